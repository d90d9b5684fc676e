//! What was met, as callers get it: weights of the source's vertices, and normals.

use super::Queries;
use crate::kernels::layout::NONE;
use crate::kernels::payloads::AttributeView;
use crate::output::npy::Hit;
use crate::stream::Item;
use anyhow::Result;
use bricks::SURFACE_ROTATION_SHIFT;
use glam::DVec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

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

/// Hits of which a thread looks up rotations at a time.
const TASK: usize = 4096;

impl Queries {
    /// Of each of `all`, which is a leaf and a triangle in it, what turns its stored vertices into the source's: stored
    /// vertex i is the source's (i + rotation) mod 3. Where there is no leaf it is 0. Reads the attributes of their
    /// bricks.
    ///
    /// # Errors
    /// A damaged brick.
    pub(super) fn rotations<T: Sync>(&self, all: &[T], of: impl Fn(&T) -> (u32, u32) + Sync) -> Result<Vec<u8>> {
        let resident = self.scene.resident();
        let brick = |leaf: u32| resident.leaves.get(leaf as usize).map_or(NONE, |leaf| leaf.brick);
        let is_met: Vec<AtomicBool> = resident.bricks.iter().map(|_| AtomicBool::new(false)).collect();
        let note = |one: &T| {
            if let Some(is_met) = is_met.get(brick(of(one).0) as usize)
                && !is_met.load(Ordering::Relaxed)
            {
                is_met.store(true, Ordering::Relaxed);
            }
        };
        self.threads.install(|| all.par_iter().with_min_len(TASK).for_each(note));
        let is_met = (0u32..).zip(is_met).filter(|(_, is_met)| is_met.load(Ordering::Relaxed));
        let items: Vec<Item> = is_met.map(|(brick, _)| Item::attributes(brick)).collect();
        let mut rotations = vec![0; all.len()];
        self.store.for_each(&items, |place, payloads| {
            // Those that are not at hand now have no surfaces.
            let mut views = vec![AttributeView::default(); resident.bricks.len()];
            for (item, payload) in items[place..].iter().zip(payloads) {
                let brick = item.number as usize;
                views[brick] = AttributeView::new(&resident.bricks[brick], payload);
            }
            let look = |(one, rotation): (&T, &mut u8)| {
                let (leaf, triangle) = of(one);
                if let Some(view) = views.get(brick(leaf) as usize)
                    && let Some(word) = view.surfaces.get(triangle as usize)
                {
                    *rotation = (word >> SURFACE_ROTATION_SHIFT) as u8;
                }
            };
            self.threads.install(|| all.par_iter().zip(&mut rotations).with_min_len(TASK).for_each(look));
            Ok(())
        })?;
        Ok(rotations)
    }

    /// Weights of vertices 1 and 2 of the source's order, of triangles in leaves with weights of their stored vertices.
    ///
    /// # Errors
    /// A damaged brick.
    pub(super) fn source_weights(&self, of: &[(u32, u32, [f64; 3])]) -> Result<Vec<[f32; 2]>> {
        let turned = |(rotation, &(_, _, weights)): (u8, &(u32, u32, [f64; 3]))| {
            [1, 2].map(|vertex: usize| weights[(vertex + 3 - usize::from(rotation)) % 3] as f32)
        };
        let rotations = self.rotations(of, |&(leaf, triangle, _)| (leaf, triangle))?;
        Ok(self.threads.install(|| rotations.into_par_iter().zip(of).map(turned).collect()))
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
