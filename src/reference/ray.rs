//! Rays as truth takes them.

use crate::math::crossing::Line;

/// A ray whose origin is given relative to a reference point, so that nothing is rounded.
///
/// It is { reference + origin + t direction : t_min ≤ t ≤ t_max }, in world units; the interval is closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TruthRay {
    /// The point that `origin` is relative to, world units. The bounds of [`super::bounds`] depend on it, because the
    /// kernels round positions relative to it.
    pub reference: [f64; 3],
    /// Origin relative to `reference`, world units.
    pub origin: [f64; 3],
    /// Direction, of any length but zero.
    pub direction: [f64; 3],
    /// Least parameter, in units of the direction's length.
    pub t_min: f64,
    /// Greatest parameter; +∞ for none.
    pub t_max: f64,
    /// Global id of a triangle that the ray does not meet: the one that a secondary ray starts from.
    pub exclude: Option<u32>,
}

impl TruthRay {
    /// A ray from a world-space origin; the reference point is the world's origin.
    pub fn new(origin: [f64; 3], direction: [f64; 3], t_min: f64, t_max: f64) -> Self {
        Self { reference: [0.0; 3], origin, direction, t_min, t_max, exclude: None }
    }

    /// The ray of a kernel: `o` and `d` in device units relative to `reference_point_world`, and `unit` world units (a
    /// power of two) to a device unit.
    ///
    /// Origin and direction are scaled alike, so that t is the kernel's own t.
    pub fn from_f32(
        reference_point_world: [f64; 3],
        unit: f64,
        o: [f32; 3],
        d: [f32; 3],
        t_min: f32,
        t_max: f32,
    ) -> Self {
        Self {
            reference: reference_point_world,
            origin: o.map(|x| f64::from(x) * unit),
            direction: d.map(|x| f64::from(x) * unit),
            t_min: t_min.into(),
            t_max: t_max.into(),
            exclude: None,
        }
    }

    /// The line that it lies on.
    pub fn line(&self) -> Line {
        let Self { reference, origin, direction, .. } = *self;
        Line { reference, origin, direction }
    }

    /// The ray, passing through triangle `id` (global). Other triangles at the same place it meets.
    pub fn excluding(self, id: u32) -> Self {
        Self { exclude: Some(id), ..self }
    }

    /// Whether every number is finite (`t_max` may be +∞), the direction has a length, and the interval is not empty.
    pub fn is_valid(&self) -> bool {
        let vectors = self.reference.iter().chain(&self.origin).chain(&self.direction);
        vectors.into_iter().all(|x| x.is_finite())
            && self.direction != [0.0; 3]
            && self.t_min.is_finite()
            && self.t_min <= self.t_max
    }
}
