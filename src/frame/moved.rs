//! What has moved from one frame to the next.

use bricks::Resident;
use glam::{DAffine3, DMat3, DVec3};
use std::ops::Range;

/// How an instance has moved since the frame before.
#[derive(Clone, Debug, PartialEq)]
pub struct InstanceMotion {
    /// Global ids of its triangles.
    ids: Range<u32>,
    /// World of the frame before from world, of what is fixed to the instance.
    before_from_now: DAffine3,
    /// What turns normals along.
    normals: DMat3,
}

impl InstanceMotion {
    /// Where a point of it was.
    pub fn point(&self, p: DVec3) -> DVec3 {
        self.before_from_now.transform_point3(p)
    }

    /// Which way a unit normal of it had; a unit vector.
    pub fn turn(&self, normal: DVec3) -> DVec3 {
        (self.normals * normal).normalize_or(normal)
    }
}

/// What has moved since the frame before.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Moved {
    /// By ids, which do not overlap.
    instances: Vec<InstanceMotion>,
}

impl Moved {
    /// The instance whose triangles have `ids` has moved.
    pub(super) fn add(&mut self, ids: Range<u32>, before_from_now: DAffine3) {
        let normals = before_from_now.matrix3.inverse().transpose();
        let at = self.instances.partition_point(|one| one.ids.start < ids.start);
        self.instances.insert(at, InstanceMotion { ids, before_from_now, normals });
    }

    /// How the instance of a triangle has moved; `None`: it has not.
    pub fn of_triangle(&self, id: u32) -> Option<&InstanceMotion> {
        let after = self.instances.partition_point(|one| one.ids.start <= id);
        self.instances[..after].last().filter(|one| one.ids.contains(&id))
    }
}

/// Whether an instance stands elsewhere in one scene than in another.
pub(super) fn stands_elsewhere(one: &Resident, other: &Resident, instance: u32) -> bool {
    let matrix = |of: &Resident| of.instances[instance as usize].world_from_object;
    matrix(one) != matrix(other)
}

/// The instances that stand elsewhere now than in `still`, ascending.
pub(crate) fn displaced(still: &Resident, now: &Resident) -> Vec<u32> {
    (0..now.instances.len() as u32).filter(|&instance| stands_elsewhere(still, now, instance)).collect()
}
