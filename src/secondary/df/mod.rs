//! Distance fields, the baseline that occupancy maps are compared with (Zeng et al., ROMA, §3.1, §6): how far the
//! nearest occupied cell is, and rays that go on by so much at a time (Hart 1996).
//!
//! The field of a [`Bom`](super::occupancy::Bom) is made by 3D jump flooding (Rong and Tan 2006), which asks 26
//! neighbours at halving distances and so misses the nearest cell now and then: a distance may be too long, never too
//! short. Distances are from middle to middle of cells, in cells, as f16 rounded toward zero, of which there are three
//! levels, each the least of 2³ of the one before. A ray reads them with weights of the eight around it, goes on in
//! coarse levels where there is room and in fine ones where there is not (Aaltonen 2018), and hits where the nearest
//! middle is near. What the paper tuned by hand for each scene are parameters: [`Tracing`].

pub mod answer;
mod field;
mod flood;
pub mod kernels;
pub mod maps;
mod settings;
#[cfg(test)]
mod tests;
mod trace;
pub mod twin;

pub use field::{DistanceField, FieldView, LEVELS, distance_f16};
pub use flood::{NO_SEED, flood, flood_steps, jump_flood, seeds};
pub use settings::Options;
pub use trace::{LEAST_STEP, Traced, Tracing, Way};
