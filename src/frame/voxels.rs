//! What stands in for bricks that are missing where a scene has no levels of detail: the cells that their triangles
//! touch, which are always resident, in the mean colour of what was seen of them.

use super::{PixelState, Pixels};
use crate::kernels::FrameExecutor;
use crate::kernels::layout::{Hit, NONE, Surface};
use crate::scene::Camera;
use crate::scene::placement::affine;
use crate::scene::top_walk::{TopWalk, crossing};
use crate::schedule::{BrickStates, ExecutorError, Pass};
use bricks::{OCCUPANCY_CELLS, Occupancy, RESIDENT_LEVEL, Resident};
use glam::DVec3;
use rayon::prelude::*;

/// Cells on an axis.
const CELLS: i32 = (OCCUPANCY_CELLS >> RESIDENT_LEVEL) as i32;
/// Weight of the latest frame in the mean colour of a brick.
const LATEST: f32 = 0.5;
/// Of the light of a cell that is seen along its side, what a cell shows that is faced.
const EDGE_ON: f32 = 0.6;
/// Radiance of bricks before any has been seen.
const UNSEEN: [f32; 3] = [0.3; 3];

/// Mean colours of bricks.
#[derive(Debug)]
pub struct Voxels {
    /// Radiance of each brick that has been seen.
    colors: Vec<Option<[f32; 3]>>,
    /// Of all that was seen in the last frame.
    mean: [f32; 3],
}

/// What a ray meets first of a brick's cells.
struct Met {
    t: f64,
    /// Unit, world space, toward the ray's origin.
    normal: DVec3,
    brick: u32,
}

impl Voxels {
    /// Of a scene; without proxies nothing is known of bricks that are missing.
    pub fn new(resident: &Resident) -> Option<Self> {
        let has = resident.occupancy.len() == resident.bricks.len() && !resident.bricks.is_empty();
        has.then(|| Self { colors: vec![None; resident.bricks.len()], mean: UNSEEN })
    }

    /// Learns colours from the pixels of a frame that are exact, whose last camera rays hit these.
    fn learn(&mut self, resident: &Resident, pixels: &Pixels, hits: &[Hit], surfaces: &[Surface]) {
        let mut seen = vec![([0.0f32; 3], 0u32); self.colors.len()];
        let mut all = ([0.0f64; 3], 0u32);
        for (pixel, (hit, surface)) in hits.iter().zip(surfaces).enumerate() {
            let leaf = resident.leaves.get(surface.leaf as usize);
            let Some(leaf) = leaf.filter(|_| hit.id != NONE && pixels.state[pixel] == PixelState::Exact) else {
                continue;
            };
            let own = &mut seen[leaf.brick as usize];
            for k in 0..3 {
                own.0[k] += pixels.radiance[pixel][k];
                all.0[k] += f64::from(pixels.radiance[pixel][k]);
            }
            (own.1, all.1) = (own.1 + 1, all.1 + 1);
        }
        if all.1 > 0 {
            self.mean = all.0.map(|sum| (sum / f64::from(all.1)) as f32);
        }
        for (color, (sum, count)) in self.colors.iter_mut().zip(seen).filter(|(_, (_, count))| *count > 0) {
            let now = sum.map(|x| x / count as f32);
            let before = color.unwrap_or(now);
            *color = Some(std::array::from_fn(|k| before[k] + LATEST * (now[k] - before[k])));
        }
    }

    /// Puts cells of missing bricks where pixels are not resolved by their camera rays, `asks`: those are bounded then.
    /// Rays that pass by all cells keep what they show.
    ///
    /// # Errors
    /// The device's.
    pub fn stand_in(
        &mut self,
        (resident, states): (&Resident, &BrickStates),
        executor: &mut dyn FrameExecutor,
        (camera, size): (&Camera, (u32, u32)),
        asks: &[bool],
        pixels: &mut Pixels,
    ) -> Result<(), ExecutorError> {
        self.learn(resident, pixels, &executor.read_hits(Pass::Primary)?, &executor.read_surfaces(Pass::Primary)?);
        if !asks.contains(&true) {
            return Ok(());
        }
        let is_missing =
            |brick: u32| states.geometry(brick as usize).is_none() || states.attributes(brick as usize).is_none();
        let (basis, top) = (camera.ray_basis(size.0, size.1), TopWalk::new(resident));
        let meet = |pixel: usize| {
            let (x, y) = ((pixel as u32 % size.0) as f64 + 0.5, (pixel as u32 / size.0) as f64 + 0.5);
            let direction = basis.direction(x, y).normalize();
            let mut end = pixels.depth.get(pixel).map_or(f64::INFINITY, |&depth| f64::from(depth));
            let mut met = None;
            top.walk(camera.position, direction, end, |leaf, range| {
                if is_missing(leaf.brick)
                    && let Some(own) =
                        cells_met(resident, leaf, camera.position, direction, [range[0], range[1].min(end)])
                {
                    end = own.t;
                    met = Some(own);
                }
                end
            });
            met.map(|met| (met, direction))
        };
        let asking: Vec<usize> = (0..asks.len()).filter(|&pixel| asks[pixel]).collect();
        let met: Vec<_> = asking.par_iter().map(|&pixel| meet(pixel)).collect();
        for (&pixel, met) in asking.iter().zip(met) {
            let Some((Met { t, normal, brick }, direction)) = met else { continue };
            let facing = EDGE_ON + (1.0 - EDGE_ON) * normal.dot(direction).abs() as f32;
            pixels.radiance[pixel] = self.colors[brick as usize].unwrap_or(self.mean).map(|c| c * facing);
            if let (Some(depth), Some(own)) = (pixels.depth.get_mut(pixel), pixels.normal.get_mut(pixel)) {
                (*depth, *own) = (t as f32, normal.as_vec3().to_array());
            }
        }
        Ok(())
    }
}

/// What a ray meets of the cells of a leaf's brick within a range.
fn cells_met(
    resident: &Resident,
    leaf: &bricks::Leaf,
    origin: DVec3,
    direction: DVec3,
    range: [f64; 2],
) -> Option<Met> {
    let Occupancy { cell_log2, origin: first, bits, .. } = &resident.occupancy[leaf.brick as usize];
    let world_from_object = affine(&resident.instances[leaf.instance as usize].world_from_object);
    let object_from_world = world_from_object.inverse();
    // In cells from the lower corner of the grid.
    let cell = f64::from(cell_log2 + RESIDENT_LEVEL as i32).exp2();
    let corner = DVec3::from_array(first.map(|x| x as f64)) * f64::from(*cell_log2).exp2();
    let from = (object_from_world.transform_point3(origin) - corner) / cell;
    let along = object_from_world.transform_vector3(direction) / cell;
    let inverse = along.recip();
    let grid = [DVec3::ZERO, DVec3::splat(f64::from(CELLS))];
    let [start, end] = crossing(grid, from, inverse, range)?;
    let step = along.to_array().map(|x| if x > 0.0 { 1 } else { -1 });
    let at = (from + along * start).to_array();
    let mut index: [i32; 3] = at.map(|x| (x.floor() as i32).clamp(0, CELLS - 1));
    // Where the ray leaves the cell along each axis.
    let leaves = |k: usize, index: i32| {
        let wall = f64::from(index + i32::from(step[k] > 0));
        if along[k] == 0.0 { f64::INFINITY } else { (wall - from[k]) * inverse[k] }
    };
    let mut next: [f64; 3] = std::array::from_fn(|k| leaves(k, index[k]));
    // The side that the grid is entered through.
    let entry = |k: usize| ((if step[k] > 0 { 0.0 } else { f64::from(CELLS) }) - from[k]) * inverse[k];
    let mut axis = (0..3).max_by(|&a, &b| entry(a).total_cmp(&entry(b))).unwrap_or(0);
    let mut t = start;
    loop {
        let bit = (index[2] + CELLS * (index[0] + CELLS * index[1])) as usize;
        if bits[bit / 8] >> (bit % 8) & 1 != 0 {
            let mut normal = [0.0; 3];
            normal[axis] = -f64::from(step[axis]);
            // Normals go by the inverse transpose.
            let normal = object_from_world.matrix3.transpose() * DVec3::from_array(normal);
            return Some(Met { t, normal: normal.normalize(), brick: leaf.brick });
        }
        axis = (0..3).min_by(|&a, &b| next[a].total_cmp(&next[b]))?;
        t = next[axis];
        index[axis] += step[axis];
        if t > end || !(0..CELLS).contains(&index[axis]) {
            return None;
        }
        next[axis] = leaves(axis, index[axis]);
    }
}
