//! Roofs: parapets, terraces, slopes with dormers, and what stands on them.

use super::facade::Side;
use super::layout::Rect;
use super::plan::Plan;
use super::style::Style;
use super::window::Window;
use crate::material::{Mat, Tint, WHITE, shade};
use crate::mesh::{Builder, Frame, face, inset, lift};
use crate::rng::Rng;
use glam::{DVec2, DVec3};

/// A parapet of height `height` and thickness `t` on the walls of `plan`.
fn parapet(b: &mut Builder, plan: &Plan, y: f64, height: f64, t: f64, style: &Style) {
    let inner = inset(&plan.corners, &vec![t; plan.corners.len()]);
    let count = inner.len();
    let up = |p: DVec2, y: f64| DVec3::new(p.x, y, p.y);
    for k in 0..count {
        let n = (k + 1) % count;
        let (a, c, ia, ic) = (plan.corners[k], plan.corners[n], inner[k], inner[n]);
        let top = y + height;
        b.fan(style.wall, style.wall_tint, &[up(a, y), up(c, y), up(c, top), up(a, top)]);
        b.fan(style.trim, shade(style.trim_tint, 0.9), &[up(a, top), up(c, top), up(ic, top), up(ia, top)]);
        b.fan(style.wall, shade(style.wall_tint, 0.85), &[up(ic, y), up(ia, y), up(ia, top), up(ic, top)]);
    }
}

/// A flat roof; `things` stand on it.
pub fn flat(b: &mut Builder, rng: &mut Rng, plan: &Plan, y: f64, style: &Style, things: bool) {
    let t = 0.25;
    let height = rng.range(0.5, 1.1);
    parapet(b, plan, y, height, t, style);
    let inner = inset(&plan.corners, &vec![t; plan.corners.len()]);
    let (m, tint) =
        rng.pick(&[(Mat::Gravel, WHITE), (Mat::Gravel, [0.75; 3]), (Mat::Concrete, [0.8; 3]), (Mat::Slate, WHITE)]);
    b.fan(m, tint, &lift(&inner, y));
    if things {
        clutter(b, rng, plan.core(), y);
    }
}

/// The roof of a lower part around the higher part on `upper`.
pub fn terrace(b: &mut Builder, rng: &mut Rng, plan: &Plan, upper: &Plan, y: f64, style: &Style) {
    parapet(b, plan, y, 0.9, 0.2, style);
    let inner = inset(&plan.corners, &vec![0.2; plan.corners.len()]);
    let up = |p: DVec2| DVec3::new(p.x, y, p.y);
    let tint = shade(WHITE, rng.range(0.8, 1.0));
    let count = inner.len();
    for k in 0..count {
        // Where the upper part stands on the parapet of a party wall nothing is left between them.
        if plan.sides[k] == Side::Party {
            continue;
        }
        let n = (k + 1) % count;
        b.fan(Mat::Paving, tint, &[up(inner[k]), up(inner[n]), up(upper.corners[n]), up(upper.corners[k])]);
        let (f, width) = plan.wall(k, y);
        for _ in 0..(width / 6.0) as u32 {
            let u = rng.range(1.0, (width - 1.8).max(1.1));
            b.cuboid(&f, Mat::Wood, WHITE, [u, u + 0.8], [0.0, 0.5], [-0.75, -0.35], face::STANDING);
            let soil = f.moved(u + 0.4, 0.55, -0.55);
            crate::vegetation::tuft(b, rng, soil.o, 0.42, 14, shade(WHITE, 0.9));
        }
    }
}

/// A steep storey with dormers under a flat top.
pub fn mansard(b: &mut Builder, rng: &mut Rng, plan: &Plan, y: f64, style: &Style) {
    let (back, height) = (rng.range(1.2, 1.7), rng.range(2.5, 3.2));
    let top = plan.set_back(back, back);
    let tint = shade(WHITE, rng.range(0.75, 1.0));
    let up = |p: DVec2, y: f64| DVec3::new(p.x, y, p.y);
    let count = plan.corners.len();
    for k in 0..count {
        let n = (k + 1) % count;
        let (a, c, ta, tc) = (plan.corners[k], plan.corners[n], top.corners[k], top.corners[n]);
        if plan.sides[k] == Side::Party {
            b.fan(
                style.wall,
                shade(style.wall_tint, 0.8),
                &[up(a, y), up(c, y), up(tc, y + height), up(ta, y + height)],
            );
            continue;
        }
        slope(b, rng, style.roof_mat, tint, [up(a, y), up(c, y), up(tc, y + height), up(ta, y + height)], 7);
        let (f, width) = plan.wall(k, y);
        let bays = (width / style.bay.max(2.6)).round();
        if width > 4.0 {
            for s in 0..bays as u32 {
                let u = (f64::from(s) + 0.5) * width / bays;
                if u > back + 0.8 && u < width - back - 0.8 {
                    dormer(b, rng, &f, u, [back, height], style, plan.sides[k] == Side::Street);
                }
            }
        }
    }
    b.fan(Mat::Slate, shade(WHITE, 0.9), &lift(&top.corners, y + height));
    let core = top.core();
    for _ in 0..rng.int(1, 3) {
        let p = core.random(rng);
        chimney(b, rng, p, y + height - 0.1);
    }
    if rng.chance(0.5) {
        let p = core.random(rng);
        antenna(b, rng, p, y + height);
    }
}

/// A dormer on the slope above a wall: `back` over `height` is the slope.
fn dormer(b: &mut Builder, rng: &mut Rng, f: &Frame, u: f64, [back, height]: [f64; 2], style: &Style, full: bool) {
    let (half, low, high) = (0.62, 0.45, (height - 0.35).min(2.15));
    // How deep the slope lies behind the wall at height v.
    let behind = |v: f64| -back * v / height;
    let front = behind(low) + 0.08;
    let cheek = shade(WHITE, 0.9);
    for (side, outward) in [(u - half, -1.0), (u + half, 1.0)] {
        let mut quad = [
            f.at(side, low, front),
            f.at(side, high, front),
            f.at(side, high, behind(high)),
            f.at(side, low, behind(low)),
        ];
        if outward > 0.0 {
            quad.reverse();
        }
        b.fan(style.roof_mat, cheek, &quad);
    }
    let window = Window { sill: full, full, recess: 0.1, wall: Mat::Paint, ..Window::of(style, style.frame_tint) };
    window.build(b, rng, &f.moved(0.0, 0.0, front), [u - half, u + half], [low, high]);
    let v = [high, high + 0.12];
    b.cuboid(f, Mat::Slate, WHITE, [u - half - 0.12, u + half + 0.12], v, [behind(high), front + 0.15], face::ON_WALL);
}

/// A slope in courses of slightly different tints, from its foot (points 0, 1) to its ridge (3, 2).
fn slope(b: &mut Builder, rng: &mut Rng, m: Mat, tint: Tint, [a, c, tc, ta]: [DVec3; 4], courses: u32) {
    let at =
        |p: DVec3, q: DVec3, k: u32| if k == courses { q } else { p + (q - p) * (f64::from(k) / f64::from(courses)) };
    for k in 0..courses {
        let t = shade(tint, rng.range(0.85, 1.0));
        b.fan(m, t, &[at(a, ta, k), at(c, tc, k), at(c, tc, k + 1), at(a, ta, k + 1)]);
    }
}

/// Two slopes over a rectangle, the ridge along x or z; ends marked in `flush` (in the order of the rectangle's walls)
/// have no overhang.
pub fn gable(b: &mut Builder, rng: &mut Rng, rect: Rect, along_x: bool, flush: [bool; 4], y: f64, style: &Style) {
    let corners = rect.polygon();
    let k = if along_x { 0 } else { 1 };
    let (f, length) = Frame::wall(corners[k], corners[k + 1], y);
    let depth = if along_x { rect.depth() } else { rect.width() };
    let rise = 0.5 * depth * rng.range(0.62, 0.95);
    let over = 0.45;
    let drop = over * rise / (0.5 * depth);
    // Wall k + 3 meets the left end of wall k, wall k + 1 its right end.
    let (left, right) = (if flush[(k + 3) % 4] { 0.0 } else { -0.3 }, length + if flush[k + 1] { 0.0 } else { 0.3 });
    let tint = shade(WHITE, rng.range(0.75, 1.0));
    let eaves = [over, -depth - over];
    let ridge = [f.at(left, rise, -0.5 * depth), f.at(right, rise, -0.5 * depth)];
    let lift = f.v * 0.09;
    for (s, w) in eaves.into_iter().enumerate() {
        let (a, c) = (f.at(left, -drop, w), f.at(right, -drop, w));
        let (foot, top) = if s == 0 { ([a, c], [ridge[0], ridge[1]]) } else { ([c, a], [ridge[1], ridge[0]]) };
        slope(b, rng, style.roof_mat, tint, [foot[0] + lift, foot[1] + lift, top[1] + lift, top[0] + lift], 9);
        b.fan(Mat::Wood, WHITE, &[foot[0], foot[1], foot[1] + lift, foot[0] + lift]);
        b.fan(Mat::Wood, shade(WHITE, 0.7), &[foot[1], foot[0], top[0], top[1]]);
        // A gutter under the eaves.
        let gutter = f.v * -0.06;
        b.tube(Mat::Metal, shade(WHITE, 0.8), [foot[0] + gutter, foot[1] + gutter], [0.07, 0.07], 6, true);
    }
    for (end, outward) in [(0.0, false), (length, true)] {
        let mut triangle = [f.at(end, 0.0, -depth), f.at(end, 0.0, 0.0), f.at(end, rise, -0.5 * depth)];
        if outward {
            triangle.swap(0, 1);
        }
        b.fan(style.wall, shade(style.wall_tint, 0.95), &triangle);
        let edge = if outward { right } else { left };
        for (s, w) in eaves.into_iter().enumerate() {
            let foot = f.at(edge, -drop, w);
            let mut board = [foot, foot + lift, f.at(edge, rise, -0.5 * depth) + lift, f.at(edge, rise, -0.5 * depth)];
            if (s == 0) == outward {
                board.reverse();
            }
            b.fan(Mat::Wood, shade(WHITE, 0.9), &board);
        }
    }
    let at = rng.range(0.2, 0.8);
    let p = f.at(at * length, 0.0, -0.5 * depth + rng.pick(&[-0.8, 0.8]));
    chimney(b, rng, DVec2::new(p.x, p.z), y + rise - 1.3);
}

/// A chimney of 1.6 to 2.4 m above `y`.
fn chimney(b: &mut Builder, rng: &mut Rng, p: DVec2, y: f64) {
    let f = Frame::standing(DVec3::new(p.x, y, p.y), 0.0);
    let h = rng.range(2.0, 2.8);
    let tint = shade(WHITE, rng.range(0.7, 1.0));
    b.cuboid(&f, Mat::Brick, tint, [-0.35, 0.35], [0.0, h], [-0.3, 0.3], face::STANDING);
    b.cuboid(&f, Mat::Concrete, tint, [-0.42, 0.42], [h, h + 0.1], [-0.37, 0.37], face::ALL);
    for u in [-0.18, 0.18] {
        let foot = f.at(u, h + 0.1, 0.0);
        b.tube(Mat::Tile, tint, [foot, foot + DVec3::Y * 0.35], [0.11, 0.09], 7, true);
    }
}

fn antenna(b: &mut Builder, rng: &mut Rng, p: DVec2, y: f64) {
    let f = Frame::standing(DVec3::new(p.x, y, p.y), rng.range(0.0, std::f64::consts::TAU));
    let h = rng.range(2.0, 4.0);
    b.tube(Mat::Metal, shade(WHITE, 0.7), [f.o, f.at(0.0, h, 0.0)], [0.03, 0.025], 5, true);
    b.tube(Mat::Metal, WHITE, [f.at(0.0, h - 0.2, -0.9), f.at(0.0, h - 0.2, 0.9)], [0.018, 0.018], 4, true);
    for k in 0..5 {
        let w = -0.85 + 0.4 * f64::from(k);
        let half = 0.5 - 0.07 * f64::from(k);
        b.tube(Mat::Metal, WHITE, [f.at(-half, h - 0.2, w), f.at(half, h - 0.2, w)], [0.012, 0.012], 3, false);
    }
}

/// Stair house, air conditioning, tanks, pipes, skylights, panels on a flat roof.
fn clutter(b: &mut Builder, rng: &mut Rng, area: Rect, y: f64) {
    if area.width() < 3.5 || area.depth() < 3.5 {
        return;
    }
    let mut taken: Vec<(DVec2, f64)> = Vec::new();
    let mut free = |rng: &mut Rng, r: f64| -> Option<DVec2> {
        if area.width() < 2.0 * r || area.depth() < 2.0 * r {
            return None;
        }
        for _ in 0..12 {
            let p = area.shrunk([r; 4]).random(rng);
            if taken.iter().all(|(q, s)| (p - *q).length() > r + s + 0.2) {
                taken.push((p, r));
                return Some(p);
            }
        }
        None
    };
    let frame = |rng: &mut Rng, p: DVec2| {
        Frame::standing(DVec3::new(p.x, y, p.y), f64::from(rng.int(0, 3) as u32) * std::f64::consts::FRAC_PI_2)
    };
    if let Some(p) = free(rng, 2.0) {
        let f = frame(rng, p);
        stair_house(b, rng, &f);
    }
    let units = (area.width() * area.depth() / 60.0).min(2.0) as u32 + 1;
    for _ in 0..units {
        if let Some(p) = free(rng, 1.0) {
            let f = frame(rng, p);
            cooler(b, rng, &f);
        }
    }
    if rng.chance(0.3)
        && let Some(p) = free(rng, 1.7)
    {
        let f = frame(rng, p);
        tank(b, rng, &f);
    }
    if rng.chance(0.3) {
        for _ in 0..4 {
            if let Some(p) = free(rng, 1.0) {
                solar(b, &Frame::standing(DVec3::new(p.x, y, p.y), 0.0));
            }
        }
    }
    for _ in 0..3 {
        if let Some(p) = free(rng, 0.3) {
            let foot = DVec3::new(p.x, y, p.y);
            let top = foot + DVec3::Y * rng.range(0.4, 1.1);
            b.tube(Mat::Metal, shade(WHITE, 0.8), [foot, top], [0.12, 0.12], 8, false);
            b.tube(Mat::Metal, shade(WHITE, 0.6), [top, top + DVec3::Y * 0.14], [0.22, 0.02], 8, true);
        }
    }
    if rng.chance(0.5)
        && let Some(p) = free(rng, 0.9)
    {
        let f = frame(rng, p);
        b.cuboid(&f, Mat::Paint, [0.6; 3], [-0.75, 0.75], [0.0, 0.35], [-0.5, 0.5], face::STANDING & !face::TOP);
        b.cuboid(&f, Mat::Glass, WHITE, [-0.75, 0.75], [0.34, 0.35], [-0.5, 0.5], face::TOP);
    }
    if rng.chance(0.55)
        && let Some(p) = free(rng, 0.5)
    {
        antenna(b, rng, p, y);
    }
}

fn stair_house(b: &mut Builder, rng: &mut Rng, f: &Frame) {
    let (m, tint) = rng.pick(&[(Mat::Concrete, WHITE), (Mat::Plaster, [0.8; 3]), (Mat::Brick, [0.9; 3])]);
    b.cuboid(f, m, tint, [-1.6, 1.6], [0.0, 2.5], [-1.2, 1.2], face::STANDING & !face::TOP);
    b.cuboid(f, Mat::Concrete, shade(WHITE, 0.7), [-1.75, 1.75], [2.5, 2.65], [-1.35, 1.35], face::ALL);
    b.cuboid(f, Mat::Paint, [0.3, 0.33, 0.36], [-0.5, 0.5], [0.0, 2.05], [1.2, 1.25], face::ON_WALL);
    b.cuboid(f, Mat::Metal, WHITE, [0.32, 0.4], [0.95, 1.05], [1.25, 1.32], face::ON_WALL);
}

fn cooler(b: &mut Builder, rng: &mut Rng, f: &Frame) {
    let (w, d, h) = (rng.range(0.6, 0.9), rng.range(0.4, 0.6), rng.range(0.8, 1.3));
    for (u, n) in [(-w, -d), (w - 0.1, -d), (-w, d - 0.1), (w - 0.1, d - 0.1)] {
        let sides = face::LEFT | face::RIGHT | face::FRONT | face::BACK;
        b.cuboid(f, Mat::Metal, [0.5; 3], [u, u + 0.1], [0.0, 0.2], [n, n + 0.1], sides);
    }
    let tint = shade(WHITE, rng.range(0.8, 1.0));
    b.cuboid(f, Mat::Paint, shade(tint, 0.75), [-w, w], [0.2, h], [-d, d], face::ALL);
    for k in 0..3 {
        let v = 0.34 + 0.16 * f64::from(k);
        b.cuboid(f, Mat::Metal, [0.3; 3], [-w + 0.08, w - 0.08], [v, v + 0.04], [d, d + 0.02], face::LEVEL);
    }
    let center = f.at(0.0, h, 0.0);
    b.tube(Mat::Metal, [0.4; 3], [center, center + DVec3::Y * 0.1], [0.8 * d, 0.8 * d], 10, false);
    b.disc(Mat::Rubber, WHITE, center + DVec3::Y * 0.03, DVec3::Y * (0.79 * d), 10);
}

/// A wooden water tank on legs.
fn tank(b: &mut Builder, rng: &mut Rng, f: &Frame) {
    let (legs, r, h) = (rng.range(1.6, 2.6), rng.range(1.1, 1.4), rng.range(2.2, 3.0));
    for (u, w) in [(-0.8, -0.8), (0.8, -0.8), (-0.8, 0.8), (0.8, 0.8)] {
        b.tube(Mat::Metal, [0.4; 3], [f.at(u, 0.0, w), f.at(u, legs, w)], [0.07, 0.07], 5, false);
    }
    for (a, c) in
        [((-0.8, -0.8), (0.8, -0.8)), ((0.8, -0.8), (0.8, 0.8)), ((0.8, 0.8), (-0.8, 0.8)), ((-0.8, 0.8), (-0.8, -0.8))]
    {
        b.tube(Mat::Metal, [0.4; 3], [f.at(a.0, 0.2, a.1), f.at(c.0, legs, c.1)], [0.03, 0.03], 4, false);
    }
    let (low, high) = (f.at(0.0, legs + 0.15, 0.0), f.at(0.0, legs + 0.15 + h, 0.0));
    let tint = shade(WHITE, rng.range(0.6, 1.0));
    b.cuboid(f, Mat::Wood, shade(tint, 0.7), [-1.0, 1.0], [legs, legs + 0.15], [-1.0, 1.0], face::ALL);
    b.tube(Mat::Wood, tint, [low, high], [r, 0.95 * r], 16, false);
    for t in [0.15, 0.4, 0.65, 0.9] {
        let at = low + (high - low) * t;
        b.tube(Mat::Metal, [0.3; 3], [at, at + DVec3::Y * 0.05], [1.01 * r, 1.01 * r], 16, false);
    }
    b.tube(Mat::Slate, WHITE, [high, high + DVec3::Y * 0.8], [1.08 * r, 0.0], 16, false);
}

fn solar(b: &mut Builder, f: &Frame) {
    let points = [f.at(-0.9, 0.15, 0.6), f.at(0.9, 0.15, 0.6), f.at(0.9, 0.75, -0.4), f.at(-0.9, 0.75, -0.4)];
    b.fan(Mat::Glass, [0.8, 0.8, 1.0], &points);
    b.fan(Mat::Metal, WHITE, &[points[1], points[0], points[3], points[2]]);
    for u in [-0.8, 0.8] {
        b.tube(Mat::Metal, WHITE, [f.at(u, 0.0, -0.38), f.at(u, 0.74, -0.38)], [0.025, 0.025], 4, false);
    }
}
