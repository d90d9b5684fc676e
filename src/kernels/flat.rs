//! Bricks in the form that the processor walks fastest: boxes as plain numbers, the vertices of triangles side by side.
//!
//! Packed nodes are decoded and seen from a ray one by one. Here what a ray adds to a box is the same in all of a
//! brick, and no index is looked up. Boxes are those of the packed nodes, and nodes and triangles have the same
//! numbers. Triangles are tested by the same operations, so hits are the same, bit for bit.

use super::vector::Vec3;
use bricks::{BRICK_WIDE, Brick, Node};

/// Triangles of a block.
pub const BLOCK: usize = 8;

/// A node. It fills four lines of a processor's cache.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub struct FlatNode {
    /// Lower bounds of the children by axes, and upper ones, device units of the object relative to the brick's origin;
    /// of those that do not exist, what no ray enters.
    pub bounds: [[[f32; 8]; 3]; 2],
    /// The triangles of each child that is a leaf, a bit each from `triangle_base` on.
    pub triangles: [u32; 8],
    /// As of [`Node`].
    pub child_base: u32,
    /// As of [`Node`].
    pub triangle_base: u32,
    /// As of [`Node`].
    pub inner_mask: u32,
    /// The children that exist, a bit each.
    pub present: u32,
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
    /// Greatest magnitude of a bound by axis.
    pub extent: Vec3,
}

/// `x` in f32, rounded down.
fn below(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) <= x { near } else { near.next_down() }
}

impl FlatNode {
    /// The same as `of`.
    fn new(of: &Node) -> Self {
        let mut node = Self {
            bounds: [[[f32::INFINITY; 8]; 3], [[f32::NEG_INFINITY; 8]; 3]],
            triangles: [0; 8],
            child_base: of.child_base,
            triangle_base: of.triangle_base,
            inner_mask: u32::from(of.inner_mask),
            present: 0,
        };
        for slot in (0..8).filter(|&slot| of.meta[slot] != 0) {
            node.present |= 1 << slot;
            for k in 0..3 {
                let step = f64::from(f32::from_bits(u32::from(of.exponent[k]) << 23));
                let plane = |q: u8| f64::from(of.origin[k]) + f64::from(q) * step;
                node.bounds[0][k][slot] = below(plane(of.lo[k][slot]));
                node.bounds[1][k][slot] = -below(-plane(of.hi[k][slot]));
            }
            if node.inner_mask >> slot & 1 == 0 {
                let what = u32::from(of.meta[slot]);
                node.triangles[slot] = (what >> 5) << (what & 31);
            }
        }
        node
    }
}

impl FlatBrick {
    /// The brick of `nodes` and `triangles`: their vertices, and ids.
    pub fn new(nodes: &[Node], triangles: impl ExactSizeIterator<Item = ([Vec3; 3], u32)>) -> Self {
        let nodes: Vec<FlatNode> = nodes.iter().map(FlatNode::new).collect();
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
        let mut extent = [0.0f32; 3];
        for (k, extent) in extent.iter_mut().enumerate() {
            let bounds = nodes.iter().flat_map(|node| node.bounds.iter().flat_map(move |side| side[k]));
            *extent = bounds.filter(|x| x.is_finite()).fold(0.0, |most, x| most.max(x.abs()));
        }
        Self { nodes, blocks, extent }
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
        let (mut made, mut apart) = (0, 0);
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
                for slot in (0..8).filter(|&slot| of.meta[slot] != 0) {
                    for k in 0..3 {
                        let step = (f64::from(of.exponent[k]) - 127.0).exp2();
                        let plane = |q: u8| f64::from(of.origin[k]) + f64::from(q) * step;
                        let (low, high) = (plane(of.lo[k][slot]), plane(of.hi[k][slot]));
                        let [below, above] = own.bounds.map(|side| f64::from(side[k][slot]));
                        assert!(below <= low && high <= above, "{below} {low} {high} {above}");
                        assert!(low - below + above - high <= 1e-6 * (low.abs() + high.abs()), "no wider");
                        apart += usize::from(below != above);
                    }
                }
            }
        }
        assert!(made > 1 && apart > 100, "{made} bricks, {apart} boxes");
    }
}
