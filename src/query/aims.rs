//! Rays on their way, side by side, set up together: each step is one of vectors. What is computed of a ray is the same
//! whoever is beside it.

use super::given::Columns;
use super::top::Top;
use crate::kernels::layout::T_INFINITE;
use crate::kernels::simd::wide::three;
use crate::kernels::trace::node::UNIT;
use crate::math::crossing::Lines;
use crate::math::exact::GREATEST_INVERSE;
use crate::output::npy::Ray;
use crate::session::trace::{Scaled, Surroundings};
use glam::DVec3;

/// Of numbers of f32: more than a conversion rounds by.
pub(super) const ROUNDED: f64 = 1.0 / (1u64 << 22) as f64;
/// Of a step of the lattice: by how much rays may be off.
pub(super) const LEAST_STEP: f64 = 1.0 / (1u64 << 20) as f64;
/// Of coordinates: more than moving a ray in f64 rounds by.
pub(super) const MOVED: f64 = 1.0 / (1u64 << 51) as f64;

/// Units of distances by which boxes are grown.
pub(super) const GROWN: f32 = 72.0 * UNIT;

/// Rays on their way. Distances along them are counted from `near`, in lengths of their scaled directions.
pub(super) struct Aims<const N: usize> {
    /// The given rays.
    pub(super) lines: Lines<N>,
    /// Where they come near the scene, by axes.
    pub(super) near: [[f64; N]; 3],
    /// Greatest magnitudes of components of that.
    pub(super) near_reach: [f64; N],
    /// The way there, in lengths of the given directions.
    start: [f64; N],
    /// Directions scaled by powers of two, by axes, as of [`Scaled`].
    pub(super) way: [[f64; N]; 3],
    /// Two factors that make of lengths of given directions those of scaled ones.
    factors: [[f64; N]; 2],
    /// Inverses of directions' components, finite.
    pub(super) inverse: [[f32; N]; 3],
    /// Intervals, in lengths of the given directions; closed.
    pub(super) t_min: [f64; N],
    /// Their ends.
    pub(super) t_max: [f64; N],
    /// Which come near the scene, a bit each. Of others nothing else is known.
    pub(super) come: u32,
}

/// Powers of two by their biased exponents.
#[inline(always)]
fn power(biased: u64) -> f64 {
    f64::from_bits(biased << 52)
}

/// Greatest magnitudes of components, by axes.
#[inline(always)]
fn greatest<const N: usize>(of: &[[f64; N]; 3]) -> [f64; N] {
    let mut greatest = [0.0f64; N];
    for axis in of {
        for i in 0..N {
            greatest[i] = greatest[i].max(axis[i].abs());
        }
    }
    greatest
}

/// Inverses of components, finite.
#[inline(always)]
pub(super) fn inverse<const N: usize>(direction: &[[f64; N]; 3]) -> [[f32; N]; 3] {
    let mut inverse = [[0.0; N]; 3];
    for k in 0..3 {
        for i in 0..N {
            let x = direction[k][i] as f32;
            inverse[k][i] = (1.0 / x.abs().max(f32::MIN_POSITIVE)).min(GREATEST_INVERSE).copysign(x);
        }
    }
    inverse
}

impl<const N: usize> Aims<N> {
    #[inline(always)]
    pub(super) fn new(top: &Top, rays: &Columns<N>) -> Self {
        let &Columns { origin, direction, t_max, .. } = rays;
        let mut aims = Self {
            lines: Lines::new(origin, direction),
            near: origin,
            near_reach: [0.0; N],
            start: [0.0; N],
            way: [[0.0; N]; 3],
            factors: [[0.0; N]; 2],
            inverse: [[0.0; N]; 3],
            t_min: [0.0; N],
            t_max,
            come: u32::MAX >> (32 - N),
        };
        let (largest, mut down) = (greatest(&direction), [[0.0; N]; 2]);
        let mut is_tiny = false;
        for i in 0..N {
            aims.t_min[i] = rays.t_min[i].max(0.0);
            let exponent = largest[i].to_bits() >> 52;
            is_tiny |= exponent == 0;
            // 2^(1023 - exponent), and 2^(exponent - 1023).
            (down[0][i], down[1][i]) = (power((3069 - exponent) >> 1), power((3070 - exponent) >> 1));
            (aims.factors[0][i], aims.factors[1][i]) = (power((exponent + 1023) >> 1), power((exponent + 1024) >> 1));
        }
        for (way, direction) in aims.way.iter_mut().zip(&direction) {
            for i in 0..N {
                way[i] = direction[i] * down[0][i] * down[1][i];
            }
        }
        if is_tiny {
            aims.scale_tiny(&largest);
        }
        match &top.surroundings {
            Some(surroundings) => aims.bring_near(surroundings, rays),
            None => aims.come = 0,
        }
        aims.near_reach = greatest(&aims.near);
        aims.inverse = inverse(&aims.way);
        aims
    }

    /// Scales directions that are subnormal.
    #[cold]
    fn scale_tiny(&mut self, largest: &[f64; N]) {
        for i in (0..N).filter(|&i| !largest[i].is_normal()) {
            let scaled = Scaled::of(three!(k => self.lines.direction[k][i]));
            for k in 0..3 {
                self.way[k][i] = scaled.direction[k];
            }
            [self.factors[0][i], self.factors[1][i]] = scaled.factors();
        }
    }

    /// Brings rays that start far away near the scene.
    #[inline(always)]
    fn bring_near(&mut self, surroundings: &Surroundings, rays: &Columns<N>) {
        let [min, max] = surroundings.room();
        let mut is_near = [true; N];
        for k in 0..3 {
            for (is_near, near) in is_near.iter_mut().zip(&self.near[k]) {
                *is_near &= (*near >= min[k]) & (*near <= max[k]);
            }
        }
        if !is_near.iter().fold(true, |all, is_near| all & is_near) {
            self.approach(surroundings, rays, is_near);
        }
    }

    #[cold]
    fn approach(&mut self, surroundings: &Surroundings, rays: &Columns<N>, is_near: [bool; N]) {
        for i in (0..N).filter(|&i| !is_near[i]) {
            let origin = three!(k => rays.origin[k][i]);
            let direction = three!(k => rays.direction[k][i]);
            let ray = Ray { origin, direction, t_min: rays.t_min[i], t_max: rays.t_max[i] };
            match surroundings.approach(&ray) {
                Some(approach) => {
                    for k in 0..3 {
                        self.near[k][i] = approach.ray.origin[k];
                    }
                    self.start[i] = approach.start;
                }
                None => self.come &= !(1 << i),
            }
        }
    }

    /// One of them.
    #[inline(always)]
    pub(super) fn get(&self, i: usize) -> Aims<1> {
        Aims {
            lines: self.lines.get(i),
            near: three!(k => [self.near[k][i]]),
            near_reach: [self.near_reach[i]],
            start: [self.start[i]],
            way: three!(k => [self.way[k][i]]),
            factors: [[self.factors[0][i]], [self.factors[1][i]]],
            inverse: three!(k => [self.inverse[k][i]]),
            t_min: [self.t_min[i]],
            t_max: [self.t_max[i]],
            come: self.come >> i & 1,
        }
    }

    /// A distance along a ray, of one in lengths of the given direction.
    #[inline(always)]
    fn along(&self, i: usize, t: f64) -> f64 {
        (t - self.start[i]) * self.factors[0][i] * self.factors[1][i]
    }

    /// No less than the distance along a ray of what is met at `t`, in lengths of the given direction. Of a ray from
    /// far away a distance that small is rounded by much.
    #[inline(always)]
    pub(super) fn limit(&self, i: usize, t: f64) -> f64 {
        let limit = self.along(i, t + t.abs() * MOVED);
        if t == f64::NEG_INFINITY { t } else { limit }
    }

    /// No more than the distances along the rays where their intervals begin.
    #[inline(always)]
    pub(super) fn begins(&self) -> [f64; N] {
        let mut begins = [0.0; N];
        for (i, (begin, t_min)) in begins.iter_mut().zip(&self.t_min).enumerate() {
            *begin = self.along(i, t_min - t_min * MOVED);
        }
        begins
    }

    /// The rays in a frame in world directions that has its origin at `origin`, from `from` on.
    #[inline(always)]
    pub(super) fn locals(&self, frame: (DVec3, f32), per_unit: f64, from: (f64, f64)) -> Locals<N> {
        self.locals_grown(frame, per_unit, from, GROWN)
    }

    /// The same where boxes are grown by other units of distances.
    #[inline(always)]
    pub(super) fn locals_grown(
        &self,
        (origin, extent): (DVec3, f32),
        per_unit: f64,
        (from, step): (f64, f64),
        grown: f32,
    ) -> Locals<N> {
        let mut at = [[0.0; N]; 3];
        for k in 0..3 {
            for (at, (near, way)) in at[k].iter_mut().zip(self.near[k].iter().zip(&self.way[k])) {
                *at = ((near - origin[k]) + way * from) * per_unit;
            }
        }
        let told = Told { factor: per_unit, from, slack: LEAST_STEP * step * per_unit };
        Locals::new((&at, extent, grown), &self.inverse, told, &self.begins())
    }
}

/// How distances along rays are told in a frame.
#[derive(Clone, Copy)]
pub(super) struct Told {
    /// The frame's lengths of a length of the ray.
    pub(super) factor: f64,
    /// How far along the ray the frame's begins.
    pub(super) from: f64,
    /// What distances in the frame may be off by.
    pub(super) slack: f64,
}

impl Told {
    /// No less than a distance along the ray; -1 for one before everything.
    #[inline(always)]
    pub(super) fn above(&self, distance: f64) -> f32 {
        let t = (distance - self.from) * self.factor;
        let above = t + t.abs() * ROUNDED + self.slack;
        let above = if above >= f64::from(T_INFINITE) { T_INFINITE } else { above as f32 };
        if t == f64::NEG_INFINITY { -1.0 } else { above }
    }
}

/// Rays in a frame.
pub(super) struct Locals<const N: usize> {
    /// Their origins by axes, moved by as much as boxes are grown: on, for their bounds that are near.
    pub(super) ahead: [[f32; N]; 3],
    /// And back, for the others.
    pub(super) behind: [[f32; N]; 3],
    /// Where their intervals begin.
    pub(super) t_min: [f32; N],
    pub(super) told: Told,
}

impl<const N: usize> Locals<N> {
    /// Rays that begin `at` there, in their intervals at `begins` along them; `extent` is that of the frame's boxes,
    /// which are grown by so many units of distances.
    #[inline(always)]
    pub(super) fn new(
        (at, extent, units): (&[[f64; N]; 3], f32, f32),
        inverse: &[[f32; N]; 3],
        told: Told,
        begins: &[f64; N],
    ) -> Self {
        let (mut ahead, mut behind, mut t_min) = ([[0.0; N]; 3], [[0.0; N]; 3], [0.0; N]);
        let mut grown = [0.0f32; N];
        for axis in at {
            for i in 0..N {
                grown[i] = grown[i].max((axis[i] as f32).abs());
            }
        }
        for k in 0..3 {
            for i in 0..N {
                let (origin, on) = (at[k][i] as f32, (units * (grown[i] + extent)).copysign(inverse[k][i]));
                (ahead[k][i], behind[k][i]) = (origin + on, origin - on);
            }
        }
        for i in 0..N {
            let begin = (begins[i] - told.from) * told.factor;
            let begin = (begin - begin.abs() * ROUNDED - told.slack).max(0.0) as f32;
            t_min[i] = begin.min(T_INFINITE);
        }
        Self { ahead, behind, t_min, told }
    }
}

#[cfg(test)]
mod tests {
    use super::super::given::Rays;
    use super::super::tests::{all_spheres, convert, rays};
    use super::*;

    /// All that is known of a ray, its bits.
    fn bits(aim: &Aims<1>) -> Vec<u64> {
        let Aims { lines, near, near_reach, start, way, factors, inverse, t_min, t_max, come } = aim;
        let axes = [&lines.origin, &lines.direction, near, way].into_iter().flatten().flatten();
        let others = [near_reach, start, t_min, t_max].into_iter().flatten().chain(factors.iter().flatten());
        let inverse = inverse.iter().flatten().map(|x| u64::from(x.to_bits()));
        let numbers = axes.chain(others).copied().chain([lines.reach(0)]).map(f64::to_bits);
        numbers.chain(inverse).chain([u64::from(*come)]).collect()
    }

    #[test]
    fn who_is_beside_a_ray_does_not_matter() {
        let (_folder, file) = convert(all_spheres(), 128);
        let top = Top::new(file.resident());
        let mut rays = rays(400);
        for (i, ray) in rays.iter_mut().enumerate() {
            // From afar, towards the scene and away from it; directions of all lengths that f64 has.
            let way = [0.0, -1e9, 1e9, 0.0, -1e300][i % 5];
            let length = [1.0, 1e-310, 1e300, 5e-324, 1e-20, 1e-290][i % 6];
            ray.origin = three!(k => ray.origin[k] + way * ray.direction[k]);
            ray.direction = ray.direction.map(|x| x * length);
        }
        rays.retain(|ray| ray.direction != [0.0; 3] && ray.origin.iter().all(|x| x.is_finite()));
        let (mut come, mut differ) = (0, 0);
        let mut last = Vec::new();
        for first in (0..rays.len()).step_by(8) {
            let aims = Aims::<8>::new(&top, &Rays::from(&rays).columns(first));
            for i in 0..8 {
                let ray = &rays[(first + i).min(rays.len() - 1)];
                let (own, alone) = (aims.get(i), Aims::new(&top, &Columns::of(ray)));
                assert_eq!(own.come, alone.come, "{ray:?}");
                if own.come == 0 {
                    continue;
                }
                assert_eq!(bits(&own), bits(&alone), "{ray:?}");
                let scaled = Scaled::of(ray.direction);
                assert_eq!(three!(k => own.way[k][0]), scaled.direction.to_array());
                for t in [0.0, 0.75, 3.0] {
                    let approach = top.surroundings.as_ref().and_then(|room| room.approach(ray));
                    let start = approach.map(|approach| approach.start).unwrap_or_default();
                    assert_eq!(own.along(0, t), scaled.scaled(t - start), "{ray:?}");
                }
                come += 1;
                differ += usize::from(bits(&own) != last);
                last = bits(&own);
            }
        }
        // The control: the comparison tells rays apart.
        assert!(come > 150 && come < rays.len() && differ > come / 2, "{come} of {}, {differ}", rays.len());
    }
}
