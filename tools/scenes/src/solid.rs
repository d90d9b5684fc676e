//! Smooth solids with normals of their own: surfaces over grids, of revolution, and along bent pipes.

use crate::material::{Mat, Tint};
use crate::mesh::Builder;
use glam::DVec3;
use std::f64::consts::TAU;

/// Facets that suit a round thing of radius `r` metres.
pub fn sides(r: f64) -> u32 {
    match r {
        r if r < 0.015 => 4,
        r if r < 0.03 => 5,
        r if r < 0.06 => 7,
        r if r < 0.12 => 10,
        r if r < 0.2 => 12,
        r if r < 0.5 => 18,
        r if r < 1.5 => 28,
        _ => 40,
    }
}

/// Below this angle, radians, between two pieces of a profile the edge between them is smooth.
const CREASE: f64 = 0.7;

/// A surface of revolution about `axis` (unit) through `o`: `profile` is a line of (radius, height), its outside to the
/// right of the way along it as drawn with the radius to the right and the height up.
pub fn lathe(b: &mut Builder, m: Mat, tint: Tint, o: DVec3, axis: DVec3, profile: &[[f64; 2]], sides: u32) {
    let x = axis.any_orthonormal_vector();
    let y = axis.cross(x);
    let directions: Vec<DVec3> = (0..=sides)
        .map(|k| {
            let (s, c) = (f64::from(k % sides) * TAU / f64::from(sides)).sin_cos();
            x * c + y * s
        })
        .collect();
    let facing: Vec<[f64; 2]> = profile
        .windows(2)
        .map(|w| {
            let (dr, dh) = (w[1][0] - w[0][0], w[1][1] - w[0][1]);
            let length = dr.hypot(dh).max(f64::MIN_POSITIVE);
            [dh / length, -dr / length]
        })
        .collect();
    // The normal of piece `k` at the end that it shares with piece `other`.
    let shared = |k: usize, other: Option<usize>| match other.and_then(|o| facing.get(o)) {
        Some(n) if n[0] * facing[k][0] + n[1] * facing[k][1] > CREASE.cos() => {
            let (r, h) = (n[0] + facing[k][0], n[1] + facing[k][1]);
            let length = r.hypot(h);
            [r / length, h / length]
        }
        _ => facing[k],
    };
    for k in 0..facing.len() {
        let ends = [shared(k, k.checked_sub(1)), shared(k, Some(k + 1))];
        b.lattice(m, 2, directions.len(), |row, column| {
            let ([r, h], [nr, nh]) = (profile[k + row], ends[row]);
            let d = directions[column];
            (o + d * r + axis * h, d * nr + axis * nh, tint)
        });
    }
}

/// A closed cylinder from `a` to `c`, of radius `r`.
pub fn rod(b: &mut Builder, m: Mat, tint: Tint, a: DVec3, c: DVec3, r: f64) {
    let length = (c - a).length();
    lathe(b, m, tint, a, (c - a) / length, &[[0.0, 0.0], [r, 0.0], [r, length], [0.0, length]], sides(r));
}

/// A tube without ends from `a` to `c`, of radius `r`.
pub fn tube(b: &mut Builder, m: Mat, tint: Tint, a: DVec3, c: DVec3, r: f64) {
    let length = (c - a).length();
    lathe(b, m, tint, a, (c - a) / length, &[[r, 0.0], [r, length]], sides(r));
}

/// A ring of radius `ring` and thickness 2 `r` about `axis` (unit).
pub fn torus(b: &mut Builder, m: Mat, tint: Tint, o: DVec3, axis: DVec3, ring: f64, r: f64) {
    let x = axis.any_orthonormal_vector();
    arc(b, m, tint, o, [x, axis.cross(x)], [ring, r], TAU, 16);
}

/// Part of a torus about `o`, from the direction `x` toward `y` (unit, orthogonal) by `angle` in `count` pieces.
#[expect(clippy::too_many_arguments, reason = "a torus in space has as many")]
pub fn arc(
    b: &mut Builder,
    m: Mat,
    tint: Tint,
    o: DVec3,
    [x, y]: [DVec3; 2],
    [ring, r]: [f64; 2],
    angle: f64,
    count: u32,
) {
    let axis = x.cross(y);
    let around = sides(r);
    let whole = angle >= TAU;
    b.lattice(m, count as usize + 1, around as usize + 1, |row, column| {
        let row = if whole { row % count as usize } else { row };
        let (s, c) = (angle * row as f64 / f64::from(count)).sin_cos();
        let out = x * c + y * s;
        let (t, u) = (f64::from(column as u32 % around) * TAU / f64::from(around)).sin_cos();
        // Outward is from the torus's own circle.
        let n = out * u - axis * t;
        (o + out * ring + n * r, n, tint)
    });
}

/// A pipe through `points` with bends of radius `bend` (of its centre line), its ends open.
pub fn pipe(b: &mut Builder, m: Mat, tint: Tint, points: &[DVec3], r: f64, bend: f64) {
    let mut from = points[0];
    for k in 1..points.len() {
        let d = (points[k] - from).normalize();
        let Some(next) = points.get(k + 1) else {
            tube(b, m, tint, from, points[k], r);
            return;
        };
        let e = (*next - points[k]).normalize();
        let angle = d.angle_between(e);
        let cut = bend * (0.5 * angle).tan();
        let (start, end) = (points[k] - d * cut, points[k] + e * cut);
        if (start - from).dot(d) > 1e-6 {
            tube(b, m, tint, from, start, r);
        }
        let inward = (e - d * d.dot(e)).normalize();
        let count = (angle / 0.32).ceil().max(1.0) as u32;
        arc(b, m, tint, start + inward * bend, [-inward, d], [bend, r], angle, count);
        from = end;
    }
}

/// A profile of an arc of the ellipse with half axes `r` and `h` above height `y0`, from the rim to the pole, or from
/// pole to rim below it for a negative `h`.
pub fn dome(r: f64, h: f64, y0: f64, count: u32) -> Vec<[f64; 2]> {
    let mut line: Vec<[f64; 2]> = (0..=count)
        .map(|k| {
            let (s, c) = (f64::from(k) / f64::from(count) * 0.25 * TAU).sin_cos();
            [if k == count { 0.0 } else { r * c }, y0 + h * s]
        })
        .collect();
    if h < 0.0 {
        line.reverse();
    }
    line
}

/// A closed surface around the origin of directions: `at` gives position and tint for a unit direction; `rows` from
/// pole to pole. Normals are those of the surface, by differences.
pub fn ball(b: &mut Builder, m: Mat, rows: u32, at: impl Fn(DVec3) -> (DVec3, Tint)) {
    let columns = 2 * rows;
    let direction = |row: u32, column: u32| {
        if row == 0 || row == rows {
            return if row == 0 { -DVec3::Y } else { DVec3::Y };
        }
        let (st, ct) = (f64::from(row) / f64::from(rows) * 0.5 * TAU).sin_cos();
        let (sp, cp) = (f64::from(column % columns) / f64::from(columns) * TAU).sin_cos();
        DVec3::new(st * cp, -ct, -st * sp)
    };
    b.lattice(m, rows as usize + 1, columns as usize + 1, |row, column| {
        let d = direction(row as u32, column as u32);
        let (p, tint) = at(d);
        let x = d.any_orthonormal_vector();
        let y = d.cross(x);
        let near = |o: DVec3| at((d + o * 0.05).normalize()).0;
        let n = (near(x) - near(-x)).cross(near(y) - near(-y));
        (p, n.normalize_or(d), tint)
    });
}
