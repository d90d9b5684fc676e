//! What a frame looks at and from where: cameras and camera paths, in f64 world space.

pub mod brick_walk;
pub mod camera;
pub mod framing;
mod keyframes;
pub mod motion;
pub mod path;
pub mod placement;
mod projection;
pub mod top_walk;

pub use camera::{Camera, RayBasis};
pub use framing::{Picture, path_from_bounds};
pub use keyframes::KeyframesError;
pub use path::{CameraPath, Keyframe};
pub use projection::Projection;
