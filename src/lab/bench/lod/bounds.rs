//! How far levels of detail may lie from the bricks that they stand for.

use super::plan::Way;
use crate::kernels::levels::stretch;
use crate::scene::placement::leaf_box;
use bricks::{NONE, Resident};
use glam::DVec3;
use std::collections::HashMap;

/// Bounds of the levels that a camera's rays take in the place of bricks.
pub struct Bounds<'a> {
    /// With levels in use.
    resident: &'a Resident,
    parents: Vec<u32>,
    /// Leaves of the top level by instance and brick.
    leaves: HashMap<(u32, u32), u32>,
    eye: DVec3,
    /// Width of a ray's cone over its length, times the tolerance.
    slope: f64,
    known: HashMap<(u32, u32), f64>,
}

impl<'a> Bounds<'a> {
    /// Those of rays from `eye`, of pixels of `angle` radians; levels are in use.
    pub fn new(resident: &'a Resident, eye: DVec3, angle: f64, way: Way) -> Self {
        let leaves = (0..).zip(&resident.leaves).map(|(index, leaf)| ((leaf.instance, leaf.brick), index)).collect();
        let parents = resident.level_parents();
        Self { resident, parents, leaves, eye, slope: way.pixels * angle, known: HashMap::new() }
    }

    /// The greatest distance, world units, of the level that rays take in the place of a brick from it; 0 where they
    /// take the brick. With blending they may take a finer one.
    pub fn of(&mut self, instance: u32, brick: u32) -> f64 {
        if let Some(&bound) = self.known.get(&(instance, brick)) {
            return bound;
        }
        let (resident, first) = (self.resident, self.resident.exact_bricks());
        let mut bound = 0.0;
        let mut at = self.leaves.get(&(instance, brick)).map_or(NONE, |&leaf| self.parents[leaf as usize]);
        // Errors grow and boxes nest toward the root, so that the first one that is too coarse ends the way.
        while at != NONE {
            let leaf = &resident.leaves[at as usize];
            let Some(level) = (leaf.brick as usize).checked_sub(first).and_then(|level| resident.levels.get(level))
            else {
                break;
            };
            let scale = stretch(&resident.instances[leaf.instance as usize]);
            let [min, max] = leaf_box(resident, leaf);
            let distance = self.eye.distance(self.eye.clamp(min, max));
            if level.error * scale > self.slope * distance {
                break;
            }
            bound = level.bound * scale;
            at = self.parents[at as usize];
        }
        self.known.insert((instance, brick), bound);
        bound
    }
}
