//! What is stored of textures: `mips` makes their levels and cuts them into tiles, `opacity` makes maps of their alpha.

pub(super) mod mips;
pub(super) mod opacity;
