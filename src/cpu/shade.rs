//! What hits show and the light on them: twins of `shaders/clear_gbuffer.wgsl`, `shade.wgsl`, `add_light.wgsl`,
//! `add_occlusion.wgsl` and `hit_demand.wgsl`.

use super::lamps::{emitter_of, environment_sample, lamp_words, shines};
use super::light::{add_light as add, ambient, background, sunlight};
use super::rays::RaySet;
use super::scene::{Bound, Tally};
use super::vector::{Vec3, dot, each, most};
use crate::kernel::layout::{
    BATCH_SAMPLES, GBuffer, NONE, PARAM_BOUNCE, PARAM_EMISSION, PARAM_EMITTER, PARAM_ENVIRONMENT, PARAM_MISS,
    PARAM_SKY, PARAM_SUN, Ray,
};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Pixels that a task shades in a row.
const RUN: usize = 1024;

/// What shading keeps per pixel.
#[derive(Default)]
pub struct Pixels {
    /// Of the hits of sets 0 and 1.
    pub gbuffers: [Vec<GBuffer>; 2],
    /// Summed over the samples of a batch; w counts them.
    pub radiance: Vec<[f32; 4]>,
    /// Of the light that the rays of set 1 bring.
    pub throughput: Vec<[f32; 4]>,
}

impl Pixels {
    /// Of `rays` pixels.
    pub fn new(rays: usize) -> Self {
        let gbuffers = [vec![GBuffer::default(); rays], Vec::new()];
        Self { gbuffers, radiance: vec![[0.0; 4]; rays], throughput: Vec::new() }
    }

    /// Makes room for bounces at every pixel.
    pub fn allow_bounces(&mut self) {
        let rays = self.radiance.len();
        self.gbuffers[1] = vec![GBuffer::default(); rays];
        self.throughput = vec![[0.0; 4]; rays];
    }
}

/// The share of a primary hit's own light that it shows; all of a hit of set 1.
pub fn surface_share(bound: &Bound) -> f32 {
    if bound.has(PARAM_BOUNCE) { 1.0 } else { bound.params.surface_share }
}

/// Empties the G-buffer of the shaded set, and before the first sample of a batch the radiance.
pub fn clear_gbuffer(bound: &Bound, pixels: &mut Pixels, shaded: usize) {
    pixels.gbuffers[shaded].fill(GBuffer::default());
    if bound.params.sample.is_multiple_of(BATCH_SAMPLES) && !bound.has(PARAM_BOUNCE) {
        pixels.radiance.fill([0.0; 4]);
    }
}

/// Calls `light` for every pixel, with the throughputs of all, and adds what it gives.
fn for_each_pixel(
    bound: &Bound,
    pixels: &mut Pixels,
    shaded: usize,
    light: impl Fn(usize, &GBuffer, &mut [f32; 4], &[[f32; 4]]) -> Option<Vec3> + Sync,
) {
    let Pixels { gbuffers, radiance, throughput } = pixels;
    let (gbuffer, throughput) = (&gbuffers[shaded], &throughput[..]);
    radiance.par_chunks_mut(RUN).enumerate().for_each(|(run, radiance)| {
        let mut tally = Tally::default();
        for (i, radiance) in radiance.iter_mut().enumerate() {
            let index = run * RUN + i;
            if let Some(light) = light(index, &gbuffer[index], radiance, throughput) {
                add(bound, &mut tally, radiance, throughput.get(index), light);
            }
        }
        bound.counters.add(&tally);
    });
}

fn is_traced(ray: &Ray) -> bool {
    ray.t_min <= ray.t_max
}

/// What the hits of the shaded set show by themselves, unless passes of their own bring it: the background on a miss, else their
/// emission and the light of the sun and of the background on a Lambertian surface. The first shading of a sample counts it.
pub fn shade(bound: &Bound, pixels: &mut Pixels, shaded: usize, seen: &RaySet) {
    let params = bound.params;
    for_each_pixel(bound, pixels, shaded, |index, g, radiance, _| {
        if !bound.has(PARAM_BOUNCE) {
            radiance[3] += 1.0;
        }
        let ray = &seen.rays[index];
        if !is_traced(ray) {
            return None;
        }
        if seen.surfaces[index].leaf == NONE {
            return bound.has(PARAM_MISS).then(|| background(bound, ray.direction));
        }
        let mut light = [0.0; 3];
        if bound.has(PARAM_SUN) {
            let sun = sunlight(params, g.normal);
            light = each(|k| light[k] + sun[k]);
        }
        if bound.has(PARAM_SKY) {
            let ambient = ambient(params, g.normal);
            light = each(|k| light[k] + ambient[k]);
        }
        let emission = if bound.has(PARAM_EMISSION) { g.emission } else { [0.0; 3] };
        Some(each(|k| surface_share(bound) * (g.albedo[k] * light[k] + emission[k])))
    });
}

/// Adds the light of the pass's lamp to the hits of the shaded set whose shadow ray went free: Lambertian surfaces.
pub fn add_light(bound: &Bound, pixels: &mut Pixels, shaded: usize, own: &RaySet) {
    for_each_pixel(bound, pixels, shaded, |index, g, _, throughput| {
        let ray = &own.rays[index];
        if !is_traced(ray) || own.hits[index].id != NONE {
            return None;
        }
        let d = ray.direction;
        let cosine = most(dot(g.normal, d), 0.0);
        let light = if bound.has(PARAM_EMITTER) {
            // Of areas one point, drawn evenly over them: radiance * cos * cos' * area / distance^2 / pi. The direction leads from
            // the surface to the point.
            let e = emitter_of(bound, index, throughput);
            let squared = dot(d, d);
            each(|k| e.radiance[k] * cosine * shines(e, d) / (PI * squared * squared) / e.probability)
        } else if bound.has(PARAM_ENVIRONMENT) {
            environment_sample(bound, lamp_words(bound, index, throughput)).light.map(|c| c * cosine / PI)
        } else {
            sunlight(bound.params, g.normal)
        };
        Some(each(|k| surface_share(bound) * g.albedo[k] * light[k]))
    });
}

/// Adds the share of the sky's light that the pass's direction stands for, where its ray went free.
pub fn add_occlusion(bound: &Bound, pixels: &mut Pixels, shaded: usize, own: &RaySet) {
    for_each_pixel(bound, pixels, shaded, |index, g, _, _| {
        if !is_traced(&own.rays[index]) || own.hits[index].id != NONE {
            return None;
        }
        let ambient = ambient(bound.params, g.normal);
        Some(each(|k| surface_share(bound) * bound.params.share * g.albedo[k] * ambient[k]))
    });
}

/// Counts, per brick, the final hits of a pass.
pub fn hit_demand(bound: &Bound, own: &RaySet) {
    own.surfaces.par_chunks(RUN).for_each(|run| {
        for hits in run.chunk_by(|a, b| a.leaf == b.leaf).filter(|hits| hits[0].leaf != NONE) {
            bound.demand[bound.brick_of(hits[0].leaf)].add(hits.len() as u32, 0);
        }
    });
}
