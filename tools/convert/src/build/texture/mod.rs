//! What is stored of textures: `mips` makes their levels and cuts them into tiles, `roughness` widens what stands for
//! bumps, `opacity` makes maps of alpha, `small` keeps copies for levels of detail.

pub(super) mod mips;
pub(super) mod opacity;
mod roughness;
pub(super) mod small;
