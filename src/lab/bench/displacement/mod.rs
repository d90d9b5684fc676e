//! `brickwalk bench displacement`.

pub mod corner;
