//! Models where a scene is named: each is converted once into a folder of the user's cache, and opened from there.
//!
//! A scene in that folder is named by the model, its path, the settings of the conversion and the version of the
//! format. Beside it lies a list of the files that the conversion looked for, with sizes and times of change: it is
//! converted again when one of them is another.

use super::convert::{summarise, usage};
use super::interrupt;
use crate::cli::output::is_quiet;
use crate::output::atomic;
use crate::remote;
use crate::settings::folder::{self, CACHE_VARIABLE};
use anyhow::{Context, Result, bail};
use bricks::one_line;
use brickwalk_convert::build::{BuildError, BuildSettings, build_source};
use brickwalk_convert::import::{EXTENSIONS, FileState, ImportSettings, Input, TILESET, import};
use brickwalk_convert::progress::Progress;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Instant, UNIX_EPOCH};
use xxhash_rust::xxh3::xxh3_64;

/// The files that a conversion looked for.
#[derive(Serialize, Deserialize, PartialEq)]
struct Sources {
    files: Vec<SourceState>,
}

/// One of them.
#[derive(Serialize, Deserialize, PartialEq)]
struct SourceState {
    path: String,
    /// Bytes, and nanoseconds since 1970 of the last change; `None`: it was not there.
    found: Option<(u64, u64)>,
}

impl From<&FileState> for SourceState {
    fn from(file: &FileState) -> Self {
        let nanoseconds = |(bytes, time): (u64, std::time::SystemTime)| {
            (bytes, time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64))
        };
        Self { path: file.path.to_string_lossy().into_owned(), found: file.found.map(nanoseconds) }
    }
}

impl Sources {
    /// Whether all files are what they were.
    fn are_current(&self) -> bool {
        let is_same = |file: &SourceState| SourceState::from(&FileState::now(Path::new(&file.path))) == *file;
        !self.files.is_empty() && self.files.iter().all(is_same)
    }
}

/// Whether `path` names a model rather than a scene file.
fn is_model(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    ending.is_some_and(|ending| EXTENSIONS.contains(&ending.as_str()))
        || path.file_name().is_some_and(|name| name == TILESET)
}

/// The folder of converted models.
///
/// # Errors
/// The environment names no folder.
fn folder() -> Result<PathBuf> {
    folder::cache().with_context(|| format!("there is no folder for converted models; name one in {CACHE_VARIABLE}"))
}

/// The scene file that `path` stands for: `path` itself, of a URL its name, of a model the converted one.
///
/// # Errors
/// The model is missing or bad; the cache folder cannot be written to.
pub fn scene(path: &Path) -> Result<PathBuf> {
    scene_told(path, None, &say)
}

/// [`scene`], which says nothing and tells `progress` how far it is.
///
/// # Errors
/// As [`scene`].
#[cfg(feature = "viewer")]
pub fn scene_quietly(path: &Path, progress: &Progress) -> Result<PathBuf> {
    scene_told(path, Some(progress), &|_| ())
}

fn scene_told(path: &Path, progress: Option<&Progress>, say: &dyn Fn(&str)) -> Result<PathBuf> {
    if remote::is_url(path) || !is_model(path) {
        return Ok(remote::name(path));
    }
    let model = path.canonicalize().with_context(|| {
        format!("{}: cannot be read; check the path and its permissions, or give a .bricks file", path.display())
    })?;
    let settings = BuildSettings::default();
    let version = (env!("CARGO_PKG_VERSION"), bricks::layout::VERSION);
    let key = xxh3_64(format!("{model:?} {version:?} {settings:?}").as_bytes());
    let name = model.file_stem().unwrap_or_default().to_string_lossy();
    let file = folder()?.join(format!("{name}-{key:016x}.bricks"));
    let folder = file.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).with_context(|| {
        format!("{}: cannot make this folder for converted models; name another in {CACHE_VARIABLE}", folder.display())
    })?;
    let lock = lock(&file.with_extension("lock"), path, say)?;
    if is_current(&file) {
        say(&format!("{}: converted before, as {}", path.display(), file.display()));
    } else {
        say(&format!("{}: converted into {}, once", path.display(), file.display()));
        let progress = progress.cloned().unwrap_or_else(interrupt::job);
        convert(path, &file, &settings, &progress, say)?;
    }
    drop(lock);
    Ok(file)
}

/// Where the list of the files of a converted model is.
fn list_of(file: &Path) -> PathBuf {
    file.with_extension("json")
}

/// Whether a model was converted to `file` from files that are still the same.
fn is_current(file: &Path) -> bool {
    let read = || serde_json::from_slice::<Sources>(&std::fs::read(list_of(file)).ok()?).ok();
    file.is_file() && read().is_some_and(|sources| sources.are_current())
}

fn convert(model: &Path, file: &Path, settings: &BuildSettings, progress: &Progress, say: &dyn Fn(&str)) -> Result<()> {
    let start = Instant::now();
    // Whatever becomes of this, the list is no longer that of the scene.
    let _ = std::fs::remove_file(list_of(file));
    let scratch = file.parent().map(Path::to_path_buf);
    // With its full path, for the list of files.
    let input = Input::from(std::path::absolute(model).unwrap_or_else(|_| model.into()));
    let source = import(&[input], &ImportSettings { scratch, ..ImportSettings::default() }, progress)?;
    let summary = match build_source(&source, settings, file, progress) {
        Err(BuildError::Interrupted(_) | BuildError::Paused { .. }) => bail!("{}: interrupted", model.display()),
        built => usage(built)?,
    };
    progress.finish();
    let sources = Sources { files: source.files().iter().map(SourceState::from).collect() };
    atomic::write(&list_of(file), serde_json::to_string_pretty(&sources)?.as_bytes())?;
    summarise(file, &summary, start, &mut |line| {
        say(line);
        Ok(())
    })
}

/// A line for people, beside what the command prints.
fn say(line: &str) {
    if !is_quiet() {
        let _ = writeln!(std::io::stderr(), "brickwalk: {}", one_line(line));
    }
}

/// The right to convert a model, which other processes wait for until the file is closed. It stays: whoever waits has
/// it open.
fn lock(path: &Path, model: &Path, say: &dyn Fn(&str)) -> Result<File> {
    let file = File::options().create(true).truncate(false).write(true).open(path);
    let file = file.with_context(|| {
        format!("{}: cannot write to this folder; name another in {CACHE_VARIABLE}", path.display())
    })?;
    if let Err(std::fs::TryLockError::WouldBlock) = file.try_lock() {
        say(&format!("{}: another process converts it; waiting", model.display()));
        // Some file systems have no locks: then the scene is written twice, each time whole.
        let _ = file.lock();
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_are_told_from_scenes() {
        for model in ["a.gltf", "a.GLB", "b/a.obj", "a.ply", "a.stl", "tiles/tileset.json"] {
            assert!(is_model(Path::new(model)), "{model}");
        }
        for other in ["a.bricks", "a", "a.json", "gltf", "a.gltf.bricks"] {
            assert!(!is_model(Path::new(other)), "{other}");
        }
    }

    #[test]
    fn a_file_that_changes_appears_or_goes_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("a.obj"), "v 0 0 0").unwrap();
        let list = || {
            let states = ["a.obj", "a.mtl"].map(|name| SourceState::from(&FileState::now(&at(name))));
            Sources { files: states.into() }
        };
        let before = list();
        assert!(before.are_current());
        std::fs::write(at("a.mtl"), "newmtl a").unwrap();
        assert!(!before.are_current() && list().are_current());
        let with_both = list();
        std::fs::write(at("a.obj"), "v 0 0 0 1").unwrap();
        assert!(!with_both.are_current());
        std::fs::remove_file(at("a.obj")).unwrap();
        assert!(!with_both.are_current());
        assert!(!Sources { files: Vec::new() }.are_current());
    }
}
