//! HDR-FLIP: the greatest FLIP over a range of exposures.
//!
//! Andersson, Nilsson, Shirley, Akenine-Möller: *Visualizing Errors in Rendered High Dynamic Range Images*,
//! Eurographics
//! 2021. The range of exposures is that in which the tone mapper brings the reference's maximum luminance, then its
//! median, to 85 % of white. Both images are exposed and tone mapped at steps of about one stop; each pixel's error
//! is the greatest of its FLIP errors.
//!
//! Two cases that the paper leaves open. A median of zero (mostly black pictures) has no exposure: the median of the
//! positive luminances takes its place, and a reference without any is compared at exposure 0. More than
//! [`MAX_EXPOSURES`] stops are spaced evenly over the range.

use super::color::luminance;
use super::flip::{Filters, FlipMap, exclude, flip_of_clamped};
use super::image::{Image, ImageError, check_same_size, finite_in_both};
use rayon::prelude::*;

/// Most exposures that are compared.
const MAX_EXPOSURES: usize = 64;

/// What the tone mapper makes of the brightest and of the median pixel at the ends of the range.
const TARGET: f64 = 0.85;

/// Coefficients of Narkowicz's fit to ACES with its exposure of 0.6 taken out:
/// (k0 x² + k1 x + k2) / (k3 x² + k4 x + k5).
const ACES: [f64; 6] = [0.36 * 2.51, 0.6 * 0.03, 0.0, 0.36 * 2.43, 0.6 * 0.59, 0.14];

/// A range of exposures in stops (log2).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Exposures {
    /// First exposure.
    pub start: f64,
    /// Last exposure, not below the first.
    pub stop: f64,
    /// Number of exposures, both ends included, 2..=64.
    pub count: usize,
}

/// The exposures at which a test image is compared with `reference`. Negative and non-finite values count as black.
pub fn exposures(reference: &Image) -> Exposures {
    let luminances = reference.rgb.iter().filter(|p| p.iter().all(|c| c.is_finite()));
    exposures_of(luminances.map(|p| luminance(p.map(|c| c.max(0.0)))).collect())
}

fn exposures_of(mut luminances: Vec<f32>) -> Exposures {
    let median = |values: &mut Vec<f32>| {
        let middle = values.len() / 2;
        if values.is_empty() { 0.0 } else { f64::from(*values.select_nth_unstable_by(middle, f32::total_cmp).1) }
    };
    let greatest = f64::from(luminances.iter().copied().fold(0.0, f32::max));
    if greatest <= 0.0 {
        return Exposures { start: 0.0, stop: 0.0, count: 2 };
    }
    let mut middle = median(&mut luminances);
    if middle <= 0.0 {
        luminances.retain(|&l| l > 0.0);
        middle = median(&mut luminances);
    }
    // The luminance that is mapped to the target: the larger root of (k0 - t k3) x² + (k1 - t k4) x + (k2 - t k5).
    let [a, b, c] = [0, 1, 2].map(|i| ACES[i] - TARGET * ACES[i + 3]);
    let half = -0.5 * b / a;
    let bright = half + (half * half - c / a).sqrt();
    let (start, stop) = ((bright / greatest).log2(), (bright / middle).log2());
    let count = ((stop - start).ceil() as usize).clamp(2, MAX_EXPOSURES);
    Exposures { start, stop, count }
}

/// HDR-FLIP of `test` against `reference` at `pixels_per_degree`, over [`exposures`] of the reference.
///
/// Negative values are taken as 0. Pixels that are not finite in both images are black in both.
pub fn flip_hdr(test: &Image, reference: &Image, pixels_per_degree: f32) -> Result<FlipMap, ImageError> {
    check_same_size(test, reference)?;
    let finite = finite_in_both(test, reference);
    let ready = |image: &Image| -> Vec<[f32; 3]> {
        let clean = |(p, &finite): (&[f32; 3], &bool)| if finite { p.map(|c| c.max(0.0)) } else { [0.0; 3] };
        image.rgb.iter().zip(&finite).map(clean).collect()
    };
    let (test, reference_rgb) = (ready(test), ready(reference));
    let Exposures { start, stop, count } = exposures_of(reference_rgb.iter().map(|&p| luminance(p)).collect());
    let filters = Filters::new(pixels_per_degree);
    let (width, height) = (reference.width, reference.height);
    let mut errors = vec![0.0f32; width * height];
    for step in 0..count {
        let exposure = start + (stop - start) * step as f64 / (count - 1) as f64;
        let mapped = [&test, &reference_rgb].map(|rgb| tone_mapped(rgb, exposure));
        let at_exposure = flip_of_clamped(width, height, &mapped[0], &mapped[1], &filters);
        errors.iter_mut().zip(at_exposure).for_each(|(error, here)| *error = error.max(here));
    }
    exclude(&mut errors, &finite);
    Ok(FlipMap { width, height, errors })
}

/// Exposes and tone maps; the results lie in 0..=1.
fn tone_mapped(rgb: &[[f32; 3]], exposure: f64) -> Vec<[f32; 3]> {
    // In f64 neither the square of a value nor that of its exposure overflows.
    let scale = exposure.exp2();
    let [k0, k1, k2, k3, k4, k5] = ACES;
    let map = |c: f32| {
        let x = f64::from(c) * scale;
        (((k0 * x + k1) * x + k2) / ((k3 * x + k4) * x + k5)).clamp(0.0, 1.0) as f32
    };
    rgb.par_iter().map(|p| p.map(map)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::PIXELS_PER_DEGREE;

    #[test]
    fn the_ends_of_the_range_map_to_the_target() {
        let image = Image::from_fn(9, 9, |x, y| [2.0f32.powi((x + y) as i32 - 6); 3]);
        let range = exposures(&image);
        let brightest = tone_mapped(&[[1024.0; 3]], range.start)[0][0];
        let median = tone_mapped(&[[4.0; 3]], range.stop)[0][0];
        assert!((brightest - 0.85).abs() < 1e-5 && (median - 0.85).abs() < 1e-5, "{brightest} {median}");
        assert_eq!(range.count, 8);
    }

    #[test]
    fn black_references_are_no_infinity() {
        let black = Image::from_fn(8, 8, |_, _| [0.0; 3]);
        assert_eq!(exposures(&black), Exposures { start: 0.0, stop: 0.0, count: 2 });
        let spot = Image::from_fn(8, 8, |x, y| if x == 3 && y == 4 { [1e30; 3] } else { [0.0; 3] });
        let range = exposures(&spot);
        assert!(range.start.is_finite() && range.stop.is_finite());
        let map = flip_hdr(&black, &spot, PIXELS_PER_DEGREE).unwrap();
        assert!(map.errors.iter().all(|e| e.is_finite()));
        assert!(map.mean() > 0.0);
        assert_eq!(flip_hdr(&spot, &spot, PIXELS_PER_DEGREE).unwrap().mean(), 0.0);
    }

    #[test]
    fn a_wide_range_is_capped() {
        let image = Image::from_fn(8, 8, |x, _| [if x == 0 { 3e38 } else { 1e-30 }; 3]);
        assert_eq!(exposures(&image).count, MAX_EXPOSURES);
    }
}
