//! Cars, vans and buses: convex bodies, glass, wheels, lights. u is to the side, n the direction of travel.

use crate::material::{Mat, Tint, WHITE, shade};
use crate::mesh::{Builder, Frame, face};
use crate::rng::Rng;

/// Kinds of vehicles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vehicle {
    /// A saloon.
    Saloon,
    /// A short car.
    Hatchback,
    /// A high car.
    Suv,
    /// A delivery van.
    Van,
    /// A city bus.
    Bus,
}

/// Tints of cars, common ones more than once.
const COLORS: [Tint; 14] = [
    [0.9, 0.9, 0.9],
    [0.8, 0.8, 0.8],
    [0.02, 0.02, 0.022],
    [0.035, 0.035, 0.04],
    [0.35, 0.36, 0.38],
    [0.5, 0.51, 0.53],
    [0.16, 0.17, 0.18],
    [0.03, 0.06, 0.22],
    [0.10, 0.20, 0.38],
    [0.48, 0.03, 0.03],
    [0.30, 0.02, 0.03],
    [0.10, 0.16, 0.11],
    [0.62, 0.55, 0.42],
    [0.85, 0.48, 0.02],
];

struct Body {
    half: f64,
    profile: Vec<[f64; 2]>,
    /// Cabin at its foot and at its top: [rear, front] along n.
    foot: [f64; 2],
    top: [f64; 2],
    waist: f64,
    roof: f64,
    /// Positions of the axles.
    axles: [f64; 2],
    wheel: f64,
    /// The rear of the cabin has no windows.
    cargo: bool,
}

/// A vehicle with its wheels on v = 0 and its middle at the origin.
pub fn vehicle(b: &mut Builder, rng: &mut Rng, kind: Vehicle) {
    let f = Frame::standing(glam::DVec3::ZERO, 0.0);
    let body = match kind {
        Vehicle::Bus => return bus(b, rng, &f),
        Vehicle::Saloon => Body {
            half: 0.89,
            profile: vec![
                [-2.2, 0.3],
                [2.15, 0.26],
                [2.27, 0.5],
                [2.12, 0.7],
                [0.95, 0.88],
                [-1.6, 0.93],
                [-2.25, 0.86],
            ],
            foot: [-1.65, 1.05],
            top: [-1.0, 0.3],
            waist: 0.88,
            roof: 1.43,
            axles: [-1.35, 1.38],
            wheel: 0.32,
            cargo: false,
        },
        Vehicle::Hatchback => Body {
            half: 0.86,
            profile: vec![
                [-1.85, 0.3],
                [1.8, 0.27],
                [1.93, 0.5],
                [1.8, 0.72],
                [0.85, 0.92],
                [-1.8, 0.95],
                [-1.92, 0.7],
            ],
            foot: [-1.8, 0.98],
            top: [-1.45, 0.25],
            waist: 0.91,
            roof: 1.48,
            axles: [-1.2, 1.2],
            wheel: 0.31,
            cargo: false,
        },
        Vehicle::Suv => Body {
            half: 0.94,
            profile: vec![
                [-2.2, 0.38],
                [2.15, 0.36],
                [2.28, 0.6],
                [2.18, 0.92],
                [1.0, 1.08],
                [-2.1, 1.1],
                [-2.28, 0.8],
            ],
            foot: [-2.12, 1.1],
            top: [-1.8, 0.4],
            waist: 1.06,
            roof: 1.72,
            axles: [-1.38, 1.4],
            wheel: 0.37,
            cargo: false,
        },
        Vehicle::Van => Body {
            half: 0.98,
            profile: vec![[-2.6, 0.35], [2.5, 0.35], [2.62, 0.6], [2.5, 1.0], [2.0, 1.22], [-2.6, 1.24], [-2.65, 0.8]],
            foot: [-2.6, 2.05],
            top: [-2.56, 1.25],
            waist: 1.2,
            roof: 2.25,
            axles: [-1.6, 1.65],
            wheel: 0.35,
            cargo: true,
        },
    };
    let paint = if kind == Vehicle::Van { rng.pick(&COLORS[..6]) } else { rng.pick(&COLORS) };
    car(b, &f, &body, paint);
}

fn car(b: &mut Builder, f: &Frame, body: &Body, paint: Tint) {
    let Body { half, ref profile, foot, top, waist, roof, axles, wheel, cargo } = *body;
    b.extrude(f, Mat::CarPaint, paint, profile, [-half, half], true);
    // The cabin leans inward at the top.
    let narrow = half - 0.2;
    let low = half - 0.03;
    let at = |u: f64, n: f64, t: f64| f.at(u, waist + (roof - waist) * t, n);
    let side = |t: f64| low + (narrow - low) * t;
    let along = |end: usize, t: f64| foot[end] + (top[end] - foot[end]) * t;
    let corner = |right: bool, end: usize, t: f64| at(if right { side(t) } else { -side(t) }, along(end, t), t);
    let c = corner;
    b.fan(Mat::CarPaint, paint, &[c(false, 1, 0.0), c(true, 1, 0.0), c(true, 1, 1.0), c(false, 1, 1.0)]);
    b.fan(Mat::CarPaint, paint, &[c(true, 0, 0.0), c(false, 0, 0.0), c(false, 0, 1.0), c(true, 0, 1.0)]);
    b.fan(Mat::CarPaint, paint, &[c(true, 1, 0.0), c(true, 0, 0.0), c(true, 0, 1.0), c(true, 1, 1.0)]);
    b.fan(Mat::CarPaint, paint, &[c(false, 0, 0.0), c(false, 1, 0.0), c(false, 1, 1.0), c(false, 0, 1.0)]);
    b.fan(Mat::CarPaint, shade(paint, 0.95), &[c(false, 1, 1.0), c(true, 1, 1.0), c(true, 0, 1.0), c(false, 0, 1.0)]);
    // Glass lies 8 mm outside of the cabin.
    let out = 0.008;
    let (v0, v1) = (0.1, 0.9);
    for (end, sign) in [(1, 1.0), (0, -1.0)] {
        if cargo && end == 0 {
            continue;
        }
        let p = |right: bool, t: f64| {
            let u = (side(t) - 0.09) * if right { 1.0 } else { -1.0 };
            at(u, along(end, t) + sign * out, t) + f.v * out
        };
        let mut quad = [p(false, v0), p(true, v0), p(true, v1), p(false, v1)];
        if end == 0 {
            quad = [quad[1], quad[0], quad[3], quad[2]];
        }
        b.fan(Mat::Glass, WHITE, &quad);
    }
    let mid = foot[0] + 0.52 * (foot[1] - foot[0]);
    for sign in [1.0, -1.0] {
        let p = |n: f64, t: f64| at(sign * (side(t) + out), n, t);
        let mut panes = vec![(mid + 0.05, mid + 0.05, along(1, v0) - 0.16, along(1, v1) - 0.1)];
        if !cargo {
            panes.push((along(0, v0) + 0.16, along(0, v1) + 0.1, mid - 0.05, mid - 0.05));
        }
        for (n0, n1, m0, m1) in panes {
            let mut quad = [p(m0, v0), p(n0, v0), p(n1, v1), p(m1, v1)];
            if sign < 0.0 {
                quad.reverse();
            }
            b.fan(Mat::Glass, WHITE, &quad);
        }
        // Door seams, handles, mirrors, sills.
        let u = [half - 0.001, half + 0.004].map(|u| u * sign);
        let u = if sign > 0.0 { u } else { [u[1], u[0]] };
        let outer = if sign > 0.0 { face::RIGHT } else { face::LEFT };
        for n in [foot[1] - 0.05, mid, foot[0] + 0.5] {
            b.cuboid(f, Mat::Rubber, WHITE, u, [0.42, waist - 0.05], [n - 0.008, n + 0.008], outer);
        }
        for n in [mid + 0.12, foot[0] + 0.62] {
            b.cuboid(f, Mat::Metal, WHITE, u, [waist - 0.17, waist - 0.13], [n, n + 0.16], outer | face::TOP);
        }
        b.cuboid(f, Mat::Rubber, WHITE, u, [0.3, 0.38], [axles[0] + 0.45, axles[1] - 0.45], outer | face::TOP);
        let mirror = if sign > 0.0 { [half, half + 0.17] } else { [-half - 0.17, -half] };
        b.cuboid(
            f,
            Mat::CarPaint,
            paint,
            mirror,
            [waist + 0.02, waist + 0.15],
            [foot[1] - 0.42, foot[1] - 0.32],
            face::ALL,
        );
        for n in axles {
            wheel_at(b, f, sign * half, n, wheel, sign);
        }
    }
    let (front, rear) = (profile[2][0], profile[profile.len() - 1][0]);
    let v = profile[2][1];
    for u in [[-half + 0.08, -half + 0.42], [half - 0.42, half - 0.08]] {
        b.cuboid(f, Mat::Fabric, [0.95; 3], u, [v, v + 0.14], [front - 0.12, front + 0.005], face::STANDING);
        b.cuboid(
            f,
            Mat::Paint,
            [0.5, 0.015, 0.01],
            u,
            [v + 0.12, v + 0.27],
            [rear - 0.02, rear + 0.12],
            face::STANDING,
        );
    }
    b.cuboid(
        f,
        Mat::Rubber,
        [1.0; 3],
        [-0.42, 0.42],
        [v - 0.06, v + 0.1],
        [front - 0.1, front + 0.003],
        face::FRONT | face::TOP,
    );
    b.cuboid(f, Mat::Paint, [0.85; 3], [-0.26, 0.26], [v - 0.2, v - 0.09], [front - 0.1, front + 0.004], face::ALL);
    b.cuboid(f, Mat::Paint, [0.85; 3], [-0.26, 0.26], [v, v + 0.11], [rear - 0.012, rear + 0.05], face::ALL);
    b.cuboid(f, Mat::Rubber, WHITE, [-half, half], [0.27, 0.36], [front - 0.14, front - 0.02], face::ALL);
    b.cuboid(f, Mat::Rubber, WHITE, [-half, half], [0.27, 0.36], [rear, rear + 0.12], face::ALL);
}

/// A wheel in its dark arch; `sign` tells on which side.
fn wheel_at(b: &mut Builder, f: &Frame, u: f64, n: f64, r: f64, sign: f64) {
    let at = |d: f64| f.at(u + sign * d, r, n);
    b.disc(Mat::Rubber, [0.6; 3], at(0.004), f.u * (sign * (r + 0.06)), 10);
    b.tube(Mat::Rubber, WHITE, [at(-0.2), at(0.015)], [r, r], 10, true);
    b.disc(Mat::Metal, shade(WHITE, 0.8), at(0.022), f.u * (sign * 0.62 * r), 9);
}

fn bus(b: &mut Builder, rng: &mut Rng, f: &Frame) {
    let paint = rng.pick(&[[0.7, 0.05, 0.04], [0.05, 0.22, 0.45], [0.85, 0.6, 0.05]]);
    let (half, front, rear, top) = (1.25, 5.6, -5.6, 3.0);
    b.cuboid(f, Mat::CarPaint, paint, [-half, half], [0.35, 1.15], [rear, front], face::ALL & !face::TOP);
    b.cuboid(f, Mat::CarPaint, [0.85; 3], [-half, half], [2.55, top], [rear, front], face::ALL & !face::BOTTOM);
    b.cuboid(
        f,
        Mat::CarPaint,
        shade(paint, 0.8),
        [-half, half],
        [1.15, 2.55],
        [rear, front],
        face::LEFT | face::RIGHT | face::BACK,
    );
    b.cuboid(f, Mat::Glass, WHITE, [-half + 0.05, half - 0.05], [1.15, 2.55], [front - 0.1, front], face::FRONT);
    b.cuboid(f, Mat::Fabric, [0.9, 0.6, 0.1], [-0.8, 0.8], [2.62, 2.9], [front - 0.1, front + 0.01], face::FRONT);
    b.cuboid(f, Mat::Glass, WHITE, [-half + 0.2, half - 0.2], [1.5, 2.4], [rear - 0.01, rear], face::BACK);
    for (u, outer, sign) in [([half, half + 0.01], face::RIGHT, 1.0), ([-half - 0.01, -half], face::LEFT, -1.0)] {
        for k in 0..7 {
            let n = rear + 0.35 + f64::from(k) * 1.55;
            b.cuboid(f, Mat::Glass, shade(WHITE, 0.9), u, [1.2, 2.45], [n, n + 1.42], outer);
            b.cuboid(f, Mat::Rubber, WHITE, u, [2.47, 2.52], [n, n + 1.42], outer);
        }
        // Doors face the pavement, to the right of the way.
        if sign < 0.0 {
            for n in [0.2, 4.1] {
                b.cuboid(f, Mat::Glass, [0.7; 3], [-half - 0.02, -half], [0.4, 2.45], [n, n + 1.2], outer);
                b.cuboid(f, Mat::Rubber, WHITE, [-half - 0.025, -half], [0.4, 2.45], [n + 0.57, n + 0.63], outer);
            }
        }
        for n in [-3.2, 3.0] {
            wheel_at(b, f, sign * half, n, 0.48, sign);
        }
    }
    b.cuboid(f, Mat::Metal, WHITE, [-0.8, 0.8], [top, top + 0.25], [-3.5, -1.5], face::STANDING);
    b.cuboid(f, Mat::Metal, WHITE, [-0.8, 0.8], [top, top + 0.2], [1.0, 2.6], face::STANDING);
    for u in [[-1.15, -0.8], [0.8, 1.15]] {
        b.cuboid(f, Mat::Fabric, WHITE, u, [0.6, 0.8], [front - 0.05, front + 0.02], face::STANDING);
        b.cuboid(f, Mat::Paint, [0.5, 0.015, 0.01], u, [0.8, 1.0], [rear - 0.02, rear + 0.05], face::STANDING);
    }
}
