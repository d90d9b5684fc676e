//! How paths go on from a surface: twin of `shaders/shade/paths.wgsl` and `generate_path.wgsl`.

use super::cones::{self, widen};
use super::generate::{for_each_leaving, none};
use super::gloss::{Drawn, Gloss, left_within};
use super::lamps::unit;
use super::more::Shown;
use super::random::tangent;
use super::shade::Pixels;
use crate::kernels::bound::Bound;
use crate::kernels::layout::{PARAM_PATH, Ray, T_INFINITE, UNSHARED};
use crate::kernels::rays::RaySet;
use crate::kernels::vector::{Vec3, cross, dot, each, least, most, most3, normalize};
use crate::math::sampling::{pcg, points4};
use bricks::Material;
use rayon::prelude::*;
use std::f32::consts::{PI, TAU};

/// The first ray of a path that may end by chance: that of the third hit.
const FIRST_CHANCE: u32 = 3;
/// No path goes on for certain from there, so that all end.
const MOST_LIKELY: f32 = 0.95;

impl Gloss {
    /// Probability that a path goes on by the gloss: its share of what the surface reflects and lets through of light
    /// from everywhere.
    fn path_choice(&self) -> f32 {
        if !self.is_glossy() {
            return 0.0;
        }
        let of_gloss = most3(self.around()) + most3(self.through);
        let of_diffuse = most3(self.diffuse);
        of_gloss / most(of_gloss + of_diffuse, 1.0e-20)
    }

    /// A direction from a surface with this normal.
    fn path_direction(&self, normal: Vec3, words: [u32; 4]) -> Drawn {
        if unit(words[3]) < self.path_choice() {
            return self.direction(words);
        }
        let around = TAU * unit(words[0]);
        let squared = unit(words[1]);
        let level = squared.sqrt();
        let (x, up) = (tangent(normal), (1.0 - squared).sqrt());
        let y = cross(normal, x);
        let direction = normalize(each(|k| level * around.cos() * x[k] + level * around.sin() * y[k] + up * normal[k]));
        Drawn { direction, is_through: false }
    }

    /// By which a path draws its direction d, a unit vector.
    pub fn path_density(&self, normal: Vec3, d: Vec3) -> f32 {
        let choice = self.path_choice();
        (1.0 - choice) * most(dot(normal, d), 0.0) / PI + choice * self.density(d)
    }
}

/// How a path goes on from a hit.
struct Step {
    ray: Ray,
    weight: Vec3,
    density: f32,
    alpha: f32,
}

/// One ray from every hit of the shaded set, which a path goes on by; see the kernel.
pub fn generate_path(bound: &Bound, own: &mut RaySet, seen: &RaySet, pixels: &mut Pixels, materials: &[Material]) {
    let Pixels { gbuffers: [_, gbuffer], mores: [_, mores], throughput, densities, .. } = pixels;
    let p = bound.params;
    let step = |index: usize, before: &[f32; 4]| -> Option<Step> {
        let surface = &seen.surfaces[index];
        if most(before[0], most(before[1], before[2])) <= 0.0 {
            return None;
        }
        let g = Shown::of(gbuffer, mores, index);
        let s = Gloss::of(g, &materials[g.material as usize], seen.rays[index].direction.map(|x| -x));
        let words = points4(bound.pixel_of(index) ^ pcg((before[3] as u32).wrapping_add(1)), p.stream, p.seed);
        let drawn = s.path_direction(g.normal, words);
        let direction = drawn.direction;
        let density = if drawn.is_through { UNSHARED } else { s.path_density(g.normal, direction) };
        let ended = Ray { direction, ..none(surface.point) };
        let mut step = Step { ray: ended, weight: [0.0; 3], density, alpha: 0.0 };
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
                step.ray = Ray { t_min: 0.0, t_max: T_INFINITE, ..ended };
                step.alpha = if s.is_glossy() { s.greatest_alpha() } else { 1.0 };
                step.weight = weight.map(|c| c * scale);
            }
        }
        Some(step)
    };
    {
        let throughput = &throughput[..];
        for_each_leaving(own, seen, |index, surface| {
            step(index, &throughput[index]).map_or_else(|| none(surface.point), |step| step.ray)
        });
    }
    let carried = throughput.par_iter_mut().zip(densities.par_iter_mut()).zip(own.surfaces.par_iter_mut());
    carried.enumerate().with_min_len(1024).for_each(|(index, ((carried, density), surface))| {
        let is_hit = seen.surfaces[index].leaf != crate::kernels::layout::NONE;
        let found = if is_hit { step(index, carried) } else { None };
        let Some(Step { ray, weight, density: own, alpha }) = found else {
            (*carried, *density) = ([0.0, 0.0, 0.0, carried[3]], 0.0);
            return;
        };
        *density = own;
        (0..3).for_each(|k| carried[k] *= weight[k]);
        if ray.t_min <= ray.t_max {
            widen(bound, surface, cones::reflected(own, alpha));
        }
    });
}
