//! KHR_draco_mesh_compression: primitives compressed by Draco, decoded into the spool.

use super::accessor::Accessor;
use super::document::{Document, Draco};
use super::file::{File, Problem, item};
use crate::import::error::{EXPORT_AGAIN, one_line};
use crate::import::panics::quietly;
use crate::import::table::TableWriter;
use draco_core::{DataType, DecodeLimits, DecoderBuffer, Mesh, MeshDecoder};
use gltf::json::{Index, buffer};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Most faces or points for a byte of a compressed primitive: the best measured streams of regular meshes spend a sixth
/// of a bit on a face.
const MAX_FACES_A_BYTE: u64 = 64;

/// Primitives may have as many faces or points at any rate.
const FREE_FACES: u64 = 1 << 20;

/// Most bytes of attributes for a byte of a compressed primitive, beside those of the free faces. Constants take next
/// to nothing, but positions are rarely constant.
const MAX_RATIO: u64 = 1024;

/// Bytes of attributes that any primitive may have.
const FREE_BYTES: u64 = 64 << 20;

/// A decoded primitive: a list of triangles.
pub(super) struct Decoded {
    /// Three indices a triangle.
    pub indices: Accessor,
    /// Attributes by their unique ids.
    attributes: BTreeMap<u32, Attribute>,
}

struct Attribute {
    values: Accessor,
    /// What integers stand for when they are normalised.
    scale: f64,
}

/// Where compressed bytes are: buffer, offset, length.
type Key = (usize, u64, u64);

/// Decoded primitives, by the bytes they are compressed to.
pub(super) type Primitives = BTreeMap<Key, Result<Decoded, String>>;

impl Decoded {
    /// The attribute `name` of a primitive that `json` compresses.
    ///
    /// Normalised integers are left for the shapes of accessors to state: see [`scale`](Self::scale).
    pub fn attribute(&self, json: &Draco, name: &str) -> Option<&Accessor> {
        Some(&self.attributes.get(json.attributes.get(name)?)?.values)
    }

    /// What the components of attribute `name` are divided by if they are normalised.
    pub fn scale(&self, json: &Draco, name: &str) -> f64 {
        json.attributes.get(name).and_then(|id| self.attributes.get(id)).map_or(1.0, |attribute| attribute.scale)
    }
}

/// Where the bytes of a buffer view are.
fn key(document: &Document, view: Index<buffer::View>) -> Result<Key, Problem> {
    let view = item(&document.buffer_views, view, "buffer view")?;
    Ok((view.buffer.value(), view.byte_offset.unwrap_or_default().0, view.byte_length.0))
}

/// The decoded primitive of `json`.
pub(super) fn find<'a>(document: &Document, decoded: &'a Primitives, json: &Draco) -> Result<&'a Decoded, Problem> {
    let problem = |what: &str| Problem::new(format!("Draco compression: {what}"));
    match decoded.get(&key(document, json.buffer_view)?) {
        Some(Ok(decoded)) => Ok(decoded),
        Some(Err(what)) => Err(problem(what)),
        None => Err(problem("it could not be decoded")),
    }
}

/// Decodes the primitives of the meshes that `is_used` marks, each once.
pub(super) fn decode(file: &File, is_used: &[bool]) -> Primitives {
    let document = &file.document;
    let meshes = document.meshes.iter().zip(is_used).filter(|(_, is_used)| **is_used);
    let primitives = meshes.flat_map(|(mesh, _)| &mesh.primitives);
    // Those without a buffer view are told where they are looked for.
    let views = primitives.filter_map(|p| p.more.extensions.draco.as_ref()).map(|draco| draco.buffer_view);
    let views: BTreeMap<_, _> = views.filter_map(|view| Some((key(document, view).ok()?, view))).collect();
    let views: Vec<_> = views.into_iter().collect();
    views.into_par_iter().map(|(key, view)| (key, decode_view(file, view))).collect()
}

fn decode_view(file: &File, view: Index<buffer::View>) -> Result<Decoded, String> {
    file.spool.progress().check().map_err(|stop| stop.to_string())?;
    let (bytes, _) = file.view(view).map_err(|problem| problem.what)?;
    let bytes = bytes.read()?;
    let faces = FREE_FACES.max(bytes.len() as u64 * MAX_FACES_A_BYTE);
    let limits = DecodeLimits::permissive()
        .with_max_faces(faces)
        .with_max_points(faces)
        .with_max_decoded_bytes(FREE_BYTES.max(bytes.len() as u64 * MAX_RATIO));
    let mesh = quietly(|| {
        let mut mesh = Mesh::new();
        let mut buffer = DecoderBuffer::new(&bytes).with_limits(limits);
        MeshDecoder::new().decode(&mut buffer, &mut mesh).map(|()| mesh).map_err(|e| one_line(&e.to_string()))
    })
    .unwrap_or_else(|| Err("its data is damaged".into()))?;
    let points = mesh.num_points();
    if points as u64 > 3 * faces {
        return Err(format!("it has {points} points, more than its {} bytes can hold", bytes.len()));
    }
    let mut indices = TableWriter::new(&file.spool, 4);
    for face in mesh.faces() {
        for point in face {
            if point.0 as usize >= points {
                return Err(format!("a face refers to point {}, but there are {points}", point.0));
            }
            indices.push(&point.0.to_le_bytes())?;
        }
    }
    let mut attributes = BTreeMap::new();
    for id in 0..mesh.num_attributes() {
        let attribute = mesh.try_attribute(id).map_err(|e| one_line(&e.to_string()))?;
        let width = usize::from(attribute.num_components());
        if !(1..=4).contains(&width) {
            continue;
        }
        let scale = match attribute.data_type() {
            DataType::Int8 => 127.0,
            DataType::Uint8 => 255.0,
            DataType::Int16 => 32767.0,
            DataType::Uint16 => 65535.0,
            DataType::Float32 => 1.0,
            // glTF has no others for attributes that are read.
            _ => continue,
        };
        let values = quietly(|| attribute.read_f32s(points, width)).ok_or("its data is damaged")?;
        let mut writer = TableWriter::new(&file.spool, 4 * width);
        for value in values.chunks_exact(width) {
            writer.push(bytemuck::cast_slice(value))?;
        }
        let values = Accessor::of_floats(writer.finish()?, width);
        attributes.insert(attribute.unique_id(), Attribute { values, scale });
    }
    Ok(Decoded { indices: Accessor::of_indices(indices.finish()?), attributes })
}

/// The problem of a primitive whose attribute `name` is in no compressed data and has no plain copy.
pub(super) fn missing(name: &str) -> Problem {
    Problem { what: format!("{name} is neither in the Draco data nor in a buffer"), remedy: EXPORT_AGAIN }
}
