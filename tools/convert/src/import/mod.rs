//! Importers: files of common formats as one [`Source`](crate::source::Source).
//!
//! Every byte of an input is untrusted: whatever it holds, importing ends with a scene or with one line that names the
//! file, the thing in it and the remedy. Memory is only allocated for counts that the bytes of the input can hold, and for
//! no more of the input than what is read at once: structure is checked on opening, geometry and images are read part by
//! part. What cannot be read in parts is decoded into an unnamed temporary file first.

mod affine;
mod bytes;
mod error;
mod gltf;
mod image;
mod imported;
mod load;
mod obj;
mod plain;
mod ply;
mod repairs;
mod stl;
mod table;
mod text;
mod transform;
mod uri;
mod vertices;
mod warnings;

pub use error::ImportError;
pub use imported::Imported;
pub use load::load_all;
pub use transform::parse_transform;

use crate::progress::Progress;
use crate::source::{IDENTITY, Outline, Primitive, SourceError, SourceTexture};
use bytes::Spool;
use error::show;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Largest number of triangles over all placements: ids are u32 and 4294967295 means "none".
const MAX_TRIANGLES: u64 = u32::MAX as u64 - 1;

/// Extensions of the files that are read, lower case.
pub const EXTENSIONS: [&str; 5] = ["gltf", "glb", "obj", "ply", "stl"];

/// How inputs are read.
#[derive(Clone, Debug, Default)]
pub struct ImportSettings {
    /// Worker threads; `None`: those of the current rayon pool.
    pub threads: Option<usize>,
    /// Folder for an unnamed temporary file of what has to be decoded; `None`: the system's.
    pub scratch: Option<PathBuf>,
}

/// A file, and what of it is taken how.
#[derive(Clone, Debug)]
pub struct Input {
    /// The file.
    pub path: PathBuf,
    /// The scene of a glTF file, by name or number; `None`: its default scene.
    pub scene: Option<String>,
    /// The axis that points up in OBJ, PLY and STL, whose frames are right-handed; glTF states its own.
    pub up: Up,
    /// Metres that a unit of length stands for in OBJ, PLY and STL, finite and positive; glTF states its own.
    pub metres: f64,
    /// Placement of the whole input, in metres with Y up: row-major 3x4, finite.
    pub transform: [f64; 12],
}

/// An axis that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Up {
    /// The y axis.
    Y,
    /// The z axis.
    Z,
}

impl Input {
    /// What takes OBJ, PLY and STL to metres with Y up.
    fn axes(&self) -> [f64; 12] {
        let m = self.metres;
        match self.up {
            Up::Y => [m, 0.0, 0.0, 0.0, 0.0, m, 0.0, 0.0, 0.0, 0.0, m, 0.0],
            Up::Z => [m, 0.0, 0.0, 0.0, 0.0, 0.0, m, 0.0, 0.0, -m, 0.0, 0.0],
        }
    }
}

impl From<PathBuf> for Input {
    fn from(path: PathBuf) -> Self {
        Self { path, scene: None, up: Up::Y, metres: 1.0, transform: IDENTITY }
    }
}

impl From<&Path> for Input {
    fn from(path: &Path) -> Self {
        path.to_path_buf().into()
    }
}

/// Opens `inputs` in the given order as one scene: materials, textures, meshes and sources of each follow those of the
/// inputs before it.
///
/// # Errors
///
/// The first defect in input order that can be known without reading geometry; see [`ImportError`]. Defects that leave
/// geometry intact are warnings of the outline.
pub fn import(inputs: &[Input], settings: &ImportSettings, progress: &Progress) -> Result<Imported, ImportError> {
    let open = || open_all(inputs, settings, progress);
    let Some(threads) = settings.threads else { return open() };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| ImportError::Threads { threads, reason: e.to_string() })?;
    pool.install(open)
}

fn open_all(inputs: &[Input], settings: &ImportSettings, progress: &Progress) -> Result<Imported, ImportError> {
    // Formats are checked first, so that a wrong argument is told before hours of reading.
    let formats = inputs.iter().map(|input| format(&input.path)).collect::<Result<Vec<_>, _>>()?;
    let spool = Arc::new(Spool::new(settings.scratch.clone()));
    let mut budget = TriangleBudget { used: 0 };
    let mut imported = Imported::default();
    progress.phase("inputs", inputs.len() as u64);
    for (input, format) in inputs.iter().zip(formats) {
        let (path, budget) = (input.path.as_path(), &mut budget);
        let opened = match format {
            Format::Gltf => gltf::open(path, input.scene.as_deref(), &spool, budget)?,
            Format::Obj => obj::open(path, &input.axes(), &spool, budget)?,
            Format::Ply => ply::open(path, &input.axes(), &spool, budget)?,
            Format::Stl => stl::open(path, &input.axes(), &spool, budget)?,
        };
        imported.append(opened, &input.transform).map_err(|problem| ImportError::Content {
            file: show(&input.path),
            place: "transform".into(),
            problem,
            remedy: "place it nearer to the origin, or scale it less",
        })?;
        progress.advance(1);
    }
    progress.finish();
    Ok(imported)
}

/// Formats of files.
#[derive(Clone, Copy, Debug)]
enum Format {
    Gltf,
    Obj,
    Ply,
    Stl,
}

/// The format that the extension of `path` tells.
fn format(path: &Path) -> Result<Format, ImportError> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("gltf" | "glb") => Ok(Format::Gltf),
        Some("obj") => Ok(Format::Obj),
        Some("ply") => Ok(Format::Ply),
        Some("stl") => Ok(Format::Stl),
        _ => Err(ImportError::Format { file: show(path) }),
    }
}

/// An opened file: a scene of its own.
struct Opened {
    outline: Outline,
    parts: Box<dyn Parts>,
}

/// What an opened file holds; see [`Source`](crate::source::Source).
trait Parts: Send + Sync {
    /// The triangles of part `part` of mesh `mesh`.
    fn part(&self, mesh: usize, part: usize) -> Result<Primitive, SourceError>;

    /// The texels of texture `index`.
    fn texture(&self, index: usize) -> Result<SourceTexture, SourceError>;

    /// What was repaired in the parts read so far.
    fn repairs(&self) -> Vec<String>;
}

thread_local! {
    static CATCHES: Cell<bool> = const { Cell::new(false) };
}

/// What `decode` returns, `None` if it panics: for decoders of others, which may not be proof against every input.
fn quietly<T>(decode: impl FnOnce() -> T) -> Option<T> {
    let before = CATCHES.replace(true);
    // What is half done is dropped with the call.
    let result = catch_unwind(AssertUnwindSafe(decode)).ok();
    CATCHES.set(before);
    result
}

/// Whether a panic of this thread is caught by an importer, which makes it an error of the input: a panic hook need not
/// tell it.
pub fn catches_panics() -> bool {
    CATCHES.get()
}

/// Triangles of all placements so far.
struct TriangleBudget {
    used: u64,
}

impl TriangleBudget {
    /// Adds `count` placements of `triangles` triangles each, from `file`.
    fn add(&mut self, file: &str, count: u64, triangles: u64) -> Result<(), ImportError> {
        self.used = self.used.saturating_add(count.saturating_mul(triangles));
        if self.used > MAX_TRIANGLES {
            return Err(ImportError::TooManyTriangles { file: file.to_owned(), triangles: self.used });
        }
        Ok(())
    }
}
