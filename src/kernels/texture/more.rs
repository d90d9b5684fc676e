//! Looks up the further textures of hits: twin of `shaders/texture/more.wgsl`.

use super::look_up::{Lookups, turned_normal};
use crate::kernels::layout::{
    GBUFFER_FIRST, GBUFFER_READ, GBUFFER_WAITS, GBuffer, MATERIAL_MORE, MATERIAL_TEXTURES, More,
};
use bricks::{BASE_COLOR, METALLIC_ROUGHNESS, NORMAL, OCCLUSION};

/// Of hit `index`; whether a coarser level stands for one that is missing.
pub fn look_up(g: &GBuffer, x: &mut More, index: u32, lookups: &Lookups) -> bool {
    let materials = lookups.materials();
    let has_more = materials[g.material as usize].flags & MATERIAL_MORE != 0;
    if g.state & GBUFFER_READ == 0 || !has_more || x.state & GBUFFER_WAITS == 0 {
        return false;
    }
    let m = &materials[g.material as usize + 1];
    let mut is_coarser = false;
    for which in 0..MATERIAL_TEXTURES as usize {
        let bit = 1 << (GBUFFER_FIRST + which as u32);
        if x.state & bit == 0 {
            continue;
        }
        let Some((color, coarser)) = lookups.look_up(g, m, which, index) else { continue };
        is_coarser |= coarser;
        let [red, green, blue, alpha] = color;
        let rgb = [red, green, blue];
        match which {
            BASE_COLOR => (x.specular, x.specular_weight) = (rgb, alpha),
            NORMAL => x.normal = turned_normal(x.normal, g, rgb, m.normal_scale),
            METALLIC_ROUGHNESS => [x.coat, x.coat_roughness, x.film, x.film_thickness] = color,
            OCCLUSION => (x.along, x.anisotropy) = ([red, green].map(|c| 2.0 * c - 1.0), blue),
            _ => (x.sheen, x.sheen_roughness) = (rgb, alpha),
        }
        x.state &= !bit;
    }
    is_coarser
}
