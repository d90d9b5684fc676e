//! What importers and generators produce and the builder consumes: meshes in f64, placed by matrices.
//!
//! A [`Source`] is read part by part, so that no more than a few parts need to be in memory. A [`SourceScene`] holds
//! everything and is a source through [`InMemory`].

use std::borrow::Cow;

/// Triangles that a part of a source should have at most, unless it lies in memory anyway.
pub const PART_TRIANGLES: u32 = 1 << 17;

/// A scene that is read part by part.
///
/// Its parts, in the order of meshes and of parts within them, hold the same triangles each time they are read, from
/// any number of threads at once.
pub trait Source: Send + Sync {
    /// Everything but geometry and texels.
    fn outline(&self) -> &Outline;

    /// Whether all geometry lies in memory, so that reading a part costs nothing.
    fn is_in_memory(&self) -> bool {
        false
    }

    /// The triangles of part `part` of mesh `mesh`, as many as its [`PartOutline`] says. The caller may be a task of a
    /// thread pool and hold memory for one part a thread: the work is done on the calling thread.
    ///
    /// # Errors
    /// The input cannot be read, or what it holds is no geometry.
    fn part(&self, mesh: usize, part: usize) -> Result<Cow<'_, Primitive>, SourceError>;

    /// The texels of texture `index`.
    ///
    /// # Errors
    /// The image is missing or cannot be decoded. This is no reason not to convert: the builder warns and leaves it
    /// out.
    fn texture(&self, index: usize) -> Result<Cow<'_, SourceTexture>, SourceError>;

    /// The file that part `part` of mesh `mesh` comes from, if any, and the number that vertex `vertex` of the part has
    /// there: in its primitive, from 0. For messages; it may read the part again.
    fn origin(&self, _mesh: usize, _part: usize, vertex: u32) -> (Option<String>, u64) {
        (None, vertex.into())
    }

    /// What was repaired in the parts that have been read, one line each: warnings that cannot be known before. Once
    /// every part has been read they are the same whatever the order.
    fn repairs(&self) -> Vec<String> {
        Vec::new()
    }
}

/// Why a source could not be read: one line that names the file, the thing in it and the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct SourceError(pub String);

/// A scene without its geometry and texels.
#[derive(Clone, Debug, Default)]
pub struct Outline {
    /// Meshes, each stored once.
    pub meshes: Vec<MeshOutline>,
    /// Uses of meshes, in the order in which global triangle ids accumulate (inputs as given, nodes depth first).
    pub placements: Vec<Placement>,
    /// Materials; primitives index them.
    pub materials: Vec<bricks::Material>,
    /// Names of the textures, for messages; materials index them.
    pub textures: Vec<String>,
    /// Lights without extent, in the world.
    pub lights: Vec<bricks::PunctualLight>,
    /// Input files.
    pub sources: Vec<bricks::Source>,
    /// What was ignored or repaired, one line each.
    pub warnings: Vec<String>,
    /// Whether any source has animation.
    pub has_animation: bool,
    /// See [`bricks::Manifest::has_own_light`].
    pub has_own_light: bool,
}

/// A mesh without its geometry.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MeshOutline {
    /// Name, or its index in the source.
    pub name: String,
    /// Its parts in the order of its triangles.
    pub parts: Vec<PartOutline>,
    /// Whether some of its triangles emit light from their front alone.
    pub shines_to_front: bool,
}

/// Whether triangles of a material emit light from their front alone.
pub(crate) fn shines_to_front(material: &bricks::Material) -> bool {
    material.flags & bricks::MATERIAL_DOUBLE_SIDED == 0 && material.emission.iter().any(|&c| c > 0.0)
}

impl MeshOutline {
    /// Number of triangles, degenerate ones counted.
    pub fn triangle_count(&self) -> u64 {
        self.parts.iter().map(|part| u64::from(part.triangles)).sum()
    }
}

/// A run of triangles of one primitive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartOutline {
    /// Index of the primitive in its mesh; a large primitive has several parts, one after the other.
    pub primitive: u32,
    /// Number of its triangles, degenerate ones counted.
    pub triangles: u32,
}

/// A [`SourceScene`] as a source: a part is a primitive.
#[derive(Clone, Debug, Default)]
pub struct InMemory {
    outline: Outline,
    meshes: Vec<Mesh>,
    textures: Vec<SourceTexture>,
}

impl From<SourceScene> for InMemory {
    fn from(scene: SourceScene) -> Self {
        let part =
            |(primitive, p): (u32, &Primitive)| PartOutline { primitive, triangles: (p.indices.len() / 3) as u32 };
        let shines = |p: &Primitive| scene.materials.get(p.material as usize).is_some_and(shines_to_front);
        let mesh = |mesh: &Mesh| MeshOutline {
            name: mesh.name.clone(),
            parts: (0u32..).zip(&mesh.primitives).map(part).collect(),
            shines_to_front: mesh.primitives.iter().any(shines),
        };
        let outline = Outline {
            meshes: scene.meshes.iter().map(mesh).collect(),
            placements: scene.placements,
            materials: scene.materials,
            textures: scene.textures.iter().map(|texture| texture.name.clone()).collect(),
            lights: scene.lights,
            sources: scene.sources,
            warnings: scene.warnings,
            has_animation: scene.has_animation,
            has_own_light: false,
        };
        Self { outline, meshes: scene.meshes, textures: scene.textures }
    }
}

impl Source for InMemory {
    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn is_in_memory(&self) -> bool {
        true
    }

    fn part(&self, mesh: usize, part: usize) -> Result<Cow<'_, Primitive>, SourceError> {
        Ok(Cow::Borrowed(&self.meshes[mesh].primitives[part]))
    }

    fn texture(&self, index: usize) -> Result<Cow<'_, SourceTexture>, SourceError> {
        Ok(Cow::Borrowed(&self.textures[index]))
    }
}

/// A scene in memory, before it is rounded to a lattice and cut into bricks.
#[derive(Clone, Debug, Default)]
pub struct SourceScene {
    /// Meshes, each stored once.
    pub meshes: Vec<Mesh>,
    /// Uses of meshes, in the order in which global triangle ids accumulate (inputs as given, nodes depth first).
    pub placements: Vec<Placement>,
    /// Materials; primitives index them.
    pub materials: Vec<bricks::Material>,
    /// Textures; materials index them.
    pub textures: Vec<SourceTexture>,
    /// Lights without extent, in the world.
    pub lights: Vec<bricks::PunctualLight>,
    /// Input files.
    pub sources: Vec<bricks::Source>,
    /// What was ignored or repaired, one line each.
    pub warnings: Vec<String>,
    /// Whether any source has animation.
    pub has_animation: bool,
}

/// A mesh: triangles that are placed together.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name, or its index in the source.
    pub name: String,
    /// Parts of one material each.
    pub primitives: Vec<Primitive>,
}

impl Mesh {
    /// Number of triangles, degenerate ones counted.
    pub fn triangle_count(&self) -> u64 {
        self.primitives.iter().map(|p| p.indices.len() as u64 / 3).sum()
    }
}

/// Triangles of one material. Per-vertex arrays, where present, have the length of `positions`, `tangents` that of
/// `indices`.
#[derive(Clone, Debug, Default)]
pub struct Primitive {
    /// Index of the material.
    pub material: u32,
    /// Positions in mesh space.
    pub positions: Vec<[f64; 3]>,
    /// Normals in mesh space, not necessarily unit; computed by the builder when absent.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Texture coordinates of set 0.
    pub uvs: Option<Vec<[f32; 2]>>,
    /// Texture coordinates of set 1.
    pub uvs1: Option<Vec<[f32; 2]>>,
    /// Of every corner, in the order of `indices`: a tangent in mesh space, not necessarily unit, and a sign, by which
    /// cross(normal, tangent) times it is the bitangent. Wanted of materials with a normal texture.
    pub tangents: Option<Vec<[f32; 4]>>,
    /// Linear RGBA colours in 0..=1.
    pub colors: Option<Vec<[f32; 4]>>,
    /// Three indices a triangle, below the number of positions.
    pub indices: Vec<u32>,
}

/// A mesh placed in the world.
#[derive(Clone, Debug, Default)]
pub struct Placement {
    /// Node name, or its index in the source.
    pub name: String,
    /// Names of nodes above it that were asked for, the outermost first.
    pub under: Vec<String>,
    /// Index of the mesh.
    pub mesh: u32,
    /// Index of the source.
    pub source: u32,
    /// world_from_mesh, row-major 3x4.
    pub world_from_mesh: [f64; 12],
}

/// An image for use as a texture.
#[derive(Clone, Debug, Default)]
pub struct SourceTexture {
    /// Name for messages.
    pub name: String,
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// `bricks::WRAP_*` of s in the low half, of t in the high half.
    pub wrap: u32,
    /// RGBA8, rows top to bottom. Red, green and blue are sRGB where a material takes it for base colour or emission,
    /// linear where it takes it otherwise.
    pub rgba: Vec<u8>,
}

/// The identity as a row-major 3x4 matrix.
pub const IDENTITY: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
