//! The triangles of the children of a level, read back from the file.

use super::vector::{Vec3, length};
use crate::build::error::BuildError;
use crate::build::input::matrix::Affine;
use crate::build::triangles::intern::Interner;
use crate::build::triangles::lattice::{Lattice, pow2};
use bricks::{
    AttributeDetail, AttributeLayout, AttributeVertex, BRICK_DETAIL, BRICK_INDEX32, BRICK_WIDE, Brick, GeometryLayout,
    Instance, NO_NORMAL, SURFACE_MATERIAL, SURFACE_ROTATION_SHIFT, Written,
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
    /// Linear RGB and alpha of the vertex colour.
    pub color: [f32; 4],
    /// Both sets of texture coordinates.
    pub uvs: [[f32; 2]; 2],
}

/// A child of a level.
#[derive(Clone, Copy)]
pub(super) struct Child<'a> {
    /// The brick.
    pub brick: &'a Brick,
    /// The lattice of its object.
    pub lattice: &'a Lattice,
    /// What places it in the world, if it is not placed as the level is.
    pub placed: Option<&'a Instance>,
}

/// Reads children of a level of an object with this lattice.
pub(super) fn merge(written: &Written, children: &[Child], lattice: &Lattice) -> Result<Merged, BuildError> {
    let bricks = || children.iter().map(|child| child.brick);
    let vertices = bricks().map(|brick| brick.vertex_count as usize).sum();
    let triangles = bricks().map(|brick| brick.triangle_count as usize).sum();
    let shades = bricks().map(|brick| brick.attribute_vertex_count as usize).sum();
    let mut positions = Interner::with_capacity(vertices);
    let mut merged =
        Merged { positions: Vec::new(), shades: Vec::with_capacity(shades), triangles: Vec::with_capacity(triangles) };
    for child in children {
        let brick = child.brick;
        let geometry = written.read(brick.geometry)?;
        let stored = written.read(brick.attributes)?;
        let mut attributes = vec![0; AttributeLayout::of(brick).bytes as usize];
        let unpacked = bricks::attributes::decode(brick, &stored, &mut Vec::new(), &mut attributes);
        unpacked.map_err(|error| BuildError::Inconsistent {
            what: "a brick that was written".to_owned(),
            found: error.to_string(),
            expected: "attributes".to_owned(),
        })?;
        let place = Place::of(child, lattice);
        add(brick, (&geometry, &attributes), &place, &mut positions, &mut merged);
    }
    merged.positions = positions.values().to_vec();
    Ok(merged)
}

/// How a child comes onto the lattice of its level.
struct Place<'a> {
    from: &'a Lattice,
    to: &'a Lattice,
    /// World from object, and what maps normals.
    through: Option<(Affine, [f64; 9])>,
    /// Added to ids.
    base: u32,
    /// Corners in their new order: a mirror turns triangles over, whose outside stays the outside.
    order: [usize; 3],
}

impl<'a> Place<'a> {
    fn of(child: &Child<'a>, to: &'a Lattice) -> Self {
        let from = child.lattice;
        let Some(instance) = child.placed else { return Self { from, to, through: None, base: 0, order: [0, 1, 2] } };
        let matrix = Affine(instance.world_from_object);
        let order = if matrix.determinant() < 0.0 { [0, 2, 1] } else { [0, 1, 2] };
        Self { from, to, through: Some((matrix, matrix.normal_matrix())), base: instance.base, order }
    }

    fn point(&self, p: [i64; 3]) -> [i64; 3] {
        match &self.through {
            None => p,
            Some((matrix, _)) => self.to.round(matrix.point(p.map(|x| self.from.length(x)))),
        }
    }

    fn normal(&self, n: [f32; 3]) -> [f32; 3] {
        let Some((_, m)) = &self.through else { return n };
        let [x, y, z] = n.map(f64::from);
        let v: Vec3 = std::array::from_fn(|k| m[3 * k] * x + m[3 * k + 1] * y + m[3 * k + 2] * z);
        let size = length(v);
        if size > 0.0 { v.map(|x| (x / size) as f32) } else { [0.0; 3] }
    }
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
    (geometry, attributes): (&[u8], &[u8]),
    place: &Place,
    positions: &mut Interner<[i64; 3]>,
    merged: &mut Merged,
) {
    let layout = GeometryLayout::of(brick);
    let scale = pow2(-place.from.step_unit_log2());
    // Exact: a coordinate is a whole number of steps, of 24 bits in each part.
    let step = |x: f32| (f64::from(x) * scale) as i64;
    let count = brick.vertex_count as usize;
    let mut number = |p: [i64; 3]| positions.intern(place.point(std::array::from_fn(|k| p[k] + brick.origin[k]))).0;
    let places: Vec<u32> = match brick.flags & BRICK_WIDE {
        0 => words::<[f32; 3]>(geometry, layout.vertices, count).map(|p| number(p.map(step))).collect(),
        _ => words::<[f32; 6]>(geometry, layout.vertices, count)
            .map(|p| number(std::array::from_fn(|k| step(p[k]) + step(p[k + 3]))))
            .collect(),
    };
    let surfaces = AttributeLayout::of(brick);
    let first = merged.shades.len() as u32;
    let vertices = words::<AttributeVertex>(attributes, 0, brick.attribute_vertex_count as usize);
    let details = match brick.flags & BRICK_DETAIL {
        0 => 0,
        _ => brick.attribute_vertex_count as usize,
    };
    let details = words::<AttributeDetail>(attributes, surfaces.details, details).map(|detail| detail.uv);
    let details = details.chain(std::iter::repeat([0.0; 2]));
    merged.shades.extend(vertices.zip(details).map(|(vertex, second)| Shade {
        normal: place.normal(normal(vertex.normal)),
        color: std::array::from_fn(|k| (vertex.color >> (8 * k) & 255) as f32 / 255.0),
        uvs: [vertex.uv, second],
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
        let stored = |k: usize| (place.order[k] + 3 - rotation) % 3;
        Source {
            id: place.base + id,
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
