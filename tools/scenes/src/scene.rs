//! A generated scene as a source: counts, names and bounds are kept, geometry is made again whenever it is read.

use crate::motion::Mover;
use crate::path::CameraPath;
use crate::settings::Settings;
use brickwalk_convert::source::{
    Mesh, MeshOutline, Outline, PART_TRIANGLES, PartOutline, Placement, Primitive, Source, SourceError, SourceScene,
    SourceTexture,
};
use glam::{DAffine3, DVec3};
use lru::LruCache;
use std::borrow::Cow;
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Makes the meshes of a scene, each alone and the same each time, from any thread.
pub trait Recipe: Send + Sync {
    /// The primitives of mesh `index`, as the outline has them.
    ///
    /// Runs on one thread: whoever waits for the mesh must not be given other work.
    fn mesh(&self, index: usize) -> Vec<Primitive>;

    /// The path of `frames` frames through the midst of the scene; a longer one begins with a shorter one.
    fn near(&self, frames: u32) -> CameraPath;

    /// The path that has the whole scene in view.
    fn far(&self) -> CameraPath;

    /// Boxes around all that is worth seeing.
    fn bounds(&self) -> &[[DVec3; 2]];

    /// What moves, and how, for `steps` units of time.
    fn movers(&self, _steps: u32) -> Vec<Mover> {
        Vec::new()
    }
}

/// A mesh that is made while its parts are read.
type Made = Arc<OnceLock<Vec<Primitive>>>;

/// A generated scene: a [`Source`] whose parts are made when they are read. Metres, Y up, right-handed; vertex colours,
/// no textures.
///
/// The meshes read last are kept, one for each thread of the pool in which the scene was generated, as the parts of a
/// mesh are made together.
pub struct Scene {
    pub(crate) outline: Outline,
    pub(crate) recipe: Box<dyn Recipe>,
    /// Where the copies of the whole are; none where there is only one.
    pub(crate) copies: Vec<DVec3>,
    recent: Mutex<LruCache<usize, Made>>,
}

impl Scene {
    /// A scene of `recipe`, whose meshes have the parts that `outline` says.
    pub(crate) fn new(outline: Outline, recipe: Box<dyn Recipe>) -> Self {
        let kept = NonZeroUsize::MIN.saturating_add(rayon::current_num_threads());
        Self { outline, recipe, copies: Vec::new(), recent: Mutex::new(LruCache::new(kept)) }
    }

    /// The path of `frames` frames (at least one) through the midst of the scene; a longer one begins with a shorter
    /// one, and it does not depend on the number of triangles.
    pub fn near_path(&self, frames: u32) -> CameraPath {
        self.recipe.near(frames.max(1))
    }

    /// The path that has the whole scene in view.
    pub fn far_path(&self) -> CameraPath {
        if self.copies.is_empty() { self.recipe.far() } else { self.far_of_copies() }
    }

    /// What moves, and how, for `steps` units of the time of its paths; nothing in most scenes.
    pub fn movers(&self, steps: u32) -> Vec<Mover> {
        self.recipe.movers(steps)
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
        let primitives = made.get_or_init(|| self.recipe.mesh(mesh));
        let parts = &self.outline.meshes[mesh].parts;
        let PartOutline { primitive, triangles } = parts[part];
        let whole = &primitives[primitive as usize];
        if whole.indices.len() == 3 * triangles as usize {
            return Ok(Cow::Owned(whole.clone()));
        }
        let before = parts[..part].iter().filter(|p| p.primitive == primitive);
        let first: usize = before.map(|p| 3 * p.triangles as usize).sum();
        Ok(Cow::Owned(cut(whole, &whole.indices[first..first + 3 * triangles as usize])))
    }

    fn texture(&self, index: usize) -> Result<Cow<'_, SourceTexture>, SourceError> {
        Err(SourceError(format!("a generated scene has no texture {index}")))
    }
}

/// The triangles `indices` of `whole`, with no vertices but theirs.
fn cut(whole: &Primitive, indices: &[u32]) -> Primitive {
    const UNUSED: u32 = u32::MAX;
    let mut new = vec![UNUSED; whole.positions.len()];
    let mut old = Vec::new();
    let renumbered = indices.iter().map(|&k| {
        let slot = &mut new[k as usize];
        if *slot == UNUSED {
            *slot = old.len() as u32;
            old.push(k as usize);
        }
        *slot
    });
    let indices = renumbered.collect();
    Primitive {
        material: whole.material,
        positions: old.iter().map(|&k| whole.positions[k]).collect(),
        normals: whole.normals.as_ref().map(|all| old.iter().map(|&k| all[k]).collect()),
        colors: whole.colors.as_ref().map(|all| old.iter().map(|&k| all[k]).collect()),
        indices,
        ..Primitive::default()
    }
}

/// The source entry of a generated scene: no bytes, and the xxh3-64 of none.
pub fn source_of(name: String) -> bricks::Source {
    bricks::Source { name, bytes: 0, hash: "2d06800538d394c2".into() }
}

/// An outline under construction.
pub struct Draft {
    /// What there is so far.
    pub outline: Outline,
}

impl Draft {
    /// Nothing yet, of `materials`.
    pub fn new(materials: Vec<bricks::Material>, settings: &Settings) -> Self {
        let mut name = format!("{} seed={} triangles={}", settings.kind, settings.seed, settings.triangles);
        if settings.copies > 1 {
            name += &format!(" copies={}", settings.copies);
        }
        let sources = vec![source_of(name)];
        Self { outline: Outline { materials, sources, ..Outline::default() } }
    }

    /// Adds a mesh whose primitives have `counts` triangles; returns its index.
    pub fn mesh(&mut self, name: String, counts: impl IntoIterator<Item = u32>) -> u32 {
        let mut parts = Vec::new();
        for (primitive, count) in (0..).zip(counts) {
            let mut left = count;
            while left > 0 {
                let triangles = left.min(PART_TRIANGLES);
                parts.push(PartOutline { primitive, triangles });
                left -= triangles;
            }
        }
        self.outline.meshes.push(MeshOutline { name, parts, shines_to_front: false });
        self.outline.meshes.len() as u32 - 1
    }

    /// Places a mesh.
    pub fn place(&mut self, name: String, mesh: u32, world_from_mesh: [f64; 12]) {
        self.outline.placements.push(Placement { name, mesh, source: 0, world_from_mesh, ..Placement::default() });
    }
}

/// Least and greatest coordinates of nothing.
pub const EMPTY: [DVec3; 2] = [DVec3::INFINITY, DVec3::NEG_INFINITY];

/// The bounds of two bounds.
pub fn union(a: [DVec3; 2], b: [DVec3; 2]) -> [DVec3; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// The row-major 3x4 matrix of `a`.
pub fn rows(a: &DAffine3) -> [f64; 12] {
    let (m, t) = (a.matrix3, a.translation);
    let mut out = [0.0; 12];
    for r in 0..3 {
        for c in 0..3 {
            out[4 * r + c] = m.col(c)[r];
        }
        out[4 * r + 3] = t[r];
    }
    out
}
