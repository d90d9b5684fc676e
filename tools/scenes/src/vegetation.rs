//! Trees, bushes and hedges: trunks and branches of tapered tubes, crowns of many small leaf quads.

use crate::material::{Mat, Tint, WHITE, shade};
use crate::mesh::{Builder, Frame, face};
use crate::rng::Rng;
use glam::DVec3;

/// Kinds of trees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tree {
    /// A lime or maple beside a street.
    Street,
    /// A wide old tree of a park.
    Park,
    /// A poplar.
    Column,
    /// A fir.
    Conifer,
}

/// A quad of a leaf cluster at `p`.
fn leaf(b: &mut Builder, rng: &mut Rng, p: DVec3, outward: DVec3, size: f64, tint: Tint) {
    // Leaves face outward and up with much disorder.
    let n = (outward * 0.8 + DVec3::Y * 0.6 + rng.direction() * 0.9).try_normalize().unwrap_or(DVec3::Y);
    let turn = rng.range(0.0, std::f64::consts::TAU);
    let (x, y) = (n.any_orthonormal_vector(), n.cross(n.any_orthonormal_vector()));
    let (s, c) = turn.sin_cos();
    let (u, v) = ((x * c + y * s) * size, (y * c - x * s) * (0.55 * size));
    let bend = n * (-0.25 * size);
    // Two triangles folded along the midrib.
    b.fan(Mat::Leaf, tint, &[p - u, p + v + bend, p + u, p - v + bend]);
}

/// `count` leaves in a ball around `center`.
pub fn tuft(b: &mut Builder, rng: &mut Rng, center: DVec3, radius: f64, count: u32, tint: Tint) {
    for _ in 0..count {
        let d = rng.direction();
        let r = radius * rng.range(0.25, 1.0).cbrt();
        let light = 0.72 + 0.28 * (0.5 + 0.5 * d.y) + rng.range(-0.12, 0.08);
        let size = (0.41 * radius).clamp(0.13, 0.44) * rng.range(0.7, 1.2);
        leaf(b, rng, center + d * r, d, size, shade(tint, light));
    }
}

/// A branch in two bent pieces; returns its tip.
fn branch(b: &mut Builder, rng: &mut Rng, from: DVec3, to: DVec3, radius: f64, sides: u32) -> DVec3 {
    let bark = shade(WHITE, rng.range(0.8, 1.0));
    let length = (to - from).length();
    let knee = from + (to - from) * rng.range(0.4, 0.6) + rng.direction() * (0.08 * length);
    b.tube(Mat::Bark, bark, [from, knee], [radius, 0.7 * radius], sides, false);
    b.tube(Mat::Bark, bark, [knee, to], [0.7 * radius, 0.25 * radius], sides, false);
    to
}

/// A tree with its foot at the origin, in metres.
pub fn tree(b: &mut Builder, rng: &mut Rng, kind: Tree) {
    match kind {
        Tree::Street => {
            crowned(b, rng, Crown { bole: 2.7, height: 7.6, radius: 2.4, branches: 6, tufts: 26, leaves: 14 })
        }
        Tree::Park => {
            crowned(b, rng, Crown { bole: 2.6, height: 10.0, radius: 3.9, branches: 8, tufts: 44, leaves: 15 })
        }
        Tree::Column => column(b, rng),
        Tree::Conifer => conifer(b, rng),
    }
}

struct Crown {
    bole: f64,
    height: f64,
    radius: f64,
    branches: u32,
    tufts: u32,
    leaves: u32,
}

fn crowned(b: &mut Builder, rng: &mut Rng, c: Crown) {
    let scale = rng.range(0.9, 1.1);
    let tint = rng.pick(&[[1.0, 1.0, 1.0], [0.85, 1.0, 0.85], [1.0, 0.95, 0.7], [0.75, 0.9, 0.8]]);
    let (bole, height, radius) = (c.bole * scale, c.height * scale, c.radius * scale);
    let thick = 0.045 * height.sqrt() * height.sqrt() * 0.4 + 0.03 * radius;
    let lean = DVec3::new(rng.range(-0.2, 0.2), 0.0, rng.range(-0.2, 0.2));
    let fork = DVec3::new(0.0, bole, 0.0) + lean * 0.5;
    let top = DVec3::new(0.0, height - 0.8, 0.0) + lean;
    b.tube(Mat::Bark, WHITE, [DVec3::ZERO, DVec3::Y * 0.4], [1.5 * thick, thick], 9, false);
    b.tube(Mat::Bark, WHITE, [DVec3::Y * 0.4, fork], [thick, 0.85 * thick], 9, false);
    b.tube(Mat::Bark, WHITE, [fork, top], [0.85 * thick, 0.15 * thick], 7, false);
    let center = DVec3::new(0.0, 0.5 * (bole + height) + 0.25, 0.0) + lean;
    let half = 0.5 * (height - bole);
    let mut spots = vec![top];
    let turn = rng.range(0.0, std::f64::consts::TAU);
    for k in 0..c.branches {
        let angle = turn + f64::from(k) * 2.4;
        let t = f64::from(k) / f64::from(c.branches);
        let start = fork + (top - fork) * (0.55 * t);
        let rise = rng.range(0.1, 0.45) + 0.3 * t;
        let reach = radius * rng.range(0.55, 0.8);
        let tip = start
            + DVec3::new(angle.cos() * reach, (rise * 2.0 * half).min(height - start.y - 0.5), angle.sin() * reach);
        spots.push(branch(b, rng, start, tip, 0.42 * thick, 4));
        let aside = start + (tip - start) * 0.55;
        let twig = aside + (rng.direction() + DVec3::Y * 0.4) * (0.35 * radius);
        spots.push(branch(b, rng, aside, twig, 0.2 * thick, 3));
    }
    // Further clusters close the shell of the crown.
    while spots.len() < c.tufts as usize {
        let d = rng.direction();
        let d = DVec3::new(d.x, d.y.max(-0.55), d.z);
        spots.push(center + d * DVec3::new(radius, half, radius) * rng.range(0.55, 0.82));
    }
    for p in spots {
        let r = 0.33 * radius * rng.range(0.8, 1.2);
        let light = 0.8 + 0.2 * ((p.y - center.y) / half).clamp(-1.0, 1.0);
        tuft(b, rng, p, r.max(0.7), c.leaves, shade(tint, light));
    }
}

fn column(b: &mut Builder, rng: &mut Rng) {
    let height = rng.range(10.0, 12.5);
    b.tube(Mat::Bark, WHITE, [DVec3::ZERO, DVec3::Y * (0.6 * height)], [0.22, 0.1], 8, false);
    b.tube(Mat::Bark, WHITE, [DVec3::Y * (0.6 * height), DVec3::Y * (0.95 * height)], [0.1, 0.02], 6, false);
    let layers = 13;
    for k in 0..layers {
        let t = f64::from(k) / f64::from(layers - 1);
        let y = 1.2 + (height - 1.6) * t;
        let r = 1.15 * (1.0 - t * t).max(0.06).sqrt() * (0.55 + 0.9 * t.min(0.5));
        for s in 0..3 {
            let angle = f64::from(s) * 2.1 + f64::from(k) * 0.8;
            let p = DVec3::new(angle.cos() * 0.5 * r, y + rng.range(-0.3, 0.3), angle.sin() * 0.5 * r);
            if t < 0.8 {
                branch(b, rng, DVec3::Y * (y - 0.9).max(0.5), p, 0.045, 3);
            }
            tuft(b, rng, p, 0.62 * r + 0.3, 13, [0.85, 1.0, 0.75]);
        }
    }
}

fn conifer(b: &mut Builder, rng: &mut Rng) {
    let height = rng.range(8.0, 11.0);
    b.tube(Mat::Bark, shade(WHITE, 0.8), [DVec3::ZERO, DVec3::Y * (0.95 * height)], [0.24, 0.03], 8, false);
    let tint: Tint = [0.5, 0.72, 0.62];
    let layers = 15;
    for k in 0..layers {
        let t = f64::from(k) / f64::from(layers);
        let y = 1.0 + (height - 1.2) * t;
        let reach = 2.3 * (1.0 - t).powf(0.85) + 0.15;
        let boughs = 5 + ((1.0 - t) * 9.0) as u32;
        for s in 0..boughs {
            let angle = (f64::from(s) + rng.range(-0.25, 0.25)) * std::f64::consts::TAU / f64::from(boughs)
                + f64::from(k) * 0.7;
            let out = DVec3::new(angle.cos(), 0.0, angle.sin());
            let side = DVec3::new(-out.z, 0.0, out.x) * (0.22 * reach + 0.08);
            let root = DVec3::Y * (y + 0.25);
            let mid = root + out * (0.55 * reach) - DVec3::Y * (0.1 * reach);
            let tip = root + out * (reach * rng.range(0.9, 1.1)) - DVec3::Y * (0.42 * reach);
            let light = shade(tint, rng.range(0.75, 1.1));
            // A bough is a roof of four triangles.
            let sag = DVec3::Y * (0.16 * reach);
            b.fan(Mat::Leaf, light, &[root, mid - side - sag, mid]);
            b.fan(Mat::Leaf, shade(light, 0.9), &[root, mid, mid + side - sag]);
            b.fan(Mat::Leaf, light, &[mid - side - sag, tip, mid]);
            b.fan(Mat::Leaf, shade(light, 0.9), &[mid, tip, mid + side - sag]);
        }
    }
    b.tube(Mat::Leaf, tint, [DVec3::Y * (0.93 * height), DVec3::Y * (height + 0.3)], [0.15, 0.0], 5, false);
}

/// A bush of radius `radius` standing at `o`.
pub fn bush(b: &mut Builder, rng: &mut Rng, o: DVec3, radius: f64) {
    let tint = shade(rng.pick(&[WHITE, [0.8, 1.0, 0.8], [1.0, 0.85, 0.6]]), rng.range(0.75, 1.0));
    for k in 0..3 {
        let angle = f64::from(k) * 2.1 + rng.range(0.0, 0.6);
        let p = o + DVec3::new(angle.cos() * 0.4 * radius, 0.6 * radius, angle.sin() * 0.4 * radius);
        tuft(b, rng, p, 0.7 * radius, 22, tint);
    }
}

/// A clipped hedge from u = 0 to `length` along the wall plane of `f`.
pub fn hedge(b: &mut Builder, rng: &mut Rng, f: &Frame, length: f64, height: f64) {
    let tint = shade([0.75, 0.9, 0.75], rng.range(0.8, 1.0));
    let half = 0.28;
    b.cuboid(f, Mat::Leaf, shade(tint, 0.75), [0.0, length], [0.0, height - 0.05], [-half, half], face::STANDING);
    let count = (length * 9.0) as u32;
    for k in 0..count {
        let u = (f64::from(k) + rng.unit()) * length / f64::from(count);
        let v = height * rng.unit().sqrt();
        let top = rng.chance(0.4);
        let (p, n) = if top {
            (f.at(u, height - 0.03, rng.range(-half, half)), f.v)
        } else {
            let side = rng.pick(&[-1.0, 1.0]);
            (f.at(u, v.min(height - 0.1), side * (half + 0.02)), f.n * side)
        };
        let light = shade(tint, rng.range(0.8, 1.1));
        leaf(b, rng, p, n, 0.12, light);
    }
}
