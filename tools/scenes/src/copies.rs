//! The whole of a scene placed several times, side by side.

use crate::path::{CameraPath, around};
use crate::scene::{EMPTY, Scene, union};
use brickwalk_convert::source::Placement;
use glam::DVec3;

impl Scene {
    /// The scene placed `count` times in a square, the first where it was. Meshes are shared by all copies.
    pub(crate) fn copied(mut self, count: u32) -> Self {
        if count < 2 {
            return self;
        }
        let [low, high] = self.recipe.bounds().iter().copied().fold(EMPTY, union);
        let side = f64::from(count).sqrt().ceil() as u32;
        // The square reaches as far to both sides of the first copy, or one further.
        let along = |k: u32| f64::from(k.div_ceil(2)) * if k.is_multiple_of(2) { 1.0 } else { -1.0 };
        let place = |k: u32| DVec3::new(along(k % side), 0.0, along(k / side)) * (high - low);
        self.copies = (0..count).map(place).collect();
        let one = std::mem::take(&mut self.outline.placements);
        let placed = |to: &DVec3| {
            let mut copy = one.clone();
            for Placement { world_from_mesh: m, .. } in &mut copy {
                m[3] += to.x;
                m[7] += to.y;
                m[11] += to.z;
            }
            copy
        };
        self.outline.placements = self.copies.iter().flat_map(placed).collect();
        self
    }

    /// The path that has all copies in view.
    pub(crate) fn far_of_copies(&self) -> CameraPath {
        let shifted = |to: &DVec3| self.recipe.bounds().iter().map(|b| b.map(|p| p + *to)).collect::<Vec<_>>();
        let all: Vec<[DVec3; 2]> = self.copies.iter().flat_map(shifted).collect();
        let [low, high] = all.iter().copied().fold(EMPTY, union);
        let middle = 0.5 * (low + high);
        around(DVec3::new(middle.x, 0.25 * high.y, middle.z), &all, 26.0f64.to_radians(), 0.7)
    }
}
