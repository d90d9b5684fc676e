//! Open blocks: parks and squares.

use super::facade::Side;
use super::furniture as things;
use super::layout::{KERB, NORTH, Rect, SOUTH, on_ground};
use super::roof;
use super::site::Site;
use super::street;
use super::style::{FacadeKind, Style};
use crate::material::{Mat, WHITE, shade};
use crate::mesh::{Builder, Frame, face};
use crate::rng::Rng;
use crate::vegetation::{self, Tree};
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// A blob around `center`: a closed curve of `sides` points, counter-clockwise from above as walls are.
fn blob(rng: &mut Rng, center: DVec2, radii: DVec2, sides: u32) -> Vec<DVec2> {
    let phases = [0; 3].map(|_| rng.range(0.0, TAU));
    (0..sides)
        .map(|k| {
            let angle = -f64::from(k) * TAU / f64::from(sides);
            let wave = 1.0 + 0.1 * (2.0 * angle + phases[0]).sin() + 0.06 * (3.0 * angle + phases[1]).sin();
            center + DVec2::new(angle.cos() * radii.x, angle.sin() * radii.y) * wave
        })
        .collect()
}

/// A fan around `center`; the curve need not be convex, only seen whole from there.
fn disc(b: &mut Builder, m: Mat, k: f64, curve: &[DVec2], center: DVec2, y: f64) {
    let up = |p: DVec2| DVec3::new(p.x, y, p.y);
    for s in 0..curve.len() {
        b.fan(m, shade(WHITE, k), &[up(center), up(curve[s]), up(curve[(s + 1) % curve.len()])]);
    }
}

/// A ring between two curves of as many points.
fn band(b: &mut Builder, rng: &mut Rng, m: Mat, outer: &[DVec2], inner: &[DVec2], y: f64) {
    let up = |p: DVec2| DVec3::new(p.x, y, p.y);
    let count = outer.len();
    for s in 0..count {
        let n = (s + 1) % count;
        let tint = shade(WHITE, rng.range(0.85, 1.0));
        b.fan(m, tint, &[up(outer[s]), up(outer[n]), up(inner[n]), up(inner[s])]);
    }
}

/// A path `width` wide from `a` to `c`.
fn path(b: &mut Builder, rng: &mut Rng, a: DVec2, c: DVec2, width: f64, y: f64) {
    let (f, length) = Frame::wall(a, c, y);
    let count = (length / 3.0).round().max(1.0);
    for s in 0..count as u32 {
        let u = [f64::from(s), f64::from(s + 1)].map(|s| s * length / count);
        let half = 0.5 * width;
        let tint = shade(WHITE, rng.range(0.85, 1.0));
        b.fan(
            Mat::Sand,
            tint,
            &[f.at(u[0], 0.0, half), f.at(u[1], 0.0, half), f.at(u[1], 0.0, -half), f.at(u[0], 0.0, -half)],
        );
    }
}

/// A park: lawns, a round walk about a pond, trees, benches.
pub fn park(site: &mut Site, rng: &mut Rng) {
    let lots = site.cell.lots();
    site.piece(rng, |b, rng| street::ground(b, rng, Mat::Grass, lots, KERB, 4.0, 0.72));
    let center = lots.at(rng.range(0.45, 0.55), rng.range(0.45, 0.55));
    let radii = DVec2::new(0.30 * lots.width(), 0.28 * lots.depth());
    let walk = blob(rng, center, radii, 40);
    let scaled = |k: f64| -> Vec<DVec2> { walk.iter().map(|p| center + (*p - center) * k).collect() };
    let pond = rng.chance(0.7);
    site.piece(rng, |b, rng| {
        band(b, rng, Mat::Sand, &walk, &scaled(0.82), KERB + 0.02);
        let corners = lots.polygon();
        for (k, corner) in corners.iter().enumerate() {
            let toward = (center - *corner).normalize();
            let start = walk.iter().map(|p| (*p - *corner).length()).fold(f64::INFINITY, f64::min);
            path(b, rng, *corner + toward * 0.8, *corner + toward * (start + 0.8), 2.2, KERB + 0.015);
            let next = corners[(k + 1) % 4];
            let gate = 0.5 * (*corner + next);
            let inward = (center - gate).normalize();
            let reach = walk.iter().map(|p| (*p - gate).length()).fold(f64::INFINITY, f64::min);
            path(b, rng, gate, gate + inward * (reach + 0.8), 2.6, KERB + 0.012);
        }
        if pond {
            let (shore, water) = (scaled(0.58), scaled(0.53));
            band(b, rng, Mat::Stone, &shore, &water, KERB + 0.12);
            let up = |p: &DVec2, y: f64| DVec3::new(p.x, y, p.y);
            for s in 0..shore.len() {
                let (a, c) = (&shore[s], &shore[(s + 1) % shore.len()]);
                b.fan(
                    Mat::Stone,
                    shade(WHITE, 0.8),
                    &[up(a, KERB), up(c, KERB), up(c, KERB + 0.12), up(a, KERB + 0.12)],
                );
            }
            disc(b, Mat::Water, 1.0, &water, center, KERB + 0.06);
        } else {
            disc(b, Mat::Paving, 0.95, &scaled(0.3), center, KERB + 0.02);
        }
    });
    if !pond {
        let f = Frame::standing(on_ground(center), rng.range(0.0, TAU));
        site.piece(rng, |b, rng| things::statue(b, rng, &f));
    }
    for k in 0..8 {
        let p = walk[k * 5];
        let out = (p - center).normalize();
        let f = Frame::standing(on_ground(p + out * 0.7), (-out.x).atan2(-out.y));
        if k % 2 == 0 {
            site.piece(rng, |b, rng| things::bench(b, rng, &f));
        } else {
            site.piece(rng, |b, _| things::park_lamp(b, &f));
        }
    }
    let inner = lots.shrunk([2.5; 4]);
    let mut planted: Vec<DVec2> = Vec::new();
    for _ in 0..60 {
        let p = inner.random(rng);
        let near = walk.iter().map(|q| (*q - p).length()).fold(f64::INFINITY, f64::min);
        let within = (p - center).length() < 0.8 * radii.min_element();
        if near > 2.2 && !within && planted.iter().all(|q| (*q - p).length() > 5.0) && planted.len() < 18 {
            let kind = if planted.len().is_multiple_of(2) {
                Tree::Park
            } else {
                rng.pick(&[Tree::Street, Tree::Street, Tree::Conifer, Tree::Column])
            };
            site.tree(rng, kind, on_ground(p));
            planted.push(p);
        }
    }
    for _ in 0..8 {
        let p = inner.random(rng);
        if walk.iter().all(|q| (*q - p).length() > 1.8) && (p - center).length() > radii.min_element() {
            let radius = rng.range(0.5, 1.0);
            site.piece(rng, |b, rng| vegetation::bush(b, rng, on_ground(p), radius));
        }
    }
    let spot = lots.at(0.14, 0.5);
    site.piece(rng, |b, _| things::playground(b, &Frame::standing(on_ground(spot), 0.2)));
    let corners = lots.polygon();
    for k in 0..4 {
        let (f, length) = Frame::wall(corners[k], corners[(k + 1) % 4], KERB);
        for [u0, u1] in [[2.2, 0.5 * length - 2.0], [0.5 * length + 2.0, length - 2.2]] {
            site.piece(rng, |b, rng| vegetation::hedge(b, rng, &f.moved(u0, 0.0, -0.4), u1 - u0, 0.7));
        }
    }
}

/// A square: a fountain, rows of trees, tables, and a hall with columns.
pub fn plaza(site: &mut Site, rng: &mut Rng) {
    let lots = site.cell.lots();
    site.piece(rng, |b, rng| {
        let step = 2.2;
        let (nx, nz) = ((lots.width() / step).round(), (lots.depth() / step).round());
        for i in 0..nx as u32 {
            for j in 0..nz as u32 {
                let (a, c) = (
                    lots.at(f64::from(i) / nx, f64::from(j) / nz),
                    lots.at(f64::from(i + 1) / nx, f64::from(j + 1) / nz),
                );
                let border = i % 6 == 0 || j % 6 == 0;
                let (m, k) = if border { (Mat::Stone, 0.6) } else { (Mat::Paving, 0.95) };
                let tint = shade(WHITE, k * rng.range(0.9, 1.0));
                street::flat(b, m, tint, Rect { x0: a.x, x1: c.x, z0: a.y, z1: c.y }, KERB);
            }
        }
    });
    // The hall stands away from the crossing at the origin.
    let north = site.cell.j < 0;
    let depth = 15.0;
    let x = [lots.x0 + 6.0, lots.x1 - 6.0];
    let hall_rect = if north {
        Rect { x0: x[0], x1: x[1], z0: lots.z0 + 2.0, z1: lots.z0 + 2.0 + depth }
    } else {
        Rect { x0: x[0], x1: x[1], z0: lots.z1 - 2.0 - depth, z1: lots.z1 - 2.0 }
    };
    let front = if north { SOUTH } else { NORTH };
    site.piece(rng, |b, rng| hall(b, rng, hall_rect, front));
    let rest = if north { Rect { z0: hall_rect.z1 + 4.0, ..lots } } else { Rect { z1: hall_rect.z0 - 4.0, ..lots } };
    let center = rest.center();
    let radius = (0.2 * rest.depth()).clamp(2.6, 3.8);
    let f = Frame::standing(on_ground(center), 0.0);
    site.piece(rng, |b, _| things::fountain(b, &f, radius));
    for k in 0..8 {
        let (s, c) = (f64::from(k) * TAU / 8.0 + 0.39).sin_cos();
        let p = center + DVec2::new(s, c) * (radius + 2.0);
        let seat = Frame::standing(on_ground(p), s.atan2(c));
        if k % 2 == 0 {
            site.piece(rng, |b, rng| things::bench(b, rng, &seat));
        } else {
            site.piece(rng, |b, _| things::park_lamp(b, &seat));
        }
    }
    for u in [0.06, 0.18, 0.3, 0.7, 0.82, 0.94] {
        for v in [0.15, 0.85] {
            let p = rest.at(u, v);
            site.tree(rng, Tree::Street, on_ground(p));
        }
    }
    for _ in 0..5 {
        let p = rest.at(rng.range(0.05, 0.27), rng.range(0.3, 0.7));
        let table = Frame::standing(on_ground(p), rng.range(0.0, TAU));
        site.piece(rng, |b, rng| things::table(b, rng, &table));
    }
    let spot = Frame::standing(on_ground(rest.at(0.84, 0.5)), if north { 0.0 } else { std::f64::consts::PI });
    if rng.chance(0.5) {
        site.piece(rng, |b, rng| things::kiosk(b, rng, &spot));
    } else {
        site.piece(rng, |b, rng| things::statue(b, rng, &spot));
    }
    let edge = if north { SOUTH } else { NORTH };
    let corners = lots.polygon();
    let (f, length) = Frame::wall(corners[edge], corners[(edge + 1) % 4], KERB);
    for k in 0..(length / 2.5) as u32 {
        site.piece(rng, |b, _| things::bollard(b, &f.moved(1.2 + f64::from(k) * 2.5, 0.0, -0.3)));
    }
}

/// A hall with steps, a row of columns and a pediment. Its front is the side `front`.
fn hall(b: &mut Builder, rng: &mut Rng, rect: Rect, front: usize) {
    let style = Style {
        kind: FacadeKind::Punched,
        ground: super::style::Ground::Dwelling,
        floor: 4.6,
        ground_floor: 4.8,
        bay: 3.6,
        window_width: 1.6,
        sill: 0.8,
        head: 1.0,
        panes: [2, 3],
        balconies: 0.0,
        ledges: false,
        ..Style::stone(rng)
    };
    let corners = rect.polygon();
    let (f, length) = Frame::wall(corners[front], corners[(front + 1) % 4], KERB);
    let tint = style.trim_tint;
    // A stylobate of four steps carries everything.
    for s in 0..4 {
        let (v, out) = (0.16 * f64::from(s), 1.4 - 0.35 * f64::from(s));
        let w = [-rect.depth(), out];
        b.cuboid(&f, Mat::Stone, shade(tint, 0.9), [-out, length + out], [v, v + 0.16], w, face::STANDING);
    }
    let floor = 0.64;
    let porch = 3.2;
    let mut sides = [Side::Rear; 4];
    sides[front] = Side::Street;
    let mut inset = [0.0; 4];
    inset[front] = porch;
    let cella = rect.shrunk(inset);
    let cella_corners = cella.polygon();
    let height = style.ground_floor + style.floor;
    for k in 0..4 {
        let (frame, width) = Frame::wall(cella_corners[k], cella_corners[(k + 1) % 4], KERB + floor);
        let wall = super::facade::Wall {
            frame,
            width,
            side: sides[k],
            joins: [true; 2],
            style: &style,
            tint: style.wall_tint,
        };
        wall.ground_floor(b, rng, style.ground_floor);
        wall.storeys(b, rng, style.ground_floor, 1);
    }
    let count = (length / 3.4).round();
    for k in 0..=count as u32 {
        let u = 0.7 + f64::from(k) * (length - 1.4) / count;
        let at = |v: f64| f.at(u, floor + v, -0.7);
        b.cuboid(&f, Mat::Stone, tint, [u - 0.62, u + 0.62], [floor, floor + 0.2], [-1.32, -0.08], face::STANDING);
        b.tube(Mat::Stone, tint, [at(0.2), at(0.45)], [0.58, 0.5], 16, true);
        b.tube(Mat::Stone, tint, [at(0.45), at(height - 0.6)], [0.5, 0.4], 16, false);
        b.tube(Mat::Stone, tint, [at(height - 0.6), at(height - 0.25)], [0.42, 0.62], 16, false);
        b.cuboid(
            &f,
            Mat::Stone,
            tint,
            [u - 0.65, u + 0.65],
            [floor + height - 0.25, floor + height],
            [-1.35, -0.05],
            face::ALL,
        );
    }
    let top = floor + height;
    for (v0, v1, out) in [(0.0, 0.7, 0.0), (0.7, 1.2, 0.15), (1.2, 1.5, 0.5)] {
        let w = [-rect.depth() - out, out];
        b.cuboid(&f, Mat::Stone, shade(tint, 0.97), [-out, length + out], [top + v0, top + v1], w, face::ALL);
    }
    roof::gable(b, rng, rect, true, [false; 4], KERB + top + 1.5, &style);
}
