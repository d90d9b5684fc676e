//! Truth in f64: what rays meet, decided exactly, and a judge of hits found in f32.
//!
//! [`Truth`] takes the *lattice-rounded* triangles of a scene file, places them by the instances' f64 matrices, and
//! answers with rays that are given in the very numbers the kernels used ([`TruthRay::from_f32`]). Whether a ray meets
//! a triangle is decided by exact signs, edges included; of two hits the nearer one is found exactly, at equal distance
//! the lower id.
//!
//! [`judge()`] compares a kernel's answer with truth. A difference is excused only where f32 arithmetic, as the kernels
//! carry it out, could not have told: [`bounds`] derives how far off it can be. Nothing is excused that a watertight
//! test must get right, so that a gap between two triangles that share an edge is a mismatch.

mod assessment;
pub mod bounds;
mod bvh;
mod decode;
mod instance;
mod judge;
mod opacity;
mod ray;
mod truth;

#[cfg(test)]
mod file_tests;
#[cfg(test)]
mod tests;

pub use decode::{DecodeError, TruthObject, TruthTriangle};
pub use instance::TruthInstance;
pub use judge::{Excuse, Fault, Tally, Verdict, judge, judge_any};
pub use ray::TruthRay;
pub use truth::{Truth, TruthHit};
