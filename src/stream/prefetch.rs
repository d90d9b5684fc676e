//! Prefetching: which bricks the camera's motion will bring into view next.
//!
//! Pure: views and boxes in, items out. The next view continues the motion between the last two; of the bricks whose
//! boxes meet its frustum, the nearest that are not at hand are read into the host cache while the next frame renders.
//! What hides what is not asked: a brick behind a wall is prefetched in vain, and nothing but time depends on it.

use std::collections::HashSet;

use bricks::{Resident, TOP_LEAF};
use glam::{DMat3, DVec3};

use super::item::Item;
use crate::scene::Camera;

/// A leaf of the top level: where in the world a brick lies. A brick of several instances has several.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrickBox {
    /// The brick.
    pub brick: u32,
    /// Least coordinates, world units.
    pub min: DVec3,
    /// Greatest coordinates, world units.
    pub max: DVec3,
}

impl BrickBox {
    /// The boxes of all leaves of a scene.
    pub fn of_scene(resident: &Resident) -> Vec<Self> {
        let step = resident.objects.first().map_or(1.0, |world| f64::from(world.step_log2).exp2());
        let point = |p: [i64; 3]| DVec3::from_array(p.map(|x| x as f64)) * step;
        let leaves = resident.top2.iter().filter(|node| node.right == TOP_LEAF);
        leaves
            .filter_map(|node| {
                let brick = resident.leaves.get(node.left as usize)?.brick;
                Some(Self { brick, min: point(node.min), max: point(node.max) })
            })
            .collect()
    }

    /// Squared distance from `p`, 0 inside.
    fn distance_squared(&self, p: DVec3) -> f64 {
        (p - p.clamp(self.min, self.max)).length_squared()
    }
}

/// The view that follows `before` and `now` when the camera goes on as it did between them: the same step, the same
/// turn in world space, the field of view of `now`. `None` for a camera at rest, which asks for nothing new, and for a
/// motion that leaves the range of f64.
pub fn predict(before: &Camera, now: &Camera) -> Option<Camera> {
    let axes = |camera: &Camera| {
        let (right, up, forward) = camera.frame();
        DMat3::from_cols(right, up, forward)
    };
    let (old, new) = (axes(before), axes(now));
    if before.position == now.position && old == new && before.fov_y == now.fov_y {
        return None;
    }
    let position = now.position + (now.position - before.position);
    // Both are orthonormal: the transpose is the inverse.
    let next = new * old.transpose() * new;
    let camera = Camera { position, target: position + next.z_axis, up: next.y_axis, fov_y: now.fov_y };
    camera.check().is_ok().then_some(camera)
}

/// The pyramid that a picture shows: four planes through the camera, without a far end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frustum {
    apex: DVec3,
    /// Inward normals of the sides, and the axis of view.
    normals: [DVec3; 5],
}

impl Frustum {
    /// Of a picture with `aspect` = width ÷ height.
    pub fn new(camera: &Camera, aspect: f64) -> Self {
        let (right, up, forward) = camera.frame();
        let y = (0.5 * camera.fov_y).tan();
        let x = y * aspect;
        // A point at apex + a·right + b·up + c·forward is inside where |a| ≤ x·c and |b| ≤ y·c.
        let normals = [forward * x - right, forward * x + right, forward * y - up, forward * y + up, forward];
        Self { apex: camera.position, normals }
    }

    /// Whether a box meets the frustum. Conservative: each plane is asked alone, so a box across an edge of the pyramid
    /// may be taken for one that meets it, and never the other way round.
    pub fn meets(&self, min: DVec3, max: DVec3) -> bool {
        self.normals.iter().all(|&normal| {
            let farthest = DVec3::select(normal.cmpge(DVec3::ZERO), max, min);
            normal.dot(farthest - self.apex) >= 0.0
        })
    }
}

/// The bricks with a box that meets the frustum of `camera`, each once, by the distance of its nearest such box, then
/// by number. `aspect` is width ÷ height.
pub fn nearest_in_view(boxes: &[BrickBox], camera: &Camera, aspect: f64) -> Vec<u32> {
    let frustum = Frustum::new(camera, aspect);
    let mut seen: Vec<(f64, u32)> = boxes
        .iter()
        .filter(|leaf| frustum.meets(leaf.min, leaf.max))
        .map(|leaf| (leaf.distance_squared(camera.position), leaf.brick))
        .collect();
    seen.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut named = HashSet::new();
    seen.into_iter().map(|(_, brick)| brick).filter(|&brick| named.insert(brick)).collect()
}

/// Watches the camera and says what to prefetch.
#[derive(Clone, Debug)]
pub struct Prefetcher {
    boxes: Vec<BrickBox>,
    aspect: f64,
    most: usize,
    last: Option<Camera>,
}

impl Prefetcher {
    /// At most `most` payloads a frame of the bricks in `boxes`, for pictures with `aspect` = width ÷ height.
    pub fn new(boxes: Vec<BrickBox>, aspect: f64, most: usize) -> Self {
        Self { boxes, aspect, most, last: None }
    }

    /// Takes the boxes of bricks that have moved, and of all others.
    pub fn set_boxes(&mut self, boxes: Vec<BrickBox>) {
        self.boxes = boxes;
    }

    /// Takes the view of the frame just rendered and returns what to have ready for the next one, most urgent first: of
    /// the bricks in the predicted view, near to far, the geometry and then the attributes, but for what is `at_hand`.
    /// Empty after the first frame and while the camera rests.
    pub fn after_frame(&mut self, camera: &Camera, at_hand: impl Fn(Item) -> bool) -> Vec<Item> {
        let next = self.last.replace(*camera).and_then(|before| predict(&before, camera));
        let Some(next) = next else { return Vec::new() };
        let bricks = nearest_in_view(&self.boxes, &next, self.aspect);
        let items = bricks.into_iter().flat_map(|brick| [Item::geometry(brick), Item::attributes(brick)]);
        items.filter(|&item| !at_hand(item)).take(self.most).collect()
    }
}
