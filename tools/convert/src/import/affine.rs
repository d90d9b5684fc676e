//! Affine transformations in f64, row-major 3x4. Their parts are those of glTF 2.0, section 3.5.3.

use crate::source::IDENTITY;

/// A row-major 3x4 matrix.
pub(super) type Affine = [f64; 12];

/// `a * b`: first `b`, then `a`.
pub(super) fn multiply(a: &Affine, b: &Affine) -> Affine {
    let mut product = [0.0; 12];
    for row in 0..3 {
        for column in 0..4 {
            let mut sum = if column == 3 { a[4 * row + 3] } else { 0.0 };
            for k in 0..3 {
                sum += a[4 * row + k] * b[4 * k + column];
            }
            product[4 * row + column] = sum;
        }
    }
    product
}

/// The image of a point.
pub(super) fn point(m: &Affine, p: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| m[4 * k] * p[0] + m[4 * k + 1] * p[1] + m[4 * k + 2] * p[2] + m[4 * k + 3])
}

/// The unit vector along the image of a vector; `None` where that has no direction.
pub(super) fn direction(m: &Affine, v: [f64; 3]) -> Option<[f64; 3]> {
    let image: [f64; 3] = std::array::from_fn(|k| m[4 * k] * v[0] + m[4 * k + 1] * v[1] + m[4 * k + 2] * v[2]);
    // Dividing by the largest component first keeps the squares in range.
    let largest = image.iter().fold(0.0f64, |most, c| most.max(c.abs()));
    let scaled = image.map(|c| c / largest);
    let length = scaled.iter().map(|c| c * c).sum::<f64>().sqrt();
    (largest > 0.0 && length.is_finite()).then(|| scaled.map(|c| c / length))
}

/// The matrix of a column-major 4x4 one, whose last row must be 0 0 0 1.
pub(super) fn from_columns(m: &[f64; 16]) -> Result<Affine, &'static str> {
    if [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0] {
        return Err("the last row of its matrix is not 0 0 0 1");
    }
    Ok(std::array::from_fn(|i| m[4 * (i % 4) + i / 4]))
}

/// Translation * rotation * scale. The quaternion (x, y, z, w) is normalised here, in f64: files round it to f32.
pub(super) fn from_parts(
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
) -> Result<Affine, &'static str> {
    let mut matrix = IDENTITY;
    if let Some(q) = rotation {
        // Dividing by the largest component first keeps the squares in range.
        let largest = q.iter().fold(0.0f64, |m, c| m.max(c.abs()));
        if largest == 0.0 || !largest.is_finite() {
            return Err("its rotation is not a quaternion of non-zero length");
        }
        let [x, y, z, w] = q.map(|c| c / largest);
        let s = 2.0 / (x * x + y * y + z * z + w * w);
        matrix = [
            1.0 - s * (y * y + z * z),
            s * (x * y - z * w),
            s * (x * z + y * w),
            0.0,
            s * (x * y + z * w),
            1.0 - s * (x * x + z * z),
            s * (y * z - x * w),
            0.0,
            s * (x * z - y * w),
            s * (y * z + x * w),
            1.0 - s * (x * x + y * y),
            0.0,
        ];
    }
    for row in 0..3 {
        if let Some(scale) = scale {
            for column in 0..3 {
                matrix[4 * row + column] *= scale[column];
            }
        }
        if let Some(translation) = translation {
            matrix[4 * row + 3] = translation[row];
        }
    }
    Ok(matrix)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apply(m: &Affine, p: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|r| m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3])
    }

    #[test]
    fn parts_apply_scale_then_rotation_then_translation() {
        // A quarter turn about z takes x to y. Exactly: the components are equal, so normalising cancels the root.
        let r = std::f64::consts::FRAC_1_SQRT_2;
        let m = from_parts(Some([10.0, 20.0, 30.0]), Some([0.0, 0.0, r, r]), Some([2.0, -3.0, 4.0])).unwrap();
        assert_eq!(apply(&m, [1.0, 0.0, 0.0]), [10.0, 22.0, 30.0]);
        assert_eq!(apply(&m, [0.0, 1.0, 1.0]), [13.0, 20.0, 34.0]);
        // A quaternion of another length is the same rotation.
        assert_eq!(
            m,
            from_parts(Some([10.0, 20.0, 30.0]), Some([0.0, 0.0, 3e200, 3e200]), Some([2.0, -3.0, 4.0])).unwrap()
        );
        assert!(from_parts(None, Some([0.0; 4]), None).is_err());
    }

    #[test]
    fn columns_become_rows() {
        let columns = [1.0, 2.0, 3.0, 0.0, 4.0, 5.0, 6.0, 0.0, 7.0, 8.0, 9.0, 0.0, 10.0, 11.0, 12.0, 1.0];
        let m = from_columns(&columns).unwrap();
        assert_eq!(m, [1.0, 4.0, 7.0, 10.0, 2.0, 5.0, 8.0, 11.0, 3.0, 6.0, 9.0, 12.0]);
        for at in [3, 7, 11, 15] {
            let mut projective = columns;
            projective[at] = 0.5;
            assert!(from_columns(&projective).is_err(), "{at}");
        }
    }

    #[test]
    fn product_applies_the_right_factor_first() {
        let a = from_parts(Some([1.0, 2.0, 3.0]), Some([1.0, 1.0, 0.0, 1.0]), Some([2.0, 1.0, 0.5])).unwrap();
        let b = from_parts(Some([-4.0, 0.5, 8.0]), Some([0.0, 1.0, 2.0, -1.0]), None).unwrap();
        let p = [0.25, -7.0, 3.0];
        let (both, steps) = (apply(&multiply(&a, &b), p), apply(&a, apply(&b, p)));
        for axis in 0..3 {
            assert!((both[axis] - steps[axis]).abs() < 1e-13, "{both:?} {steps:?}");
        }
        let swapped = apply(&multiply(&b, &a), p);
        assert!((swapped[0] - steps[0]).abs() > 1e-3, "the order must matter for this test to mean anything");
    }
}
