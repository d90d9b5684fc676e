//! What tests of kernels read back of the device.

use super::GpuExecutor;
use crate::kernels::layout;
use crate::schedule::ExecutorError;
use crate::secondary::df::device::Field;
use crate::secondary::roma::device::Roma;

/// Bounds, lists, entries and selection of all tiles.
type TilesRead = (Vec<layout::TileBounds>, Vec<layout::TileList>, Vec<layout::Entry>, Vec<u32>);

impl GpuExecutor {
    /// Reads the tiles back: bounds, lists, entries, selection.
    pub fn read_tiles(&mut self) -> Result<TilesRead, ExecutorError> {
        Ok((
            self.read(|s| &s.buffers.tiles.bounds)?,
            self.read(|s| &s.buffers.tiles.lists)?,
            self.read(|s| &s.buffers.tiles.list)?,
            self.read(|s| &s.buffers.tiles.selection)?,
        ))
    }

    /// The G-buffer of the hits of a set.
    pub fn read_gbuffer_of(&mut self, set: usize) -> Result<Vec<layout::GBuffer>, ExecutorError> {
        self.read(|s| &s.buffers.pixels.gbuffers[set])
    }

    /// The columns of the ray-aligned maps that were made last.
    pub fn read_columns(&mut self) -> Result<Vec<u32>, ExecutorError> {
        let Some(Roma { columns, maps, .. }) = &self.roma else { return Ok(Vec::new()) };
        self.read_words((columns, maps.words() as usize))
    }

    /// The words of the distance fields that were made last.
    pub fn read_distances(&mut self) -> Result<Vec<u32>, ExecutorError> {
        let Some(Field { distances, maps, .. }) = &self.field else { return Ok(Vec::new()) };
        self.read_words((distances, maps.distance_words() as usize))
    }

    /// The texels of reflective shadow maps.
    pub fn read_rsm_texels(&mut self) -> Result<Vec<layout::RsmTexel>, ExecutorError> {
        let Some(rsm) = &self.rsm else { return Ok(Vec::new()) };
        let bytes = self.readback.read(&self.gpu, &rsm.texels)?;
        Ok(bytemuck::pod_collect_to_vec(&bytes))
    }

    /// The bits of rays that wait for bricks.
    pub fn read_dvf_waiting(&mut self) -> Result<Vec<u32>, ExecutorError> {
        self.dvf.as_ref().map_or(Ok(Vec::new()), |dvf| self.read_words(dvf.waiting()))
    }
}
