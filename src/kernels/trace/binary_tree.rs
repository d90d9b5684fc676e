//! A brick's wide tree as a binary one: the choice of CHC+RT's (§7) and most other tracers' nodes, for comparison.
//!
//! A wide node stands for a binary subtree that was collapsed (Ylitie, Karras, Laine 2017). Each is opened again into
//! the binary tree over its at most eight children that has the least surface area, by dynamic programming over their
//! subsets. Leaves stay what they are. Boxes are those of the triangles, not of the wide tree's grids.

use crate::kernels::layout::{BINARY_LEAF, BinaryNode};
use crate::schedule::ExecutorError;
use crate::stream::{Item, StreamError};
use bricks::{Brick, Corners, NODE_WIDTH, Node, Payload, Resident, SceneFile};

/// Bits below the number of a leaf's triangles.
const COUNT_SHIFT: u32 = 29;

/// A box in device units of the object, relative to the brick's origin; exact.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bounds {
    min: [f64; 3],
    max: [f64; 3],
}

impl Bounds {
    const NONE: Self = Self { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };

    fn union(self, other: Self) -> Self {
        Self {
            min: std::array::from_fn(|k| self.min[k].min(other.min[k])),
            max: std::array::from_fn(|k| self.max[k].max(other.max[k])),
        }
    }

    fn half_area(&self) -> f64 {
        let [x, y, z] = std::array::from_fn(|k| self.max[k] - self.min[k]);
        x * y + y * z + z * x
    }
}

/// A child of a wide node.
#[derive(Clone, Copy, Debug)]
struct Child {
    bounds: Bounds,
    what: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// A wide node.
    Inner(u32),
    /// First triangle and their number.
    Leaf(u32, u32),
}

/// The binary tree of a brick. Node 0 is the root, node 1 unused, so that two children lie in 64 aligned bytes.
#[derive(Debug, Default)]
pub struct Tree {
    /// The nodes, an even number.
    pub nodes: Vec<BinaryNode>,
    /// Levels of inner nodes: what a traversal's stack must hold at most.
    pub height: u32,
}

/// Makes the tree of brick number `brick` of `scene`.
///
/// # Errors
/// A brick that cannot be read.
pub fn tree_of(scene: &SceneFile, brick: usize) -> Result<Tree, ExecutorError> {
    let item = Item::geometry(brick as u32);
    let payload = Payload::from(item);
    let mut geometry = vec![0u32; scene.loaded_bytes(payload) as usize / 4];
    scene
        .copy(payload, bytemuck::cast_slice_mut(&mut geometry))
        .map_err(|reason| StreamError::Payload { item, reason: Box::new(reason) })?;
    Ok(binary_tree(&scene.resident().bricks[brick], &geometry))
}

/// Levels of inner nodes of the binary top level.
pub fn top_height(resident: &Resident) -> u32 {
    let mut levels = vec![0; resident.top2.len()];
    // Children follow their parent.
    for (i, node) in resident.top2.iter().enumerate() {
        if node.right != bricks::TOP_LEAF {
            for child in [node.left, node.right] {
                levels[child as usize] = levels[i] + 1;
            }
        }
    }
    levels.into_iter().max().unwrap_or(0)
}

/// Makes the tree of `brick` from the words of its geometry payload, which is valid.
pub fn binary_tree(brick: &Brick, geometry: &[u32]) -> Tree {
    let wide: &[Node] = bytemuck::cast_slice(&geometry[..brick.node_count as usize * size_of::<Node>() / 4]);
    let bounds = bounds(brick, geometry, wide);
    let mut tree = Tree { nodes: vec![BinaryNode::default(); 2], height: 0 };
    tree.nodes[0].what = BINARY_LEAF;
    // Wide nodes with the binary node that each becomes, and the level of that.
    let mut stack = if wide.is_empty() { Vec::new() } else { vec![(0u32, 0usize, 0u32)] };
    while let Some((index, at, level)) = stack.pop() {
        let children: Vec<Child> = children(&wide[index as usize], &bounds).collect();
        if children.is_empty() {
            continue;
        }
        let splits = splits(&children);
        // Subsets of the children with the binary node that each becomes.
        let mut sets = vec![(splits.len() - 1, at, level)];
        while let Some((set, at, level)) = sets.pop() {
            let inside = (0..children.len()).filter(|i| set & 1 << i != 0);
            let all = inside.fold(Bounds::NONE, |all, i| all.union(children[i].bounds));
            let what = match children[set.trailing_zeros() as usize].what {
                _ if !set.is_power_of_two() => {
                    let first = tree.nodes.len();
                    tree.nodes.resize(first + 2, BinaryNode::default());
                    tree.height = tree.height.max(level + 1);
                    sets.extend([(splits[set], first, level + 1), (set ^ splits[set], first + 1, level + 1)]);
                    first as u32
                }
                Kind::Inner(child) => {
                    stack.push((child, at, level));
                    continue;
                }
                Kind::Leaf(first, count) => BINARY_LEAF | count << COUNT_SHIFT | first,
            };
            tree.nodes[at] = BinaryNode { min: all.min.map(below), what, max: all.max.map(above), padding: 0 };
        }
    }
    tree
}

/// For every subset of two or more children, a bit each, one of the two parts into which the binary tree of least area
/// splits it.
fn splits(children: &[Child]) -> Vec<usize> {
    let sets = 1usize << children.len();
    let mut bounds = vec![Bounds::NONE; sets];
    let mut costs = vec![0.0f64; sets];
    let mut splits = vec![0; sets];
    for set in 1..sets {
        let rest = set & (set - 1);
        bounds[set] = bounds[rest].union(children[set.trailing_zeros() as usize].bounds);
        if rest == 0 {
            continue;
        }
        // The lowest child lies in one part: the other is a subset of the rest.
        splits[set] = rest;
        let (mut best, mut part) = (f64::INFINITY, rest);
        while part != 0 {
            let cost = costs[part] + costs[set ^ part];
            if cost < best {
                (best, splits[set]) = (cost, part);
            }
            part = (part - 1) & rest;
        }
        costs[set] = best + bounds[set].half_area();
    }
    splits
}

/// The children of a wide node below which there are triangles, `of` the boxes of wide nodes and of triangles.
fn children(node: &Node, of: &AllBounds) -> impl Iterator<Item = Child> {
    let mut inner = node.child_base;
    let children = (0..NODE_WIDTH).filter_map(move |slot| {
        let meta = node.meta[slot];
        if meta == 0 {
            return None;
        }
        if node.inner_mask & 1 << slot != 0 {
            inner += 1;
            return Some(Child { bounds: of.nodes[inner as usize - 1], what: Kind::Inner(inner - 1) });
        }
        let (first, count) = (node.triangle_base + u32::from(meta & 31), (meta >> 5).count_ones());
        let triangles = &of.triangles[first as usize..(first + count) as usize];
        let bounds = triangles.iter().fold(Bounds::NONE, |all, &one| all.union(one));
        Some(Child { bounds, what: Kind::Leaf(first, count) })
    });
    children.filter(|child| child.bounds != Bounds::NONE)
}

/// Exact boxes.
struct AllBounds {
    nodes: Vec<Bounds>,
    triangles: Vec<Bounds>,
}

fn bounds(brick: &Brick, geometry: &[u32], wide: &[Node]) -> AllBounds {
    let corners = Corners::new(brick, bytemuck::cast_slice(geometry));
    let triangle = |i: u32| {
        let points = corners.of(i);
        points.iter().fold(Bounds::NONE, |all, &p| all.union(Bounds { min: p, max: p }))
    };
    let triangles = (0..brick.triangle_count).map(triangle).collect();
    let mut all = AllBounds { nodes: vec![Bounds::NONE; wide.len()], triangles };
    // Children follow their parent.
    for (i, node) in wide.iter().enumerate().rev() {
        all.nodes[i] = children(node, &all).fold(Bounds::NONE, |sum, child| sum.union(child.bounds));
    }
    all
}

/// The greatest f32 that is not above `x`.
fn below(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) > x { near.next_down() } else { near }
}

/// The least f32 that is not below `x`.
fn above(x: f64) -> f32 {
    -below(-x)
}

#[cfg(test)]
#[path = "binary_tree_tests.rs"]
mod tests;
