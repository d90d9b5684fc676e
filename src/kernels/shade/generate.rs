//! Rays from the camera and from hits: twins of `shaders/shade/generate_primary.wgsl`, `generate_shadow.wgsl`,
//! `generate_around.wgsl`, `generate_glossy.wgsl` and `start_hits.wgsl`.

use super::choose::{ChooseDirection, Chosen, choose_emitter};
use super::cones::{self, widen};
use super::directions::{Around, Column, OfDisc, RUN};
use super::gloss::{Drawn, Gloss, left_within};
use super::lamps::{lamp_words, shines};
use super::more::Shown;
use super::random::tangent;
use super::shade::Pixels;
use crate::kernels::bound::Bound;
use crate::kernels::layout::{
    EMITTER_DISTANT, EMITTER_KIND, EMITTER_TRIANGLE, Emitter, GBuffer, NONE, Origin, PARAM_EMITTER, PARAM_ENVIRONMENT,
    Params, Ray, Surface, T_INFINITE, UNSHARED,
};
use crate::kernels::rays::{RaySet, start_hit};
use crate::kernels::simd::isa::Best;
use crate::kernels::vector::{Vec3, cross, dot, each, most, most3, normalize, xyz};
use crate::math::exact::barrier;
use crate::math::sampling::{pcg, points2, points4};
use bricks::Material;
use rayon::prelude::*;
use std::f32::consts::PI;

/// Rays to emitters end short of them by this share of the distance, so that what lies in their plane casts no shadow.
const SHORT_OF_LIGHT: f32 = 1.0 / 65_536.0;

/// Of the coordinates: more than what three roundings may leave a point of an emitter beside its triangle, and more on
/// instances.
const BESIDE: f32 = 1.0 / 1_048_576.0;

/// Makes every ray of `own`, with the triangle that it starts from and the emitter that it leads to: by what `of_run`
/// gives for the rays from a number on, the place in the run, and the ray's number.
fn for_each_in_runs<T>(
    own: &mut RaySet,
    of_run: impl Fn(usize) -> T + Sync,
    make: impl Fn(&T, usize, usize) -> (Ray, u32, Chosen) + Sync,
) {
    let RaySet { rays, hits, surfaces, .. } = own;
    let runs = rays.par_chunks_mut(RUN).zip(hits.par_chunks_mut(RUN)).zip(surfaces.par_chunks_mut(RUN));
    runs.enumerate().with_min_len(1024 / RUN).for_each(|(run, ((rays, hits), surfaces))| {
        let shared = of_run(run * RUN);
        for (k, ((ray, hit), surface)) in rays.iter_mut().zip(hits).zip(surfaces).enumerate() {
            let (source, chosen);
            (*ray, source, chosen) = make(&shared, k, run * RUN + k);
            (*hit, *surface) = start_hit(ray.t_max, source);
            (surface.emitter, surface.area) = (chosen.emitter, chosen.probability);
        }
    });
}

/// The same of rays that share nothing.
fn for_each_new(own: &mut RaySet, make: impl Fn(usize) -> (Ray, u32, Chosen) + Sync) {
    for_each_in_runs(own, |_| (), |(), _, index| make(index));
}

/// Starts the hits of rays that came from outside: nothing found within their range.
pub fn start_hits(own: &mut RaySet) {
    let RaySet { rays, hits, surfaces, .. } = own;
    for ((ray, hit), surface) in rays.iter().zip(hits).zip(surfaces) {
        (*hit, *surface) = start_hit(ray.t_max, NONE);
    }
}

fn along(base: f32, x: f32, step_x: f32, y: f32, step_y: f32) -> f32 {
    barrier(barrier(base + barrier(x * step_x)) + barrier(y * step_y))
}

/// Whether the ray's block is traced: all are, or the one of its group that is chosen.
fn is_chosen(p: &Params, column: u32, row: u32) -> bool {
    let one_in = p.traced_one_in;
    if one_in == 0 {
        return true;
    }
    let block = row / 8 * p.width.div_ceil(8) + column / 8;
    block % one_in == pcg((block / one_in) ^ pcg(p.seed)) % one_in
}

/// Camera rays: direction(x, y) = base + x * step_x + y * step_y through the jittered pixel position, not normalised.
pub fn generate_primary(bound: &Bound, own: &mut RaySet) {
    let p = bound.params;
    for_each_new(own, |index| {
        let (column, row) = (index as u32 % p.width, p.first_row + index as u32 / p.width);
        let x = barrier(column as f32 + p.jitter[0]);
        let y = barrier(row as f32 + p.jitter[1]);
        let direction = each(|k| along(p.base[k], x, p.step_x[k], y, p.step_y[k]));
        // The last band of a picture may reach beyond it.
        let (t_min, t_max) =
            if row < p.picture_rows && is_chosen(p, column, row) { (0.0, T_INFINITE) } else { (1.0, 0.0) };
        (Ray { origin: xyz(p.origin), t_min, direction, t_max }, NONE, Chosen::default())
    });
}

/// From `start` to the point of `e` that `r` draws evenly. Triangles are surfaces of the scene themselves, so the point
/// is lifted off them by what roundings leave; a start that lies in the plane of the triangle within as much has no
/// light from it: zero.
fn toward(e: &Emitter, start: Vec3, r: [f32; 2]) -> Vec3 {
    let kind = e.kind & EMITTER_KIND;
    if kind == EMITTER_DISTANT {
        return e.u.map(|x| -x);
    }
    if kind > EMITTER_TRIANGLE {
        return each(|k| barrier(e.corner[k] - start[k]));
    }
    let is_triangle = kind == EMITTER_TRIANGLE;
    let s = if is_triangle && r[0] + r[1] > 1.0 { r.map(|r| 1.0 - r) } else { r };
    let across = |k: usize| barrier(barrier(s[0] * e.u[k]) + barrier(s[1] * e.v[k]));
    let p = each(|k| barrier(e.corner[k] + across(k)));
    let direction = each(|k| barrier(p[k] - start[k]));
    if !is_triangle {
        return direction;
    }
    let n = normalize(cross(e.u, e.v));
    let above = -dot(direction, n);
    let beside = BESIDE * (most3(p.map(f32::abs)) + most3(start.map(f32::abs)));
    if above.abs() <= beside {
        return [0.0; 3];
    }
    let lift = if above > 0.0 { beside } else { -beside };
    each(|k| direction[k] + lift * n[k])
}

/// One ray from every hit of the shaded set to a point of the pass's lamp; from surfaces that face away, none.
pub fn generate_shadow(bound: &Bound, own: &mut RaySet, seen: &RaySet, origins: &[Origin]) {
    let p = bound.params;
    let (sun, best) = (xyz(p.sun), Best::detect());
    let draws = bound.has(PARAM_EMITTER) || bound.has(PARAM_ENVIRONMENT);
    let x = tangent(sun);
    let y = cross(sun, x);
    let of_run = |first| (!draws && p.sun_radius > 0.0).then(|| best.run(OfDisc { bound, first, origins }));
    for_each_in_runs(own, of_run, |disc, k, index| {
        let surface = &seen.surfaces[index];
        let mut ray = Ray { origin: surface.point, t_min: 1.0, direction: sun, t_max: 0.0 };
        let mut chosen = Chosen::default();
        if surface.leaf != NONE {
            let mut faces = true;
            let mut t_max = T_INFINITE;
            if bound.has(PARAM_EMITTER) {
                // The first two words draw the point.
                let random = lamp_words(bound, index, 0, origins)[2];
                let emitters = bound.lamps.emitters();
                chosen = choose_emitter(emitters, p.emitter_count, random, surface.point, surface.normal);
                faces = chosen.emitter != NONE;
                if faces {
                    let e = &emitters[chosen.emitter as usize];
                    let r = points2(bound.pixel_of(index, origins), p.stream, p.seed);
                    ray.direction = toward(e, surface.point, r);
                    faces = shines(e, ray.direction) > 0.0;
                    t_max = if e.kind & EMITTER_KIND == EMITTER_DISTANT { T_INFINITE } else { 1.0 - SHORT_OF_LIGHT };
                }
            } else if bound.has(PARAM_ENVIRONMENT) {
                (chosen, ray.direction) = best.run(ChooseDirection { bound, index, origins, normal: surface.normal });
                faces = chosen.probability > 0.0;
            } else if let Some(disc) = disc {
                let disc = [disc[0][k], disc[1][k]].map(|x| x * p.sun_radius);
                let across = |k: usize| barrier(barrier(x[k] * disc[0]) + barrier(y[k] * disc[1]));
                ray.direction = each(|k| barrier(sun[k] + across(k)));
            }
            if faces && dot(surface.normal, ray.direction) > 0.0 {
                ray.t_min = 0.0;
                ray.t_max = t_max;
            }
        }
        (ray, seen.hits[index].id, chosen)
    });
}

/// Directions around the normals of the hits of a run; see [`Around`].
fn directions_around(bound: &Bound, first: usize, gbuffer: &[GBuffer], origins: &[Origin]) -> [Column; 3] {
    let mut normals = [[0.0; RUN]; 3];
    for (k, g) in gbuffer[first..].iter().take(RUN).enumerate() {
        (0..3).for_each(|axis| normals[axis][k] = g.normal[axis]);
    }
    Best::detect().run(Around { bound, first, origins, normals })
}

/// A ray from a hit in `direction`, up to `t_max`; none where that leads below the surface.
pub fn leaving(surface: &Surface, direction: Vec3, t_max: f32) -> Ray {
    let above = dot(surface.normal, direction) > 0.0;
    let (t_min, t_max) = if above { (0.0, t_max) } else { (1.0, 0.0) };
    Ray { origin: surface.point, t_min, direction, t_max }
}

/// What stands for the ray of a pixel without a hit.
pub fn none(origin: Vec3) -> Ray {
    Ray { origin, t_min: 1.0, direction: [0.0, 1.0, 0.0], t_max: 0.0 }
}

/// Makes a ray from every hit of the shaded set; where there is none, none.
pub fn for_each_leaving(own: &mut RaySet, seen: &RaySet, make: impl Fn(usize, &Surface) -> Ray + Sync) {
    for_each_new(own, |index| {
        let surface = &seen.surfaces[index];
        let ray = if surface.leaf == NONE { none(surface.point) } else { make(index, surface) };
        (ray, seen.hits[index].id, Chosen::default())
    });
}

/// Rays of at most such a length from the hits of the shaded set, in directions around their normals.
fn leave_around(
    bound: &Bound,
    own: &mut RaySet,
    seen: &RaySet,
    (gbuffer, origins): (&[GBuffer], &[Origin]),
    length: f32,
) {
    let of_run = |first| directions_around(bound, first, gbuffer, origins);
    for_each_in_runs(own, of_run, |[x, y, z], k, index| {
        let surface = &seen.surfaces[index];
        let is_hit = surface.leaf != NONE;
        let ray = if is_hit { leaving(surface, [x[k], y[k], z[k]], length) } else { none(surface.point) };
        (ray, seen.hits[index].id, Chosen::default())
    });
}

/// One ray of limited length from every primary hit in the pass's direction around the interpolated normal (CHC+RT
/// §5.3); where that leads below the surface, none.
pub fn generate_occlusion(bound: &Bound, own: &mut RaySet, seen: &RaySet, gbuffer: &[GBuffer], origins: &[Origin]) {
    leave_around(bound, own, seen, (gbuffer, origins), bound.params.length);
}

/// As [`generate_occlusion`], of unlimited length. The throughput is noted: what of light from around the surface
/// reflects, by the share of the direction; in w the density of the direction.
pub fn generate_diffuse(bound: &Bound, own: &mut RaySet, seen: &RaySet, pixels: &mut Pixels, materials: &[Material]) {
    let Pixels { gbuffers: [gbuffer, _], mores: [mores, _], throughput, origins, .. } = pixels;
    leave_around(bound, own, seen, (gbuffer, &[]), T_INFINITE);
    let carried = throughput.par_iter_mut().zip(origins.par_iter_mut());
    carried.enumerate().with_min_len(1024).for_each(|(index, (carried, origin))| {
        let ray = &own.rays[index];
        let density = bound.params.diffuse_count * most(dot(gbuffer[index].normal, ray.direction), 0.0) / PI;
        *carried = [0.0, 0.0, 0.0, density];
        *origin = Origin { pixel: index as u32, direction: bound.params.direction };
        if ray.t_min <= ray.t_max {
            let g = Shown::of(gbuffer, mores, index);
            let s = Gloss::of(g, &materials[g.material as usize], seen.rays[index].direction.map(|x| -x));
            let reflected = s.reflected_by_diffuse_rays(bound);
            (0..3).for_each(|k| carried[k] = bound.params.share * reflected[k]);
        }
    });
}

/// One ray from every primary hit that reflects otherwise than diffusely, in a direction drawn by its gloss, which may
/// lead through it; where what is reflected leads below the surface, none. The throughput and by which density the
/// direction was drawn are noted.
pub fn generate_glossy(bound: &Bound, own: &mut RaySet, seen: &RaySet, pixels: &mut Pixels, materials: &[Material]) {
    let Pixels { gbuffers: [gbuffer, _], mores: [mores, _], throughput, origins, .. } = pixels;
    let p = bound.params;
    let gloss = |index: usize| {
        let g = Shown::of(gbuffer, mores, index);
        Gloss::of(g, &materials[g.material as usize], seen.rays[index].direction.map(|x| -x))
    };
    for_each_leaving(own, seen, |index, surface| {
        let s = gloss(index);
        if !s.is_glossy() {
            return none(surface.point);
        }
        let Drawn { direction, is_through } = s.direction(points4(bound.pixel_of(index, &[]), p.stream, p.seed));
        let leaves = (dot(surface.normal, direction) > 0.0) != is_through;
        let ended = Ray { direction, ..none(surface.point) };
        if leaves && (is_through || s.density(direction) > 0.0) {
            Ray { t_min: 0.0, t_max: T_INFINITE, ..ended }
        } else {
            ended
        }
    });
    let carried = throughput.par_iter_mut().zip(origins.par_iter_mut()).zip(own.surfaces.par_iter_mut());
    carried.enumerate().with_min_len(1024).for_each(|(index, ((carried, origin), surface))| {
        *carried = [0.0; 4];
        *origin = Origin { pixel: index as u32, direction: 0 };
        let ray = &own.rays[index];
        if ray.t_min <= ray.t_max {
            let (s, g) = (gloss(index), &gbuffer[index]);
            let left = left_within(bound, g, &materials[g.material as usize], seen.way(index));
            let is_through = dot(seen.surfaces[index].normal, ray.direction) <= 0.0;
            let density = if is_through { UNSHARED } else { s.density(ray.direction) };
            let (light, share) = if is_through {
                (s.passed(ray.direction), s.eta * s.eta)
            } else {
                (s.reflected(ray.direction), dot(g.normal, ray.direction) / (PI * density))
            };
            (0..3).for_each(|k| carried[k] = light[k] * share * left[k]);
            carried[3] = density;
            let curvature = if is_through { 0.0 } else { g.curvature };
            surface.emitter = curvature.to_bits();
            widen(bound, surface, ray.origin, cones::reflected(density, s.greatest_alpha()), curvature);
        }
    });
}
