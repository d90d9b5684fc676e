//! A building site: a block under construction within a budget of triangles, and the library of trees and vehicles that
//! blocks share.

use super::layout::Cell;
use super::vehicle::{Vehicle, vehicle};
use crate::mesh::{Builder, Frame};
use crate::pieces::Pieces;
use crate::rng::Rng;
use crate::vegetation::{Tree, tree};
use glam::{DAffine3, DMat3, DVec3};

/// A mesh that many blocks use.
pub struct Item {
    /// Name.
    pub name: String,
    /// The mesh, its foot at the origin.
    pub mesh: Builder,
    /// Its triangles.
    pub triangles: u64,
}

/// Meshes that blocks share.
pub struct Library {
    /// The meshes.
    pub items: Vec<Item>,
    trees: Vec<(Tree, usize)>,
    vehicles: Vec<(Vehicle, usize)>,
}

impl Library {
    /// The library of `seed`.
    pub fn new(seed: u64) -> Self {
        let mut library = Self { items: Vec::new(), trees: Vec::new(), vehicles: Vec::new() };
        let trees = [(Tree::Street, 5), (Tree::Park, 4), (Tree::Column, 2), (Tree::Conifer, 2)];
        for (kind, count) in trees {
            for k in 0..count {
                let mut mesh = Builder::new();
                tree(&mut mesh, &mut Rng::new(seed, &[10, kind as i64, k]), kind);
                library.trees.push((kind, library.items.len()));
                library.add(format!("tree {kind:?} {k}").to_lowercase(), mesh);
            }
        }
        let vehicles =
            [(Vehicle::Saloon, 9), (Vehicle::Hatchback, 8), (Vehicle::Suv, 6), (Vehicle::Van, 3), (Vehicle::Bus, 2)];
        for (kind, count) in vehicles {
            for k in 0..count {
                let mut mesh = Builder::new();
                vehicle(&mut mesh, &mut Rng::new(seed, &[11, kind as i64, k]), kind);
                library.vehicles.push((kind, library.items.len()));
                library.add(format!("vehicle {kind:?} {k}").to_lowercase(), mesh);
            }
        }
        library
    }

    fn add(&mut self, name: String, mesh: Builder) {
        let triangles = mesh.triangles();
        self.items.push(Item { name, mesh, triangles });
    }
}

/// A shared mesh in its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Use {
    /// Index of the item.
    pub item: usize,
    /// world_from_mesh.
    pub world_from_mesh: DAffine3,
}

/// A block under construction.
pub struct Site<'a> {
    /// The cell.
    pub cell: Cell,
    library: &'a Library,
    instanced: bool,
    pieces: Pieces,
    uses: Vec<Use>,
}

impl<'a> Site<'a> {
    /// An empty block that takes at most `budget` triangles. With `instanced`, shared meshes are listed instead of
    /// copied.
    pub fn new(cell: Cell, library: &'a Library, instanced: bool, budget: u64) -> Self {
        Self { cell, library, instanced, pieces: Pieces::new(Builder::new(), budget), uses: Vec::new() }
    }

    /// See [`Pieces::piece`].
    pub fn piece(&mut self, rng: &mut Rng, build: impl FnOnce(&mut Builder, &mut Rng)) {
        self.pieces.piece(rng, build);
    }

    fn place(&mut self, item: usize, f: &Frame, scale: f64) {
        if !self.pieces.spend(self.library.items[item].triangles) {
            return;
        }
        let world_from_mesh = DAffine3::from_mat3_translation(DMat3::from_cols(f.u, f.v, f.n) * scale, f.o);
        if self.instanced {
            self.uses.push(Use { item, world_from_mesh });
        } else {
            self.pieces.append(&self.library.items[item].mesh, &world_from_mesh);
        }
    }

    /// Plants a tree at `o`.
    pub fn tree(&mut self, rng: &mut Rng, kind: Tree, o: DVec3) {
        let choices: Vec<usize> = self.library.trees.iter().filter(|t| t.0 == kind).map(|t| t.1).collect();
        let item = rng.pick(&choices);
        let f = Frame::standing(o, rng.range(0.0, std::f64::consts::TAU));
        let scale = rng.range(0.82, 1.12);
        self.place(item, &f, scale);
    }

    /// Puts a vehicle at `f`, which faces the way it drives.
    pub fn vehicle(&mut self, rng: &mut Rng, kind: Vehicle, f: &Frame) {
        let choices: Vec<usize> = self.library.vehicles.iter().filter(|t| t.0 == kind).map(|t| t.1).collect();
        let item = rng.pick(&choices);
        self.place(item, f, 1.0);
    }

    /// What was built.
    pub fn finish(self) -> (Builder, Vec<Use>, u64) {
        let (mesh, triangles) = self.pieces.finish();
        (mesh, self.uses, triangles)
    }
}
