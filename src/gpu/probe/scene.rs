//! The scene of the probe, which is part of the program.

use bricks::{Error, SceneFile};

/// The scene that the traversal pipelines are compared with: several bricks, one of them wide; sheets in one plane,
/// some twice; slivers; turned and mirrored instances. `scene_tests.rs` says how it is made.
pub(crate) fn scene() -> Result<SceneFile, Error> {
    SceneFile::from_bytes("the probe's scene", include_bytes!("scene.bricks"))
}
