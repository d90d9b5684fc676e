//! A mesh that grows piece by piece within a budget of triangles.

use crate::mesh::Builder;
use crate::rng::Rng;
use glam::DAffine3;

/// A mesh under construction that takes at most so many triangles.
pub struct Pieces {
    mesh: Builder,
    budget: u64,
    triangles: u64,
}

impl Pieces {
    /// Continues `mesh`, which is empty, with at most `budget` triangles.
    pub fn new(mesh: Builder, budget: u64) -> Self {
        Self { mesh, budget, triangles: 0 }
    }

    /// Builds something with random numbers of its own; left out whole when the budget does not allow it, without
    /// consequence for what follows.
    pub fn piece(&mut self, rng: &mut Rng, build: impl FnOnce(&mut Builder, &mut Rng)) {
        let mut own = rng.fork();
        let mark = self.mesh.mark();
        let before = self.mesh.triangles();
        build(&mut self.mesh, &mut own);
        let added = self.mesh.triangles() - before;
        if self.triangles + added > self.budget {
            self.mesh.rollback(&mark);
        } else {
            self.triangles += added;
        }
    }

    /// Takes `triangles` of the budget, if there are as many left.
    pub fn spend(&mut self, triangles: u64) -> bool {
        let fits = self.triangles + triangles <= self.budget;
        if fits {
            self.triangles += triangles;
        }
        fits
    }

    /// Adds a transformed copy of `other`, already paid for by [`Self::spend`].
    pub fn append(&mut self, other: &Builder, transform: &DAffine3) {
        self.mesh.append(other, transform);
    }

    /// What was built, and the triangles spent.
    pub fn finish(self) -> (Builder, u64) {
        (self.mesh, self.triangles)
    }
}
