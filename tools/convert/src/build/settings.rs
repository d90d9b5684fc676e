//! How to build, and what was built.

use super::error::BuildError;
use std::path::PathBuf;
use std::time::Duration;

/// Largest number of triangles a brick may be allowed.
const LARGEST_BRICK: u32 = 1 << 20;

/// How textures are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TextureEncoding {
    /// As blocks of BC7, normals as blocks of BC5, a byte a texel.
    #[default]
    Bc7,
    /// As they are, four bytes a texel.
    Raw,
}

/// A lattice step that does not follow from the median size of an object's parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LatticeStep {
    /// Of each object the finest at which none of its parts of 16,384 triangles takes wide vertices.
    Finest,
    /// log2 of the step in scene units, -126 to 96.
    Log2(i32),
}

/// How to build.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BuildSettings {
    /// Most triangles of a brick, 1 to 1,048,576. Changes neither ids nor positions.
    pub brick_triangles: u32,
    /// Worker threads, at least 1; `None`: one a core. Changes nothing but the time.
    pub threads: Option<usize>,
    /// The lattice step; `None`: from the median size of each object's parts.
    pub lattice: Option<LatticeStep>,
    /// Leaves out triangles with a vertex that is not finite; otherwise such a vertex is an error.
    pub drop_non_finite: bool,
    /// Least triangles of a mesh that is placed more than once and stored once.
    pub instance_min_triangles: u32,
    /// Most triangles of smaller meshes, all copies counted, that are copied into the world; beyond it they too are
    /// stored once.
    pub bake_budget_triangles: u64,
    /// Names of nodes, with wildcards ([`crate::pattern`]), whose meshes, and those of the nodes below them, are kept
    /// as objects with instances of their own, however often they are placed.
    pub movable: Vec<String>,
    /// Memory to get by with, in bytes, the source not counted if it lies in memory; `None`: a quarter of the
    /// machine's. What does not fit goes to the scratch folder. Changes nothing but the time.
    pub memory_bytes: Option<u64>,
    /// Builds the trees in bricks faster, for rays that take longer. Changes neither ids nor positions.
    pub fast: bool,
    /// Stores an occupancy map with every brick. Changes nothing else of the scene.
    pub proxies: bool,
    /// Stores levels of detail behind the bricks. Changes nothing else of the scene.
    pub lod: bool,
    /// How textures are stored.
    pub textures: TextureEncoding,
    /// Folder for the scratch folder; `None`: that of the output.
    pub scratch: Option<PathBuf>,
    /// Continues an interrupted conversion of the same source with the same settings, if there is one. Only a
    /// conversion that did not fit in memory leaves something to continue.
    pub resume: bool,
}

impl Default for BuildSettings {
    fn default() -> Self {
        Self {
            brick_triangles: 16384,
            threads: None,
            lattice: None,
            drop_non_finite: false,
            instance_min_triangles: 1000,
            bake_budget_triangles: 4_000_000,
            movable: Vec::new(),
            memory_bytes: None,
            fast: false,
            proxies: true,
            lod: false,
            textures: TextureEncoding::default(),
            scratch: None,
            resume: false,
        }
    }
}

impl BuildSettings {
    /// Checks the ranges of all settings.
    pub(super) fn check(&self) -> Result<(), BuildError> {
        let rule = |ok: bool, setting, found: String, expected: &str| {
            if ok { Ok(()) } else { Err(BuildError::Setting { setting, found, expected: expected.to_owned() }) }
        };
        let bricks = self.brick_triangles;
        rule((1..=LARGEST_BRICK).contains(&bricks), "--brick-triangles", bricks.to_string(), "1 to 1048576")?;
        let threads = self.threads.unwrap_or(1);
        rule((1..=4096).contains(&threads), "--threads", threads.to_string(), "1 to 4096")?;
        let lattice = if let Some(LatticeStep::Log2(step)) = self.lattice { step } else { 0 };
        rule((-126..=96).contains(&lattice), "--lattice", lattice.to_string(), "-126 to 96")
    }
}

/// What was built.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BuildSummary {
    /// Objects, the world counted.
    pub objects: u64,
    /// Instances, the world not counted.
    pub instances: u64,
    /// Bricks.
    pub bricks: u64,
    /// Bricks with wide vertices.
    pub wide_bricks: u64,
    /// Leaves of the top level.
    pub leaves: u64,
    /// Triangle ids: all triangles of the sources, placements multiplied out.
    pub triangle_ids: u64,
    /// Triangles stored.
    pub triangles_stored: u64,
    /// Triangles with every instance multiplied out, without the dropped ones.
    pub triangles_instanced: u64,
    /// Triangles without area, instances multiplied out.
    pub dropped_zero_area: u64,
    /// Triangles with a vertex that is not finite, instances multiplied out.
    pub dropped_non_finite: u64,
    /// log2 of the world's lattice step in scene units.
    pub world_step_log2: i32,
    /// Wide nodes of all bricks.
    pub nodes: u64,
    /// Bytes of the nodes of all bricks.
    pub bytes_nodes: u64,
    /// Bytes of the geometry of all bricks, nodes included.
    pub bytes_geometry: u64,
    /// Bytes of the attributes of all bricks.
    pub bytes_attributes: u64,
    /// Bytes of the proxies of all bricks, their resident part included.
    pub bytes_proxies: u64,
    /// Levels of detail.
    pub levels: u64,
    /// Triangles of the levels of detail.
    pub level_triangles: u64,
    /// Bytes of the payloads of the levels of detail.
    pub bytes_levels: u64,
    /// Largest bound of the distance between a level and what it stands for, in units of its object.
    pub level_bound: f64,
    /// Bytes of the textures.
    pub bytes_textures: u64,
    /// Bytes of the file.
    pub bytes_file: u64,
    /// Warnings, as in the manifest.
    pub warnings: Vec<String>,
    /// Wall time of the phases, in their order.
    pub phases: Vec<(&'static str, Duration)>,
}
