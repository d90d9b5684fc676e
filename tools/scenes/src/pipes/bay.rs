//! A bay of the plant: its frame and floors, the ways around it, its equipment, and the pipes in what room is left.

use super::fitting::{Line, Look, flange, line};
use super::plan::{AISLE, Bay, HEIGHT, PITCH, Use};
use super::route::{CELL, FLOOR, Grid};
use super::steel::{self, STEEL};
use super::vessel;
use crate::material::{Mat, WHITE, shade};
use crate::mesh::{Builder, Frame, face};
use crate::pieces::Pieces;
use crate::rng::Rng;
use crate::solid::{pipe, tube};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI};

/// Width of the block between the ways, metres.
const BLOCK: f64 = PITCH - 2.0 * AISLE;

/// Builds the bay. What it has first is what a small budget leaves.
pub fn bay(site: &mut Pieces, seed: u64, bay: &Bay) {
    let mut rng = Rng::new(seed, &[31, bay.i, bay.j]);
    let levels = bay.levels;
    let size = (BLOCK / CELL).round() as i32;
    let corner = bay.corner + DVec3::new(AISLE, 0.0, AISLE);
    let mut grid = Grid::new(corner, [size, FLOOR * levels as i32, size]);
    site.piece(&mut rng, |b, rng| slab(b, rng, bay));
    frame(site, &mut rng, bay, &mut grid);
    for level in 1..levels {
        ways(site, &mut rng, bay, level);
    }
    equipment(site, &mut rng, bay, &mut grid);
    for level in 0..levels {
        mains(site, seed, bay, level);
    }
    let open = floors(site, &mut rng, bay, &grid);
    pipes(site, &mut rng, bay, &mut grid);
    clutter(site, &mut rng, bay, &open);
}

/// The concrete floor with joints, yellow lines along the ways.
fn slab(b: &mut Builder, rng: &mut Rng, bay: &Bay) {
    let f = Frame::standing(bay.corner, 0.0);
    let count = 8;
    for i in 0..count {
        for j in 0..count {
            let [u, w] =
                [i, j].map(|k| [f64::from(k) * PITCH / f64::from(count), f64::from(k + 1) * PITCH / f64::from(count)]);
            let tint = shade([0.62, 0.61, 0.58], rng.range(0.72, 1.0));
            b.fan(
                Mat::Concrete,
                tint,
                &[f.at(u[0], 0.0, w[1]), f.at(u[1], 0.0, w[1]), f.at(u[1], 0.0, w[0]), f.at(u[0], 0.0, w[0])],
            );
        }
    }
    for k in 0..4 {
        let side = bay.side(k);
        let (u, w) = ([AISLE - 0.1, PITCH - AISLE + 0.1], [-AISLE + 0.08, -AISLE + 0.2]);
        let points = [[u[0], w[1]], [u[1], w[1]], [u[1], w[0]], [u[0], w[0]]].map(|[u, w]| side.at(u, 0.004, w));
        b.fan(Mat::Marking, [0.9, 0.66, 0.1], &points);
    }
}

/// Columns, beams and braces.
fn frame(site: &mut Pieces, rng: &mut Rng, bay: &Bay, grid: &mut Grid) {
    let top = f64::from(bay.levels) * HEIGHT;
    let spots = [0.0, 0.5 * BLOCK, BLOCK];
    let in_block = |x: f64, z: f64| bay.corner + DVec3::new(AISLE + x, 0.0, AISLE + z);
    for x in spots {
        for z in spots {
            let middle = x == spots[1] && z == spots[1];
            if middle {
                continue;
            }
            // Columns stand inside the block.
            let pull = |v: f64| v.clamp(0.3, BLOCK - 0.3);
            let o = in_block(pull(x), pull(z));
            grid.take(o - DVec3::new(0.3, 0.0, 0.3), o + DVec3::new(0.3, top - 0.05, 0.3));
            site.piece(rng, |b, _| steel::column(b, o, top));
        }
    }
    for level in 1..=bay.levels {
        let y = f64::from(level) * HEIGHT - 0.04;
        for k in 0..4 {
            let side = bay.side(k).moved(AISLE, y, -AISLE - 0.3);
            site.piece(rng, |b, _| steel::beam(b, &side, BLOCK, [0.4, 0.22], STEEL));
        }
        for k in 1..4 {
            let across = Frame::standing(in_block(0.0, f64::from(k) * BLOCK / 4.0) + DVec3::Y * y, 0.0);
            site.piece(rng, |b, _| steel::beam(b, &across, BLOCK, [0.3, 0.16], STEEL));
        }
    }
    for k in 0..4 {
        for level in 0..bay.levels {
            if rng.chance(0.4) {
                let u = AISLE + if rng.chance(0.5) { 0.3 } else { 0.5 * BLOCK };
                let f = bay.side(k).moved(u, f64::from(level) * HEIGHT, -AISLE - 0.3);
                site.piece(rng, |b, _| steel::brace(b, &f, 0.5 * BLOCK - 0.3, HEIGHT));
            }
        }
    }
}

/// The bay's halves of the ways around it at `level`: grating, railing, supports, lamps beneath.
fn ways(site: &mut Pieces, rng: &mut Rng, bay: &Bay, level: u32) {
    let y = f64::from(level) * HEIGHT;
    for k in 0..4 {
        let f = bay.side(k).moved(0.0, y, 0.0);
        // The corners belong to every other side.
        let u = if k % 2 == 0 { [0.0, PITCH] } else { [AISLE, PITCH - AISLE] };
        site.piece(rng, |b, _| steel::grating(b, &f, u, [-AISLE + 0.02, -0.01]));
        for u in [[AISLE + 0.9, 0.5 * PITCH - 0.6], [0.5 * PITCH + 0.6, PITCH - AISLE - 0.9]] {
            site.piece(rng, |b, _| steel::railing(b, &f.moved(0.0, 0.0, -AISLE + 0.05), u));
        }
        for s in 0..4 {
            let u = AISLE + 0.4 + f64::from(s) * (BLOCK - 0.8) / 3.0;
            let arm = Frame { o: f.at(u, -0.07, -AISLE - 0.2), u: f.n, v: DVec3::Y, n: -f.u };
            site.piece(rng, |b, _| steel::beam(b, &arm, AISLE + 0.2, [0.18, 0.12], STEEL));
        }
        for s in [0.25, 0.75] {
            let lamp = f.moved(s * PITCH, HEIGHT - 0.75, -0.6);
            site.piece(rng, |b, _| {
                b.cuboid(&lamp, Mat::Paint, [0.95; 3], [-0.6, 0.6], [0.0, 0.06], [-0.09, 0.09], face::ALL);
                b.cuboid(&lamp, Mat::Paint, [1.0, 1.0, 0.9], [-0.56, 0.56], [-0.04, 0.0], [-0.06, 0.06], face::ALL);
                for u in [-0.5, 0.5] {
                    tube(b, Mat::Steel, [0.6; 3], lamp.at(u, 0.06, 0.0), lamp.at(u, 0.6, 0.0), 0.008);
                }
            });
        }
    }
}

/// The pipes and trays above the ways, which go on from bay to bay: those along x higher than those along z.
fn mains(site: &mut Pieces, seed: u64, bay: &Bay, level: u32) {
    for k in 0..4 {
        let f = bay.side(k);
        let along_x = f.u.x.abs() > 0.5;
        let (axis, line_number, half) = bay.half_way(k);
        let mut rng = Rng::new(seed, &[32, axis, line_number, half, i64::from(level)]);
        let floor = f64::from(level) * HEIGHT;
        let base = floor + if along_x { 4.25 } else { 3.0 };
        let mut w = -0.1 - rng.range(0.0, 0.12);
        let mut first = true;
        while w > -AISLE + 0.25 {
            if rng.chance(0.22) && w > -AISLE + 0.65 {
                // Positions are those of the whole way, so that what crosses from bay to bay is in line.
                let (y, count) = (base + rng.range(0.0, 0.4), rng.int(5, 12) as u32);
                let at = f.moved(0.0, y, w - 0.25);
                let mut own = Rng::new(seed, &[33, bay.i, bay.j, k as i64, i64::from(level)]);
                site.piece(&mut own, |b, rng| vessel::tray(b, rng, &at, PITCH, count));
                w -= 0.62;
            } else {
                let r = 0.035 + 0.16 * rng.unit().powi(2);
                let y = base + r + rng.range(0.0, 0.25);
                let look = Look::any(&mut rng);
                let ends = [f.at(0.0, y, w - r), f.at(PITCH, y, w - r)];
                let mut own = Rng::new(seed, &[34, bay.i, bay.j, k as i64, i64::from(level), (w * 1000.0) as i64]);
                site.piece(&mut own, |b, rng| {
                    line(b, rng, &ends, Line { r, bend: 1.5 * r, look, storey: f64::INFINITY });
                    if !first {
                        return;
                    }
                    for s in [0.2, 0.5, 0.8] {
                        // The beams that carry what lies along the way.
                        let arm = Frame { o: f.at(s * PITCH, base - 0.02, -AISLE - 0.3), u: f.n, v: DVec3::Y, n: -f.u };
                        steel::beam(b, &arm, AISLE + 0.3, [0.14, 0.1], STEEL);
                    }
                });
                first = false;
                w -= 2.0 * r + rng.range(0.1, 0.34);
            }
        }
    }
}

/// What the bay is for.
fn equipment(site: &mut Pieces, rng: &mut Rng, bay: &Bay, grid: &mut Grid) {
    let top = f64::from(bay.levels) * HEIGHT;
    let at = |u: f64, y: f64, w: f64| bay.corner + DVec3::new(AISLE + u * BLOCK, y, AISLE + w * BLOCK);
    let tank = |site: &mut Pieces, grid: &mut Grid, rng: &mut Rng, o: DVec3, r: f64, height: f64| {
        let wide = DVec3::new(r + 0.35, 0.0, r + 0.35);
        grid.take(o - wide, o + wide + DVec3::Y * height);
        let galleries: Vec<f64> = (1..).map(|k| HEIGHT * f64::from(k)).take_while(|y| y + 0.8 < height).collect();
        site.piece(rng, |b, rng| vessel::tank(b, rng, o, r, height, &galleries));
    };
    match bay.purpose {
        Use::Rack => {}
        Use::Tank => {
            let r = rng.range(2.6, 3.6);
            let o = at(0.5 + rng.range(-0.04, 0.04), 0.0, 0.5 + rng.range(-0.04, 0.04));
            let height = (top - 1.5).min(rng.range(11.0, 17.0));
            tank(site, grid, rng, o, r, height);
        }
        Use::Tanks => {
            for (u, w) in [(0.27, 0.27), (0.73, 0.27), (0.73, 0.73), (0.27, 0.73)] {
                let (r, height) = (rng.range(1.0, 1.75), rng.range(5.0, 10.5).min(top - 0.8));
                if rng.chance(0.85) {
                    tank(site, grid, rng, at(u, 0.0, w), r, height);
                }
            }
        }
        Use::Column => {
            for (u, w) in [(0.3, 0.35), (0.7, 0.66)] {
                let (r, height) = (rng.range(1.1, 1.7), top + rng.range(5.0, 17.0));
                tank(site, grid, rng, at(u, 0.0, w), r, height);
            }
        }
        Use::Boiler => {
            let (side, o) = (rng.range(6.5, 7.6), at(0.5, 0.0, 0.5));
            let wide = DVec3::new(0.5 * side + 0.6, 0.0, 0.5 * side + 0.6);
            grid.take(o - wide + DVec3::Y * 2.5, o + wide + DVec3::Y * top);
            site.piece(rng, |b, rng| vessel::boiler(b, rng, o, side, [3.0, top + 1.5]));
            let stack = o + DVec3::Y * (top + 1.6);
            let height = rng.range(18.0, 30.0);
            site.piece(rng, |b, _| vessel::stack(b, stack, 1.3, height));
        }
        Use::Exchangers => {
            for level in 0..bay.levels.min(3) {
                for w in [0.25, 0.5, 0.75] {
                    if rng.chance(0.75) {
                        let (r, length) = (rng.range(0.4, 0.7), rng.range(5.0, 8.5));
                        let down = r + rng.range(0.5, 1.2);
                        let o = at(0.5, f64::from(level) * HEIGHT + 0.05 + down, w);
                        let reach = DVec3::new(0.5 * length + 0.3, r + 0.1, r + 0.2);
                        grid.take(o - reach - DVec3::Y * (down - r), o + reach);
                        site.piece(rng, |b, rng| vessel::exchanger(b, rng, &Frame::standing(o, 0.0), length, r, down));
                    }
                }
            }
        }
    }
    // Pumps on the ground where there is room, and ducts overhead.
    for _ in 0..7 {
        let scale = rng.range(0.7, 1.25);
        let o = at(rng.range(0.14, 0.86), 0.01, rng.range(0.14, 0.86));
        let turned = rng.chance(0.5);
        let (a, c) = if turned { (0.5, 1.1) } else { (1.1, 0.5) };
        let reach = DVec3::new(a, 0.0, c) * scale;
        let free = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (0.0, 0.0)].iter().all(|(x, z)| {
            let p = (o + DVec3::new(reach.x * x, 0.5, reach.z * z) - at(0.0, 0.0, 0.0)) / CELL;
            grid.room(p.floor().to_array().map(|v| v as i32), 0)
        });
        if free {
            grid.take(o - reach, o + reach + DVec3::Y * (1.1 * scale));
            let f = Frame::standing(o, if turned { 0.0 } else { FRAC_PI_2 });
            site.piece(rng, |b, rng| vessel::pump(b, rng, &f, scale));
        }
    }
    for level in 0..bay.levels {
        if rng.chance(0.55) {
            let along_x = rng.chance(0.5);
            let (t, y) = (rng.range(0.2, 0.8), f64::from(level) * HEIGHT + rng.range(3.4, 4.6));
            let (w, h) = (rng.range(0.5, 1.1), rng.range(0.4, 0.8));
            let ends = if along_x { [at(0.04, y, t), at(0.96, y, t)] } else { [at(t, y, 0.04), at(t, y, 0.96)] };
            let reach = DVec3::new(0.5 * w + 0.1, 0.5 * h + 0.1, 0.5 * w + 0.1);
            let cells = (0..=30).map(|k| ends[0] + (ends[1] - ends[0]) * f64::from(k) / 30.0);
            let free = cells.into_iter().all(|p| {
                let c = ((p - at(0.0, 0.0, 0.0)) / CELL).floor().to_array().map(|v| v as i32);
                grid.room(c, 1)
            });
            if free {
                grid.take(ends[0] - reach, ends[1] + reach);
                let tint = shade(WHITE, rng.range(0.75, 1.0));
                site.piece(rng, |b, _| vessel::duct(b, ends[0], ends[1], [w, h], tint));
            }
        }
    }
}

/// Gratings and plates between the beams, where nothing stands in the way; returns the middles of those without.
fn floors(site: &mut Pieces, rng: &mut Rng, bay: &Bay, grid: &Grid) -> Vec<(DVec3, bool)> {
    let half = 0.25 * BLOCK;
    let mut spots = Vec::new();
    for level in 0..bay.levels {
        let y = f64::from(level) * HEIGHT;
        for i in 0..4 {
            for j in 0..4 {
                let low = bay.corner + DVec3::new(AISLE + f64::from(i) * half, y, AISLE + f64::from(j) * half);
                let center = low + DVec3::new(0.5 * half, 0.0, 0.5 * half);
                let kind = rng.unit();
                let c = ((center + DVec3::Y * 0.6 - bay.corner - DVec3::new(AISLE, 0.0, AISLE)) / CELL).floor();
                if !grid.room(c.to_array().map(|v| v as i32), 2) {
                    continue;
                }
                spots.push((center, level == 0 || kind < 0.55));
                if level == 0 {
                    continue;
                }
                let f = Frame::standing(low, 0.0);
                if kind < 0.4 {
                    site.piece(rng, |b, _| steel::grating(b, &f, [0.02, half - 0.02], [0.02, half - 0.02]));
                } else if kind < 0.55 {
                    site.piece(rng, |b, rng| steel::plates(b, rng, &f, [0.02, half - 0.02], [0.02, half - 0.02]));
                }
            }
        }
    }
    spots
}

/// Pipes of all sizes through the room that is left: a few wide ones, then many, then bundles of thin ones.
fn pipes(site: &mut Pieces, rng: &mut Rng, bay: &Bay, grid: &mut Grid) {
    let levels = bay.levels as i32;
    let [nx, ny, nz] = grid.size();
    let plan = [(1, 5, 2 * levels), (0, 3, 15 * levels), (0, 2, 5 * levels)];
    for (class, (half, run, count)) in plan.into_iter().enumerate() {
        for _ in 0..count {
            let level = rng.int(0, i64::from(levels) - 1) as i32;
            let y = level * FLOOR + if rng.chance(0.7) { rng.int(6, 12) } else { rng.int(2, 5) } as i32;
            let start = [rng.int(1, i64::from(nx) - 2) as i32, y.min(ny - 2), rng.int(1, i64::from(nz) - 2) as i32];
            let direction = [rng.pick(&[0, 0, 1, 2, 2]), rng.pick(&[-1, 1])];
            let Some(cells) = grid.route(rng, start, direction, half, run) else { continue };
            let points: Vec<DVec3> = cells.iter().map(|c| grid.center(*c)).collect();
            match class {
                0 => site.piece(rng, |b, rng| {
                    let r = rng.range(0.26, 0.42);
                    let look = Look::any(rng);
                    line(b, rng, &points, Line { r, bend: 0.95, look, storey: HEIGHT });
                }),
                1 => site.piece(rng, |b, rng| {
                    let r = rng.range(0.05, 0.155);
                    let look = Look::any(rng);
                    line(b, rng, &points, Line { r, bend: (3.0 * r).clamp(0.15, 0.4), look, storey: HEIGHT });
                }),
                _ => site.piece(rng, |b, rng| bundle(b, rng, &points)),
            }
        }
    }
}

/// Thin lines side by side.
fn bundle(b: &mut Builder, rng: &mut Rng, points: &[DVec3]) {
    let count = rng.int(2, 6);
    let look = Look::any(rng);
    for k in 0..count {
        let shift = DVec3::splat((k as f64 + 0.5) / count as f64 - 0.5) * 0.3;
        let r = rng.range(0.008, 0.018);
        let moved: Vec<DVec3> = points.iter().map(|p| *p + shift).collect();
        pipe(b, look.mat, shade(look.tint, rng.range(0.85, 1.0)), &moved, r, 0.1);
        let last = moved.len() - 1;
        flange(b, look, moved[0], (moved[1] - moved[0]).normalize(), r, true);
        flange(b, look, moved[last], (moved[last] - moved[last - 1]).normalize(), r, true);
    }
}

/// Cabinets, standpipes, ladders, stairs, hanging cables.
fn clutter(site: &mut Pieces, rng: &mut Rng, bay: &Bay, spots: &[(DVec3, bool)]) {
    for &(p, floored) in spots {
        if !floored {
            continue;
        }
        let f = Frame::standing(p, rng.pick(&[0.0, FRAC_PI_2, PI, -FRAC_PI_2]));
        match rng.int(0, 9) {
            0 => site.piece(rng, |b, rng| vessel::cabinets(b, rng, &f.moved(-0.8, 0.01, 0.25), 2)),
            1 => site.piece(rng, |b, rng| vessel::standpipe(b, rng, &f)),
            2 | 3 => site.piece(rng, |b, rng| {
                for _ in 0..rng.int(2, 6) {
                    let a = f.at(rng.range(-1.3, 1.3), HEIGHT - 0.5, rng.range(-1.3, 1.3));
                    let c = f.at(rng.range(-1.3, 1.3), HEIGHT - rng.range(0.5, 2.5), rng.range(-1.3, 1.3));
                    let tint = rng.pick(&[[0.05; 3], [0.08; 3], [0.5, 0.2, 0.03]]);
                    let sag = rng.range(0.1, 0.9);
                    vessel::hanging(b, [a, c], sag, rng.range(0.006, 0.02), tint);
                }
            }),
            _ => {}
        }
    }
    for level in 0..bay.levels {
        let y = f64::from(level) * HEIGHT;
        let side = bay.side(rng.int(0, 3) as usize);
        if rng.chance(0.5) {
            let f = side.moved(0.5 * PITCH, y, -AISLE - 0.12);
            site.piece(rng, |b, _| steel::ladder(b, &f, HEIGHT));
        }
        if rng.chance(0.35) && level > 0 {
            let f = side.moved(AISLE + 1.0, y - HEIGHT, -AISLE - 1.4);
            site.piece(rng, |b, _| steel::stairs(b, &f, HEIGHT, 0.5 * BLOCK + 1.0, 0.8));
        }
    }
}
