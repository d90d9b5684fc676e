//! Reflective shadow maps: twins of `shaders/rsm/rsm_write.wgsl` and `rsm_light.wgsl`.

use crate::kernels::bound::Bound;
use crate::kernels::layout::{MET, NONE, RSM_PERSPECTIVE, RsmMap, RsmOwn, RsmTexel};
use crate::kernels::rays::RaySet;
use crate::kernels::shade::gloss::Gloss;
use crate::kernels::shade::lamps::{lamp_words, shines, unit};
use crate::kernels::shade::light::sunlight;
use crate::kernels::shade::more::Shown;
use crate::kernels::shade::shade::{Pixels, for_each_hit};
use crate::kernels::table::words;
use crate::kernels::vector::{Vec3, dot, each, most};
use crate::math::exact::divide;
use crate::schedule::ExecutorError;
use bricks::Material;
use rayon::prelude::*;
use std::f32::consts::PI;

/// By the lift of the level that was met: how wide points are moved.
const MOVED: f32 = 0.8;
/// How far what is seen may be from the point, across its surface.
const ACROSS: f32 = 1.2;
/// And in depth.
const IN_DEPTH: f32 = 3.6;

/// Writes a block of texels of a map from the hits of set 0.
pub fn rsm_write(
    bound: &Bound,
    buffers: &mut [Vec<u32>],
    pixels: &Pixels,
    seen: &RaySet,
    materials: &[Material],
) -> Result<(), ExecutorError> {
    let (p, own) = (bound.params, bound.own::<RsmOwn>());
    let [maps, texels] = words(buffers)?;
    let map = &bytemuck::cast_slice::<_, RsmMap>(maps)[own.map as usize];
    let texels: &mut [RsmTexel] = bytemuck::cast_slice_mut(texels);
    let (width, height) = (map.width.saturating_sub(own.x), map.height.saturating_sub(own.y));
    let rows = texels[map.first as usize..][..(map.width * map.height) as usize].par_chunks_mut(map.width as usize);
    rows.skip(own.y as usize).take(height.min(p.height) as usize).enumerate().for_each(|(y, row)| {
        for (x, texel) in row.iter_mut().skip(own.x as usize).take(width.min(p.width) as usize).enumerate() {
            let index = y * p.width as usize + x;
            *texel = seen_by_lamp(bound, (map.lamp, map.flags), pixels, seen, index, materials);
        }
    });
    Ok(())
}

fn seen_by_lamp(
    bound: &Bound,
    (lamp, flags): (u32, u32),
    pixels: &Pixels,
    seen: &RaySet,
    index: usize,
    materials: &[Material],
) -> RsmTexel {
    let surface = &seen.surfaces[index];
    if surface.leaf == NONE {
        return RsmTexel { depth: -1.0, ..RsmTexel::default() };
    }
    let g = Shown::of(&pixels.gbuffers[0], &pixels.mores[0], index);
    let t = seen.hits[index].t;
    let to_lamp = seen.rays[index].direction.map(|x| -x);
    let light = if lamp == NONE {
        sunlight(bound.params, g.normal)
    } else {
        let e = bound.lamps.emitter(lamp);
        let d = if flags & RSM_PERSPECTIVE != 0 { to_lamp.map(|x| x * t) } else { to_lamp };
        let squared = dot(d, d);
        let (cosine, shone) = (most(dot(g.normal, d), 0.0), shines(e, d));
        e.radiance.map(|c| c * cosine * shone / (PI * squared * squared))
    };
    let n = surface.normal;
    let facing = n[0] * to_lamp[0] + n[1] * to_lamp[1] + n[2] * to_lamp[2];
    let s = Gloss::of(g, &materials[g.material as usize], to_lamp);
    RsmTexel { flux: each(|k| s.diffuse[k] * light[k]), depth: t, normal: n, facing }
}

fn row_at(row: &[f32; 4], p: Vec3) -> f32 {
    row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]
}

/// What is reflected to a ray along `-view` from near `p`, which is known to within `lift`.
fn reflected(bound: &Bound, (maps, texels): (&[RsmMap], &[RsmTexel]), p: Vec3, view: Vec3, lift: f32) -> Vec3 {
    let mut light = [0.0; 3];
    let mut done = bound.params.emitter_count;
    for map in maps {
        if map.lamp == done {
            continue;
        }
        let [mut u, mut v, depth] = [0, 1, 2].map(|k| row_at(&map.texel_from_point[k], p));
        if map.flags & RSM_PERSPECTIVE != 0 {
            if depth.is_nan() || depth <= 0.0 {
                continue;
            }
            (u, v) = (divide(u, depth), divide(v, depth));
        }
        if !(u >= 0.0 && v >= 0.0 && u < map.width as f32 && v < map.height as f32) {
            continue;
        }
        done = map.lamp;
        let texel = &texels[(map.first + v as u32 * map.width + u as u32) as usize];
        let n = texel.normal;
        let turned = n[0] * view[0] + n[1] * view[1] + n[2] * view[2];
        let apart = (depth - texel.depth).abs();
        let is_near = apart <= IN_DEPTH * lift && apart * texel.facing <= ACROSS * lift;
        if texel.depth >= 0.0 && turned > 0.0 && is_near {
            light = each(|k| light[k] + texel.flux[k]);
        }
    }
    light
}

/// Adds what the hits that occupancy maps gave reflect of the lamps, by their maps.
pub fn rsm_light(
    bound: &Bound,
    buffers: &mut [Vec<u32>],
    (pixels, shaded): (&mut Pixels, usize),
    seen: &RaySet,
) -> Result<(), ExecutorError> {
    let [maps, texels] = words(buffers)?;
    let maps = &bytemuck::cast_slice(maps)[..bound.own::<RsmOwn>().maps as usize];
    let looked_up = (maps, bytemuck::cast_slice(texels));
    for_each_hit(bound, pixels, shaded, |index, _, (_, origins)| {
        let ray = &seen.rays[index];
        let is_traced = ray.t_min <= ray.t_max;
        if !is_traced || seen.hits[index].id != MET {
            return None;
        }
        let met = &seen.surfaces[index];
        let words = lamp_words(bound, index, 0, origins);
        let p = each(|k| met.point[k] + MOVED * met.area * (unit(words[k]) - 0.5));
        let light = reflected(bound, looked_up, p, met.normal, met.area);
        light.iter().any(|&c| c != 0.0).then_some(light)
    });
    Ok(())
}
