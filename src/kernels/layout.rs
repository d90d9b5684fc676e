//! Structures and constants shared with the kernels. The build writes them from `shaders/common/types.wgsl` and every
//! other WGSL file whose name ends in `types.wgsl`.

#[cfg(test)]
mod mirror;

include!(concat!(env!("OUT_DIR"), "/layout.rs"));

/// Number of counters.
pub const COUNTERS: usize = WORK_CHOSEN as usize;
/// Counters and, behind them, what indirect dispatches take: from [`WORK_CHOSEN`] and [`WORK_ROOTED`] on, four words
/// each.
pub const COUNTERS_AND_WORK: usize = WORK_ROOTED as usize + 4;

/// Constants that the scene file shares with the kernels have one value.
macro_rules! as_in_the_scene_file {
    ($($name:ident)*) => {$(
        const _: () = assert!($name as usize == bricks::$name as usize, stringify!($name));
    )*};
}

as_in_the_scene_file! {
    NONE NO_NORMAL INSTANCE_IDENTITY INSTANCE_MIRRORED
    BRICK_DETAIL BRICK_INDEX32 BRICK_OPACITY BRICK_WIDE
    MATERIAL_DOUBLE_SIDED MATERIAL_UNLIT MATERIAL_REFRACTS MATERIAL_LAYERS MATERIAL_ANISOTROPIC MATERIAL_MORE
    MATERIAL_TEXTURES
    LAYER_STEPS LAYER_BITS LAYER_INDEX_STEPS
    BASE_COLOR NORMAL METALLIC_ROUGHNESS OCCLUSION EMISSIVE
    TEXTURE_BC5 TEXTURE_BC7 TEXTURE_RGBA8 TEXTURE_SRGB TILE_TEXELS
}
