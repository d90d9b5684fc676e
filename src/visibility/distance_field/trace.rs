//! Sphere tracing.

use super::field::{DistanceField, LEVELS};

/// How rays go through a field. Lengths are in cells of the finest level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracing {
    /// Most look-ups of a ray: 64, of soft shadows 16 (spec §2).
    pub iterations: u32,
    /// A ray hits where the nearest middle of an occupied cell is no farther. A plane in the middle of its cells is at most 0 away; in a
    /// corner 3^0.5 / 2.
    pub hit: f32,
    /// Least way between two look-ups.
    pub least_step: f32,
}

impl Default for Tracing {
    fn default() -> Self {
        Self { iterations: 64, hit: 0.75, least_step: 0.5 }
    }
}

/// What a ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Traced {
    /// Where it hit, world units along the ray; `None`: it did not.
    pub t: Option<f64>,
    /// Look-ups.
    pub iterations: u32,
    /// It had them all, and neither hit nor left the field or its interval.
    pub is_capped: bool,
}

/// A ray in cells of the finest level, from the first.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct LocalRay {
    /// Where it starts.
    pub origin: [f32; 3],
    /// Where its interval starts, in lengths of `direction`.
    pub t_min: f32,
    /// Of length 1.
    pub direction: [f32; 3],
    /// Where its interval ends.
    pub t_max: f32,
}

/// What a ray met, in cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LocalTraced {
    /// Where it hit.
    pub t: Option<f32>,
    /// As of [`Traced`].
    pub iterations: u32,
    /// As of [`Traced`].
    pub is_capped: bool,
}

impl DistanceField {
    /// Traces the ray from `origin`, world units, along `direction`, which has length 1, from `t_min` to `t_max`, world units. Outside of the field
    /// there is nothing.
    pub fn trace(&self, tracing: &Tracing, origin: [f64; 3], direction: [f64; 3], t_min: f64, t_max: f64) -> Traced {
        let [t_min, t_max] = [t_min, t_max].map(|t| (t / self.side()) as f32);
        let ray = LocalRay { origin: self.local(origin), t_min, direction: direction.map(|x| x as f32), t_max };
        let LocalTraced { t, iterations, is_capped } = self.trace_local(tracing, &ray);
        Traced { t: t.map(|t| f64::from(t) * self.side()), iterations, is_capped }
    }

    /// [`Self::trace`] in f32: the twin of `shaders/trace_field.wgsl`.
    pub fn trace_local(&self, tracing: &Tracing, ray: &LocalRay) -> LocalTraced {
        let size = self.cells(0) as f32;
        let (mut t, mut end) = (ray.t_min, ray.t_max);
        let mut is_in = self.has_seed();
        for k in 0..3 {
            let (origin, along) = (ray.origin[k], ray.direction[k]);
            if along == 0.0 {
                is_in &= (0.0..=size).contains(&origin);
            } else {
                let [a, b] = [-origin / along, (size - origin) / along];
                (t, end) = (t.max(a.min(b)), end.min(a.max(b)));
            }
        }
        let mut level = LEVELS - 1;
        let (mut found, mut iterations) = (None, 0);
        while is_in && iterations < tracing.iterations && t <= end {
            let distance = self.distance(level, std::array::from_fn(|k| ray.origin[k] + t * ray.direction[k]));
            iterations += 1;
            // Within two of its cells a level says little.
            let width = (1 << level) as f32;
            if level > 0 && distance < 2.0 * width {
                level -= 1;
                continue;
            }
            if distance <= tracing.hit {
                found = Some(t);
                break;
            }
            t += distance.max(tracing.least_step);
            if level + 1 < LEVELS && distance >= 4.0 * width {
                level += 1;
            }
        }
        let is_capped = is_in && found.is_none() && iterations == tracing.iterations && t <= end;
        LocalTraced { t: found, iterations, is_capped }
    }

    /// Whether anything is hit; as [`Self::trace`].
    pub fn any(&self, tracing: &Tracing, origin: [f64; 3], direction: [f64; 3], t_min: f64, t_max: f64) -> bool {
        self.trace(tracing, origin, direction, t_min, t_max).t.is_some()
    }
}
