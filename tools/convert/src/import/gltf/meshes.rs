//! Meshes (glTF 2.0, section 3.7): primitives are checked first, which gives their triangle counts, then read in parts.

use super::accessor::{Accessor, Shape};
use super::document::{Document, Primitive as Json};
use super::draco;
use super::file::{File, Problem, item};
use super::materials::Coordinates;
use super::names::label;
use crate::import::tangents;
use crate::import::vertices::Vertices;
use crate::import::warnings::Warnings;
use crate::source::Primitive;
use gltf::json::accessor::{ComponentType as Component, Type};
use gltf::json::mesh::{Mode, Semantic};
use gltf::json::validation::Checked::{Invalid, Valid};
use std::io;

/// How elements form triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Topology {
    Triangles,
    Strip,
    Fan,
}

impl Topology {
    /// Triangles of `elements` vertices or indices; left-over elements form none.
    fn triangles(self, elements: u64) -> u64 {
        match self {
            Self::Triangles => elements / 3,
            Self::Strip | Self::Fan => elements.saturating_sub(2),
        }
    }

    /// The elements of triangle `i`, in the order that the specification gives, so that all faces of a strip wind
    /// alike.
    fn corners(self, i: u64) -> [u64; 3] {
        match self {
            Self::Triangles => [3 * i, 3 * i + 1, 3 * i + 2],
            Self::Strip => [i, i + 1 + i % 2, i + 2 - i % 2],
            Self::Fan => [i + 1, i + 2, 0],
        }
    }

    /// The elements of triangles `first` to `end`, ascending, without repetition.
    fn elements(self, first: u64, end: u64) -> Vec<u64> {
        match self {
            _ if first == end => Vec::new(),
            Self::Triangles => (3 * first..3 * end).collect(),
            Self::Strip => (first..end + 2).collect(),
            Self::Fan => std::iter::once(0).chain(first + 1..end + 2).collect(),
        }
    }
}

/// A primitive whose accessors have been checked.
pub(super) struct Checked {
    /// Material of the file; `None`: the default one.
    material: Option<usize>,
    /// `None`: it has no triangles to read.
    geometry: Option<Geometry>,
}

struct Geometry {
    topology: Topology,
    triangles: u64,
    positions: Accessor,
    normals: Option<Accessor>,
    uvs: Option<Accessor>,
    uvs1: Option<Accessor>,
    tangents: Option<Accessor>,
    /// Set and rows of the normal texture's coordinates; `None`: no tangents are wanted.
    normal_coordinates: Option<(usize, [[f32; 4]; 2])>,
    /// Tangents are wanted even where there are no coordinates.
    is_anisotropic: bool,
    colors: Option<Accessor>,
    indices: Option<Accessor>,
}

/// The tangent of anisotropy without texture coordinates: what of the mesh's x axis lies along the surface.
const ALONG_X: [f32; 4] = [1.0, 0.0, 0.0, 1.0];

const FLOAT_OR_QUANTIZED: &[Component] =
    &[Component::F32, Component::I8, Component::U8, Component::I16, Component::U16];
const POSITION: Shape = Shape { kinds: &[Type::Vec3], components: FLOAT_OR_QUANTIZED, always_normalized: false };
const NORMAL: Shape = Shape {
    kinds: &[Type::Vec3],
    components: &[Component::F32, Component::I8, Component::I16],
    always_normalized: true,
};
const TANGENT: Shape = Shape { kinds: &[Type::Vec4], ..NORMAL };
const TEXCOORD: Shape = Shape { kinds: &[Type::Vec2], components: FLOAT_OR_QUANTIZED, always_normalized: false };
const COLOR: Shape = Shape {
    kinds: &[Type::Vec3, Type::Vec4],
    components: &[Component::F32, Component::U8, Component::U16],
    always_normalized: true,
};
const INDICES: Shape = Shape {
    kinds: &[Type::Scalar],
    components: &[Component::U8, Component::U16, Component::U32],
    always_normalized: false,
};

/// "mesh 2 \"door\" primitive 0".
pub(super) fn primitive_place(document: &Document, mesh: usize, primitive: usize) -> String {
    let name = document.meshes.get(mesh).and_then(|m| m.name.as_deref());
    format!("{} primitive {primitive}", label("mesh", mesh, name))
}

/// Checks the indices of every mesh of the file, used or not.
pub(super) fn check_references(document: &Document) -> Result<(), (usize, usize, Problem)> {
    for (m, mesh) in document.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            for &accessor in primitive.attributes.values().chain(&primitive.indices) {
                item(&document.accessors, accessor, "accessor").map_err(|problem| (m, p, problem))?;
            }
        }
    }
    Ok(())
}

/// Checks one primitive of `file`. Those without triangles (points, lines, no positions) stay as empty ones, so that
/// primitives keep their numbers; the reason is noted for `place`.
pub(super) fn check(
    file: &File,
    json: &Json,
    decoded: &draco::Primitives,
    warnings: &mut Warnings,
    place: &dyn Fn() -> String,
) -> Result<Checked, Problem> {
    let material = json.material.and_then(|index| match item(&file.document.materials, index, "material") {
        // A malformed one is told where materials are read.
        Ok(_) => Some(index.value()),
        Err(problem) => {
            warnings.add("unknown material; default material used", || format!("{} ({})", place(), problem.what));
            None
        }
    });
    let draco = json.more.extensions.draco.as_ref();
    let topology = match json.mode {
        Valid(Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) => {
            warnings.add("points and lines skipped", place);
            return Ok(Checked { material, geometry: None });
        }
        Valid(Mode::Triangles) => Topology::Triangles,
        // Draco decodes to a list of triangles whatever was compressed.
        Valid(_) if draco.is_some() => Topology::Triangles,
        Valid(Mode::TriangleStrip) => Topology::Strip,
        Valid(Mode::TriangleFan) => Topology::Fan,
        Invalid => return Err(Problem::new("unknown primitive mode")),
    };
    let compressed = match draco {
        Some(draco) => Some((draco, draco::find(&file.document, decoded, draco)?)),
        None => None,
    };
    let attribute = |semantic: Semantic, shape: &Shape| {
        let name = &semantic.to_string();
        let Some(&index) = json.attributes.get(&Valid(semantic)) else { return Ok(None) };
        let plain = Accessor::resolve(file, index, shape)
            .map_err(|problem| Problem { what: format!("{name}: {}", problem.what), ..problem })?;
        let Some((draco, decoded)) = compressed else { return Ok(Some(plain)) };
        match decoded.attribute(draco, name) {
            Some(values) if values.width == plain.width => {
                let scale = if plain.normalized { decoded.scale(draco, name) } else { 1.0 };
                Ok(Some(values.clone().scaled(scale)))
            }
            Some(values) => Err(Problem::new(format!("{name} has {} components in the Draco data", values.width))),
            None if plain.is_empty_of_data() => Err(draco::missing(name)),
            None => Ok(Some(plain)),
        }
    };
    let Some(positions) = attribute(Semantic::Positions, &POSITION)? else {
        warnings.add("no POSITION; skipped", place);
        return Ok(Checked { material, geometry: None });
    };
    let normals = attribute(Semantic::Normals, &NORMAL)?;
    let colors = attribute(Semantic::Colors(0), &COLOR)?;
    let looks = material.and_then(|m| file.document.materials[m].0.as_ref().ok());
    let Coordinates { sets, normal, is_anisotropic } = looks.map(Coordinates::of).unwrap_or_default();
    let uvs = attribute(Semantic::TexCoords(0), &TEXCOORD)?;
    let uvs1 = if sets[1] { attribute(Semantic::TexCoords(1), &TEXCOORD)? } else { None };
    let is_there = [uvs.is_some(), uvs1.is_some()];
    if (0..2).any(|set| sets[set] && !is_there[set]) {
        warnings.add("textured, but without texture coordinates", place);
    }
    let normal_coordinates = normal.filter(|(set, _)| is_there[*set]);
    // Tangents without normals mean nothing (glTF 2.0, section 3.7.2.1).
    let has_frame = (normal_coordinates.is_some() || is_anisotropic) && normals.is_some();
    let tangents = if has_frame { attribute(Semantic::Tangents, &TANGENT)? } else { None };
    let others = [("NORMAL", &normals), ("COLOR_0", &colors), ("TEXCOORD_0", &uvs), ("TEXCOORD_1", &uvs1)];
    for (name, other) in others.into_iter().chain([("TANGENT", &tangents)]) {
        if let Some(other) = other.as_ref().filter(|other| other.count != positions.count) {
            return Err(Problem::new(format!("{name} has {} elements, POSITION {}", other.count, positions.count)));
        }
    }
    if json.targets.as_ref().is_some_and(|targets| !targets.is_empty()) {
        warnings.add("morph targets ignored; rest shape used", place);
    }
    let indices = match json.indices {
        _ if let Some((_, decoded)) = compressed => Some(decoded.indices.clone()),
        Some(index) => Some(
            Accessor::resolve(file, index, &INDICES)
                .map_err(|problem| Problem { what: format!("indices: {}", problem.what), ..problem })?,
        ),
        None => None,
    };
    let elements = indices.as_ref().map_or(positions.count, |a| a.count);
    if topology == Topology::Triangles && !elements.is_multiple_of(3) {
        warnings.add("incomplete last triangle skipped", place);
    }
    let triangles = topology.triangles(elements);
    let geometry = Geometry {
        topology,
        triangles,
        positions,
        normals,
        uvs,
        uvs1,
        tangents,
        normal_coordinates,
        is_anisotropic,
        colors,
        indices,
    };
    Ok(Checked { material, geometry: Some(geometry) })
}

/// A part that was read, and what was repaired in it.
pub(super) struct Read {
    pub primitive: Primitive,
    /// Kinds of repair.
    pub repairs: Vec<&'static str>,
}

impl Checked {
    /// Number of triangles.
    pub fn triangles(&self) -> u64 {
        self.geometry.as_ref().map_or(0, |g| g.triangles)
    }

    /// Whether its vertices have colours.
    pub fn has_colors(&self) -> bool {
        self.geometry.as_ref().is_some_and(|geometry| geometry.colors.is_some())
    }

    /// Material of the file; `None`: there is none.
    pub fn material(&self) -> Option<usize> {
        self.material
    }

    /// The number of vertex `vertex` of what [`Self::read`] reads of triangles `first` to `end`.
    pub fn vertex(&self, first: u64, end: u64, vertex: u32) -> Option<u64> {
        let unreadable = |e: io::Error| Problem::new(e.to_string());
        let vertices = self.geometry.as_ref()?.vertices(first, end, unreadable).ok()?;
        vertices.used.get(vertex as usize).copied()
    }

    /// Reads triangles `first` to `end`, at most the number of triangles; their material is `material`.
    pub fn read(&self, first: u64, end: u64, material: u32) -> Result<Read, Problem> {
        let mut repairs = Vec::new();
        let Some(geometry) = &self.geometry else {
            return Ok(Read { primitive: Primitive { material, ..Default::default() }, repairs });
        };
        let unreadable = |e: io::Error| Problem {
            what: format!("cannot be read: {e}"),
            remedy: "keep the file and its buffers in place while it is converted",
        };
        let Vertices { used, indices } = geometry.vertices(first, end, unreadable)?;
        let positions = geometry.positions.gather::<3>(&used).map_err(unreadable)?;
        let mut repair = |value: &mut f32, otherwise: f32, what| {
            if !value.is_finite() {
                *value = otherwise;
                if !repairs.contains(&what) {
                    repairs.push(what);
                }
            }
        };
        let normals = geometry.normals.as_ref().map(|normals| normals.gather::<3>(&used)).transpose();
        let normals = normals.map_err(unreadable)?.map(|normals| {
            let normal = |normal: [f64; 3]| {
                let mut normal = normal.map(|c| c as f32);
                if normal.iter().any(|c| !c.is_finite()) {
                    normal.iter_mut().for_each(|c| repair(c, 0.0, "non-finite normals set to zero"));
                    normal = [0.0; 3];
                }
                normal
            };
            normals.into_iter().map(normal).collect()
        });
        let mut coordinates = |uvs: &Option<Accessor>| {
            let uvs = uvs.as_ref().map(|uvs| uvs.gather::<2>(&used)).transpose().map_err(unreadable)?;
            let uv = |uv: [f64; 2]| {
                let mut uv = uv.map(|c| c as f32);
                uv.iter_mut().for_each(|c| repair(c, 0.0, "non-finite texture coordinates set to zero"));
                uv
            };
            Ok::<_, Problem>(uvs.map(|uvs| uvs.into_iter().map(uv).collect::<Vec<_>>()))
        };
        let (uvs, uvs1) = (coordinates(&geometry.uvs)?, coordinates(&geometry.uvs1)?);
        let tangents = geometry.tangents.as_ref().map(|tangents| tangents.gather::<4>(&used)).transpose();
        let tangents = tangents.map_err(unreadable)?.map(|tangents| {
            let tangent = |tangent: &[f64; 4]| {
                let mut tangent = tangent.map(|c| c as f32);
                if tangent.iter().any(|c| !c.is_finite()) {
                    tangent.iter_mut().for_each(|c| repair(c, 0.0, "non-finite tangents ignored"));
                    tangent = [0.0; 4];
                }
                tangent
            };
            let tangents: Vec<[f32; 4]> = tangents.iter().map(tangent).collect();
            indices.iter().map(|&index| tangents[index as usize]).collect()
        });
        let colors = geometry.colors.as_ref().map(|colors| Ok((colors.width, colors.gather::<4>(&used)?))).transpose();
        let colors = colors.map_err(unreadable)?.map(|(width, colors)| {
            let color = |color: [f64; 4]| {
                let mut color = color.map(|c| c as f32);
                if width == 3 {
                    color[3] = 1.0;
                }
                color.iter_mut().for_each(|c| repair(c, 1.0, "non-finite colours set to one"));
                color.map(|c| c.clamp(0.0, 1.0))
            };
            colors.into_iter().map(color).collect()
        });
        let mut primitive = Primitive { material, positions, normals, uvs, uvs1, tangents, colors, indices };
        if primitive.tangents.is_none() {
            primitive.tangents = match &geometry.normal_coordinates {
                Some((set, rows)) => tangents::make(&primitive, *set, rows),
                None if geometry.is_anisotropic => Some(vec![ALONG_X; primitive.indices.len()]),
                None => None,
            };
        }
        Ok(Read { primitive, repairs })
    }
}

impl Geometry {
    /// The vertices of triangles `first` to `end`, each below the number of positions.
    fn vertices(&self, first: u64, end: u64, unreadable: impl Fn(io::Error) -> Problem) -> Result<Vertices, Problem> {
        let count = self.positions.count;
        let elements = self.topology.elements(first, end);
        let vertices: Option<Vec<[f64; 1]>> = match &self.indices {
            Some(indices) => Some(indices.gather(&elements).map_err(unreadable)?),
            None => None,
        };
        // Elements are consecutive but for the first one of a fan, which is element 0.
        let last = elements.last().copied().unwrap_or(0);
        let position = |element: u64| if element == 0 { 0 } else { elements.len() - 1 - (last - element) as usize };
        let mut corners = Vec::with_capacity(3 * (end - first) as usize);
        for triangle in first..end {
            for element in self.topology.corners(triangle) {
                let vertex = match &vertices {
                    // Exact: indices are integers of at most 32 bits.
                    Some(vertices) => vertices[position(element)][0] as u64,
                    None => element,
                };
                if vertex >= count {
                    return Err(Problem::new(format!("index {element} is {vertex}, but there are {count} vertices")));
                }
                corners.push(vertex);
            }
        }
        Ok(Vertices::of(corners))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_wind_alike() {
        // The same square 0 1 / 2 3, as strip 0 1 2 3.
        assert_eq!([0, 1].map(|i| Topology::Strip.corners(i)), [[0, 1, 2], [1, 3, 2]]);
        assert_eq!([0, 1].map(|i| Topology::Fan.corners(i)), [[1, 2, 0], [2, 3, 0]]);
        for topology in [Topology::Triangles, Topology::Strip, Topology::Fan] {
            for elements in 0..20 {
                let n = topology.triangles(elements);
                let most = (0..n).flat_map(|i| topology.corners(i)).max();
                assert!(most.is_none_or(|most| most < elements), "{topology:?} {elements}");
                for (first, end) in [(0, n), (n / 2, n), (n / 3, n / 2)] {
                    let mut corners: Vec<_> = (first..end).flat_map(|i| topology.corners(i)).collect();
                    corners.sort_unstable();
                    corners.dedup();
                    assert_eq!(topology.elements(first, end), corners, "{topology:?} {first} {end}");
                }
            }
        }
    }
}
