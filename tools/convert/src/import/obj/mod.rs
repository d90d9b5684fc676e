//! OBJ with MTL (Wavefront, "Object files"): polygons, triangulated as fans.
//!
//! Each object or group with faces is a mesh; a primitive is a run of faces of one material, so that triangles keep
//! their order in the file. The text is run through once; its numbers go to the spool.

mod mtl;
mod parse;

use super::bytes::{Bytes, Spool, Stream};
use super::error::{ImportError, one_line};
use super::image::decode_texture;
use super::opened::{Opened, Parts, TriangleBudget};
use super::plain::{self, doubles, fault, floats, unreadable};
use super::reach::Reach;
use super::repairs::Repairs;
use super::table::Table;
use super::tangents;
use super::text::Lines;
use super::uri;
use super::vertices::Vertices;
use super::warnings::Warnings;
use crate::source::{MeshOutline, Outline, Primitive, SourceError, SourceTexture};
use bricks::NONE;
use parse::{Parsed, Run};
use std::collections::{BTreeMap, HashMap};
use std::io;
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::Xxh3;

/// Texture coordinates are taken as they are.
const SAME_UV: [[f32; 4]; 2] = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0]];

/// Largest file of materials.
const MAX_MATERIALS_BYTES: u64 = 256 << 20;

/// An OBJ file, opened.
struct Obj {
    label: String,
    positions: Table,
    colors: Option<Table>,
    uvs: Table,
    normals: Table,
    /// Position, texture coordinates and normal, or `NONE`, of three corners a row.
    triangles: Table,
    /// Parts of each mesh: run and first triangle.
    parts: Vec<Vec<(Run, u64)>>,
    textures: Vec<Texture>,
    /// Whether tangents are wanted, by material.
    wants_tangents: Vec<bool>,
    repairs: Repairs,
}

/// A texture.
struct Texture {
    name: String,
    wrap: u32,
    picture: Picture,
}

/// What a texture shows.
enum Picture {
    /// A picture.
    Whole(Result<Bytes, String>),
    /// The grey pictures of roughness, which goes to green, and of being metal, which goes to blue; white where there
    /// is none.
    Grey([Option<Result<Bytes, String>>; 2]),
}

/// Opens one .obj file. References lead as far as `within` lets them ([`Reach::of`]).
pub(super) fn open(
    (path, within): (&Path, Option<&Path>),
    axes: &[f64; 12],
    spool: &Spool,
    budget: &mut TriangleBudget,
) -> Result<Opened, ImportError> {
    let mut start = plain::start(path, spool)?;
    let reach = Reach::of(path, within)?;
    let label = start.label.clone();
    let stream = start.bytes.stream(spool).map_err(|e| unreadable(path, &e))?;
    let (parsed, stream) = parse::parse(path, stream, spool, &mut start.warnings, budget)?;
    let mut hash = Stream::finish(stream).map_err(|e| unreadable(path, &e))?;
    if parsed.triangles.count() == 0 {
        return Err(fault(path, "faces", "the file has none"));
    }
    let Looks { materials, textures } = looks(&reach, &parsed, spool, &mut start.warnings, &mut hash);

    let mut meshes: Vec<MeshOutline> = Vec::new();
    let mut parts: Vec<Vec<(Run, u64)>> = Vec::new();
    let mut last = None;
    for (i, run) in parsed.runs.iter().enumerate() {
        if last != Some(run.object) {
            let name = &parsed.objects[run.object as usize];
            let name = if name.is_empty() { plain::stem(path) } else { name.clone() };
            meshes.push(MeshOutline { name, ..MeshOutline::default() });
            parts.push(Vec::new());
            last = Some(run.object);
        }
        let end = parsed.runs.get(i + 1).map_or(parsed.triangles.count(), |next| next.first);
        // Just pushed if there was none.
        if let (Some(mesh), Some(of_mesh)) = (meshes.last_mut(), parts.last_mut()) {
            let primitive = mesh.parts.last().map_or(0, |part| part.primitive + 1);
            let mut first = run.first;
            for part in plain::parts(primitive, end - run.first) {
                mesh.parts.push(part);
                of_mesh.push((*run, first));
                first += u64::from(part.triangles);
            }
        }
    }
    let wants_tangents = materials.iter().map(|material| material.normal_texture != NONE).collect();
    let outline = Outline {
        materials,
        textures: textures.iter().map(|texture| texture.name.clone()).collect(),
        ..plain::outline(path, start, &hash, axes, meshes, false)
    };
    let Parsed { positions, colors, uvs, normals, triangles, .. } = parsed;
    let repairs = Repairs::new(label.clone());
    Ok(Opened {
        outline,
        parts: Box::new(Obj {
            label,
            positions,
            colors,
            uvs,
            normals,
            triangles,
            parts,
            textures,
            wants_tangents,
            repairs,
        }),
    })
}

/// Materials and pictures.
struct Looks {
    materials: Vec<bricks::Material>,
    textures: Vec<Texture>,
}

/// The materials that `parsed` uses, from the files that it names.
fn looks(reach: &Reach, parsed: &Parsed, spool: &Spool, warnings: &mut Warnings, hash: &mut Xxh3) -> Looks {
    let mut known = HashMap::new();
    for library in &parsed.libraries {
        match read_library(reach, library, spool, hash) {
            Ok(definitions) => {
                for mut definition in definitions {
                    definition.maps().for_each(|(file, _)| locate(reach, library, file));
                    known.entry(definition.name.clone()).or_insert(definition);
                }
            }
            Err(problem) => warnings.add("cannot read the materials", || format!("{} ({problem})", one_line(library))),
        }
    }
    let mut textures: Vec<Texture> = Vec::new();
    let mut numbers = BTreeMap::new();
    let mut materials = Vec::with_capacity(parsed.materials.len());
    for name in &parsed.materials {
        let place = || format!("material \"{}\"", one_line(name));
        let Some(definition) = known.get(name) else {
            // Faces before any `usemtl` have the unnamed material.
            if !name.is_empty() {
                warnings.add("is in no material library; grey used instead", place);
            }
            materials.push(plain::bare(parsed.colors.is_some()));
            continue;
        };
        let mut material = definition.material;
        let open = |file: &String| beside(reach, file, spool);
        let mut add = |key: [Option<&mtl::Map>; 3], make: &dyn Fn() -> Texture| {
            *numbers.entry(key.map(|map| map.cloned())).or_insert_with(|| {
                textures.push(make());
                textures.len() as u32 - 1
            })
        };
        let maps = [
            (&mut material.base_color_texture, &definition.color),
            (&mut material.normal_texture, &definition.normals),
            (&mut material.emissive_texture, &definition.emission),
        ];
        for (texture, map) in maps {
            let Some((file, wrap)) = map else { continue };
            let whole = || Texture { name: one_line(file), wrap: *wrap, picture: Picture::Whole(open(file)) };
            *texture = add([map.as_ref(), None, None], &whole);
        }
        let grey = [definition.roughness.as_ref(), definition.metallic.as_ref()];
        if let Some((_, wrap)) = grey[0].or(grey[1]) {
            let names: Vec<String> = grey.into_iter().flatten().map(|(file, _)| one_line(file)).collect();
            let pictures = || grey.map(|map| map.map(|(file, _)| open(file)));
            let combined = || Texture { name: names.join(" and "), wrap: *wrap, picture: Picture::Grey(pictures()) };
            material.metallic_roughness_texture = add([None, grey[0], grey[1]], &combined);
        }
        for warning in &definition.warnings {
            warnings.add(*warning, place);
        }
        materials.push(material);
    }
    Looks { materials, textures }
}

fn read_library(reach: &Reach, library: &str, spool: &Spool, hash: &mut Xxh3) -> Result<Vec<mtl::Definition>, String> {
    let bytes = beside(reach, library, spool)?;
    if bytes.len() > MAX_MATERIALS_BYTES {
        return Err("it is too large".into());
    }
    bytes.hash(spool, hash).map_err(|e| e.to_string())?;
    mtl::read(&mut Lines::new(bytes.stream(spool).map_err(|e| e.to_string())?)).map_err(|e| e.to_string())
}

/// Makes `file`, which a material library names, a path from the OBJ file's folder if it lies beside the library. Some
/// programs mean that folder, others the OBJ file's: then it stays as it is.
fn locate(reach: &Reach, library: &str, file: &mut String) {
    let library = library.replace('\\', "/");
    let Some((folder, _)) = library.rsplit_once('/') else { return };
    let beside = format!("{folder}/{file}");
    if below(reach, &beside).is_ok_and(|path| reach.path(&path).is_file()) {
        *file = beside;
    }
}

/// Where a file that the OBJ file names is, below the root; the path may be written as on Windows.
fn below(reach: &Reach, file: &str) -> Result<PathBuf, &'static str> {
    uri::below(reach.own(file.replace('\\', "/")))
}

/// Its bytes.
fn beside(reach: &Reach, file: &str, spool: &Spool) -> Result<Bytes, String> {
    reach.file(&below(reach, file)?, spool)
}

impl Parts for Obj {
    fn part(&self, mesh: usize, part: usize) -> Result<Primitive, SourceError> {
        let primitive = self.read(mesh, part);
        let mut primitive = primitive.map_err(|e| SourceError(format!("{}: cannot be read again: {e}", self.label)))?;
        plain::repair(&mut primitive, |what| self.repairs.add(what, (mesh, part as u32), || format!("mesh {mesh}")));
        Ok(primitive)
    }

    fn label(&self) -> &str {
        &self.label
    }

    fn vertex(&self, mesh: usize, part: usize, vertex: u32) -> Option<u64> {
        self.vertices(mesh, part).ok()?.used.get(vertex as usize).map(|[position, ..]| u64::from(*position))
    }

    fn texture(&self, index: usize) -> Result<SourceTexture, SourceError> {
        let Texture { name, wrap, picture } = &self.textures[index];
        let decode = |bytes: &Result<Bytes, String>| {
            bytes.as_ref().map_err(String::clone).and_then(|b| decode_texture(b, name.clone(), *wrap))
        };
        let decoded = match picture {
            Picture::Whole(bytes) => decode(bytes),
            Picture::Grey(pictures) => {
                let channel = |bytes: &Option<_>| bytes.as_ref().map(decode).transpose();
                channel(&pictures[0]).and_then(|roughness| Ok(combine(roughness, channel(&pictures[1])?)))
            }
        };
        decoded.map_err(|problem| {
            let file = &self.label;
            SourceError(format!("{file}: image {name}: the image cannot be used ({problem})"))
        })
    }

    fn repairs(&self) -> Vec<String> {
        self.repairs.lines()
    }
}

impl Obj {
    /// The vertices of a part: position, texture coordinates and normal.
    fn vertices(&self, mesh: usize, part: usize) -> io::Result<Vertices<[u32; 3]>> {
        let first = self.parts[mesh][part].1;
        // The first triangle of the next part of this run, or of the run after it.
        let rest = self.parts[mesh].get(part + 1).or_else(|| self.parts.get(mesh + 1)?.first());
        let end = rest.map_or(self.triangles.count(), |(_, first)| *first);
        let mut corners: Vec<[u32; 3]> = Vec::with_capacity(3 * (end - first) as usize);
        self.triangles.run(first, end, |_, row| {
            let word = |bytes: &[u8; 4]| u32::from_le_bytes(*bytes);
            let words = row.as_chunks::<4>().0;
            corners.extend(words.as_chunks::<3>().0.iter().map(|corner| corner.each_ref().map(word)));
            true
        })?;
        Ok(Vertices::of(corners))
    }

    fn read(&self, mesh: usize, part: usize) -> io::Result<Primitive> {
        let run = self.parts[mesh][part].0;
        let Vertices { used, indices } = self.vertices(mesh, part)?;
        let positions: Vec<u64> = used.iter().map(|[position, ..]| u64::from(*position)).collect();
        let colors = self.colors.as_ref().map(|colors| floats::<4>(colors, &positions)).transpose()?;
        let mut primitive = Primitive {
            material: run.material,
            positions: doubles(&self.positions, &positions)?,
            normals: if run.has_normals { Some(optional(&self.normals, used.iter().map(|v| v[2]))?) } else { None },
            uvs: if run.has_uvs { Some(optional(&self.uvs, used.iter().map(|v| v[1]))?) } else { None },
            colors,
            indices,
            ..Primitive::default()
        };
        if self.wants_tangents[run.material as usize] {
            primitive.tangents = tangents::make(&primitive, 0, &SAME_UV);
        }
        Ok(primitive)
    }
}

/// The red of one picture as green and that of another as blue, white where there is none, in the size of the larger of
/// them each way: the nearest texels are taken.
fn combine(roughness: Option<SourceTexture>, metallic: Option<SourceTexture>) -> SourceTexture {
    let channels = [roughness, metallic];
    let size = |of: fn(&SourceTexture) -> u32| channels.iter().flatten().map(of).max().unwrap_or(1);
    let (width, height) = (size(|texture| texture.width), size(|texture| texture.height));
    let texel = |channel: &Option<SourceTexture>, x: u32, y: u32| {
        channel.as_ref().map_or(255, |texture| {
            let nearest = |at: u32, of: u32, side: u32| (u64::from(at) * u64::from(side) / u64::from(of)) as usize;
            let (x, y) = (nearest(x, width, texture.width), nearest(y, height, texture.height));
            texture.rgba[4 * (y * texture.width as usize + x)]
        })
    };
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let rgba = texels.flat_map(|(x, y)| [255, texel(&channels[0], x, y), texel(&channels[1], x, y), 255]).collect();
    let first = channels.into_iter().flatten().next().unwrap_or_default();
    SourceTexture { width, height, rgba, ..first }
}

/// The floats of the rows `wanted`, in any order; zero for `NONE` and for those that are not there.
fn optional<const N: usize>(table: &Table, wanted: impl Iterator<Item = u32>) -> io::Result<Vec<[f32; N]>> {
    let is_there = |row: &u64| *row < table.count();
    let Vertices { used, indices } = Vertices::of(wanted.map(u64::from).collect());
    let values = floats::<N>(table, &used[..used.partition_point(is_there)])?;
    Ok(indices.iter().map(|&i| values.get(i as usize).copied().unwrap_or([0.0; N])).collect())
}

const _: () = assert!(NONE == u32::MAX, "what is absent sorts behind what is there");
