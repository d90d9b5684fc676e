//! Distances in f64: where the given ray meets the plane of the triangle that was found.
//!
//! The triangle is that of the file, on its lattice. The device has decided in f32 whether the ray hits it, so the f64
//! ray may pass beside it by a rounding, and at a grazing triangle its plane is then met far away. What is met outside
//! of the triangle's box, widened by f32 roundings, is not the hit: then the device's distance stands.

use super::given::{Scaled, Surroundings};
use super::{Found, Traced};
use crate::kernels::frame::Frame;
use crate::output::npy::{Hit, Ray};
use crate::stream::Item;
use anyhow::Result;
use bricks::{Corners, INSTANCE_IDENTITY, Payload, Resident, SceneFile};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Arc;

/// Of distances: f32 roundings of a ray and of what it meets (src/reference/bounds.rs), with a wide margin.
const ROUNDING: f64 = 1.0 / (1u32 << 19) as f64;

/// Gives the `hits` of rays their distances and normals in f64. The geometry of every brick that was hit is read once
/// more, from the host's cache or from the file.
///
/// # Errors
/// A damaged brick.
pub(super) fn refine(traced: &Traced, rays: &[Ray], mut found: Vec<Found>, hits: &mut [Hit]) -> Result<()> {
    let (scene, host) = (traced.scene, traced.executor.workers().host_cache());
    let resident = scene.resident();
    let Some(surroundings) = Surroundings::new(resident) else { return Ok(()) };
    let brick_of = |found: &Found| resident.leaves[found.leaf as usize].brick;
    found.sort_unstable_by_key(|found| (brick_of(found), found.ray));
    let groups: Vec<&[Found]> = found.chunk_by(|a, b| brick_of(a) == brick_of(b)).collect();
    let of_group = |group: &&[Found]| -> Result<Vec<(usize, f64, DVec3)>> {
        let number = brick_of(&group[0]);
        let held = host.get(Item::geometry(number));
        let bytes = held.map_or_else(|| read(scene, number), Ok)?;
        let corners = Corners::new(&resident.bricks[number as usize], &bytes);
        let one = |found: &Found| {
            let points = vertices(resident, found, &corners);
            let (t, normal) = meet(resident, &surroundings, &rays[found.ray], found.t, points);
            (found.ray, t, normal)
        };
        Ok(group.iter().map(one).collect())
    };
    let refined: Vec<Vec<(usize, f64, DVec3)>> = groups.par_iter().map(of_group).collect::<Result<_>>()?;
    for (ray, t, normal) in refined.into_iter().flatten() {
        (hits[ray].t, hits[ray].normal) = (t, normal.as_vec3().to_array());
    }
    Ok(())
}

/// The geometry of a brick.
fn read(scene: &SceneFile, brick: u32) -> Result<Arc<[u8]>> {
    let payload = Payload::Geometry(brick);
    let mut bytes = vec![0; scene.loaded_bytes(payload) as usize];
    scene.copy(payload, &mut bytes)?;
    Ok(bytes.into())
}

/// The stored vertices of the triangle that was found, world units.
fn vertices(resident: &Resident, found: &Found, corners: &Corners) -> [DVec3; 3] {
    let leaf = resident.leaves[found.leaf as usize];
    let (brick, instance) = (&resident.bricks[leaf.brick as usize], &resident.instances[leaf.instance as usize]);
    let object = &resident.objects[brick.object as usize];
    let [step, unit] = [object.step_log2, object.unit_log2].map(|log2| f64::from(log2).exp2());
    let m = &instance.world_from_object;
    corners.of(found.triangle).map(|corner| {
        let p: [f64; 3] = std::array::from_fn(|k| brick.origin[k] as f64 * step + corner[k] * unit);
        if instance.flags & INSTANCE_IDENTITY != 0 {
            return DVec3::from_array(p);
        }
        let row = |k: usize| m[4 * k] * p[0] + m[4 * k + 1] * p[1] + m[4 * k + 2] * p[2] + m[4 * k + 3];
        DVec3::new(row(0), row(1), row(2))
    })
}

/// Distance at which `ray` meets the triangle that the device found at `found`, counted from the ray's near origin, and
/// the triangle's unit normal.
fn meet(resident: &Resident, surroundings: &Surroundings, ray: &Ray, found: f64, vertices: [DVec3; 3]) -> (f64, DVec3) {
    let [a, b, c] = vertices;
    // Of the order of the source, which storing only turns: about it the normal is right-handed.
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let Some(near) = surroundings.approach(ray) else { return (found, normal) };
    let origin = DVec3::from_array(near.ray.origin);
    let scaled = Scaled::of(ray.direction);
    let [a, b, c] = vertices.map(|vertex| vertex - origin);
    let across = (b - a).cross(c - a);
    let plane = across.dot(a) / across.dot(scaled.direction);
    let reference = Frame::near(resident, origin).origin;
    let reach = [a, b, c, origin - reference].map(|v| v.abs().max_element()).into_iter().fold(0.0, f64::max);
    let slack = ROUNDING * reach * resident.manifest.instance_scale_ratio;
    let (min, max) = (a.min(b).min(c) - slack, a.max(b).max(c) + slack);
    let point = scaled.direction * plane;
    let is_there = point.cmpge(min).all() && point.cmple(max).all();
    let local = if is_there { scaled.given(plane) } else { found };
    ((near.start + local).max(ray.t_min.max(0.0)).min(ray.t_max), normal)
}
