//! Meshes (glTF 2.0, section 3.7): primitives are checked first, which gives their triangle counts, then read.

use super::accessor::{Accessor, Component, Shape};
use super::document::{Document, Primitive as Json, TextureTransform};
use super::file::{File, Problem, item};
use super::label;
use super::materials::base_color_set;
use crate::import::warnings::Warnings;
use crate::source::Primitive;

/// How elements form triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Topology {
    Triangles,
    Strip,
    Fan,
}

impl Topology {
    /// Triangles of `elements` vertices or indices; left-over elements form none.
    fn triangles(self, elements: usize) -> usize {
        match self {
            Self::Triangles => elements / 3,
            Self::Strip | Self::Fan => elements.saturating_sub(2),
        }
    }

    /// The elements of triangle `i`, in the order that the specification gives, so that all faces of a strip wind alike.
    fn corners(self, i: usize) -> [usize; 3] {
        match self {
            Self::Triangles => [3 * i, 3 * i + 1, 3 * i + 2],
            Self::Strip => [i, i + 1 + i % 2, i + 2 - i % 2],
            Self::Fan => [i + 1, i + 2, 0],
        }
    }
}

/// A primitive whose accessors have been checked.
pub(super) struct Checked<'a> {
    /// Material of the file; `None`: the default one.
    material: Option<usize>,
    /// `None`: it has no triangles to read.
    geometry: Option<Geometry<'a>>,
}

struct Geometry<'a> {
    topology: Topology,
    triangles: usize,
    positions: Accessor<'a>,
    normals: Option<Accessor<'a>>,
    uvs: Option<Accessor<'a>>,
    transform: Option<UvTransform>,
    colors: Option<Accessor<'a>>,
    indices: Option<Accessor<'a>>,
}

const FLOAT_OR_QUANTIZED: &[Component] =
    &[Component::F32, Component::I8, Component::U8, Component::I16, Component::U16];
const POSITION: Shape = Shape { kinds: &[("VEC3", 3)], components: FLOAT_OR_QUANTIZED, always_normalized: false };
const NORMAL: Shape = Shape {
    kinds: &[("VEC3", 3)],
    components: &[Component::F32, Component::I8, Component::I16],
    always_normalized: true,
};
const TEXCOORD: Shape = Shape { kinds: &[("VEC2", 2)], components: FLOAT_OR_QUANTIZED, always_normalized: false };
const COLOR: Shape = Shape {
    kinds: &[("VEC3", 3), ("VEC4", 4)],
    components: &[Component::F32, Component::U8, Component::U16],
    always_normalized: true,
};
const INDICES: Shape = Shape {
    kinds: &[("SCALAR", 1)],
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
            if let Some(material) = primitive.material {
                item(&document.materials, material, "material").map_err(|problem| (m, p, problem))?;
            }
        }
    }
    Ok(())
}

/// Checks one primitive of `file`. Those without triangles (points, lines, no positions) stay as empty ones, so that
/// primitives keep their numbers; the reason is noted for `place`.
pub(super) fn check<'a>(
    file: &'a File,
    json: &Json,
    warnings: &mut Warnings,
    place: &dyn Fn() -> String,
) -> Result<Checked<'a>, Problem> {
    // In range: `check_references` checked it.
    let material = json.material.map(|m| m.0 as usize);
    let topology = match json.mode.map_or(4, |mode| mode.0) {
        0..=3 => {
            warnings.add("points and lines are left out", place);
            return Ok(Checked { material, geometry: None });
        }
        4 => Topology::Triangles,
        5 => Topology::Strip,
        6 => Topology::Fan,
        mode => return Err(Problem::new(format!("mode {mode} is not one of glTF"))),
    };
    let attribute = |name: &str, shape: &Shape| {
        let Some(&index) = json.attributes.get(name) else { return Ok(None) };
        Accessor::resolve(file, index, shape)
            .map(Some)
            .map_err(|problem| Problem { what: format!("{name}: {}", problem.what), ..problem })
    };
    let Some(positions) = attribute("POSITION", &POSITION)? else {
        warnings.add("without POSITION; left out", place);
        return Ok(Checked { material, geometry: None });
    };
    if json.extensions.draco.is_some() && positions.is_empty_of_data() {
        return Err(Problem {
            what: "is compressed by KHR_draco_mesh_compression and has no plain copy".into(),
            remedy: "export the file without Draco compression",
        });
    }
    let normals = attribute("NORMAL", &NORMAL)?;
    let colors = attribute("COLOR_0", &COLOR)?;
    let texture = material.and_then(|m| base_color_set(&file.document.materials[m]));
    let (set, transform) = texture.unwrap_or_default();
    let uvs = attribute(&format!("TEXCOORD_{set}"), &TEXCOORD)?;
    if uvs.is_none() && texture.is_some() {
        warnings.add("textured, but without texture coordinates", place);
    }
    for (name, other) in [("NORMAL", &normals), ("COLOR_0", &colors), ("TEXCOORD", &uvs)] {
        if let Some(other) = other.as_ref().filter(|other| other.count != positions.count) {
            return Err(Problem::new(format!("{name} has {} elements, POSITION {}", other.count, positions.count)));
        }
    }
    if u32::try_from(positions.count).is_err() {
        return Err(Problem::new(format!("{} vertices are more than indices can name", positions.count)));
    }
    if !json.targets.is_empty() {
        warnings.add("has morph targets; its geometry is taken at rest", place);
    }
    let indices = match json.indices {
        Some(index) => Some(
            Accessor::resolve(file, index, &INDICES)
                .map_err(|problem| Problem { what: format!("indices: {}", problem.what), ..problem })?,
        ),
        None => None,
    };
    let elements = indices.as_ref().map_or(positions.count, |a| a.count);
    if topology == Topology::Triangles && elements % 3 != 0 {
        warnings.add("ends within a triangle, which is left out", place);
    }
    let triangles = topology.triangles(elements);
    let transform = transform.map(UvTransform::of);
    let geometry = Geometry { topology, triangles, positions, normals, uvs, transform, colors, indices };
    Ok(Checked { material, geometry: Some(geometry) })
}

/// A primitive that was read, and what was repaired in it.
pub(super) struct Read {
    pub primitive: Primitive,
    /// Kinds of repair.
    pub repairs: Vec<&'static str>,
}

impl Checked<'_> {
    /// Number of triangles.
    pub fn triangles(&self) -> u64 {
        self.geometry.as_ref().map_or(0, |g| g.triangles as u64)
    }

    /// Material of the file; `None`: the default one.
    pub fn material(&self) -> Option<usize> {
        self.material
    }

    /// Reads the primitive; its material is `material`.
    pub fn read(&self, material: u32) -> Result<Read, Problem> {
        let mut repairs = Vec::new();
        let Some(geometry) = &self.geometry else {
            return Ok(Read { primitive: Primitive { material, ..Default::default() }, repairs });
        };
        let mut indices = geometry.corner_vertices()?;
        let selection = Selection::of(&mut indices, geometry.positions.count);
        let positions = selection.gather(|i| geometry.positions.get::<3>(i));
        let mut repair = |values: &mut f32, otherwise: f32, what| {
            if !values.is_finite() {
                *values = otherwise;
                if !repairs.contains(&what) {
                    repairs.push(what);
                }
            }
        };
        let normals = geometry.normals.as_ref().map(|normals| {
            selection.gather(|i| {
                let mut normal = normals.get::<3>(i).map(|c| c as f32);
                if normal.iter().any(|c| !c.is_finite()) {
                    normal.iter_mut().for_each(|c| repair(c, 0.0, "normals that are not finite are set to zero"));
                    normal = [0.0; 3];
                }
                normal
            })
        });
        let uvs = geometry.uvs.as_ref().map(|uvs| {
            selection.gather(|i| {
                let uv = uvs.get::<2>(i);
                let mut uv = geometry.transform.as_ref().map_or(uv, |t| t.apply(uv)).map(|c| c as f32);
                uv.iter_mut().for_each(|c| repair(c, 0.0, "texture coordinates that are not finite are set to zero"));
                uv
            })
        });
        let colors = geometry.colors.as_ref().map(|colors| {
            selection.gather(|i| {
                let mut color = colors.get::<4>(i).map(|c| c as f32);
                if colors.width == 3 {
                    color[3] = 1.0;
                }
                color.iter_mut().for_each(|c| repair(c, 1.0, "colours that are not finite are set to one"));
                color.map(|c| c.clamp(0.0, 1.0))
            })
        });
        Ok(Read { primitive: Primitive { material, positions, normals, uvs, colors, indices }, repairs })
    }
}

impl Geometry<'_> {
    /// The vertices of the corners of all triangles, each below the number of positions.
    fn corner_vertices(&self) -> Result<Vec<u32>, Problem> {
        let vertices = self.positions.count;
        let mut corners = Vec::with_capacity(3 * self.triangles);
        for triangle in 0..self.triangles {
            for element in self.topology.corners(triangle) {
                let vertex = match &self.indices {
                    // Exact: indices are integers of at most 32 bits.
                    Some(indices) => indices.get::<1>(element)[0] as usize,
                    None => element,
                };
                if vertex >= vertices {
                    return Err(Problem::new(format!(
                        "index {element} is {vertex}, but there are {vertices} vertices"
                    )));
                }
                // `check` refused more vertices than u32 can name.
                corners.push(vertex as u32);
            }
        }
        Ok(corners)
    }
}

/// Which vertices to read. Exporters may share one large vertex buffer among many primitives; copying it for each would
/// take memory out of proportion to the file, so then only the vertices in use are read.
enum Selection {
    /// All of so many.
    All(usize),
    /// These, ascending.
    Used(Vec<u32>),
}

impl Selection {
    /// Chooses; `corners` are renumbered to match.
    fn of(corners: &mut [u32], vertices: usize) -> Self {
        if vertices <= corners.len() {
            return Self::All(vertices);
        }
        let mut used = corners.to_vec();
        used.sort_unstable();
        used.dedup();
        for corner in corners {
            // Present: `used` holds every corner.
            *corner = used.partition_point(|vertex| vertex < corner) as u32;
        }
        Self::Used(used)
    }

    fn gather<T>(&self, mut read: impl FnMut(usize) -> T) -> Vec<T> {
        match self {
            Self::All(count) => (0..*count).map(read).collect(),
            Self::Used(vertices) => vertices.iter().map(|&vertex| read(vertex as usize)).collect(),
        }
    }
}

/// KHR_texture_transform, applied to the texture coordinates themselves: a primitive has one material and only its base
/// colour texture is used.
struct UvTransform {
    offset: [f64; 2],
    sin: f64,
    cos: f64,
    scale: [f64; 2],
}

impl UvTransform {
    fn of(json: &TextureTransform) -> Self {
        let (sin, cos) = json.rotation.unwrap_or(0.0).sin_cos();
        Self { offset: json.offset.unwrap_or([0.0; 2]), sin, cos, scale: json.scale.unwrap_or([1.0; 2]) }
    }

    /// Translation * rotation * scale; a positive angle turns counter-clockwise in an image whose v points down.
    fn apply(&self, uv: [f64; 2]) -> [f64; 2] {
        let [u, v] = [uv[0] * self.scale[0], uv[1] * self.scale[1]];
        [self.cos * u + self.sin * v + self.offset[0], -self.sin * u + self.cos * v + self.offset[1]]
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
            }
        }
    }

    #[test]
    fn only_used_vertices_are_kept() {
        let mut corners = [90, 7, 90, 7, 50, 8];
        let Selection::Used(used) = Selection::of(&mut corners, 100) else { panic!("all kept") };
        assert_eq!(used, [7, 8, 50, 90]);
        assert_eq!(corners, [3, 0, 3, 0, 2, 1]);
        assert!(matches!(Selection::of(&mut [0, 1, 2], 3), Selection::All(3)));
    }

    #[test]
    fn texture_transform_of_the_specification() {
        // The specification's matrix for rotation: [cos sin; -sin cos], offset last.
        let json = TextureTransform {
            offset: Some([0.5, 0.25]),
            rotation: Some(std::f64::consts::FRAC_PI_2),
            scale: Some([2.0, 3.0]),
            tex_coord: None,
        };
        let [u, v] = UvTransform::of(&json).apply([0.25, 0.5]);
        assert!((u - (1.5 + 0.5)).abs() < 1e-15 && (v - (-0.5 + 0.25)).abs() < 1e-15, "{u} {v}");
    }
}
