//! What hits show and the light on them: twins of `shaders/shade/clear_gbuffer.wgsl`, `shade.wgsl`, `add_light.wgsl`,
//! `add_occlusion.wgsl` and `hit_demand.wgsl`.

use super::gloss::Gloss;
use super::lamps::{
    drawn_density, drawn_light, environment_at, environment_density, environment_sample, lamp_words, outweighs, shines,
    sun_density,
};
use super::light::{add_light as add, ambient, background, sunlight};
use super::more::Shown;
use crate::kernels::bound::{Bound, DemandTally, Tally, atomic};
use crate::kernels::layout::{
    BATCH_SAMPLES, EMITTER_KIND, EMITTER_TRIANGLE, GBUFFER_BACK, GBuffer, Hit, MATERIAL_DOUBLE_SIDED, MATERIAL_UNLIT,
    MET, More, NONE, Origin, PARAM_BOUNCE, PARAM_EMISSION, PARAM_EMITTER, PARAM_ENVIRONMENT, PARAM_GLOSSY, PARAM_MISS,
    PARAM_PATH, PARAM_SCATTER, PARAM_SKY, PARAM_SUN, Ray,
};
use crate::kernels::rays::RaySet;
use crate::kernels::vector::{Vec3, cross, dot, each, most, normalize, xyz};
use bricks::Material;
use rayon::prelude::*;
use std::f32::consts::PI;

/// Pixels that a task shades in a row.
const RUN: usize = 1024;

/// What shading keeps per pixel.
#[derive(Default)]
pub struct Pixels {
    /// Of the hits of sets 0 and 1.
    pub gbuffers: [Vec<GBuffer>; 2],
    /// What their further textures show; empty in scenes without. The kernels keep it with the G-buffer.
    pub mores: [Vec<More>; 2],
    /// Summed over the samples of a batch; w counts them.
    pub radiance: Vec<[f32; 4]>,
    /// Of the light that the rays of set 1 bring; w: by which density their directions were drawn, 0 where no lamp's
    /// rays bring the same light.
    pub throughput: Vec<[f32; 4]>,
    /// Where their paths come from.
    pub origins: Vec<Origin>,
}

impl Pixels {
    /// Of `rays` pixels; `has_more`: of a scene with further textures.
    pub fn new(rays: usize, has_more: bool) -> Self {
        let gbuffers = [vec![GBuffer::default(); rays], Vec::new()];
        let mores = [vec![More::default(); if has_more { rays } else { 0 }], Vec::new()];
        Self { gbuffers, mores, radiance: vec![[0.0; 4]; rays], throughput: Vec::new(), origins: Vec::new() }
    }

    /// For so many pixels; those beyond are forgotten.
    pub fn resize(&mut self, rays: usize) {
        resize(&mut self.gbuffers[0], rays);
        resize(&mut self.mores[0], rays);
        resize(&mut self.radiance, rays);
        self.resize_bounces(rays);
    }

    /// For so many rays of set 1, where there is room for bounces; what is known of those beyond is forgotten.
    pub fn resize_bounces(&mut self, rays: usize) {
        resize(&mut self.gbuffers[1], rays);
        resize(&mut self.mores[1], rays);
        resize(&mut self.throughput, rays);
        resize(&mut self.origins, rays);
    }

    /// What is kept of the hits of a set.
    pub fn of_set(&mut self, set: usize) -> (&mut [GBuffer], &mut [More]) {
        (&mut self.gbuffers[set], &mut self.mores[set])
    }

    /// Makes room for bounces at every pixel.
    pub fn allow_bounces(&mut self) {
        let rays = self.radiance.len();
        self.gbuffers[1] = vec![GBuffer::default(); rays];
        self.mores[1] = vec![More::default(); self.mores[0].len()];
        self.throughput = vec![[0.0; 4]; rays];
        self.origins = vec![Origin::default(); rays];
    }
}

fn resize<T: Copy + Default>(all: &mut Vec<T>, rays: usize) {
    if !all.is_empty() {
        all.resize(rays, T::default());
    }
}

/// Empties the G-buffer of the shaded set, and before the first sample of a batch the radiance.
pub fn clear_gbuffer(bound: &Bound, pixels: &mut Pixels, shaded: usize) {
    pixels.gbuffers[shaded].fill(GBuffer::default());
    if bound.params.sample.is_multiple_of(BATCH_SAMPLES) && !bound.has(PARAM_BOUNCE) {
        pixels.radiance.fill([0.0; 4]);
    }
}

/// What the rays of set 1 carry, and where they come from.
type Carried<'a> = (&'a [[f32; 4]], &'a [Origin]);

/// Calls `light` for every hit of the shaded set, with what the rays of set 1 carry, and adds what it gives to the
/// hit's pixel. Of one set no two hits belong to one.
pub(crate) fn for_each_hit(
    bound: &Bound,
    pixels: &mut Pixels,
    shaded: usize,
    light: impl Fn(usize, Shown, Carried) -> Option<Vec3> + Sync,
) {
    let Pixels { gbuffers, mores, radiance, throughput, origins } = pixels;
    let (gbuffer, mores, carried) = (&gbuffers[shaded], &mores[shaded], (&throughput[..], &origins[..]));
    let radiance = atomic(bytemuck::cast_slice_mut(radiance));
    (0..gbuffer.len().div_ceil(RUN)).into_par_iter().for_each(|run| {
        let mut tally = Tally::default();
        for index in run * RUN..((run + 1) * RUN).min(gbuffer.len()) {
            if let Some(light) = light(index, Shown::of(gbuffer, mores, index), carried) {
                let pixel = 4 * bound.own_pixel(index, origins) as usize;
                add(bound, &mut tally, &radiance[pixel..pixel + 3], throughput.get(index), light);
            }
        }
        bound.counters.add(&tally);
    });
}

/// Counts the sample for the pixels whose camera ray is traced.
fn count_samples(radiance: &mut [[f32; 4]], seen: &RaySet) {
    let traced = radiance.par_iter_mut().zip(&seen.rays).with_min_len(RUN).filter(|(_, ray)| is_traced(ray));
    traced.for_each(|(radiance, _)| radiance[3] += 1.0);
}

/// For how many rays one that met nothing counts: those beside it were not traced ([`crate::secondary::roma::twin`]).
fn weight_of(hit: &Hit) -> f32 {
    1.0 + hit.u
}

pub(crate) fn is_traced(ray: &Ray) -> bool {
    ray.t_min <= ray.t_max
}

/// Of the background in direction `d`, which was drawn by `density`; 0: where no lamp draws it as well.
fn seen_background(bound: &Bound, d: Vec3, density: f32) -> Vec3 {
    let params = bound.params;
    let mut light = background(bound, d);
    if density > 0.0 {
        let n = normalize(d);
        if bound.has(PARAM_ENVIRONMENT) && params.environment_width != 0 {
            let weight = outweighs(density, environment_density(bound, n));
            light = light.map(|c| c * weight);
        }
        // The sun's disc is met by rays of gloss alone, unless its light is without shadows.
        let sun = xyz(params.sun);
        let along = dot(n, sun);
        if bound.has(PARAM_EMITTER) && !bound.has(PARAM_SUN) && params.sun_radius > 0.0 && along > 0.0 {
            let across = cross(n, sun);
            if dot(across, across) <= params.sun_radius * params.sun_radius * along * along {
                let of_sun = sun_density(params, n.map(|x| x / along));
                let weight = PI * of_sun * outweighs(density, of_sun);
                light = each(|k| light[k] + params.sun_color[k] * weight);
            }
        }
    }
    light
}

/// The emission of the hit of ray `index` of `seen`, which was drawn by `density`, as above.
fn seen_emission(bound: &Bound, g: &GBuffer, m: &Material, seen: &RaySet, index: usize, density: f32) -> Vec3 {
    // Only these are lamps.
    let is_lamp = m.emissive_texture == NONE && m.flags & MATERIAL_UNLIT == 0;
    if !is_lamp {
        return g.emission;
    }
    let is_behind = m.flags & MATERIAL_DOUBLE_SIDED == 0 && g.state & GBUFFER_BACK != 0;
    if !bound.has(PARAM_EMISSION) || is_behind {
        return [0.0; 3];
    }
    if density > 0.0 && bound.params.emitter_density > 0.0 {
        let d = seen.rays[index].direction;
        let length = seen.way(index);
        let cosine = most(dot(normalize(d), seen.surfaces[index].normal).abs(), 1.0e-6);
        let sides = if m.flags & MATERIAL_DOUBLE_SIDED != 0 { 2.0 } else { 1.0 };
        let luminance = dot(m.emission, [0.2126, 0.7152, 0.0722]);
        let of_lamp = luminance * sides * bound.params.emitter_density * (length * length / cosine);
        let weight = outweighs(density, of_lamp);
        return g.emission.map(|c| c * weight);
    }
    g.emission
}

/// What the hits of the shaded set show by themselves, unless passes of their own bring it: the background on a miss,
/// else their emission and the light of the sun and of the background, unshadowed. Where rays were drawn by the gloss
/// of surfaces, what rays to lamps bring as well is weighted; so is the environment where diffuse rays meet it. The
/// first shading of a sample counts it.
pub fn shade(bound: &Bound, pixels: &mut Pixels, shaded: usize, seen: &RaySet, materials: &[Material]) {
    let params = bound.params;
    if !bound.has(PARAM_BOUNCE) {
        count_samples(&mut pixels.radiance, seen);
    }
    for_each_hit(bound, pixels, shaded, |index, g, (throughput, _)| {
        let ray = &seen.rays[index];
        if !is_traced(ray) {
            return None;
        }
        let density = if bound.has(PARAM_BOUNCE) { throughput[index][3] } else { 0.0 };
        if seen.surfaces[index].leaf == NONE {
            // What occupancy maps met is lit otherwise.
            let is_miss = bound.has(PARAM_MISS) && seen.hits[index].id != MET;
            return is_miss.then(|| seen_background(bound, ray.direction, density));
        }
        let m = &materials[g.material as usize];
        let s = Gloss::of(g, m, ray.direction.map(|x| -x));
        let (mut light, mut mirrored) = ([0.0; 3], [0.0; 3]);
        if bound.has(PARAM_SUN) {
            let sun = sunlight(params, g.normal);
            let reflected = s.reflected(xyz(params.sun));
            light = each(|k| light[k] + sun[k]);
            mirrored = each(|k| mirrored[k] + reflected[k] * sun[k]);
        }
        if bound.has(PARAM_SKY) {
            let ambient = ambient(params, g.normal);
            let reflected = s.reflected_ambient(bound);
            light = each(|k| light[k] + ambient[k] * g.occlusion);
            mirrored = each(|k| mirrored[k] + reflected[k] * g.occlusion);
        }
        let emission = seen_emission(bound, &g, m, seen, index, density);
        Some(each(|k| s.diffuse[k] * light[k] + mirrored[k] + emission[k]))
    });
}

/// Adds the light of the pass's lamp to the hits of the shaded set, those of `seen`, whose shadow ray went free. The
/// environment shares a direction with diffuse rays, what is not diffuse with the rays that surfaces draw by their
/// gloss, and all light with rays by which paths go on. Of an even environment rays to it bring what none of these do.
pub fn add_light(
    bound: &Bound,
    pixels: &mut Pixels,
    shaded: usize,
    (seen, own): (&RaySet, &RaySet),
    materials: &[Material],
) {
    let is_around = bound.has(PARAM_ENVIRONMENT) && bound.has(PARAM_SCATTER);
    let shares = |flag: bool| flag && !bound.has(PARAM_BOUNCE);
    let (by_diffuse, by_gloss) = (shares(bound.params.diffuse_count > 0.0), shares(bound.has(PARAM_GLOSSY)));
    for_each_hit(bound, pixels, shaded, |index, g, (_, origins)| {
        let ray = &own.rays[index];
        if !is_traced(ray) || own.hits[index].id != NONE {
            return None;
        }
        let d = ray.direction;
        let cosine = most(dot(g.normal, d), 0.0);
        // By which the lamp drew the direction, where the rays of the gloss may meet it.
        let mut density = 0.0;
        let light = if bound.has(PARAM_EMITTER) {
            // Of areas one point, drawn evenly over them: radiance * cos * cos' * area / distance^2 / pi. The direction
            // leads from the surface to the point.
            let chosen = &own.surfaces[index];
            // Rays that others made may lead to none of the emitters.
            if chosen.emitter == NONE {
                return None;
            }
            let e = bound.lamps.emitter(chosen.emitter);
            let squared = dot(d, d);
            let shone = shines(e, d);
            if e.kind & EMITTER_KIND == EMITTER_TRIANGLE {
                density = e.probability * squared * squared.sqrt() / shone;
            }
            each(|k| e.radiance[k] * cosine * shone / (PI * squared * squared) / chosen.area)
        } else if is_around {
            environment_at(bound, d)
        } else if bound.has(PARAM_ENVIRONMENT) {
            let chosen = &own.surfaces[index];
            let drawn = environment_sample(bound, lamp_words(bound, index, chosen.emitter, origins));
            density = drawn_density(bound, &drawn);
            drawn_light(bound, &drawn).map(|c| c * cosine / (PI * chosen.area))
        } else {
            if bound.params.sun_radius > 0.0 {
                density = sun_density(bound.params, d);
            }
            sunlight(bound.params, g.normal)
        };
        let s = Gloss::of(g, &materials[g.material as usize], seen.rays[index].direction.map(|x| -x));
        let mut reflects = s.diffuse;
        if bound.has(PARAM_ENVIRONMENT) && by_diffuse {
            let by_rays = bound.params.diffuse_count * cosine / PI;
            let share = if is_around { 0.0 } else { outweighs(density, by_rays) };
            reflects = reflects.map(|c| c * share);
        }
        if s.is_glossy() && !(is_around && by_gloss) {
            let unit = normalize(d);
            let mut weight = 1.0;
            if by_gloss && density > 0.0 {
                weight = outweighs(density, s.density(unit));
            }
            let reflected = s.reflected(unit);
            reflects = each(|k| reflects[k] + weight * reflected[k]);
        }
        if bound.has(PARAM_PATH) && density > 0.0 {
            let share = outweighs(density, s.path_density(g.normal, normalize(d)));
            reflects = reflects.map(|c| c * share);
        }
        Some(each(|k| weight_of(&own.hits[index]) * reflects[k] * light[k]))
    });
}

/// Adds the share of the sky's light that the pass's direction stands for, where its ray went free.
pub fn add_occlusion(
    bound: &Bound,
    pixels: &mut Pixels,
    shaded: usize,
    (seen, own): (&RaySet, &RaySet),
    materials: &[Material],
) {
    for_each_hit(bound, pixels, shaded, |index, g, _| {
        if !is_traced(&own.rays[index]) || own.hits[index].id != NONE {
            return None;
        }
        let ambient = ambient(bound.params, g.normal);
        let s = Gloss::of(g, &materials[g.material as usize], seen.rays[index].direction.map(|x| -x));
        let mirrored = s.reflected_ambient(bound);
        let share = weight_of(&own.hits[index]) * bound.params.share;
        Some(each(|k| share * (s.diffuse[k] * ambient[k] + mirrored[k])))
    });
}

/// Counts, per brick, the final hits of a pass.
pub fn hit_demand(bound: &Bound, own: &RaySet) {
    own.surfaces.par_chunks(8 * RUN).for_each(|run| {
        let mut demand = DemandTally::default();
        for leaf in run.iter().map(|surface| surface.leaf).filter(|&leaf| leaf != NONE) {
            demand.add_ray(bound.demand, bound.brick_of(leaf), 0.0);
        }
        demand.finish(bound.demand);
    });
}
