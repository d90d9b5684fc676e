//! The vertices of triangles in payloads, as numbers of 16 or 32 bits.

use bricks::{BRICK_INDEX32, Brick};

/// Three indices a triangle where they lie.
#[derive(Clone, Copy, Default)]
pub struct Indices<'a> {
    /// Where they have 16 bits,
    short: &'a [u16],
    /// and where they have 32.
    long: &'a [u32],
}

impl<'a> Indices<'a> {
    /// The indices of `brick`, which `bytes` are, aligned for u32.
    pub fn new(brick: &Brick, bytes: &'a [u8]) -> Self {
        match brick.flags & BRICK_INDEX32 {
            0 => Self { short: bytemuck::cast_slice(bytes), long: &[] },
            _ => Self { short: &[], long: bytemuck::cast_slice(bytes) },
        }
    }

    /// The vertices of a triangle.
    #[inline(always)]
    pub fn of(&self, triangle: u32) -> [u32; 3] {
        let at = 3 * triangle as usize;
        if self.long.is_empty() {
            let i = &self.short[at..at + 3];
            return [i[0].into(), i[1].into(), i[2].into()];
        }
        let i = &self.long[at..at + 3];
        [i[0], i[1], i[2]]
    }
}
