//! Scene files back to integers: every triangle of every object on its lattice.

use bricks::{
    AttributeLayout, BRICK_INDEX32, BRICK_OPACITY, BRICK_WIDE, Brick, GeometryLayout, NONE, Object, OpacityTriangle,
    Payload, SURFACE_ROTATION_SHIFT, SceneFile,
};
use rayon::prelude::*;

/// A triangle of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TruthTriangle {
    /// Mesh-local index; the global id is that of the instance's triangle 0 plus this.
    pub local_id: u32,
    /// r of the vertex rotation: stored vertex i is source vertex (i + r) mod 3.
    pub rotation: u32,
    /// Stored vertices, in steps of the object's lattice.
    pub vertices: [[i64; 3]; 3],
    /// Words of the [`OpacityTriangle`] that says which rays pass, if some do.
    pub opacity: Option<[u32; 8]>,
}

impl TruthTriangle {
    /// What says which rays pass.
    pub(super) fn opacity(&self) -> Option<OpacityTriangle> {
        self.opacity.map(bytemuck::cast)
    }
}

/// An object on its lattice.
#[derive(Clone, Debug, PartialEq)]
pub struct TruthObject {
    /// log2 of the lattice step in object units.
    pub step_log2: i32,
    /// Triangles by increasing `local_id`, each once.
    pub triangles: Vec<TruthTriangle>,
    /// Least and greatest vertex coordinates of the object's bricks in lattice steps; zero without triangles. They
    /// bound the reference point that kernels use for its instances.
    pub bounds: [[i64; 3]; 2],
}

impl TruthObject {
    /// An object of these triangles.
    pub fn new(step_log2: i32, mut triangles: Vec<TruthTriangle>) -> Self {
        triangles.sort_by_key(|triangle| triangle.local_id);
        let mut vertices = triangles.iter().flat_map(|triangle| triangle.vertices);
        let first = vertices.next().unwrap_or_default();
        let bounds = vertices.fold([first, first], |[low, high], v| {
            [std::array::from_fn(|k| low[k].min(v[k])), std::array::from_fn(|k| high[k].max(v[k]))]
        });
        Self { step_log2, triangles, bounds }
    }
}

/// A scene file that has no truth.
#[derive(Debug, thiserror::Error)]
pub enum DecodeError {
    /// The scene file is damaged or cannot be read.
    #[error(transparent)]
    File(#[from] bricks::Error),
    /// A vertex is not on its object's lattice.
    #[error("brick {brick}: vertex {vertex} is not on the lattice of its object; convert the scene again")]
    OffLattice {
        /// The brick.
        brick: u32,
        /// The vertex within the brick.
        vertex: u32,
    },
    /// Two copies of a triangle differ in their vertices or rotation.
    #[error("object {object}: copies of triangle {local_id} differ; convert the scene again")]
    Copies {
        /// The object.
        object: u32,
        /// Mesh-local index of the triangle.
        local_id: u32,
    },
    /// Two triangles of the scene have one global id, or an id is beyond the greatest.
    #[error("triangle id {id} is given twice or is beyond 4294967294; convert the scene again")]
    Id {
        /// The id.
        id: u64,
    },
}

/// All objects of a file. Copies of split triangles are merged; that they agree is checked.
pub(super) fn objects(file: &SceneFile) -> Result<Vec<TruthObject>, DecodeError> {
    let bricks: Vec<u32> = (0..file.resident().exact_bricks() as u32).collect();
    objects_of(file, &bricks)
}

/// All objects of a file as these of its bricks and levels of detail show them.
pub(super) fn objects_of(file: &SceneFile, bricks: &[u32]) -> Result<Vec<TruthObject>, DecodeError> {
    let objects = 0..file.resident().objects.len() as u32;
    objects.map(|index| object(file, index, bricks)).collect()
}

fn object(file: &SceneFile, index: u32, bricks: &[u32]) -> Result<TruthObject, DecodeError> {
    let object = file.resident().objects[index as usize];
    let is_of_it = |brick: &u32| file.resident().brick(*brick).is_some_and(|brick| brick.object == index);
    let bricks: Vec<u32> = bricks.iter().copied().filter(is_of_it).collect();
    let parts: Vec<Vec<TruthTriangle>> =
        bricks.into_par_iter().map(|index| brick(file, &object, index)).collect::<Result<_, _>>()?;
    let mut triangles: Vec<TruthTriangle> = parts.into_iter().flatten().collect();
    triangles.par_sort_unstable_by_key(|triangle| {
        (triangle.local_id, triangle.vertices, triangle.rotation, triangle.opacity)
    });
    triangles.dedup();
    if let Some(pair) = triangles.windows(2).find(|pair| pair[0].local_id == pair[1].local_id) {
        return Err(DecodeError::Copies { object: index, local_id: pair[0].local_id });
    }
    Ok(TruthObject::new(object.step_log2, triangles))
}

/// Words of a payload, checked by the file as they are copied.
fn words(file: &SceneFile, payload: Payload) -> Result<Vec<u32>, DecodeError> {
    let mut words = vec![0u32; file.loaded_bytes(payload) as usize / 4];
    file.copy(payload, bytemuck::cast_slice_mut(&mut words))?;
    Ok(words)
}

fn brick(file: &SceneFile, object: &Object, index: u32) -> Result<Vec<TruthTriangle>, DecodeError> {
    let brick = &file.resident().bricks[index as usize];
    let geometry = words(file, Payload::Geometry(index))?;
    let attributes = words(file, Payload::Attributes(index))?;
    let layout = GeometryLayout::of(brick);
    let vertices = vertices(object, brick, index, &geometry[layout.vertices as usize / 4..])?;
    let ids = &geometry[layout.ids as usize / 4..];
    let indices = &geometry[layout.indices as usize / 4..];
    let surfaces = &attributes[AttributeLayout::of(brick).surfaces as usize / 4..];
    let corner = |at: usize| {
        if brick.flags & BRICK_INDEX32 != 0 {
            indices[at] as usize
        } else {
            // Two to a word, the first in the low half.
            (indices[at / 2] >> (16 * (at % 2)) & 0xffff) as usize
        }
    };
    let words_at = |offset: u64| &geometry[offset as usize / 4..];
    let opacity = |i: usize| {
        let number = (brick.flags & BRICK_OPACITY != 0).then(|| words_at(layout.opacity_of)[i])?;
        (number != NONE).then(|| words_at(layout.opacities).as_chunks().0[number as usize])
    };
    let triangle = |i: usize| TruthTriangle {
        local_id: ids[i],
        rotation: surfaces[i] >> SURFACE_ROTATION_SHIFT,
        vertices: std::array::from_fn(|k| vertices[corner(3 * i + k)]),
        opacity: opacity(i),
    };
    Ok((0..brick.triangle_count as usize).map(triangle).collect())
}

/// The vertices of a brick in steps of the object's lattice.
fn vertices(object: &Object, brick: &Brick, index: u32, words: &[u32]) -> Result<Vec<[i64; 3]>, DecodeError> {
    let steps_of_unit = f64::from(object.unit_log2 - object.step_log2).exp2();
    let wide = brick.flags & BRICK_WIDE != 0;
    let stride = if wide { 6 } else { 3 };
    let vertex = |(vertex, words): (u32, &[u32])| {
        let value = |k: usize| f64::from(f32::from_bits(words[k]));
        let mut point = [0i64; 3];
        for (k, coordinate) in point.iter_mut().enumerate() {
            // Both parts have 24 bits and multiples of one step, so that neither sum nor scaling rounds.
            let steps = (value(k) + if wide { value(k + 3) } else { 0.0 }) * steps_of_unit;
            if steps.fract() != 0.0 || steps.abs() > 2.0f64.powi(52) {
                return Err(DecodeError::OffLattice { brick: index, vertex });
            }
            *coordinate = brick.origin[k] + steps as i64;
        }
        Ok(point)
    };
    (0..brick.vertex_count).zip(words.chunks_exact(stride)).map(vertex).collect()
}
