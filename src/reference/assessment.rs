//! What truth says of a kernel's hit of a triangle.

/// Holds the terms of higher order.
pub(super) const SLACK: f64 = 1.0 + 1.0 / 65_536.0;

/// What can be said of a triangle's hit by a kernel.
#[derive(Clone, Copy, Debug)]
pub struct Assessment {
    /// Whether truth has the ray's line meet the closed triangle.
    pub inside: bool,
    /// Distance of the ray from the triangle's boundary, across the direction's dominant axis, in object units.
    pub edge_distance: f64,
    /// ε_edge, in the same units.
    pub edge_epsilon: f64,
    /// Least t that the kernel may report.
    pub t_low: f64,
    /// Greatest t that the kernel may report.
    pub t_high: f64,
    /// The vertices on the sheared plane.
    pub(super) sheared: [[f64; 2]; 3],
}

impl Assessment {
    /// Whether the ray is within ε_edge of an edge, so that the kernel may decide either way.
    pub fn near_edge(&self) -> bool {
        self.edge_distance <= self.edge_epsilon
    }

    /// Whether the kernel must find the triangle met, t aside.
    pub fn certainly_met(&self) -> bool {
        self.inside && !self.near_edge()
    }

    /// Whether the kernel may find the triangle met, t aside.
    pub fn possibly_met(&self) -> bool {
        self.inside || self.near_edge()
    }

    /// Twice the area on the sheared plane, with its sign.
    pub(super) fn determinant(&self) -> f64 {
        orientation(self.sheared[0], self.sheared[1], self.sheared[2])
    }

    /// Whether the winding on the sheared plane stays the same however the vertices move by up to `e`.
    pub(super) fn winding_is_certain(&self, e: f64) -> bool {
        self.determinant().abs() > (perimeter(&self.sheared) * e + 3.0 * e * e) * SLACK
    }
}

/// Twice the signed area of a triangle on a plane.
pub(super) fn orientation(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Distance of the origin from a segment of the plane.
pub(super) fn distance_to_segment(a: [f64; 2], b: [f64; 2]) -> f64 {
    let e = [b[0] - a[0], b[1] - a[1]];
    let squared = e[0] * e[0] + e[1] * e[1];
    let s = if squared > 0.0 { (-(a[0] * e[0] + a[1] * e[1]) / squared).clamp(0.0, 1.0) } else { 0.0 };
    (a[0] + s * e[0]).hypot(a[1] + s * e[1])
}

pub(super) fn perimeter(p: &[[f64; 2]; 3]) -> f64 {
    (0..3).map(|i| (p[i][0] - p[(i + 1) % 3][0]).hypot(p[i][1] - p[(i + 1) % 3][1])).sum()
}
