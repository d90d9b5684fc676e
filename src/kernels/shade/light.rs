//! Light: the background, and what is added to pixels. Twin of `shaders/shade/light.wgsl`.

use super::lamps::environment_at;
use crate::kernels::bound::{Bound, Tally};
use crate::kernels::layout::{COUNTER_NON_FINITE, PARAM_BOUNCE, Params};
use crate::kernels::vector::{Vec3, dot, each, mix, most, normalize, xyz};
use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;

/// Radiance of the sky in direction `d`.
pub fn sky(params: &Params, d: Vec3) -> Vec3 {
    let up = normalize(d)[1];
    let (sky, ground) = (xyz(params.sky_color), xyz(params.ground_color));
    let grey = dot(sky, [0.2126, 0.7152, 0.0722]);
    let horizon = sky.map(|c| mix(c, grey, 0.65) * 1.3);
    if up < 0.0 {
        let share = (-up * 8.0).clamp(0.0, 1.0);
        return each(|k| mix(horizon[k], ground[k], share));
    }
    each(|k| mix(horizon[k], sky[k], up.sqrt()))
}

/// What rays see that meet nothing.
pub fn background(bound: &Bound, d: Vec3) -> Vec3 {
    if bound.params.environment_width != 0 { environment_at(bound, d) } else { sky(bound.params, d) }
}

/// What a white surface reflects of the background, by its normal: of an environment by its spherical harmonics up to
/// order 2 (Ramamoorthi, Hanrahan 2001); else of a sky over a ground, each of one radiance: a cosine-weighted
/// hemisphere sees the share of both.
pub fn ambient(params: &Params, normal: Vec3) -> Vec3 {
    if params.environment_width != 0 {
        let [x, y, z] = normal;
        let terms = [1.0, y, z, x, x * y, y * z, 3.0 * z * z - 1.0, x * z, x * x - y * y];
        let mut sum = xyz(params.ambient[0]);
        for (color, term) in params.ambient.iter().zip(terms).skip(1) {
            sum = each(|k| sum[k] + color[k] * term);
        }
        return sum.map(|c| most(c, 0.0));
    }
    let share = 0.5 + 0.5 * normal[1];
    each(|k| mix(params.ground_color[k], params.sky_color[k], share))
}

/// What a white surface with this normal reflects of the sun.
pub fn sunlight(params: &Params, normal: Vec3) -> Vec3 {
    let cosine = most(dot(normal, xyz(params.sun)), 0.0);
    each(|k| params.sun_color[k] * cosine)
}

/// Adds what a hit of the shaded set shows to its pixel, bits of f32 that nothing else writes meanwhile; light that is
/// not finite is counted and left out.
pub fn add_light(bound: &Bound, tally: &mut Tally, radiance: &[AtomicU32], throughput: Option<&[f32; 4]>, light: Vec3) {
    let mut color = light;
    if let Some(throughput) = throughput.filter(|_| bound.has(PARAM_BOUNCE)) {
        color = each(|k| color[k] * throughput[k]);
    }
    if color.iter().any(|c| !c.is_finite()) {
        tally.add(COUNTER_NON_FINITE, 1);
        return;
    }
    for (sum, c) in radiance.iter().zip(color) {
        sum.store((f32::from_bits(sum.load(Relaxed)) + c).to_bits(), Relaxed);
    }
}
