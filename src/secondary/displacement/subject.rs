//! What a field is of: an object, or a brick of it.

use super::ball::{Ball, Outermost};
use crate::kernels::frame::is_stretched;
use crate::kernels::layout::NONE;
use crate::scene::placement::affine;
use bricks::{Corners, Instance, Payload, Resident, SceneFile};
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;

/// Whether an instance is turned, moved and scaled alike on all axes, so that spheres stay spheres.
pub fn is_similarity(instance: &Instance) -> bool {
    !is_stretched(&affine(&instance.world_from_object).matrix3)
}

/// What a field is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Subject {
    /// The object.
    pub object: u32,
    /// One brick of it, else all.
    pub brick: Option<u32>,
}

impl Subject {
    /// By which scene files have fields in order.
    pub fn order(self) -> (u32, u32) {
        (self.object, self.brick.unwrap_or(NONE))
    }

    /// Its bricks.
    pub fn bricks(self, resident: &Resident) -> Range<u32> {
        match self.brick {
            Some(brick) => brick..brick + 1,
            None => {
                let object = &resident.objects[self.object as usize];
                object.first_brick..object.first_brick + object.brick_count
            }
        }
    }

    /// A small sphere around it, object units.
    ///
    /// # Errors
    /// A brick that cannot be read.
    pub fn ball(self, scene: &SceneFile) -> Result<Ball, bricks::Error> {
        let bricks: Vec<u32> = self.bricks(scene.resident()).collect();
        let each = |brick: &u32| {
            let mut outermost = Outermost::default();
            corners(scene, *brick, &mut |point| outermost.add(point)).map(|()| outermost)
        };
        let all = bricks.par_iter().map(each).collect::<Result<Vec<_>, _>>()?;
        let mut outermost = Outermost::default();
        all.iter().flat_map(Outermost::points).for_each(|point| outermost.add(point));
        let center = outermost.center().unwrap_or_default();
        let farthest = |brick: &u32| {
            let mut farthest = 0.0f64;
            corners(scene, *brick, &mut |point| farthest = farthest.max(point.distance_squared(center)))?;
            Ok(farthest)
        };
        let all = bricks.par_iter().map(farthest).collect::<Result<Vec<f64>, bricks::Error>>()?;
        Ok(Ball::new(center, all.into_iter().fold(0.0, f64::max).sqrt()))
    }
}

/// Tells the corners of all triangles of a brick, object units.
fn corners(scene: &SceneFile, number: u32, take: &mut dyn FnMut(DVec3)) -> Result<(), bricks::Error> {
    let payload = Payload::Geometry(number);
    let mut bytes = vec![0; scene.loaded_bytes(payload) as usize];
    scene.copy(payload, &mut bytes)?;
    let brick = &scene.resident().bricks[number as usize];
    let object = &scene.resident().objects[brick.object as usize];
    let [step, unit] = [object.step_log2, object.unit_log2].map(|log2| f64::from(log2).exp2());
    let corners = Corners::new(brick, &bytes);
    for triangle in 0..brick.triangle_count {
        for corner in corners.of(triangle) {
            take(DVec3::from_array(std::array::from_fn(|k| brick.origin[k] as f64 * step + corner[k] * unit)));
        }
    }
    Ok(())
}
