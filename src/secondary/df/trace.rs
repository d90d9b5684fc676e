//! Sphere tracing.

use super::field::{DistanceField, FieldView, LEVELS};
use crate::math::exact::{divide, most, square_root};

/// Least way between two look-ups, cells.
pub const LEAST_STEP: f32 = 0.5;

/// How rays go through a field. Lengths are in cells of the finest level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracing {
    /// Most look-ups of a ray: 64, of soft shadows 16 (spec §2).
    pub iterations: u32,
    /// A ray hits where the nearest middle of an occupied cell is no farther. A plane in the middle of its cells is at
    /// most 0 away; in a corner 3^0.5 / 2.
    pub hit: f32,
    /// Least way between two look-ups.
    pub least_step: f32,
}

impl Default for Tracing {
    fn default() -> Self {
        Self { iterations: 64, hit: 0.75, least_step: LEAST_STEP }
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

/// How a ray goes on from one look-up to the next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Way {
    /// The level that it reads.
    pub level: usize,
    /// Look-ups that it made.
    pub look_ups: u32,
}

impl FieldView<'_> {
    /// Where a ray meets something, and whether it made as many look-ups as it may and was not at its end: `at` and
    /// `speed` in cells of the finest level, `range` of t within the field. Twin of `through` in
    /// `shaders/df/df_trace.wgsl`.
    pub fn through(
        &self,
        tracing: &Tracing,
        at: [f32; 3],
        speed: [f32; 3],
        range: [f32; 2],
        way: &mut Way,
    ) -> (Option<f32>, bool) {
        if !self.has_seed() {
            return (None, false);
        }
        let squares = speed[0] * speed[0] + speed[1] * speed[1] + speed[2] * speed[2];
        let per_cell = divide(1.0, square_root(squares));
        let mut t = range[0];
        while way.look_ups < tracing.iterations && t <= range[1] {
            let distance = self.distance(way.level, std::array::from_fn(|k| at[k] + t * speed[k]));
            way.look_ups += 1;
            // Within two of its cells a level says little.
            let width = (1 << way.level) as f32;
            if way.level > 0 && distance < 2.0 * width {
                way.level -= 1;
                continue;
            }
            if distance <= tracing.hit {
                return (Some(t), false);
            }
            t += most(distance, tracing.least_step) * per_cell;
            if way.level + 1 < LEVELS && distance >= 4.0 * width {
                way.level += 1;
            }
        }
        (None, t <= range[1])
    }
}

impl DistanceField {
    /// Traces the ray from `origin`, world units, along `direction`, which has length 1, from `t_min` to `t_max`, world
    /// units. Outside of the field there is nothing.
    pub fn trace(&self, tracing: &Tracing, origin: [f64; 3], direction: [f64; 3], t_min: f64, t_max: f64) -> Traced {
        let (origin, direction) = (self.local(origin), direction.map(|x| x as f32));
        let [mut t, mut end] = [t_min, t_max].map(|t| (t / self.side) as f32);
        let size = self.view().cells as f32;
        let mut is_in = true;
        for (&origin, &along) in origin.iter().zip(&direction) {
            if along == 0.0 {
                is_in &= (0.0..=size).contains(&origin);
            } else {
                let [a, b] = [-origin / along, (size - origin) / along];
                (t, end) = (t.max(a.min(b)), end.min(a.max(b)));
            }
        }
        let mut way = Way { level: LEVELS - 1, look_ups: 0 };
        let found = is_in.then(|| self.view().through(tracing, origin, direction, [t, end], &mut way));
        let (t, is_capped) = found.unwrap_or_default();
        Traced { t: t.map(|t| f64::from(t) * self.side), iterations: way.look_ups, is_capped }
    }
}
