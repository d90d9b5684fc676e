//! Files of chunks with lengths and checksums: taken apart, changed, and put together rightly.

use super::Harm;
use crate::random::Random;

/// The first bytes of a PNG file.
const PNG: &[u8; 8] = b"\x89PNG\r\n\x1a\n";

/// A chunk of a PNG file: its name and its bytes.
type Chunk = ([u8; 4], Vec<u8>);

fn png_chunks(file: &[u8]) -> Vec<Chunk> {
    let mut rest = file.get(PNG.len()..).unwrap_or_default();
    let mut chunks = Vec::new();
    while let Some((length, after)) = rest.split_first_chunk::<4>() {
        let Some((name, after)) = after.split_first_chunk::<4>() else { break };
        let Some((data, after)) = after.split_at_checked(u32::from_be_bytes(*length) as usize) else { break };
        chunks.push((*name, data.to_vec()));
        rest = after.get(4..).unwrap_or_default();
    }
    chunks
}

fn png_of(chunks: &[Chunk]) -> Vec<u8> {
    let mut file = PNG.to_vec();
    for (name, data) in chunks {
        file.extend((data.len() as u32).to_be_bytes());
        let start = file.len();
        file.extend_from_slice(name);
        file.extend_from_slice(data);
        let checksum = crc32fast::hash(&file[start..]);
        file.extend(checksum.to_be_bytes());
    }
    file
}

/// Names of chunks of PNG.
const NAMES: [&[u8; 4]; 10] =
    [b"IHDR", b"PLTE", b"IDAT", b"IEND", b"tRNS", b"gAMA", b"iCCP", b"zTXt", b"acTL", b"fdAT"];

/// Changes chunks of a PNG file; their checksums are right afterwards.
pub fn change_png(harm: Harm, random: &mut Random, file: &mut Vec<u8>) {
    let mut chunks = png_chunks(file);
    if chunks.is_empty() {
        return;
    }
    let (at, to) = (random.below(chunks.len()), random.below(chunks.len()));
    match random.below(7) {
        0 => {
            chunks.remove(at);
        }
        1 => {
            let copy = chunks[at].clone();
            chunks.insert(to, copy);
        }
        2 => chunks.swap(at, to),
        3 => chunks[at].0 = *random.pick(NAMES),
        4 => {
            // Width, height, depth, colours.
            let header = &mut chunks[0].1;
            harm.bytes(random, header, 100);
            header.resize(13, 0);
        }
        5 => {
            // A size that the data cannot have.
            let sides = [1u32, 3, 4096, 16384, 65536, 1 << 20, u32::MAX / 2, u32::MAX];
            let [width, height] = [random.pick(sides), random.pick(sides)];
            for (byte, new) in chunks[0].1.iter_mut().zip([width.to_be_bytes(), height.to_be_bytes()].concat()) {
                *byte = new;
            }
        }
        _ => harm.bytes(random, &mut chunks[at].1, 100),
    }
    *file = png_of(&chunks);
}

/// A GLB file of these two chunks.
pub fn glb(json: &[u8], binary: &[u8]) -> Vec<u8> {
    let padded = |bytes: &[u8], with: u8| {
        let mut bytes = bytes.to_vec();
        bytes.resize(bytes.len().next_multiple_of(4), with);
        bytes
    };
    let (json, binary) = (padded(json, b' '), padded(binary, 0));
    let total = 12 + 8 + json.len() + 8 + binary.len();
    let word = |n: usize| (n as u32).to_le_bytes();
    [b"glTF", &word(2)[..], &word(total), &word(json.len()), b"JSON", &json, &word(binary.len()), b"BIN\0", &binary]
        .concat()
}

/// Changes the header of a GLB file or of one of its chunks.
pub fn change_glb(random: &mut Random, file: &mut [u8]) {
    let json = file.get(12..16).and_then(|four| four.try_into().ok()).map_or(0, u32::from_le_bytes);
    let second = 20usize.saturating_add(json as usize);
    let at = random.pick([0, 4, 8, 12, 16, second, second + 4]);
    let words = [b"glTF", b"JSON", b"BIN\0", b"JUNK"];
    let value = match random.below(3) {
        0 => *random.pick(words),
        1 => (super::bytes::word(random) as u32).to_le_bytes(),
        _ => (file.len() as u32).wrapping_add(random.pick([1, 4, u32::MAX, u32::MAX - 3])).to_le_bytes(),
    };
    for (byte, new) in file.iter_mut().skip(at).zip(value) {
        *byte = new;
    }
}
