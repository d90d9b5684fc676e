//! Instances that move from frame to frame: the scene placed anew, and what was made of where they were.

use super::{Displaced, Renderer};
use bricks::{PlaceError, Resident, SceneFile};
use glam::{DAffine3, DMat3, DVec3};
use std::ops::Range;
use std::sync::Arc;

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
    /// How the instance of a triangle has moved; `None`: it has not.
    pub fn of_triangle(&self, id: u32) -> Option<&InstanceMotion> {
        let after = self.instances.partition_point(|one| one.ids.start <= id);
        self.instances[..after].last().filter(|one| one.ids.contains(&id))
    }
}

fn affine(m: &[f64; 12]) -> DAffine3 {
    let column = |k: usize| DVec3::new(m[k], m[4 + k], m[8 + k]);
    DAffine3::from_cols(column(0), column(1), column(2), column(3))
}

/// The boxes of the bricks of instances, world units; `instances` ascend.
fn boxes(resident: &Resident, instances: &[u32]) -> Vec<[DVec3; 2]> {
    let step = f64::from(resident.objects[0].step_log2).exp2();
    let leaves = resident.leaves.iter().filter(|leaf| instances.binary_search(&leaf.instance).is_ok());
    leaves.map(|leaf| resident.leaf_box(leaf).map(|p| DVec3::from_array(p.map(|x| x as f64)) * step)).collect()
}

/// Whether an instance stands elsewhere in one scene than in another.
fn stands_elsewhere(one: &Resident, other: &Resident, instance: u32) -> bool {
    let matrix = |of: &Resident| of.instances[instance as usize].world_from_object;
    matrix(one) != matrix(other)
}

/// The instances that stand elsewhere now than in `still`, ascending.
pub(crate) fn displaced(still: &Resident, now: &Resident) -> Vec<u32> {
    (0..now.instances.len() as u32).filter(|&instance| stands_elsewhere(still, now, instance)).collect()
}

impl Renderer {
    /// Places instances by new matrices, world_from_object, for the frames to come; `still` is the scene as it was
    /// opened. What was made of where those were that have moved is made anew when it is asked for. Returns which have
    /// moved, ascending. Lamps that move along are the caller's.
    ///
    /// # Errors
    /// As of [`SceneFile::place`]; then nothing has changed.
    pub fn place(&mut self, still: &Arc<SceneFile>, places: &[(u32, [f64; 12])]) -> Result<Vec<u32>, PlaceError> {
        let Self { engine, methods } = self;
        let resident = engine.scene.resident();
        let is_other = |(instance, matrix): &&(u32, [f64; 12])| {
            resident.instances.get(*instance as usize).is_none_or(|before| before.world_from_object != *matrix)
        };
        let mut moving: Vec<u32> = places.iter().filter(is_other).map(|(instance, _)| *instance).collect();
        moving.sort_unstable();
        moving.dedup();
        if moving.is_empty() {
            return Ok(moving);
        }
        let matrices = |resident: &Resident| {
            let matrix = |&instance: &u32| resident.instances.get(instance as usize).map(|one| one.world_from_object);
            moving.iter().map(matrix).collect::<Vec<_>>()
        };
        let before = matrices(resident);
        let mut touched = boxes(resident, &moving);
        // Nobody else holds the scene that frames before were of, but for the first time.
        let mut scene = std::mem::replace(&mut engine.scene, still.clone());
        engine.executor.set_scene(still);
        let placed = match Arc::get_mut(&mut scene) {
            Some(scene) => scene.place(places),
            None => {
                let mut copy = scene.duplicate();
                let placed = copy.place(places);
                scene = Arc::new(copy);
                placed
            }
        };
        engine.executor.set_scene(&scene);
        engine.scene = scene;
        placed?;
        let resident = engine.scene.resident();
        touched.extend(boxes(resident, &moving));
        for ((&instance, before), now) in moving.iter().zip(before).zip(matrices(resident)) {
            let (Some(before), Some(now)) = (before, now) else { continue };
            let record = &resident.instances[instance as usize];
            let end = record.base + resident.objects[record.object as usize].triangle_ids;
            let before_from_now = affine(&before) * affine(&now).inverse();
            let normals = before_from_now.matrix3.inverse().transpose();
            engine.moved.instances.push(InstanceMotion { ids: record.base..end, before_from_now, normals });
        }
        engine.moved.instances.sort_by_key(|one| one.ids.start);
        // A field of visibility is that of the scene as it was opened.
        let mut displaced: Vec<u32> = places.iter().map(|(instance, _)| *instance).collect();
        displaced.sort_unstable();
        let own = still.resident();
        displaced.retain(|&instance| stands_elsewhere(own, resident, instance));
        let mut elsewhere = boxes(own, &displaced);
        elsewhere.extend(boxes(resident, &displaced));
        let displaced = Displaced { still, instances: &displaced, boxes: &elsewhere, touched: &touched };
        methods.iter_mut().for_each(|method| method.scene_has_moved(&displaced));
        Ok(moving)
    }
}
