//! Instances placed anew between frames, and what was made of where they were.

use super::moved::stands_elsewhere;
use super::{Displaced, Renderer};
use crate::scene::placement::{affine, leaf_box};
use bricks::{PlaceError, Resident, SceneFile};
use glam::DVec3;
use std::sync::Arc;

/// The boxes of the bricks of instances, world units; `instances` ascend.
fn boxes(resident: &Resident, instances: &[u32]) -> Vec<[DVec3; 2]> {
    let leaves = resident.leaves.iter().filter(|leaf| instances.binary_search(&leaf.instance).is_ok());
    leaves.map(|leaf| leaf_box(resident, leaf)).collect()
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
            engine.moved.add(record.base..end, affine(&before) * affine(&now).inverse());
        }
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
