//! Walks of a brick's tree on the host, in f64: for what pictures show of it, not for hits.

use super::top_walk::{Sight, entering};
use bricks::{Brick, NODE_WIDTH, Node, Resident};
use glam::DVec3;

/// The tree of a brick.
#[derive(Clone, Copy)]
pub struct BrickWalk<'a> {
    nodes: &'a [Node],
    /// Where the nodes are relative to, and what a device unit is, object units.
    origin: DVec3,
    unit: f64,
}

impl<'a> BrickWalk<'a> {
    /// Of a brick, from the words of its geometry.
    pub fn new(resident: &Resident, brick: &Brick, geometry: &'a [u32]) -> Self {
        let object = &resident.objects[brick.object as usize];
        let [step, unit] = [object.step_log2, object.unit_log2].map(|log2| f64::from(log2).exp2());
        // Nodes come first.
        let nodes = &geometry[..brick.node_count as usize * size_of::<Node>() / 4];
        let origin = DVec3::from_array(brick.origin.map(|x| x as f64)) * step;
        Self { nodes: bytemuck::cast_slice(nodes), origin, unit }
    }

    /// How many nodes each of `rays` from `origin` enters before it ends, object units. Those of them enter the root
    /// whose numbers are in `root`.
    pub fn entered(&self, origin: DVec3, rays: &[Sight], root: Vec<u32>) -> Vec<u32> {
        let mut entered = vec![0; rays.len()];
        let mut stack = vec![(0u32, root)];
        while let Some((number, within)) = stack.pop() {
            within.iter().for_each(|&ray| entered[ray as usize] += 1);
            let node = &self.nodes[number as usize];
            let inner = (0..NODE_WIDTH).filter(|slot| node.inner_mask >> slot & 1 != 0);
            for (child, slot) in (node.child_base..).zip(inner) {
                let own = entering(self.bounds(node, slot), origin, rays, &within);
                if !own.is_empty() {
                    stack.push((child, own));
                }
            }
        }
        entered
    }

    /// The bounds of a child, object units.
    fn bounds(&self, node: &Node, slot: usize) -> [DVec3; 2] {
        [&node.lo, &node.hi].map(|steps| {
            let of = |k: usize| {
                let step = (i32::from(node.exponent[k]) - 127) as f64;
                f64::from(node.origin[k]) + f64::from(steps[k][slot]) * step.exp2()
            };
            self.origin + DVec3::from_array(std::array::from_fn(of)) * self.unit
        })
    }
}
