//! How large a part of a scene is.

use crate::frame::triangles::words;
use crate::scene::placement::affine;
use bricks::{Brick, Corners, Error, GeometryLayout, Payload, SceneFile};
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// Least and greatest coordinates.
type Box3 = [DVec3; 2];

fn joined(a: Option<Box3>, b: Option<Box3>) -> Option<Box3> {
    match (a, b) {
        (Some(a), Some(b)) => Some([a[0].min(b[0]), a[1].max(b[1])]),
        (a, b) => a.or(b),
    }
}

/// The bounds of the triangles of a node, by their global ids, world units; `None`: none is stored. All bricks of the
/// object that it is of are read: the file does not say which of them have parts of it.
///
/// # Errors
/// A brick that cannot be read.
pub fn extent(scene: &SceneFile, ids: &Range<u32>) -> Result<Option<Box3>, Error> {
    let resident = scene.resident();
    let of = |object: u32| &resident.objects[object as usize];
    // What is no other instance's is the world's.
    let own = |base: u32, object: u32| base..base.saturating_add(of(object).triangle_ids);
    let is_of = |instance: &&bricks::Instance| own(instance.base, instance.object).contains(&ids.start);
    let instance = resident.instances.iter().skip(1).find(is_of).or(resident.instances.first());
    let Some(instance) = instance else { return Ok(None) };
    let object = of(instance.object);
    let local = ids.start - instance.base..ids.end - instance.base;
    let world_from_object = affine(&instance.world_from_object);
    let last = object.first_brick + object.brick_count;
    let bricks = (object.first_brick..last).into_par_iter();
    bricks
        .map(|brick| within(scene, brick, &local, |p| world_from_object.transform_point3(p)))
        .try_reduce(|| None, |a, b| Ok(joined(a, b)))
}

/// The bounds of the triangles of a brick with these ids.
fn within(
    scene: &SceneFile,
    index: u32,
    ids: &Range<u32>,
    placed: impl Fn(DVec3) -> DVec3,
) -> Result<Option<Box3>, Error> {
    let resident = scene.resident();
    let brick: &Brick = &resident.bricks[index as usize];
    let object = &resident.objects[brick.object as usize];
    let geometry = words(scene, Payload::Geometry(index))?;
    let local_ids = &geometry[GeometryLayout::of(brick).ids as usize / 4..][..brick.triangle_count as usize];
    let corners = Corners::new(brick, bytemuck::cast_slice(&geometry));
    let [step, unit] = [object.step_log2, object.unit_log2].map(|log2| f64::from(log2).exp2());
    let origin = DVec3::from_array(brick.origin.map(|x| x as f64)) * step;
    let own = (0..brick.triangle_count).filter(|&triangle| ids.contains(&local_ids[triangle as usize]));
    let points = own.flat_map(|triangle| corners.of(triangle));
    let points = points.map(|p| placed(origin + DVec3::from_array(p) * unit));
    Ok(points.fold(None, |all, p| joined(all, Some([p, p]))))
}
