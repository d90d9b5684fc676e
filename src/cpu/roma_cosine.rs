//! Maps that are drawn by the cosine to a normal: twin of `shaders/shared/roma_cosine.wgsl`.
//!
//! *Theory.* A ray around a normal, drawn by the cosine, takes the map of the stratum that it lies in (Zeng et al., §4), whose direction is drawn evenly
//! from the stratum. Of 4 x 4 strata each is some 40 degrees wide, and within it the cosine is lost: surfaces have light from where they hardly look.
//!
//! *What we changed.* Which map a ray takes is drawn among all of them in proportion to the cosines of their own directions. As these are spread evenly
//! over the sphere, one in each stratum, the directions that are travelled are drawn by the cosine, but for what the sum of cosines differs by from
//! sample to sample.

use super::vector::Vec3;
use crate::kernel::layout::{Params, RomaMap};
use crate::math::exact::square_root;
use crate::math::sampling::random4;

/// The golden section of 2³².
const GOLDEN: u32 = 0x9e37_79b9;

/// What is less than this, 2⁻³⁰, is rounding.
const LEAST_COSINE: f32 = f32::from_bits((127 - 30) << 23);

/// The number, from 0 to below 1, by which a ray draws its map: the directions of a pixel, those of all samples, go on by the golden section, so that any
/// that follow each other are spread evenly; where they begin is the pixel's own.
pub(super) fn drawn_number(p: &Params, index: u32) -> f32 {
    let first = random4(index, !p.stream.wrapping_sub(p.sample), p.seed)[1];
    (first.wrapping_add(p.direction.wrapping_mul(GOLDEN)) >> 8) as f32 / 16_777_216.0
}

pub(super) fn length_of(d: Vec3) -> f32 {
    square_root(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
}

fn product(d: Vec3, v: Vec3) -> f32 {
    d[0] * v[0] + d[1] * v[1] + d[2] * v[2]
}

/// The direction of a map in the sense that leads above the surface.
pub(super) fn upward(map: &RomaMap, normal: Vec3) -> Vec3 {
    let d = [map.direction[0], map.direction[1], map.direction[2]];
    if product(d, normal) >= 0.0 { d } else { d.map(|x| -x) }
}

/// The map that `number`, from 0 to below 1, draws among `maps` in proportion to cosines; `None` where all are 0. `normals`: the one that light is weighed
/// by, and the surface's own: what is below that is no direction of a ray, and what is below the other brings no light.
pub(super) fn drawn_map(maps: &[RomaMap], number: f32, [shading, normal]: [Vec3; 2]) -> Option<usize> {
    let cosine_of = |map: &RomaMap| {
        let cosine = product(upward(map, normal), shading);
        if cosine >= LEAST_COSINE { cosine } else { 0.0 }
    };
    let wanted = number * maps.iter().fold(0.0, |sum, map| sum + cosine_of(map));
    let mut sum = 0.0;
    // The last sum is the total, and any number's share of it is less.
    maps.iter().position(|map| {
        sum += cosine_of(map);
        sum > wanted
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampling::hammersley;
    use crate::visibility::roma::directions::draw;

    /// The greatest number below 1 that [`drawn_number`] gives.
    const GREATEST: f32 = 1.0 - 1.0 / 16_777_216.0;

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
            let n = 1 << 16;
            let mut counts = vec![0u32; maps.len()];
            for i in 0..n {
                counts[drawn_map(&maps, i as f32 / n as f32, [normal; 2]).expect("a map")] += 1;
            }
            let cosines: Vec<f64> =
                maps.iter().map(|m| (0..3).map(|i| f64::from(m.direction[i] * normal[i])).sum::<f64>().abs()).collect();
            let total: f64 = cosines.iter().sum();
            let off = |even: bool| {
                let expected = |cosine: f64| if even { 1.0 / maps.len() as f64 } else { cosine / total };
                let all = counts.iter().zip(&cosines);
                all.map(|(&c, &cosine)| (f64::from(c) / f64::from(n) - expected(cosine)).abs()).fold(0.0, f64::max)
            };
            // Numbers are evenly spaced: no count is off by more than those at its two ends.
            assert!(off(false) <= 2.5 / f64::from(n), "{k} {normal:?}: {}", off(false));
            assert!(off(true) > 0.005, "control");
        }
    }

    #[test]
    fn directions_are_drawn_by_the_cosine_over_samples() {
        // Below elevation a lies a share of sin² a of the cosine, of what is drawn evenly sin a.
        for (k, bound) in [(4, 0.004), (8, 0.002)] {
            for normal in NORMALS.map(unit) {
                let (samples, numbers) = (4000, 16);
                for elevation in [10f64, 25.0, 45.0, 70.0] {
                    let sine = elevation.to_radians().sin();
                    let mut below = 0u32;
                    for sample in 0..samples {
                        let maps = maps(k, sample);
                        let first = hammersley(sample, samples)[1] / numbers as f32;
                        for i in 0..numbers {
                            let number = (first + i as f32 / numbers as f32).min(GREATEST);
                            let map = drawn_map(&maps, number, [normal; 2]).expect("a map");
                            below += u32::from(f64::from(product(upward(&maps[map], normal), normal)) < sine);
                        }
                    }
                    let share = f64::from(below) / f64::from(samples * numbers);
                    let expected = sine * sine;
                    assert!((share - expected).abs() < bound + 0.01, "{k} {normal:?} {elevation}: {share} {expected}");
                }
            }
        }
    }

    #[test]
    fn any_number_and_normal_draw_a_map_above_the_surface_or_none() {
        for (k, sample) in [(4, 0), (4, 1), (8, 2), (8, 3)] {
            let maps = maps(k, sample);
            for (number, normal) in [0.0, 0.5, GREATEST].into_iter().flat_map(|u| NORMALS.map(|n| (u, unit(n)))) {
                for other in NORMALS.map(unit) {
                    if let Some(map) = drawn_map(&maps, number, [other, normal]) {
                        let d = upward(&maps[map], normal);
                        assert!(product(d, normal) >= 0.0 && product(d, other) > 0.0);
                    }
                }
                assert!(drawn_map(&maps, number, [normal; 2]).is_some());
                // All below the surface, no normal, none that is a number.
                assert_eq!(drawn_map(&maps, number, [normal.map(|x| -x), normal]), None);
                assert_eq!(drawn_map(&maps, number, [[0.0; 3], normal]), None);
                assert_eq!(drawn_map(&maps, number, [[f32::NAN; 3], normal]), None);
            }
        }
        // All lines but along the surface: rounding decides nothing.
        let flat = |z: f32| -> Vec<RomaMap> {
            let of = |i: i32| {
                let angle = 0.4 * i as f32;
                RomaMap {
                    direction: [angle.cos(), angle.sin(), if i == 3 { z } else { 0.0 }, 0.0],
                    ..RomaMap::default()
                }
            };
            (0..16).map(of).collect()
        };
        let up = [[0.0, 0.0, 1.0]; 2];
        for number in [0.0, 0.5, GREATEST] {
            assert_eq!(drawn_map(&flat(1e-12), number, up), None);
            assert_eq!(drawn_map(&flat(-1e-6), number, up), Some(3));
        }
        assert_eq!(drawn_map(&[], 0.5, up), None);
    }

    #[test]
    fn numbers_of_directions_that_follow_each_other_are_spread_evenly() {
        let params =
            |direction, sample| Params { direction, sample, stream: sample + (4 << 24), seed: 9, ..Params::default() };
        for (pixel, count) in [0, 7, 1000].into_iter().flat_map(|pixel| [1, 4, 5, 16, 64].map(|count| (pixel, count))) {
            for sample in [0, 3] {
                let number = |i: u32| drawn_number(&params(sample * count + i, sample), pixel);
                let mut all: Vec<f32> = (0..count).map(number).collect();
                all.sort_by(f32::total_cmp);
                assert!(all.iter().all(|u| (0.0..1.0).contains(u)));
                let round = [all[0] + 1.0];
                let gaps = all.windows(2).map(|w| w[1] - w[0]).chain([round[0] - all[all.len() - 1]]);
                let greatest = gaps.fold(0.0, f32::max) * count as f32;
                // Of at most three lengths (Sós 1958).
                assert!(greatest <= 1.9 + 1e-3, "{count}: {greatest}");
            }
        }
        let first = |pixel| drawn_number(&params(0, 0), pixel);
        assert!((0..100).any(|pixel| first(pixel) < 0.1) && (0..100).any(|pixel| first(pixel) > 0.9), "pixels differ");
    }
}
