//! Walks of the top level on the host, in f64: for what pictures show of it, not for hits.

use super::placement::world_box;
use bricks::{Leaf, Resident, TOP_LEAF};
use glam::DVec3;

/// Entries of the stack: each level of the tree leaves one, and the last two.
const STACK: usize = bricks::MAX_TOP2_HEIGHT as usize + 2;

/// The binary top level of a scene.
#[derive(Clone, Copy)]
pub struct TopWalk<'a> {
    resident: &'a Resident,
    exact_bricks: u32,
}

/// A ray and where it ends: from an origin that it shares with others, such as a camera's.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// In which direction, of any length.
    pub direction: DVec3,
    /// Parameter of its end, its hit's.
    pub end: f64,
}

/// What the rays of a tile meet of the top level: pairs of the tile with its nodes, as fronts have them that begin at
/// the root and are not pulled up (CHC+RT, sections 4.2 and 4.3).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct TileFront {
    /// Nodes that are leaves and that a ray enters before it ends: the visible front.
    pub visible: Vec<u32>,
    /// Nodes that no ray enters, where one enters the node above: the invisible front.
    pub invisible: Vec<u32>,
    /// How many nodes each ray enters.
    pub entered: Vec<u32>,
}

/// Those of `rays`, by their numbers, that enter a box before they end.
pub fn entering(bounds: [DVec3; 2], origin: DVec3, rays: &[Sight], numbers: &[u32]) -> Vec<u32> {
    let enters = |&&number: &&u32| {
        let Sight { direction, end } = rays[number as usize];
        crossing(bounds, origin, direction.recip(), [0.0, end]).is_some()
    };
    numbers.iter().filter(enters).copied().collect()
}

/// The parameters at which a ray enters and leaves a box, within a range; `None`: it passes it by.
pub fn crossing([min, max]: [DVec3; 2], origin: DVec3, inverse: DVec3, [start, end]: [f64; 2]) -> Option<[f64; 2]> {
    let (mut near, mut far) = (start, end);
    for k in 0..3 {
        if inverse[k].is_infinite() {
            // The ray does not move along this axis.
            if origin[k] < min[k] || origin[k] > max[k] {
                return None;
            }
            continue;
        }
        let (a, b) = ((min[k] - origin[k]) * inverse[k], (max[k] - origin[k]) * inverse[k]);
        (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
    }
    (near <= far).then_some([near, far])
}

impl<'a> TopWalk<'a> {
    /// Of a scene.
    pub fn new(resident: &'a Resident) -> Self {
        Self { resident, exact_bricks: resident.exact_bricks() as u32 }
    }

    /// Calls `meet` for the bricks, no levels of detail among them, whose boxes a ray enters before `end`, nearer ones
    /// first but where boxes overlap: the leaf, the parameters of entry and exit. It returns where the ray ends from
    /// then on. Returns how many nodes were visited.
    pub fn walk(&self, origin: DVec3, direction: DVec3, end: f64, mut meet: impl FnMut(&Leaf, [f64; 2]) -> f64) -> u32 {
        let Self { resident, exact_bricks } = *self;
        let (inverse, mut end, mut visited) = (direction.recip(), end, 0);
        let enter = |node: u32, end: f64| {
            let node = &resident.top2[node as usize];
            crossing(world_box(resident, [node.min, node.max]), origin, inverse, [0.0, end])
        };
        let mut stack = [(0u32, [0.0; 2]); STACK];
        let mut depth = 0;
        if let Some(range) = (!resident.top2.is_empty()).then(|| enter(0, end)).flatten() {
            (stack[0], depth) = ((0, range), 1);
        }
        while depth > 0 {
            depth -= 1;
            let (number, range) = stack[depth];
            if range[0] > end {
                continue;
            }
            visited += 1;
            let node = &resident.top2[number as usize];
            if node.right == TOP_LEAF {
                let leaf = &resident.leaves[node.left as usize];
                if leaf.brick < exact_bricks {
                    end = meet(leaf, range);
                }
                continue;
            }
            let children = [node.left, node.right].map(|child| enter(child, end).map(|range| (child, range)));
            let mut put = |entry: Option<(u32, [f64; 2])>| {
                if let Some(entry) = entry.filter(|_| depth < STACK) {
                    stack[depth] = entry;
                    depth += 1;
                }
            };
            // The nearer one on top.
            match children {
                [Some(a), Some(b)] if a.1[0] <= b.1[0] => [Some(b), Some(a)].map(&mut put),
                [a, b] => [a, b].map(&mut put),
            };
        }
        visited
    }

    /// What rays from `origin` meet, levels of detail not among it.
    pub fn front(&self, origin: DVec3, rays: &[Sight]) -> TileFront {
        let mut front = TileFront { entered: vec![0; rays.len()], ..TileFront::default() };
        let all: Vec<u32> = (0..rays.len() as u32).collect();
        let mut stack = if self.resident.top2.is_empty() { Vec::new() } else { vec![(0u32, all)] };
        while let Some((number, above)) = stack.pop() {
            let node = &self.resident.top2[number as usize];
            let is_leaf = node.right == TOP_LEAF;
            if is_leaf && self.resident.leaves[node.left as usize].brick >= self.exact_bricks {
                continue;
            }
            let within = entering(world_box(self.resident, [node.min, node.max]), origin, rays, &above);
            within.iter().for_each(|&ray| front.entered[ray as usize] += 1);
            match (within.is_empty(), is_leaf) {
                (true, _) => front.invisible.push(number),
                (false, true) => front.visible.push(number),
                (false, false) => stack.extend([(node.right, within.clone()), (node.left, within)]),
            }
        }
        front
    }

    /// The leaf that a node of the top level is; `None`: it is none.
    pub fn leaf(&self, node: u32) -> Option<&'a Leaf> {
        let node = &self.resident.top2[node as usize];
        (node.right == TOP_LEAF).then(|| &self.resident.leaves[node.left as usize])
    }

    /// The bounds of a node, world units.
    pub fn bounds(&self, node: u32) -> [DVec3; 2] {
        let node = &self.resident.top2[node as usize];
        world_box(self.resident, [node.min, node.max])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_crossed_where_they_are_met() {
        let unit = [DVec3::ZERO, DVec3::ONE];
        let of = |origin: [f64; 3], direction: [f64; 3]| {
            crossing(unit, origin.into(), DVec3::from(direction).recip(), [0.0, 10.0])
        };
        assert_eq!(of([-1.0, 0.5, 0.5], [1.0, 0.0, 0.0]), Some([1.0, 2.0]));
        assert_eq!(of([0.5, 0.5, 0.5], [0.0, 0.0, -2.0]), Some([0.0, 0.25]));
        assert_eq!(of([-1.0, 1.5, 0.5], [1.0, 0.0, 0.0]), None);
        assert_eq!(of([2.0, 0.5, 0.5], [1.0, 0.0, 0.0]), None);
        assert_eq!(of([-20.0, 0.5, 0.5], [1.0, 0.0, 0.0]), None);
        // In a side, along it.
        assert_eq!(of([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]), Some([1.0, 2.0]));
    }
}
