//! Importers: files of common formats into a [`SourceScene`].
//!
//! Every byte of an input is untrusted: whatever it holds, importing ends with a scene or with one line that names the
//! file, the thing in it and the remedy. Memory is only allocated for counts that the bytes of the input can hold.

mod error;
mod gltf;
mod warnings;

pub use error::ImportError;

use crate::progress::Progress;
use crate::source::SourceScene;
use error::show;
use std::path::{Path, PathBuf};

/// Largest number of triangles over all placements: ids are u32 and 4294967295 means "none".
const MAX_TRIANGLES: u64 = u32::MAX as u64 - 1;

/// How inputs are read.
#[derive(Clone, Debug, Default)]
pub struct ImportSettings {
    /// Worker threads; `None`: those of the current rayon pool.
    pub threads: Option<usize>,
}

/// Imports `paths` in the given order into one scene: materials, textures, meshes and sources of each input follow those
/// of the inputs before it.
///
/// # Errors
///
/// The first defect in input order; see [`ImportError`]. Defects that leave geometry intact (a missing image, say) are
/// [`SourceScene::warnings`].
pub fn import(paths: &[PathBuf], settings: &ImportSettings, progress: &Progress) -> Result<SourceScene, ImportError> {
    let Some(threads) = settings.threads else { return import_all(paths, progress) };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| ImportError::Threads { threads, reason: e.to_string() })?;
    pool.install(|| import_all(paths, progress))
}

fn import_all(paths: &[PathBuf], progress: &Progress) -> Result<SourceScene, ImportError> {
    let mut scene = SourceScene::default();
    let mut triangles = TriangleBudget { used: 0 };
    // Formats are checked first, so that a wrong argument is told before hours of reading.
    let importers = paths.iter().map(|path| importer(path)).collect::<Result<Vec<_>, _>>()?;
    for (path, importer) in paths.iter().zip(importers) {
        let part = importer(path, &mut triangles, progress)?;
        append(&mut scene, part);
    }
    progress.finish();
    Ok(scene)
}

/// Reads one file into a scene of its own, counting its triangles before memory is allocated for them.
type Importer = fn(&Path, &mut TriangleBudget, &Progress) -> Result<SourceScene, ImportError>;

/// The importer for the extension of `path`.
fn importer(path: &Path) -> Result<Importer, ImportError> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("gltf" | "glb") => Ok(gltf::load),
        _ => Err(ImportError::Format { file: show(path) }),
    }
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

/// Appends `part`, shifting its indices behind those of `scene`. Each list of `part` is smaller than the bytes it was
/// read from, so sums stay within u32 for everything that fits memory.
fn append(scene: &mut SourceScene, mut part: SourceScene) {
    let meshes = scene.meshes.len() as u32;
    let materials = scene.materials.len() as u32;
    let textures = scene.textures.len() as u32;
    let sources = scene.sources.len() as u32;
    for primitive in part.meshes.iter_mut().flat_map(|mesh| &mut mesh.primitives) {
        primitive.material += materials;
    }
    for material in &mut part.materials {
        if material.base_color_texture != bricks::NONE {
            material.base_color_texture += textures;
        }
    }
    for placement in &mut part.placements {
        placement.mesh += meshes;
        placement.source += sources;
    }
    scene.meshes.append(&mut part.meshes);
    scene.placements.append(&mut part.placements);
    scene.materials.append(&mut part.materials);
    scene.textures.append(&mut part.textures);
    scene.sources.append(&mut part.sources);
    scene.warnings.append(&mut part.warnings);
    scene.has_animation |= part.has_animation;
}
