//! Changes to bytes.

use crate::random::Random;

/// Values at which counts, offsets and lengths go wrong.
const WORDS: [u64; 18] = [
    0,
    1,
    2,
    3,
    7,
    63,
    64,
    127,
    255,
    256,
    0x7fff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_fffe,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0xffff_ffff_ffff_ffff,
];

/// A value such as a mistake or malice would leave.
pub fn word(random: &mut Random) -> u64 {
    match random.below(4) {
        0 => random.word(),
        1 => random.below(70) as u64,
        _ => random.pick(WORDS),
    }
}

/// Numbers that arithmetic stumbles over.
const NUMBERS: [f32; 10] =
    [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0, 1e-40, 3e38, -3e38, 1e20, -1.0, f32::EPSILON];

/// Changes `bytes` at one place.
pub fn change(random: &mut Random, bytes: &mut Vec<u8>) {
    match random.below(14) {
        0 => {
            let bit = random.below(8);
            edit(random, bytes, |byte, _| *byte ^= 1 << bit);
        }
        1 | 2 => edit(random, bytes, |byte, random| *byte = random.word() as u8),
        3 => edit(random, bytes, |byte, random| *byte = word(random) as u8),
        4..=6 => put(random, bytes),
        7 => {
            let range = random.range(bytes.len());
            bytes.drain(range);
        }
        8 => {
            let (range, to) = (random.range(bytes.len()), random.below(bytes.len() + 1));
            let copy = bytes[range].to_vec();
            bytes.splice(to..to, copy);
        }
        9 => {
            let (range, to) = (random.range(bytes.len()), random.below(bytes.len() + 1));
            let copy = bytes[range].to_vec();
            for (byte, copied) in bytes[to..].iter_mut().zip(copy) {
                *byte = copied;
            }
        }
        10 => {
            let (at, length) = (random.below(bytes.len() + 1), random.within(1, 16));
            let fresh: Vec<u8> = (0..length).map(|_| random.word() as u8).collect();
            bytes.splice(at..at, fresh);
        }
        11 => bytes.truncate(random.below(bytes.len() + 1)),
        12 => {
            // A count that is off by a little.
            let at = random.below(bytes.len() / 4) * 4;
            if let Some(four) = bytes.get_mut(at..).and_then(<[u8]>::first_chunk_mut::<4>) {
                let step = random.pick([1u32, 2, 4, 8, u32::MAX, u32::MAX - 1, u32::MAX - 3]);
                *four = u32::from_le_bytes(*four).wrapping_add(step).to_le_bytes();
            }
        }
        _ => {
            let at = random.below(bytes.len() / 4) * 4;
            if let Some(four) = bytes.get_mut(at..).and_then(<[u8]>::first_chunk_mut::<4>) {
                *four = random.pick(NUMBERS).to_le_bytes();
            }
        }
    }
}

fn edit(random: &mut Random, bytes: &mut [u8], change: impl FnOnce(&mut u8, &mut Random)) {
    let at = random.below(bytes.len());
    if let Some(byte) = bytes.get_mut(at) {
        change(byte, random);
    }
}

/// Puts a word of 1, 2, 4 or 8 bytes somewhere, aligned or not, in either order of bytes.
fn put(random: &mut Random, bytes: &mut [u8]) {
    let width = random.pick([2usize, 4, 4, 4, 8]);
    let align = if random.chance(80) { width } else { 1 };
    let at = random.below(bytes.len() / align + 1) * align;
    let mut value = word(random).to_le_bytes();
    if random.chance(20) {
        value[..width].reverse();
    }
    for (byte, new) in bytes.iter_mut().skip(at).zip(&value[..width]) {
        *byte = *new;
    }
}
