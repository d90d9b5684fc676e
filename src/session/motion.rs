//! The motion of a scene: instances of the scene placed anew for every frame.

use super::lighting::LampSources;
use crate::frame::Renderer;
use crate::scene::motion::{Motion, Movers};
use anyhow::{Context, Result};
use bricks::SceneFile;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A motion of a scene.
pub struct SceneMotion {
    file: PathBuf,
    movers: Movers,
    /// The scene as it was opened.
    still: Arc<SceneFile>,
    /// What instances take along.
    lamps: LampSources,
}

impl SceneMotion {
    /// Reads the motion of `file` for `scene`, where `lamps` shine.
    ///
    /// # Errors
    /// A bad file; a node or an instance that cannot move.
    pub fn open(file: &Path, scene: &Arc<SceneFile>, lamps: &LampSources) -> Result<Self> {
        let movers = Motion::read(file)?.bind(scene.resident())?;
        Ok(Self { file: file.to_owned(), movers, still: scene.clone(), lamps: lamps.clone() })
    }

    /// Places everything for the frames to come as it is at a time of the camera path; whether anything has moved.
    ///
    /// # Errors
    /// A place that is too far out.
    pub fn place(&self, renderer: &mut Renderer, time: f64) -> Result<bool> {
        let context = || format!("{}: at time {time}", self.file.display());
        let moved = renderer.place(&self.still, &self.movers.at(time)).with_context(context)?;
        if let Some(lamps) = self.lamps.moved(&renderer.light.lamps, renderer.scene.resident(), &moved) {
            renderer.light.lamps = Arc::new(lamps);
        }
        Ok(!moved.is_empty())
    }
}
