//! Looks up the textures of hits, one by one: each whose tiles are resident together; of the others all tiles are asked
//! for, and the hit waits. With `PARAM_COARSER` none waits: the next coarser level that is resident stands for what is
//! missing. Twin of `shaders/texture/sample.wgsl`.

use super::texels::{Sampling, TileDemand};
use super::texture::{Level, color_at, level_at, levels_of, tile_at};
use crate::kernels::bound::{Bound, Tally};
use crate::kernels::layout::{
    COUNTER_UNRESOLVED, GBUFFER_COARSER, GBUFFER_FIRST, GBUFFER_WAITS, GBuffer, MATERIAL_UNLIT, NONE, PARAM_COARSER,
};
use crate::kernels::vector::{Vec3, cross, dot, each, mix, most};
use bricks::{BASE_COLOR, METALLIC_ROUGHNESS, NORMAL, OCCLUSION};
use rayon::prelude::*;
use std::sync::atomic::Ordering;

/// Of all hits of the shaded set that wait for it.
pub fn sample(bound: &Bound, gbuffer: &mut [GBuffer], from: Sampling, demand: &[TileDemand]) {
    let width = bound.params.width as usize;
    let takes_coarser = bound.has(PARAM_COARSER);
    gbuffer.par_chunks_mut(width.max(1)).enumerate().for_each(|(row, gbuffer)| {
        let mut tally = Tally::default();
        for (x, g) in gbuffer.iter_mut().enumerate().filter(|(_, g)| g.state & GBUFFER_WAITS != 0) {
            let is_coarser = look_up(g, (row * width + x) as u32, from, demand, takes_coarser);
            tally.add(COUNTER_UNRESOLVED, is_coarser.into());
        }
        bound.counters.add(&tally);
    });
}

/// Unlit surfaces show their base colour whatever the light (KHR_materials_unlit).
pub(crate) fn settle(g: &mut GBuffer, flags: u32) {
    if flags & MATERIAL_UNLIT != 0 {
        g.emission = g.albedo;
        g.albedo = [0.0; 3];
    }
}

/// The normal that a texel of the normal texture stands for.
fn turned_normal(g: &GBuffer, texel: Vec3, scale: f32) -> Vec3 {
    let n = texel.map(|c| 2.0 * c - 1.0);
    let beside = dot(g.normal, g.tangent);
    let along = each(|k| g.tangent[k] - g.normal[k] * beside);
    let size = dot(along, along);
    // The tangent may have no part beside the normal.
    let inverse = 1.0 / most(size, 1.0e-30).sqrt();
    let t = along.map(|x| x * inverse);
    let sign = if g.handedness > 0.0 { 1.0 } else { -1.0 };
    let b = cross(g.normal, t).map(|x| x * sign);
    let turned = each(|k| scale * n[0] * t[k] + scale * n[1] * b[k] + n[2] * g.normal[k]);
    let length = dot(turned, turned);
    if size > 1.0e-30 && length > 1.0e-12 {
        let inverse = 1.0 / most(length, 1.0e-30).sqrt();
        return turned.map(|x| x * inverse);
    }
    g.normal
}

fn tiles_of(level: &Level) -> impl Iterator<Item = u32> {
    (0..4).map(|k| tile_at(level, k)).filter(|&tile| tile != NONE)
}

/// Of one hit, that of ray `index`; whether a coarser level stands for one that is missing.
pub(crate) fn look_up(g: &mut GBuffer, index: u32, from: Sampling, demand: &[TileDemand], takes_coarser: bool) -> bool {
    let m = &from.texels.materials[g.material as usize];
    let mut is_coarser = false;
    let is_resident = |level: &Level| tiles_of(level).all(|tile| !from.tiles[tile as usize].is_empty());
    for (which, texture) in m.textures().into_iter().enumerate() {
        let bit = 1 << (GBUFFER_FIRST + which as u32);
        if g.state & bit == 0 {
            continue;
        }
        let t = &from.texels.textures[texture as usize];
        let is_second = m.uv_sets >> which & 1 != 0;
        let (set, footprint) = if is_second { (g.uv1, g.footprint1) } else { (g.uv, g.footprint) };
        let [u, v] = [m.uv_from_set[2 * which], m.uv_from_set[2 * which + 1]];
        let uv = [u, v].map(|row| row[0] * set[0] + row[1] * set[1] + row[2]);
        let mut levels = levels_of(t, footprint * u[3]);
        let mut around =
            [0, 1].map(|n| if n < levels.count { level_at(t, levels.finer + n, uv) } else { Level::default() });
        let mut is_missing = !around[..levels.count as usize].iter().all(is_resident);
        if is_missing && takes_coarser {
            levels.count = 1;
            // The tail ends this: it is resident throughout.
            while !is_resident(&around[0]) {
                levels.finer += 1;
                around[0] = level_at(t, levels.finer, uv);
            }
            (is_missing, is_coarser) = (false, true);
        }
        let around = &around[..levels.count as usize];
        for tile in around.iter().flat_map(tiles_of) {
            let asked = &demand[tile as usize];
            if is_missing {
                asked.rays.fetch_add(1, Ordering::Relaxed);
                asked.first.fetch_min(index, Ordering::Relaxed);
            } else if asked.used.load(Ordering::Relaxed) == 0 {
                asked.used.store(1, Ordering::Relaxed);
            }
        }
        if is_missing {
            continue;
        }
        let mut color = color_at(t, &around[0], from);
        if let Some(coarser) = around.get(1) {
            let other = color_at(t, coarser, from);
            color = [0, 1, 2, 3].map(|k| mix(color[k], other[k], levels.share));
        }
        match which {
            BASE_COLOR => (0..3).for_each(|k| g.albedo[k] *= color[k]),
            NORMAL => g.normal = turned_normal(g, [color[0], color[1], color[2]], m.normal_scale),
            METALLIC_ROUGHNESS => {
                g.roughness *= color[1];
                g.metallic *= color[2];
            }
            OCCLUSION => g.occlusion = 1.0 + m.occlusion_strength * (color[0] - 1.0),
            _ => (0..3).for_each(|k| g.emission[k] *= color[k]),
        }
        g.state &= !bit;
    }
    if g.state & GBUFFER_WAITS == 0 {
        settle(g, m.flags);
    }
    g.state |= if is_coarser { GBUFFER_COARSER } else { 0 };
    is_coarser
}
