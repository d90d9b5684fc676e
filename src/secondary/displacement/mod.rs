//! Displacement fields (Gaitatzes, Chrysanthou, Papaioannou 2008, "Presampled visibility for ambient occlusion"): for a
//! sphere around an object or a brick how far rays that enter it go, by position and direction.
//!
//! *Gains.* A look-up costs the same whatever the object holds, and needs no brick: rays are answered against bricks
//! that are away. *Costs.* 4.3 MB an object of 4226 x 32² samples; at most an eighth of a brick's geometry. *Limits.*
//! Errors of the size of a cell of positions; nothing is known of what lies before a ray's start within the sphere, so
//! rays that start there are mostly traced; similarities alone.
//!
//! *What we changed.* The stored ray is the one from the nearest position that meets the asked one in the middle of its
//! chord, not the one in its direction: half of the error. Distances are shares of the chord instead of the diameter:
//! all codes are used. A ray that a field does not know is traced, and so is what lies near its start; the others are
//! ended there.
//!
//! [`shape`] has the samples, [`field`] what they say of a ray, [`bake`] traces them, [`make`] puts them into a scene
//! file, [`Library`] has those of a scene, [`Displacement`] answers rays. Kernel: `shaders/displacement/`.

mod answer;
pub mod bake;
mod ball;
mod carriers;
pub mod field;
pub mod kernels;
mod library;
pub mod make;
mod settings;
pub mod shape;
mod subject;
#[cfg(test)]
mod tests;
pub mod twin;

pub use answer::Displacement;
pub use bake::{Bench, Job};
pub use ball::Ball;
pub use field::{Chord, FieldView, code_of};
pub use library::Library;
pub use settings::{Against, Interpolation, Options};
pub use shape::Shape;
pub use subject::{Subject, is_similarity};
