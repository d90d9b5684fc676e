//! Equipment: tanks, columns, exchangers, pumps, a boiler, ducts, cabinets, stacks.

use super::fitting::{Look, flange, manway, nozzle};
use super::steel::{STEEL, beam, gallery, ladder};
use crate::material::{Mat, Tint, WHITE, shade};
use crate::mesh::{Builder, Frame, face};
use crate::rng::Rng;
use crate::solid::{dome, lathe, pipe, rod, sides};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, TAU};

fn level(angle: f64) -> DVec3 {
    DVec3::new(angle.cos(), 0.0, angle.sin())
}

/// Rings around a vessel: plates of its cladding, one a metre.
fn bands(b: &mut Builder, tint: Tint, o: DVec3, axis: DVec3, r: f64, [from, to]: [f64; 2]) {
    let count = ((to - from) / 1.1).round().max(1.0);
    for k in 0..=count as u32 {
        let h = from + (to - from) * f64::from(k) / count;
        let profile = [[r, h - 0.035], [r + 0.012, h - 0.03], [r + 0.012, h + 0.03], [r, h + 0.035]];
        lathe(b, Mat::Steel, shade(tint, 0.82), o, axis, &profile, sides(r));
    }
}

/// A standing tank of radius `r` and `height` on a skirt, with a ladder; `gallery_at` are heights of galleries.
pub fn tank(b: &mut Builder, rng: &mut Rng, o: DVec3, r: f64, height: f64, galleries: &[f64]) {
    let clad = rng.chance(0.6);
    let look = if clad {
        Look { mat: Mat::Steel, tint: shade(WHITE, rng.range(0.85, 1.0)), wrapped: true }
    } else {
        let tint = rng.pick(&[[0.78, 0.78, 0.74], [0.5, 0.55, 0.56], [0.42, 0.46, 0.4], [0.55, 0.36, 0.22]]);
        Look { mat: Mat::Paint, tint, wrapped: false }
    };
    let (skirt, cap) = (0.7, 0.42 * r);
    let around = sides(r);
    lathe(b, Mat::Concrete, WHITE, o, DVec3::Y, &[[r + 0.35, 0.0], [r + 0.35, 0.2], [0.0, 0.2]], around);
    lathe(b, Mat::Paint, STEEL, o, DVec3::Y, &[[r + 0.02, 0.2], [r + 0.02, skirt + cap]], around);
    let mut profile = dome(r, -cap, skirt + cap, 6);
    profile.push([r, height - cap]);
    profile.extend(dome(r, cap, height - cap, 8).into_iter().skip(1));
    lathe(b, look.mat, look.tint, o, DVec3::Y, &profile, around);
    if clad {
        bands(b, look.tint, o, DVec3::Y, r, [skirt + cap + 0.1, height - cap - 0.1]);
    }
    nozzle(b, look, o + DVec3::Y * (height - 0.05), DVec3::Y, 0.12, 0.3);
    let turn = rng.range(0.0, TAU);
    for k in 0..rng.int(4, 9) {
        let d = level(turn + 1.1 * k as f64);
        let y = rng.range(skirt + cap + 0.3, height - cap - 0.3);
        let size = rng.range(0.05, 0.16);
        nozzle(b, look, o + DVec3::Y * y + d * r, d, size, 0.25 + size);
    }
    manway(b, look, o + DVec3::Y * (skirt + cap + 0.6) + level(turn) * r, level(turn));
    let yaw = turn + 2.0;
    let d = level(yaw);
    let side = Frame { o: o + d * (r + 0.25), u: DVec3::Y.cross(d), v: DVec3::Y, n: d };
    ladder(b, &side, galleries.last().copied().unwrap_or(height - cap));
    for &y in galleries {
        gallery(b, o + DVec3::Y * y, r + 0.05, r + 1.15);
    }
}

/// A heat exchanger along x of `f`, its middle at the height of `f`, on two saddles that reach down `down` metres.
pub fn exchanger(b: &mut Builder, rng: &mut Rng, f: &Frame, length: f64, r: f64, down: f64) {
    let look = Look { wrapped: rng.chance(0.5), mat: Mat::Steel, tint: shade(WHITE, rng.range(0.7, 1.0)) };
    let around = sides(r);
    let o = f.at(-0.5 * length, 0.0, 0.0);
    let mut profile = dome(0.95 * r, -0.4 * r, 0.25 * r, 5);
    profile.extend([[0.95 * r, 0.45 * r], [1.2 * r, 0.45 * r], [1.2 * r, 0.6 * r], [r, 0.6 * r]]);
    profile.extend([
        [r, length - 0.6 * r],
        [1.2 * r, length - 0.6 * r],
        [1.2 * r, length - 0.45 * r],
        [0.95 * r, length - 0.45 * r],
    ]);
    profile.extend(dome(0.95 * r, 0.4 * r, length - 0.25 * r, 5));
    lathe(b, look.mat, look.tint, o, f.u, &profile, around);
    bands(b, look.tint, o, f.u, r, [0.8 * r, length - 0.8 * r]);
    for h in [0.45 * r, length - 0.6 * r] {
        for k in 0..16 {
            let (s, c) = (f64::from(k) * TAU / 16.0).sin_cos();
            let p = o + f.u * (h - 0.03) + (f.v * s + f.n * c) * (1.1 * r);
            b.tube(Mat::Steel, [0.5; 3], [p, p + f.u * (0.15 * r + 0.06)], [0.022; 2], 6, true);
        }
    }
    for u in [-0.28, 0.28] {
        let saddle = f.moved(u * length, 0.0, 0.0);
        b.cuboid(&saddle, Mat::Paint, STEEL, [-0.12, 0.12], [-down + 0.12, -0.8 * r], [-0.8 * r, 0.8 * r], face::ALL);
        b.cuboid(&saddle, Mat::Concrete, [0.9; 3], [-0.25, 0.25], [-down, 0.12 - down], [-r, r], face::STANDING);
    }
    for k in 0..5 {
        let u = rng.range(-0.4, 0.4) * length;
        let up = if k % 2 == 0 { f.v } else { -f.v };
        if up == f.v || down > r + 0.5 {
            nozzle(b, look, f.at(u, 0.0, 0.0) + up * r, up, rng.range(0.06, 0.14), 0.25);
        }
    }
}

/// A pump with its motor along u of `f`, on a base; 1.9 m long.
pub fn pump(b: &mut Builder, rng: &mut Rng, f: &Frame, scale: f64) {
    let paint = rng.pick(&[[0.1, 0.24, 0.45], [0.14, 0.34, 0.2], [0.5, 0.5, 0.48], [0.55, 0.3, 0.08]]);
    let s = scale;
    b.cuboid(f, Mat::Concrete, [0.85; 3], [-s, s], [0.0, 0.15 * s], [-0.4 * s, 0.4 * s], face::STANDING);
    b.cuboid(f, Mat::Paint, STEEL, [-0.92 * s, 0.92 * s], [0.15 * s, 0.22 * s], [-0.32 * s, 0.32 * s], face::STANDING);
    let y = 0.55 * s;
    let at = |u: f64| f.at(u * s, y, 0.0);
    // The motor and its fins.
    let mut profile = dome(0.22 * s, -0.06 * s, 0.06 * s, 3);
    profile.push([0.22 * s, 0.7 * s]);
    profile.extend([[0.25 * s, 0.72 * s], [0.25 * s, 0.8 * s], [0.04 * s, 0.82 * s]]);
    lathe(b, Mat::Paint, paint, at(-0.85), f.u, &profile, 22);
    for k in 0..20 {
        let (sin, cos) = (f64::from(k) * TAU / 20.0).sin_cos();
        let out = f.v * cos + f.n * sin;
        let fin = Frame { o: at(-0.75), u: f.u, v: out, n: f.u.cross(out) };
        b.cuboid(
            &fin,
            Mat::Paint,
            paint,
            [0.0, 0.5 * s],
            [0.2 * s, 0.255 * s],
            [-0.005 * s, 0.005 * s],
            face::STANDING,
        );
    }
    b.cuboid(
        &f.moved(-0.5 * s, y, 0.0),
        Mat::Paint,
        shade(paint, 0.8),
        [-0.12 * s, 0.12 * s],
        [0.2 * s, 0.36 * s],
        [-0.1 * s, 0.1 * s],
        face::STANDING,
    );
    for u in [-0.7, -0.3] {
        b.cuboid(
            &f.moved(u * s, 0.22 * s, 0.0),
            Mat::Paint,
            paint,
            [-0.05 * s, 0.05 * s],
            [0.0, 0.2 * s],
            [-0.2 * s, 0.2 * s],
            face::STANDING,
        );
    }
    // The guard of the coupling, then the casing.
    lathe(
        b,
        Mat::Paint,
        [0.8, 0.6, 0.08],
        at(-0.05),
        f.u,
        &[[0.0, 0.0], [0.13 * s, 0.0], [0.13 * s, 0.3 * s], [0.0, 0.3 * s]],
        16,
    );
    let casing: Vec<[f64; 2]> = (0..=10)
        .map(|k| {
            let t = f64::from(k) / 10.0;
            [s * (0.12 + 0.22 * (t * std::f64::consts::PI).sin()), s * (0.3 + 0.36 * t)]
        })
        .collect();
    lathe(b, Mat::Paint, paint, at(0.0), f.u, &casing, 26);
    let look = Look { mat: Mat::Paint, tint: paint, wrapped: false };
    nozzle(b, look, at(0.6), f.u, 0.11 * s, 0.22 * s);
    nozzle(b, look, f.at(0.48 * s, y + 0.28 * s, 0.1 * s), f.v, 0.09 * s, 0.25 * s);
    b.cuboid(
        &f.moved(0.48 * s, 0.22 * s, 0.0),
        Mat::Paint,
        paint,
        [-0.08 * s, 0.08 * s],
        [0.0, 0.1 * s],
        [-0.2 * s, 0.2 * s],
        face::STANDING,
    );
}

/// A furnace whose walls are tubes, `side` wide in the middle of `o`, from `low` to `high`, with beams around it.
pub fn boiler(b: &mut Builder, rng: &mut Rng, o: DVec3, side: f64, [low, high]: [f64; 2]) {
    let half = 0.5 * side;
    let tint = rng.pick(&[[0.5, 0.33, 0.24], [0.45, 0.4, 0.36], [0.42, 0.28, 0.2]]);
    for k in 0..4 {
        let n = level(f64::from(k) * FRAC_PI_2);
        let u = DVec3::Y.cross(n);
        let wall = Frame { o: o + n * half - u * half, u, v: DVec3::Y, n };
        b.panel(&wall, Mat::Paint, shade(tint, 0.6), [0.0, side], [low, high], 0.0);
        let count = (side / 0.12).round();
        for s in 0..count as u32 {
            let p = wall.at((f64::from(s) + 0.5) * side / count, 0.0, 0.02);
            let tone = shade(tint, rng.range(0.8, 1.05));
            lathe(b, Mat::Paint, tone, p, DVec3::Y, &[[0.045, low], [0.045, high]], 8);
        }
        let mut y = low + 1.0;
        while y < high - 0.5 {
            let around = Frame { o: o + n * (half + 0.28) - u * (half + 0.4), u, v: DVec3::Y, n };
            beam(b, &around.moved(0.0, y, 0.0), side + 0.8, [0.35, 0.3], STEEL);
            y += 2.4;
        }
        for (y, r) in [(low, 0.22), (high, 0.26)] {
            rod(
                b,
                Mat::Steel,
                [0.75; 3],
                o + n * half - u * (half + 0.3) + DVec3::Y * y,
                o + n * half + u * (half + 0.3) + DVec3::Y * y,
                r,
            );
        }
        for _ in 0..3 {
            let p = wall.at(rng.range(0.2, 0.8) * side, rng.range(low + 1.0, high - 1.0), 0.05);
            let look = Look { mat: Mat::Paint, tint: [0.2; 3], wrapped: false };
            manway(b, look, p, n);
        }
    }
    let lid = Frame::standing(o, 0.0);
    b.cuboid(&lid, Mat::Steel, WHITE, [-half, half], [high, high + 0.12], [-half, half], face::ALL);
}

/// A duct with ribs from `a` to `c` (along one axis), `w` wide and `h` high.
pub fn duct(b: &mut Builder, a: DVec3, c: DVec3, [w, h]: [f64; 2], tint: Tint) {
    let d = (c - a).normalize();
    let up = if d.y.abs() > 0.5 { DVec3::X } else { DVec3::Y };
    let f = Frame { o: a, u: d, v: up, n: d.cross(up) };
    let length = (c - a).length();
    b.cuboid(&f, Mat::Steel, tint, [0.0, length], [-0.5 * h, 0.5 * h], [-0.5 * w, 0.5 * w], face::ALL);
    let count = (length / 0.9).round().max(1.0);
    for k in 0..=count as u32 {
        let u = (length * f64::from(k) / count).clamp(0.04, length - 0.04);
        let e = 0.06;
        b.cuboid(
            &f,
            Mat::Steel,
            shade(tint, 0.85),
            [u - 0.03, u + 0.03],
            [-0.5 * h - e, 0.5 * h + e],
            [-0.5 * w - e, 0.5 * w + e],
            face::ALL,
        );
    }
}

/// A row of cabinets along u of `f`, `count` of them 0.8 m wide.
pub fn cabinets(b: &mut Builder, rng: &mut Rng, f: &Frame, count: u32) {
    let tint = rng.pick(&[[0.62, 0.64, 0.6], [0.42, 0.47, 0.45], [0.7, 0.69, 0.62]]);
    for k in 0..count {
        let g = f.moved(0.8 * f64::from(k), 0.0, 0.0);
        b.cuboid(&g, Mat::Paint, tint, [0.005, 0.795], [0.1, 2.1], [-0.5, 0.0], face::ALL);
        b.cuboid(&g, Mat::Paint, [0.08; 3], [0.02, 0.78], [0.0, 0.1], [-0.48, -0.03], face::STANDING);
        b.cuboid(&g, Mat::Paint, shade(tint, 0.93), [0.04, 0.76], [0.14, 2.06], [0.0, 0.018], face::ON_WALL);
        b.cuboid(&g, Mat::Steel, [0.3; 3], [0.68, 0.71], [1.0, 1.2], [0.018, 0.045], face::ON_WALL);
        for s in 0..6 {
            let v = 0.25 + 0.05 * f64::from(s);
            b.cuboid(&g, Mat::Paint, [0.2; 3], [0.2, 0.6], [v, v + 0.015], [0.018, 0.024], face::ON_WALL);
        }
        for s in 0..rng.int(1, 4) {
            let (u, lamp) =
                (0.2 + 0.14 * s as f64, rng.pick(&[[0.7, 0.05, 0.04], [0.1, 0.55, 0.12], [0.8, 0.6, 0.05]]));
            lathe(b, Mat::Paint, lamp, g.at(u, 1.75, 0.018), g.n, &[[0.025, 0.0], [0.02, 0.02], [0.0, 0.025]], 10);
        }
        if rng.chance(0.5) {
            b.panel(&g, Mat::Glass, WHITE, [0.2, 0.6], [1.35, 1.62], 0.0185);
        }
    }
}

/// A tray along u of `f` with `count` cables of various thickness that lie in it untidily.
pub fn tray(b: &mut Builder, rng: &mut Rng, f: &Frame, length: f64, count: u32) {
    let half = 0.24;
    for w in [-half, half] {
        b.cuboid(f, Mat::Steel, [0.66; 3], [0.0, length], [0.0, 0.09], [w - 0.003, w + 0.003], face::ALL);
    }
    for k in 0..=(length / 0.4) as u32 {
        let u = (0.4 * f64::from(k)).clamp(0.02, length - 0.02);
        b.cuboid(
            f,
            Mat::Steel,
            [0.62; 3],
            [u - 0.015, u + 0.015],
            [0.005, 0.015],
            [-half, half],
            face::TOP | face::BOTTOM | face::LEFT | face::RIGHT,
        );
    }
    for k in 0..count {
        let r = rng.pick(&[0.006, 0.009, 0.012, 0.018, 0.026]);
        let tint = rng.pick(&[[0.05; 3], [0.07; 3], [0.1; 3], [0.5, 0.25, 0.04], [0.45, 0.05, 0.04], [0.3; 3]]);
        let home = -half + 0.04 + (2.0 * half - 0.08) * (f64::from(k) + 0.5) / f64::from(count);
        let pieces = (length / 0.8).round().max(1.0);
        let mut points: Vec<DVec3> = (0..=pieces as u32)
            .map(|s| {
                let free = s > 0 && f64::from(s) < pieces;
                let (w, v) = if free { (rng.range(-0.02, 0.02), rng.range(0.0, 0.02)) } else { (0.0, 0.0) };
                f.at(length * f64::from(s) / pieces, 0.015 + r + v, home + w)
            })
            .collect();
        points.dedup();
        cable(b, &points, r, tint);
    }
}

/// A flexible line through `points`.
pub fn cable(b: &mut Builder, points: &[DVec3], r: f64, tint: Tint) {
    let around = sides(r) as usize;
    let last = points.len() - 1;
    let main = (points[last] - points[0]).normalize();
    let x = main.any_orthonormal_vector();
    b.lattice(Mat::Paint, points.len(), around + 1, |row, column| {
        let d = (points[(row + 1).min(last)] - points[row.saturating_sub(1)]).normalize();
        let x = (x - d * x.dot(d)).normalize();
        let (s, c) = ((column % around) as f64 * TAU / around as f64).sin_cos();
        let n = x * c + d.cross(x) * s;
        (points[row] + n * r, n, tint)
    });
}

/// A cable that hangs between `a` and `c` and sags by `sag`.
pub fn hanging(b: &mut Builder, [a, c]: [DVec3; 2], sag: f64, r: f64, tint: Tint) {
    let points: Vec<DVec3> = (0..=10)
        .map(|k| {
            let t = f64::from(k) / 10.0;
            a + (c - a) * t - DVec3::Y * (4.0 * sag * t * (1.0 - t))
        })
        .collect();
    cable(b, &points, r, tint);
}

/// A chimney from `o`, `height` high, red and white at its top.
pub fn stack(b: &mut Builder, o: DVec3, r: f64, height: f64) {
    let pieces = 10;
    for k in 0..pieces {
        let [h0, h1] = [k, k + 1].map(|k| height * f64::from(k) / f64::from(pieces));
        let at = |h: f64| r * (1.0 - 0.35 * h / height);
        let tint = match (k > 5, k % 2) {
            (true, 0) => [0.6, 0.1, 0.07],
            (true, _) => [0.85, 0.85, 0.82],
            _ => [0.62, 0.61, 0.58],
        };
        lathe(b, Mat::Paint, tint, o, DVec3::Y, &[[at(h0), h0], [at(h1), h1]], 40);
        lathe(
            b,
            Mat::Paint,
            shade(tint, 0.8),
            o,
            DVec3::Y,
            &[[at(h1), h1 - 0.06], [at(h1) + 0.05, h1 - 0.05], [at(h1) + 0.05, h1 + 0.05], [at(h1), h1 + 0.06]],
            40,
        );
    }
    let top = r * 0.65;
    lathe(
        b,
        Mat::Paint,
        [0.05; 3],
        o + DVec3::Y * height,
        DVec3::Y,
        &[[top, 0.0], [0.85 * top, 0.0], [0.85 * top, -1.5], [0.0, -1.5]],
        40,
    );
    for k in [5, 8] {
        gallery(b, o + DVec3::Y * (height * f64::from(k) / 10.0), r, r + 1.1);
    }
    let f = Frame { o: o + DVec3::Z * (r + 0.3), u: DVec3::X, v: DVec3::Y, n: DVec3::Z };
    ladder(b, &f, 0.8 * height);
}

/// A bent standpipe with a wheel, as hydrants and sampling points have.
pub fn standpipe(b: &mut Builder, rng: &mut Rng, f: &Frame) {
    let tint = [0.6, 0.08, 0.05];
    let look = Look { mat: Mat::Paint, tint, wrapped: false };
    pipe(b, Mat::Paint, tint, &[f.at(0.0, 0.0, 0.0), f.at(0.0, 1.1, 0.0), f.at(0.0, 1.1, 0.5)], 0.06, 0.18);
    flange(b, look, f.at(0.0, 0.05, 0.0), DVec3::Y, 0.06, false);
    super::fitting::valve(b, rng, f.at(0.0, 0.6, 0.0), DVec3::Y, f.n, 0.06);
    flange(b, look, f.at(0.0, 1.1, 0.5), f.n, 0.06, true);
}
