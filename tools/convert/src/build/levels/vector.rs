//! Vectors of three f64.

/// A point or vector, in lattice steps.
pub(super) type Vec3 = [f64; 3];

/// a - b.
pub(super) fn sub(a: Vec3, b: Vec3) -> Vec3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// a + t b.
pub(super) fn add_scaled(a: Vec3, t: f64, b: Vec3) -> Vec3 {
    [a[0] + t * b[0], a[1] + t * b[1], a[2] + t * b[2]]
}

/// The scalar product.
pub(super) fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The vector product.
pub(super) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Twice the area vector of a triangle.
pub(super) fn area_vector([a, b, c]: [Vec3; 3]) -> Vec3 {
    cross(sub(b, a), sub(c, a))
}

/// The square of the length.
pub(super) fn square(a: Vec3) -> f64 {
    dot(a, a)
}

/// The length.
pub(super) fn length(a: Vec3) -> f64 {
    square(a).sqrt()
}

/// Six classes of directions: the axis of the largest component, and its sign.
pub(super) const CLASSES: usize = 6;

/// The class of a direction.
pub(super) fn class(v: Vec3) -> usize {
    let size = v.map(f64::abs);
    let axis = if size[0] >= size[1] && size[0] >= size[2] { 0 } else { 1 + usize::from(size[2] > size[1]) };
    2 * axis + usize::from(v[axis] < 0.0)
}
