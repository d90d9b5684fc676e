//! Structures and constants shared with the kernels. The build reflects `shaders/common/types.wgsl` and asserts that
//! sizes, offsets and values agree; see the WGSL for what each field means.
#![allow(missing_docs)]

use bytemuck::{Pod, Zeroable};

pub use bricks::{
    BRICK_DETAIL, BRICK_INDEX32, BRICK_OPACITY, BRICK_WIDE, INSTANCE_IDENTITY, INSTANCE_MIRRORED, NO_NORMAL, NONE,
};
pub use bricks::{MATERIAL_DOUBLE_SIDED, MATERIAL_UNLIT};
pub use bricks::{TEXTURE_BC5, TEXTURE_BC7, TEXTURE_RGBA8, TEXTURE_SRGB, TILE_TEXELS};

pub const PARAM_ANY_HIT: u32 = 1;
pub const PARAM_NEEDED: u32 = 2;
pub const PARAM_SUN: u32 = 4;
pub const PARAM_SKY: u32 = 8;
pub const PARAM_BOUNCE: u32 = 16;
pub const PARAM_EMITTER: u32 = 32;
pub const PARAM_ENVIRONMENT: u32 = 64;
pub const PARAM_SCATTER: u32 = 4096;
pub const PARAM_TIGHTER: u32 = 128;
pub const PARAM_NEXT: u32 = 256;
pub const PARAM_CULLED: u32 = 512;
pub const PARAM_EMISSION: u32 = 1024;
pub const PARAM_MISS: u32 = 2048;
pub const PARAM_GLOSSY: u32 = 8192;
pub const PARAM_COARSER: u32 = 16384;
pub const STATE_GEOMETRY: u32 = 1;
pub const STATE_DONE: u32 = 2;
pub const STATE_BATCH: u32 = 4;
pub const STATE_ATTRIBUTES: u32 = 8;
pub const COUNTER_PAIRS_TESTED: u32 = 0;
pub const COUNTER_PAIRS_CULLED: u32 = 1;
pub const COUNTER_PAIRS_VISIBLE: u32 = 2;
pub const COUNTER_PAIRS_INVISIBLE: u32 = 3;
pub const COUNTER_PAIRS_INTERSECTED: u32 = 4;
pub const COUNTER_LIST_ENTRIES: u32 = 5;
pub const COUNTER_STACK_OVERFLOW: u32 = 6;
pub const COUNTER_NON_FINITE: u32 = 7;
pub const COUNTER_RAYS: u32 = 8;
pub const COUNTER_NODES: u32 = 9;
pub const COUNTER_TRIANGLES: u32 = 10;
pub const COUNTER_HITS: u32 = 11;
pub const COUNTER_MOST_SELECTED: u32 = 12;
pub const COUNTER_FRONT_TO_BACK: u32 = 13;
pub const COUNTER_TILE_BATCHES: u32 = 14;
pub const COUNTER_TILE_BATCH_LEAVES: u32 = 15;
pub const COUNTER_TIGHTENED: u32 = 16;
pub const COUNTER_TILES_FROM_ROOT: u32 = 17;
pub const COUNTER_TILES_CHOSEN: u32 = 18;
pub const COUNTER_ROMA_CAPPED: u32 = 19;
pub const COUNTER_UNRESOLVED: u32 = 20;
pub const COUNTER_DVF_ANSWERED: u32 = 21;
pub const COUNTER_FIELD_CAPPED: u32 = 22;
pub const COUNTER_PILOTS: u32 = 23;
pub const WORK_CHOSEN: u32 = 32;
pub const WORK_ROOTED: u32 = 36;
pub const GBUFFER_READ: u32 = 1;
pub const GBUFFER_WAITS: u32 = 62;
pub const GBUFFER_FIRST: u32 = 1;
pub const MET: u32 = 0xffff_fffe;
pub const ROMA_WHOLE: u32 = 0;
pub const ROMA_FAR: u32 = 1;
pub const ROMA_SIFT: u32 = 2;
pub const ROMA_CORRECT: u32 = 3;
/// Distances up to which rays in doubt may be traced: 0, 2, 4, 8, 16 and 32 cells of a map.
pub const HANDOVERS: u32 = 6;
pub const RSM_PERSPECTIVE: u32 = 1;
pub const DVF_HAMMERSLEY: u32 = 1;
pub const DVF_ROUND: u32 = 2;
pub const DVF_BOTH: u32 = 4;
pub const DVF_DOUBT: u32 = 8;
pub const DVF_PAPER: u32 = 16;
pub const DVF_RENEW: u32 = 32;
pub const DVF_WALK: u32 = 512;
pub const BINARY_LEAF: u32 = 0x8000_0000;
/// Samples that are summed in f32 before the sum begins anew, see `render::Accumulation`.
pub const BATCH_SAMPLES: u32 = 64;
pub const EMITTER_PARALLELOGRAM: u32 = 0;
pub const EMITTER_TRIANGLE: u32 = 1;
pub const EMITTER_POINT: u32 = 2;
pub const EMITTER_SPOT: u32 = 3;
pub const EMITTER_DISTANT: u32 = 4;
pub const EMITTER_KIND: u32 = 7;
pub const EMITTER_TWO_SIDED: u32 = 8;
/// Rows and columns of the table of reflectances.
pub const REFLECTANCE_SIZE: u32 = 32;
/// Number of counters.
pub const COUNTERS: usize = 32;
/// Counters and, behind them, what indirect dispatches take: from [`WORK_CHOSEN`] and [`WORK_ROOTED`] on, four words
/// each.
pub const COUNTERS_AND_WORK: usize = 40;
/// What an unbounded ray has for t_max on the device: the greatest f32 but one.
pub const T_INFINITE: f32 = 3.402_823_4e38;

macro_rules! mirror {
    ($(struct $name:ident { $($field:ident: $kind:ty),* $(,)? })*) => {$(
        #[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
        #[repr(C)]
        pub struct $name { $(pub $field: $kind),* }
    )*};
}

mirror! {
    struct Params {
        zero: u32, width: u32, height: u32, tile: u32,
        tiles_x: u32, tiles: u32, flags: u32, list_capacity: u32,
        select_mask: u32, select_want: u32, threshold: u32, top_count: u32,
        sample: u32, seed: u32, instance_pad: f32, sun_radius: f32,
        origin: [f32; 4], base: [f32; 4], step_x: [f32; 4], step_y: [f32; 4],
        sun: [f32; 4], sun_color: [f32; 4], sky_color: [f32; 4], ground_color: [f32; 4], jitter: [f32; 4],
        around: [f32; 4],
        share: f32, length: f32, stream: u32,
        pair_count: u32, run_first: u32, run_count: u32, list_most: u32,
        emitter_count: u32, direction: u32, environment_width: u32, environment_height: u32,
        emitter_density: f32, diffuse_count: f32, padding0: u32, padding1: u32, padding2: u32,
        environment_turn: [f32; 4], ambient: [[f32; 4]; 9],
    }
    struct Ray { origin: [f32; 3], t_min: f32, direction: [f32; 3], t_max: f32 }
    struct Hit { t: f32, id: u32, u: f32, v: f32 }
    struct Surface {
        point: [f32; 3], leaf: u32, normal: [f32; 3], triangle: u32, area: f32, source: u32, pending: u32, padding: u32,
    }
    struct TileBounds {
        origin_min: [f32; 3], t_min: f32, origin_max: [f32; 3], t_max: f32,
        direction_min: [f32; 3], rays: u32, direction_max: [f32; 3], padding: u32,
    }
    struct TileList { first: u32, count: u32, selected: u32, from_root: u32, chosen: u32, rooted: u32 }
    struct Entry { leaf: u32, near: f32 }
    struct TopNode2 { min: [f32; 3], left: u32, max: [f32; 3], right: u32 }
    struct BinaryNode { min: [f32; 3], what: u32, max: [f32; 3], padding: u32 }
    struct Leaf { offset_high: [f32; 3], instance: u32, offset_low: [f32; 3], brick: u32 }
    struct Instance {
        object_from_world: [[f32; 4]; 3], world_from_object: [[f32; 4]; 3],
        base: u32, flags: u32, scale: f32, volume: f32,
    }
    struct Brick {
        vertices: u32, ids: u32, indices: u32, flags: u32,
        surfaces: u32, attribute_indices: u32, opacity_of: u32, opacities: u32,
        details: u32, padding0: u32, padding1: u32, padding2: u32,
    }
    struct Opacity {
        factor: f32, cutoff: f32, blends: u32, texels: u32, width: u32, height: u32, wrap: u32, padding: u32,
    }
    struct Slot {
        geometry_page: u32, geometry_offset: u32, attributes_page: u32, attributes_offset: u32,
        state: u32, padding0: u32, padding1: u32, padding2: u32,
    }
    struct Pair { x0: u32, y0: u32, x1: u32, y1: u32, first: u32, count: u32, padding0: u32, padding1: u32 }
    struct Demand { rays: u32, nearest: u32, next: u32 }
    struct PairDemand { rays: u32, nearest: u32 }
    struct Material {
        base_color: [f32; 4], emission: [f32; 3], metallic: f32,
        roughness: f32, alpha_cutoff: f32, flags: u32, base_color_texture: u32,
        opacity_map: u32, normal_texture: u32, metallic_roughness_texture: u32, occlusion_texture: u32,
        emissive_texture: u32, normal_scale: f32, occlusion_strength: f32, clearcoat: f32,
        specular: [f32; 3], specular_weight: f32,
        clearcoat_roughness: f32, transmission: f32, uv_sets: u32, padding: u32,
        uv_from_set: [[f32; 4]; 10],
    }
    struct Texture {
        width: u32, height: u32, levels: u32, wrap: u32, encoding: u32, flags: u32, first_tile: u32, tail_level: u32,
        tail_page: u32, tail_offset: u32, padding0: u32, padding1: u32,
    }
    struct TileSlot { page: u32, offset: u32 }
    struct TileDemand { rays: u32, first: u32, used: u32 }
    struct GBuffer {
        albedo: [f32; 3], state: u32, normal: [f32; 3], material: u32, emission: [f32; 3], footprint: f32,
        weights: [f32; 2], uv: [f32; 2], tangent: [f32; 3], handedness: f32,
        uv1: [f32; 2], footprint1: f32, occlusion: f32, metallic: f32, roughness: f32, padding0: u32, padding1: u32,
    }
    struct Level { first: [f32; 3], scale: f32, lift: f32, padding0: u32, padding1: u32, padding2: u32 }
    struct RomaMap { cell_from_point: [[f32; 4]; 3], base_from_cell: [[f32; 4]; 3], direction: [f32; 4] }
    struct RsmMap {
        texel_from_point: [[f32; 4]; 3], first: u32, width: u32, height: u32, lamp: u32,
        flags: u32, padding0: u32, padding1: u32, padding2: u32,
    }
    struct DvfGrid {
        first: [f32; 3], scale: f32, size: [u32; 3], octahedral: u32,
        flags: u32, points: f32, total: f32, area_scale: f32,
        rays: u32, lanes: u32, triangles: u32, point_count: u32,
        seed: u32, listed: u32, padding0: u32, padding1: u32,
    }
    struct DvfTriangle { a: [f32; 3], id: u32, b: [f32; 3], flags: u32, c: [f32; 3], padding: u32 }
    struct RsmTexel { flux: [f32; 3], depth: f32, normal: [f32; 3], facing: f32 }
    struct RomaOwn {
        k: u32, size: u32, cells: u32, levels: u32, samples: u32, steps: u32, near: u32, part: u32, is_part: u32, pilots: u32,
    }
    struct DfOwn { cells: u32, levels: u32, level: u32, mip: u32, step: u32, half: u32, steps: u32, hit: f32 }
    struct RsmOwn { maps: u32, map: u32, x: u32, y: u32 }
    struct DvfOwn { first: u32, next: u32, count: u32, turn: u32, around: [f32; 4] }
    struct Emitter {
        corner: [f32; 3], kind: u32, u: [f32; 3], probability: f32,
        v: [f32; 3], threshold: u32, radiance: [f32; 3], other: u32,
    }
}
