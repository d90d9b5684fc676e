//! A triangle on the lattice of its object, with all that a brick stores of it.

use super::attributes;
use super::lattice::Lattice;
use super::objects::Placed;
use bytemuck::{Pod, Zeroable};

/// A triangle as bricks are made of it. Corners are in source order.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, packed(4))]
pub(super) struct Triangle {
    /// The brick.
    pub brick: u32,
    /// Its id. Within a brick triangles are in order of ids.
    pub id: u32,
    /// Index of its material.
    pub material: u32,
    /// Corners, in steps of the object's lattice.
    pub corners: [[i64; 3]; 3],
    /// Attribute vertices, see [`attributes::VertexBits`].
    pub attributes: [[u32; 4]; 3],
}

impl Triangle {
    /// Rounds a triangle of a part; `None` if that leaves it without area.
    pub fn round(placed: &Placed, triangle: u32, lattice: &Lattice, brick: u32) -> Option<Self> {
        let source = placed.vertices(triangle);
        let corners = source.map(|vertex| lattice.round(placed.position(vertex)));
        if attributes::is_degenerate(&corners) {
            return None;
        }
        let attributes = source.map(|vertex| attributes::vertex(placed, vertex).0);
        Some(Self {
            brick,
            id: placed.part.first_id + triangle,
            material: placed.primitive.material,
            corners,
            attributes,
        })
    }
}
