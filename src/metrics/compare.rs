//! All metrics of two loaded images at once.

use super::flip::{PIXELS_PER_DEGREE, flip_ldr};
use super::hdr::flip_hdr;
use super::image::{ImageError, check_same_size};
use super::load::{Channel, Encoding, Loaded};
use super::pixel::{PixelErrors, pixel_errors};
use std::path::PathBuf;

/// The EXR channel of global triangle ids.
const ID_CHANNEL: &str = "triangle.id";

/// Which FLIP was computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FlipKind {
    /// Of values clamped to 0..=1: at least one image is a PNG.
    Ldr,
    /// Over exposures: both images are EXR.
    Hdr,
}

/// How image A differs from the reference B.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Comparison {
    /// File of image A.
    pub a: PathBuf,
    /// File of the reference B.
    pub b: PathBuf,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// RMSE, relMSE, bias, greatest error and the counts of pixels.
    #[serde(flatten)]
    pub pixels: PixelErrors,
    /// Mean FLIP over the pixels finite in both, 0..=1.
    pub flip: f64,
    /// Greatest FLIP of a pixel.
    pub flip_max: f64,
    /// Which FLIP that is.
    pub flip_kind: FlipKind,
    /// Pixels per degree that FLIP assumed.
    pub pixels_per_degree: f64,
    /// Pixels whose integer `triangle.id` differs; `None` unless both files have that channel.
    pub ids_differing: Option<u64>,
}

/// Two files that cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// The images do not fit together.
    #[error("{} and {}: {source}", a.display(), b.display())]
    Image {
        /// File of image A.
        a: PathBuf,
        /// File of image B.
        b: PathBuf,
        /// Why.
        source: ImageError,
    },
    /// No pixel is finite in both images, so that no metric has a value.
    #[error("{} and {}: no pixel is finite in both images, so there is nothing to compare", a.display(), b.display())]
    NothingFinite {
        /// File of image A.
        a: PathBuf,
        /// File of image B.
        b: PathBuf,
    },
}

/// Compares `a` with the reference `b`. FLIP is at [`PIXELS_PER_DEGREE`]; it is HDR-FLIP if both are EXR.
pub fn compare(a: &Loaded, b: &Loaded) -> Result<Comparison, CompareError> {
    let image_error = |source| CompareError::Image { a: a.path.clone(), b: b.path.clone(), source };
    check_same_size(&a.image, &b.image).map_err(image_error)?;
    let pixels = pixel_errors(&a.image, &b.image).map_err(image_error)?;
    if pixels.compared_pixels == 0 {
        return Err(CompareError::NothingFinite { a: a.path.clone(), b: b.path.clone() });
    }
    let (flip_kind, map) = match (a.encoding, b.encoding) {
        (Encoding::Exr, Encoding::Exr) => (FlipKind::Hdr, flip_hdr(&a.image, &b.image, PIXELS_PER_DEGREE)),
        _ => (FlipKind::Ldr, flip_ldr(&a.image, &b.image, PIXELS_PER_DEGREE)),
    };
    let map = map.map_err(image_error)?;
    let ids_differing = match (a.channels.get(ID_CHANNEL), b.channels.get(ID_CHANNEL)) {
        (Some(Channel::Integer(a)), Some(Channel::Integer(b))) => Some(count_differing(a, b)),
        _ => None,
    };
    Ok(Comparison {
        a: a.path.clone(),
        b: b.path.clone(),
        width: a.image.width,
        height: a.image.height,
        pixels,
        flip: map.mean(),
        flip_max: f64::from(map.errors.iter().copied().fold(0.0, f32::max)),
        flip_kind,
        pixels_per_degree: f64::from(PIXELS_PER_DEGREE),
        ids_differing,
    })
}

/// Number of places at which the integers differ; those that only one slice has count as differing.
pub fn count_differing(a: &[u32], b: &[u32]) -> u64 {
    let differing = a.iter().zip(b).filter(|(a, b)| a != b).count();
    (differing + a.len().abs_diff(b.len())) as u64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::Image;
    use std::collections::BTreeMap;

    fn loaded(encoding: Encoding, ids: Option<Vec<u32>>) -> Loaded {
        let image = Image::from_fn(12, 8, |x, y| [x as f32 / 12.0, y as f32 / 8.0, 0.25]);
        let channels = ids.map(|ids| (ID_CHANNEL.to_owned(), Channel::Integer(ids)));
        Loaded { path: "x".into(), encoding, image, channels: BTreeMap::from_iter(channels) }
    }

    #[test]
    fn equal_images_and_a_permuted_id() {
        // Ids beyond 2^24, neighbours of which are equal as f32.
        let ids: Vec<u32> = (0..96).map(|i| (1 << 30) + i).collect();
        let a = loaded(Encoding::Exr, Some(ids.clone()));
        let same = compare(&a, &a).unwrap();
        assert_eq!((same.pixels.rmse, same.flip, same.ids_differing), (0.0, 0.0, Some(0)));
        assert_eq!(same.flip_kind, FlipKind::Hdr);

        let mut permuted = ids;
        permuted.swap(5, 6);
        let b = loaded(Encoding::Exr, Some(permuted));
        assert_eq!(compare(&a, &b).unwrap().ids_differing, Some(2));
        assert_eq!(compare(&a, &loaded(Encoding::Exr, None)).unwrap().ids_differing, None);
        assert_eq!(count_differing(&[1, 2], &[1]), 1);
    }

    #[test]
    fn kind_of_flip_and_json() {
        let png = loaded(Encoding::Png, None);
        let mut brighter = loaded(Encoding::Exr, None);
        brighter.image.rgb.iter_mut().for_each(|p| p[1] += 0.1);
        let result = compare(&brighter, &png).unwrap();
        assert_eq!(result.flip_kind, FlipKind::Ldr);
        assert!(result.flip > 0.01 && result.flip_max >= result.flip);
        assert!((result.pixels.bias_rgb[1] - 0.1).abs() < 1e-7);
        let json = serde_json::to_value(&result).unwrap();
        for key in ["rmse", "rel_mse", "bias", "flip", "max_error", "non_finite_pixels", "ids_differing"] {
            assert!(json.get(key).is_some(), "{key} in {json}");
        }
        assert_eq!(json["flip_kind"], "ldr");
    }

    #[test]
    fn errors() {
        let a = loaded(Encoding::Png, None);
        let mut b = a.clone();
        b.image = Image::from_fn(8, 12, |_, _| [0.0; 3]);
        let text = compare(&a, &b).unwrap_err().to_string();
        assert!(text.contains("12x8") && text.contains("8x12"), "{text}");
        b.image = Image::from_fn(12, 8, |_, _| [f32::NAN; 3]);
        assert!(matches!(compare(&a, &b), Err(CompareError::NothingFinite { .. })));
    }
}
