//! Which vertices a part of a mesh uses. Exporters may share one large vertex buffer among many primitives; copying it
//! for each part would take memory out of proportion to the file, so only the vertices in use are read.

/// The vertices of some triangles.
#[derive(Debug, PartialEq)]
pub(super) struct Vertices<T = u64> {
    /// They, ascending, each once.
    pub used: Vec<T>,
    /// Three indices a triangle, into `used`.
    pub indices: Vec<u32>,
}

impl<T: Ord + Copy> Vertices<T> {
    /// Those of triangles with the given corners, fewer than 2^32.
    pub fn of(corners: Vec<T>) -> Self {
        let mut used = corners.clone();
        used.sort_unstable();
        used.dedup();
        // Present: `used` holds every corner.
        let indices = corners.iter().map(|corner| used.partition_point(|vertex| vertex < corner) as u32).collect();
        Self { used, indices }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_used_vertices_are_kept() {
        let vertices = Vertices::of(vec![90, 7, 90, 7, 50, 8]);
        assert_eq!(vertices, Vertices { used: vec![7, 8, 50, 90], indices: vec![3, 0, 3, 0, 2, 1] });
    }
}
