//! Street furniture. Everything stands at its frame's origin and faces n, the street.

use crate::material::{Mat, Tint, WHITE, shade};
use crate::mesh::{Builder, Frame, face};
use crate::rng::Rng;
use glam::DVec3;
use std::f64::consts::TAU;

const IRON: Tint = [0.07, 0.08, 0.085];

/// A street lamp, 6 m; its arm reaches over the street.
pub fn lamp(b: &mut Builder, f: &Frame) {
    b.tube(Mat::Paint, IRON, [f.o, f.at(0.0, 0.9, 0.0)], [0.13, 0.10], 10, true);
    b.tube(Mat::Paint, IRON, [f.at(0.0, 0.9, 0.0), f.at(0.0, 5.6, 0.0)], [0.07, 0.05], 8, false);
    let bend = [(0.0, 5.6), (0.25, 6.0), (0.8, 6.2), (1.5, 6.2)];
    for k in 0..3 {
        let (a, c) = (bend[k], bend[k + 1]);
        b.tube(Mat::Paint, IRON, [f.at(0.0, a.1, a.0), f.at(0.0, c.1, c.0)], [0.045, 0.045], 6, false);
    }
    b.cuboid(f, Mat::Paint, IRON, [-0.13, 0.13], [6.14, 6.27], [1.3, 1.95], face::ALL);
    b.cuboid(f, Mat::Fabric, [1.0, 0.97, 0.88], [-0.1, 0.1], [6.11, 6.14], [1.36, 1.9], face::ALL);
}

/// A low lamp of a park, 3.4 m.
pub fn park_lamp(b: &mut Builder, f: &Frame) {
    b.tube(Mat::Paint, IRON, [f.o, f.at(0.0, 0.5, 0.0)], [0.12, 0.08], 8, false);
    b.tube(Mat::Paint, IRON, [f.at(0.0, 0.5, 0.0), f.at(0.0, 2.9, 0.0)], [0.05, 0.04], 8, false);
    b.tube(Mat::Fabric, [1.0, 0.97, 0.9], [f.at(0.0, 2.9, 0.0), f.at(0.0, 3.3, 0.0)], [0.12, 0.2], 8, false);
    b.tube(Mat::Paint, IRON, [f.at(0.0, 3.3, 0.0), f.at(0.0, 3.5, 0.0)], [0.26, 0.0], 8, false);
}

/// A bench of slats.
pub fn bench(b: &mut Builder, rng: &mut Rng, f: &Frame) {
    let tint = shade(WHITE, rng.range(0.7, 1.0));
    for k in 0..4 {
        let w = -0.2 + 0.125 * f64::from(k);
        b.cuboid(f, Mat::Wood, tint, [-0.9, 0.9], [0.42, 0.46], [w, w + 0.1], face::ALL);
    }
    for k in 0..3 {
        let v = 0.56 + 0.13 * f64::from(k);
        b.cuboid(f, Mat::Wood, tint, [-0.9, 0.9], [v, v + 0.1], [-0.3, -0.26], face::ALL);
    }
    for u in [-0.75, 0.7] {
        b.cuboid(f, Mat::Paint, IRON, [u, u + 0.05], [0.0, 0.42], [0.18, 0.24], face::STANDING);
        b.cuboid(f, Mat::Paint, IRON, [u, u + 0.05], [0.0, 0.9], [-0.34, -0.3], face::STANDING);
        b.cuboid(f, Mat::Paint, IRON, [u, u + 0.05], [0.37, 0.42], [-0.3, 0.18], face::ALL);
    }
}

/// A litter bin.
pub fn bin(b: &mut Builder, f: &Frame) {
    b.tube(Mat::Paint, [0.06, 0.14, 0.09], [f.at(0.0, 0.05, 0.0), f.at(0.0, 0.85, 0.0)], [0.22, 0.26], 12, false);
    b.tube(Mat::Paint, IRON, [f.at(0.0, 0.85, 0.0), f.at(0.0, 0.9, 0.0)], [0.28, 0.28], 12, true);
    b.tube(Mat::Rubber, WHITE, [f.at(0.0, 0.89, 0.0), f.at(0.0, 0.905, 0.0)], [0.16, 0.16], 12, true);
}

/// A fire hydrant.
pub fn hydrant(b: &mut Builder, f: &Frame) {
    let red = [0.55, 0.05, 0.03];
    for (v0, v1, r0, r1) in
        [(0.0, 0.08, 0.17, 0.17), (0.08, 0.5, 0.11, 0.1), (0.5, 0.56, 0.15, 0.15), (0.56, 0.7, 0.11, 0.05)]
    {
        b.tube(Mat::Paint, red, [f.at(0.0, v0, 0.0), f.at(0.0, v1, 0.0)], [r0, r1], 10, true);
    }
    for (u, w) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0)] {
        let d = f.u * u + f.n * w;
        let o = f.at(0.0, 0.38, 0.0);
        b.tube(Mat::Paint, red, [o + d * 0.08, o + d * 0.17], [0.05, 0.06], 8, true);
    }
    b.tube(Mat::Metal, WHITE, [f.at(0.0, 0.7, 0.0), f.at(0.0, 0.75, 0.0)], [0.03, 0.03], 5, true);
}

/// Traffic lights on a pole: one toward u for the traffic that comes from there, one for those on foot.
pub fn traffic_light(b: &mut Builder, rng: &mut Rng, f: &Frame) {
    b.tube(Mat::Paint, IRON, [f.o, f.at(0.0, 5.4, 0.0)], [0.09, 0.07], 8, true);
    let reach = 3.4;
    b.tube(Mat::Paint, IRON, [f.at(0.0, 5.1, 0.0), f.at(0.0, 5.45, reach)], [0.06, 0.045], 6, true);
    let green = rng.chance(0.5);
    for (v, w) in [(2.5, 0.0), (4.65, reach - 0.2)] {
        head(b, &f.moved(0.0, v, w), green);
    }
    // The box of the button and the light for those on foot.
    let turned = f.turned(0.0);
    b.cuboid(&turned, Mat::Paint, [0.5, 0.35, 0.05], [-0.07, 0.07], [1.0, 1.25], [0.08, 0.18], face::ALL);
    b.cuboid(&turned, Mat::Rubber, WHITE, [-0.14, 0.14], [2.0, 2.55], [0.09, 0.3], face::ALL);
    b.cuboid(&turned, Mat::Paint, [0.7, 0.08, 0.03], [-0.09, 0.09], [2.32, 2.5], [0.3, 0.305], face::FRONT);
}

/// Three lights that face u.
fn head(b: &mut Builder, f: &Frame, green: bool) {
    b.cuboid(f, Mat::Rubber, WHITE, [0.08, 0.28], [-0.1, 0.95], [-0.17, 0.17], face::ALL);
    let lights: [Tint; 3] = if green {
        [[0.05, 0.75, 0.3], [0.12, 0.08, 0.02], [0.12, 0.02, 0.02]]
    } else {
        [[0.02, 0.1, 0.05], [0.12, 0.08, 0.02], [0.9, 0.06, 0.03]]
    };
    for (k, tint) in lights.into_iter().enumerate() {
        let v = 0.09 + 0.33 * k as f64;
        b.disc(Mat::Paint, tint, f.at(0.285, v, 0.0), f.u * 0.11, 10);
        b.cuboid(f, Mat::Rubber, WHITE, [0.28, 0.42], [v + 0.12, v + 0.14], [-0.13, 0.13], face::TOP | face::BOTTOM);
    }
}

/// A shelter with a bench; opens toward the street.
pub fn bus_stop(b: &mut Builder, rng: &mut Rng, f: &Frame) {
    let (half, depth, top) = (1.9, 1.3, 2.5);
    for u in [-half, half - 0.08] {
        for w in [-depth, -0.08] {
            b.cuboid(f, Mat::Paint, IRON, [u, u + 0.08], [0.0, top], [w, w + 0.08], face::STANDING);
        }
    }
    b.cuboid(f, Mat::Paint, IRON, [-half - 0.15, half + 0.15], [top, top + 0.12], [-depth - 0.1, 0.25], face::ALL);
    for k in 0..3 {
        let u = -half + 0.1 + f64::from(k) * 1.25;
        b.cuboid(f, Mat::Glass, [1.0; 3], [u, u + 1.18], [0.25, 2.35], [-depth + 0.03, -depth + 0.05], face::ALL);
    }
    b.cuboid(f, Mat::Glass, WHITE, [-half + 0.03, -half + 0.05], [0.25, 2.35], [-depth + 0.1, -0.2], face::ALL);
    let poster = rng.pick(&[[0.8, 0.25, 0.1], [0.15, 0.4, 0.7], [0.9, 0.8, 0.2], [0.75, 0.3, 0.5]]);
    b.cuboid(f, Mat::Paint, IRON, [half - 0.12, half], [0.3, 2.3], [-depth + 0.1, -0.1], face::ALL);
    for (u, faces) in [([half, half + 0.005], face::RIGHT), ([half - 0.125, half - 0.12], face::LEFT)] {
        b.cuboid(f, Mat::Paint, poster, u, [0.5, 2.15], [-depth + 0.2, -0.2], faces);
    }
    b.cuboid(f, Mat::Wood, WHITE, [-1.5, 1.0], [0.45, 0.5], [-depth + 0.15, -depth + 0.5], face::ALL);
    for u in [-1.3, 0.75] {
        b.cuboid(f, Mat::Paint, IRON, [u, u + 0.06], [0.0, 0.45], [-depth + 0.2, -depth + 0.4], face::STANDING);
    }
    let pole = f.moved(-half - 0.7, 0.0, -0.1);
    b.tube(Mat::Metal, WHITE, [pole.o, pole.at(0.0, 2.9, 0.0)], [0.035, 0.035], 6, true);
    b.cuboid(&pole, Mat::Paint, [0.08, 0.2, 0.5], [-0.02, 0.02], [2.35, 2.85], [-0.25, 0.25], face::ALL);
}

/// A bollard.
pub fn bollard(b: &mut Builder, f: &Frame) {
    b.tube(Mat::Paint, IRON, [f.o, f.at(0.0, 0.8, 0.0)], [0.07, 0.06], 8, false);
    b.tube(Mat::Paint, [0.8; 3], [f.at(0.0, 0.8, 0.0), f.at(0.0, 0.86, 0.0)], [0.07, 0.07], 8, false);
    b.tube(Mat::Paint, IRON, [f.at(0.0, 0.86, 0.0), f.at(0.0, 0.95, 0.0)], [0.06, 0.02], 8, true);
}

/// A letter box.
pub fn letter_box(b: &mut Builder, f: &Frame) {
    let blue = [0.05, 0.10, 0.35];
    b.cuboid(f, Mat::Paint, blue, [-0.28, 0.28], [0.2, 1.0], [-0.25, 0.25], face::ALL & !face::TOP);
    let arch: Vec<[f64; 2]> =
        (0..=6).map(|k| (f64::from(k) * TAU / 12.0).sin_cos()).map(|(s, c)| [0.25 * c, 1.0 + 0.22 * s]).collect();
    b.extrude(f, Mat::Paint, blue, &arch, [-0.28, 0.28], true);
    for (u, w) in [(-0.25, -0.22), (0.2, -0.22), (-0.25, 0.17), (0.2, 0.17)] {
        b.cuboid(f, Mat::Paint, blue, [u, u + 0.05], [0.0, 0.2], [w, w + 0.05], face::STANDING & !face::TOP);
    }
    b.cuboid(f, Mat::Paint, [0.85; 3], [-0.15, 0.15], [0.6, 0.8], [0.25, 0.255], face::FRONT);
}

/// A sign on a post.
pub fn sign(b: &mut Builder, rng: &mut Rng, f: &Frame) {
    b.tube(Mat::Metal, WHITE, [f.o, f.at(0.0, 2.7, 0.0)], [0.03, 0.03], 6, true);
    let turned = f.turned(std::f64::consts::FRAC_PI_2);
    match rng.int(0, 2) {
        0 => {
            let center = turned.at(0.0, 2.4, 0.04);
            b.tube(Mat::Paint, [0.6, 0.04, 0.03], [center, center + turned.n * 0.01], [0.3, 0.3], 16, true);
            b.tube(Mat::Paint, [0.9; 3], [center, center + turned.n * 0.014], [0.22, 0.22], 16, true);
        }
        1 => b.cuboid(&turned, Mat::Paint, [0.06, 0.15, 0.5], [-0.25, 0.25], [2.1, 2.65], [0.03, 0.05], face::ALL),
        _ => {
            b.cuboid(&turned, Mat::Paint, [0.05, 0.3, 0.16], [-0.5, 0.5], [2.45, 2.65], [0.03, 0.05], face::ALL);
            b.cuboid(&turned, Mat::Paint, [0.9; 3], [-0.4, 0.3], [2.52, 2.58], [0.05, 0.054], face::FRONT);
        }
    }
}

/// Bicycle stands, some with a bicycle.
pub fn bicycles(b: &mut Builder, rng: &mut Rng, f: &Frame) {
    for k in 0..4 {
        let stand = f.moved(f64::from(k) * 0.8 - 1.2, 0.0, 0.0);
        for w in [-0.35, 0.35] {
            b.tube(Mat::Metal, WHITE, [stand.at(0.0, 0.0, w), stand.at(0.0, 0.8, w)], [0.025, 0.025], 6, false);
        }
        b.tube(Mat::Metal, WHITE, [stand.at(0.0, 0.8, -0.35), stand.at(0.0, 0.8, 0.35)], [0.025, 0.025], 6, false);
        if rng.chance(0.6) {
            bicycle(b, rng, &stand.moved(0.14, 0.0, 0.0));
        }
    }
}

fn bicycle(b: &mut Builder, rng: &mut Rng, f: &Frame) {
    let paint = rng.pick(&[[0.5, 0.05, 0.05], [0.05, 0.2, 0.4], [0.05, 0.05, 0.05], [0.2, 0.45, 0.3]]);
    for w in [-0.52, 0.52] {
        let count = 12;
        let at = |k: u32, r: f64| {
            let (s, c) = (f64::from(k) * TAU / f64::from(count)).sin_cos();
            f.at(0.0, 0.34 + r * s, w + r * c)
        };
        for k in 0..count {
            b.tube(Mat::Rubber, WHITE, [at(k, 0.33), at(k + 1, 0.33)], [0.02, 0.02], 3, false);
            if k % 3 == 0 {
                b.tube(Mat::Metal, WHITE, [f.at(0.0, 0.34, w), at(k, 0.32)], [0.004, 0.004], 3, false);
            }
        }
    }
    let joint = |v: f64, w: f64| f.at(0.0, v, w);
    let (hub, crank, seat, neck) = (joint(0.34, -0.52), joint(0.3, -0.08), joint(0.85, -0.2), joint(0.82, 0.36));
    for (a, c) in [(hub, crank), (hub, seat), (crank, seat), (crank, neck), (seat, neck), (neck, joint(0.34, 0.52))] {
        b.tube(Mat::Paint, paint, [a, c], [0.018, 0.018], 4, false);
    }
    b.tube(Mat::Metal, WHITE, [neck, joint(1.0, 0.33)], [0.014, 0.014], 5, false);
    b.tube(Mat::Rubber, WHITE, [f.at(-0.26, 1.02, 0.3), f.at(0.26, 1.02, 0.3)], [0.016, 0.016], 5, true);
    b.cuboid(f, Mat::Rubber, WHITE, [-0.07, 0.07], [0.9, 0.94], [-0.34, -0.1], face::ALL);
}

/// A tub with a bush.
pub fn planter(b: &mut Builder, rng: &mut Rng, f: &Frame) {
    b.tube(Mat::Concrete, shade(WHITE, 0.9), [f.o, f.at(0.0, 0.55, 0.0)], [0.42, 0.55], 10, false);
    b.tube(Mat::Bark, WHITE, [f.at(0.0, 0.4, 0.0), f.at(0.0, 0.5, 0.0)], [0.5, 0.5], 10, true);
    let tint = rng.pick(&[WHITE, [0.9, 1.0, 0.8], [1.0, 0.9, 0.7]]);
    crate::vegetation::tuft(b, rng, f.at(0.0, 0.85, 0.0), 0.55, 34, tint);
}

/// A table with an umbrella and chairs.
pub fn table(b: &mut Builder, rng: &mut Rng, f: &Frame) {
    b.tube(Mat::Metal, WHITE, [f.at(0.0, 0.0, 0.0), f.at(0.0, 0.72, 0.0)], [0.04, 0.04], 6, false);
    b.tube(Mat::Wood, WHITE, [f.at(0.0, 0.72, 0.0), f.at(0.0, 0.75, 0.0)], [0.42, 0.42], 12, true);
    b.tube(Mat::Wood, WHITE, [f.at(0.0, 0.75, 0.0), f.at(0.0, 2.5, 0.0)], [0.025, 0.025], 5, false);
    let tint = rng.pick(&[[0.75, 0.70, 0.6], [0.6, 0.1, 0.08], [0.1, 0.25, 0.4], [0.85, 0.83, 0.78]]);
    for k in 0..8 {
        let at = |k: u32| {
            let (s, c) = (f64::from(k) * TAU / 8.0).sin_cos();
            f.at(1.35 * s, 2.1, 1.35 * c)
        };
        b.fan(Mat::Fabric, shade(tint, 0.9 + 0.1 * f64::from(k % 2)), &[at(k), at(k + 1), f.at(0.0, 2.55, 0.0)]);
    }
    for k in 0..3 {
        let c = f.turned(f64::from(k) * 2.1 + rng.range(0.0, 0.4)).moved(0.0, 0.0, 0.8);
        b.cuboid(&c, Mat::Metal, WHITE, [-0.2, 0.2], [0.43, 0.46], [-0.2, 0.2], face::ALL);
        b.cuboid(&c, Mat::Metal, WHITE, [-0.2, 0.2], [0.6, 0.88], [0.18, 0.2], face::ALL);
        for (u, w) in [(-0.19, -0.19), (0.17, -0.19), (-0.19, 0.17), (0.17, 0.17)] {
            b.cuboid(&c, Mat::Metal, [0.7; 3], [u, u + 0.02], [0.0, 0.43], [w, w + 0.02], face::STANDING & !face::TOP);
        }
    }
}

/// A round basin of radius `r` with a column in its middle.
pub fn fountain(b: &mut Builder, f: &Frame, r: f64) {
    let sides = 28;
    let up = |v: f64| f.at(0.0, v, 0.0);
    b.tube(Mat::Stone, WHITE, [up(0.0), up(0.55)], [r, r], sides, false);
    b.tube(Mat::Stone, shade(WHITE, 0.95), [up(0.55), up(0.56)], [r + 0.08, r - 0.35], sides, false);
    // The inside of the rim, seen from within.
    b.tube(Mat::Stone, shade(WHITE, 0.8), [up(0.56), up(0.2)], [r - 0.35, r - 0.36], sides, false);
    b.tube(Mat::Water, WHITE, [up(0.3), up(0.42)], [r - 0.3, r - 0.35], sides, true);
    for (v0, v1, r0, r1) in [
        (0.3, 0.6, 0.7, 0.5),
        (0.6, 1.5, 0.28, 0.22),
        (1.5, 1.75, 0.3, 1.2),
        (1.75, 1.82, 1.2, 1.2),
        (1.82, 2.6, 0.16, 0.12),
        (2.6, 2.8, 0.2, 0.55),
    ] {
        b.tube(Mat::Stone, shade(WHITE, 0.95), [up(v0), up(v1)], [r0, r1], 16, true);
    }
    b.tube(Mat::Water, WHITE, [up(1.8), up(1.83)], [1.1, 1.1], 16, true);
    for k in 0..10 {
        let (s, c) = (f64::from(k) * TAU / 10.0).sin_cos();
        let edge = |d: f64, v: f64| f.at(s * d, v, c * d);
        b.tube(Mat::Water, [1.0; 3], [edge(1.2, 1.8), edge(1.55, 1.3)], [0.03, 0.035], 5, false);
        b.tube(Mat::Water, [1.0; 3], [edge(1.55, 1.3), edge(1.65, 0.42)], [0.035, 0.04], 5, false);
    }
}

/// A figure on a pedestal.
pub fn statue(b: &mut Builder, rng: &mut Rng, f: &Frame) {
    b.cuboid(f, Mat::Stone, WHITE, [-1.1, 1.1], [0.0, 0.3], [-1.1, 1.1], face::STANDING);
    b.cuboid(f, Mat::Stone, WHITE, [-0.8, 0.8], [0.3, 2.2], [-0.8, 0.8], face::STANDING);
    b.cuboid(f, Mat::Stone, WHITE, [-0.95, 0.95], [2.2, 2.4], [-0.95, 0.95], face::ALL);
    let bronze = [0.25, 0.36, 0.3];
    let turn = f.turned(rng.range(-0.5, 0.5));
    let mut limb = |a: [f64; 3], c: [f64; 3], r: [f64; 2]| {
        let at = |p: [f64; 3]| turn.at(p[0], 2.4 + p[1], p[2]);
        b.tube(Mat::Metal, bronze, [at(a), at(c)], r, 9, true);
    };
    limb([-0.2, 0.0, 0.0], [-0.15, 0.95, 0.0], [0.15, 0.14]);
    limb([0.2, 0.0, 0.15], [0.12, 0.95, 0.0], [0.15, 0.14]);
    limb([0.0, 0.85, 0.0], [0.0, 1.65, 0.03], [0.24, 0.3]);
    limb([0.0, 1.65, 0.03], [0.0, 1.78, 0.05], [0.12, 0.1]);
    limb([0.0, 1.76, 0.05], [0.0, 2.08, 0.06], [0.12, 0.13]);
    limb([-0.3, 1.6, 0.0], [-0.5, 0.95, 0.1], [0.1, 0.07]);
    limb([0.3, 1.6, 0.0], [0.75, 2.2, 0.2], [0.1, 0.06]);
}

/// A fence of pickets from u = 0 to `length`.
pub fn fence(b: &mut Builder, f: &Frame, length: f64, tint: Tint) {
    for v in [0.3, 0.8] {
        b.cuboid(
            f,
            Mat::Paint,
            tint,
            [0.0, length],
            [v, v + 0.06],
            [-0.02, 0.02],
            face::FRONT | face::BACK | face::TOP,
        );
    }
    let count = (length / 0.36).floor().max(1.0);
    for k in 0..count as u32 {
        let u = (f64::from(k) + 0.5) * length / count;
        b.cuboid(f, Mat::Paint, tint, [u - 0.055, u + 0.055], [0.05, 1.0], [0.02, 0.04], face::FRONT | face::TOP);
        b.panel(f, Mat::Paint, shade(tint, 0.9), [u + 0.055, u - 0.055], [0.05, 1.0], 0.0195);
    }
}

/// A kiosk.
pub fn kiosk(b: &mut Builder, rng: &mut Rng, f: &Frame) {
    let tint = rng.pick(&[[0.08, 0.2, 0.14], [0.25, 0.06, 0.05], [0.1, 0.14, 0.25]]);
    b.cuboid(f, Mat::Paint, tint, [-1.5, 1.5], [0.0, 1.0], [-1.1, 1.1], face::STANDING);
    b.cuboid(f, Mat::Glass, WHITE, [-1.4, 1.4], [1.0, 2.2], [-1.0, 1.0], face::ALL & !face::TOP & !face::BOTTOM);
    for u in [-1.5, -0.05, 1.4] {
        b.cuboid(f, Mat::Paint, tint, [u, u + 0.1], [1.0, 2.2], [1.0, 1.1], face::ALL);
        b.cuboid(f, Mat::Paint, tint, [u, u + 0.1], [1.0, 2.2], [-1.1, -1.0], face::ALL);
    }
    b.cuboid(f, Mat::Paint, tint, [-1.8, 1.8], [2.2, 2.45], [-1.4, 1.6], face::ALL);
    b.cuboid(f, Mat::Wood, WHITE, [-1.5, 1.5], [0.98, 1.04], [1.1, 1.4], face::ALL);
    let p = DVec3::Y * 2.45;
    let corner = |u: f64, w: f64| f.at(u, 2.45, w);
    let top = f.o + p + DVec3::Y * 0.9;
    let ring = [corner(-1.6, 1.3), corner(1.6, 1.3), corner(1.6, -1.2), corner(-1.6, -1.2)];
    for k in 0..4 {
        b.fan(Mat::Slate, WHITE, &[ring[k], ring[(k + 1) % 4], top]);
    }
}

/// A swing and a slide.
pub fn playground(b: &mut Builder, f: &Frame) {
    let red = [0.6, 0.08, 0.05];
    for u in [-1.5, 1.5] {
        for w in [-0.8, 0.8] {
            b.tube(Mat::Paint, red, [f.at(u, 0.0, w), f.at(u, 2.3, 0.0)], [0.05, 0.05], 6, false);
        }
    }
    b.tube(Mat::Paint, red, [f.at(-1.6, 2.3, 0.0), f.at(1.6, 2.3, 0.0)], [0.05, 0.05], 6, true);
    for u in [-0.8, 0.5] {
        for d in [0.0, 0.4] {
            b.tube(Mat::Metal, WHITE, [f.at(u + d, 2.3, 0.0), f.at(u + d, 0.5, 0.1)], [0.012, 0.012], 4, false);
        }
        b.cuboid(f, Mat::Wood, WHITE, [u - 0.03, u + 0.43], [0.46, 0.5], [-0.02, 0.22], face::ALL);
    }
    let s = f.moved(4.2, 0.0, 0.0);
    let blue = [0.06, 0.2, 0.5];
    b.cuboid(&s, Mat::Wood, WHITE, [-0.5, 0.5], [1.5, 1.58], [-1.4, -0.4], face::ALL);
    for (u, w) in [(-0.5, -1.4), (0.4, -1.4), (-0.5, -0.5), (0.4, -0.5)] {
        b.cuboid(&s, Mat::Wood, WHITE, [u, u + 0.1], [0.0, 2.3], [w, w + 0.1], face::STANDING);
    }
    for (a, c) in [((-0.4, 1.58), (1.6, 0.3)), ((1.6, 0.3), (2.2, 0.25))] {
        let (p, q) = (|u: f64| s.at(u, a.1, a.0), |u: f64| s.at(u, c.1, c.0));
        b.fan(Mat::Fabric, blue, &[q(-0.35), q(0.35), p(0.35), p(-0.35)]);
        for u in [-0.35, 0.35] {
            b.fan(Mat::Fabric, shade(blue, 0.9), &[p(u), q(u), q(u) + DVec3::Y * 0.2, p(u) + DVec3::Y * 0.2]);
        }
    }
    for k in 0..6 {
        let v = 0.25 * f64::from(k + 1);
        b.tube(Mat::Metal, WHITE, [s.at(-0.4, v, -1.4), s.at(0.4, v, -1.4)], [0.02, 0.02], 5, false);
    }
}
