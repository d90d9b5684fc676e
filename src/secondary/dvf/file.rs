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
use glam::DVec3;
use std::io;
use thiserror::Error;
use xxhash_rust::xxh3::xxh3_64;

/// First bytes.
pub const MAGIC: [u8; 8] = *b"BWDVF\x1a\n\0";
/// The version of the format.
pub const VERSION: u32 = 2;

/// Bytes before the cells.
const HEAD: usize = 8 + 4 + 4 + 8 + 24 + 8 + 12 + 8 + 4;

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
    let mut bytes = Vec::with_capacity(HEAD + known.len() * 4 * (1 + words) + 8);
    bytes.extend(MAGIC);
    for word in [VERSION, shape.octahedral] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(key.to_le_bytes());
    for value in [shape.corner.x, shape.corner.y, shape.corner.z, shape.side] {
        bytes.extend(value.to_le_bytes());
    }
    let areas = [areas.scale, areas.total].map(f32::to_bits);
    for word in shape.size.into_iter().chain(areas).chain([known.len() as u32]) {
        bytes.extend(word.to_le_bytes());
    }
    for cell in known {
        let masks = &field.masks[cell * words..(cell + 1) * words];
        for word in std::iter::once(cell as u32).chain(masks.iter().copied()) {
            bytes.extend(word.to_le_bytes());
        }
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
    let array = |at: usize| bytes.get(at..at + 8).and_then(|b| <[u8; 8]>::try_from(b).ok());
    let word =
        |at: usize| bytes.get(at..at + 4).and_then(|b| <[u8; 4]>::try_from(b).ok()).map_or(0, u32::from_le_bytes);
    let version = word(8);
    if bytes.len() >= HEAD && version != VERSION {
        return Err(FileError::Version(version));
    }
    if bytes.len() < HEAD + 8 {
        return Err(FileError::Damaged("it is too short"));
    }
    let (body, checksum) = bytes.split_at(bytes.len() - 8);
    if checksum != xxh3_64(body).to_le_bytes() {
        return Err(FileError::Damaged("its checksum is another than stated"));
    }
    if array(16) != Some(key.to_le_bytes()) {
        return Err(FileError::Other);
    }
    let value = |at: usize| array(at).map_or(0.0, f64::from_le_bytes);
    let octahedral = word(12);
    let size = [56, 60, 64].map(word);
    let [scale, total] = [68, 72].map(|at| f32::from_bits(word(at)));
    let shape = Shape { corner: DVec3::new(value(24), value(32), value(40)), side: value(48), size, octahedral };
    let is_sound = [8, 16, 32].contains(&octahedral)
        && shape.side > 0.0
        && shape.side.is_finite()
        && shape.corner.is_finite()
        && [scale, total].iter().all(|x| *x > 0.0 && x.is_finite())
        && size.iter().all(|n| (1..=1 << 16).contains(n))
        && shape.cells().checked_mul(4 * shape.words() as u64).is_some_and(|bytes| bytes <= most);
    let (count, words) = (word(76) as usize, if is_sound { shape.words() } else { 0 });
    if !is_sound || body.len() - HEAD != count * 4 * (1 + words) {
        return Err(FileError::Damaged("its numbers cannot be"));
    }
    let mut field = DvfField::unknown(shape);
    for entry in body[HEAD..].chunks_exact(4 * (1 + words)) {
        let entry: Vec<u32> = entry.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b)).collect();
        let cell = entry[0] as usize;
        if cell >= field.labels.len() {
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
