//! What lookups read, textures with their tails and tiles where they lie, and what they ask of tiles.

use crate::kernels::layout;
use crate::kernels::textures::{UNASKED, record};
use crate::schedule::ExecutorError;
use bricks::{Material, Payload, SceneFile};
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
        scene.announce((0..resident.textures.len() as u32).map(Payload::Texture));
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
    /// Hits that wait for some tile and need this one.
    pub rays: AtomicU32,
    /// The least number of a ray among them.
    pub first: AtomicU32,
    /// 1: a lookup has read it.
    pub used: AtomicU32,
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
