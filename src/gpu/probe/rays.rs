//! The fixed rays of the probe.

use super::twin::Twin;
use crate::kernels::layout::{Ray, T_INFINITE};
use crate::math::random::Rng;

/// Number of rays.
pub const RAYS: usize = 2048;

type Vector = [f32; 3];

fn each(f: impl Fn(usize) -> f32) -> Vector {
    [f(0), f(1), f(2)]
}

/// Rays at triangles of `twin`: at their insides, edges and vertices, from outside, from close by and from their own
/// planes, some along axes; rays that end at their aim or before; rays in all directions, untraced ones. `unit`: world
/// units of one device unit.
pub fn rays(twin: &Twin, unit: f64) -> Vec<Ray> {
    let triangles: Vec<[Vector; 3]> = twin.world_triangles().collect();
    let mut rng = Rng(5);
    let size = (3.0 / unit) as f32;
    (0..RAYS)
        .map(|i| {
            let [a, b, c] = triangles[(rng.bits() >> 32) as usize % triangles.len()];
            let s = 0.5 + 0.5 * rng.signed();
            let t = (0.5 + 0.5 * rng.signed()) * (1.0 - s);
            let between = |s: f32, t: f32| each(|k| a[k] + s * (b[k] - a[k]) + t * (c[k] - a[k]));
            let mut aim = match i % 4 {
                0 => a,
                1 => between(s, 0.0),
                _ => between(s, t),
            };
            let offset = [rng.signed(), rng.signed(), rng.signed()];
            let mut origin = match i / 4 % 4 {
                0 => each(|k| size * offset[k]),
                1 => each(|k| aim[k] + 0.05 * size * offset[k]),
                // In the plane of the triangle, also beside it.
                2 => between(2.0 * offset[0], 2.0 * offset[1]),
                _ => each(|k| 300.0 * size * offset[k]),
            };
            let mut range = (0.0, T_INFINITE);
            match i / 16 % 8 {
                // Along an axis, or in a plane across one.
                0 => (0..2).for_each(|k| origin[(i + k) % 3] = aim[(i + k) % 3]),
                1 => origin[i % 3] = aim[i % 3],
                // Up to the aim, just short of it, and from it on.
                2 => range.1 = [1.0, 0.999_99, 1.000_01][i % 3],
                3 => range.0 = [1.0, 0.999_99, 1.000_01][i % 3],
                // Off every aim.
                4 => aim = each(|k| aim[k] + size * offset[(k + 1) % 3]),
                5 if i % 16 == 0 => range = (1.0, 0.0),
                _ => {}
            }
            let mut direction = each(|k| aim[k] - origin[k]);
            if direction.iter().all(|x| x.abs() < 1e-6 * size) {
                direction = each(|k| if k == i % 3 { 1.0 } else { 0.0 });
            }
            if range == (0.0, T_INFINITE) {
                let scale = [1.0, 0.125, 0.37][(rng.bits() >> 32) as usize % 3];
                direction = direction.map(|x| x * scale);
            }
            Ray { origin, t_min: range.0, direction, t_max: range.1 }
        })
        .collect()
}
