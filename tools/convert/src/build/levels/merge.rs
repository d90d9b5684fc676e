//! The triangles of the children of a level, read back from the file.

use super::vector::Vec3;
use crate::build::error::BuildError;
use crate::build::triangles::intern::Interner;
use crate::build::triangles::lattice::{Lattice, pow2};
use bricks::{
    AttributeLayout, AttributeVertex, BRICK_INDEX32, BRICK_WIDE, Brick, GeometryLayout, NO_NORMAL, SURFACE_MATERIAL,
    SURFACE_ROTATION_SHIFT, Written,
};

/// Triangles with their distinct vertices.
#[derive(Debug)]
pub(super) struct Merged {
    /// Positions, in steps of the object's lattice.
    pub positions: Vec<[i64; 3]>,
    /// Attribute vertices.
    pub shades: Vec<Shade>,
    /// The triangles, child by child.
    pub triangles: Vec<Source>,
}

/// A triangle that a level stands for. Corners are in source order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source {
    /// Its id.
    pub id: u32,
    /// Its material.
    pub material: u32,
    /// Its positions.
    pub corners: [u32; 3],
    /// Its attribute vertices.
    pub shades: [u32; 3],
}

/// What a level takes of an attribute vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shade {
    /// Unit normal in the object's space; zero where there is none.
    pub normal: [f32; 3],
    /// Linear RGB of the vertex colour.
    pub color: [f32; 3],
}

/// Reads bricks of one object.
pub(super) fn merge(written: &Written, bricks: &[&Brick], lattice: &Lattice) -> Result<Merged, BuildError> {
    let vertices = bricks.iter().map(|brick| brick.vertex_count as usize).sum();
    let triangles = bricks.iter().map(|brick| brick.triangle_count as usize).sum();
    let shades = bricks.iter().map(|brick| brick.attribute_vertex_count as usize).sum();
    let mut positions = Interner::with_capacity(vertices);
    let mut merged =
        Merged { positions: Vec::new(), shades: Vec::with_capacity(shades), triangles: Vec::with_capacity(triangles) };
    for brick in bricks {
        let geometry = written.read(brick.geometry)?;
        let stored = written.read(brick.attributes)?;
        let mut attributes = vec![0; AttributeLayout::of(brick).bytes as usize];
        let unpacked = bricks::attributes::decode(brick, &stored, &mut Vec::new(), &mut attributes);
        unpacked.map_err(|error| BuildError::Inconsistent {
            what: "a brick that was written".to_owned(),
            found: error.to_string(),
            expected: "attributes".to_owned(),
        })?;
        add(brick, &geometry, &attributes, lattice, &mut positions, &mut merged);
    }
    merged.positions = positions.values().to_vec();
    Ok(merged)
}

fn words<T: bytemuck::AnyBitPattern>(bytes: &[u8], offset: u64, count: usize) -> impl Iterator<Item = T> + '_ {
    bytes[offset as usize..][..count * size_of::<T>()].chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned)
}

fn triples(bytes: &[u8], offset: u64, brick: &Brick) -> Vec<[u32; 3]> {
    let count = brick.triangle_count as usize;
    match brick.flags & BRICK_INDEX32 {
        0 => words::<[u16; 3]>(bytes, offset, count).map(|triple| triple.map(u32::from)).collect(),
        _ => words(bytes, offset, count).collect(),
    }
}

/// Adds the triangles of a brick.
fn add(
    brick: &Brick,
    geometry: &[u8],
    attributes: &[u8],
    lattice: &Lattice,
    positions: &mut Interner<[i64; 3]>,
    merged: &mut Merged,
) {
    let layout = GeometryLayout::of(brick);
    let scale = pow2(-lattice.step_unit_log2());
    // Exact: a coordinate is a whole number of steps, of 24 bits in each part.
    let step = |x: f32| (f64::from(x) * scale) as i64;
    let count = brick.vertex_count as usize;
    let mut place = |p: [i64; 3]| positions.intern(std::array::from_fn(|k| p[k] + brick.origin[k])).0;
    let places: Vec<u32> = match brick.flags & BRICK_WIDE {
        0 => words::<[f32; 3]>(geometry, layout.vertices, count).map(|p| place(p.map(step))).collect(),
        _ => words::<[f32; 6]>(geometry, layout.vertices, count)
            .map(|p| place(std::array::from_fn(|k| step(p[k]) + step(p[k + 3]))))
            .collect(),
    };
    let surfaces = AttributeLayout::of(brick);
    let first = merged.shades.len() as u32;
    let vertices = words::<AttributeVertex>(attributes, 0, brick.attribute_vertex_count as usize);
    merged.shades.extend(vertices.map(|vertex| Shade {
        normal: normal(vertex.normal),
        color: std::array::from_fn(|k| (vertex.color >> (8 * k) & 255) as f32 / 255.0),
    }));
    let count = brick.triangle_count as usize;
    let ids = words::<u32>(geometry, layout.ids, count);
    let surface_words = words::<u32>(attributes, surfaces.surfaces, count);
    let corners = triples(geometry, layout.indices, brick);
    let shades = triples(attributes, surfaces.indices, brick);
    let rows = ids.zip(surface_words).zip(corners.iter().zip(&shades));
    merged.triangles.extend(rows.map(|((id, surface), (corners, shades))| {
        // Stored corner i is source corner (i + rotation) mod 3.
        let rotation = (surface >> SURFACE_ROTATION_SHIFT) as usize;
        let stored = |k: usize| (k + 3 - rotation) % 3;
        Source {
            id,
            material: surface & SURFACE_MATERIAL,
            corners: std::array::from_fn(|k| places[corners[stored(k)] as usize]),
            shades: std::array::from_fn(|k| first + shades[stored(k)]),
        }
    }));
}

/// The unit vector of an octahedral normal; zero if it is none.
fn normal(bits: u32) -> [f32; 3] {
    if bits == NO_NORMAL {
        return [0.0; 3];
    }
    let [x, y] = [bits as u16 as i16, (bits >> 16) as u16 as i16].map(|x| (f32::from(x) / 32767.0).max(-1.0));
    let z = 1.0 - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    let v = [x - fold.copysign(x), y - fold.copysign(y), z];
    let length = v.iter().map(|x| x * x).sum::<f32>().sqrt();
    v.map(|x| x / length)
}

impl Merged {
    /// Least and greatest coordinates.
    pub fn bounds(&self) -> [[i64; 3]; 2] {
        self.positions.iter().fold([[i64::MAX; 3], [i64::MIN; 3]], |[low, high], p| {
            [std::array::from_fn(|k| low[k].min(p[k])), std::array::from_fn(|k| high[k].max(p[k]))]
        })
    }

    /// Positions relative to `origin`; exact.
    pub fn relative(&self, origin: [i64; 3]) -> Vec<Vec3> {
        self.positions.iter().map(|p| std::array::from_fn(|k| (p[k] - origin[k]) as f64)).collect()
    }
}
