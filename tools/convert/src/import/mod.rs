//! Importers: files of common formats as one [`Source`](crate::source::Source).
//!
//! Every byte of an input is untrusted: whatever it holds, importing ends with a scene or with one line that names the
//! file, the thing in it and the remedy. Memory is only allocated for counts that the bytes of the input can hold, and
//! for no more of the input than what is read at once: structure is checked on opening, geometry and images are read
//! part by part. What cannot be read in parts is decoded into an unnamed temporary file first.

mod affine;
mod bytes;
mod error;
mod gltf;
mod image;
mod imported;
mod load;
mod obj;
mod opened;
mod panics;
mod plain;
mod ply;
mod reach;
mod repairs;
mod stl;
mod table;
mod tangents;
mod text;
mod tiles;
mod transform;
mod uri;
mod vertices;
mod warnings;

pub use bytes::FileState;
pub use error::ImportError;
pub use imported::Imported;
pub use load::load_all;
pub use panics::catches_panics;
pub use transform::parse_transform;

use crate::progress::Progress;
use crate::source::IDENTITY;
use bytes::Spool;
use error::show;
use opened::TriangleBudget;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Extensions of the files that folders are searched for, lower case.
pub const EXTENSIONS: [&str; 5] = ["gltf", "glb", "obj", "ply", "stl"];

/// The file that stands for a whole folder: the root of a set of 3D Tiles.
pub const TILESET: &str = "tileset.json";

/// How inputs are read.
#[derive(Clone, Debug, Default)]
pub struct ImportSettings {
    /// Worker threads; `None`: those of the current rayon pool.
    pub threads: Option<usize>,
    /// Folder for an unnamed temporary file of what has to be decoded; `None`: the system's.
    pub scratch: Option<PathBuf>,
    /// Names of nodes, with wildcards ([`crate::pattern`]), of which the placements below them are to tell
    /// ([`crate::source::Placement::under`]).
    pub movable: Vec<String>,
}

/// A file, and what of it is taken how.
#[derive(Clone, Debug)]
pub struct Input {
    /// The file.
    pub path: PathBuf,
    /// The scene of a glTF file, by name or number; `None`: its default scene.
    pub scene: Option<String>,
    /// The axis that points up in OBJ, PLY, STL and tilesets, whose frames are right-handed; `None`: Z in tilesets,
    /// else Y. glTF states its own.
    pub up: Option<Up>,
    /// Metres that a unit of length stands for in OBJ, PLY and STL, finite and positive; glTF states its own.
    pub metres: f64,
    /// A folder around the file, which its references may lead to, and below it, but not out of it, by symbolic links
    /// neither. `None`: the file's own folder, out of which symbolic links may lead.
    pub within: Option<PathBuf>,
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
    /// What takes OBJ, PLY and STL, or another format whose axis `up` points up by default, to metres with Y up.
    fn axes(&self, up: Up) -> [f64; 12] {
        let m = self.metres;
        match self.up.unwrap_or(up) {
            Up::Y => [m, 0.0, 0.0, 0.0, 0.0, m, 0.0, 0.0, 0.0, 0.0, m, 0.0],
            Up::Z => [m, 0.0, 0.0, 0.0, 0.0, 0.0, m, 0.0, 0.0, -m, 0.0, 0.0],
        }
    }
}

impl From<PathBuf> for Input {
    fn from(path: PathBuf) -> Self {
        Self { path, scene: None, up: None, metres: 1.0, within: None, transform: IDENTITY }
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
    let open = || {
        let opened = open_all(inputs, settings, progress);
        // Whatever it was that failed: it was asked to.
        opened.map_err(|error| progress.check().err().map_or(error, ImportError::Interrupted))
    };
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
    let spool = Arc::new(Spool::new(settings.scratch.clone(), progress.clone()));
    let mut budget = TriangleBudget::new();
    let mut imported = Imported::default();
    progress.phase("inputs", inputs.len() as u64);
    for (input, format) in inputs.iter().zip(formats) {
        progress.check().map_err(ImportError::Interrupted)?;
        let (path, budget, axes) = (input.path.as_path(), &mut budget, input.axes(Up::Y));
        let (file, asked) = ((path, input.within.as_deref()), (input.scene.as_deref(), &*settings.movable));
        let opened = match format {
            Format::Gltf => gltf::open(file, asked, &spool, budget)?,
            Format::Obj => obj::open(file, &axes, &spool, budget)?,
            Format::Ply => ply::open(path, &axes, &spool, budget)?,
            Format::Stl => stl::open(path, &axes, &spool, budget)?,
            Format::Tiles => {
                append_tiles(&mut imported, input, (settings, &spool), budget, progress)?;
                continue;
            }
        };
        imported.append(opened, &[input.transform]).map_err(|problem| misplaced(path, problem))?;
        progress.advance(1);
    }
    imported.set_files(spool.looked_for());
    progress.finish();
    Ok(imported)
}

/// Appends every model of a tileset, each opened once however many tiles show it.
fn append_tiles(
    imported: &mut Imported,
    input: &Input,
    (settings, spool): (&ImportSettings, &Arc<Spool>),
    budget: &mut TriangleBudget,
    progress: &Progress,
) -> Result<(), ImportError> {
    let tileset = tiles::open(&input.path, input.within.as_deref(), spool)?;
    tileset.sources.into_iter().for_each(|source| imported.add_source(source));
    if tileset.copies > 0 {
        let (file, copies) = (show(&input.path), tileset.copies);
        imported.warn(format!(
            "{file}: {copies} times tiles show a model where it is shown already; each place is taken once"
        ));
    }
    let world_from_tileset = affine::multiply(&input.transform, &input.axes(Up::Z));
    progress.phase("tiles", tileset.models.len() as u64);
    for model in &tileset.models {
        progress.check().map_err(ImportError::Interrupted)?;
        let opened = tiles::open_model(model, (input.within.as_deref(), &settings.movable), spool, budget)?;
        let meshes = &opened.outline.meshes;
        let triangles = opened.outline.placements.iter().map(|p| meshes[p.mesh as usize].triangle_count()).sum();
        // Opening it counted one.
        budget.add(&show(&model.path), model.placements.len() as u64 - 1, triangles)?;
        let transforms: Vec<_> = model.placements.iter().map(|m| affine::multiply(&world_from_tileset, m)).collect();
        imported.append(opened, &transforms).map_err(|problem| misplaced(&model.path, problem))?;
        progress.advance(1);
    }
    Ok(())
}

/// The error for an input that a transformation takes too far.
fn misplaced(path: &Path, problem: String) -> ImportError {
    let remedy = "place it nearer to the origin, or scale it less";
    ImportError::Content { file: show(path), place: "transform".into(), problem, remedy }
}

/// Formats of files.
#[derive(Clone, Copy, Debug)]
enum Format {
    Gltf,
    Obj,
    Ply,
    Stl,
    Tiles,
}

/// The format that the extension of `path` tells.
fn format(path: &Path) -> Result<Format, ImportError> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("gltf" | "glb") => Ok(Format::Gltf),
        Some("obj") => Ok(Format::Obj),
        Some("ply") => Ok(Format::Ply),
        Some("stl") => Ok(Format::Stl),
        Some("json") => Ok(Format::Tiles),
        _ => Err(ImportError::Format { file: show(path) }),
    }
}
