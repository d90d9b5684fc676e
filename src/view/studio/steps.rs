//! What the rays of a picture meet of the top level.

use crate::scene::Camera;
use crate::scene::top_walk::TopWalk;
use bricks::Resident;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Pixel by pixel.
pub struct Steps {
    /// Nodes of the binary top level that the ray enters before it hits: none is visited less by any traversal.
    pub nodes: Vec<u32>,
    /// Bricks that rays of the pixel's tile enter before they hit: the pairs of tile and brick that are visible to
    /// queries (CHC+RT, section 3).
    pub bricks: Vec<u32>,
}

/// Of a picture of such a size, in square tiles of edge `tile`, whose pixels see so far.
pub fn steps(resident: &Resident, camera: &Camera, size: (u32, u32), tile: u32, depth: &[f32]) -> Steps {
    let basis = camera.ray_basis(size.0, size.1);
    let top = TopWalk::new(resident);
    let tiles_x = size.0.div_ceil(tile);
    let walk_tile = |number: u32| {
        let (x0, y0) = (number % tiles_x * tile, number / tiles_x * tile);
        let mut bricks = BTreeSet::new();
        let mut nodes = Vec::new();
        for (y, x) in (y0..size.1.min(y0 + tile)).flat_map(|y| (x0..size.0.min(x0 + tile)).map(move |x| (y, x))) {
            let index = (y * size.0 + x) as usize;
            let direction = basis.direction(f64::from(x) + 0.5, f64::from(y) + 0.5).normalize();
            let end = depth.get(index).map_or(f64::INFINITY, |&depth| f64::from(depth));
            let visited = top.walk(camera.position, direction, end, |leaf, _| {
                bricks.insert((leaf.instance, leaf.brick));
                end
            });
            nodes.push((index, visited));
        }
        (nodes, bricks.len() as u32)
    };
    let count = tiles_x * size.1.div_ceil(tile);
    let walked: Vec<_> = (0..count).into_par_iter().map(walk_tile).collect();
    let pixels = size.0 as usize * size.1 as usize;
    let mut steps = Steps { nodes: vec![0; pixels], bricks: vec![0; pixels] };
    for (nodes, bricks) in walked {
        for (index, visited) in nodes {
            (steps.nodes[index], steps.bricks[index]) = (visited, bricks);
        }
    }
    steps
}
