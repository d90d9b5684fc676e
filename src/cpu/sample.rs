//! Looks up the textures of hits whose tiles are resident together; the others ask for all of theirs and wait: twin of
//! `shaders/sample.wgsl`.

use super::scene::Bound;
use super::texture::{Level, color_at, level_at, levels_of, tile_at};
use super::vector::mix;
use crate::kernel::layout::{self, GBUFFER_READ, GBUFFER_WAITS, GBuffer, NONE};
use crate::kernel::textures::{UNASKED, record};
use crate::schedule::ExecutorError;
use bricks::{Material, Payload, SceneFile};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// Materials, textures and their tails, resident throughout.
pub struct Texels {
    /// Materials.
    pub materials: Vec<Material>,
    /// Textures.
    pub textures: Vec<layout::Texture>,
    /// Words of the tails.
    pub tails: Vec<Vec<u32>>,
    /// Bytes of tails.
    pub bytes: u64,
}

impl Texels {
    /// Reads and verifies every tail.
    ///
    /// # Errors
    /// A texture that cannot be read or verified.
    pub fn new(scene: &SceneFile) -> Result<Self, ExecutorError> {
        let resident = scene.resident();
        let read = |(i, texture): (u32, &bricks::Texture)| {
            let mut words = vec![0u32; texture.tail.bytes as usize / 4];
            scene
                .copy(Payload::Texture(i), bytemuck::cast_slice_mut(&mut words))
                .map_err(|error| ExecutorError::Device(format!("failed: {error}")))?;
            Ok(words)
        };
        Ok(Self {
            materials: resident.materials.clone(),
            // A tail is a page of its own.
            textures: (0u32..).zip(&resident.textures).map(|(i, texture)| record(texture, i, 0)).collect(),
            tails: (0u32..).zip(&resident.textures).map(read).collect::<Result<_, ExecutorError>>()?,
            bytes: resident.textures.iter().map(|texture| texture.tail.bytes).sum(),
        })
    }
}

/// What lookups read: textures with their tails, and tiles where they lie; empty of those that are not resident.
#[derive(Clone, Copy)]
pub struct Sampling<'a> {
    /// What is resident throughout.
    pub texels: &'a Texels,
    /// Words of the tiles.
    pub tiles: &'a [&'a [u32]],
}

/// What is asked of a tile.
pub struct TileDemand {
    rays: AtomicU32,
    first: AtomicU32,
    used: AtomicU32,
}

impl Default for TileDemand {
    fn default() -> Self {
        let layout::TileDemand { rays, first, used } = UNASKED;
        Self { rays: rays.into(), first: first.into(), used: used.into() }
    }
}

impl TileDemand {
    /// What was asked.
    pub fn get(&self) -> layout::TileDemand {
        let [rays, first, used] = [&self.rays, &self.first, &self.used].map(|x| x.load(Ordering::Relaxed));
        layout::TileDemand { rays, first, used }
    }
}

/// Of all hits of the shaded set that wait for it.
pub fn sample(bound: &Bound, gbuffer: &mut [GBuffer], from: Sampling, demand: &[TileDemand]) {
    let width = bound.params.width as usize;
    gbuffer.par_chunks_mut(width.max(1)).enumerate().for_each(|(row, gbuffer)| {
        for (x, g) in gbuffer.iter_mut().enumerate().filter(|(_, g)| g.state == GBUFFER_WAITS) {
            look_up(g, (row * width + x) as u32, from, demand);
        }
    });
}

/// Of one hit, that of ray `index`.
pub(super) fn look_up(g: &mut GBuffer, index: u32, from: Sampling, demand: &[TileDemand]) {
    let t = &from.texels.textures[from.texels.materials[g.material as usize].base_color_texture as usize];
    let levels = levels_of(t, g.footprint);
    let around = [0, 1].map(|n| if n < levels.count { level_at(t, levels.finer + n, g.uv) } else { Level::default() });
    let around = &around[..levels.count as usize];
    let tiles = || around.iter().flat_map(|level| (0..4).map(|k| tile_at(level, k))).filter(|&tile| tile != NONE);
    let is_missing = tiles().any(|tile| from.tiles[tile as usize].is_empty());
    for tile in tiles() {
        let asked = &demand[tile as usize];
        if is_missing {
            asked.rays.fetch_add(1, Ordering::Relaxed);
            asked.first.fetch_min(index, Ordering::Relaxed);
        } else if asked.used.load(Ordering::Relaxed) == 0 {
            asked.used.store(1, Ordering::Relaxed);
        }
    }
    if is_missing {
        return;
    }
    let mut color = color_at(t, &around[0], from);
    if let Some(coarser) = around.get(1) {
        let other = color_at(t, coarser, from);
        color = [0, 1, 2, 3].map(|k| mix(color[k], other[k], levels.share));
    }
    (0..3).for_each(|k| g.albedo[k] *= color[k]);
    g.state = GBUFFER_READ;
}
