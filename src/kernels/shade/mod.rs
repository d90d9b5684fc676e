//! Twins of the kernels that make rays and shade what they hit.

pub mod generate;
pub mod gloss;
pub mod lamps;
pub mod light;
pub mod random;
pub mod resolve;
pub mod shade;
