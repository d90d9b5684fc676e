//! The file of a field, beside its scene: what it was made of, then the cells of which something is known.
//!
//! Little-endian; bytes from the first:
//!
//! | at | bytes | what |
//! | --- | --- | --- |
//! | 0 | 8 | [`MAGIC`] |
//! | 8 | 4 | [`VERSION`] |
//! | 12 | 4 | texels of a mask on both axes |
//! | 16 | 8 | the key: what it was made of |
//! | 24 | 24 + 8 | corner of cell 0 and side of a cell, world units, f64 |
//! | 56 | 12 | cells on each axis |
//! | 68 | 4 + 4 | steps of sums a device unit of area, and twice the sum of all areas, f32 ([`Areas`]) |
//! | 76 | 4 | known cells |
//! | 80 | | of each its number (4) and both masks, before they are widened |
//! | | 8 | xxh3-64 of all before |
//!
//! Nothing is used before the checksum is found right.

use super::{Areas, DvfField, DvfKept, Shape, mask};
use bricks::planted::{self, Defect};
use bytemuck::{Pod, Zeroable};
use std::io;
use thiserror::Error;
use xxhash_rust::xxh3::xxh3_64;

/// First bytes.
pub const MAGIC: [u8; 8] = *b"BWDVF\x1a\n\0";
/// The version of the format.
pub const VERSION: u32 = 2;

/// What stands before the cells.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Head {
    magic: [u8; 8],
    version: u32,
    octahedral: u32,
    key: u64,
    corner: [f64; 3],
    side: f64,
    size: [u32; 3],
    areas: [f32; 2],
    known: u32,
}

/// Its bytes.
const HEAD: usize = size_of::<Head>();

/// Why a file is of no use.
#[derive(Debug, Error)]
pub enum FileError {
    /// It cannot be read.
    #[error("cannot be read: {0}")]
    Io(#[from] io::Error),
    /// It is none.
    #[error("is no field")]
    Foreign,
    /// Of another version of this program.
    #[error("has version {0}, this program reads {VERSION}")]
    Version(u32),
    /// Of another scene, or made by other options.
    #[error("is of another scene, or was made with other options")]
    Other,
    /// Its bytes are not those that were written.
    #[error("is damaged: {0}")]
    Damaged(&'static str),
}

/// The bytes of `field`; `key` says what it was made of.
pub fn encode(kept: &DvfKept, key: u64) -> Vec<u8> {
    let DvfKept { field, areas } = kept;
    let shape = &field.shape;
    let words = shape.words();
    let known: Vec<usize> = (0..field.labels.len()).filter(|&cell| field.labels[cell] != mask::UNKNOWN).collect();
    let head = Head {
        magic: MAGIC,
        version: VERSION,
        octahedral: shape.octahedral,
        key,
        corner: shape.corner.to_array(),
        side: shape.side,
        size: shape.size,
        areas: [areas.scale, areas.total],
        known: known.len() as u32,
    };
    let mut bytes = bytemuck::bytes_of(&head).to_vec();
    for cell in known {
        bytes.extend(bytemuck::bytes_of(&(cell as u32)));
        bytes.extend_from_slice(bytemuck::cast_slice(&field.masks[cell * words..(cell + 1) * words]));
    }
    let checksum = xxh3_64(&bytes);
    bytes.extend(checksum.to_le_bytes());
    bytes
}

/// The field of `bytes`, made of what `key` says, of at most `most` bytes of masks.
///
/// # Errors
/// Other bytes than [`encode`] gives for that key.
pub fn decode(bytes: &[u8], key: u64, most: u64) -> Result<DvfKept, FileError> {
    if bytes.get(..8) != Some(&MAGIC[..]) {
        return Err(FileError::Foreign);
    }
    let head = bytes.get(..HEAD).map(bytemuck::pod_read_unaligned::<Head>);
    let head = head.ok_or(FileError::Damaged("it is too short"))?;
    if head.version != VERSION {
        return Err(FileError::Version(head.version));
    }
    if bytes.len() < HEAD + 8 {
        return Err(FileError::Damaged("it is too short"));
    }
    let (body, checksum) = bytes.split_at(bytes.len() - 8);
    if checksum != xxh3_64(body).to_le_bytes() {
        return Err(FileError::Damaged("its checksum is another than stated"));
    }
    if head.key != key {
        return Err(FileError::Other);
    }
    let Head { octahedral, side, size, areas: [scale, total], .. } = head;
    let shape = Shape { corner: head.corner.into(), side, size, octahedral };
    let is_sound = [8, 16, 32].contains(&octahedral)
        && shape.side > 0.0
        && shape.side.is_finite()
        && shape.corner.is_finite()
        && [scale, total].iter().all(|x| *x > 0.0 && x.is_finite())
        && size.iter().all(|n| (1..=1 << 16).contains(n))
        && shape.cells().checked_mul(4 * shape.words() as u64).is_some_and(|bytes| bytes <= most);
    let (count, words) = (head.known as usize, if is_sound { shape.words() } else { 0 });
    if !is_sound || body.len() - HEAD != count * 4 * (1 + words) {
        return Err(FileError::Damaged("its numbers cannot be"));
    }
    let mut field = DvfField::unknown(shape);
    for entry in body[HEAD..].chunks_exact(4 * (1 + words)) {
        let entry: Vec<u32> = bytemuck::pod_collect_to_vec(entry);
        let cell = entry[0] as usize;
        if cell >= field.labels.len() && !planted::is(Defect::DvfCell) {
            return Err(FileError::Damaged("a cell lies outside"));
        }
        field.masks[cell * words..(cell + 1) * words].copy_from_slice(&entry[1..]);
        field.labels[cell] = mask::label(&entry[1..]);
    }
    Ok(DvfKept { field, areas: Areas { scale, total } })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampling::pcg;
    use glam::DVec3;

    fn kept() -> DvfKept {
        let mut field = DvfField::unknown(Shape::new(DVec3::ZERO, DVec3::new(3.0, 2.0, 1.0), 6, 8));
        let words = field.shape.words();
        for (cell, masks) in field.masks.chunks_exact_mut(words).enumerate().filter(|(cell, _)| cell % 3 == 0) {
            masks.iter_mut().enumerate().for_each(|(i, word)| *word = pcg((cell * 16 + i) as u32));
        }
        field.finish(false);
        DvfKept { field, areas: Areas { scale: 0.5, total: 3.25 } }
    }

    #[test]
    fn what_is_written_is_read() {
        let kept = kept();
        assert_eq!(decode(&encode(&kept, 7), 7, 1 << 20).unwrap(), kept);
    }

    #[test]
    fn every_byte_that_is_damaged_is_found() {
        let bytes = encode(&kept(), 7);
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << (at % 8);
            assert!(decode(&damaged, 7, 1 << 20).is_err(), "byte {at}");
            assert!(decode(&bytes[..at], 7, 1 << 20).is_err(), "{at} bytes");
        }
        assert!(matches!(decode(&bytes, 8, 1 << 20), Err(FileError::Other)));
        assert!(matches!(decode(&bytes, 7, 100), Err(FileError::Damaged(_))), "more than there is room for");
        assert!(matches!(decode(b"something else", 7, 100), Err(FileError::Foreign)));
        let mut old = bytes;
        old[8] = 0;
        assert!(matches!(decode(&old, 7, 1 << 20), Err(FileError::Version(0))));
    }
}
