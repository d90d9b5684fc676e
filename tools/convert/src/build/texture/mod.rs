//! What is stored of textures: `mips` makes their levels, by what `content` says that texels mean, and cuts them into
//! tiles. `roughness` widens what stands for bumps, `opacity` makes maps of alpha, `small` keeps copies for levels of
//! detail.

mod content;
pub(super) mod mips;
pub(super) mod opacity;
mod roughness;
pub(super) mod small;
