//! The scenes of the bench: generated where they are missing.

use super::args::Settings;
use super::plan::{SceneId, View};
use crate::cli::options::args::Cli;
use crate::output::atomic;
use crate::scene::path::{CameraPath, path_from_bounds};
use anyhow::{Context, Result};
use clap::Parser;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Copies of the plant in [`SceneId::Pipes16`].
const COPIES: u32 = 16;

/// Bricks that a scene has at least.
const LEAST_BRICKS: u64 = 100;

/// A scene file.
pub struct Place {
    /// The file.
    pub scene: PathBuf,
    /// Path of a scene that has none beside it.
    otherwise: Option<CameraPath>,
}

impl Place {
    /// The path of a view: the file beside the scene, or one made from the scene's bounds.
    ///
    /// # Errors
    /// The file cannot be read or is no path.
    pub fn path(&self, view: View) -> Result<CameraPath> {
        let file = self.scene.with_extension(format!("{}.json", view.name()));
        match &self.otherwise {
            Some(path) if !file.exists() => Ok(path.clone()),
            _ => Ok(CameraPath::read(&file)?),
        }
    }
}

/// Makes sure that a scene is there.
///
/// # Errors
/// It cannot be generated, or is no scene.
pub fn place(scene: SceneId, folder: &Path, settings: &Settings, sponza: Option<&Path>) -> Result<Place> {
    let [city, large, pipes] = settings.triangles;
    let (kind, triangles, copies) = match scene {
        SceneId::Sponza => {
            let scene = sponza.context("there is no Sponza; give it with --sponza")?.to_path_buf();
            let manifest = crate::session::open::open_scene(&scene)?.resident().manifest.clone();
            let otherwise = Some(path_from_bounds(manifest.min, manifest.max));
            return Ok(Place { scene, otherwise });
        }
        SceneId::City => ("city", city, 1),
        SceneId::CityLarge => ("city", large, 1),
        SceneId::Pipes => ("pipes", pipes, 1),
        SceneId::Pipes16 => ("pipes", pipes, COPIES),
    };
    let file = folder.join(match copies {
        1 => format!("{kind}-{triangles}.bricks"),
        copies => format!("{kind}-{triangles}-x{copies}.bricks"),
    });
    // Paths are written after the scene.
    if !file.with_extension("far.json").exists() || !file.exists() {
        atomic::create_folder(folder)?;
        let mut words: Vec<OsString> = ["brickwalk", "scene", kind, "-o"].map(OsString::from).to_vec();
        words.push(file.clone().into());
        // Small scenes are cut finer, so that shares of the cache hold several bricks.
        let brick_triangles = (triangles / LEAST_BRICKS).clamp(1, 16_384).to_string();
        let (triangles, copies) = (triangles.to_string(), copies.to_string());
        let options = ["--triangles", &triangles, "--copies", &copies, "--brick-triangles", &brick_triangles];
        words.extend(options.map(OsString::from));
        let cli = Cli::try_parse_from(words).context("the bench's own scene")?;
        crate::cli::run(&cli.command).with_context(|| file.display().to_string())?;
    }
    Ok(Place { scene: file, otherwise: None })
}
