//! The ground of a cell: half of the four streets around it, markings, kerb, pavement; and the country outside the
//! city.

use super::layout::{CORNER, Cell, KERB, Layout, PAVEMENT, Rect};
use crate::material::{Mat, Tint, WHITE, shade};
use crate::mesh::{Builder, Frame};
use crate::rng::Rng;
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;

/// Height of markings above the asphalt, metres.
const PAINT: f64 = 0.006;
/// Segments of a kerb's corner.
const ARC: u32 = 5;
/// Width of kerb stones, metres.
const STONE: f64 = 0.18;

/// A grid of upward quads over `rect` at height `y`, each at most about `step` wide, tints between `dark` and 1.
pub fn ground(b: &mut Builder, rng: &mut Rng, m: Mat, rect: Rect, y: f64, step: f64, dark: f64) {
    let count = |length: f64| (length / step).round().max(1.0);
    let (nx, nz) = (count(rect.width()), count(rect.depth()));
    for i in 0..nx as u32 {
        for j in 0..nz as u32 {
            let part = |k: u32, n: f64| if f64::from(k) == n { 1.0 } else { f64::from(k) / n };
            let (a, c) = (rect.at(part(i, nx), part(j, nz)), rect.at(part(i + 1, nx), part(j + 1, nz)));
            let tint = shade(WHITE, rng.range(dark, 1.0));
            flat(b, m, tint, Rect { x0: a.x, x1: c.x, z0: a.y, z1: c.y }, y);
        }
    }
}

/// One upward quad.
pub fn flat(b: &mut Builder, m: Mat, tint: Tint, rect: Rect, y: f64) {
    b.fan(m, tint, &rect.polygon().map(|p| DVec3::new(p.x, y, p.y)));
}

/// One side of a cell seen from its street: u runs along the traffic of this half of the street, 0 at the cell's
/// corner; w runs from the kerb-side block toward the centre line, 0 at the centre line, so that the kerb is at w =
/// −half.
struct Side {
    frame: Frame,
    length: f64,
    half: f64,
    /// Half widths of the streets at the two ends.
    ends: [f64; 2],
}

impl Side {
    /// Side `k` in the order of [`super::layout::SOUTH`].
    fn new(cell: &Cell, k: usize) -> Self {
        let corners = cell.rect.polygon();
        // Traffic keeps right: it runs clockwise around a block, against the order of the walls.
        let (from, to) = (corners[(k + 1) % 4], corners[k]);
        let length = (to - from).length();
        let d = (to - from) / length;
        let out = DVec2::new(d.y, -d.x);
        let frame = Frame {
            o: DVec3::new(from.x, 0.0, from.y),
            u: DVec3::new(d.x, 0.0, d.y),
            v: DVec3::new(out.x, 0.0, out.y),
            n: DVec3::Y,
        };
        Self { frame, length, half: cell.half[k], ends: [cell.half[(k + 1) % 4], cell.half[(k + 3) % 4]] }
    }

    /// A rectangle painted on the road: along the street and out from the kerb toward the centre.
    fn paint(&self, b: &mut Builder, tint: Tint, u: [f64; 2], w: [f64; 2]) {
        b.panel(&self.frame, Mat::Marking, tint, u, w, PAINT);
    }
}

/// The points of the kerb's arc at corner `k` of a cell, `inset` metres behind the kerb line, counter-clockwise around
/// the block.
fn arc(cell: &Cell, k: usize, inset: f64) -> Vec<DVec2> {
    let block = cell.block();
    let corner = block.polygon()[k];
    let toward = |v: f64, low: f64| if v == low { 1.0 } else { -1.0 };
    let center = corner + DVec2::new(toward(corner.x, block.x0), toward(corner.y, block.z0)) * CORNER;
    let radius = CORNER - inset;
    // Corner 0 is (x0, z1): its arc starts facing −x and ends facing +z.
    let start = [2.0, 1.0, 0.0, 3.0][k] * FRAC_PI_2;
    (0..=ARC)
        .map(|s| {
            // Exact directions at the ends, so that arcs and straight sides share their vertices.
            let (sin, cos) = match s {
                0 => unit(start),
                ARC => unit(start - FRAC_PI_2),
                _ => (start - f64::from(s) / f64::from(ARC) * FRAC_PI_2).sin_cos(),
            };
            center + DVec2::new(cos, sin) * radius
        })
        .collect()
}

/// Sine and cosine of a multiple of a quarter turn.
fn unit(angle: f64) -> (f64, f64) {
    let (s, c) = angle.sin_cos();
    (s.round(), c.round())
}

/// The roadway, kerb and pavement of a cell.
pub fn cell_ground(b: &mut Builder, rng: &mut Rng, cell: &Cell) {
    roadway(b, rng, cell);
    kerb_and_pavement(b, rng, cell);
    for k in 0..4 {
        markings(b, rng, &Side::new(cell, k), k);
    }
}

fn roadway(b: &mut Builder, rng: &mut Rng, cell: &Cell) {
    let (outer, block) = (cell.rect.polygon(), cell.block());
    for (k, &corner) in outer.iter().enumerate() {
        let side = Side::new(cell, k);
        let (u0, u1) = (side.ends[0] + CORNER, side.length - side.ends[1] - CORNER);
        let count = ((u1 - u0) / 6.0).round();
        for s in 0..count as u32 {
            let u = [f64::from(s), f64::from(s + 1)].map(|s| u0 + (u1 - u0) * s / count);
            let tint = shade(WHITE, rng.range(0.8, 1.0));
            b.panel(&side.frame, Mat::Asphalt, tint, u, [-side.half, 0.0], 0.0);
        }
        let mut points = vec![corner];
        let ring = arc(cell, k, 0.0);
        // The two ends of the corner piece on the centre lines, beside the ends of the arc.
        let (first, last) = (ring[0], ring[ring.len() - 1]);
        let on_line = |p: DVec2| {
            let near_x = (p.x - block.x0).abs() < 1e-9 || (p.x - block.x1).abs() < 1e-9;
            if near_x { DVec2::new(corner.x, p.y) } else { DVec2::new(p.x, corner.y) }
        };
        points.push(on_line(last));
        points.extend(ring.iter().rev());
        points.push(on_line(first));
        points.dedup();
        let lifted: Vec<DVec3> = points.iter().map(|p| DVec3::new(p.x, 0.0, p.y)).collect();
        b.fan(Mat::Asphalt, shade(WHITE, rng.range(0.87, 0.93)), &lifted);
    }
    for _ in 0..3 {
        manhole(b, rng, cell);
    }
}

fn manhole(b: &mut Builder, rng: &mut Rng, cell: &Cell) {
    let side = Side::new(cell, rng.int(0, 3) as usize);
    let (u, w) = (rng.range(16.0, side.length - 16.0), -rng.range(1.2, 2.6));
    let ring = |r: f64, y: f64| -> Vec<DVec3> {
        (0..12)
            .map(|k| {
                let (s, c) = (f64::from(k) * std::f64::consts::TAU / 12.0).sin_cos();
                side.frame.at(u + c * r, w + s * r, y)
            })
            .collect()
    };
    b.fan(Mat::Metal, [0.25; 3], &ring(0.36, 0.004));
    b.fan(Mat::Metal, [0.4; 3], &ring(0.29, 0.009));
}

fn kerb_and_pavement(b: &mut Builder, rng: &mut Rng, cell: &Cell) {
    let lots = cell.lots().polygon();
    let up = |p: DVec2, y: f64| DVec3::new(p.x, y, p.y);
    for k in 0..4 {
        let (line, behind) = (arc(cell, k, 0.0), arc(cell, k, STONE));
        let tint = shade(WHITE, rng.range(0.85, 1.0));
        for s in 0..ARC as usize {
            stone(b, tint, [line[s], line[s + 1]], [behind[s], behind[s + 1]]);
        }
        // The pavement's corner is convex: the lots' corner, out to the straight sides, around the arc.
        let (first, last) = (behind[0], behind[behind.len() - 1]);
        let lot = lots[k];
        let beside = |p: DVec2, arc_end: DVec2| {
            let along_x = (arc_end.x - lot.x).abs() < (arc_end.y - lot.y).abs();
            if along_x { DVec2::new(p.x, arc_end.y) } else { DVec2::new(arc_end.x, p.y) }
        };
        let mut points = vec![up(lot, KERB), up(beside(lot, first), KERB)];
        points.extend(behind.iter().map(|p| up(*p, KERB)));
        points.push(up(beside(lot, last), KERB));
        b.fan(Mat::Paving, shade(WHITE, rng.range(0.86, 0.98)), &points);

        let next = arc(cell, (k + 1) % 4, 0.0);
        let next_behind = arc(cell, (k + 1) % 4, STONE);
        let straight = |t: f64, a: DVec2, c: DVec2| if t == 1.0 { c } else { a + (c - a) * t };
        let (a, c) = (line[ARC as usize], next[0]);
        let (ab, cb) = (behind[ARC as usize], next_behind[0]);
        let count = ((c - a).length() / 2.6).round();
        for s in 0..count as u32 {
            let (t0, t1) = (f64::from(s) / count, f64::from(s + 1) / count);
            let tint = shade(WHITE, rng.range(0.8, 1.0));
            stone(b, tint, [straight(t0, a, c), straight(t1, a, c)], [straight(t0, ab, cb), straight(t1, ab, cb)]);
        }
        // Slabs in two rows between the kerb stones and the lots.
        let (d, lot_next) = ((c - a).normalize(), lots[(k + 1) % 4]);
        let inward = DVec2::new(d.y, -d.x);
        let width = PAVEMENT - STONE;
        let (la, lb) = (lot, lot_next);
        let length = (lb - la).length();
        let count = (length / 2.4).round();
        for s in 0..count as u32 {
            let t = [f64::from(s), f64::from(s + 1)].map(|s| straight(s / count, la, lb));
            for row in [[width, 0.42 * width], [0.42 * width, 0.0]] {
                let tint = shade(WHITE, rng.range(0.84, 1.0));
                let quad =
                    [t[0] - inward * row[0], t[1] - inward * row[0], t[1] - inward * row[1], t[0] - inward * row[1]];
                b.fan(Mat::Paving, tint, &quad.map(|p| up(p, KERB)));
            }
        }
    }
}

/// A kerb stone from the kerb line to the line behind it.
fn stone(b: &mut Builder, tint: Tint, line: [DVec2; 2], behind: [DVec2; 2]) {
    let up = |p: DVec2, y: f64| DVec3::new(p.x, y, p.y);
    b.graded(
        Mat::Kerb,
        shade(tint, 0.7),
        tint,
        [up(line[0], 0.0), up(line[1], 0.0), up(line[1], KERB), up(line[0], KERB)],
    );
    b.fan(Mat::Kerb, tint, &[up(line[0], KERB), up(line[1], KERB), up(behind[1], KERB), up(behind[0], KERB)]);
}

fn markings(b: &mut Builder, rng: &mut Rng, side: &Side, k: usize) {
    let worn = |rng: &mut Rng| shade(WHITE, rng.range(0.72, 1.0));
    let (start, end) = (side.ends[0] + CORNER, side.length - side.ends[1] - CORNER);
    // Zebra crossings at both ends, each half drawn by its own cell.
    for u in [[start + 0.6, start + 3.2], [end - 3.2, end - 0.6]] {
        let mut w = -0.25;
        while w > -side.half + 0.6 {
            let tint = worn(rng);
            side.paint(b, tint, u, [w - 0.5, w]);
            w -= 1.0;
        }
    }
    let lanes = lanes(side.half);
    let (from, to) = (start + 4.2, end - 4.2);
    // The traffic of this half stops before the crossing at its end.
    let tint = worn(rng);
    side.paint(b, tint, [to - 0.4, to], [-lanes.parking, -0.15]);
    let tint = worn(rng);
    side.paint(b, tint, [from, to - 0.5], [-lanes.parking - 0.06, -lanes.parking + 0.06]);
    if lanes.centers.len() > 1 {
        let between = -0.5 * (lanes.centers[0] + lanes.centers[1]);
        dashes(from, to - 0.5, |u| {
            let tint = worn(rng);
            side.paint(b, tint, u, [between - 0.06, between + 0.06]);
        });
    }
    // The centre line belongs to the cell at its greater side.
    if k == super::layout::NORTH || k == super::layout::WEST {
        let yellow = [1.0, 0.72, 0.18];
        if lanes.centers.len() > 1 {
            for w in [[-0.2, -0.08], [0.08, 0.2]] {
                side.paint(b, yellow, [from, to], w);
            }
        } else {
            dashes(from, to, |u| side.paint(b, shade(yellow, 0.92), u, [-0.06, 0.06]));
        }
    }
    // An arrow in each lane before the stop line.
    for &center in &lanes.centers {
        let tint = worn(rng);
        side.paint(b, tint, [to - 7.0, to - 4.6], [-center - 0.08, -center + 0.08]);
        let tip = [
            side.frame.at(to - 3.2, -center, PAINT),
            side.frame.at(to - 4.6, -center + 0.38, PAINT),
            side.frame.at(to - 4.6, -center - 0.38, PAINT),
        ];
        b.fan(Mat::Marking, tint, &tip);
    }
}

/// Calls `paint` for dashes of 2 m with gaps of 3 m.
fn dashes(from: f64, to: f64, mut paint: impl FnMut([f64; 2])) {
    let mut u = from;
    while u + 2.0 <= to {
        paint([u, u + 2.0]);
        u += 5.0;
    }
}

/// The lanes of one half of a street.
pub struct Lanes {
    /// Distances of the lanes' centres from the street's centre line.
    pub centers: Vec<f64>,
    /// Distance of the edge of the parking lane from the street's centre line.
    pub parking: f64,
}

/// The lanes of a street of half width `half`.
pub fn lanes(half: f64) -> Lanes {
    let parking = half - 2.15;
    let centers = if half > 6.5 { vec![1.75, 4.35] } else { vec![1.85] };
    Lanes { centers, parking }
}

/// A cell of the outermost ring on which nothing is built: streets and grass in few triangles.
pub fn meadow(b: &mut Builder, cell: &Cell) {
    let (r, block) = (cell.rect, cell.block());
    for (x0, x1, column) in [(r.x0, block.x0, 0), (block.x0, block.x1, 1), (block.x1, r.x1, 2)] {
        for (z0, z1, row) in [(r.z0, block.z0, 0), (block.z0, block.z1, 1), (block.z1, r.z1, 2)] {
            let inside = column == 1 && row == 1;
            let m = if inside { Mat::Grass } else { Mat::Asphalt };
            flat(b, m, shade(WHITE, 0.9), Rect { x0, x1, z0, z1 }, 0.0);
        }
    }
}

/// The country around a city of the rings 0..=`ring`: the outer halves of the last streets, then fields.
pub fn country(b: &mut Builder, rng: &mut Rng, layout: &Layout, ring: i64) {
    const STEPS: [f64; 5] = [22.0, 70.0, 150.0, 260.0, 400.0];
    let axis = |line: &dyn Fn(i64) -> f64, half: &dyn Fn(i64) -> f64| {
        let (low, high) = (-ring - 1, ring + 1);
        let (first, last) = (line(low) - half(low), line(high) + half(high));
        let mut all: Vec<f64> = STEPS.iter().rev().map(|s| first - s).collect();
        all.push(first);
        all.extend((low..=high).map(line));
        all.push(last);
        all.extend(STEPS.iter().map(|s| last + s));
        all
    };
    let xs = axis(&|k| layout.x(k), &|k| layout.half_x(k));
    let zs = axis(&|k| layout.z(k), &|k| layout.half_z(k));
    // Index of the first coordinate of the half street, and of the city itself.
    let (street, city) = (STEPS.len(), STEPS.len() + 1);
    let within = |k: usize, count: usize, first: usize| k >= first && k + 1 < count - first;
    for i in 0..xs.len() - 1 {
        for j in 0..zs.len() - 1 {
            let inside = |first: usize| within(i, xs.len(), first) && within(j, zs.len(), first);
            let rect = Rect { x0: xs[i], x1: xs[i + 1], z0: zs[j], z1: zs[j + 1] };
            if inside(city) {
                continue;
            } else if inside(street) {
                flat(b, Mat::Asphalt, shade(WHITE, 0.9), rect, 0.0);
            } else {
                let crop = rng.unit();
                let tint: Tint =
                    if crop < 0.2 { [1.0, 0.82, 0.62] } else { shade([0.9, 1.0, 0.8], rng.range(0.7, 1.0)) };
                flat(b, Mat::Grass, tint, rect, 0.0);
            }
        }
    }
}

/// Things that stand beside the street: calls `place` with a frame at points along the pavement, `back` metres behind
/// the kerb, facing the street, every `step` metres; the second argument tells the side.
pub fn along_kerb(cell: &Cell, back: f64, step: f64, mut place: impl FnMut(Frame, usize)) {
    let block = cell.block();
    let corners = block.polygon();
    for k in 0..4 {
        let (wall, length) = Frame::wall(corners[k], corners[(k + 1) % 4], KERB);
        let margin = CORNER + 6.0;
        let count = ((length - 2.0 * margin) / step).floor().max(0.0);
        let slack = length - 2.0 * margin - count * step;
        for s in 0..=count as u32 {
            place(wall.moved(margin + 0.5 * slack + f64::from(s) * step, 0.0, -back), k);
        }
    }
}

/// Frames on the road: at `w` metres from the centre line of the streets around the cell, driving with the traffic, `u`
/// as fraction of the stretch between the crossings; facing the direction of travel.
pub fn on_road(cell: &Cell, k: usize, u: f64, w: f64) -> Frame {
    let side = Side::new(cell, k);
    let (from, to) = (side.ends[0] + CORNER + 7.5, side.length - side.ends[1] - CORNER - 7.5);
    let o = side.frame.at(from + (to - from) * u, -w, 0.0);
    let n = side.frame.u;
    Frame { o, u: DVec3::Y.cross(n), v: DVec3::Y, n }
}

/// Length of the stretch that [`on_road`] divides, and half the street's width.
pub fn road_stretch(cell: &Cell, k: usize) -> (f64, f64) {
    let side = Side::new(cell, k);
    (side.length - side.ends[0] - side.ends[1] - 2.0 * CORNER - 15.0, side.half)
}

/// The pavement beside the stop line at the end of side `k`: n toward the street, u against the traffic.
pub fn beside_stop_line(cell: &Cell, k: usize) -> Frame {
    let side = Side::new(cell, k);
    let o = side.frame.at(side.length - side.ends[1] - CORNER - 4.4, -side.half - 0.5, KERB);
    let n = side.frame.v;
    Frame { o, u: DVec3::Y.cross(n), v: DVec3::Y, n }
}
