//! Maps that are drawn by the cosine to a normal: twins of `shaders/roma/roma_cosine.wgsl` and
//! `shaders/roma/roma_draw.wgsl`.
//!
//! *Theory.* A ray around a normal, drawn by the cosine, takes the map of the stratum that it lies in (Zeng et al.,
//! §4), whose direction is drawn evenly from the stratum. Of 4 x 4 strata each is some 40 degrees wide, and within it
//! the cosine is lost: surfaces have light from where they hardly look.
//!
//! *What we changed.* Any map is tried, all as likely as each other, and taken with the probability of the cosine of
//! its own direction (rejection: von Neumann 1951), another one where it is not. As directions are spread evenly over
//! the sphere, one in each stratum, those that are travelled are drawn by the cosine. Two tries are made on the
//! average, however many maps there are; of some 200 rays one is refused by all, and takes the nearest map.

use super::twin::{GOLDEN, Maps, RUN, Taken, length_of, normal_of};
use crate::kernels::bound::{Bound, Tally};
use crate::kernels::layout::{COUNTER_RAYS_ANSWERED, COUNTER_RAYS_CAPPED, PARAM_ANY_HIT, Params, Ray, RomaMap};
use crate::kernels::rays::RaySet;
use crate::kernels::shade::shade::Pixels;
use crate::kernels::vector::{Vec3, dot, each, most};
use crate::math::sampling::{pcg, random4};
use crate::schedule::ExecutorError;
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

const TRIES: usize = 8;

/// The word by which a ray first tries a map: the directions of a pixel, those of all samples, go on by the golden
/// section, so that any that follow each other are spread evenly; where they begin is the pixel's own.
pub(crate) fn drawn_word(p: &Params, index: u32) -> u32 {
    let first = random4(index, !p.stream.wrapping_sub(p.sample), p.seed)[1];
    first.wrapping_add(p.direction.wrapping_mul(GOLDEN))
}

fn product(d: Vec3, v: Vec3) -> f32 {
    d[0] * v[0] + d[1] * v[1] + d[2] * v[2]
}

/// The direction of a map in the sense that leads above the surface.
pub(crate) fn upward(map: &RomaMap, normal: Vec3) -> Vec3 {
    let d = [map.direction[0], map.direction[1], map.direction[2]];
    if product(d, normal) >= 0.0 { d } else { d.map(|x| -x) }
}

/// The map among `maps` that a ray draws in proportion to cosines, from the word it first tries one by; `None` where
/// all are refused. `normals`: the one that light is weighed by, and the surface's own, of unit length: what is below
/// that is no direction of a ray, and what is below the other brings no light.
pub(crate) fn drawn_map(maps: &[RomaMap], first: u32, [shading, normal]: [Vec3; 2]) -> Option<usize> {
    let tried = |word: u32| {
        let at = (word >> 8) as f32 / 16_777_216.0 * maps.len() as f32;
        let map = (at as usize).min(maps.len() - 1);
        (at - (map as f32) < product(upward(&maps[map], normal), shading)).then_some(map)
    };
    std::iter::successors(Some(first), |&word| Some(pcg(word))).take(TRIES).find_map(tried)
}

impl Maps<'_> {
    /// The map that is drawn by the cosine to normals, as of [`drawn_map`]; the nearest where all are refused.
    fn drawn(&self, index: u32, ray: &Ray, normals: [Vec3; 2]) -> Taken {
        let maps = &self.maps[..(self.own.k * self.own.k) as usize];
        let Some(map) = drawn_map(maps, drawn_word(self.params, index), normals) else {
            return self.nearest(ray, normals[1]);
        };
        let (length, direction) = (length_of(ray.direction), upward(&maps[map], normals[1]));
        Taken { map: map as u32, direction: each(|k| length * direction[k]), steps: 0 }
    }
}

/// Answers the pass's rays, which are snapped, by maps that are drawn. Where the closest is asked for they go on in the
/// direction they were answered in.
pub fn roma_draw(
    bound: &Bound,
    buffers: &mut [Vec<u32>],
    own: &mut RaySet,
    seen: &RaySet,
    (pixels, shaded): (&mut Pixels, usize),
) -> Result<(), ExecutorError> {
    let p = bound.params;
    let of = Maps::of(bound, buffers)?;
    // Where nothing is asked of what is met, nothing is of where it is.
    let is_turned = !bound.has(PARAM_ANY_HIT);
    let Pixels { gbuffers, throughput, .. } = pixels;
    let gbuffer = &gbuffers[shaded];
    let RaySet { rays, hits, surfaces, .. } = own;
    let all = hits.par_chunks_mut(RUN).zip(surfaces.par_chunks_mut(RUN)).zip(rays.par_chunks_mut(RUN));
    all.enumerate().for_each(|(run, ((hits, surfaces), rays))| {
        let mut tally = Tally::default();
        for (i, ray) in rays.iter_mut().enumerate().filter(|(_, ray)| ray.t_min <= ray.t_max) {
            let index = run * RUN + i;
            tally.add(COUNTER_RAYS_ANSWERED, 1);
            if of.levels.is_empty() {
                continue;
            }
            let normal = normal_of(seen, index);
            let taken = of.drawn(index as u32, ray, [gbuffer[index].normal, normal]);
            let found = of.answer(index as u32, ray, &taken, normal, ray.t_min, false);
            tally.add(COUNTER_RAYS_CAPPED, u32::from(found.is_capped));
            if is_turned {
                ray.direction = found.direction;
            }
            found.write(&mut hits[i], is_turned.then_some(&mut surfaces[i]));
        }
        bound.counters.add(&tally);
    });
    if is_turned {
        for ((carried, ray), g) in throughput.iter_mut().zip(rays).zip(gbuffer) {
            carried[3] = p.diffuse_count * most(dot(g.normal, ray.direction), 0.0) * FRAC_1_PI;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::secondary::roma::directions::draw;

    fn maps(k: u32, sample: u32) -> Vec<RomaMap> {
        let of = |[x, y, z]: Vec3| RomaMap { direction: [x, y, z, 0.0], ..RomaMap::default() };
        draw(k, sample, 5).iter().map(|drawn| of(drawn.direction)).collect()
    }

    fn unit(v: Vec3) -> Vec3 {
        v.map(|x| x / length_of(v))
    }

    const NORMALS: [Vec3; 6] =
        [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [1.0, -2.0, 0.5], [-0.3, 0.2, -0.9]];

    #[test]
    fn maps_are_drawn_in_proportion_to_cosines() {
        for (k, normal) in [4, 8].into_iter().flat_map(|k| NORMALS.map(|normal| (k, unit(normal)))) {
            let maps = maps(k, 3);
            let n = 1u32 << 20;
            let mut counts = vec![0u32; maps.len()];
            let mut refused = 0;
            for i in 0..n {
                match drawn_map(&maps, i << 12, [normal; 2]) {
                    Some(map) => counts[map] += 1,
                    None => refused += 1,
                }
            }
            let cosines: Vec<f64> =
                maps.iter().map(|m| (0..3).map(|i| f64::from(m.direction[i] * normal[i])).sum::<f64>().abs()).collect();
            let total: f64 = cosines.iter().sum();
            let drawn = f64::from(n - refused);
            // In standard deviations of counts.
            let off = |even: bool| {
                let expected = |cosine: f64| if even { 1.0 / maps.len() as f64 } else { cosine / total };
                let deviation = |(&c, &cosine): (&u32, &f64)| {
                    let expected = drawn * expected(cosine);
                    (f64::from(c) - expected).abs() / (1.0 + expected).sqrt()
                };
                counts.iter().zip(&cosines).map(deviation).fold(0.0, f64::max)
            };
            assert!(off(false) < 5.0, "{k} {normal:?}: {}", off(false));
            assert!(off(true) > 50.0, "control");
            let expected = (1.0 - total / maps.len() as f64).powi(TRIES as i32);
            let share = f64::from(refused) / f64::from(n);
            assert!((share - expected).abs() < 0.1 * expected + 1e-4 && share < 0.01, "{k}: {share} {expected}");
        }
    }

    #[test]
    fn directions_are_drawn_by_the_cosine_over_samples() {
        // Below elevation a lies a share of sin² a of the cosine, of what is drawn evenly sin a.
        for (k, normal) in [4, 8].into_iter().flat_map(|k| NORMALS.map(|normal| (k, unit(normal)))) {
            for elevation in [10f64, 25.0, 45.0, 70.0] {
                let sine = elevation.to_radians().sin();
                let (mut below, mut drawn) = (0u32, 0u32);
                for sample in 0..4000 {
                    let maps = maps(k, sample);
                    let words = (0..16).map(|i: u32| pcg(sample).wrapping_add(i.wrapping_mul(GOLDEN)));
                    for map in words.filter_map(|word| drawn_map(&maps, word, [normal; 2])) {
                        below += u32::from(f64::from(product(upward(&maps[map], normal), normal)) < sine);
                        drawn += 1;
                    }
                }
                let (share, expected) = (f64::from(below) / f64::from(drawn), sine * sine);
                assert!((share - expected).abs() < 0.008, "{k} {normal:?} {elevation}: {share} {expected}");
                assert!((share - sine).abs() > 0.03, "control");
            }
        }
    }

    #[test]
    fn any_word_and_normal_draw_a_map_above_the_surface_or_none() {
        for (k, sample) in [(4, 0), (4, 1), (8, 2), (8, 3)] {
            let maps = maps(k, sample);
            for (word, normal) in [0, 1 << 31, u32::MAX].into_iter().flat_map(|u| NORMALS.map(|n| (u, unit(n)))) {
                for other in NORMALS.map(unit) {
                    if let Some(map) = drawn_map(&maps, word, [other, normal]) {
                        let d = upward(&maps[map], normal);
                        assert!(product(d, normal) >= 0.0 && product(d, other) > 0.0);
                    }
                }
                // All below the surface, no normal, none that is a number.
                assert_eq!(drawn_map(&maps, word, [normal.map(|x| -x), normal]), None);
                assert_eq!(drawn_map(&maps, word, [[0.0; 3], normal]), None);
                assert_eq!(drawn_map(&maps, word, [[f32::NAN; 3], normal]), None);
            }
        }
    }

    #[test]
    fn words_of_directions_that_follow_each_other_are_spread_evenly() {
        let params =
            |direction, sample| Params { direction, sample, stream: sample + (4 << 24), seed: 9, ..Params::default() };
        for (pixel, count) in [0, 7, 1000].into_iter().flat_map(|pixel| [1, 4, 5, 16, 64].map(|count| (pixel, count))) {
            for sample in [0, 3] {
                let number = |i: u32| drawn_word(&params(sample * count + i, sample), pixel) as f32 / 4_294_967_296.0;
                let mut all: Vec<f32> = (0..count).map(number).collect();
                all.sort_by(f32::total_cmp);
                assert!(all.iter().all(|u| (0.0..=1.0).contains(u)));
                let round = [all[0] + 1.0];
                let gaps = all.windows(2).map(|w| w[1] - w[0]).chain([round[0] - all[all.len() - 1]]);
                let greatest = gaps.fold(0.0, f32::max) * count as f32;
                // Of at most three lengths (Sós 1958).
                assert!(greatest <= 1.9 + 1e-3, "{count}: {greatest}");
            }
        }
        let first = |pixel| drawn_word(&params(0, 0), pixel) >> 29;
        assert!((0..100).any(|pixel| first(pixel) == 0) && (0..100).any(|pixel| first(pixel) == 7), "pixels differ");
    }
}
