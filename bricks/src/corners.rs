//! Vertices of triangles in a brick's geometry, in f64.

use crate::records::{BRICK_INDEX32, BRICK_WIDE, Brick, GeometryLayout};

/// The triangles in a geometry payload, which is valid and needs no alignment.
#[derive(Clone, Copy, Debug)]
pub struct Corners<'a> {
    vertices: &'a [u8],
    indices: &'a [u8],
    has_wide_vertices: bool,
    has_wide_indices: bool,
}

impl<'a> Corners<'a> {
    /// Those of `brick`, whose geometry `bytes` are.
    pub fn new(brick: &Brick, bytes: &'a [u8]) -> Self {
        let layout = GeometryLayout::of(brick);
        Self {
            vertices: &bytes[layout.vertices as usize..],
            indices: &bytes[layout.indices as usize..],
            has_wide_vertices: brick.flags & BRICK_WIDE != 0,
            has_wide_indices: brick.flags & BRICK_INDEX32 != 0,
        }
    }

    /// The vertices of a triangle in the order in which they are stored, in device units of the object, relative to the
    /// brick's origin; exact.
    pub fn of(&self, triangle: u32) -> [[f64; 3]; 3] {
        let word =
            |bytes: &[u8], at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        std::array::from_fn(|corner| {
            let at = 3 * triangle as usize + corner;
            let vertex = if self.has_wide_indices {
                word(self.indices, 4 * at) as usize
            } else {
                usize::from(u16::from_le_bytes([self.indices[2 * at], self.indices[2 * at + 1]]))
            };
            let value = |word_index: usize| f64::from(f32::from_bits(word(self.vertices, 4 * word_index)));
            // High and low part have 24 bits each and a common step: the sum is exact.
            std::array::from_fn(|k| match self.has_wide_vertices {
                true => value(6 * vertex + k) + value(6 * vertex + 3 + k),
                false => value(3 * vertex + k),
            })
        })
    }
}
