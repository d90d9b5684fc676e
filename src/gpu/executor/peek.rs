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
        self.whole.read(&self.gpu, &self.buffers.pixels.gbuffers[set])
    }
}
