//! What was met, as callers get it: weights of the source's vertices, and normals.

use super::Queries;
use crate::kernels::payloads::AttributeView;
use crate::output::npy::Hit;
use crate::stream::Item;
use anyhow::Result;
use bricks::SURFACE_ROTATION_SHIFT;
use glam::DVec3;

/// A triangle that was met.
pub(super) struct Met {
    /// By which ray.
    pub(super) item: usize,
    /// Where.
    pub(super) t: f64,
    /// Global id.
    pub(super) id: u32,
    /// Leaf of the top level.
    pub(super) leaf: u32,
    /// Triangle within its brick.
    pub(super) triangle: u32,
    /// Weights of the vertices as they are stored.
    pub(super) weights: [f64; 3],
    /// These, world units.
    pub(super) vertices: [DVec3; 3],
}

/// The unit normal of a triangle, right-handed about its vertices; zero without area.
pub(super) fn normal([a, b, c]: [DVec3; 3]) -> [f32; 3] {
    (b - a).cross(c - a).normalize_or_zero().as_vec3().to_array()
}

impl Queries {
    /// Of triangles in leaves, what turns their stored vertices into the source's: stored vertex i is the source's
    /// (i + rotation) mod 3. Reads the attributes of their bricks.
    ///
    /// # Errors
    /// A damaged brick.
    fn rotations(&self, triangles: &[(u32, u32)]) -> Result<Vec<usize>> {
        let resident = self.scene.resident();
        let brick = |number: usize| resident.leaves[triangles[number].0 as usize].brick;
        let mut order: Vec<usize> = (0..triangles.len()).collect();
        order.sort_unstable_by_key(|&number| (brick(number), number));
        let groups: Vec<&[usize]> = order.chunk_by(|&a, &b| brick(a) == brick(b)).collect();
        let items: Vec<Item> = groups.iter().map(|group| Item::attributes(brick(group[0]))).collect();
        let mut rotations = vec![0; triangles.len()];
        self.store.for_each(&items, |place, payloads| {
            for (payload, &group) in payloads.iter().zip(&groups[place..]) {
                let view = AttributeView::new(&resident.bricks[brick(group[0]) as usize], payload);
                for &number in group {
                    let word = view.surfaces[triangles[number].1 as usize];
                    rotations[number] = (word >> SURFACE_ROTATION_SHIFT) as usize;
                }
            }
            Ok(())
        })?;
        Ok(rotations)
    }

    /// Weights of vertices 1 and 2 of the source's order, of triangles in leaves with weights of their stored vertices.
    ///
    /// # Errors
    /// A damaged brick.
    pub(super) fn source_weights(&self, of: &[(u32, u32, [f64; 3])]) -> Result<Vec<[f32; 2]>> {
        let triangles: Vec<(u32, u32)> = of.iter().map(|&(leaf, triangle, _)| (leaf, triangle)).collect();
        let turned = |(rotation, &(_, _, weights)): (usize, &(u32, u32, [f64; 3]))| {
            [1, 2].map(|vertex: usize| weights[(vertex + 3 - rotation) % 3] as f32)
        };
        Ok(self.rotations(&triangles)?.into_iter().zip(of).map(turned).collect())
    }

    /// What was met as hits, in its order.
    ///
    /// # Errors
    /// A damaged brick.
    pub(super) fn hits(&self, all: &[Met]) -> Result<Vec<Hit>> {
        let of: Vec<_> = all.iter().map(|met| (met.leaf, met.triangle, met.weights)).collect();
        let hit =
            |(met, [u, v]): (&Met, [f32; 2])| Hit { t: met.t, triangle: met.id, u, v, normal: normal(met.vertices) };
        Ok(all.iter().zip(self.source_weights(&of)?).map(hit).collect())
    }
}
