//! The state of every brick as a schedule sees it, mirrored to the executor at each step.

use crate::stream::{Item, Kind, Placed, Slot};

/// Where bricks and tiles of textures lie, and what part bricks play in the pass.
#[derive(Clone, Debug)]
pub struct BrickStates {
    geometry: Vec<Option<Slot>>,
    attributes: Vec<Option<Slot>>,
    tiles: Vec<Option<Slot>>,
    done: Vec<bool>,
    batch: Vec<bool>,
    keeps_asking: bool,
}

impl BrickStates {
    /// Nothing resident of `bricks` bricks and `tiles` tiles.
    pub fn new(bricks: usize, tiles: usize) -> Self {
        Self {
            geometry: vec![None; bricks],
            attributes: vec![None; bricks],
            tiles: vec![None; tiles],
            done: vec![false; bricks],
            batch: vec![false; bricks],
            keeps_asking: false,
        }
    }

    /// Number of bricks.
    pub fn len(&self) -> usize {
        self.done.len()
    }

    /// Whether there are no bricks.
    pub fn is_empty(&self) -> bool {
        self.done.is_empty()
    }

    /// Slot of a brick's geometry.
    pub fn geometry(&self, brick: usize) -> Option<Slot> {
        self.geometry[brick]
    }

    /// Slot of a brick's attributes.
    pub fn attributes(&self, brick: usize) -> Option<Slot> {
        self.attributes[brick]
    }

    /// Slots of all tiles.
    pub fn tiles(&self) -> &[Option<Slot>] {
        &self.tiles
    }

    /// Whether every ray of the pass that wanted the brick has been intersected with it.
    pub fn done(&self, brick: usize) -> bool {
        self.done[brick]
    }

    /// Whether the brick came with the batch to be intersected now.
    pub fn batch(&self, brick: usize) -> bool {
        self.batch[brick]
    }

    /// Forgets the pass before.
    pub(super) fn begin_pass(&mut self) {
        self.done.fill(false);
        self.batch.fill(false);
    }

    /// Marks what is resident as done.
    pub(super) fn finish_resident(&mut self) {
        for (done, slot) in self.done.iter_mut().zip(&self.geometry) {
            *done |= slot.is_some();
        }
    }

    /// Marks `bricks` as the batch, done when its step has run.
    pub(super) fn set_batch(&mut self, bricks: &[u32]) {
        self.batch.fill(false);
        for &brick in bricks {
            self.batch[brick as usize] = true;
            self.done[brick as usize] = true;
        }
    }

    /// Enters a placement that `residency` made.
    pub(super) fn place(&mut self, item: Item, placed: &Placed) {
        for evicted in &placed.evicted {
            *self.slot(*evicted) = None;
        }
        *self.slot(item) = Some(placed.slot);
    }

    /// Drops a payload that could not be read.
    pub(super) fn forget(&mut self, item: Item) {
        *self.slot(item) = None;
    }

    /// Whether every brick's geometry is resident, so that no ray has to ask.
    pub fn all_geometry_resident(&self) -> bool {
        !self.keeps_asking && self.geometry.iter().all(Option::is_some)
    }

    /// Whether rays ask for missing bricks even where none is missing.
    pub fn keep_asking(&mut self, asks: bool) {
        self.keeps_asking = asks;
    }

    fn slot(&mut self, item: Item) -> &mut Option<Slot> {
        match item.kind {
            Kind::Geometry => &mut self.geometry[item.number as usize],
            Kind::Attributes => &mut self.attributes[item.number as usize],
            Kind::Tile => &mut self.tiles[item.number as usize],
        }
    }
}
