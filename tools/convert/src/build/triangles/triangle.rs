//! A triangle on the lattice of its object, with all that a brick stores of it.

use super::attributes::{self, NO_DETAIL, PlainBits, VertexBits, Wants};
use super::lattice::Lattice;
use crate::build::input::objects::Placed;
use bytemuck::{Pod, Zeroable};

/// A triangle as bricks are made of it. Corners are in source order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Triangle {
    /// The brick.
    pub brick: u32,
    /// Its id. Within a brick triangles are in order of ids.
    pub id: u32,
    /// Index of its material.
    pub material: u32,
    /// Corners, in steps of the object's lattice.
    pub corners: [[i64; 3]; 3],
    /// Attribute vertices.
    pub attributes: [VertexBits; 3],
}

impl Triangle {
    /// Rounds a triangle of a part; `None` if that leaves it without area. `wants`: what its material does.
    pub fn round(placed: &Placed, triangle: u32, lattice: &Lattice, brick: u32, wants: Wants) -> Option<Self> {
        let source = placed.vertices(triangle);
        let corners = source.map(|vertex| lattice.round(placed.position(vertex)));
        if attributes::is_degenerate(&corners) {
            return None;
        }
        let first = triangle as usize * 3;
        // A mirror turns the order of corners about.
        let is_mirrored = placed.part.baking.as_ref().is_some_and(|baking| baking.matrix.determinant() < 0.0);
        let outside = attributes::cross(&corners).map(|x| if is_mirrored { -x } else { x });
        let attributes =
            std::array::from_fn(|corner| attributes::vertex(placed, source[corner], first + corner, wants, outside));
        Some(Self {
            brick,
            id: placed.part.first_id + triangle,
            material: placed.primitive.material,
            corners,
            attributes,
        })
    }
}

/// A triangle as it lies on the scratch disk.
pub(crate) trait Stored: Pod + Send + Sync {
    /// Of a triangle; details that it has no room for are lost.
    fn of(triangle: &Triangle) -> Self;

    /// The triangle.
    fn triangle(&self) -> Triangle;

    /// Brick and id, which order triangles.
    fn key(&self) -> u64;
}

/// What triangles of all scenes have.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, packed(4))]
pub(crate) struct Plain {
    brick: u32,
    id: u32,
    material: u32,
    corners: [[i64; 3]; 3],
    attributes: [PlainBits; 3],
}

/// The same, and details.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, packed(4))]
pub(crate) struct Detailed {
    plain: Plain,
    details: [attributes::DetailBits; 3],
}

impl Stored for Plain {
    fn of(triangle: &Triangle) -> Self {
        let Triangle { brick, id, material, corners, attributes } = *triangle;
        Self { brick, id, material, corners, attributes: attributes.map(|vertex| vertex.0) }
    }

    fn triangle(&self) -> Triangle {
        let Self { brick, id, material, corners, attributes } = *self;
        Triangle { brick, id, material, corners, attributes: attributes.map(|vertex| VertexBits(vertex, NO_DETAIL)) }
    }

    fn key(&self) -> u64 {
        u64::from(self.brick) << 32 | u64::from(self.id)
    }
}

impl Stored for Detailed {
    fn of(triangle: &Triangle) -> Self {
        Self { plain: Plain::of(triangle), details: triangle.attributes.map(|vertex| vertex.1) }
    }

    fn triangle(&self) -> Triangle {
        let Self { plain, details } = *self;
        let mut triangle = plain.triangle();
        triangle.attributes.iter_mut().zip(details).for_each(|(vertex, detail)| vertex.1 = detail);
        triangle
    }

    fn key(&self) -> u64 {
        self.plain.key()
    }
}
