//! What the rays of a picture meet of the trees.

use crate::frame::triangles::words;
use crate::scene::Camera;
use crate::scene::brick_walk::BrickWalk;
use crate::scene::placement::{affine, leaf_box};
use crate::scene::top_walk::{Sight, TileFront, TopWalk, entering};
use bricks::{Error, Leaf, Payload, SceneFile};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU32, Ordering};

/// The camera rays of a picture, up to what they hit, in square tiles.
pub struct Sights<'a> {
    /// From where.
    pub camera: &'a Camera,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Edge of a tile in pixels.
    pub tile: u32,
    /// Distance of what each pixel shows, world units; empty: not known.
    pub depth: &'a [f32],
}

impl Sights<'_> {
    fn columns(&self) -> u32 {
        self.size.0.div_ceil(self.tile)
    }

    fn tiles(&self) -> u32 {
        self.columns() * self.size.1.div_ceil(self.tile)
    }

    /// The tile in the middle.
    pub fn middle(&self) -> u32 {
        let [x, y] = [self.size.0, self.size.1].map(|edge| edge / 2 / self.tile);
        y * self.columns() + x
    }

    /// Left upper corner and edge of a tile, pixels.
    pub fn square(&self, tile: u32) -> ([u32; 2], u32) {
        ([tile % self.columns(), tile / self.columns()].map(|at| at * self.tile), self.tile)
    }

    /// The pixels of a tile, and their rays.
    fn rays(&self, tile: u32) -> (Vec<usize>, Vec<Sight>) {
        let basis = self.camera.ray_basis(self.size.0, self.size.1);
        let ([x0, y0], edge) = self.square(tile);
        let [x1, y1] = [self.size.0.min(x0 + edge), self.size.1.min(y0 + edge)];
        let ray = |(x, y): (u32, u32)| {
            let index = (y * self.size.0 + x) as usize;
            let direction = basis.direction(f64::from(x) + 0.5, f64::from(y) + 0.5).normalize();
            (index, Sight { direction, end: self.depth.get(index).map_or(f64::INFINITY, |&depth| f64::from(depth)) })
        };
        (y0..y1).flat_map(|y| (x0..x1).map(move |x| (x, y))).map(ray).unzip()
    }

    /// The front of a tile.
    pub fn front(&self, top: &TopWalk, tile: u32) -> TileFront {
        top.front(self.camera.position, &self.rays(tile).1)
    }
}

/// Of each pixel of a picture.
#[derive(Debug)]
pub struct Steps {
    /// Nodes that the ray enters before it hits, of the binary top level and of bricks that are in the cache: none of
    /// these is left out by any traversal.
    pub nodes: Vec<u32>,
    /// Bricks that rays of the pixel's tile enter before they hit: its visible pairs.
    pub bricks: Vec<u32>,
}

/// What `sights` meet of a scene. Nodes are counted of bricks that `is_resident` says so of: those are read from the
/// file.
///
/// # Errors
/// A brick that cannot be read.
pub fn steps(scene: &SceneFile, is_resident: &(dyn Fn(u32) -> bool + Sync), sights: &Sights) -> Result<Steps, Error> {
    let resident = scene.resident();
    let top = TopWalk::new(resident);
    let fronts: Vec<TileFront> = (0..sights.tiles()).into_par_iter().map(|tile| sights.front(&top, tile)).collect();
    let pixels = sights.size.0 as usize * sights.size.1 as usize;
    let nodes: Vec<AtomicU32> = (0..pixels).map(|_| AtomicU32::new(0)).collect();
    let mut bricks = vec![0; pixels];
    // Where each brick is seen, and by which tiles.
    let mut seen: BTreeMap<u32, Vec<(&Leaf, u32)>> = BTreeMap::new();
    for (tile, front) in (0..).zip(&fronts) {
        for (&pixel, &entered) in sights.rays(tile).0.iter().zip(&front.entered) {
            bricks[pixel] = front.visible.len() as u32;
            nodes[pixel].store(entered, Ordering::Relaxed);
        }
        for leaf in front.visible.iter().filter_map(|&node| top.leaf(node)) {
            seen.entry(leaf.brick).or_default().push((leaf, tile));
        }
    }
    seen.retain(|&brick, _| is_resident(brick));
    let count = |(&index, places): (&u32, &Vec<(&Leaf, u32)>)| {
        let geometry = words(scene, Payload::Geometry(index))?;
        let brick = BrickWalk::new(resident, &resident.bricks[index as usize], &geometry);
        for &(leaf, tile) in places {
            let (pixels, mut rays) = sights.rays(tile);
            let all: Vec<u32> = (0..rays.len() as u32).collect();
            let own = entering(leaf_box(resident, leaf), sights.camera.position, &rays, &all);
            let object_from_world = affine(&resident.instances[leaf.instance as usize].world_from_object).inverse();
            let origin = object_from_world.transform_point3(sights.camera.position);
            rays.iter_mut().for_each(|ray| ray.direction = object_from_world.transform_vector3(ray.direction));
            pixels.iter().zip(brick.entered(origin, &rays, own)).for_each(|(&pixel, entered)| {
                nodes[pixel].fetch_add(entered, Ordering::Relaxed);
            });
        }
        Ok(())
    };
    seen.par_iter().try_for_each(count)?;
    Ok(Steps { nodes: nodes.into_iter().map(AtomicU32::into_inner).collect(), bricks })
}
