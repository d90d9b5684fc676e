//! The bowl: tiers of seats around the pitch, what is under and above them. Cut into sectors along the rounded
//! rectangle of the pitch's surround.

use crate::material::{Mat, Tint, WHITE, shade};
use crate::mesh::{Builder, Frame, face};
use crate::rng::Rng;
use crate::solid::{lathe, rod, tube};
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;

/// Sectors around.
pub const SECTORS: u32 = 96;
/// Half the inner rectangle's straight sides and its corners' radius, metres.
const HALF: DVec2 = DVec2::new(43.0, 26.0);
const CORNER: f64 = 21.0;
/// Metres from row to row.
const DEPTH: f64 = 0.82;
/// The tiers: rows, distance of the first row from the inner line, its height, rise of a row, color.
const TIERS: [Tier; 2] =
    [Tier { rows: 24, out: 0.0, base: 1.2, rise: 0.36 }, Tier { rows: 26, out: 17.0, base: 13.5, rise: 0.52 }];
/// Distance of the outer wall from the inner line, metres.
const WALL: f64 = 44.0;
/// Height of the roof's inner edge, metres.
const ROOF: f64 = 34.0;
/// How much detail seats can have; 0: a bench a row.
pub const DETAILS: u32 = 4;

struct Tier {
    rows: u32,
    out: f64,
    base: f64,
    rise: f64,
}

/// The point of the line `out` metres outside the inner rectangle, and the direction outward there, at `t` in [0, 1)
/// around.
fn line(t: f64, out: f64) -> (DVec3, DVec3) {
    // The division follows the inner line, so that rows are parallel.
    let arc = FRAC_PI_2 * CORNER;
    let total = 4.0 * (HALF.x + HALF.y + arc);
    let mut s = t.rem_euclid(1.0) * total;
    let radius = CORNER + out;
    for (k, (along, half)) in
        [(HALF.x, HALF.y), (HALF.y, HALF.x), (HALF.x, HALF.y), (HALF.y, HALF.x)].into_iter().enumerate()
    {
        let (sin, cos) = [(0.0, 1.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0)][k];
        // Outward and onward at side k: +z first, then +x, −z, −x.
        let (n, d) = (DVec3::new(sin, 0.0, cos), DVec3::new(cos, 0.0, -sin));
        if s < 2.0 * along {
            return (n * (half + radius) + d * (s - along), n);
        }
        s -= 2.0 * along;
        if s < arc || k == 3 {
            let (sa, ca) = (s / CORNER).sin_cos();
            let out = n * ca + d * sa;
            return (n * half + d * along + out * radius, out);
        }
        s -= arc;
    }
    (DVec3::ZERO, DVec3::Z)
}

/// A frame at `t` around and `out` metres outside: n toward the pitch, u to the right of one who looks at the stand.
fn frame(t: f64, out: f64, y: f64) -> Frame {
    let (p, outward) = line(t, out);
    let n = -outward;
    Frame { o: p + DVec3::Y * y, u: DVec3::Y.cross(n), v: DVec3::Y, n }
}

/// A wall or floor between two lines around: from `t0` to `t1` in `count` pieces; the first line is the lower or inner
/// one.
fn strip(b: &mut Builder, m: Mat, tint: Tint, [t0, t1]: [f64; 2], count: u32, [a, c]: [[f64; 2]; 2]) {
    let at = |k: u32, [out, y]: [f64; 2]| line(t0 + (t1 - t0) * f64::from(k) / f64::from(count), out).0 + DVec3::Y * y;
    for k in 0..count {
        // Counter-clockwise as seen from the pitch or from above.
        b.fan(m, tint, &[at(k + 1, a), at(k, a), at(k, c), at(k + 1, c)]);
    }
}

/// Sector `sector` with seats of `detail`.
pub fn sector(seed: u64, sector: u32, detail: u32) -> Builder {
    let mut b = Builder::smooth();
    let rng = &mut Rng::new(seed, &[51, i64::from(sector)]);
    let t = [sector, sector + 1].map(|k| f64::from(k) / f64::from(SECTORS));
    let pieces = 2 + 2 * detail.min(2);
    for (k, tier) in TIERS.iter().enumerate() {
        stand(&mut b, rng, t, pieces, tier, k, detail);
    }
    walls(&mut b, t, pieces, detail);
    roof(&mut b, t, pieces, sector, detail);
    if sector % 24 == 12 {
        floodlight(&mut b, &frame(t[0], 36.0, ROOF + 6.0));
    }
    if detail > 0 {
        boards(&mut b, rng, t);
    }
    b
}

fn stand(b: &mut Builder, rng: &mut Rng, t: [f64; 2], pieces: u32, tier: &Tier, number: usize, detail: u32) {
    let blocks: [Tint; 3] = [[0.05, 0.13, 0.42], [0.55, 0.05, 0.04], [0.8, 0.8, 0.78]];
    let main = blocks[number];
    let concrete = shade([0.72, 0.71, 0.69], rng.range(0.9, 1.0));
    let stair = 0.6 / (t[1] - t[0]) / 340.0;
    for row in 0..tier.rows {
        let (out, y) = (tier.out + DEPTH * f64::from(row), tier.base + tier.rise * f64::from(row));
        strip(b, Mat::Concrete, shade(concrete, 0.85), t, pieces, [[out, y - tier.rise], [out, y]]);
        strip(b, Mat::Concrete, concrete, t, pieces, [[out, y], [out + DEPTH, y]]);
        if detail == 0 {
            strip(b, Mat::Paint, main, t, 2, [[out + 0.45, y + 0.42], [out + 0.75, y + 0.45]]);
            continue;
        }
        // Letters and stripes of another colour run through the blocks.
        let length = (line(t[1], out).0 - line(t[0], out).0).length() * 1.01;
        let count = ((length - 1.1) / 0.52).floor().max(1.0);
        for k in 0..count as u32 {
            let s = stair + (1.0 - stair) * (f64::from(k) + 0.5) / count;
            let place = frame(t[0] + (t[1] - t[0]) * s, out + 0.55, y);
            let stripe = (row + number as u32 * 3) % 12 == 5 || rng.chance(0.012);
            let tint = shade(if stripe { blocks[2] } else { main }, rng.range(0.85, 1.0));
            seat(b, &place, tint, detail);
        }
        // The steps between blocks.
        for half in 0..2 {
            let f = frame(t[0] + (t[1] - t[0]) * 0.5 * stair, out + 0.41 * f64::from(half), y);
            let rise = 0.5 * tier.rise * f64::from(half);
            b.cuboid(
                &f,
                Mat::Concrete,
                shade(concrete, 1.1),
                [-0.5, 0.5],
                [0.0, rise + 0.02],
                [-0.41, 0.0],
                face::STANDING,
            );
        }
        if detail > 1 && row % 3 == 1 {
            let f = frame(t[0] + (t[1] - t[0]) * 0.5 * stair, out + 0.4, y);
            for u in [-0.2, 0.2] {
                rod(b, Mat::Steel, WHITE, f.at(u, 0.0, 0.0), f.at(u, 0.95, 0.0), 0.02);
            }
            rod(b, Mat::Steel, WHITE, f.at(-0.25, 0.95, 0.0), f.at(0.25, 0.95, 0.0), 0.0195);
        }
    }
    // The parapet and its rail.
    let (out, y) = (tier.out - 0.05, tier.base);
    strip(b, Mat::Concrete, shade(concrete, 0.9), t, pieces, [[out, y - 1.2], [out, y + 0.75]]);
    strip(b, Mat::Concrete, concrete, t, pieces, [[out, y + 0.75], [out + 0.2, y + 0.75]]);
    strip(b, Mat::Concrete, shade(concrete, 0.9), [t[1], t[0]], pieces, [[out + 0.2, y], [out + 0.2, y + 0.75]]);
    if detail > 0 {
        let [a, c] = t.map(|t| line(t, out + 0.1).0 + DVec3::Y * (y + 1.0));
        tube(b, Mat::Steel, WHITE, a, c, 0.025);
    }
    // The underside of the upper tier.
    if number > 0 {
        let (last, high) = (out + DEPTH * f64::from(tier.rows), y + tier.rise * f64::from(tier.rows));
        strip(b, Mat::Concrete, shade(concrete, 0.7), [t[1], t[0]], pieces, [[out, y - 1.2], [last, high - 1.6]]);
    }
}

/// A seat at `f`, which faces the pitch; the floor is at v = 0.
fn seat(b: &mut Builder, f: &Frame, tint: Tint, detail: u32) {
    let (half, dark) = (0.21, shade(tint, 0.8));
    if detail == 1 {
        b.cuboid(f, Mat::Paint, tint, [-half, half], [0.4, 0.45], [-0.2, 0.2], face::TOP | face::FRONT);
        b.cuboid(f, Mat::Paint, dark, [-half, half], [0.45, 0.82], [-0.2, -0.16], face::FRONT | face::TOP);
        return;
    }
    // A moulded shell: hollow in the seat, round at the back.
    let division = if detail == 2 { [4, 6] } else { [10, 18] };
    let profile = |s: f64| -> [f64; 2] {
        // From the front edge back and up.
        let seat = (s / 0.5).min(1.0);
        let back = ((s - 0.5) / 0.5).max(0.0);
        let bend = (0.5 * (1.0 - (2.0 * s - 1.0).abs() * 3.0).max(0.0)).powi(2) * 0.12;
        [0.22 - 0.4 * seat - 0.07 * back + bend, 0.45 - 0.03 * (seat * 3.1).sin() + 0.4 * back + bend]
    };
    for (side, tone) in [(1.0, tint), (-1.0, dark)] {
        b.lattice(Mat::Paint, division[1] + 1, division[0] + 1, |row, column| {
            let s = row as f64 / division[1] as f64;
            let c = 2.0 * column as f64 / division[0] as f64 - 1.0;
            let hollow = 0.025 * (c * c - 0.4);
            let e = 1e-3;
            let ([w0, v0], [w1, v1], [w, v]) = (profile((s - e).max(0.0)), profile((s + e).min(1.0)), profile(s));
            let n = (f.v * (w0 - w1) + f.n * (v1 - v0)).normalize_or(f.v);
            let u = c * half * (1.0 - 0.12 * (s - 0.6).max(0.0) / 0.4) * side;
            (f.at(u, v, w) + n * (hollow - 0.006 * (1.0 - side)), n * side, tone)
        });
    }
    for u in [-0.12, 0.12] {
        let foot = f.at(u, 0.0, -0.12);
        b.tube(Mat::Steel, [0.4; 3], [foot, f.at(u, 0.42, -0.08)], [0.018; 2], if detail == 2 { 4 } else { 8 }, false);
    }
    if detail > 2 {
        let plate = f.moved(0.0, 0.78, -0.2);
        b.cuboid(&plate, Mat::Paint, [0.85; 3], [-0.035, 0.035], [-0.02, 0.02], [-0.06, -0.055], face::ALL);
        for u in [-0.12, 0.12] {
            lathe(b, Mat::Steel, [0.5; 3], f.at(u, 0.0, -0.12), f.v, &[[0.05, 0.0], [0.05, 0.012], [0.0, 0.012]], 10);
        }
        rod(b, Mat::Steel, [0.45; 3], f.at(-0.2, 0.4, -0.06), f.at(0.2, 0.4, -0.06), 0.014);
    }
}

fn walls(b: &mut Builder, t: [f64; 2], pieces: u32, detail: u32) {
    let grey = [0.66, 0.67, 0.68];
    // Concourse floors, and the outer wall of fins and glass; it faces outward.
    let back = [t[1], t[0]];
    strip(b, Mat::Concrete, shade(grey, 0.9), t, pieces, [[19.6, 9.6], [WALL, 9.6]]);
    strip(b, Mat::Concrete, shade(grey, 0.9), back, pieces, [[19.6, 9.4], [WALL, 9.4]]);
    strip(b, Mat::Concrete, grey, back, pieces, [[WALL, 0.0], [WALL, 4.0]]);
    strip(b, Mat::Glass, WHITE, back, pieces, [[WALL, 4.0], [WALL, 24.0]]);
    strip(b, Mat::Paint, [0.75, 0.76, 0.78], back, pieces, [[WALL, 24.0], [WALL, 28.0]]);
    strip(b, Mat::Concrete, shade(grey, 0.6), t, pieces, [[WALL - 0.3, 0.0], [WALL - 0.3, 28.0]]);
    let fins = [1, 4, 8, 12, 12][detail as usize];
    for k in 0..fins {
        let mut f = frame(t[0] + (t[1] - t[0]) * (f64::from(k) + 0.5) / f64::from(fins), WALL, 0.0);
        (f.u, f.n) = (-f.u, -f.n);
        b.cuboid(&f, Mat::Paint, [0.82, 0.83, 0.84], [-0.09, 0.09], [3.0, 29.0], [0.0, 0.9], face::ALL);
    }
    // A column and a raking beam under the upper tier.
    let f = frame(t[0], 30.0, 0.0);
    b.cuboid(&f, Mat::Concrete, grey, [-0.5, 0.5], [0.0, 18.5], [-0.6, 0.6], face::UPRIGHT | face::BACK);
}

/// A truss from the outer wall toward the pitch, purlins, and the skin on it.
fn roof(b: &mut Builder, t: [f64; 2], pieces: u32, sector: u32, detail: u32) {
    let [inner, outer] = [2.0, WALL + 3.0];
    let top = |out: f64| ROOF - 3.0 * ((out - inner) / (outer - inner)).powi(2);
    let bays = 10;
    let station = |k: u32| inner + (outer - inner) * f64::from(k) / f64::from(bays);
    for k in 0..bays {
        let ([a, c], tint) =
            ([station(k), station(k + 1)], shade([0.5, 0.52, 0.54], if k % 2 == 0 { 1.0 } else { 0.9 }));
        let clear = k < 2;
        let (m, tint) = if clear { (Mat::TowerGlass, [1.0; 3]) } else { (Mat::Paint, tint) };
        strip(b, m, tint, t, pieces, [[a, top(a) + 0.6], [c, top(c) + 0.6]]);
        strip(b, m, shade(tint, 0.8), [t[1], t[0]], pieces, [[a, top(a) + 0.5], [c, top(c) + 0.5]]);
    }
    strip(b, Mat::Paint, [0.7; 3], t, pieces, [[inner, top(inner) + 0.2], [inner, top(inner) + 0.6]]);
    let point = |out: f64, down: f64| line(t[0], out).0 + DVec3::Y * (top(out) - down);
    let depth = |k: u32| 0.8 + 3.4 * f64::from(k) / f64::from(bays);
    let white = [0.88, 0.88, 0.87];
    let wide = |k: u32| 0.11 + 0.01 * f64::from(k);
    for k in 0..bays {
        let (a, c) = (station(k), station(k + 1));
        rod(b, Mat::Paint, white, point(a, 0.0), point(c, 0.0), wide(k));
        rod(b, Mat::Paint, white, point(a, depth(k)), point(c, depth(k + 1)), wide(k));
        let (low, high) =
            if k % 2 == 0 { (point(a, depth(k)), point(c, 0.0)) } else { (point(a, 0.0), point(c, depth(k + 1))) };
        rod(b, Mat::Paint, white, low, high, 0.07);
        rod(b, Mat::Paint, white, point(c, 0.0), point(c, depth(k + 1)), 0.075);
    }
    for k in 0..=bays {
        // Purlins to the next truss, with lacing where there is detail.
        let out = station(k);
        let [a, c] = t.map(|t| line(t, out).0 + DVec3::Y * (top(out) + 0.3));
        rod(b, Mat::Paint, white, a, c, 0.08);
        if detail > 0 && k % 2 == 1 {
            let low = [a, c].map(|p| p - DVec3::Y * 0.9);
            rod(b, Mat::Paint, white, low[0], low[1], 0.05);
            for s in 0..8 {
                let at = |ends: [DVec3; 2], s: u32| ends[0] + (ends[1] - ends[0]) * f64::from(s) / 8.0;
                let ends = if s % 2 == 0 { [at([a, c], s), at(low, s + 1)] } else { [at(low, s), at([a, c], s + 1)] };
                rod(b, Mat::Paint, white, ends[0], ends[1], 0.03);
            }
        }
    }
    // Masts outside, with ties.
    if sector.is_multiple_of(4) {
        let foot = line(t[0], WALL + 5.0).0;
        lathe(b, Mat::Paint, white, foot, DVec3::Y, &[[0.55, 0.0], [0.55, 30.0], [0.25, 46.0], [0.0, 46.5]], 20);
        for out in [8.0, 20.0, 32.0] {
            rod(
                b,
                Mat::Steel,
                [0.8; 3],
                foot + DVec3::Y * 45.0,
                line(t[0], out).0 + DVec3::Y * (top(out) + 0.3),
                0.045,
            );
        }
    }
    // Lamps along the inner edge.
    let lamps = 2 + 2 * detail;
    for k in 0..lamps {
        let f = frame(t[0] + (t[1] - t[0]) * (f64::from(k) + 0.5) / f64::from(lamps), inner + 0.6, top(inner) - 0.3);
        b.cuboid(&f, Mat::Paint, [0.2; 3], [-0.3, 0.3], [-0.25, 0.25], [-0.2, 0.1], face::ALL);
        b.panel(&f, Mat::Paint, [1.0, 1.0, 0.93], [-0.26, 0.26], [-0.21, 0.21], 0.101);
    }
}

/// A frame full of lamps on the roof.
fn floodlight(b: &mut Builder, f: &Frame) {
    for u in [-4.0, 4.0] {
        rod(b, Mat::Paint, [0.8; 3], f.at(u, -6.5, -1.0), f.at(u, 4.2, 0.0), 0.16);
    }
    for row in 0..5 {
        let v = 0.9 * f64::from(row);
        rod(b, Mat::Paint, [0.8; 3], f.at(-4.5, v, 0.0), f.at(4.5, v, 0.0), 0.06);
        for k in 0..11 {
            let o = f.at(-4.2 + 0.84 * f64::from(k), v, 0.12);
            let axis = (f.n * 0.85 - f.v * 0.53).normalize();
            let bowl = [[0.0, -0.12], [0.16, -0.12], [0.36, 0.16], [0.36, 0.2], [0.32, 0.19]];
            lathe(b, Mat::Steel, WHITE, o, axis, &bowl, 20);
            lathe(b, Mat::Paint, [1.0, 1.0, 0.95], o, axis, &[[0.32, 0.17], [0.0, 0.17]], 20);
        }
    }
}

/// Boards around the pitch.
fn boards(b: &mut Builder, rng: &mut Rng, t: [f64; 2]) {
    let tint = rng.pick(&[[0.7, 0.08, 0.05], [0.08, 0.3, 0.6], [0.85, 0.75, 0.1], [0.9, 0.9, 0.9], [0.1, 0.45, 0.2]]);
    let out = -4.5;
    let a = frame(0.5 * (t[0] + t[1]), out, 0.0);
    let half = 0.47 * (line(t[1], out).0 - line(t[0], out).0).length();
    b.cuboid(&a, Mat::Paint, tint, [-half, half], [0.05, 1.0], [-0.06, 0.0], face::ALL);
    let mut u = -0.8 * half;
    while u < 0.8 * half {
        // Blocks in place of letters.
        let (wide, high) = (rng.range(0.1, 0.3), rng.range(0.3, 0.55));
        b.panel(&a, Mat::Paint, shade([1.0; 3], 0.95), [u, u + wide], [0.25, 0.25 + high], 0.004);
        u += wide + 0.12;
    }
}
