//! Structural steel: columns, beams, braces, gratings, railings, ladders, stairs.

use crate::material::{Mat, Tint, shade};
use crate::mesh::{Builder, Frame, face};
use crate::rng::Rng;
use crate::solid::{rod, torus};
use glam::DVec3;

/// The colour of the plant's steel.
pub const STEEL: Tint = [0.32, 0.37, 0.36];
/// The colour of railings.
pub const RAIL: Tint = [0.78, 0.58, 0.08];

/// An I-beam along u of `f` from 0 to `length`, `h` high and `w` wide, its top at v = 0.
pub fn beam(b: &mut Builder, f: &Frame, length: f64, [h, w]: [f64; 2], tint: Tint) {
    let t = 0.06 * h;
    let u = [0.0, length];
    let along = face::TOP | face::BOTTOM | face::FRONT | face::BACK;
    b.cuboid(f, Mat::Paint, tint, u, [-t, 0.0], [-0.5 * w, 0.5 * w], along);
    b.cuboid(f, Mat::Paint, tint, u, [-h, t - h], [-0.5 * w, 0.5 * w], along);
    b.cuboid(f, Mat::Paint, tint, u, [t - h, -t], [-0.4 * t, 0.4 * t], face::FRONT | face::BACK);
    // Stiffeners where something may be fastened.
    let count = (length / 1.6).floor().max(1.0);
    for k in 0..count as u32 {
        let at = (f64::from(k) + 0.5) * length / count;
        for side in [[0.4 * t, 0.48 * w], [-0.48 * w, -0.4 * t]] {
            let plate = [at - 0.005, at + 0.005];
            b.cuboid(f, Mat::Paint, tint, plate, [t - h, -t], side, face::LEFT | face::RIGHT);
        }
    }
}

/// A column of H section at `o` up to `height`, with a foot and bolts.
pub fn column(b: &mut Builder, o: DVec3, height: f64) {
    let f = Frame { o, u: DVec3::Y, v: DVec3::X, n: -DVec3::Z };
    beam(b, &f.moved(0.0, 0.14, 0.0), height, [0.28, 0.28], STEEL);
    let foot = Frame::standing(o, 0.0);
    b.cuboid(&foot, Mat::Concrete, [0.9; 3], [-0.4, 0.4], [0.0, 0.18], [-0.4, 0.4], face::STANDING);
    b.cuboid(&foot, Mat::Paint, STEEL, [-0.26, 0.26], [0.18, 0.21], [-0.26, 0.26], face::STANDING);
    for (x, z) in [(-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2)] {
        let p = foot.at(x, 0.21, z);
        b.tube(Mat::Steel, [0.5; 3], [p, p + DVec3::Y * 0.05], [0.025; 2], 6, true);
    }
}

/// Two crossing braces between (0, 0) and (u, v) of `f`.
pub fn brace(b: &mut Builder, f: &Frame, u: f64, v: f64) {
    for (a, c) in
        [(f.at(0.15, 0.3, 0.0), f.at(u - 0.15, v - 0.5, 0.0)), (f.at(u - 0.15, 0.3, 0.03), f.at(0.15, v - 0.5, 0.03))]
    {
        rod(b, Mat::Paint, STEEL, a, c, 0.045);
    }
}

/// A floor of grating over u and w of `f`, its top at v = 0: bearing bars along u, rods across.
pub fn grating(b: &mut Builder, f: &Frame, [u0, u1]: [f64; 2], [w0, w1]: [f64; 2]) {
    const PITCH: f64 = 0.07;
    let tint = [0.7, 0.71, 0.72];
    let count = ((w1 - w0) / PITCH).round().max(1.0);
    for k in 0..=count as u32 {
        let w = w0 + (w1 - w0) * f64::from(k) / count;
        let w = w.clamp(w0 + 0.004, w1 - 0.004);
        let edge = k == 0 || f64::from(k) == count;
        let deep = if edge { 0.06 } else { 0.03 };
        b.cuboid(
            f,
            Mat::Steel,
            tint,
            [u0, u1],
            [-deep, 0.0],
            [w - 0.003, w + 0.003],
            face::ALL & !(face::LEFT | face::RIGHT),
        );
    }
    let rods = ((u1 - u0) / 0.35).round().max(1.0);
    for k in 0..=rods as u32 {
        let u = (u0 + (u1 - u0) * f64::from(k) / rods).clamp(u0 + 0.005, u1 - 0.005);
        let ends = [f.at(u, -0.008, w0), f.at(u, -0.008, w1)];
        b.tube(Mat::Steel, shade(tint, 0.9), ends, [0.005; 2], 3, false);
    }
}

/// A floor of plates over u and w of `f`, its top at v = 0.
pub fn plates(b: &mut Builder, rng: &mut Rng, f: &Frame, [u0, u1]: [f64; 2], [w0, w1]: [f64; 2]) {
    let count = [u1 - u0, w1 - w0].map(|length| (length / 1.6).round().max(1.0));
    for i in 0..count[0] as u32 {
        for j in 0..count[1] as u32 {
            let part = |k: u32, n: f64, a: f64, c: f64| a + (c - a) * f64::from(k) / n;
            let u = [part(i, count[0], u0, u1) + 0.004, part(i + 1, count[0], u0, u1) - 0.004];
            let w = [part(j, count[1], w0, w1) + 0.004, part(j + 1, count[1], w0, w1) - 0.004];
            let tint = shade([0.5, 0.5, 0.49], rng.range(0.75, 1.0));
            b.cuboid(f, Mat::Steel, tint, u, [-0.012, 0.0], w, face::ALL);
        }
    }
}

/// A railing along u of `f` from `u0` to `u1`: posts, two rails, a toe plate.
pub fn railing(b: &mut Builder, f: &Frame, [u0, u1]: [f64; 2]) {
    let count = ((u1 - u0) / 1.4).round().max(1.0);
    for k in 0..=count as u32 {
        let u = u0 + (u1 - u0) * f64::from(k) / count;
        rod(b, Mat::Paint, RAIL, f.at(u, -0.1, 0.0), f.at(u, 1.1, 0.0), 0.021);
    }
    for v in [0.55, 1.1] {
        rod(b, Mat::Paint, RAIL, f.at(u0 - 0.03, v, 0.0), f.at(u1 + 0.03, v, 0.0), 0.0205);
    }
    b.cuboid(f, Mat::Paint, RAIL, [u0, u1], [0.01, 0.11], [-0.003, 0.003], face::FRONT | face::BACK | face::TOP);
}

/// A ladder in the plane of `f` from v = 0 to `height`, climbed from n, with a cage above 2.2 m.
pub fn ladder(b: &mut Builder, f: &Frame, height: f64) {
    for u in [-0.23, 0.23] {
        b.cuboid(
            f,
            Mat::Paint,
            RAIL,
            [u - 0.006, u + 0.006],
            [0.0, height + 1.0],
            [-0.03, 0.03],
            face::ALL & !face::BOTTOM,
        );
    }
    for k in 1..=(height / 0.3) as u32 {
        let v = 0.3 * f64::from(k);
        b.tube(Mat::Paint, RAIL, [f.at(-0.23, v, 0.0), f.at(0.23, v, 0.0)], [0.013; 2], 6, false);
    }
    if height < 3.0 {
        return;
    }
    let bow = |angle: f64| (0.36 * angle.sin(), 0.33 - 0.4 * angle.cos());
    let hoops = ((height - 1.4) / 0.9) as u32;
    for k in 0..hoops {
        let v = 2.3 + 0.9 * f64::from(k);
        for s in 0..10 {
            let [a, c] = [s, s + 1].map(|s| bow(0.9 + f64::from(s) * 0.4483));
            let points = [f.at(a.0, v, a.1), f.at(c.0, v, c.1), f.at(c.0, v + 0.05, c.1), f.at(a.0, v + 0.05, a.1)];
            b.fan(Mat::Paint, RAIL, &points);
            b.fan(Mat::Paint, RAIL, &[points[3], points[2], points[1], points[0]]);
        }
    }
    for s in [1, 3, 5, 7, 9] {
        let (u, w) = bow(0.9 + f64::from(s) * 0.4483);
        let top = 2.35 + 0.9 * f64::from(hoops.max(1) - 1);
        b.tube(Mat::Paint, RAIL, [f.at(u, 2.3, w), f.at(u, top, w)], [0.012; 2], 5, false);
    }
}

/// A flight of stairs along u of `f`, up to `height` within `length`, `width` wide about n = 0, with rails.
pub fn stairs(b: &mut Builder, f: &Frame, height: f64, length: f64, width: f64) {
    let steps = (height / 0.2).round();
    let half = 0.5 * width;
    for k in 1..=steps as u32 {
        let (u, v) = (length * f64::from(k) / steps, height * f64::from(k) / steps);
        grating_step(b, &f.moved(u, v, 0.0), length / steps, half);
    }
    for w in [-half - 0.02, half + 0.02] {
        let side = [[0.0, -0.05], [length, height - 0.05], [length, height + 0.2], [0.0, 0.2]];
        let at = |x: f64| side.map(|[u, v]| f.at(u, v, w + x));
        b.fan(Mat::Paint, STEEL, &at(0.006));
        let mut back = at(-0.006);
        back.reverse();
        b.fan(Mat::Paint, STEEL, &back);
        for v in [0.6, 1.0] {
            rod(b, Mat::Paint, RAIL, f.at(0.0, v, w), f.at(length, height + v, w), 0.02);
        }
        for k in 0..=4 {
            let t = f64::from(k) / 4.0;
            rod(b, Mat::Paint, RAIL, f.at(length * t, height * t, w), f.at(length * t, height * t + 1.0, w), 0.0195);
        }
    }
}

fn grating_step(b: &mut Builder, f: &Frame, depth: f64, half: f64) {
    for k in 0..5 {
        let u = -depth + depth * f64::from(k) / 4.0;
        let w = [-half, half];
        b.cuboid(
            f,
            Mat::Steel,
            [0.7; 3],
            [u - 0.003, u + 0.003],
            [-0.03, 0.0],
            w,
            face::ALL & !(face::FRONT | face::BACK),
        );
    }
}

/// A round platform with a railing around a vessel of radius `inner`.
pub fn gallery(b: &mut Builder, o: DVec3, inner: f64, outer: f64) {
    use std::f64::consts::TAU;
    let count = (TAU * outer / 0.5).round();
    let direction = |k: f64| {
        let (s, c) = (k * TAU / count).sin_cos();
        DVec3::new(c, 0.0, s)
    };
    for k in 0..count as u32 {
        let (d0, d1) = (direction(f64::from(k)), direction(f64::from(k + 1)));
        let tint = shade([0.55; 3], if k % 2 == 0 { 1.0 } else { 0.85 });
        let [a, c, d, e] = [d0 * inner, d1 * inner, d1 * outer, d0 * outer].map(|p| o + p);
        b.fan(Mat::Steel, tint, &[a, c, d, e]);
        let down = DVec3::Y * 0.04;
        b.fan(Mat::Steel, shade(tint, 0.8), &[e - down, d - down, c - down, a - down]);
        b.fan(Mat::Paint, RAIL, &[e - down, e + down * 3.0, d + down * 3.0, d - down]);
        b.fan(Mat::Paint, RAIL, &[d - down, d + down * 3.0, e + down * 3.0, e - down]);
        if k % 2 == 0 {
            rod(b, Mat::Paint, RAIL, o + d0 * (outer - 0.03), o + d0 * (outer - 0.03) + DVec3::Y * 1.1, 0.02);
        }
        if k % 4 == 0 {
            rod(b, Mat::Paint, STEEL, o + d0 * (0.98 * inner) - DVec3::Y * 0.7, o + d0 * (0.95 * outer) - down, 0.035);
        }
    }
    for v in [0.55, 1.1] {
        torus_wide(b, o + DVec3::Y * v, outer - 0.03);
    }
}

fn torus_wide(b: &mut Builder, o: DVec3, ring: f64) {
    torus(b, Mat::Paint, RAIL, o, DVec3::Y, ring, 0.0195);
}
