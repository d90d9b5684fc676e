//! Metrics that look at one pixel at a time.

use super::image::{Image, ImageError, check_same_size, finite_in_both};

/// ε of relMSE: it bounds the weight of dark pixels.
pub const RELATIVE_EPSILON: f64 = 0.01;

/// The per-pixel metrics of two images, in f64 over the pixels that are finite in both. With no such pixel all are
/// zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PixelErrors {
    /// Pixels finite in both images.
    pub compared_pixels: u64,
    /// Pixels with a NaN or an infinity in either image.
    pub non_finite_pixels: u64,
    /// √ mean (a − b)².
    pub rmse: f64,
    /// Mean (a − b)² / (b² + [`RELATIVE_EPSILON`]).
    pub rel_mse: f64,
    /// Mean (a − b).
    pub bias: f64,
    /// Mean (a − b) of each channel.
    pub bias_rgb: [f64; 3],
    /// Greatest abs(a − b) of any channel.
    pub max_error: f64,
}

/// The per-pixel metrics of `a` against the reference `b`.
pub fn pixel_errors(a: &Image, b: &Image) -> Result<PixelErrors, ImageError> {
    check_same_size(a, b)?;
    let finite = finite_in_both(a, b);
    let mut errors = PixelErrors::default();
    let (mut squares, mut relative) = (0.0f64, 0.0f64);
    for ((a, b), &finite) in a.rgb.iter().zip(&b.rgb).zip(&finite) {
        if !finite {
            errors.non_finite_pixels += 1;
            continue;
        }
        errors.compared_pixels += 1;
        for c in 0..3 {
            let (a, b) = (f64::from(a[c]), f64::from(b[c]));
            let difference = a - b;
            squares += difference * difference;
            relative += difference * difference / (b * b + RELATIVE_EPSILON);
            errors.bias_rgb[c] += difference;
            errors.max_error = errors.max_error.max(difference.abs());
        }
    }
    let pixels = errors.compared_pixels.max(1) as f64;
    errors.rmse = (squares / (3.0 * pixels)).sqrt();
    errors.rel_mse = relative / (3.0 * pixels);
    errors.bias_rgb = errors.bias_rgb.map(|sum| sum / pixels);
    errors.bias = errors.bias_rgb.iter().sum::<f64>() / 3.0;
    Ok(errors)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn closed_forms() {
        let b = Image::from_fn(4, 2, |x, _| [x as f32, 0.0, 1.0]);
        let a = Image::from_fn(4, 2, |x, y| [x as f32 + 0.5, if y == 0 { -0.25 } else { 0.25 }, 1.0]);
        let e = pixel_errors(&a, &b).unwrap();
        assert_eq!((e.compared_pixels, e.non_finite_pixels), (8, 0));
        assert_eq!(e.bias_rgb, [0.5, 0.0, 0.0]);
        assert_eq!(e.bias, 0.5 / 3.0);
        assert_eq!(e.max_error, 0.5);
        assert!((e.rmse - ((0.25 + 0.0625) / 3.0f64).sqrt()).abs() < 1e-15);
        let red: f64 = (0..4).map(|x| 0.25 / ((x * x) as f64 + 0.01)).sum::<f64>() / 4.0;
        assert!((e.rel_mse - (red + 0.0625 / 0.01) / 3.0).abs() < 1e-12);
        // The reference is the second image: exchanging them turns the sign of the bias and changes relMSE.
        let swapped = pixel_errors(&b, &a).unwrap();
        assert_eq!(swapped.bias, -e.bias);
        assert_ne!(swapped.rel_mse, e.rel_mse);
    }

    #[test]
    fn non_finite_pixels_are_counted_and_left_out() {
        let b = Image::from_fn(3, 1, |_, _| [0.5; 3]);
        let mut a = b.clone();
        a.rgb[0][1] = f32::NAN;
        a.rgb[2][2] = f32::NEG_INFINITY;
        let e = pixel_errors(&a, &b).unwrap();
        assert_eq!((e.compared_pixels, e.non_finite_pixels, e.rmse), (1, 2, 0.0));
        // Control: the same pixels count once they are finite.
        a.rgb[0][1] = 7.0;
        assert!(pixel_errors(&a, &b).unwrap().rmse > 0.0);
    }

    #[test]
    fn sizes_must_agree() {
        let a = Image::from_fn(3, 2, |_, _| [0.0; 3]);
        let b = Image::from_fn(2, 3, |_, _| [0.0; 3]);
        let text = pixel_errors(&a, &b).unwrap_err().to_string();
        assert!(text.contains("3x2") && text.contains("2x3"), "{text}");
        let empty = Image { width: 0, height: 0, rgb: vec![] };
        assert!(matches!(pixel_errors(&empty, &empty), Err(ImageError::Pixels { .. })));
    }
}
