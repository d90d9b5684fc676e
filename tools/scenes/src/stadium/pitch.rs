//! The pitch, its lines, goals and flags; the ground outside; the pedestal in the middle.

use crate::material::{Mat, Tint, WHITE, shade};
use crate::mesh::{Builder, Frame, face};
use crate::rng::Rng;
use crate::solid::{lathe, rod, tube};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Half the pitch, metres.
const HALF: [f64; 2] = [52.5, 34.0];
/// Height of the table on which the teapot stands, metres.
pub const TABLE: f64 = 1.05;
/// Height of paint above grass, metres.
const PAINT: f64 = 0.004;

fn quad(b: &mut Builder, m: Mat, tint: Tint, [x0, x1]: [f64; 2], [z0, z1]: [f64; 2], y: f64) {
    let points = [[x0, z1], [x1, z1], [x1, z0], [x0, z0]];
    b.fan(m, tint, &points.map(|[x, z]| DVec3::new(x, y, z)));
}

/// Everything on the ground.
pub fn pitch(seed: u64) -> Builder {
    let mut b = Builder::smooth();
    let rng = &mut Rng::new(seed, &[50]);
    // Mown in stripes, each a little uneven.
    let [stripes, rows] = [20, 12];
    for i in 0..stripes {
        for j in 0..rows {
            let at = |k: u32, n: u32, half: f64| -half + 2.0 * half * f64::from(k) / f64::from(n);
            let x = [at(i, stripes, HALF[0] + 4.0), at(i + 1, stripes, HALF[0] + 4.0)];
            let z = [at(j, rows, HALF[1] + 4.0), at(j + 1, rows, HALF[1] + 4.0)];
            let tint = shade([0.75, 1.0, 0.6], if i % 2 == 0 { 1.0 } else { 0.78 } * rng.range(0.94, 1.0));
            quad(&mut b, Mat::Grass, tint, x, z, 0.0);
        }
    }
    quad(&mut b, Mat::Paving, [0.75, 0.8, 0.85], [-140.0, 140.0], [-120.0, 120.0], -0.06);
    quad(&mut b, Mat::Grass, [0.85, 0.95, 0.75], [-420.0, 420.0], [-420.0, 420.0], -0.15);
    lines(&mut b);
    for side in [-1.0, 1.0] {
        goal(&mut b, side);
        for z in [-1.0, 1.0] {
            let o = DVec3::new(side * HALF[0], 0.0, z * HALF[1]);
            rod(&mut b, Mat::Paint, [0.9, 0.85, 0.2], o, o + DVec3::Y * 1.5, 0.015);
            let flag = [o + DVec3::Y * 1.5, o + DVec3::Y * 1.15, o + DVec3::new(0.45, 1.33, 0.08)];
            b.fan(Mat::Fabric, [0.85, 0.15, 0.05], &flag);
        }
        bench(&mut b, side);
    }
    pedestal(&mut b);
    b
}

fn lines(b: &mut Builder) {
    let mut stroke = |x: [f64; 2], z: [f64; 2]| quad(b, Mat::Marking, WHITE, x, z, PAINT);
    let w = 0.06;
    let [hx, hz] = HALF;
    for s in [-1.0, 1.0] {
        stroke([-hx - w, hx + w], [s * hz - w, s * hz + w]);
        stroke([s * hx - w, s * hx + w], [-hz, hz]);
        for (depth, half) in [(16.5, 20.16), (5.5, 9.16)] {
            let x = s * (hx - depth);
            stroke([x - w, x + w], [-half - w, half + w]);
            for z in [-half, half] {
                let [x0, x1] = if s > 0.0 { [x, hx] } else { [-hx, x] };
                stroke([x0, x1], [z - w, z + w]);
            }
        }
    }
    stroke([-w, w], [-hz, hz]);
    let mut ring = |x: f64, z: f64, r: f64, from: f64, to: f64, count: u32| {
        for k in 0..count {
            let [a, c] = [k, k + 1].map(|k| from + (to - from) * f64::from(k) / f64::from(count));
            let at = |angle: f64, r: f64| DVec3::new(x + r * angle.cos(), PAINT, z - r * angle.sin());
            b.fan(Mat::Marking, WHITE, &[at(a, r - w), at(a, r + w), at(c, r + w), at(c, r - w)]);
        }
    };
    ring(0.0, 0.0, 9.15, 0.0, TAU, 96);
    for s in [-1.0, 1.0] {
        let half = (5.5f64 / 9.15).acos();
        let toward = if s > 0.0 { PI } else { 0.0 };
        ring(s * (hx - 11.0), 0.0, 9.15, toward - half, toward + half, 32);
        ring(s * (hx - 11.0), 0.0, 0.07, 0.0, TAU, 12);
    }
}

fn goal(b: &mut Builder, side: f64) {
    let [x, half, high] = [side * HALF[0], 3.66, 2.44];
    let at = |dx: f64, y: f64, z: f64| DVec3::new(x + side * dx, y, z);
    for z in [-half, half] {
        rod(b, Mat::Paint, WHITE, at(0.0, 0.0, z), at(0.0, high, z), 0.06);
        rod(b, Mat::Paint, WHITE, at(0.0, high, z), at(1.0, high, z), 0.025);
        rod(b, Mat::Paint, WHITE, at(1.0, high, z), at(2.2, 0.0, z), 0.025);
    }
    rod(b, Mat::Paint, WHITE, at(0.0, high, -half), at(0.0, high, half), 0.0595);
    rod(b, Mat::Paint, WHITE, at(2.2, 0.03, -half), at(2.2, 0.03, half), 0.025);
    // The net, of meshes of 15 cm.
    let mut cord = |a: DVec3, c: DVec3| tube(b, Mat::Paint, [0.9; 3], a, c, 0.004);
    let back = |s: f64, z: f64| {
        if s < 1.0 { at(s, high, z) } else { at(1.0 + 1.2 * (s - 1.0) / 2.73, high - high * (s - 1.0) / 2.73, z) }
    };
    for k in 0..=48 {
        let z = -half + 2.0 * half * f64::from(k) / 48.0;
        cord(back(0.0, z), back(1.0, z));
        cord(back(1.0, z), back(3.73, z));
    }
    for k in 1..25 {
        let s = 3.73 * f64::from(k) / 25.0;
        cord(back(s, -half), back(s, half));
        for z in [-half, half] {
            let p = back(s, z);
            cord(p, DVec3::new(p.x, 0.0, z));
        }
    }
}

/// The bench for those who wait, under a glass roof.
fn bench(b: &mut Builder, side: f64) {
    let f = Frame::standing(DVec3::new(side * 14.0, 0.0, -HALF[1] - 3.2), 0.0);
    b.cuboid(&f, Mat::Paint, [0.75; 3], [-5.0, 5.0], [0.0, 0.1], [-1.2, 0.3], face::STANDING);
    for k in 0..14 {
        let g = f.moved(-4.6 + 0.7 * f64::from(k), 0.1, -0.6);
        b.cuboid(&g, Mat::Paint, [0.1, 0.1, 0.12], [-0.26, 0.26], [0.35, 0.48], [-0.25, 0.25], face::ALL);
        b.cuboid(&g, Mat::Paint, [0.1, 0.1, 0.12], [-0.26, 0.26], [0.48, 1.2], [-0.35, -0.25], face::ALL);
    }
    for k in 0..8 {
        let [a, c] = [k, k + 1].map(|k| {
            let (s, c) = (f64::from(k) / 8.0 * 1.9).sin_cos();
            [-1.2 + 1.5 * (1.0 - c), 2.1 * s]
        });
        let points = [f.at(-5.0, a[1], a[0]), f.at(5.0, a[1], a[0]), f.at(5.0, c[1], c[0]), f.at(-5.0, c[1], c[0])];
        b.fan(Mat::TowerGlass, WHITE, &points);
        b.fan(Mat::TowerGlass, WHITE, &[points[3], points[2], points[1], points[0]]);
    }
}

/// A pedestal of stone on the centre spot with a round top and a cloth of paving.
fn pedestal(b: &mut Builder) {
    let o = DVec3::ZERO;
    let stone: Tint = [0.9, 0.87, 0.82];
    let f = Frame::standing(o, 0.0);
    b.cuboid(&f, Mat::Stone, stone, [-0.42, 0.42], [0.0, 0.1], [-0.42, 0.42], face::STANDING);
    b.cuboid(&f, Mat::Stone, shade(stone, 0.93), [-0.36, 0.36], [0.1, 0.18], [-0.36, 0.36], face::STANDING);
    let mut profile: Vec<[f64; 2]> = vec![[0.31, 0.18], [0.31, 0.215]];
    // A torus, a fluted shaft's swell, and mouldings under the top.
    profile.extend((0..=8).map(|k| {
        let a = -0.5 * PI + PI * f64::from(k) / 8.0;
        [0.27 + 0.035 * a.cos(), 0.25 + 0.035 * a.sin()]
    }));
    profile.extend((0..=12).map(|k| {
        let t = f64::from(k) / 12.0;
        [0.225 - 0.05 * t + 0.012 * (t * PI).sin(), 0.3 + 0.56 * t]
    }));
    profile.extend((0..=6).map(|k| {
        let a = 0.5 * PI * f64::from(k) / 6.0;
        [0.185 + 0.1 * (1.0 - a.cos()), 0.88 + 0.07 * a.sin()]
    }));
    profile.extend([[0.31, 0.955], [0.31, 0.985]]);
    lathe(b, Mat::Stone, stone, o, DVec3::Y, &profile, 72);
    let top = [[0.33, 0.985], [0.345, 0.995], [0.35, 1.015], [0.345, 1.035], [0.33, TABLE], [0.0, TABLE]];
    lathe(b, Mat::Stone, [0.42, 0.3, 0.26], o, DVec3::Y, &[[0.3, 0.985], [0.33, 0.985]], 96);
    lathe(b, Mat::Stone, [0.42, 0.3, 0.26], o, DVec3::Y, &top, 96);
}
