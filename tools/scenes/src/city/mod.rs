//! The city: blocks built ring by ring around the crossing at the origin until the count of triangles is reached.
//!
//! A block depends on the seed and its cell alone, so that the centre is the same in every size. The last block gets
//! what is left of the budget, piece by piece; the rest of its ring stays meadow, and fields surround everything.

mod block;
mod building;
mod facade;
mod furniture;
mod layout;
mod open;
mod plan;
mod roof;
mod site;
mod street;
mod style;
mod vehicle;
mod window;

use crate::material::city_materials;
use crate::mesh::Builder;
use crate::path::{self, CameraPath, Way};
use crate::rings::{cell_of, empty_cells, grow, last_ring};
use crate::rng::Rng;
use crate::scene::{Draft, EMPTY, Recipe, Scene, rows, union};
use crate::settings::Settings;
use block::block;
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Primitive};
use glam::{DVec2, DVec3};
use layout::Layout;
use site::{Library, Site, Use};

/// What a block takes on average, to guess how many are still needed.
const USUAL: u64 = 30_000;

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

    fn plan(&self, index: usize, budget: u64) -> (u64, Plan) {
        let (mesh, uses, triangles) = self.block(index, budget);
        (triangles, Plan { counts: mesh.counts(), bounds: mesh.bounds(), uses })
    }

    fn block_name(&self, index: usize) -> String {
        let (i, j) = cell_of(index);
        format!("block {i} {j} {:?}", self.layout.cell(i, j).zone).to_lowercase()
    }

    /// The meadows and fields around the blocks.
    fn surroundings(&self) -> Builder {
        let blocks = self.bounds.len();
        let mut b = Builder::new();
        for (i, j) in empty_cells(blocks) {
            street::meadow(&mut b, &self.layout.cell(i, j));
        }
        street::country(&mut b, &mut Rng::new(self.seed, &[6]), &self.layout, last_ring(blocks));
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

    fn bounds(&self) -> &[[DVec3; 2]] {
        &self.bounds
    }
}

/// Triangles of the surroundings of `blocks` blocks.
fn surrounding_triangles(blocks: usize) -> u64 {
    let last = last_ring(blocks) as u64;
    let meadows = 4 * (last + 1) * (last + 1) - blocks as u64;
    // Five stripes of fields and half a street on each side of the cells.
    let (all, cells) = (2 * last + 14, 2 * last + 2);
    18 * meadows + 2 * (all * all - cells * cells)
}

/// See [`crate::generate()`]. Builds every block once, to count.
pub fn generate(settings: &Settings, progress: &Progress) -> Scene {
    let Settings { triangles, seed, instanced, .. } = *settings;
    let (layout, library) = (Layout::new(seed), Library::new(seed));
    // Meshes of the scene that items of the library have become.
    let mut shared: Vec<Option<u32>> = vec![None; library.items.len()];
    let mut city = City { seed, instanced, layout, library, origins: Vec::new(), bounds: Vec::new() };
    let blocks = grow(triangles, USUAL, progress, surrounding_triangles, |index, budget| city.plan(index, budget));
    let mut draft = Draft::new(city_materials(), settings);
    for (number, (budget, plan)) in blocks.into_iter().enumerate() {
        let name = city.block_name(number);
        let mesh = draft.mesh(name.clone(), plan.counts);
        city.origins.push(Origin::Block(number, budget));
        draft.place(name, mesh, IDENTITY);
        city.bounds.push(plan.bounds);
        for one in plan.uses {
            // Shared meshes become meshes of the scene when they are first used.
            let item = &city.library.items[one.item];
            let mesh = *shared[one.item].get_or_insert_with(|| {
                city.origins.push(Origin::Item(one.item));
                draft.mesh(item.name.clone(), item.mesh.counts())
            });
            draft.place(item.name.clone(), mesh, rows(&one.world_from_mesh));
        }
    }
    let mesh = draft.mesh("surroundings".into(), city.surroundings().counts());
    city.origins.push(Origin::Surroundings);
    draft.place("surroundings".into(), mesh, IDENTITY);
    Scene::new(draft.outline, Box::new(city))
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
