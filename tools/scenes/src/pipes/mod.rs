//! Pipes: a plant like a power station's, an open frame of steel several floors high, full of pipes and equipment.
//!
//! Bays are built ring by ring around the origin until the count of triangles is reached. A bay depends on the seed and
//! its place alone; the ways between the bays are at multiples of [`PITCH`].

mod bay;
mod fitting;
mod plan;
mod route;
mod steel;
mod vessel;

use crate::material::{Mat, materials, shade};
use crate::mesh::Builder;
use crate::path::{self, CameraPath, Way};
use crate::pieces::Pieces;
use crate::rings::{cell_of, empty_cells, grow, last_ring};
use crate::scene::{Draft, EMPTY, Recipe, Scene, union};
use crate::settings::Settings;
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Primitive};
use glam::{DVec2, DVec3};
use plan::{Bay, HEIGHT, PITCH};

/// What a bay takes on average.
const USUAL: u64 = 130_000;
/// Triangles of what surrounds a plant, but for empty bays.
const AROUND: u64 = 16;

struct Plant {
    seed: u64,
    /// Most triangles of each bay.
    budgets: Vec<u64>,
    bounds: Vec<[DVec3; 2]>,
}

impl Plant {
    fn bay(&self, index: usize, budget: u64) -> Builder {
        let (i, j) = cell_of(index);
        let mut site = Pieces::new(Builder::smooth(), budget);
        bay::bay(&mut site, self.seed, &Bay::new(self.seed, i, j));
        site.finish().0
    }

    /// Bare ground: empty bays, gravel, grass.
    fn surroundings(&self) -> Builder {
        let mut b = Builder::smooth();
        let count = self.budgets.len();
        let mut ground = |m: Mat, tint, x: [f64; 2], z: [f64; 2], y: f64| {
            let points = [[x[0], z[1]], [x[1], z[1]], [x[1], z[0]], [x[0], z[0]]];
            b.fan(m, tint, &points.map(|[x, z]| DVec3::new(x, y, z)));
        };
        for (i, j) in empty_cells(count) {
            let [x, z] = [i, j].map(|k| [k as f64 * PITCH, (k + 1) as f64 * PITCH]);
            ground(Mat::Concrete, shade([0.6; 3], 0.8 + 0.03 * ((i * 3 + j * 5).rem_euclid(7)) as f64), x, z, 0.0);
        }
        let mut inner = (last_ring(count) + 1) as f64 * PITCH;
        for (m, tint, width) in [(Mat::Gravel, [0.9, 0.88, 0.85], 14.0), (Mat::Grass, [0.9, 0.95, 0.8], 120.0)] {
            let outer = inner + width;
            ground(m, tint, [-outer, outer], [-outer, -inner], -0.02);
            ground(m, tint, [-outer, outer], [inner, outer], -0.02);
            ground(m, tint, [-outer, -inner], [-inner, inner], -0.02);
            ground(m, tint, [inner, outer], [-inner, inner], -0.02);
            inner = outer;
        }
        b
    }
}

impl Recipe for Plant {
    fn mesh(&self, index: usize) -> Vec<Primitive> {
        match self.budgets.get(index) {
            Some(&budget) => self.bay(index, budget).into_primitives(),
            None => self.surroundings().into_primitives(),
        }
    }

    /// Along the first floor around the bay in the middle.
    fn near(&self, frames: u32) -> CameraPath {
        let way = [[13.0, 0.0], [0.0, 0.0], [0.0, PITCH], [PITCH, PITCH], [PITCH, 0.0], [-60.0, 0.0]];
        path::walk(&Way::new(&way.map(DVec2::from_array)), HEIGHT + path::EYE, frames)
    }

    /// Above the chimneys.
    fn far(&self) -> CameraPath {
        let [low, high] = self.bounds.iter().copied().fold(EMPTY, union);
        let middle = 0.5 * (low + high);
        path::around(DVec3::new(middle.x, 0.25 * high.y, middle.z), &self.bounds, 26.0f64.to_radians(), 0.7)
    }

    fn bounds(&self) -> &[[DVec3; 2]] {
        &self.bounds
    }
}

/// See [`crate::generate()`]. Builds every bay once, to count.
pub fn generate(settings: &Settings, progress: &Progress) -> Scene {
    let plant = Plant { seed: settings.seed, budgets: Vec::new(), bounds: Vec::new() };
    let around = |count: usize| AROUND + 2 * (4 * (last_ring(count) as u64 + 1).pow(2) - count as u64);
    let bays = grow(settings.triangles, USUAL, progress, around, |index, budget| {
        let mesh = plant.bay(index, budget);
        (mesh.triangles(), (mesh.counts(), mesh.bounds()))
    });
    let mut draft = Draft::new(materials(), settings);
    let mut plant = plant;
    for (budget, (counts, bounds)) in bays {
        let (i, j) = cell_of(plant.budgets.len());
        let name = format!("bay {i} {j} {:?}", Bay::new(plant.seed, i, j).purpose).to_lowercase();
        let mesh = draft.mesh(name.clone(), counts);
        draft.place(name, mesh, IDENTITY);
        plant.budgets.push(budget);
        plant.bounds.push(bounds);
    }
    let ground = plant.surroundings();
    let mesh = draft.mesh("surroundings".into(), ground.counts());
    draft.place("surroundings".into(), mesh, IDENTITY);
    debug_assert_eq!(ground.triangles(), around(plant.budgets.len()));
    Scene::new(draft.outline, Box::new(plant))
}
