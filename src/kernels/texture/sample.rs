//! Looks up the textures of hits, one by one: each whose tiles are resident together; of the others all tiles are asked
//! for, and the hit waits. With `PARAM_COARSER` none waits: the next coarser level that is resident stands for what is
//! missing. Twin of `shaders/texture/sample.wgsl`.

use super::look_up::{Lookups, turned_normal};
use super::more;
use super::texels::{Sampling, TileDemand};
use crate::kernels::bound::{Bound, Tally};
use crate::kernels::layout::{
    COUNTER_UNRESOLVED, GBUFFER_COARSER, GBUFFER_FIRST, GBUFFER_WAITS, GBuffer, MATERIAL_UNLIT, More, PARAM_COARSER,
};
use bricks::{BASE_COLOR, METALLIC_ROUGHNESS, NORMAL, OCCLUSION};
use rayon::prelude::*;

/// Of all hits of the shaded set that wait for it. `mores`: of the same hits, or of none.
pub fn sample(bound: &Bound, (gbuffer, mores): (&mut [GBuffer], &mut [More]), from: Sampling, demand: &[TileDemand]) {
    let width = (bound.params.width as usize).max(1);
    let lookups = Lookups { from, demand, takes_coarser: bound.has(PARAM_COARSER) };
    let rows = gbuffer.len().div_ceil(width);
    let none = (0..rows).map(|_| &mut [][..]);
    let of_rows: Vec<&mut [More]> = if mores.is_empty() { none.collect() } else { mores.chunks_mut(width).collect() };
    let all = gbuffer.par_chunks_mut(width).zip(of_rows).enumerate();
    all.for_each(|(row, (gbuffer, mores))| {
        let mut tally = Tally::default();
        for (x, g) in gbuffer.iter_mut().enumerate() {
            let index = (row * width + x) as u32;
            let mut is_coarser = mores.get_mut(x).is_some_and(|more| more::look_up(g, more, index, &lookups));
            g.state |= if is_coarser { GBUFFER_COARSER } else { 0 };
            if g.state & GBUFFER_WAITS != 0 {
                is_coarser |= look_up(g, index, &lookups);
            }
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

/// Of one hit, that of ray `index`; whether a coarser level stands for one that is missing.
pub(crate) fn look_up(g: &mut GBuffer, index: u32, lookups: &Lookups) -> bool {
    let m = &lookups.materials()[g.material as usize];
    let mut is_coarser = false;
    for which in 0..m.textures().len() {
        let bit = 1 << (GBUFFER_FIRST + which as u32);
        if g.state & bit == 0 {
            continue;
        }
        let Some((color, coarser)) = lookups.look_up(g, m, which, index) else { continue };
        is_coarser |= coarser;
        match which {
            BASE_COLOR => (0..3).for_each(|k| g.albedo[k] *= color[k]),
            NORMAL => g.normal = turned_normal(g.normal, g, [color[0], color[1], color[2]], m.normal_scale),
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
