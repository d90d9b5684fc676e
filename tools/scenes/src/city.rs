//! The city: blocks built ring by ring around the crossing at the origin until the count of triangles is reached.
//!
//! A block depends on the seed and its cell alone, so that the centre is the same in every size. The last block gets
//! what is left of the budget, piece by piece; the rest of its ring stays meadow, and fields surround everything.

use crate::block::block;
use crate::layout::{Layout, ring};
use crate::material::materials;
use crate::mesh::Builder;
use crate::rng::Rng;
use crate::site::{Library, Site, Use};
use crate::street;
use crate::{Error, Settings};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Mesh, Placement, SourceScene};
use glam::{DAffine3, DVec3};
use rayon::prelude::*;

/// Fewest triangles of a city.
pub const MIN_TRIANGLES: u64 = 10_000;
/// Most triangles of a city.
pub const MAX_TRIANGLES: u64 = 20_000_000;

/// Blocks built at once; more only cost memory.
const BATCH: usize = 32;
/// What a block takes on average, to guess how many are still needed.
const USUAL: u64 = 30_000;
/// Less is not worth beginning a block.
const LEAST: u64 = 4_000;

/// What came out of building a city, block by block.
pub struct Outcome {
    /// Blocks built.
    pub blocks: usize,
    /// The last ring with a block.
    pub ring: i64,
    /// Least and greatest coordinates of each block.
    pub bounds: Vec<[DVec3; 2]>,
}

/// Triangles of the meadows and fields around `blocks` blocks.
fn surroundings(seed: u64, layout: &Layout, blocks: usize) -> (i64, Builder) {
    let mut b = Builder::new();
    let mut last = 0;
    while (4 * (last + 1) * (last + 1)) < blocks as i64 {
        last += 1;
    }
    let before = (4 * last * last) as usize;
    for (i, j) in Layout::ring_cells(last).into_iter().skip(blocks.saturating_sub(before)) {
        street::meadow(&mut b, &layout.cell(i, j));
    }
    street::country(&mut b, &mut Rng::new(seed, &[6]), layout, last);
    (last, b)
}

/// Cell of the block with number `index`.
fn cell_of(index: usize) -> (i64, i64) {
    let mut r = 0;
    while (4 * (r + 1) * (r + 1)) as usize <= index {
        r += 1;
    }
    let cell = Layout::ring_cells(r)[index - (4 * r * r) as usize];
    debug_assert_eq!(ring(cell.0, cell.1), r);
    cell
}

type Built = (Builder, Vec<Use>, u64);

/// Builds blocks in order and hands each to `take`; then the surroundings.
fn build(
    settings: &Settings,
    library: &Library,
    progress: &Progress,
    mut take: impl FnMut(String, Builder, Vec<Use>),
) -> Result<Outcome, Error> {
    let Settings { triangles: wanted, seed, instanced, .. } = *settings;
    if !(MIN_TRIANGLES..=MAX_TRIANGLES).contains(&wanted) {
        return Err(Error::Triangles { asked: wanted, min: MIN_TRIANGLES, max: MAX_TRIANGLES });
    }
    let layout = Layout::new(seed);
    let one = |index: usize, budget: u64| -> Built {
        let (i, j) = cell_of(index);
        let mut site = Site::new(layout.cell(i, j), library, instanced, budget);
        block(&mut site, seed);
        site.finish()
    };
    let name = |index: usize| {
        let (i, j) = cell_of(index);
        format!("block {i} {j} {:?}", layout.cell(i, j).zone).to_lowercase()
    };
    progress.phase("city", wanted);
    let mut outcome = Outcome { blocks: 0, ring: 0, bounds: Vec::new() };
    let mut total = 0;
    let mut count = 0;
    'all: loop {
        let guess = ((wanted - total) / USUAL + 1) as usize;
        let batch: Vec<usize> = (count..count + guess.min(BATCH)).collect();
        let built: Vec<Built> = batch.par_iter().map(|&index| one(index, u64::MAX)).collect();
        for (index, (mesh, uses, triangles)) in batch.into_iter().zip(built) {
            let around = surroundings(seed, &layout, count + 1).1.triangles();
            let left = wanted.saturating_sub(total + around);
            if triangles <= left {
                outcome.bounds.push(mesh.bounds());
                take(name(index), mesh, uses);
                progress.advance(triangles);
                total += triangles;
                count += 1;
                continue;
            }
            if left >= LEAST || count == 0 {
                let (mesh, uses, triangles) = one(index, left);
                outcome.bounds.push(mesh.bounds());
                take(name(index), mesh, uses);
                progress.advance(triangles);
                count += 1;
            }
            break 'all;
        }
    }
    let (last, mesh) = surroundings(seed, &layout, count);
    take("surroundings".into(), mesh, Vec::new());
    outcome.blocks = count;
    outcome.ring = last;
    progress.finish();
    Ok(outcome)
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

/// See [`crate::generate`].
pub fn generate(settings: &Settings, progress: &Progress) -> Result<SourceScene, Error> {
    let library = Library::new(settings.seed);
    let mut scene = SourceScene { materials: materials(), ..SourceScene::default() };
    scene
        .sources
        .push(crate::source_of(format!("{} seed={} triangles={}", settings.kind, settings.seed, settings.triangles)));
    // Shared meshes become meshes of the scene when they are first used.
    let mut shared: Vec<Option<u32>> = vec![None; library.items.len()];
    build(settings, &library, progress, |name, mesh, uses| {
        let index = scene.meshes.len() as u32;
        scene.meshes.push(mesh.into_mesh(name.clone()));
        scene.placements.push(Placement { name, mesh: index, source: 0, world_from_mesh: IDENTITY });
        for one in uses {
            let item = &library.items[one.item];
            let mesh = *shared[one.item].get_or_insert_with(|| {
                scene.meshes.push(item.mesh.clone().into_mesh(item.name.clone()));
                scene.meshes.len() as u32 - 1
            });
            let world_from_mesh = rows(&one.world_from_mesh);
            scene.placements.push(Placement { name: item.name.clone(), mesh, source: 0, world_from_mesh });
        }
    })?;
    Ok(scene)
}

/// What [`generate`] builds with `settings`, without keeping it.
pub fn outline(settings: &Settings, progress: &Progress) -> Result<Outcome, Error> {
    let settings = Settings { instanced: false, ..settings.clone() };
    build(&settings, &Library::new(settings.seed), progress, |_, _, _| {})
}

/// Triangles of a scene, every use of a mesh counted.
pub fn placed_triangles(scene: &SourceScene) -> u64 {
    scene.placements.iter().map(|p| scene.meshes.get(p.mesh as usize).map_or(0, Mesh::triangle_count)).sum()
}
