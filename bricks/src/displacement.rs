//! Displacement fields: how far it is from a sphere around an object, or a brick, to the triangles in it, for rays from
//! sampled positions into sampled directions.
//!
//! The positions are those of two hemispheres in Slater's subdivision ("Constant time queries on uniformly distributed
//! points on a hemisphere", J. Graphics Tools 7(1), 2002), the directions a square of them for each position. Here is
//! what the file says of a field; which position and direction a sample is of, whoever traces fields decides.

use crate::records::{NONE, Span};
use bytemuck::{Pod, Zeroable};

/// [`DisplacementField::bits`]: a byte a sample, the distance as a share of the chord; [`DISPLACEMENT_MISS`] for none.
pub const DISPLACEMENT_DISTANCES: u32 = 8;
/// [`DisplacementField::bits`]: a bit a sample, set where the ray hits.
pub const DISPLACEMENT_HITS: u32 = 1;

/// The byte of a ray that hits nothing.
pub const DISPLACEMENT_MISS: u8 = 255;

/// [`DisplacementField::executor`]: it was traced on the processor.
pub const DISPLACEMENT_BY_CPU: u32 = 0;
/// [`DisplacementField::executor`]: it was traced on a GPU.
pub const DISPLACEMENT_BY_GPU: u32 = 1;

/// Most rings of a field.
pub const MAX_DISPLACEMENT_RINGS: u32 = 64;
/// Least directions of a field on a side of their square.
pub const MIN_DISPLACEMENT_DIRECTIONS: u32 = 2;
/// Most directions of a field on a side of their square. All samples of the largest field are less than
/// [`crate::layout::MAX_PAYLOAD_BYTES`].
pub const MAX_DISPLACEMENT_DIRECTIONS: u32 = 256;

/// A displacement field: what it is of, how it is sampled, and where its samples lie.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct DisplacementField {
    /// The object that it is of.
    pub object: u32,
    /// The brick of the object that it is of alone, or [`NONE`]: it is of the whole object.
    pub brick: u32,
    /// Slater's m, the rings of a hemisphere: 1 to [`MAX_DISPLACEMENT_RINGS`].
    pub rings: u32,
    /// Directions of a position on a side of their square: [`MIN_DISPLACEMENT_DIRECTIONS`] to
    /// [`MAX_DISPLACEMENT_DIRECTIONS`].
    pub directions: u32,
    /// Bits of a sample: [`DISPLACEMENT_DISTANCES`] or [`DISPLACEMENT_HITS`].
    pub bits: u32,
    /// [`DISPLACEMENT_BY_CPU`] or [`DISPLACEMENT_BY_GPU`].
    pub executor: u32,
    /// Centre of the sphere, object units.
    pub center: [f64; 3],
    /// Radius of the sphere, object units.
    pub radius: f64,
    /// Mean distance of the rays that hit, as a share of the chord, 0 to 1: what a field of bits answers.
    pub mean: f64,
    /// The samples, packed.
    pub span: Span,
}

impl DisplacementField {
    /// Positions on the sphere: those of both hemispheres, the equator in each.
    pub fn positions(&self) -> u64 {
        let m = u64::from(self.rings);
        (m * m).saturating_mul(4).saturating_add(4 * m + 2)
    }

    /// Samples, one a position and direction: the directions of a position follow each other.
    pub fn samples(&self) -> u64 {
        self.positions().saturating_mul(u64::from(self.directions) * u64::from(self.directions))
    }

    /// Bytes of the samples, without the padding to 16.
    pub fn sample_bytes(&self) -> u64 {
        if self.bits == DISPLACEMENT_HITS { self.samples().div_ceil(8) } else { self.samples() }
    }

    /// Bytes of the samples as they are loaded, padded with zeros to a multiple of 16.
    pub fn loaded_bytes(&self) -> u64 {
        self.sample_bytes().div_ceil(16).saturating_mul(16)
    }

    /// The brick that it is of alone, if it is not of the whole object.
    pub fn of_brick(&self) -> Option<u32> {
        (self.brick != NONE).then_some(self.brick)
    }
}

/// Of the largest field, which is what the other rules allow: the length needs none of its own.
const _: () = {
    let (m, n) = (MAX_DISPLACEMENT_RINGS as u64, MAX_DISPLACEMENT_DIRECTIONS as u64);
    assert!((4 * m * m + 4 * m + 2) * n * n <= crate::layout::MAX_PAYLOAD_BYTES);
};

#[cfg(test)]
mod tests {
    use super::*;

    fn field(rings: u32, directions: u32, bits: u32) -> DisplacementField {
        DisplacementField { rings, directions, bits, ..DisplacementField::zeroed() }
    }

    #[test]
    fn positions_are_those_of_two_hemispheres() {
        for (rings, positions) in [(1, 10), (8, 290), (16, 1090), (32, 4226)] {
            let m = u64::from(rings);
            let field = field(rings, 3, DISPLACEMENT_DISTANCES);
            assert_eq!(field.positions(), positions);
            assert_eq!(positions, 2 * (2 * m * m + 2 * m + 1));
            assert_eq!(field.samples(), 9 * positions);
        }
    }

    #[test]
    fn samples_are_padded() {
        for (rings, directions, bits, bytes, loaded) in [
            (1, 3, DISPLACEMENT_DISTANCES, 90, 96),
            (1, 4, DISPLACEMENT_DISTANCES, 160, 160),
            (1, 3, DISPLACEMENT_HITS, 12, 16),
            (1, 2, DISPLACEMENT_HITS, 5, 16),
            (8, 16, DISPLACEMENT_HITS, 9280, 9280),
            (64, 256, DISPLACEMENT_DISTANCES, 1_090_650_112, 1_090_650_112),
        ] {
            let field = field(rings, directions, bits);
            assert_eq!((field.sample_bytes(), field.loaded_bytes()), (bytes, loaded));
        }
    }

    #[test]
    fn counts_of_any_record_do_not_overflow() {
        for bits in [DISPLACEMENT_DISTANCES, DISPLACEMENT_HITS, u32::MAX] {
            assert!(field(u32::MAX, u32::MAX, bits).loaded_bytes() > 1 << 60);
        }
    }
}
