//! What every importer gives: an opened file, whose geometry is read part by part.

use super::error::ImportError;
use crate::source::{Outline, Primitive, SourceError, SourceTexture};

/// Largest number of triangles over all placements: ids are u32 and 4294967295 means "none".
const MAX_TRIANGLES: u64 = u32::MAX as u64 - 1;

/// An opened file: a scene of its own.
pub(super) struct Opened {
    pub outline: Outline,
    pub parts: Box<dyn Parts>,
}

/// What an opened file holds; see [`Source`](crate::source::Source).
pub(super) trait Parts: Send + Sync {
    /// The triangles of part `part` of mesh `mesh`.
    fn part(&self, mesh: usize, part: usize) -> Result<Primitive, SourceError>;

    /// The file as messages show it.
    fn label(&self) -> &str;

    /// The number in the file of vertex `vertex` of a part: in its primitive, from 0. `None`: the part cannot be read
    /// again.
    fn vertex(&self, mesh: usize, part: usize, vertex: u32) -> Option<u64>;

    /// The texels of texture `index`.
    fn texture(&self, index: usize) -> Result<SourceTexture, SourceError>;

    /// What was repaired in the parts read so far.
    fn repairs(&self) -> Vec<String>;
}

/// Triangles of all placements so far.
pub(super) struct TriangleBudget {
    used: u64,
}

impl TriangleBudget {
    /// None so far.
    pub fn new() -> Self {
        Self { used: 0 }
    }

    /// Adds `count` placements of `triangles` triangles each, from `file`.
    pub fn add(&mut self, file: &str, count: u64, triangles: u64) -> Result<(), ImportError> {
        self.used = self.used.saturating_add(count.saturating_mul(triangles));
        if self.used > MAX_TRIANGLES {
            return Err(ImportError::TooManyTriangles { file: file.to_owned(), triangles: self.used });
        }
        Ok(())
    }
}
