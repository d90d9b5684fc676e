//! Bricks in the form that the processor walks fastest: all boxes on one grid, the vertices of triangles side by side.
//!
//! Packed nodes have grids of their own, which are seen from a ray one by one. Here what a ray makes of the grid is the
//! same in all of a brick, and no index is looked up. Boxes are those of the packed nodes, up to a step of the grid.
//! Nodes and triangles have the same numbers. Triangles are tested by the same operations, so hits are the same, bit
//! for bit.

use super::vector::Vec3;
use bricks::{BRICK_WIDE, Brick, Node};

/// Triangles of a block.
pub const BLOCK: usize = 8;

/// A node. It fills two lines of a processor's cache, which are brought near together.
#[derive(Clone, Copy)]
#[repr(C, align(128))]
pub struct FlatNode {
    /// Lower bounds of the children by axes, and upper ones, steps of the brick's grid; of those that do not exist,
    /// zeros.
    pub bounds: [[[u16; 8]; 3]; 2],
    /// As of [`Node`]; it tells the triangles of each child that is a leaf.
    pub meta: [u8; 8],
    /// As of [`Node`].
    pub child_base: u32,
    /// As of [`Node`].
    pub triangle_base: u32,
    /// As of [`Node`].
    pub inner_mask: u8,
    /// The children that exist, a bit each.
    pub present: u8,
}

/// The grid that the bounds of a brick lie on, by axes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Grid {
    /// Where it begins, device units of the object relative to the brick's origin.
    pub origin: Vec3,
    /// Its steps, powers of two.
    pub step: Vec3,
}

/// Triangles that follow each other.
#[derive(Clone, Copy, Default)]
#[repr(C, align(64))]
pub struct FlatBlock {
    /// Vertices a, b, c by axes, device units of the object relative to the brick's origin.
    pub vertices: [[[f32; BLOCK]; 3]; 3],
    /// Mesh-local ids.
    pub ids: [u32; BLOCK],
}

/// A brick.
pub struct FlatBrick {
    /// The root first.
    pub nodes: Vec<FlatNode>,
    /// All triangles; what the last holds beside them is of no meaning.
    pub blocks: Vec<FlatBlock>,
    /// What the nodes' bounds lie on.
    pub grid: Grid,
}

/// `x` in f32, rounded down.
fn below(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) <= x { near } else { near.next_down() }
}

/// Bounds of a child of a node by axes, lower and upper, device units of the object relative to the brick's origin.
fn bounds_of(node: &Node, slot: usize) -> [[f64; 2]; 3] {
    [0, 1, 2].map(|k| {
        let step = f64::from(f32::from_bits(u32::from(node.exponent[k]) << 23));
        let plane = |q: u8| f64::from(node.origin[k]) + f64::from(q) * step;
        [plane(node.lo[k][slot]), plane(node.hi[k][slot])]
    })
}

/// The children of a node that exist.
fn slots(node: &Node) -> impl Iterator<Item = usize> {
    (0..8).filter(|&slot| node.meta[slot] != 0)
}

impl Grid {
    /// Steps that it has.
    pub const STEPS: f32 = 65535.0;

    /// The finest that holds all children of `nodes`.
    fn new(nodes: &[Node]) -> Self {
        let mut grid = Self::default();
        for k in 0..3 {
            let all = nodes.iter().flat_map(|node| slots(node).map(move |slot| bounds_of(node, slot)[k]));
            let [low, high] = all.fold([f64::INFINITY, f64::NEG_INFINITY], |[l, h], [x, y]| [l.min(x), h.max(y)]);
            grid.origin[k] = if low <= high { below(low) } else { 0.0 };
            let size = (high - f64::from(grid.origin[k])).max(0.0);
            // The least exponent of a number that is not denormal, or the next that suffices.
            grid.step[k] = f32::MIN_POSITIVE;
            while f64::from(grid.step[k]) * f64::from(Self::STEPS) < size {
                grid.step[k] *= 2.0;
            }
        }
        grid
    }

    /// Steps up to `x` along an axis, rounded down and up.
    fn steps(&self, k: usize, x: f64) -> [u16; 2] {
        let steps = (x - f64::from(self.origin[k])) / f64::from(self.step[k]);
        // Casts saturate; all bounds lie within.
        [steps.floor() as u16, steps.ceil() as u16]
    }
}

impl FlatNode {
    /// The same as `of`.
    fn new(of: &Node, grid: &Grid) -> Self {
        let mut node = Self {
            bounds: [[[0; 8]; 3]; 2],
            meta: of.meta,
            child_base: of.child_base,
            triangle_base: of.triangle_base,
            inner_mask: of.inner_mask,
            present: 0,
        };
        for slot in slots(of) {
            node.present |= 1 << slot;
            for (k, [low, high]) in bounds_of(of, slot).into_iter().enumerate() {
                node.bounds[0][k][slot] = grid.steps(k, low)[0];
                node.bounds[1][k][slot] = grid.steps(k, high)[1];
            }
        }
        node
    }

    /// The triangles of a child that is a leaf, a bit each from `triangle_base` on.
    #[inline(always)]
    pub fn triangles_of(&self, slot: usize) -> u32 {
        let what = u32::from(self.meta[slot % 8]);
        (what >> 5) << (what & 31)
    }
}

impl FlatBrick {
    /// The brick of `nodes` and `triangles`: their vertices, and ids.
    pub fn new(nodes: &[Node], triangles: impl ExactSizeIterator<Item = ([Vec3; 3], u32)>) -> Self {
        let grid = Grid::new(nodes);
        let nodes = nodes.iter().map(|node| FlatNode::new(node, &grid)).collect();
        let mut blocks = vec![FlatBlock::default(); triangles.len().div_ceil(BLOCK)];
        for (number, (vertices, id)) in triangles.enumerate() {
            let (block, lane) = (&mut blocks[number / BLOCK], number % BLOCK);
            for (to, vertex) in block.vertices.iter_mut().zip(vertices) {
                for (to, x) in to.iter_mut().zip(vertex) {
                    to[lane] = x;
                }
            }
            block.ids[lane] = id;
        }
        Self { nodes, blocks, grid }
    }

    /// Bytes that it takes of a brick. `None`: vertices have too many bits for this form.
    pub fn bytes_of(brick: &Brick) -> Option<u64> {
        let blocks = brick.triangle_count.div_ceil(BLOCK as u32);
        let bytes = u64::from(brick.node_count) * size_of::<FlatNode>() as u64
            + u64::from(blocks) * size_of::<FlatBlock>() as u64;
        (brick.flags & BRICK_WIDE == 0).then_some(bytes)
    }

    /// The vertices of a triangle as they are stored.
    #[inline(always)]
    pub fn vertices(&self, triangle: u32) -> [Vec3; 3] {
        let (block, lane) = (&self.blocks[triangle as usize / BLOCK], triangle as usize % BLOCK);
        let vertex = |[x, y, z]: &[[f32; BLOCK]; 3]| [x[lane], y[lane], z[lane]];
        let [a, b, c] = &block.vertices;
        [vertex(a), vertex(b), vertex(c)]
    }

    /// The mesh-local id of a triangle.
    #[inline(always)]
    pub fn id(&self, triangle: u32) -> u32 {
        self.blocks[triangle as usize / BLOCK].ids[triangle as usize % BLOCK]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::probe;
    use crate::kernels::payloads::BrickView;
    use bricks::Payload;

    #[test]
    fn boxes_and_triangles_are_those_of_the_packed_brick() {
        let file = probe::scene().unwrap();
        let (mut made, mut apart, mut finest) = (0, 0, 0.0f64);
        for (number, record) in (0..).zip(&file.resident().bricks) {
            let payload = Payload::Geometry(number);
            let mut words = vec![0u32; file.span(payload).bytes as usize / 4];
            file.copy(payload, bytemuck::cast_slice_mut(&mut words)).unwrap();
            let view = BrickView::new(record, bytemuck::cast_slice(&words), &[]);
            let flat = view.flattened(record.triangle_count);
            assert_eq!(flat.is_some(), record.flags & BRICK_WIDE == 0);
            let Some(flat) = flat else { continue };
            made += 1;
            let bytes = size_of_val(&flat.nodes[..]) + size_of_val(&flat.blocks[..]);
            assert_eq!(FlatBrick::bytes_of(record), Some(bytes as u64));
            for triangle in 0..record.triangle_count {
                let corners = flat.vertices(triangle).map(|vertex| vertex.map(f64::from));
                assert_eq!(corners, view.corners(triangle));
                assert_eq!(flat.id(triangle), view.ids[triangle as usize]);
            }
            for (own, of) in flat.nodes.iter().zip(view.nodes) {
                assert_eq!((own.child_base, own.triangle_base), (of.child_base, of.triangle_base));
                assert_eq!(usize::from(own.present), slots(of).fold(0, |bits, slot| bits | 1 << slot));
                for slot in (0..8).filter(|&slot| of.meta[slot] != 0) {
                    for k in 0..3 {
                        let step = (f64::from(of.exponent[k]) - 127.0).exp2();
                        let plane = |q: u8| f64::from(of.origin[k]) + f64::from(q) * step;
                        let (low, high) = (plane(of.lo[k][slot]), plane(of.hi[k][slot]));
                        let Grid { origin, step } = flat.grid;
                        let of_grid = |q: u16| f64::from(origin[k]) + f64::from(q) * f64::from(step[k]);
                        let [below, above] = own.bounds.map(|side| of_grid(side[k][slot]));
                        assert!(below <= low && high <= above, "{below} {low} {high} {above}");
                        let most = f64::from(step[k]);
                        assert!(low - below < most && above - high < most, "wider by more than a step");
                        apart += usize::from(below != above);
                        finest = finest.max(above.max(-below) / most);
                    }
                }
            }
        }
        assert!(finest > 16384.0, "grids have up to {finest} steps in use");
        assert!(made > 1 && apart > 100, "{made} bricks, {apart} boxes");
    }
}
