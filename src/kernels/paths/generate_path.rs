//! One ray from every hit, by which paths go on: twin of `shaders/paths/generate_path.wgsl`.

use crate::kernels::bound::Bound;
use crate::kernels::layout::{NONE, Origin, PARAM_PATH, Ray, Surface, T_INFINITE, UNSHARED};
use crate::kernels::rays::{RaySet, start_hit};
use crate::kernels::shade::cones::{self, widen};
use crate::kernels::shade::generate::none;
use crate::kernels::shade::gloss::{Gloss, left_within};
use crate::kernels::shade::lamps::unit;
use crate::kernels::shade::more::Shown;
use crate::kernels::shade::shade::Pixels;
use crate::kernels::vector::{Vec3, dot, each, least, most3, xyz};
use crate::math::sampling::{pcg, points4};
use bricks::Material;
use rayon::prelude::*;
use std::f32::consts::PI;

/// The first ray of a path that may end by chance: that of the third hit.
const FIRST_CHANCE: u32 = 3;
/// No path goes on for certain from there, so that all end.
const MOST_LIKELY: f32 = 0.95;

/// How a path goes on from a hit.
struct Step {
    ray: Ray,
    carried: Vec3,
    density: f32,
    alpha: f32,
    curvature: f32,
}

/// One ray from every hit of the shaded set, which a path goes on by; see the kernel.
pub fn generate_path(bound: &Bound, own: &mut RaySet, seen: &RaySet, pixels: &Pixels, materials: &[Material]) {
    let Pixels { gbuffers: [_, gbuffer], mores: [_, mores], throughput, origins, .. } = pixels;
    let p = bound.params;
    let step = |index: usize| -> Step {
        let (surface, before) = (&seen.surfaces[index], xyz(throughput[index]));
        let ended = Step { ray: none(surface.point), carried: [0.0; 3], density: 0.0, alpha: 0.0, curvature: 0.0 };
        if surface.leaf == NONE || most3(before) <= 0.0 {
            return ended;
        }
        let g = Shown::of(gbuffer, mores, index);
        let s = Gloss::of(g, &materials[g.material as usize], seen.rays[index].direction.map(|x| -x));
        let of_path = pcg(origins[index].direction.wrapping_add(1));
        let words = points4(bound.pixel_of(index, origins) ^ of_path, p.stream, p.seed);
        let drawn = s.path_direction(g.normal, words);
        let direction = drawn.direction;
        let density = if drawn.is_through { UNSHARED } else { s.path_density(g.normal, direction) };
        let mut step = Step { ray: Ray { direction, ..ended.ray }, density, ..ended };
        let goes_on = drawn.is_through || bound.has(PARAM_PATH);
        if goes_on && density > 0.0 && (dot(surface.normal, direction) > 0.0) != drawn.is_through {
            let (mut weight, mut scale);
            if drawn.is_through {
                weight = s.passed(direction).map(|c| c / s.path_choice());
                scale = s.eta * s.eta;
            } else {
                let (reflected, share) = (s.reflected(direction), dot(g.normal, direction) / (PI * density));
                weight = each(|k| (s.diffuse[k] + reflected[k]) * share);
                scale = 1.0;
            }
            let left = left_within(bound, &g, &materials[g.material as usize], seen.way(index));
            weight = each(|k| weight[k] * left[k]);
            let chance = if p.direction >= FIRST_CHANCE { least(most3(weight), MOST_LIKELY) } else { 1.0 };
            if unit(pcg(words[3])) < chance {
                scale /= chance;
                (step.ray.t_min, step.ray.t_max) = (0.0, T_INFINITE);
                step.alpha = if s.is_glossy() { s.greatest_alpha() } else { 1.0 };
                step.curvature = if drawn.is_through { 0.0 } else { g.curvature };
                step.carried = each(|k| before[k] * (weight[k] * scale));
            }
        }
        step
    };
    let RaySet { rays, hits, surfaces, .. } = own;
    let all = rays.par_iter_mut().zip(hits).zip(surfaces).enumerate().with_min_len(256);
    all.for_each(|(index, ((own, hit), surface))| {
        let Step { ray, carried, density, alpha, curvature } = step(index);
        *own = ray;
        (*hit, *surface) = start_hit(ray.t_max, seen.hits[index].id);
        let Origin { pixel, direction } = origins[index];
        *surface = Surface { point: carried, area: density, emitter: pixel, triangle: direction, ..*surface };
        surface.normal[0] = curvature;
        if ray.t_min <= ray.t_max {
            widen(bound, surface, ray.origin, cones::reflected(density, alpha), curvature);
        }
    });
}
