//! The scenes: generated or converted with levels of detail where they are missing.

use super::scale::Settings;
use crate::lab::bench::scenes::{View, make_by};
use crate::lab::console::Console;
use crate::output::atomic;
use crate::scene::framing::path_from_bounds;
use crate::scene::path::CameraPath;
use crate::session::opened::open_scene;
use anyhow::{Context, Result, bail};
use brickwalk_convert::build::{BuildSettings, build_source};
use brickwalk_convert::import::{ImportSettings, Input, import};
use brickwalk_scenes::{Kind, Settings as Generated};
use std::path::{Path, PathBuf};

/// The city.
pub const CITY: &str = "city";
/// The large city.
pub const CITY_LARGE: &str = "city-large";
/// The plant.
pub const PLANT: &str = "pipes";
/// Sixteen copies of it.
pub const PLANTS_16: &str = "pipes-16";
/// Mountains and woods.
pub const TERRAIN: &str = "terrain";

/// Copies of the plant and the names of such scenes.
const PLANTS: [(u32, &str); 4] = [(1, PLANT), (4, "pipes-4"), (16, PLANTS_16), (256, "pipes-256")];

/// Triangles of a brick of models: they are small, and shares of the cache are to hold several.
const MODEL_BRICKS: u32 = 2048;

/// Bricks that a generated scene has at least.
const LEAST_BRICKS: u64 = 100;

/// Models below the folder of inputs: names, files, and what they are.
const MODELS: [(&str, &str); 3] =
    [("teapots", "teapots_instanced/TeapotsGalore.gltf"), ("scan", "scans/lucy.ply"), ("sponza", "sponza/Sponza.gltf")];

/// The name of so many copies of the plant.
pub fn plants(copies: u32) -> &'static str {
    PLANTS.iter().find(|(own, _)| *own == copies).map_or(PLANT, |(_, name)| name)
}

/// Where a scene comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Origin {
    /// It is generated.
    Generated(Generated),
    /// It is converted from a file.
    Model(PathBuf),
}

/// A scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Subject {
    /// Its name.
    pub name: &'static str,
    /// Where it comes from.
    pub origin: Origin,
    /// Whether pictures and walks are measured, and not its working set alone.
    pub is_shown: bool,
}

/// The scenes that are measured, and what is left out, a line each.
pub fn subjects(settings: &Settings, inputs: Option<&Path>) -> (Vec<Subject>, Vec<String>) {
    let generated = |name, kind: Kind, triangles: u64, copies| {
        let triangles = triangles.clamp(*kind.triangles().start(), *kind.triangles().end());
        let origin = Origin::Generated(Generated { kind, triangles, copies, ..Generated::default() });
        Subject { name, origin, is_shown: true }
    };
    let mut all = vec![generated(CITY, Kind::City, settings.triangles, 1)];
    all.extend(settings.large.map(|triangles| generated(CITY_LARGE, Kind::City, triangles, 1)));
    all.push(generated(TERRAIN, Kind::Terrain, settings.triangles, 1));
    all.push(generated("stadium", Kind::Stadium, settings.triangles, 1));
    for (copies, name) in PLANTS {
        if copies == 16 || settings.copies.contains(&copies) {
            let is_shown = copies == 16;
            all.push(Subject { is_shown, ..generated(name, Kind::Pipes, settings.triangles, copies) });
        }
    }
    let mut left_out = Vec::new();
    for (name, file) in MODELS {
        match inputs.map(|folder| folder.join(file)) {
            Some(file) if file.exists() => {
                all.push(Subject { name, origin: Origin::Model(file), is_shown: true });
            }
            Some(file) => left_out.push(format!("{name}: left out: {} is missing", file.display())),
            None => left_out.push(format!("{name}: left out: give the folder of {file} with --inputs")),
        }
    }
    (all, left_out)
}

/// A scene file.
pub struct Place {
    /// The file.
    pub file: PathBuf,
    /// Whether there are path files beside it.
    has_paths: bool,
}

impl Place {
    /// The path of a view: the file beside the scene, or a quarter turn around the scene from outside.
    ///
    /// # Errors
    /// The file cannot be read or is no path; the scene cannot be read.
    pub fn path(&self, view: View) -> Result<CameraPath> {
        if self.has_paths {
            return Ok(CameraPath::read(&self.file.with_extension(format!("{}.json", view.name())))?);
        }
        let scene = open_scene(&self.file)?;
        let manifest = &scene.resident().manifest;
        Ok(path_from_bounds(manifest.min, manifest.max))
    }
}

/// The file of a scene in `folder`, made where it is missing.
///
/// # Errors
/// It cannot be generated, read or written; it has no levels of detail.
pub fn place(subject: &Subject, folder: &Path, console: Console) -> Result<Place> {
    let place = match &subject.origin {
        Origin::Generated(settings) => {
            let Generated { kind, triangles, copies, .. } = *settings;
            let copied = if copies == 1 { String::new() } else { format!("-x{copies}") };
            let file = folder.join(format!("{kind}-{triangles}{copied}-lod.bricks"));
            // Paths are written after the scene.
            if !file.with_extension("far.json").exists() || !file.exists() {
                atomic::create_folder(folder)?;
                let brick_triangles = (triangles / LEAST_BRICKS).clamp(1, 16_384) as u32;
                make_by(settings, levelled(brick_triangles), &file, console)?;
            }
            Place { file, has_paths: true }
        }
        Origin::Model(model) => {
            let file = folder.join(format!("{}-lod.bricks", subject.name));
            if !file.exists() {
                atomic::create_folder(folder)?;
                convert(model, &file, console).with_context(|| model.display().to_string())?;
            }
            Place { file, has_paths: false }
        }
    };
    if open_scene(&place.file)?.resident().levels.is_empty() {
        bail!("{}: the scene has no levels of detail; remove it to have it made anew", place.file.display());
    }
    Ok(place)
}

/// How scenes with levels of detail are built.
fn levelled(brick_triangles: u32) -> BuildSettings {
    BuildSettings { brick_triangles, lod: true, ..BuildSettings::default() }
}

/// Converts a model.
fn convert(model: &Path, file: &Path, console: Console) -> Result<()> {
    let progress = (console.job)();
    let scratch = file.parent().map(Path::to_path_buf);
    let importing = ImportSettings { scratch, ..ImportSettings::default() };
    let source = import(&[Input::from(model)], &importing, &progress)?;
    build_source(&source, &levelled(MODEL_BRICKS), file, &progress)?;
    progress.finish();
    Ok(())
}
