//! Placements in f64: points, normals and boxes through a row-major 3x4 matrix.

/// An affine map, row-major 3x4.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Affine(pub [f64; 12]);

impl Affine {
    /// The image of a point.
    pub fn point(&self, p: [f64; 3]) -> [f64; 3] {
        let m = &self.0;
        std::array::from_fn(|k| m[4 * k] * p[0] + m[4 * k + 1] * p[1] + m[4 * k + 2] * p[2] + m[4 * k + 3])
    }

    /// The image of a vector.
    pub fn vector(&self, v: [f64; 3]) -> [f64; 3] {
        let m = &self.0;
        std::array::from_fn(|k| m[4 * k] * v[0] + m[4 * k + 1] * v[1] + m[4 * k + 2] * v[2])
    }

    /// Whether every element is a finite number.
    pub fn is_finite(&self) -> bool {
        self.0.iter().all(|value| value.is_finite())
    }

    /// Determinant of the linear part, by the expression of the format's check.
    pub fn determinant(&self) -> f64 {
        bricks::Instance { object: 0, base: 0, flags: 0, _reserved: 0, world_from_object: self.0 }.determinant()
    }

    /// What maps normals: a positive multiple of the inverse transpose of the linear part (its cofactors, with the sign
    /// of the determinant), row-major 3x3. It also exists for singular matrices.
    pub fn normal_matrix(&self) -> [f64; 9] {
        let m = |row: usize, column: usize| self.0[4 * (row % 3) + column % 3];
        // Scaled first, so that products of two elements neither overflow nor vanish.
        let largest = (0..9).map(|i| m(i / 3, i % 3).abs()).fold(0.0, f64::max);
        let scale = if largest > 0.0 && largest.is_finite() { 1.0 / largest } else { 1.0 };
        let sign = if self.determinant() < 0.0 { -1.0 } else { 1.0 };
        std::array::from_fn(|i| {
            let (row, column) = (i / 3, i % 3);
            let s = |r: usize, c: usize| m(row + r, column + c) * scale;
            sign * (s(1, 1) * s(2, 2) - s(1, 2) * s(2, 1))
        })
    }

    /// Ratio κ of the largest to the smallest singular value of the linear part; infinite if it is singular.
    pub fn scale_ratio(&self) -> f64 {
        let Some((_, values)) = self.squared_scales() else { return f64::INFINITY };
        let (least, most) =
            (values.iter().copied().fold(f64::MAX, f64::min), values.iter().copied().fold(0.0, f64::max));
        if least > 0.0 { (most / least).sqrt().max(1.0) } else { f64::INFINITY }
    }

    /// The largest singular value of the linear part: by how much lengths grow at most.
    pub fn largest_scale(&self) -> f64 {
        let Some((unit, values)) = self.squared_scales() else { return 0.0 };
        unit * values.iter().copied().fold(0.0, f64::max).sqrt()
    }

    /// A length, and the squares of the singular values of the linear part in units of it; `None` if all is zero or
    /// something not finite.
    fn squared_scales(&self) -> Option<(f64, [f64; 3])> {
        let m = |row: usize, column: usize| self.0[4 * row + column];
        let largest = (0..9).map(|i| m(i / 3, i % 3).abs()).fold(0.0, f64::max);
        if largest == 0.0 || !largest.is_finite() {
            return None;
        }
        let mut g = [[0.0; 3]; 3];
        for (i, row) in g.iter_mut().enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                *value = (0..3).map(|k| (m(k, i) / largest) * (m(k, j) / largest)).sum();
            }
        }
        Some((largest, symmetric_eigenvalues(g)))
    }

    /// A box that contains the images of all points of a box, rounding errors included.
    pub fn bounds(&self, min: [f64; 3], max: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        bricks::image_bounds(&self.0, min, max)
    }
}

/// Eigenvalues of a symmetric matrix by cyclic Jacobi rotations.
fn symmetric_eigenvalues(mut a: [[f64; 3]; 3]) -> [f64; 3] {
    for _ in 0..16 {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            if a[p][q] == 0.0 {
                continue;
            }
            let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
            let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
            let c = 1.0 / (t * t + 1.0).sqrt();
            let s = t * c;
            for row in &mut a {
                (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
            }
            let (row_p, row_q) = (a[p], a[q]);
            a[p] = std::array::from_fn(|k| c * row_p[k] - s * row_q[k]);
            a[q] = std::array::from_fn(|k| s * row_p[k] + c * row_q[k]);
        }
    }
    [a[0][0], a[1][1], a[2][2]]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn affine(linear: [f64; 9], t: [f64; 3]) -> Affine {
        let l = linear;
        Affine([l[0], l[1], l[2], t[0], l[3], l[4], l[5], t[1], l[6], l[7], l[8], t[2]])
    }

    #[test]
    fn scale_ratio_is_that_of_the_singular_values() {
        let (s, c) = 0.7f64.sin_cos();
        // A rotation between two scalings of ratio 12: 6, 1.5, 0.5 on orthogonal axes.
        let rotated = affine([6.0 * c, -1.5 * s, 0.0, 6.0 * s, 1.5 * c, 0.0, 0.0, 0.0, -0.5], [9.0; 3]);
        assert!((rotated.scale_ratio() - 12.0).abs() < 1e-12);
        assert!((rotated.largest_scale() - 6.0).abs() < 1e-12);
        let even = affine([c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0], [0.0; 3]);
        assert!((even.scale_ratio() - 1.0).abs() < 1e-12);
        let singular = affine([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], [0.0; 3]);
        assert_eq!(singular.scale_ratio(), f64::INFINITY);
        assert_eq!(affine([0.0; 9], [0.0; 3]).scale_ratio(), f64::INFINITY);
        let small = affine([1e-160, 0.0, 0.0, 0.0, 1e-160, 0.0, 0.0, 0.0, 4e-160], [0.0; 3]);
        assert!((small.scale_ratio() - 4.0).abs() < 1e-12);
    }

    #[test]
    fn normals_stay_normal_and_outward() {
        let matrices = [
            affine([2.0, 0.5, 0.0, 0.0, 3.0, -1.0, 0.25, 0.0, 0.5], [1.0, 2.0, 3.0]),
            affine([-2.0, 0.5, 0.0, 0.0, 3.0, -1.0, 0.25, 0.0, 0.5], [1.0, 2.0, 3.0]),
        ];
        for m in matrices {
            let n = m.normal_matrix();
            let normal: [f64; 3] = std::array::from_fn(|k| n[3 * k] * 0.6 + n[3 * k + 1] * 0.0 + n[3 * k + 2] * 0.8);
            let origin = m.point([0.0; 3]);
            let image = |p: [f64; 3]| -> f64 {
                let q = m.point(p);
                (0..3).map(|k| (q[k] - origin[k]) * normal[k]).sum()
            };
            assert!(image([0.8, 0.0, -0.6]).abs() < 1e-12, "a tangent stays a tangent");
            assert!(image([0.0, 1.0, 0.0]).abs() < 1e-12, "a tangent stays a tangent");
            assert!(image([0.6, 0.0, 0.8]) > 0.1, "the outside stays outside, mirrored or not");
        }
    }

    #[test]
    fn boxes_contain_their_points() {
        let m = affine([0.1, -0.7, 0.3, 1.7, 0.3, 0.11, -0.9, 0.2, 1.3], [1e7, -3e6, 0.1]);
        let (min, max) = ([-1.1, 0.3, 5.0], [2.3, 0.7, 9.1]);
        let (low, high) = m.bounds(min, max);
        for corner in 0..8 {
            let p = std::array::from_fn(|k| if corner >> k & 1 == 0 { min[k] } else { max[k] });
            let q = m.point(p);
            assert!((0..3).all(|k| low[k] <= q[k] && q[k] <= high[k]));
        }
        let outside = m.point([2.4, 0.3, 5.0]);
        assert!((0..3).any(|k| outside[k] < low[k] || outside[k] > high[k]));
    }
}
