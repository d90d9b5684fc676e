//! The table of kernels: one row each, with all that follows from it. What both executors do with a kernel, which
//! pipelines there are, what runs in its place on the processor, under which name it is timed and compared, is said
//! here alone.
//!
//! A row is `name: "family/file" BINDINGS [OVERRIDE = value, …] |bound, target| twin`. Several rows may specialise one
//! file. The kernels of a secondary method have a table of their own in the method's folder ([`Family`]).

use super::bound::Bound;
use super::paths::generate_path::generate_path;
use super::paths::move_paths::{compact_paths, keep_paths};
use super::payloads::AttributeView;
use super::query::query::query;
use super::query::query_all::count_pairs;
use super::query::query_pairs::query_pairs;
use super::query::stand_ins::query_stand_ins;
use super::query::tile_bounds::tile_bounds;
use super::query::tile_lists::{query_reduce, tile_choose, tile_scan, tile_select, tile_sort};
use super::query::tile_walk::{tile_walk_count, tile_walk_write};
use super::query::wanted::query_all;
use super::rays::RaySet;
use super::shade::clip_rays::clip_rays;
use super::shade::generate::{
    generate_diffuse, generate_glossy, generate_occlusion, generate_primary, generate_shadow, start_hits,
};
use super::shade::halve_rays::halve_rays;
use super::shade::resolve::resolve;
use super::shade::shade::{Pixels, add_light, add_occlusion, clear_gbuffer, hit_demand, shade};
use super::texture::sample::sample;
use super::texture::texels::{Sampling, TileDemand};
use super::tiles::TileLists;
use super::trace::intersect_all::intersect_all;
use super::trace::intersect_binary::{BinaryTrees, intersect_binary};
use super::trace::intersect_list::intersect_list;
use super::trace::run::Work;
use crate::schedule::ExecutorError;
use bricks::Material;

/// Which groups a kernel binds beside 0, the scene, and 1, parameters and rays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Bindings {
    /// 3: tiles and their lists.
    Tiles,
    /// 2: the cache; 3: tiles and their lists.
    CacheTiles,
    /// 2: the lamps; 3: what shading the set before the pass's needs.
    Shading,
    /// 2: the cache; 3: what shading needs.
    CacheShading,
    /// 2: the cache; 3: what texture lookups for the set before the pass's need.
    Sampling,
    /// 2: the cache; 3: binary trees.
    Binary,
    /// 2: the buffers of the kernel's [`Family`]; 3: what shading needs.
    Own,
}

/// What the twin of a kernel works on: what a dispatch binds beside what all read ([`Bound`]).
pub struct Target<'a> {
    /// The set of the pass.
    pub own: &'a mut RaySet,
    /// The set before it, whose hits are shaded; of set 0 nothing.
    pub seen: &'a mut RaySet,
    /// Its number.
    pub shaded: usize,
    /// What shading keeps per pixel.
    pub pixels: &'a mut Pixels,
    /// Tiles and their lists.
    pub tiles: &'a mut TileLists,
    /// Materials of the scene.
    pub materials: &'a [Material],
    /// Attributes of the resident bricks.
    pub attributes: &'a [AttributeView<'a>],
    /// What textures are looked up in.
    pub sampling: Sampling<'a>,
    /// What lookups ask of tiles.
    pub tile_demand: &'a [TileDemand],
    /// Binary trees, once they are made.
    pub binary: Option<&'a BinaryTrees>,
    /// The buffers of the kernel's family, in the order of its table; of other kernels none.
    pub buffers: &'a mut [Vec<u32>],
}

/// The words of the buffers of a family that has `N`.
///
/// # Errors
/// There are not as many, which is a defect.
pub fn words<const N: usize>(buffers: &mut [Vec<u32>]) -> Result<[&mut [u32]; N], ExecutorError> {
    <&mut [Vec<u32>; N]>::try_from(buffers)
        .map(|all| all.each_mut().map(Vec::as_mut_slice))
        .map_err(|_| ExecutorError::Device("has other buffers than the kernel; this is a bug in brickwalk".into()))
}

/// The twin of a kernel.
pub type Twin = fn(&Bound, &mut Target) -> Result<(), ExecutorError>;

/// A kernel, specialised.
pub struct Kernel {
    /// Of the pipeline, the twin, the timing row: one name.
    pub name: &'static str,
    /// Its WGSL, from `shaders/`, without the extension.
    pub file: &'static str,
    /// What it binds.
    pub bindings: Bindings,
    /// Override constants. `COUNT` is set where nodes and triangles are counted.
    pub overrides: &'static [(&'static str, f64)],
    /// What runs in its place on the processor.
    pub twin: Twin,
}

/// A buffer that the kernels of a family share.
pub struct FamilyBuffer {
    /// Its name.
    pub name: &'static str,
    /// Bytes of an element.
    pub stride: usize,
    /// Whether kernels write it.
    pub is_written: bool,
}

/// The kernels of a secondary method, and the buffers that they share: group 2, in the order of their bindings.
pub struct Family {
    /// Of the group.
    pub name: &'static str,
    /// What the buffers hold, in messages.
    pub what: &'static str,
    /// What to do where the device holds less, in messages.
    pub remedy: &'static str,
    /// Whether the lamps come before the buffers.
    pub has_lamps: bool,
    /// The buffers.
    pub buffers: &'static [FamilyBuffer],
    /// The kernels.
    pub kernels: &'static [Kernel],
}

impl Family {
    /// The kernel of a name, if it is one of these.
    pub fn kernel(&self, name: &str) -> Option<&'static Kernel> {
        self.kernels.iter().find(|kernel| kernel.name == name)
    }
}

/// What a twin returns, made a result.
pub trait Outcome {
    /// The result.
    ///
    /// # Errors
    /// The twin's.
    fn outcome(self) -> Result<(), ExecutorError>;
}

impl Outcome for () {
    fn outcome(self) -> Result<(), ExecutorError> {
        Ok(())
    }
}

impl Outcome for Result<(), ExecutorError> {
    fn outcome(self) -> Result<(), ExecutorError> {
        self
    }
}

/// Declares a table of kernels; see the head of this module. `pub static TABLE in names` names the table and a module
/// with a constant for each kernel's name.
#[macro_export]
macro_rules! kernels {
    (
        $(#[$about:meta])* static $table:ident, $names:ident;
        $($name:ident: $file:literal $bindings:ident [$($constant:ident = $value:literal),*] $twin:expr;)*
    ) => {
        /// The names of the kernels.
        #[allow(non_upper_case_globals, missing_docs)]
        pub mod $names {
            $(pub const $name: &str = stringify!($name);)*
        }

        $(#[$about])*
        pub static $table: &[$crate::kernels::table::Kernel] = &[$($crate::kernels::table::Kernel {
            name: $names::$name,
            file: $file,
            bindings: $crate::kernels::table::Bindings::$bindings,
            overrides: &[$((stringify!($constant), $value as f64)),*],
            twin: |bound, target| {
                let twin: fn(&$crate::kernels::bound::Bound, &mut $crate::kernels::table::Target) -> _ = $twin;
                $crate::kernels::table::Outcome::outcome(twin(bound, target))
            },
        }),*];
    };
}

kernels! {
    /// The kernels that need no method.
    static KERNELS, names;

    generate_primary: "shade/generate_primary" Tiles [] |b, t| generate_primary(b, t.own);
    generate_shadow: "shade/generate_shadow" Shading []
        |b, t| generate_shadow(b, t.own, t.seen, &t.pixels.origins);
    generate_occlusion: "shade/generate_around" Shading [LIMITED = 1]
        |b, t| generate_occlusion(b, t.own, t.seen, &t.pixels.gbuffers[t.shaded], &t.pixels.origins);
    generate_diffuse: "shade/generate_around" Shading [LIMITED = 0]
        |b, t| generate_diffuse(b, t.own, t.seen, t.pixels, t.materials);
    generate_glossy: "shade/generate_glossy" Shading []
        |b, t| generate_glossy(b, t.own, t.seen, t.pixels, t.materials);
    generate_path: "paths/generate_path" Shading []
        |b, t| generate_path(b, t.own, t.seen, t.pixels, t.materials);
    count_paths: "paths/count_paths" Shading [] |_, _| ();
    scan_paths: "paths/scan_paths" Shading [] |_, _| ();
    keep_paths: "paths/move_paths" Shading [COMPACT = 0] |b, t| keep_paths(b, t.own, t.seen, t.pixels);
    compact_paths: "paths/move_paths" Shading [COMPACT = 1] |b, t| compact_paths(b, t.own, t.seen, t.pixels);
    start_hits: "shade/start_hits" Tiles [] |_, t| start_hits(t.own);
    clip_rays: "shade/clip_rays" Tiles [] |b, t| clip_rays(b, t.own);
    halve_rays: "shade/halve_rays" Tiles [] |b, t| halve_rays(b, t.own);

    clear_gbuffer: "shade/clear_gbuffer" Shading [] |b, t| clear_gbuffer(b, t.pixels, t.shaded);
    resolve: "shade/resolve" CacheShading []
        |b, t| resolve(b, t.seen, t.pixels.of_set(t.shaded), t.materials, t.attributes);
    sample: "texture/sample" Sampling []
        |b, t| sample(b, t.pixels.of_set(t.shaded), t.sampling, t.tile_demand);
    shade: "shade/shade" Shading [] |b, t| shade(b, t.pixels, t.shaded, t.seen, t.materials);
    add_light: "shade/add_light" Shading [] |b, t| add_light(b, t.pixels, t.shaded, (t.seen, t.own), t.materials);
    add_occlusion: "shade/add_occlusion" Shading []
        |b, t| add_occlusion(b, t.pixels, t.shaded, (t.seen, t.own), t.materials);

    tile_bounds: "query/tile_bounds" Tiles [] |b, t| tile_bounds(b, t.own, &mut t.tiles.bounds);
    tile_walk_count: "query/tile_walk" Tiles [WRITE = 0] |b, t| tile_walk_count(b, t.tiles);
    tile_walk_write: "query/tile_walk" Tiles [WRITE = 1] |b, t| tile_walk_write(b, t.tiles);
    tile_scan: "query/tile_scan" Tiles [] |b, t| tile_scan(b, t.tiles);
    tile_select: "query/tile_select" Tiles [INTERSECT = 0] |b, t| tile_select::<false>(b, t.tiles);
    tile_select_intersect: "query/tile_select" Tiles [INTERSECT = 1] |b, t| tile_select::<true>(b, t.tiles);
    tile_choose: "query/tile_choose" Tiles [] |_, t| tile_choose(t.tiles);
    tile_sort_number: "query/tile_sort" Tiles [NEAR = 0] |b, t| tile_sort::<false>(b, t.tiles);
    tile_sort_near: "query/tile_sort" Tiles [NEAR = 1] |b, t| tile_sort::<true>(b, t.tiles);

    query: "query/query" Tiles [] |b, t| query(b, t.own, t.tiles);
    query_pairs: "query/query_pairs" Tiles [] |b, t| query_pairs(b, t.own, t.tiles);
    query_reduce: "query/query_reduce" Tiles [] |b, t| query_reduce(b, t.tiles);
    query_all: "query/query_all" Tiles [] |b, t| query_all(b, t.own, Work::All, &t.tiles.pair_counts);
    query_from_root: "query/query_all" Tiles [OF_TILES = 1]
        |b, t| query_all(b, t.own, Work::Rooted(&t.tiles.lists), &t.tiles.pair_counts);
    query_stand_ins: "query/query_all" Tiles [STAND_INS = 1] |b, t| query_stand_ins(b, t.own, &t.tiles.pair_counts);
    count_pairs: "query/query_all" Tiles [PAIRS = 1] |b, t| {
        t.tiles.pair_counts.start(b.params.tiles, b.scene.leaves.len())?;
        count_pairs(b, t.own, &t.tiles.pair_counts);
        Ok(())
    };
    hit_demand: "query/hit_demand" Tiles [] |b, t| hit_demand(b, t.own);

    intersect_list: "trace/intersect_list" CacheTiles [COUNT = 0] |b, t| intersect_list(b, t.own, t.tiles);
    intersect_all: "trace/intersect_all" CacheTiles [COUNT = 0, SELECT = 0]
        |b, t| intersect_all::<false>(b, t.own, Work::All, &t.tiles.pair_counts);
    intersect_selected: "trace/intersect_all" CacheTiles [COUNT = 0, SELECT = 1]
        |b, t| intersect_all::<true>(b, t.own, Work::All, &t.tiles.pair_counts);
    intersect_from_root: "trace/intersect_all" CacheTiles [COUNT = 0, SELECT = 1, OF_TILES = 1]
        |b, t| intersect_all::<true>(b, t.own, Work::Rooted(&t.tiles.lists), &t.tiles.pair_counts);
    intersect_from_root_all: "trace/intersect_all" CacheTiles [COUNT = 0, SELECT = 0, OF_TILES = 1]
        |b, t| intersect_all::<false>(b, t.own, Work::Rooted(&t.tiles.lists), &t.tiles.pair_counts);
    intersect_binary: "trace/intersect_binary" Binary [] |b, t| match t.binary {
        Some(trees) => {
            intersect_binary(b, t.own, trees);
            Ok(())
        }
        None => Err(ExecutorError::Device("has no binary trees; this is a bug in brickwalk".into())),
    };
}

/// The kernel of a name, if it is one of [`KERNELS`].
pub fn kernel(name: &str) -> Option<&'static Kernel> {
    KERNELS.iter().find(|kernel| kernel.name == name)
}
