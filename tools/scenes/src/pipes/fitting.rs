//! Pipes with what is on them: flanges with bolts, valves, gauges, hangers, bands of insulation.

use crate::material::{Mat, Tint, WHITE, shade};
use crate::mesh::Builder;
use crate::rng::Rng;
use crate::solid::{dome, lathe, pipe, rod, sides, torus};
use glam::DVec3;

/// How a pipe looks.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// Material.
    pub mat: Mat,
    /// Tint.
    pub tint: Tint,
    /// Wrapped in insulation, with bands instead of flanges.
    pub wrapped: bool,
}

impl Look {
    /// What a plant has: bare and wrapped steel, and the colours of water, air, gas and fire.
    pub fn any(rng: &mut Rng) -> Self {
        let (mat, tint, wrapped) = match rng.int(0, 15) {
            0..=2 => (Mat::Steel, WHITE, true),
            3..=5 => (Mat::Steel, [0.62, 0.62, 0.6], false),
            6 | 7 => (Mat::Paint, [0.55, 0.56, 0.56], false),
            8 | 9 => (Mat::Paint, [0.16, 0.36, 0.22], false),
            10 => (Mat::Paint, [0.13, 0.27, 0.5], false),
            11 => (Mat::Paint, [0.68, 0.5, 0.09], false),
            12 => (Mat::Paint, [0.55, 0.09, 0.06], false),
            13 => (Mat::Paint, [0.42, 0.2, 0.1], false),
            14 => (Mat::Paint, [0.3, 0.29, 0.27], false),
            _ => (Mat::Paint, [0.8, 0.79, 0.74], false),
        };
        Self { mat, tint: shade(tint, rng.range(0.8, 1.0)), wrapped }
    }
}

/// A flange of a pipe of radius `r` at `o`, with its bolts; `blind` closes it.
pub fn flange(b: &mut Builder, look: Look, o: DVec3, axis: DVec3, r: f64, blind: bool) {
    let (out, half) = (1.55 * r + 0.02, 0.22 * r + 0.008);
    let inner = if blind { 0.0 } else { r };
    let tint = shade(look.tint, 0.85);
    for (low, high) in [(-half, -0.12 * half), (0.12 * half, half)] {
        let profile = [[inner, low], [out, low], [out, high], [inner, high]];
        lathe(b, look.mat, tint, o, axis, &profile, sides(out));
    }
    if r < 0.07 {
        return;
    }
    let (x, count) = (axis.any_orthonormal_vector(), if r < 0.15 { 4 } else { 10 });
    let y = axis.cross(x);
    let (ring, size) = (1.27 * r + 0.01, 0.1 * r + 0.006);
    for k in 0..count {
        let (s, c) = (f64::from(k) * std::f64::consts::TAU / f64::from(count)).sin_cos();
        let p = o + (x * c + y * s) * ring;
        let ends = [p - axis * (1.7 * half), p + axis * (1.7 * half)];
        b.tube(Mat::Steel, [0.5; 3], ends, [size; 2], 5, true);
    }
}

/// A gate valve on a pipe of radius `r`: body, bonnet, stem and hand wheel toward `up`.
pub fn valve(b: &mut Builder, rng: &mut Rng, o: DVec3, axis: DVec3, up: DVec3, r: f64) {
    let tint = rng.pick(&[[0.12, 0.26, 0.42], [0.4, 0.4, 0.4], [0.5, 0.13, 0.08], [0.16, 0.3, 0.18]]);
    let length = 1.6 * r + 0.06;
    let body = Look { mat: Mat::Paint, tint, wrapped: false };
    let profile: Vec<[f64; 2]> = (0..=10)
        .map(|k| {
            let t = f64::from(k) / 10.0;
            [r * (1.02 + 0.42 * (std::f64::consts::PI * t).sin()), (2.0 * t - 1.0) * length]
        })
        .collect();
    lathe(b, Mat::Paint, tint, o, axis, &profile, sides(1.3 * r));
    flange(b, body, o - axis * length, axis, r, false);
    flange(b, body, o + axis * length, axis, r, false);
    let neck =
        [[0.75 * r, 0.9 * r], [0.62 * r, 1.9 * r], [1.05 * r, 1.95 * r], [1.05 * r, 2.25 * r], [0.4 * r, 2.35 * r]];
    lathe(b, Mat::Paint, tint, o, up, &neck, sides(r));
    lathe(b, Mat::Paint, tint, o, up, &[[0.4 * r, 2.35 * r], [0.3 * r, 3.2 * r], [0.0, 3.2 * r]], sides(0.4 * r));
    let wheel = rng.range(3.4, 3.9) * r + 0.03;
    rod(b, Mat::Steel, [0.7; 3], o + up * (3.2 * r), o + up * (wheel + 0.25 * r), 0.12 * r + 0.004);
    let (center, ring, thick) = (o + up * wheel, 1.15 * r + 0.05, 0.1 * r + 0.006);
    let paint = rng.pick(&[[0.6, 0.08, 0.05], [0.1, 0.22, 0.5], [0.12, 0.12, 0.12]]);
    torus(b, Mat::Paint, paint, center, up, ring, thick);
    let x = up.any_orthonormal_vector();
    for k in 0..3 {
        let (s, c) = (f64::from(k) * 2.0944).sin_cos();
        b.tube(Mat::Paint, paint, [center, center + (x * c + up.cross(x) * s) * ring], [0.7 * thick; 2], 5, false);
    }
}

/// A pressure gauge on a stub toward `up` that faces `face`.
pub fn gauge(b: &mut Builder, o: DVec3, up: DVec3, face: DVec3, r: f64) {
    let top = o + up * (r + 0.22);
    rod(b, Mat::Steel, [0.6; 3], o + up * (0.9 * r), top, 0.012);
    let center = top + up * 0.06;
    let dial = [[0.0, -0.025], [0.062, -0.025], [0.062, 0.02], [0.054, 0.022]];
    lathe(b, Mat::Paint, [0.06; 3], center, face, &dial, 18);
    lathe(b, Mat::Paint, [0.92; 3], center, face, &[[0.054, 0.018], [0.0, 0.018]], 18);
    let x = face.cross(up).normalize_or(up.any_orthonormal_vector());
    b.tube(
        Mat::Paint,
        [0.7, 0.05, 0.03],
        [center + face * 0.021, center + face * 0.021 + (x + up) * 0.03],
        [0.003; 2],
        4,
        true,
    );
}

/// A clamp around a pipe of radius `r` that hangs from two rods, `length` long.
fn hanger(b: &mut Builder, o: DVec3, axis: DVec3, r: f64, length: f64) {
    let w = 0.04 + 0.1 * r;
    let profile = [[r, -w], [r + 0.012, -w], [r + 0.012, w], [r, w]];
    lathe(b, Mat::Steel, [0.7; 3], o, axis, &profile, sides(r));
    let side = axis.cross(DVec3::Y) * (r + 0.025);
    for s in [side, -side] {
        rod(b, Mat::Steel, [0.62; 3], o + s, o + s + DVec3::Y * length, 0.009 + 0.02 * r);
    }
}

/// What a pipe is to have.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    /// Radius, metres.
    pub r: f64,
    /// Radius of the centre line of its bends, metres.
    pub bend: f64,
    /// How it looks.
    pub look: Look,
    /// Level runs hang from the floor above: floors are at multiples of this height. Infinite if they lie on something.
    pub storey: f64,
}

/// A pipe through `points` with flanges, valves, gauges, hangers or bands.
pub fn line(b: &mut Builder, rng: &mut Rng, points: &[DVec3], line: Line) {
    let Line { r, bend, look, storey } = line;
    pipe(b, look.mat, look.tint, points, r, bend);
    let last = points.len() - 1;
    for (end, next) in [(points[0], points[1]), (points[last], points[last - 1])] {
        flange(b, look, end, (next - end).normalize(), r, true);
    }
    for (k, w) in points.windows(2).enumerate() {
        let (run, d) = (w[1] - w[0], (w[1] - w[0]).normalize());
        let cut = |corner: bool| if corner { bend } else { 0.15 };
        let (from, to) = (cut(k > 0), run.length() - cut(k + 1 < last));
        if to - from < 0.5 {
            continue;
        }
        let up = if d.y.abs() > 0.5 { rng.pick(&[DVec3::X, DVec3::Z, -DVec3::X, -DVec3::Z]) } else { DVec3::Y };
        let at = |t: f64| w[0] + d * t;
        if look.wrapped {
            let count = ((to - from) / 1.5).ceil();
            for s in 0..=count as u32 {
                let o = at(from + (to - from) * f64::from(s) / count);
                let profile = [[r, -0.025], [r + 0.006, -0.022], [r + 0.006, 0.022], [r, 0.025]];
                lathe(b, Mat::Steel, [0.75; 3], o, d, &profile, sides(r));
            }
        } else {
            if rng.chance(0.7) {
                flange(b, look, at(from + 0.05), d, r, false);
            }
            if rng.chance(0.5) {
                flange(b, look, at(to - 0.05), d, r, false);
            }
        }
        let room = to - from - 2.0 * (1.6 * r + 0.06);
        if room > 1.0 && rng.chance(0.4) {
            let o = at(0.5 * (from + to) + rng.range(-0.2, 0.2) * room);
            valve(b, rng, o, d, up, r);
        } else if room > 0.6 && rng.chance(0.3) {
            let face = if d.cross(up).x.abs() > 0.5 { d.cross(up) } else { d };
            gauge(b, at(from + rng.range(0.3, 0.7) * (to - from)), up, face, r);
        }
        if d.y.abs() < 0.5 {
            let above = (w[0].y / storey).floor() * storey + storey - w[0].y;
            if storey.is_finite() && above > 0.2 && above < 0.6 * storey {
                let count = ((to - from) / 3.5).round().max(1.0);
                for s in 0..count as u32 {
                    hanger(b, at(from + (to - from) * (f64::from(s) + 0.5) / count), d, r, above - 0.15);
                }
            }
        }
    }
}

/// A short closed branch with a flange, as vessels have: from the wall at `o` outward along `d`.
pub fn nozzle(b: &mut Builder, look: Look, o: DVec3, d: DVec3, r: f64, length: f64) {
    lathe(b, look.mat, look.tint, o, d, &[[r, -0.3 * r], [r, length]], sides(r));
    flange(b, look, o + d * length, d, r, true);
}

/// A manhole: a wide nozzle with a domed lid and a handle.
pub fn manway(b: &mut Builder, look: Look, o: DVec3, d: DVec3) {
    nozzle(b, look, o, d, 0.28, 0.22);
    lathe(b, look.mat, look.tint, o + d * 0.3, d, &dome(0.3, 0.08, 0.0, 4), 20);
    let side = d.any_orthonormal_vector() * 0.15;
    let points = [o + d * 0.32 + side, o + d * 0.46 + side, o + d * 0.46 - side, o + d * 0.32 - side];
    pipe(b, Mat::Steel, [0.6; 3], &points, 0.012, 0.03);
}
