//! Scenes as glTF 2.0 for other programs, written part by part: what is held is a few parts and a record of each.
//!
//! A mesh of the scene is a mesh there, a part a primitive, a placement a node; all keep their order, and so do
//! triangles. Positions are f32 relative to an anchor of their mesh, by which its nodes are moved.

use super::output;
use crate::error::Error;
use bricks::{MATERIAL_BLEND, MATERIAL_DOUBLE_SIDED, MATERIAL_MASK};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{PART_TRIANGLES, PartOutline, Placement, Primitive, Source, SourceError};
use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Value, json};
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::OnceLock;

/// Vertices up to this number are counted in 16 bits; glTF reserves the greatest index (section 3.7.2.1).
const SHORT_VERTICES: usize = 65_535;
/// Triangles that a thread encodes before they are written, about.
const BATCH_TRIANGLES: u64 = 2 * PART_TRIANGLES as u64;
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const UNSIGNED_SHORT: u32 = 5123;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
/// Says how much dielectrics reflect.
const SPECULAR: &str = "KHR_materials_specular";
/// Lets emission be more than 1.
const STRENGTH: &str = "KHR_materials_emissive_strength";
/// GLB header and two chunk headers (glTF 2.0, section 4.4).
const GLB_HEADERS: u64 = 12 + 8 + 8;

/// The two forms of glTF.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GltfForm {
    /// `.glb`: one file, below 4 GiB.
    Binary,
    /// `.gltf`, and the buffer beside it in `.bin`.
    Separate,
}

impl GltfForm {
    /// The form that the extension of `path` stands for, upper and lower case alike; `None`: another format.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?;
        let is = |known: &str| extension.eq_ignore_ascii_case(known);
        if is("glb") {
            Some(Self::Binary)
        } else if is("gltf") {
            Some(Self::Separate)
        } else {
            None
        }
    }
}

/// Writes a scene as glTF 2.0: positions, normals, vertex colours, the factors of materials, nodes with names. For
/// [`GltfForm::Separate`] the buffer `dir/S.bin` appears before `dir/S.gltf`. Each file appears complete or not at all.
/// Works on the threads of the current pool.
///
/// # Errors
///
/// [`Error::GlbSize`] for a scene too large for [`GltfForm::Binary`], [`Error::Write`] when a file cannot be written,
/// [`Error::Interrupted`].
pub fn write_gltf(scene: &dyn Source, path: &Path, form: GltfForm, progress: &Progress) -> Result<(), Error> {
    match form {
        GltfForm::Binary => write_binary(scene, path, u32::MAX.into(), progress),
        GltfForm::Separate => write_separate(scene, path, progress),
    }
}

/// Writes a file of at most `most` bytes.
fn write_binary(source: &dyn Source, path: &Path, most: u64, progress: &Progress) -> Result<(), Error> {
    let failed = |source| Error::Write { path: path.to_path_buf(), source };
    let too_large = || Error::GlbSize { path: path.to_path_buf() };
    // The JSON comes first, but is known last.
    let mut buffer = tempfile::tempfile_in(output::folder(path)).map_err(failed)?;
    let written = write_buffer(source, &mut buffer, most, progress, &failed)?.ok_or_else(too_large)?;
    let mut text = serde_json::to_vec(&document(source, &written, None)).map_err(|e| failed(e.into()))?;
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = GLB_HEADERS + text.len() as u64 + written.bytes;
    if length > most {
        return Err(too_large());
    }
    let mut temporary = output::temporary(path).map_err(failed)?;
    let mut write = |file: &mut File| {
        file.write_all(b"glTF")?;
        let chunk = |bytes: u64, kind: &[u8; 4]| [(bytes as u32).to_le_bytes(), *kind].concat();
        file.write_all(&[2u32.to_le_bytes(), (length as u32).to_le_bytes()].concat())?;
        file.write_all(&chunk(text.len() as u64, b"JSON"))?;
        file.write_all(&text)?;
        file.write_all(&chunk(written.bytes, b"BIN\0"))?;
        buffer.seek(SeekFrom::Start(0))?;
        io::copy(&mut buffer, file)
    };
    write(temporary.as_file_mut()).and_then(|_| output::publish(temporary, path)).map_err(failed)
}

/// Writes a file and its buffer.
fn write_separate(source: &dyn Source, path: &Path, progress: &Progress) -> Result<(), Error> {
    let beside = path.with_extension("bin");
    let failed = |source| Error::Write { path: path.to_path_buf(), source };
    let buffer_failed = |source| Error::Write { path: beside.clone(), source };
    let name = beside.file_name().and_then(|name| name.to_str());
    let name = name.ok_or_else(|| failed(io::Error::other("its name is not UTF-8, which references in glTF are")))?;
    let mut buffer = output::temporary(&beside).map_err(buffer_failed)?;
    let written = write_buffer(source, buffer.as_file_mut(), u64::MAX, progress, &buffer_failed)?;
    // Only a limit makes it stop early.
    let written = written.unwrap_or_default();
    let mut temporary = output::temporary(path).map_err(failed)?;
    let mut out = BufWriter::new(temporary.as_file_mut());
    serde_json::to_writer(&mut out, &document(source, &written, Some(percent_encoded(name))))
        .map_err(io::Error::from)
        .and_then(|()| out.flush())
        .map_err(failed)?;
    drop(out);
    output::publish(buffer, &beside).map_err(buffer_failed)?;
    output::publish(temporary, path).map_err(failed)
}

/// What has been written into a buffer.
#[derive(Default)]
struct Written {
    bytes: u64,
    /// Of each mesh with parts.
    anchors: Vec<[f64; 3]>,
    /// Of all parts of all meshes.
    records: Vec<Record>,
}

/// Where a part lies and what its accessors say. Positions, normals, colours and indices follow each other without
/// gaps.
struct Record {
    start: u64,
    vertices: u64,
    indices: u64,
    has_normals: bool,
    has_colors: bool,
    material: u32,
    /// Least and greatest coordinates.
    bounds: [[f32; 3]; 2],
}

/// Writes all parts, `None` as soon as there are more than `most` bytes.
fn write_buffer(
    source: &dyn Source,
    out: &mut File,
    most: u64,
    progress: &Progress,
    failed: &dyn Fn(io::Error) -> Error,
) -> Result<Option<Written>, Error> {
    let meshes = &source.outline().meshes;
    let parts: Vec<(usize, usize, PartOutline)> =
        (0..).zip(meshes).flat_map(|(m, mesh)| (0..).zip(&mesh.parts).map(move |(p, part)| (m, p, *part))).collect();
    let anchors: Vec<OnceLock<Result<[f64; 3], SourceError>>> = vec![OnceLock::new(); meshes.len()];
    progress.phase("writing", parts.iter().map(|(_, _, part)| u64::from(part.triangles)).sum());
    let mut written = Written::default();
    let mut left = &parts[..];
    while !left.is_empty() {
        progress.check()?;
        let (batch, rest) = left.split_at(batch(left, BATCH_TRIANGLES * rayon::current_num_threads() as u64));
        left = rest;
        let encoded: Result<Vec<_>, SourceError> = batch
            .par_iter()
            .map(|&(mesh, part, _)| {
                let primitive = source.part(mesh, part)?;
                // By the first part of the mesh, whichever part comes first.
                let anchor = anchors[mesh].get_or_init(|| match part {
                    0 => Ok(anchor_of(&primitive)),
                    _ => source.part(mesh, 0).map(|first| anchor_of(&first)),
                });
                Ok(encode(&primitive, anchor.clone()?))
            })
            .collect();
        for (mut record, bytes) in encoded? {
            record.start = written.bytes;
            written.bytes += bytes.len() as u64;
            if written.bytes > most {
                return Ok(None);
            }
            out.write_all(&bytes).map_err(failed)?;
            progress.advance(record.indices / 3);
            written.records.push(record);
        }
    }
    let anchor = |anchor: OnceLock<_>| anchor.into_inner().unwrap_or(Ok([0.0; 3]));
    written.anchors = anchors.into_iter().map(anchor).collect::<Result<_, _>>()?;
    Ok(Some(written))
}

/// Number of the first parts that together have `triangles` triangles; at least one.
fn batch(parts: &[(usize, usize, PartOutline)], triangles: u64) -> usize {
    let mut sum = 0;
    let fitting = parts.iter().take_while(|(_, _, part)| {
        sum += u64::from(part.triangles);
        sum <= triangles
    });
    fitting.count().max(1).min(parts.len())
}

/// The middle of a part, in whole units, so that it is exact in decimals, too.
fn anchor_of(primitive: &Primitive) -> [f64; 3] {
    let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
    for position in &primitive.positions {
        for k in 0..3 {
            bounds[0][k] = bounds[0][k].min(position[k]);
            bounds[1][k] = bounds[1][k].max(position[k]);
        }
    }
    [0, 1, 2].map(|k| (0.5 * bounds[0][k] + 0.5 * bounds[1][k]).round()).map(|c| if c.is_finite() { c } else { 0.0 })
}

/// The bytes of a part.
fn encode(primitive: &Primitive, anchor: [f64; 3]) -> (Record, Vec<u8>) {
    let Primitive { material, positions, normals, colors, indices, .. } = primitive;
    let mut bytes = Vec::with_capacity(40 * positions.len() + 4 * indices.len());
    let mut bounds = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
    for position in positions {
        for k in 0..3 {
            // Adding zero makes -0 positive.
            let c = (position[k] - anchor[k]) as f32 + 0.0;
            bounds[0][k] = bounds[0][k].min(c);
            bounds[1][k] = bounds[1][k].max(c);
            bytes.extend_from_slice(&c.to_le_bytes());
        }
    }
    let floats = |bytes: &mut Vec<u8>, values: &[f32]| values.iter().for_each(|c| bytes.extend(c.to_le_bytes()));
    floats(&mut bytes, normals.as_ref().map_or(&[][..], |normals| normals.as_flattened()));
    floats(&mut bytes, colors.as_ref().map_or(&[][..], |colors| colors.as_flattened()));
    if positions.len() <= SHORT_VERTICES {
        indices.iter().for_each(|&k| bytes.extend((k as u16).to_le_bytes()));
        bytes.resize(bytes.len().next_multiple_of(4), 0);
    } else {
        indices.iter().for_each(|k| bytes.extend(k.to_le_bytes()));
    }
    let record = Record {
        start: 0,
        vertices: positions.len() as u64,
        indices: indices.len() as u64,
        has_normals: normals.is_some(),
        has_colors: colors.is_some(),
        material: *material,
        bounds,
    };
    (record, bytes)
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Document<'a> {
    asset: Value,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    extensions_used: Vec<&'static str>,
    scene: u32,
    scenes: Value,
    nodes: Vec<Node<'a>>,
    meshes: Vec<Mesh<'a>>,
    materials: Vec<Value>,
    accessors: Vec<Accessor>,
    buffer_views: Vec<View>,
    buffers: Vec<Value>,
}

#[derive(Serialize)]
struct Node<'a> {
    name: &'a str,
    mesh: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    translation: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    matrix: Option<[f64; 16]>,
}

#[derive(Serialize)]
struct Mesh<'a> {
    name: &'a str,
    primitives: Vec<JsonPrimitive>,
}

#[derive(Serialize)]
struct JsonPrimitive {
    attributes: Attributes,
    indices: usize,
    material: u32,
}

#[derive(Serialize)]
#[serde(rename_all = "SCREAMING_SNAKE_CASE")]
struct Attributes {
    position: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    normal: Option<usize>,
    #[serde(rename = "COLOR_0", skip_serializing_if = "Option::is_none")]
    color: Option<usize>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: usize,
    component_type: u32,
    count: u64,
    #[serde(rename = "type")]
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    min: Option<[f32; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    max: Option<[f32; 3]>,
}

#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct View {
    buffer: u32,
    byte_offset: u64,
    byte_length: u64,
    target: u32,
}

/// The JSON of a scene whose buffer is the file `uri`; `None`: the chunk behind it.
fn document<'a>(source: &'a dyn Source, written: &Written, uri: Option<String>) -> Document<'a> {
    let outline = source.outline();
    let (mut accessors, mut views) = (Vec::new(), Vec::new());
    let mut records = written.records.iter();
    let meshes = outline.meshes.iter().map(|mesh| Mesh {
        name: &mesh.name,
        primitives: records
            .by_ref()
            .take(mesh.parts.len())
            .map(|record| record.describe(&mut accessors, &mut views))
            .collect(),
    });
    let meshes = meshes.collect();
    let nodes = outline.placements.iter().map(|p| node(p, written.anchors[p.mesh as usize]));
    let buffer = match uri {
        Some(uri) => json!({ "byteLength": written.bytes, "uri": uri }),
        None => json!({ "byteLength": written.bytes }),
    };
    Document {
        asset: json!({ "version": "2.0", "generator": concat!("brickwalk ", env!("CARGO_PKG_VERSION")) }),
        scene: 0,
        scenes: json!([{ "nodes": (0..outline.placements.len()).collect::<Vec<_>>() }]),
        nodes: nodes.collect(),
        meshes,
        extensions_used: extensions_used(&outline.materials),
        materials: outline.materials.iter().map(material).collect(),
        accessors,
        buffer_views: views,
        buffers: vec![buffer],
    }
}

impl Record {
    /// Adds the accessors and buffer views of the part.
    fn describe(&self, accessors: &mut Vec<Accessor>, views: &mut Vec<View>) -> JsonPrimitive {
        let mut byte_offset = self.start;
        let mut add = |component_type, size: u64, count, kind, bounds: Option<[[f32; 3]; 2]>, target| {
            let byte_length = size * count;
            views.push(View { buffer: 0, byte_offset, byte_length, target });
            byte_offset += byte_length;
            let (min, max) = (bounds.map(|b| b[0]), bounds.map(|b| b[1]));
            accessors.push(Accessor { buffer_view: views.len() - 1, component_type, count, kind, min, max });
            accessors.len() - 1
        };
        let position = add(FLOAT, 12, self.vertices, "VEC3", Some(self.bounds), ARRAY_BUFFER);
        let normal = self.has_normals.then(|| add(FLOAT, 12, self.vertices, "VEC3", None, ARRAY_BUFFER));
        let color = self.has_colors.then(|| add(FLOAT, 16, self.vertices, "VEC4", None, ARRAY_BUFFER));
        let is_short = self.vertices <= SHORT_VERTICES as u64;
        let (code, size) = if is_short { (UNSIGNED_SHORT, 2) } else { (UNSIGNED_INT, 4) };
        let indices = add(code, size, self.indices, "SCALAR", None, ELEMENT_ARRAY_BUFFER);
        JsonPrimitive { attributes: Attributes { position, normal, color }, indices, material: self.material }
    }
}

/// The node of a placement whose mesh lies `anchor` away from where its positions say.
fn node(placement: &Placement, anchor: [f64; 3]) -> Node<'_> {
    let m = &placement.world_from_mesh;
    let [x, y, z] = anchor;
    let t = [0, 1, 2].map(|r| m[4 * r] * x + m[4 * r + 1] * y + m[4 * r + 2] * z + m[4 * r + 3]);
    let columns = [m[0], m[4], m[8], 0.0, m[1], m[5], m[9], 0.0, m[2], m[6], m[10], 0.0, t[0], t[1], t[2], 1.0];
    let is_moved_only = (0..12).all(|k| columns[k] == if k % 5 == 0 { 1.0 } else { 0.0 });
    Node {
        name: &placement.name,
        mesh: placement.mesh,
        translation: is_moved_only.then_some(t),
        matrix: (!is_moved_only).then_some(columns),
    }
}

/// Whether the dielectric part of a material reflects nothing.
fn is_without_highlight(material: &bricks::Material) -> bool {
    material.specular_weight == 0.0
}

/// The greatest factor of its emission.
fn strength(material: &bricks::Material) -> f32 {
    material.emission.iter().copied().fold(0.0, f32::max)
}

/// What the materials need beyond glTF's own.
fn extensions_used(materials: &[bricks::Material]) -> Vec<&'static str> {
    let without_highlight = materials.iter().any(is_without_highlight).then_some(SPECULAR);
    let strong = materials.iter().any(|material| strength(material) > 1.0).then_some(STRENGTH);
    without_highlight.into_iter().chain(strong).collect()
}

/// The factors of a material.
fn material(material: &bricks::Material) -> Value {
    let is = |flag: u32| material.flags & flag != 0;
    let alpha_mode = match () {
        () if is(MATERIAL_BLEND) => "BLEND",
        () if is(MATERIAL_MASK) => "MASK",
        () => "OPAQUE",
    };
    let mut json = json!({
        "pbrMetallicRoughness": {
            "baseColorFactor": material.base_color,
            "metallicFactor": material.metallic,
            "roughnessFactor": material.roughness,
        },
        "emissiveFactor": material.emission,
        "doubleSided": is(MATERIAL_DOUBLE_SIDED),
        "alphaMode": alpha_mode,
    });
    if is(MATERIAL_MASK) {
        json["alphaCutoff"] = material.alpha_cutoff.into();
    }
    if is_without_highlight(material) {
        // Without the extension glTF's materials have one.
        json["extensions"][SPECULAR] = json!({ "specularFactor": 0 });
    }
    let strength = strength(material);
    if strength > 1.0 {
        json["emissiveFactor"] = json!(material.emission.map(|c| c / strength));
        json["extensions"][STRENGTH] = json!({ "emissiveStrength": strength });
    }
    json
}

/// A file name as a URI (RFC 3986, section 2).
fn percent_encoded(name: &str) -> String {
    let mut uri = String::with_capacity(name.len());
    for &byte in name.as_bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'.' | b'_' | b'~' => uri.push(char::from(byte)),
            _ => uri.push_str(&format!("%{byte:02X}")),
        }
    }
    uri
}

#[cfg(test)]
mod tests {
    use super::*;
    use brickwalk_convert::import::{ImportSettings, import};
    use brickwalk_convert::source::{IDENTITY, InMemory, Mesh, SourceScene};

    /// A triangle of millimetres, 6400 km away from the origin.
    fn far_away() -> InMemory {
        let at = |x, y, z| [6.4e6 + x, y - 6.4e6, z];
        let positions = vec![at(0.0, 0.0, 0.0), at(0.001, 0.0, 0.0), at(0.0, 0.001, 0.0)];
        let primitive = Primitive { positions, indices: vec![0, 1, 2], ..Primitive::default() };
        InMemory::from(SourceScene {
            meshes: vec![Mesh { name: "far".into(), primitives: vec![primitive] }],
            placements: vec![Placement { name: "far".into(), world_from_mesh: IDENTITY, ..Placement::default() }],
            materials: vec![crate::material::material([0.5; 3], 0.5, MATERIAL_MASK)],
            ..SourceScene::default()
        })
    }

    #[test]
    fn large_coordinates_keep_their_digits() {
        let (folder, source) = (tempfile::tempdir().unwrap(), far_away());
        let file = folder.path().join("far.glb");
        write_binary(&source, &file, u32::MAX.into(), &Progress::hidden()).unwrap();
        let read = import(&[file.into()], &ImportSettings::default(), &Progress::hidden()).unwrap();
        assert_eq!(read.outline().materials[0], source.outline().materials[0]);
        let m = read.outline().placements[0].world_from_mesh;
        let (there, here) = (read.part(0, 0).unwrap(), source.part(0, 0).unwrap());
        for (p, q) in there.positions.iter().zip(&here.positions) {
            for k in 0..3 {
                // f32 relative to an anchor within half a unit: 2^-25; f64 at 6.4e6: 2^-30.
                assert!((p[k] + m[4 * k + 3] - q[k]).abs() < 2.0f64.powi(-24), "{p:?} {q:?}");
                let lost = f64::from(q[k] as f32) - q[k];
                assert!(k != 0 || q[0] == 6.4e6 || lost.abs() > 1e-4, "f32 alone would lose it: {lost}");
            }
        }
    }

    #[test]
    fn too_much_for_a_glb_is_refused_and_leaves_nothing() {
        let (folder, source) = (tempfile::tempdir().unwrap(), far_away());
        let file = folder.path().join("a.glb");
        write_binary(&source, &file, u32::MAX.into(), &Progress::hidden()).unwrap();
        let bytes = std::fs::metadata(&file).unwrap().len();
        write_binary(&source, &file, bytes, &Progress::hidden()).unwrap();
        std::fs::remove_file(&file).unwrap();
        for most in [bytes - 1, 8] {
            let error = write_binary(&source, &file, most, &Progress::hidden()).unwrap_err().to_string();
            assert!(error.contains("a.glb: ") && error.contains("a.gltf"), "{error}");
        }
        let stopped = Progress::hidden();
        stopped.interrupt();
        assert!(matches!(write_separate(&source, &file, &stopped), Err(Error::Interrupted(_))));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn names_become_uris() {
        assert_eq!(percent_encoded("city-1.bin"), "city-1.bin");
        assert_eq!(percent_encoded("a b%ü.bin"), "a%20b%25%C3%BC.bin");
    }
}
