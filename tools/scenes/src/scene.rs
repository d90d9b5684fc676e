//! A generated scene as a source: counts, names and bounds are kept, geometry is made again whenever it is read.

use crate::path::CameraPath;
use brickwalk_convert::source::{
    Mesh, MeshOutline, Outline, PartOutline, Primitive, Source, SourceError, SourceScene, SourceTexture,
};
use glam::DVec3;
use lru::LruCache;
use std::borrow::Cow;
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Makes the meshes of a scene, each alone and the same each time, from any thread.
pub trait Recipe: Send + Sync {
    /// The primitives of mesh `index`, each at most [`brickwalk_convert::source::PART_TRIANGLES`] and one a part.
    ///
    /// Runs on one thread: whoever waits for the mesh must not be given other work.
    fn mesh(&self, index: usize) -> Vec<Primitive>;

    /// The path of `frames` frames through the midst of the scene; a longer one begins with a shorter one.
    fn near(&self, frames: u32) -> CameraPath;

    /// The path that has the whole scene in view.
    fn far(&self) -> CameraPath;
}

/// A mesh that is made while its parts are read.
type Made = Arc<OnceLock<Vec<Primitive>>>;

/// A generated scene: a [`Source`] whose parts are made when they are read. Metres, Y up, right-handed; vertex colours, no
/// textures.
///
/// The meshes read last are kept, two for each thread of the pool in which the scene was generated, as the parts of a mesh
/// are made together.
pub struct Scene {
    outline: Outline,
    recipe: Box<dyn Recipe>,
    recent: Mutex<LruCache<usize, Made>>,
}

impl Scene {
    /// A scene of `recipe`, whose meshes have the parts that `outline` says.
    pub(crate) fn new(outline: Outline, recipe: Box<dyn Recipe>) -> Self {
        let kept = NonZeroUsize::MIN.saturating_add(2 * rayon::current_num_threads());
        Self { outline, recipe, recent: Mutex::new(LruCache::new(kept)) }
    }

    /// The path of `frames` frames (at least one) through the midst of the scene; a longer one begins with a shorter one,
    /// and it does not depend on the number of triangles.
    pub fn near_path(&self, frames: u32) -> CameraPath {
        self.recipe.near(frames.max(1))
    }

    /// The path that has the whole scene in view.
    pub fn far_path(&self) -> CameraPath {
        self.recipe.far()
    }

    /// Triangles, every use of a mesh counted.
    pub fn placed_triangles(&self) -> u64 {
        let counts: Vec<u64> = self.outline.meshes.iter().map(MeshOutline::triangle_count).collect();
        self.outline.placements.iter().map(|p| counts[p.mesh as usize]).sum()
    }

    /// Everything at once, in memory.
    pub fn whole(&self) -> SourceScene {
        let outline = &self.outline;
        let mesh = |(k, m): (usize, &MeshOutline)| Mesh { name: m.name.clone(), primitives: self.recipe.mesh(k) };
        SourceScene {
            meshes: outline.meshes.iter().enumerate().map(mesh).collect(),
            placements: outline.placements.clone(),
            materials: outline.materials.clone(),
            sources: outline.sources.clone(),
            ..SourceScene::default()
        }
    }
}

impl Source for Scene {
    fn outline(&self) -> &Outline {
        &self.outline
    }

    /// Panics when the outline has no such part.
    fn part(&self, mesh: usize, part: usize) -> Result<Cow<'_, Primitive>, SourceError> {
        let made = {
            let mut recent = self.recent.lock().unwrap_or_else(PoisonError::into_inner);
            recent.get_or_insert(mesh, Made::default).clone()
        };
        Ok(Cow::Owned(made.get_or_init(|| self.recipe.mesh(mesh))[part].clone()))
    }

    fn texture(&self, index: usize) -> Result<Cow<'_, SourceTexture>, SourceError> {
        Err(SourceError(format!("a generated scene has no texture {index}")))
    }
}

/// The parts of a mesh whose primitives have `counts` triangles.
pub fn parts(counts: impl IntoIterator<Item = u32>) -> Vec<PartOutline> {
    (0..).zip(counts).map(|(primitive, triangles)| PartOutline { primitive, triangles }).collect()
}

/// Least and greatest coordinates of nothing.
pub const EMPTY: [DVec3; 2] = [DVec3::INFINITY, DVec3::NEG_INFINITY];

/// The bounds of two bounds.
pub fn union(a: [DVec3; 2], b: [DVec3; 2]) -> [DVec3; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}
