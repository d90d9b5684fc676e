//! FLIP for pictures of low dynamic range.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild: *FLIP: A Difference Evaluator for Alternating
//! Images*, HPG 2020. Per pixel: the perceived colour difference ΔEc between the images after filtering by contrast
//! sensitivity, raised by the difference ΔEf of their edges and points: ΔE = ΔEc^(1 − ΔEf). All filters are Gaussians
//! or derivatives of Gaussians, so the two-dimensional convolutions are made of passes along x and y. The filter of the
//! blue-yellow channel is a sum of two Gaussians and takes two such pairs.

use super::color::{hunt_lab_from_rgb, hyab, rgb_from_ycxcz, ycxcz_from_rgb};
use super::filter::Plane;
use super::image::{Image, ImageError, check_same_size, finite_in_both};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Pixels per degree of visual angle that `compare` assumes: a 4K monitor of 0.7 m seen from 0.7 m.
pub const PIXELS_PER_DEGREE: f32 = 67.0;

/// Exponent of the colour difference, q_c.
const COLOR_EXPONENT: f32 = 0.7;
/// The share p_c of the greatest colour difference that is mapped to p_t.
const COLOR_SHARE: f32 = 0.4;
/// What that share is mapped to, p_t.
const COLOR_TARGET: f32 = 0.95;
/// Width w of the feature detectors in degrees.
const FEATURE_WIDTH: f32 = 0.082;
/// Exponent of the feature difference, q_f.
const FEATURE_EXPONENT: f32 = 0.5;

/// The Gaussians of contrast sensitivity (a, b): value a √(π/b) exp(−π² x² / b) at x degrees.
const ACHROMATIC: [(f32, f32); 1] = [(1.0, 0.0047)];
const RED_GREEN: [(f32, f32); 1] = [(1.0, 0.0053)];
const BLUE_YELLOW: [(f32, f32); 2] = [(34.1, 0.04), (13.5, 0.025)];
/// The greatest b, which sets the radius of the filters.
const WIDEST: f32 = 0.04;

/// FLIP of every pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct FlipMap {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Errors in 0..=1, row by row; NaN where either image is not finite.
    pub errors: Vec<f32>,
}

impl FlipMap {
    /// Mean over the pixels that are finite in both images; 0 if there are none.
    pub fn mean(&self) -> f64 {
        let (sum, count) = self
            .errors
            .iter()
            .filter(|error| !error.is_nan())
            .fold((0.0f64, 0u64), |(sum, count), &error| (sum + f64::from(error), count + 1));
        sum / count.max(1) as f64
    }
}

/// FLIP of `test` against `reference` at `pixels_per_degree` (0.01 at least; less is taken as 0.01).
///
/// Both are clamped to 0..=1. Pixels that are not finite in both images are black in both while filtering.
pub fn flip_ldr(test: &Image, reference: &Image, pixels_per_degree: f32) -> Result<FlipMap, ImageError> {
    check_same_size(test, reference)?;
    let finite = finite_in_both(test, reference);
    let ready = |image: &Image| -> Vec<[f32; 3]> {
        let clamp = |(p, &finite): (&[f32; 3], &bool)| if finite { p.map(|c| c.clamp(0.0, 1.0)) } else { [0.0; 3] };
        image.rgb.iter().zip(&finite).map(clamp).collect()
    };
    let filters = Filters::new(pixels_per_degree);
    let (width, height) = (test.width, test.height);
    let mut errors = flip_of_clamped(width, height, &ready(test), &ready(reference), &filters);
    exclude(&mut errors, &finite);
    Ok(FlipMap { width, height, errors })
}

/// Marks the pixels that do not count.
pub(super) fn exclude(errors: &mut [f32], finite: &[bool]) {
    for (error, &finite) in errors.iter_mut().zip(finite) {
        if !finite {
            *error = f32::NAN;
        }
    }
}

/// FLIP per pixel of images in linear RGB within 0..=1.
pub(super) fn flip_of_clamped(
    width: usize,
    height: usize,
    test: &[[f32; 3]],
    reference: &[[f32; 3]],
    filters: &Filters,
) -> Vec<f32> {
    let test = Features::of(width, height, test, filters);
    let reference = Features::of(width, height, reference, filters);
    let greatest = hyab(hunt_lab_from_rgb([0.0, 1.0, 0.0]), hunt_lab_from_rgb([0.0, 0.0, 1.0])).powf(COLOR_EXPONENT);
    let knee = COLOR_SHARE * greatest;
    (0..width * height)
        .into_par_iter()
        .map(|i| {
            let difference = hyab(reference.lab[i], test.lab[i]).powf(COLOR_EXPONENT);
            let color = if difference < knee {
                difference * COLOR_TARGET / knee
            } else {
                COLOR_TARGET + (difference - knee) / (greatest - knee) * (1.0 - COLOR_TARGET)
            };
            let edge = (reference.edge[i] - test.edge[i]).abs();
            let point = (reference.point[i] - test.point[i]).abs();
            let feature = (edge.max(point) / 2.0f32.sqrt()).powf(FEATURE_EXPONENT);
            color.powf(1.0 - feature).clamp(0.0, 1.0)
        })
        .collect()
}

/// What FLIP extracts from one image.
struct Features {
    /// Hunt-adjusted Lab after filtering by contrast sensitivity.
    lab: Vec<[f32; 3]>,
    /// Length of the gradient of luminance.
    edge: Vec<f32>,
    /// Length of the vector of second derivatives of luminance.
    point: Vec<f32>,
}

impl Features {
    fn of(width: usize, height: usize, rgb: &[[f32; 3]], filters: &Filters) -> Self {
        let ycxcz: Vec<[f32; 3]> = rgb.par_iter().map(|&p| ycxcz_from_rgb(p)).collect();
        let plane = |c: usize| Plane::new(width, height, ycxcz.iter().map(|p| p[c]).collect());

        let luma = plane(0);
        let filtered_luma = luma.along_x(&filters.achromatic).along_y(&filters.achromatic);
        let cx = plane(1).along_x(&filters.red_green).along_y(&filters.red_green);
        let cz = plane(2);
        let [wide, narrow] = &filters.blue_yellow;
        let (cz_wide, cz_narrow) = (cz.along_x(wide).along_y(wide), cz.along_x(narrow).along_y(narrow));
        let lab = (0..rgb.len())
            .into_par_iter()
            .map(|i| {
                let filtered = [filtered_luma.values[i], cx.values[i], cz_wide.values[i] + cz_narrow.values[i]];
                hunt_lab_from_rgb(rgb_from_ycxcz(filtered).map(|c| c.clamp(0.0, 1.0)))
            })
            .collect();

        let gray = Plane::new(width, height, luma.values.iter().map(|y| (y + 16.0) / 116.0).collect());
        let blurred_x = gray.along_x(&filters.gaussian);
        let length = |x: Plane, y: Plane| -> Vec<f32> {
            x.values.par_iter().zip(&y.values).map(|(x, y)| (x * x + y * y).sqrt()).collect()
        };
        let derivative =
            |kernel: &[f32]| length(gray.along_x(kernel).along_y(&filters.gaussian), blurred_x.along_y(kernel));
        Self { lab, edge: derivative(&filters.first), point: derivative(&filters.second) }
    }
}

/// The filters for one viewing distance: taps along one axis, an odd number.
pub(super) struct Filters {
    achromatic: Vec<f32>,
    red_green: Vec<f32>,
    /// The two Gaussians of the blue-yellow channel; the sum of their outer products is its filter.
    blue_yellow: [Vec<f32>; 2],
    gaussian: Vec<f32>,
    /// First derivative of the Gaussian: its positive taps sum to 1, its negative ones to −1.
    first: Vec<f32>,
    /// Second derivative, normalised likewise.
    second: Vec<f32>,
}

impl Filters {
    pub(super) fn new(pixels_per_degree: f32) -> Self {
        let ppd = pixels_per_degree.max(0.01);
        let radius = (3.0 * (WIDEST / (2.0 * PI * PI)).sqrt() * ppd).ceil() as i32;
        let single = |[(_, b)]: [(f32, f32); 1]| normalised(taps(radius, |x| (-PI * PI * (x / ppd).powi(2) / b).exp()));

        // One factor of each Gaussian goes to each axis; both kernels are scaled together so that the filter sums to 1.
        let [mut wide, mut narrow] = BLUE_YELLOW
            .map(|(a, b)| taps(radius, |x| (a * (PI / b).sqrt()).sqrt() * (-PI * PI * (x / ppd).powi(2) / b).exp()));
        let (sum_wide, sum_narrow) = (wide.iter().sum::<f32>(), narrow.iter().sum::<f32>());
        let scale = 1.0 / (sum_wide * sum_wide + sum_narrow * sum_narrow).sqrt();
        wide.iter_mut().chain(&mut narrow).for_each(|tap| *tap *= scale);

        let deviation = 0.5 * FEATURE_WIDTH * ppd;
        let radius = (3.0 * deviation).ceil() as i32;
        let gaussian = |x: f32| (-x * x / (2.0 * deviation * deviation)).exp();
        Self {
            achromatic: single(ACHROMATIC),
            red_green: single(RED_GREEN),
            blue_yellow: [wide, narrow],
            gaussian: normalised(taps(radius, gaussian)),
            first: balanced(taps(radius, |x| -x * gaussian(x))),
            second: balanced(taps(radius, |x| (x * x / (deviation * deviation) - 1.0) * gaussian(x))),
        }
    }
}

fn taps(radius: i32, value: impl Fn(f32) -> f32) -> Vec<f32> {
    (-radius..=radius).map(|x| value(x as f32)).collect()
}

fn normalised(taps: Vec<f32>) -> Vec<f32> {
    let sum: f32 = taps.iter().sum();
    taps.into_iter().map(|tap| tap / sum).collect()
}

/// Scales positive taps to a sum of 1 and negative ones to a sum of −1.
fn balanced(taps: Vec<f32>) -> Vec<f32> {
    let positive: f32 = taps.iter().filter(|&&tap| tap > 0.0).sum();
    let negative: f32 = -taps.iter().filter(|&&tap| tap < 0.0).sum::<f32>();
    let scale = |tap: f32| match tap {
        tap if tap > 0.0 => tap / positive,
        tap if tap < 0.0 => tap / negative,
        _ => 0.0,
    };
    taps.into_iter().map(scale).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filters_sum_as_they_should() {
        let filters = Filters::new(PIXELS_PER_DEGREE);
        let sum = |taps: &[f32]| taps.iter().sum::<f32>();
        for taps in [&filters.achromatic, &filters.red_green, &filters.gaussian] {
            assert!((sum(taps) - 1.0).abs() < 1e-6);
        }
        let [wide, narrow] = &filters.blue_yellow;
        assert!((sum(wide).powi(2) + sum(narrow).powi(2) - 1.0).abs() < 1e-6);
        for taps in [&filters.first, &filters.second] {
            assert!(sum(taps).abs() < 1e-6);
        }
        assert_eq!(wide.len(), 21);
        assert_eq!(filters.first.len(), 19);
    }

    #[test]
    fn equal_images_have_none_and_opposite_ones_most() {
        let black = Image::from_fn(24, 16, |_, _| [0.0; 3]);
        let white = Image::from_fn(24, 16, |_, _| [1.0; 3]);
        assert_eq!(flip_ldr(&white, &white, PIXELS_PER_DEGREE).unwrap().mean(), 0.0);
        assert!(flip_ldr(&black, &white, PIXELS_PER_DEGREE).unwrap().mean() > 0.9);
        let one = Image::from_fn(1, 1, |_, _| [0.3; 3]);
        assert_eq!(flip_ldr(&one, &one, PIXELS_PER_DEGREE).unwrap().mean(), 0.0);
    }

    #[test]
    fn non_finite_pixels_are_excluded() {
        let b = Image::from_fn(16, 16, |x, _| [x as f32 / 16.0; 3]);
        let mut a = b.clone();
        a.rgb[40] = [f32::NAN, 0.0, 0.0];
        let map = flip_ldr(&a, &b, PIXELS_PER_DEGREE).unwrap();
        assert_eq!(map.errors.iter().filter(|e| e.is_nan()).count(), 1);
        assert_eq!(map.mean(), 0.0);
        a.rgb[40] = [0.9, 0.0, 0.0];
        assert!(flip_ldr(&a, &b, PIXELS_PER_DEGREE).unwrap().mean() > 0.0, "control: a finite difference counts");
    }
}
