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

impl DistanceField {
    /// Traces the ray from `origin`, world units, along `direction`, which has length 1, from `t_min` to `t_max`, world units. Outside of the field
    /// there is nothing.
    pub fn trace(&self, tracing: &Tracing, origin: [f64; 3], direction: [f64; 3], t_min: f64, t_max: f64) -> Traced {
        let missed = |iterations| Traced { t: None, iterations, is_capped: false };
        let start = self.local(origin);
        let along = direction.map(|x| x as f32);
        let per_cell = self.side();
        let (mut t, mut end) = ((t_min / per_cell) as f32, (t_max / per_cell) as f32);
        let size = self.cells(0) as f32;
        for k in 0..3 {
            let [a, b] = [0.0, size].map(|face| (face - start[k]) / along[k]);
            if along[k] == 0.0 {
                if !(0.0..=size).contains(&start[k]) {
                    return missed(0);
                }
            } else {
                (t, end) = (t.max(a.min(b)), end.min(a.max(b)));
            }
        }
        if !self.has_seed() {
            return missed(0);
        }
        let mut level = LEVELS - 1;
        for iteration in 0..tracing.iterations {
            let is_within = t <= end;
            if !is_within {
                return missed(iteration);
            }
            let distance = self.distance(level, std::array::from_fn(|k| start[k] + t * along[k]));
            // Within two of its cells a level says little.
            let width = (1 << level) as f32;
            if level > 0 && distance < 2.0 * width {
                level -= 1;
                continue;
            }
            if distance <= tracing.hit {
                return Traced { t: Some(f64::from(t) * per_cell), iterations: iteration + 1, is_capped: false };
            }
            t += distance.max(tracing.least_step);
            if level + 1 < LEVELS && distance >= 4.0 * width {
                level += 1;
            }
        }
        Traced { t: None, iterations: tracing.iterations, is_capped: t <= end }
    }

    /// Whether anything is hit; as [`Self::trace`].
    pub fn any(&self, tracing: &Tracing, origin: [f64; 3], direction: [f64; 3], t_min: f64, t_max: f64) -> bool {
        self.trace(tracing, origin, direction, t_min, t_max).t.is_some()
    }
}
