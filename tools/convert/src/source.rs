//! What importers and generators produce and the builder consumes: meshes in f64, placed by matrices.

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

/// Triangles of one material. Per-vertex arrays, where present, have the length of `positions`.
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
    /// sRGB RGBA8, rows top to bottom.
    pub rgba: Vec<u8>,
}

/// The identity as a row-major 3x4 matrix.
pub const IDENTITY: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
