//! Light without what it falls on, and back.

use super::grid::Grid;
use crate::frame::Guides;
use crate::picture::color::is_finite;
use rayon::prelude::*;

/// Channels of an albedo below this are not divided by: their light goes around the filter, so that black stays black
/// and nothing is divided by zero. What is left noisy there is less than 1/1024 of the light; dyes with one bright
/// channel have others of little more, which a long exposure shows.
pub const LEAST_ALBEDO: f32 = 1.0 / 1024.0;

/// Of pixels that lend their light to second surfaces, each way.
const REACH: i32 = 2;

/// A frame taken apart.
pub struct Parts {
    /// What goes around the filter: what guides say ([`Guides::around`]), and light on what is nearly black.
    pub around: Vec<[f32; 3]>,
    /// The light of the lamps and all other light, divided by the albedo; `None` where it is not finite.
    pub layers: [Vec<Option<[f32; 3]>>; 2],
    /// Pixels with a value that is not finite.
    pub non_finite: u64,
}

/// One pixel: what goes around, and the two layers. `direct` and `around`: what guides say.
fn split(radiance: [f32; 3], direct: [f32; 3], albedo: [f32; 3], shown: [f32; 3]) -> ([f32; 3], [[f32; 3]; 2]) {
    let mut around = [0.0; 3];
    let mut layers = [[0.0; 3]; 2];
    for k in 0..3 {
        if albedo[k] < LEAST_ALBEDO {
            around[k] = radiance[k];
            continue;
        }
        // The lamps' light comes out negative by rounding, at most: that goes around, too. Other light is negative
        // where traced rays take back what maps gave (`Role::Correct`), and only the mean of neighbours is right.
        around[k] = shown[k] + direct[k].min(0.0);
        layers[0][k] = direct[k].max(0.0) / albedo[k];
        layers[1][k] = (radiance[k] - shown[k] - direct[k]) / albedo[k];
    }
    (around, layers)
}

/// Takes a frame apart.
pub fn demodulate(guides: &Guides, radiance: &[[f32; 3]]) -> Parts {
    let pixels: Vec<_> = radiance
        .par_iter()
        .zip(guides.direct.par_iter().zip(&guides.around).zip(&guides.seen))
        .map(|(radiance, ((direct, around), seen))| split(*radiance, *direct, seen.albedo, *around))
        .collect();
    let sound = |c: [f32; 3]| is_finite(&c).then_some(c);
    let around = pixels.iter().map(|(around, _)| sound(*around).unwrap_or_default()).collect();
    let layer = |which: usize| pixels.iter().map(|(_, layers)| sound(layers[which])).collect();
    let is_sound = |(around, [a, b]): &&([f32; 3], [[f32; 3]; 2])| is_finite(around) && is_finite(a) && is_finite(b);
    let non_finite = (pixels.len() - pixels.iter().filter(is_sound).count()) as u64;
    Parts { around, layers: [layer(0), layer(1)], non_finite }
}

/// Puts a frame together again. The light on second surfaces is that of pixels nearby which see these first.
pub fn recompose(
    grid: &Grid,
    guides: &Guides,
    around: &[[f32; 3]],
    layers: &[Vec<[f32; 3]>; 2],
    radiance: &mut [[f32; 3]],
) {
    radiance.par_iter_mut().enumerate().for_each(|(i, radiance)| {
        let albedo = guides.seen[i].albedo;
        for k in 0..3 {
            let light = if albedo[k] < LEAST_ALBEDO { 0.0 } else { albedo[k] * (layers[0][i][k] + layers[1][i][k]) };
            radiance[k] = around[i][k] + light;
        }
        let Some(second) = guides.second.get(i).and_then(Option::as_ref) else { return };
        let (mut sum, mut count) = ([0.0; 3], 0.0);
        for other in grid.around(i, REACH).filter(|&other| guides.seen[other].is_same_surface(&second.seen)) {
            sum = [0, 1, 2].map(|k| sum[k] + layers[0][other][k] + layers[1][other][k]);
            count += 1.0;
        }
        for k in (0..3).filter(|&k| count > 0.0 && second.seen.albedo[k] >= LEAST_ALBEDO) {
            radiance[k] += second.seen.albedo[k] * sum[k] / count - second.light[k];
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_passes_untouched_and_nothing_is_lost() {
        // A mirror on a black wall: all of it goes around.
        let (around, layers) = split([0.5, 0.25, 0.0], [0.1; 3], [0.0; 3], [0.0; 3]);
        assert_eq!((around, layers), ([0.5, 0.25, 0.0], [[0.0; 3]; 2]));
        let (radiance, direct, albedo, shown) = ([0.9, 0.2, 0.4], [0.25, 0.05, -0.15], [0.5, 0.25, 0.001], [0.25; 3]);
        let (around, [lamps, other]) = split(radiance, direct, albedo, shown);
        for k in 0..3 {
            let light = if albedo[k] < LEAST_ALBEDO { 0.0 } else { albedo[k] * (lamps[k] + other[k]) };
            assert!((around[k] + light - radiance[k]).abs() < 1e-6, "{k}");
        }
        assert!(lamps[0] == 0.5 && (other[0] - 0.8).abs() < 1e-6, "{lamps:?} {other:?}");
        assert!(lamps.iter().all(|&x| x >= 0.0) && other[1] < 0.0, "what is taken back is filtered, too");
    }
}
