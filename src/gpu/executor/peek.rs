//! What tests of kernels read back of the device.

use super::GpuExecutor;
use crate::kernels::layout;
use crate::schedule::ExecutorError;

/// Bounds, lists, entries and selection of all tiles.
type TilesRead = (Vec<layout::TileBounds>, Vec<layout::TileList>, Vec<layout::Entry>, Vec<u32>);

impl GpuExecutor {
    /// Reads the tiles back: bounds, lists, entries, selection.
    pub fn read_tiles(&mut self) -> Result<TilesRead, ExecutorError> {
        Ok((
            self.whole.read(&self.gpu, &self.buffers.tiles.bounds)?,
            self.whole.read(&self.gpu, &self.buffers.tiles.lists)?,
            self.whole.read(&self.gpu, &self.buffers.tiles.list)?,
            self.whole.read(&self.gpu, &self.buffers.tiles.selection)?,
        ))
    }

    /// The G-buffer of the hits of a set.
    pub fn read_gbuffer_of(&mut self, set: usize) -> Result<Vec<layout::GBuffer>, ExecutorError> {
        self.gbuffer_of(set)
    }

    /// Whether further textures are kept of a hit.
    pub fn keeps_more(&self, hit: &layout::GBuffer) -> bool {
        hit.state != 0 && self.scene.resident().materials[hit.material as usize].flags & layout::MATERIAL_MORE != 0
    }

    /// What further textures of the hits of a set show; empty in scenes without.
    pub fn read_more_of(&mut self, set: usize) -> Result<Vec<layout::More>, ExecutorError> {
        if !self.has_more() {
            return Ok(Vec::new());
        }
        let all: Vec<layout::GBuffer> = self.whole.read(&self.gpu, &self.buffers.pixels.gbuffers[set])?;
        Ok(all[all.len() / 2..].iter().take(self.rays_of(set)).map(kept).collect())
    }
}

/// What `shaders/shade/more_kept.wgsl` keeps in a record of the G-buffer.
fn kept(g: &layout::GBuffer) -> layout::More {
    let [coat, coat_roughness] = g.uv;
    let [anisotropy, film, film_thickness] = g.tangent;
    layout::More {
        specular: g.albedo,
        specular_weight: g.footprint,
        sheen: g.emission,
        sheen_roughness: g.handedness,
        normal: g.normal,
        coat,
        along: g.weights,
        anisotropy,
        coat_roughness,
        film,
        film_thickness,
        state: g.state,
        padding0: 0,
    }
}
