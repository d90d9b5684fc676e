//! How the attributes of a brick lie in a file: the arrays of [`AttributeLayout`] arranged for LZ4, which finds
//! repetitions of bytes, and packed ([`crate::pack`]).
//!
//! What is packed are these columns, without padding, for v attribute vertices and t triangles:
//!
//! | column | bytes | what |
//! | --- | --- | --- |
//! | normals | 4 v | [`AttributeVertex::normal`] |
//! | texture coordinates | 8 v | [`AttributeVertex::uv`] |
//! | colours | 4 v | [`AttributeVertex::color`] |
//! | materials | 4 t | the low 30 bits of the surface words |
//! | rotations | ⌈t / 4⌉ | their high 2 bits, four to a byte, the first in the lowest bits |
//! | indices | 6 t or 12 t | as distances from the next new one: all lowest bytes, all second bytes, and so on |
//! | tangents | 4 v | [`AttributeDetail::tangent`], with [`BRICK_DETAIL`] |
//! | handedness | 4 v | [`AttributeDetail::handedness`], with [`BRICK_DETAIL`] |
//! | second coordinates | 8 v | [`AttributeDetail::uv`], with [`BRICK_DETAIL`] |
//!
//! Vertices are numbered in the order of their first use, so an index is either the next new one, distance 0, or one of
//! few before it. With h = 0 at first, an index i is stored as d = h - i, in the modulus of its 16 or 32 bits, and d =
//! 0 makes h one more: any indices in any order can be stored so.

use crate::pack::{UnpackError, pack, unpack};
use crate::records::{
    AttributeDetail, AttributeLayout, AttributeVertex, BRICK_DETAIL, BRICK_INDEX32, Brick, SURFACE_MATERIAL,
    SURFACE_ROTATION_SHIFT,
};

/// Lengths of the columns in bytes, in their order.
struct Columns {
    normals: usize,
    uvs: usize,
    colors: usize,
    materials: usize,
    rotations: usize,
    indices: usize,
    /// Tangents, and as many bytes of handedness.
    tangents: usize,
    second_uvs: usize,
}

impl Columns {
    fn of(brick: &Brick) -> Self {
        let (vertices, triangles) = (brick.attribute_vertex_count as usize, brick.triangle_count as usize);
        let details = if brick.flags & BRICK_DETAIL != 0 { vertices } else { 0 };
        Self {
            normals: vertices * 4,
            uvs: vertices * 8,
            colors: vertices * 4,
            materials: triangles * 4,
            rotations: triangles.div_ceil(4),
            indices: triangles * if brick.flags & BRICK_INDEX32 != 0 { 12 } else { 6 },
            tangents: details * 4,
            second_uvs: details * 8,
        }
    }

    fn bytes(&self) -> usize {
        let details = 2 * self.tangents + self.second_uvs;
        self.normals + self.uvs + self.colors + self.materials + self.rotations + self.indices + details
    }
}

/// Encodes the attributes of `brick`, laid out as [`AttributeLayout`] says; padding is not looked at. The same
/// attributes give the same bytes.
///
/// # Panics
///
/// If `loaded` is not as long as the counts of `brick` say.
pub fn encode(brick: &Brick, loaded: &[u8]) -> Vec<u8> {
    let layout = AttributeLayout::of(brick);
    assert_eq!(loaded.len() as u64, layout.bytes, "the length of the attributes, as the counts of the brick say");
    let columns = Columns::of(brick);
    let (vertices, rest) = loaded.split_at(layout.surfaces as usize);
    let (surfaces, rest) = rest.split_at((layout.indices - layout.surfaces) as usize);
    let (indices, details) = rest.split_at((layout.details - layout.indices) as usize);
    let vertices = &vertices.as_chunks::<{ size_of::<AttributeVertex>() }>().0[..columns.normals / 4];
    let surfaces = &surfaces.as_chunks::<4>().0[..columns.materials / 4];

    let mut bytes = Vec::with_capacity(columns.bytes());
    bytes.extend(vertices.iter().flat_map(|vertex| &vertex[..4]));
    bytes.extend(vertices.iter().flat_map(|vertex| &vertex[4..12]));
    bytes.extend(vertices.iter().flat_map(|vertex| &vertex[12..]));
    let surface = |surface: &[u8; 4]| u32::from_le_bytes(*surface);
    bytes.extend(surfaces.iter().flat_map(|word| (surface(word) & SURFACE_MATERIAL).to_le_bytes()));
    bytes.extend(surfaces.chunks(4).map(|four| {
        four.iter().rev().fold(0, |byte, word| byte << 2 | (surface(word) >> SURFACE_ROTATION_SHIFT) as u8)
    }));
    if brick.flags & BRICK_INDEX32 != 0 {
        encode_indices::<4>(&indices[..columns.indices], &mut bytes);
    } else {
        encode_indices::<2>(&indices[..columns.indices], &mut bytes);
    }
    let details = details.as_chunks::<{ size_of::<AttributeDetail>() }>().0;
    bytes.extend(details.iter().flat_map(|detail| &detail[..4]));
    bytes.extend(details.iter().flat_map(|detail| &detail[4..8]));
    bytes.extend(details.iter().flat_map(|detail| &detail[8..]));
    pack(&bytes)
}

/// Decodes what [`encode`] made of attributes as long as `loaded` into it, padding included. Whatever `stored` holds,
/// it does not panic; the indices and materials that come out may be any. `scratch` grows to the length of the columns,
/// which the counts of `brick` say, and is of use for the next call. After an error the contents of `loaded` are of no
/// use.
///
/// # Errors
///
/// If `stored` cannot be unpacked to columns of the lengths that the counts of `brick` say, or has set bits where there
/// are none of a material or a rotation.
///
/// # Panics
///
/// If `loaded` is not as long as the counts of `brick` say.
pub fn decode(brick: &Brick, stored: &[u8], scratch: &mut Vec<u8>, loaded: &mut [u8]) -> Result<(), UnpackError> {
    let layout = AttributeLayout::of(brick);
    assert_eq!(loaded.len() as u64, layout.bytes, "the length of the attributes, as the counts of the brick say");
    let lengths = Columns::of(brick);
    if scratch.len() < lengths.bytes() {
        scratch.resize(lengths.bytes(), 0);
    }
    let columns = &mut scratch[..lengths.bytes()];
    unpack(stored, columns)?;
    let (normals, columns) = columns.split_at(lengths.normals);
    let (uvs, columns) = columns.split_at(lengths.uvs);
    let (colors, columns) = columns.split_at(lengths.colors);
    let (materials, columns) = columns.split_at(lengths.materials);
    let (rotations, columns) = columns.split_at(lengths.rotations);
    let (distances, columns) = columns.split_at(lengths.indices);
    let (tangents, columns) = columns.split_at(lengths.tangents);
    let (handedness, second_uvs) = columns.split_at(lengths.tangents);
    let (vertices, rest) = loaded.split_at_mut(layout.surfaces as usize);
    let (surfaces, rest) = rest.split_at_mut((layout.indices - layout.surfaces) as usize);
    let (indices, details) = rest.split_at_mut((layout.details - layout.indices) as usize);

    let rows = normals.as_chunks::<4>().0.iter().zip(uvs.as_chunks::<8>().0).zip(colors.as_chunks::<4>().0);
    for (vertex, ((normal, uv), color)) in vertices.as_chunks_mut::<16>().0.iter_mut().zip(rows) {
        vertex[..4].copy_from_slice(normal);
        vertex[4..12].copy_from_slice(uv);
        vertex[12..].copy_from_slice(color);
    }
    decode_surfaces(materials, rotations, surfaces)?;
    let (indices, padding) = indices.split_at_mut(lengths.indices);
    padding.fill(0);
    if brick.flags & BRICK_INDEX32 != 0 {
        decode_indices::<4>(distances, indices);
    } else {
        decode_indices::<2>(distances, indices);
    }
    let columns = tangents.as_chunks::<4>().0.iter().zip(handedness.as_chunks::<4>().0);
    let rows = columns.zip(second_uvs.as_chunks::<8>().0);
    for (detail, ((tangent, handedness), uv)) in details.as_chunks_mut::<16>().0.iter_mut().zip(rows) {
        detail[..4].copy_from_slice(tangent);
        detail[4..8].copy_from_slice(handedness);
        detail[8..].copy_from_slice(uv);
    }
    Ok(())
}

fn decode_surfaces(materials: &[u8], rotations: &[u8], surfaces: &mut [u8]) -> Result<(), UnpackError> {
    let (surfaces, padding) = surfaces.split_at_mut(materials.len());
    padding.fill(0);
    let (mut all, mut unused) = (0, 0);
    for ((surfaces, materials), &rotations) in surfaces.chunks_mut(16).zip(materials.chunks(16)).zip(rotations) {
        let mut rotations = u32::from(rotations);
        for (surface, material) in surfaces.as_chunks_mut::<4>().0.iter_mut().zip(materials.as_chunks::<4>().0) {
            let material = u32::from_le_bytes(*material);
            all |= material;
            *surface = (material | rotations << SURFACE_ROTATION_SHIFT).to_le_bytes();
            rotations >>= 2;
        }
        // Of the last byte fewer than four may be in use.
        unused |= rotations;
    }
    if all & !SURFACE_MATERIAL != 0 || unused != 0 {
        let (found, expected) = ("set bits beside those of materials and rotations", "zeros there");
        return Err(UnpackError { found: found.to_owned(), expected: expected.to_owned() });
    }
    Ok(())
}

/// Appends the distances of indices of `BYTES` bytes.
fn encode_indices<const BYTES: usize>(indices: &[u8], distances: &mut Vec<u8>) {
    let mut next = 0u32;
    let indices: Vec<[u8; 4]> = indices
        .as_chunks::<BYTES>()
        .0
        .iter()
        .map(|index| {
            let distance = next.wrapping_sub(word(index)) & mask::<BYTES>();
            next = next.wrapping_add(u32::from(distance == 0));
            distance.to_le_bytes()
        })
        .collect();
    for corner in 0..3 {
        for byte in 0..BYTES {
            distances.extend(indices.iter().skip(corner).step_by(3).map(|distance| distance[byte]));
        }
    }
}

/// The inverse of [`encode_indices`].
fn decode_indices<const BYTES: usize>(distances: &[u8], indices: &mut [u8]) {
    let triangles = distances.len() / (3 * BYTES);
    let planes: [[&[u8]; BYTES]; 3] = std::array::from_fn(|corner| {
        std::array::from_fn(|byte| &distances[(corner * BYTES + byte) * triangles..][..triangles])
    });
    let mut next = 0u32;
    for (triangle, indices) in indices.chunks_exact_mut(3 * BYTES).enumerate() {
        for (planes, index) in planes.iter().zip(indices.as_chunks_mut::<BYTES>().0) {
            let distance = word(&planes.map(|plane| plane[triangle]));
            index.copy_from_slice(&next.wrapping_sub(distance).to_le_bytes()[..BYTES]);
            next = next.wrapping_add(u32::from(distance == 0));
        }
    }
}

/// The little-endian number in at most four bytes.
fn word(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte))
}

/// The low `BYTES` bytes of a word.
const fn mask<const BYTES: usize>() -> u32 {
    u32::MAX >> (32 - 8 * BYTES)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use proptest::prelude::*;

    fn brick(triangles: u32, vertices: u32, flags: u32) -> Brick {
        Brick { flags, triangle_count: triangles, attribute_vertex_count: vertices, ..Brick::zeroed() }
    }

    /// Attributes of these values, each used again from the start when there are too few.
    fn loaded(brick: &Brick, words: &[u32], indices: &[u32]) -> Vec<u8> {
        let layout = AttributeLayout::of(brick);
        let mut words = words.iter().cycle().flat_map(|word| word.to_le_bytes());
        let mut indices = indices.iter().cycle();
        let mut bytes: Vec<u8> = words.by_ref().take(layout.surfaces as usize).collect();
        bytes.extend(words.by_ref().take(brick.triangle_count as usize * 4));
        let details = words;
        bytes.resize(layout.indices as usize, 0);
        let size = if brick.flags & BRICK_INDEX32 != 0 { 4 } else { 2 };
        for _ in 0..brick.triangle_count * 3 {
            bytes.extend(&indices.next().unwrap().to_le_bytes()[..size]);
        }
        bytes.resize(layout.details as usize, 0);
        bytes.extend(details.take((layout.bytes - layout.details) as usize));
        bytes
    }

    fn decoded(brick: &Brick, stored: &[u8]) -> Result<Vec<u8>, UnpackError> {
        // Stale bytes, which must not show.
        let (mut scratch, mut out) = (vec![0xa5; 100], vec![0xa5; AttributeLayout::of(brick).bytes as usize]);
        decode(brick, stored, &mut scratch, &mut out).map(|()| out)
    }

    /// A brick of a mesh whose normals are the only thing that varies, with indices in the order of their first use.
    #[test]
    fn a_smooth_mesh_takes_six_bytes_a_triangle() {
        let (triangles, vertices) = (10_000u32, 5_100);
        let brick = brick(triangles, vertices, 0);
        let mut number = 1u32;
        let mut random = move || {
            number = number.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            number >> 8
        };
        let words: Vec<u32> = (0..vertices)
            .flat_map(|_| [random() & 0x7fff_7fff, 0, 0, u32::MAX])
            .chain(vec![1; triangles as usize])
            .collect();
        let mut next = 0;
        let mut indices: Vec<u32> = Vec::new();
        for triangle in 0..triangles * 3 {
            let is_new = next < vertices && triangle % 6 == 0;
            indices.push(if is_new { next } else { next.saturating_sub(1 + random() % 250) });
            next += u32::from(is_new);
        }
        let loaded = loaded(&brick, &words, &indices);
        let stored = encode(&brick, &loaded);
        let (before, after) = (loaded.len() as f64 / 1e4, stored.len() as f64 / 1e4);
        assert!(before > 18.0 && after < 6.0 && after > 4.0, "{before} to {after}");
        assert_eq!(decoded(&brick, &stored).unwrap(), loaded);
    }

    #[test]
    fn lengths_are_those_of_the_brick() {
        let of = brick(7, 9, 0);
        let stored = encode(&of, &loaded(&of, &[1, 2, 3], &[0, 1, 2]));
        assert!(decoded(&of, &stored).is_ok());
        for other in [
            brick(8, 9, 0),
            brick(7, 8, 0),
            brick(7, 9, BRICK_INDEX32),
            brick(7, 9, BRICK_DETAIL),
            brick(1 << 20, 3 << 20, BRICK_INDEX32),
        ] {
            assert!(decoded(&other, &stored).is_err());
        }
    }

    #[test]
    fn bits_without_meaning_are_zero() {
        let brick = brick(3, 1, 0);
        let columns = |material: u32, rotations: u8| {
            let mut columns = vec![7; 16];
            columns.extend([0, material, 0].iter().flat_map(|word| word.to_le_bytes()));
            columns.push(rotations);
            columns.extend([0; 18]);
            pack(&columns)
        };
        assert!(decoded(&brick, &columns(SURFACE_MATERIAL, 0x3f)).is_ok());
        for stored in [columns(1 << 30, 0), columns(1 << 31, 0), columns(0, 0x40), columns(0, 0x80)] {
            assert!(decoded(&brick, &stored).unwrap_err().found.contains("set bits"));
        }
        // The last byte of rotations, all the ways to leave bits of it without use.
        for triangles in 1..5 {
            let brick = self::brick(triangles, 1, 0);
            for bit in 0..8 {
                let mut columns = vec![0; Columns::of(&brick).bytes()];
                columns[16 + 4 * triangles as usize] = 1 << bit;
                assert_eq!(decoded(&brick, &pack(&columns)).is_ok(), bit < 2 * triangles, "bit {bit} of {triangles}");
            }
        }
    }

    /// Even those that no valid brick has, and more than 16 bits hold.
    fn index() -> impl Strategy<Value = u32> {
        prop_oneof![0u32..300, Just(u32::MAX), Just(65_535), any::<u32>()]
    }

    fn flags() -> impl Strategy<Value = u32> {
        prop::sample::select(vec![0, BRICK_INDEX32, BRICK_DETAIL, BRICK_INDEX32 | BRICK_DETAIL])
    }

    proptest! {
        #[test]
        fn what_is_encoded_comes_back(
            triangles in 1u32..90,
            vertices in 1u32..200,
            flags in flags(),
            words in prop::collection::vec(any::<u32>(), 1..400),
            indices in prop::collection::vec(index(), 1..300),
        ) {
            let brick = brick(triangles, vertices, flags);
            let loaded = loaded(&brick, &words, &indices);
            let stored = encode(&brick, &loaded);
            prop_assert_eq!(&stored, &encode(&brick, &loaded));
            prop_assert_eq!(decoded(&brick, &stored), Ok(loaded));
        }

        #[test]
        fn any_columns_are_decoded_or_refused(
            triangles in 1u32..90,
            flags in flags(),
            bytes in prop::collection::vec(any::<u8>(), 1..600),
            longer in 0usize..3,
        ) {
            let brick = brick(triangles, 5, flags);
            let length = Columns::of(&brick).bytes() + longer - 1;
            let columns: Vec<u8> = bytes.iter().cycle().take(length).copied().collect();
            let result = decoded(&brick, &pack(&columns));
            if let Ok(loaded) = result {
                // Nothing that is decoded is lost.
                prop_assert!(longer == 1);
                prop_assert_eq!(encode(&brick, &loaded), pack(&columns));
            }
        }

        #[test]
        fn changed_bytes_are_decoded_or_refused(
            triangles in 1u32..90,
            words in prop::collection::vec(0u32..9, 1..9),
            edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5),
        ) {
            let brick = brick(triangles, triangles, BRICK_DETAIL);
            let mut stored = encode(&brick, &loaded(&brick, &words, &words));
            for (at, value) in edits {
                *at.get_mut(&mut stored) = value;
            }
            let _ = decoded(&brick, &stored);
        }
    }
}
