//! The city: blocks built ring by ring around the crossing at the origin until the count of triangles is reached.
//!
//! A block depends on the seed and its cell alone, so that the centre is the same in every size. The last block gets
//! what is left of the budget, piece by piece; the rest of its ring stays meadow, and fields surround everything.

use crate::block::block;
use crate::layout::{Layout, ring};
use crate::material::materials;
use crate::mesh::Builder;
use crate::path::{self, CameraPath, Way};
use crate::rng::Rng;
use crate::scene::{EMPTY, Recipe, parts, union};
use crate::site::{Library, Site, Use};
use crate::street;
use crate::{Scene, Settings};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, MeshOutline, Outline, Placement, Primitive};
use glam::{DAffine3, DVec2, DVec3};
use rayon::prelude::*;

/// Blocks made at once.
const BATCH: usize = 64;
/// What a block takes on average, to guess how many are still needed.
const USUAL: u64 = 30_000;
/// Less is not worth beginning a block.
const LEAST: u64 = 4_000;

/// Where a mesh of the city comes from.
enum Origin {
    /// The block with this number, within this many triangles.
    Block(usize, u64),
    /// The meadows and fields.
    Surroundings,
    /// An item of the library.
    Item(usize),
}

struct City {
    seed: u64,
    instanced: bool,
    layout: Layout,
    library: Library,
    /// Where each mesh comes from.
    origins: Vec<Origin>,
    /// Least and greatest coordinates of each block.
    bounds: Vec<[DVec3; 2]>,
}

/// What is known of a block without its geometry.
struct Plan {
    triangles: u64,
    counts: Vec<u32>,
    bounds: [DVec3; 2],
    uses: Vec<Use>,
}

impl City {
    /// Builds the block with number `index` of at most `budget` triangles.
    fn block(&self, index: usize, budget: u64) -> (Builder, Vec<Use>, u64) {
        let (i, j) = cell_of(index);
        let mut site = Site::new(self.layout.cell(i, j), &self.library, self.instanced, budget);
        block(&mut site, self.seed);
        site.finish()
    }

    fn plan(&self, index: usize, budget: u64) -> Plan {
        let (mesh, uses, triangles) = self.block(index, budget);
        Plan { triangles, counts: mesh.counts(), bounds: mesh.bounds(), uses }
    }

    fn block_name(&self, index: usize) -> String {
        let (i, j) = cell_of(index);
        format!("block {i} {j} {:?}", self.layout.cell(i, j).zone).to_lowercase()
    }

    /// The meadows and fields around the blocks.
    fn surroundings(&self) -> Builder {
        let blocks = self.bounds.len();
        let (mut b, last) = (Builder::new(), last_ring(blocks));
        for (i, j) in Layout::ring_cells(last).into_iter().skip(blocks - (4 * last * last) as usize) {
            street::meadow(&mut b, &self.layout.cell(i, j));
        }
        street::country(&mut b, &mut Rng::new(self.seed, &[6]), &self.layout, last);
        b
    }
}

impl Recipe for City {
    fn mesh(&self, index: usize) -> Vec<Primitive> {
        match self.origins[index] {
            Origin::Block(number, budget) => self.block(number, budget).0.into_primitives(),
            Origin::Surroundings => self.surroundings().into_primitives(),
            Origin::Item(item) => self.library.items[item].mesh.clone().into_primitives(),
        }
    }

    /// To the crossing at the origin, then around the first block.
    fn near(&self, frames: u32) -> CameraPath {
        let (x1, z1) = (self.layout.x(1), self.layout.z(1));
        let way = Way::new(&[
            DVec2::new(-9.0, 0.0),
            DVec2::ZERO,
            DVec2::new(0.0, z1),
            DVec2::new(x1, z1),
            DVec2::new(x1, 0.0),
            DVec2::new(-60.0, 0.0),
        ]);
        path::walk(&way, path::EYE, frames)
    }

    /// Above the roofs.
    fn far(&self) -> CameraPath {
        let [low, high] = self.bounds.iter().copied().fold(EMPTY, union);
        let middle = 0.5 * (low + high);
        let target = DVec3::new(middle.x, (0.02 * (high.x - low.x)).min(0.3 * high.y), middle.z);
        path::around(target, &self.bounds, 33.0f64.to_radians(), 0.5)
    }
}

/// The ring of the last of `blocks` blocks.
fn last_ring(blocks: usize) -> i64 {
    let mut last = 0;
    while (4 * (last + 1) * (last + 1)) < blocks as i64 {
        last += 1;
    }
    last
}

/// Triangles of the surroundings of `blocks` blocks.
fn surrounding_triangles(blocks: usize) -> u64 {
    let last = last_ring(blocks) as u64;
    let meadows = 4 * (last + 1) * (last + 1) - blocks as u64;
    // Five stripes of fields and half a street on each side of the cells.
    let (all, cells) = (2 * last + 14, 2 * last + 2);
    18 * meadows + 2 * (all * all - cells * cells)
}

/// Cell of the block with number `index`.
fn cell_of(index: usize) -> (i64, i64) {
    let r = last_ring(index + 1);
    let cell = Layout::ring_cells(r)[index - (4 * r * r) as usize];
    debug_assert_eq!(ring(cell.0, cell.1), r);
    cell
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

/// Writes down what the city has.
struct Draft {
    city: City,
    outline: Outline,
    /// Meshes of the scene that items of the library have become.
    shared: Vec<Option<u32>>,
}

impl Draft {
    fn mesh(&mut self, name: String, origin: Origin, counts: Vec<u32>) -> u32 {
        self.outline.meshes.push(MeshOutline { name, parts: parts(counts) });
        self.city.origins.push(origin);
        self.city.origins.len() as u32 - 1
    }

    fn place(&mut self, name: String, mesh: u32, world_from_mesh: [f64; 12]) {
        self.outline.placements.push(Placement { name, mesh, source: 0, world_from_mesh });
    }

    /// Adds the next block.
    fn block(&mut self, budget: u64, plan: Plan) {
        let number = self.city.bounds.len();
        let name = self.city.block_name(number);
        let mesh = self.mesh(name.clone(), Origin::Block(number, budget), plan.counts);
        self.place(name, mesh, IDENTITY);
        self.city.bounds.push(plan.bounds);
        // Shared meshes become meshes of the scene when they are first used.
        for one in plan.uses {
            let item = &self.city.library.items[one.item];
            let (name, counts) = (item.name.clone(), item.mesh.counts());
            let mesh = match self.shared[one.item] {
                Some(mesh) => mesh,
                None => self.mesh(name.clone(), Origin::Item(one.item), counts),
            };
            self.shared[one.item] = Some(mesh);
            self.place(name, mesh, rows(&one.world_from_mesh));
        }
    }
}

/// See [`crate::generate`]. Builds every block once, to count.
pub fn generate(settings: &Settings, progress: &Progress) -> Scene {
    let Settings { triangles: wanted, seed, instanced, .. } = *settings;
    let (layout, library) = (Layout::new(seed), Library::new(seed));
    let outline =
        Outline { materials: materials(), sources: vec![crate::source_of_settings(settings)], ..Outline::default() };
    let shared = vec![None; library.items.len()];
    let city = City { seed, instanced, layout, library, origins: Vec::new(), bounds: Vec::new() };
    let mut draft = Draft { city, outline, shared };
    let mut total = 0;
    'all: loop {
        let count = draft.city.bounds.len();
        let guess = ((wanted - total) / USUAL + 1) as usize;
        let batch = count..count + guess.min(BATCH);
        let plans: Vec<Plan> = batch.into_par_iter().map(|index| draft.city.plan(index, u64::MAX)).collect();
        for plan in plans {
            let count = draft.city.bounds.len();
            let left = wanted.saturating_sub(total + surrounding_triangles(count + 1));
            let triangles = plan.triangles;
            if triangles <= left {
                draft.block(u64::MAX, plan);
                progress.advance(triangles);
                total += triangles;
                continue;
            }
            if left >= LEAST || count == 0 {
                let plan = draft.city.plan(count, left);
                draft.block(left, plan);
            }
            break 'all;
        }
    }
    let counts = draft.city.surroundings().counts();
    let mesh = draft.mesh("surroundings".into(), Origin::Surroundings, counts);
    draft.place("surroundings".into(), mesh, IDENTITY);
    Scene::new(draft.outline, Box::new(draft.city))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surroundings_are_counted_without_building_them() {
        let mut city = City {
            seed: 3,
            instanced: false,
            layout: Layout::new(3),
            library: Library::new(3),
            origins: Vec::new(),
            bounds: Vec::new(),
        };
        for blocks in 1..150 {
            city.bounds.push(EMPTY);
            assert_eq!(surrounding_triangles(blocks), city.surroundings().triangles(), "{blocks} blocks");
        }
    }
}
