//! The scenes of the benches: generated where they are missing.

use crate::frame::Renderer;
use crate::lab::console::Console;
use crate::output::atomic;
use crate::scene::framing::path_from_bounds;
use crate::scene::path::CameraPath;
use crate::schedule::cache::Cache;
use crate::session::Settings;
use crate::session::opened::{Opened, open_scene};
use crate::session::renderer::renderer;
use crate::settings::names;
use crate::stream::Residency;
use anyhow::{Context, Result};
use brickwalk_convert::build::{BuildSettings, build_source};
use brickwalk_scenes::{Kind, Settings as Generated, generate, write_motion, write_paths};
use std::path::{Path, PathBuf};

names! {
    /// A scene.
    SceneId {
        /// The city that fits.
        City = "city",
        /// The city that does not.
        CityLarge = "city-large",
        /// The plant.
        Pipes = "pipes",
        /// Sixteen copies of it.
        Pipes16 = "pipes-16",
        /// A converted Sponza.
        Sponza = "sponza",
    }
}

names! {
    /// A path; so are path files called.
    View {
        /// Through the midst.
        Near = "near",
        /// With everything in view.
        Far = "far",
    }
}

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

/// Where scenes are, and how large.
pub struct Scenes<'a> {
    folder: PathBuf,
    triangles: [u64; 3],
    sponza: Option<&'a Path>,
    console: Console<'a>,
}

impl<'a> Scenes<'a> {
    /// Those of `folder`, else of the folder `scenes` in `output`: the city, the large city and the plant of so many
    /// triangles.
    pub fn new(
        folder: Option<&Path>,
        output: &Path,
        triangles: [u64; 3],
        sponza: Option<&'a Path>,
        console: Console<'a>,
    ) -> Self {
        let folder = folder.map_or_else(|| output.join("scenes"), Path::to_path_buf);
        Self { folder, triangles, sponza, console }
    }

    /// The file name of Sponza, if there is one.
    pub fn sponza_name(&self) -> Option<String> {
        self.sponza?.file_name().map(|name| name.to_string_lossy().into_owned())
    }

    /// Makes sure that a scene is there.
    ///
    /// # Errors
    /// It cannot be generated, or is no scene.
    pub fn place(&self, scene: SceneId) -> Result<Place> {
        let [city, large, pipes] = self.triangles;
        let (kind, triangles, copies) = match scene {
            SceneId::Sponza => {
                let scene = self.sponza.context("there is no Sponza; give it with --sponza")?.to_path_buf();
                let manifest = open_scene(&scene)?.resident().manifest.clone();
                return Ok(Place { scene, otherwise: Some(path_from_bounds(manifest.min, manifest.max)) });
            }
            SceneId::City => (Kind::City, city, 1),
            SceneId::CityLarge => (Kind::City, large, 1),
            SceneId::Pipes => (Kind::Pipes, pipes, 1),
            SceneId::Pipes16 => (Kind::Pipes, pipes, COPIES),
        };
        let copied = if copies == 1 { String::new() } else { format!("-x{copies}") };
        let file = self.folder.join(format!("{kind}-{triangles}{copied}.bricks"));
        // Paths are written after the scene.
        if !file.with_extension("far.json").exists() || !file.exists() {
            atomic::create_folder(&self.folder)?;
            // Small scenes are cut finer, so that shares of the cache hold several bricks.
            let brick_triangles = (triangles / LEAST_BRICKS).clamp(1, 16_384) as u32;
            make(&Generated { kind, triangles, copies, ..Generated::default() }, brick_triangles, &file, self.console)?;
        }
        Ok(Place { scene: file, otherwise: None })
    }
}

/// Opens a scene file to be rendered.
///
/// # Errors
/// The scene's, the device's.
pub fn open(scene: &Path, settings: &Settings) -> Result<Renderer> {
    renderer(Opened::open(open_scene(scene)?, scene, settings)?, scene, settings)
}

/// Empties the cache of a renderer.
///
/// # Errors
/// None that the first one did not have.
pub fn empty_cache(renderer: &mut Renderer) -> Result<()> {
    let page_bytes = renderer.executor.page_bytes();
    let Cache { sizes, nodes, residency: old, .. } = &renderer.cache;
    let residency = Residency::new(sizes, old.budget_bytes(), page_bytes, old.policy())?;
    renderer.cache = Cache::new(residency, sizes.clone(), nodes.clone(), None);
    Ok(())
}

/// Generates a scene with bricks of at most so many triangles, its paths and its motion beside it.
///
/// # Errors
/// It cannot have so many triangles; the file cannot be written.
pub fn make(settings: &Generated, brick_triangles: u32, file: &Path, console: Console) -> Result<()> {
    make_by(settings, BuildSettings { brick_triangles, ..BuildSettings::default() }, file, console)
}

/// [`make`] as `build` says, except for what moves.
///
/// # Errors
/// As of [`make`].
pub fn make_by(settings: &Generated, build: BuildSettings, file: &Path, console: Console) -> Result<()> {
    let name = || file.display().to_string();
    let progress = (console.job)();
    let scene = generate(settings, &progress).with_context(name)?;
    let movable = settings.kind.movable().iter().map(|&name| name.to_owned()).collect();
    let build = BuildSettings { movable, ..build };
    build_source(&scene, &build, file, &progress).with_context(name)?;
    progress.finish();
    write_paths(&scene, file)?;
    write_motion(&scene, file)?;
    Ok(())
}
