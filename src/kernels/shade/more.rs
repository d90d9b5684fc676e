//! What the further textures of hits show: twin of `shaders/shade/more.wgsl`.

use crate::kernels::layout::{GBUFFER_FIRST, GBuffer, MATERIAL_MORE, MATERIAL_TEXTURES, More, NONE};
use crate::kernels::vector::Vec3;
use bricks::{Material, NORMAL, Resident};
use std::ops::Deref;

/// Of a material without further textures.
pub const WHOLE: More = More {
    specular: [1.0; 3],
    specular_weight: 1.0,
    sheen: [1.0; 3],
    sheen_roughness: 1.0,
    normal: [0.0; 3],
    coat: 1.0,
    along: [1.0, 0.0],
    anisotropy: 1.0,
    coat_roughness: 1.0,
    film: 1.0,
    film_thickness: 1.0,
    state: 0,
    padding0: 0,
};

/// Whether some material of the scene has further textures, or a coat with a normal of its own.
pub fn is_needed(resident: &Resident) -> bool {
    resident.materials.iter().any(|material| material.flags & MATERIAL_MORE != 0)
}

/// A hit as it is shaded: what its textures show, and its further ones where the scene has any.
#[derive(Clone, Copy)]
pub struct Shown<'a> {
    gbuffer: &'a GBuffer,
    more: Option<&'a More>,
}

impl<'a> Shown<'a> {
    /// Hit `index` of a set, of which these are the records.
    pub fn of(gbuffers: &'a [GBuffer], mores: &'a [More], index: usize) -> Self {
        Self { gbuffer: &gbuffers[index], more: mores.get(index) }
    }

    /// What its further textures show.
    pub fn more(&self, m: &Material) -> More {
        self.more.filter(|_| m.flags & MATERIAL_MORE != 0).copied().unwrap_or(WHOLE)
    }
}

impl Deref for Shown<'_> {
    type Target = GBuffer;

    fn deref(&self) -> &GBuffer {
        self.gbuffer
    }
}

impl<'a> From<&'a GBuffer> for Shown<'a> {
    /// Its further textures are white.
    fn from(gbuffer: &'a GBuffer) -> Self {
        Self { gbuffer, more: None }
    }
}

/// What a hit shows before its further textures are looked up, by its normal before its normal texture. `None`: it has
/// none.
pub fn start(g: &GBuffer, materials: &[Material], normal: Vec3) -> Option<More> {
    if materials[g.material as usize].flags & MATERIAL_MORE == 0 {
        return None;
    }
    let mut x = More { normal, ..WHOLE };
    for (place, texture) in (0..MATERIAL_TEXTURES as usize).zip(materials[g.material as usize + 1].textures()) {
        let wants_tangent = place == NORMAL && g.handedness == 0.0;
        if texture != NONE && !wants_tangent {
            x.state |= 1 << (GBUFFER_FIRST + place as u32);
        }
    }
    Some(x)
}
