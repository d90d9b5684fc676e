//! Discrete visibility fields (DVF; Günay and Akyüz 2025, after Xu et al. 2022): which directions around a place are
//! worth tracing.
//!
//! *Theory.* A grid over a region keeps of each cell two masks of directions: those in which some ray from a surface in
//! the cell missed everything, and those in which some ray met something; and a label, which of the two are more. A ray
//! to the environment from a cell that is mostly visible is traced where the masks know of something in its direction,
//! from one that is mostly occluded where they know of a way out. Masks are made by rays from points strewn over all
//! triangles by area.
//!
//! *What we changed.* The run-time algorithm as corrected (hit and miss are swapped in the paper's text): a ray that is
//! not traced counts as what its cell says, and rays are those that would be traced without a field, so that where
//! masks cover the picture is the same, bit for bit, and no spherical harmonics stand for light. Directions of which
//! nothing is known are traced. Rays meet all bricks, by the schedules that trace every other ray. Areas are summed in
//! whole numbers, so that sums are the same on every device and never fall; points are numbered over all triangles and
//! found by binary search, so that large triangles are shared out over lanes by themselves; hashes take the triangle's
//! id rather than its vertices' numbers, which repeat in simple scenes.
//!
//! *Practice.* [`mask`] has the masks, [`shape`] the grid, [`field`] a whole field and what is said of it, [`mod@file`]
//! its file, [`Fresh`] what of it is made anew when something has moved. Kernels: `shaders/dvf/`.

mod answer;
mod areas;
pub mod field;
pub mod file;
mod fresh;
pub mod kernels;
mod make;
pub mod maps;
pub mod mask;
mod movers;
mod plan;
pub mod prepare;
mod renew;
mod settings;
pub mod shape;
pub mod source;
pub mod strew;
pub mod twin;
pub mod worth;

pub use answer::Dvf;
pub use areas::Areas;
pub use field::{Answer, DvfField, DvfKept, Trial};
pub use fresh::Fresh;
pub use make::DvfMade;
pub use movers::Concerned;
pub use plan::{DvfTracing, EFFECT, Renewal};
pub use settings::{Count, Mode, Options, RegionKind, Sequence, Sides, Trust};
pub use shape::Shape;
pub use source::Region;

/// Which cells a field has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cells {
    /// As many along the region's longest side as a trial finds best.
    Auto,
    /// So many along the region's longest side.
    Longest(u32),
}

/// How a field is made: what its bits depend on, beside scene and region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DvfSettings {
    /// Points to be strewn over all triangles (N_P).
    pub points: u32,
    /// Rays of a point on each side that has some (N_r).
    pub rays: u32,
    /// Which cells.
    pub cells: Cells,
    /// Texels of a mask on both axes: 8, 16 or 32.
    pub octahedral: u32,
    /// Whether masks are widened by a texel.
    pub dilate: bool,
    /// Points are those of Hammersley, else hashed.
    pub hammersley: bool,
    /// Numbers of points are rounded, else raised to whole ones.
    pub round: bool,
    /// Rays start from both sides of triangles, else from their front.
    pub both: bool,
    /// Seed of the points.
    pub seed: u32,
}

/// Least and most points.
pub const POINTS: [u32; 2] = [100, 16_000_000];
/// Least and most rays of a point.
pub const RAYS: [u32; 2] = [1, 1024];
/// Least and most cells along the longest side.
pub const CELLS: [u32; 2] = [1, 512];
/// Bytes of the masks of the finest grid that is tried.
pub const MOST_TRIAL_BYTES: u64 = 64 << 20;
/// Cells along the longest side of the finest grid that is tried, and of the coarsest.
pub const TRIAL_CELLS: [u32; 2] = [128, 4];

/// How rays are answered by a field.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DvfUse {
    /// Rays are traced where a mask says both or neither; else by the label, as in the paper: more are traced, and
    /// fewer answered wrongly.
    pub doubt: bool,
    /// As in the paper: rays by the cosine, none where masks know nothing, and spherical harmonics for what is not
    /// occluded in cells that are mostly visible. Primary hits alone.
    pub paper: bool,
}

impl Default for DvfSettings {
    fn default() -> Self {
        Options::default().settings()
    }
}
