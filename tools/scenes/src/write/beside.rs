//! Camera paths and motion of a scene, written beside it.

use super::output;
use crate::error::Error;
use crate::motion::Mover;
use crate::path::{CameraPath, LONG_FRAMES, NEAR_FRAMES};
use crate::scene::Scene;
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};

/// What the names of scene files end with, and those of their paths do not.
const SCENE_EXTENSIONS: [&str; 4] = ["bricks", "glb", "gltf", "ply"];

#[derive(Serialize)]
struct Motion {
    instances: Vec<Mover>,
}

/// Writes the paths of a scene beside it: for `base` = `dir/S.bricks`, `dir/S.glb`, `dir/S.gltf`, `dir/S.ply` or
/// `dir/S` the files `dir/S.near.json` (a walk for 30 frames), `dir/S.near-300.json` (the same walk, longer, for 300
/// frames) and `dir/S.far.json`. Returns their names.
///
/// Each file appears complete or not at all.
///
/// # Errors
///
/// [`Error::Write`] when a file cannot be written.
pub fn write_paths(scene: &Scene, base: &Path) -> Result<Vec<PathBuf>, Error> {
    let near = |frames| scene.near_path(frames);
    let paths = [("near", near(NEAR_FRAMES)), ("near-300", near(LONG_FRAMES)), ("far", scene.far_path())];
    paths.iter().map(|(suffix, path)| write_beside(path, base, suffix)).collect()
}

/// As [`write_paths`], of a path that has all of the scene in view: `dir/S.far.json`.
///
/// # Errors
///
/// [`Error::Write`] when the file cannot be written.
pub fn write_far_path(path: &CameraPath, base: &Path) -> Result<PathBuf, Error> {
    write_beside(path, base, "far")
}

/// Writes how things of a scene move beside it, as long as its longest path: for `base` = `dir/S.bricks` the file
/// `dir/S.motion.json`. Returns its name; `None` where nothing moves.
///
/// The file appears complete or not at all.
///
/// # Errors
///
/// [`Error::Write`] when the file cannot be written.
pub fn write_motion(scene: &Scene, base: &Path) -> Result<Option<PathBuf>, Error> {
    let instances = scene.movers(LONG_FRAMES);
    if instances.is_empty() {
        return Ok(None);
    }
    write_beside(&Motion { instances }, base, "motion").map(Some)
}

/// Writes `path` into `dir/S.suffix.json`, for `base` as of [`write_paths`]; returns that name.
fn write_beside(path: &impl Serialize, base: &Path, suffix: &str) -> Result<PathBuf, Error> {
    let is_scene = base.extension().is_some_and(|e| SCENE_EXTENSIONS.iter().any(|known| e.eq_ignore_ascii_case(known)));
    let stem = if is_scene { base.with_extension("") } else { base.to_path_buf() };
    let mut name = stem.into_os_string();
    name.push(format!(".{suffix}.json"));
    let file = PathBuf::from(name);
    write_json(path, &file).map_err(|source| Error::Write { path: file.clone(), source })?;
    Ok(file)
}

fn write_json(path: &impl Serialize, file: &Path) -> std::io::Result<()> {
    let mut temporary = output::temporary(file)?;
    serde_json::to_writer_pretty(&mut temporary, path)?;
    temporary.write_all(b"\n")?;
    output::publish(temporary, file)
}
