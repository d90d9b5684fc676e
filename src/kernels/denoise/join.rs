//! Twin of `shaders/denoise/denoise_join.wgsl`: puts a frame together again.

use super::buffers::{Buffers, LEAST_ALBEDO};
use super::grid::{Grid, each, is_second, sum};
use crate::kernels::layout::{DenoiseOwn, NONE};
use crate::math::exact::divide;

/// Of pixels that lend their light to second surfaces, each way.
const REACH: i32 = 2;

/// Puts a frame together again. The light on second surfaces is that of pixels nearby which see these first.
pub fn join(own: &DenoiseOwn, buffers: &mut Buffers) {
    let Buffers { seen, given, seconds, lit, picture, .. } = buffers;
    let (grid, seen, given, seconds, lit) = (Grid::new(own), *seen, *given, *seconds, &**lit);
    let light = |pixel: usize| sum(lit[pixel].color, lit[grid.pixels() + pixel].color);
    each(picture, |pixel, radiance| {
        let (albedo, light_here) = (given[pixel].albedo, light(pixel));
        for k in 0..3 {
            radiance[k] += if albedo[k] < LEAST_ALBEDO { 0.0 } else { albedo[k] * light_here[k] };
        }
        if seen[pixel].second == NONE {
            return;
        }
        let second = &seconds[seen[pixel].second as usize];
        let (mut total, mut count) = ([0.0; 3], 0u32);
        for other in grid.around(pixel, REACH).filter(|&other| is_second(&seen[other], second)) {
            total = sum(total, light(other));
            count += 1;
        }
        for k in (0..3).filter(|&k| count > 0 && second.albedo[k] >= LEAST_ALBEDO) {
            radiance[k] += divide(second.albedo[k] * total[k], count as f32) - second.light[k];
        }
    });
}
