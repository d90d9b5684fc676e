//! glTF 2.0, as JSON or GLB.
//!
//! The node hierarchy of one scene becomes placements, in depth-first order; each mesh in use is stored once. Geometry
//! is taken at rest.
//!
//! The `gltf` crate is the model of the document, without its validator. Own code does what the crate lacks:
//!
//! - Matrices and placements are f64 (`document`, `nodes`); the crate reads f32, too coarse far from the origin.
//! - Extensions of geometry, materials and lights (`draco`, `meshopt`, `nodes`, `materials`, `lights`); the crate lacks
//!   them, or reads them in f32.
//! - Checks where something is followed (`file`, `accessor`, `nodes`). The crate's validator refuses extensions that
//!   are read here, and its readers panic on what it would have refused.
//! - Buffers larger than memory, read piece by piece, and decoded ones in the spool (`file`, `accessor`); the crate
//!   wants each buffer in memory.
//!
//! Opening a file parses its JSON and checks the ranges of what is in use; geometry is read part by part when it is
//! asked for, images are decoded one by one.

mod accessor;
mod document;
mod draco;
mod file;
mod further;
mod glb;
mod lights;
mod materials;
mod meshes;
mod meshopt;
mod names;
mod nodes;
mod passing;

use super::affine::{Affine, multiply};
use super::bytes::{Bytes, Spool};
use super::error::{EXPORT_AGAIN, ImportError, show};
use super::image::{decode_texture, pack};
use super::opened::{Opened, Parts, TriangleBudget};
use super::repairs::Repairs;
use super::warnings::Warnings;
use crate::source::{
    IDENTITY, MeshOutline, Outline, PART_TRIANGLES, PartOutline, Placement, Primitive, SourceError, SourceTexture,
    shines_to_front,
};
use file::{File, Problem};
use materials::{Images, Picture, Texture};
use meshes::Checked;
use names::{display_name, label};
use std::path::Path;
use std::sync::Arc;

/// Most triangles stored for a byte of input. A triangle of its own takes several bytes; many meshes may share
/// accessors (to differ in material, say), but without a bound a small file could demand any amount of work.
const MAX_SHARING: u64 = 64;

/// Instances whose transformations are read at once.
const INSTANCES_AT_ONCE: u64 = 1 << 14;

/// A glTF file, opened.
struct Gltf {
    label: String,
    /// Meshes in use.
    meshes: Vec<Mesh>,
    /// Names and images of the textures in use.
    textures: Vec<(String, Texture)>,
    /// Where each image is, or why nowhere.
    images: Vec<Result<Bytes, String>>,
    /// Where each material of the file is among all; the default ones follow them.
    materials: Vec<u32>,
    /// The first default one.
    default_material: u32,
    repairs: Repairs,
}

/// A mesh in use.
struct Mesh {
    /// As messages show it.
    label: String,
    primitives: Vec<Checked>,
    /// Primitive and first triangle of each part.
    parts: Vec<(u32, u64)>,
}

/// Opens one .gltf or .glb file: of its scenes the one that is asked for, by name or number; placements tell which
/// nodes above them the asked names match. References lead as far as `within` lets them
/// ([`Reach::of`](super::reach::Reach::of)).
pub(super) fn open(
    (path, within): (&Path, Option<&Path>),
    asked: (Option<&str>, &[String]),
    spool: &Arc<Spool>,
    budget: &mut TriangleBudget,
) -> Result<Opened, ImportError> {
    let unreadable = |reason| ImportError::Read { file: show(path), reason };
    let bytes = spool.file(path).map_err(unreadable)?;
    open_piece((path, within), [&bytes, &bytes], asked, &IDENTITY, spool, budget)
}

/// Opens the glTF file that is a piece of the file at `path`, whose bytes are `[all, piece]`, placed by `placing`: a
/// rotation, and a translation to which the centre of CESIUM_RTC adds.
pub(super) fn open_piece(
    (path, within): (&Path, Option<&Path>),
    bytes: [&Bytes; 2],
    asked: (Option<&str>, &[String]),
    placing: &Affine,
    spool: &Arc<Spool>,
    budget: &mut TriangleBudget,
) -> Result<Opened, ImportError> {
    let mut warnings = Warnings::new(show(path));
    let mut file = File::open((path, within), bytes, spool.clone(), &mut warnings)?;
    let mut placing = *placing;
    for (row, center) in file.document.extensions.rtc.iter().flat_map(|rtc| rtc.center.into_iter().enumerate()) {
        placing[4 * row + 3] += center;
    }
    let document = &file.document;
    meshes::check_references(document).map_err(|(mesh, primitive, problem)| {
        file.fault(meshes::primitive_place(document, mesh, primitive), problem)
    })?;
    let has_animation = !document.animations.is_empty();
    if has_animation {
        warnings.add("animations ignored; rest pose used", String::new);
    }
    meshopt::decode_views(&mut file)?;
    let document = &file.document;
    let nodes::Placed { uses, lights } = nodes::uses(&file, asked, &placing, &mut warnings)?;
    let mut is_used = vec![false; document.meshes.len()];
    uses.iter().for_each(|one| is_used[one.mesh] = true);
    let (meshes, numbers) = check_meshes(&file, &is_used, &mut warnings)?;
    count(&file, &uses, &meshes, &numbers, budget)?;

    let mut is_used = vec![false; document.materials.len()];
    let mut needs_default = false;
    for primitive in meshes.iter().flat_map(|mesh| &mesh.primitives) {
        match primitive.material() {
            Some(material) => is_used[material] = true,
            None => needs_default = true,
        }
    }
    let materials::Materials { records: mut materials, places, textures, .. } =
        materials::load(&file, &is_used, &mut warnings);
    let default_material = materials.len() as u32;
    if needs_default {
        materials.extend([materials::default_material(), bricks::Material::GREY]);
    }
    let image_name = |texture: &Texture| {
        let image = texture.image();
        display_name(image, document.images[image].0.as_ref().ok().and_then(|image| image.more.name.as_deref()))
    };
    let textures: Vec<_> = textures.into_iter().map(|texture| (image_name(&texture), texture)).collect();
    let outlines =
        meshes.iter().zip(numbers_used(&numbers)).map(|(mesh, m)| mesh.outline(document, m, (&materials, &places)));
    let outline = Outline {
        meshes: outlines.collect(),
        placements: place(&file, &uses, &numbers)?,
        materials,
        textures: textures.iter().map(|(name, _)| name.clone()).collect(),
        lights,
        sources: vec![file.source],
        warnings: warnings.into_lines(),
        has_animation,
        has_own_light: false,
    };
    let repairs = Repairs::new(file.label.clone());
    let parts =
        Gltf { label: file.label, meshes, textures, images: file.images, materials: places, default_material, repairs };
    Ok(Opened { outline, parts: Box::new(parts) })
}

impl Parts for Gltf {
    fn part(&self, mesh: usize, part: usize) -> Result<Primitive, SourceError> {
        let in_mesh = &self.meshes[mesh];
        let (number, primitive, first, end) = in_mesh.part(part);
        // Where there is none, the default one of glTF shows the vertices' colours, grey stands for what has none.
        let default = self.default_material + u32::from(!primitive.has_colors());
        let material = primitive.material().map_or(default, |material| self.materials[material]);
        let place = || format!("{} primitive {number}", in_mesh.label);
        let read = primitive.read(first, end, material).map_err(|Problem { what, remedy }| {
            let file = self.label.clone();
            SourceError(ImportError::Content { file, place: place(), problem: what, remedy }.to_string())
        })?;
        for repair in read.repairs {
            self.repairs.add(repair, (mesh, number), place);
        }
        Ok(read.primitive)
    }

    fn label(&self) -> &str {
        &self.label
    }

    fn vertex(&self, mesh: usize, part: usize, vertex: u32) -> Option<u64> {
        let (_, primitive, first, end) = self.meshes[mesh].part(part);
        primitive.vertex(first, end, vertex)
    }

    fn texture(&self, index: usize) -> Result<SourceTexture, SourceError> {
        let (name, texture) = &self.textures[index];
        match &texture.picture {
            Picture::Whole(images) => self.decode(images, name, texture.wrap),
            Picture::Packed { channels, passing } => {
                let mut read: Vec<(&Images, SourceTexture)> = Vec::new();
                for images in texture.picture.images() {
                    if read.iter().all(|(known, _)| *known != images) {
                        read.push((images, self.decode(images, name, texture.wrap)?));
                    }
                }
                let place = |images: &Images| read.iter().position(|(known, _)| *known == images);
                let channels = channels
                    .each_ref()
                    .map(|channel| channel.as_ref().and_then(|(images, from)| Some((place(images)?, *from))));
                let share = passing.as_ref().and_then(|(images, ..)| place(images));
                let read: Vec<_> = read.into_iter().map(|(_, texture)| texture).collect();
                let changing = share.map(|share| pack(&read, [Some((share, 0)), None, None, None], name.clone(), 0));
                let mut packed = pack(&read, channels, name.clone(), texture.wrap);
                if let (Some((_, passing, changed)), Some(changing)) = (passing, changing) {
                    passing.change(*changed, &mut packed.rgba, &changing.rgba);
                }
                Ok(packed)
            }
        }
    }

    fn repairs(&self) -> Vec<String> {
        self.repairs.lines()
    }
}

impl Gltf {
    /// The first of these images that can be decoded.
    fn decode(&self, images: &Images, name: &str, wrap: u32) -> Result<SourceTexture, SourceError> {
        let mut first_problem = None;
        for &image in images {
            let bytes = self.images[image].as_ref().map_err(String::clone);
            match bytes.and_then(|bytes| decode_texture(bytes, name.to_owned(), wrap)) {
                Ok(texture) => return Ok(texture),
                Err(problem) => first_problem.get_or_insert((image, problem)),
            };
        }
        // At least one image was tried.
        let (image, problem) = first_problem.unwrap_or_default();
        let place = label("image", image, Some(name).filter(|name| **name != image.to_string()));
        Err(SourceError(format!("{}: {place}: the image cannot be used ({problem})", self.label)))
    }
}

impl Mesh {
    fn outline(
        &self,
        document: &document::Document,
        number: usize,
        (materials, places): (&[bricks::Material], &[u32]),
    ) -> MeshOutline {
        let part = |&(primitive, first): &(u32, u64)| {
            let triangles = self.primitives[primitive as usize].triangles() - first;
            // In range: at most `PART_TRIANGLES`.
            PartOutline { primitive, triangles: triangles.min(PART_TRIANGLES.into()) as u32 }
        };
        let name = display_name(number, document.meshes[number].name.as_deref());
        // The default material does not shine.
        let shines = |primitive: &Checked| {
            let material = primitive.material().and_then(|m| materials.get(*places.get(m)? as usize));
            material.is_some_and(shines_to_front)
        };
        let shines_to_front = self.primitives.iter().any(shines);
        MeshOutline { name, parts: self.parts.iter().map(part).collect(), shines_to_front }
    }

    /// A part: its primitive with that one's number, and its first triangle and the one behind its last.
    fn part(&self, part: usize) -> (u32, &Checked, u64, u64) {
        let (number, first) = self.parts[part];
        let primitive = &self.primitives[number as usize];
        (number, primitive, first, primitive.triangles().min(first + u64::from(PART_TRIANGLES)))
    }

    fn triangles(&self) -> u64 {
        self.primitives.iter().map(Checked::triangles).sum()
    }
}

/// Checks the meshes in use. Also gives the new number of each mesh of the file that is in use.
fn check_meshes(
    file: &File,
    is_used: &[bool],
    warnings: &mut Warnings,
) -> Result<(Vec<Mesh>, Vec<Option<u32>>), ImportError> {
    let document = &file.document;
    let decoded = draco::decode(file, is_used);
    let mut meshes = Vec::new();
    let mut numbers = Vec::with_capacity(is_used.len());
    for (m, &is_used) in is_used.iter().enumerate() {
        if !is_used {
            numbers.push(None);
            continue;
        }
        let mut primitives = Vec::with_capacity(document.meshes[m].primitives.len());
        let mut parts = Vec::new();
        for (p, json) in document.meshes[m].primitives.iter().enumerate() {
            let place = || meshes::primitive_place(document, m, p);
            let primitive = meshes::check(file, json, &decoded, warnings, &place);
            let primitive = primitive.map_err(|problem| file.fault(place(), problem))?;
            // A primitive without triangles has one empty part.
            let firsts = (0..primitive.triangles().max(1)).step_by(PART_TRIANGLES as usize);
            parts.extend(firsts.map(|first| (p as u32, first)));
            primitives.push(primitive);
        }
        numbers.push(Some(meshes.len() as u32));
        let label = label("mesh", m, document.meshes[m].name.as_deref());
        meshes.push(Mesh { label, primitives, parts });
    }
    Ok((meshes, numbers))
}

/// The meshes of the file that have a new number.
fn numbers_used(numbers: &[Option<u32>]) -> impl Iterator<Item = usize> {
    numbers.iter().enumerate().filter_map(|(m, number)| number.map(|_| m))
}

/// Counts triangles and instances against what the file can hold and ids can number.
fn count(
    file: &File,
    uses: &[nodes::Use],
    meshes: &[Mesh],
    numbers: &[Option<u32>],
    budget: &mut TriangleBudget,
) -> Result<(), ImportError> {
    let mut instanced = 0u64;
    for one in uses {
        let instances = one.instances.as_ref().map_or(1, |i| i.count);
        // Instances have attributes of their own but for a few nodes that share them; the buffers bound what that may
        // multiply to.
        instanced = instanced.saturating_add(one.instances.as_ref().map_or(0, |_| instances));
        if instanced > file.input_bytes {
            let what = format!("brings the instances to {instanced}, more than the file and its buffers can hold");
            return Err(file.fault(nodes::node_place(&file.document, one.node), Problem::new(what)));
        }
        let triangles = numbers[one.mesh].map_or(0, |mesh| meshes[mesh as usize].triangles());
        budget.add(&file.label, instances, triangles)?;
    }
    let stored: u64 = meshes.iter().map(Mesh::triangles).sum();
    if stored / MAX_SHARING > file.input_bytes {
        let what = format!("its meshes repeat the same accessors to {stored} triangles");
        let remedy = "use one mesh for several nodes instead of copies of it";
        return Err(file.fault("meshes".into(), Problem { what, remedy }));
    }
    Ok(())
}

/// The placements of all uses, instances multiplied out.
fn place(file: &File, uses: &[nodes::Use], numbers: &[Option<u32>]) -> Result<Vec<Placement>, ImportError> {
    let document = &file.document;
    let mut placements = Vec::with_capacity(uses.len());
    for one in uses {
        let name = display_name(one.node, document.nodes[one.node].name.as_deref());
        // Every mesh in use has a number.
        let Some(mesh) = numbers[one.mesh] else { continue };
        let Some(instances) = &one.instances else {
            placements.push(Placement { name, under: one.names_above(), mesh, source: 0, world_from_mesh: one.world });
            continue;
        };
        let fault = |what: String, remedy| file.fault(nodes::node_place(document, one.node), Problem { what, remedy });
        for first in (0..instances.count).step_by(INSTANCES_AT_ONCE as usize) {
            let end = instances.count.min(first + INSTANCES_AT_ONCE);
            let matrices = instances.matrices(first, end);
            let matrices = matrices.map_err(|e| fault(format!("its instances cannot be read: {e}"), EXPORT_AGAIN))?;
            for (i, matrix) in (first..).zip(matrices) {
                let matrix = matrix.map_err(|what| fault(format!("instance {i}: {what}"), EXPORT_AGAIN))?;
                let world_from_mesh = multiply(&one.world, &matrix);
                if !world_from_mesh.iter().all(|c| c.is_finite()) {
                    return Err(fault(format!("instance {i}: its transformation is not finite"), EXPORT_AGAIN));
                }
                let (name, under) = (name.clone(), one.names_above());
                placements.push(Placement { name, under, mesh, source: 0, world_from_mesh });
            }
        }
    }
    Ok(placements)
}
