//! The payloads that are resident: verified bytes in host memory, shared with the host cache, and the places that they
//! take of the budget.

use crate::kernels::flat::FlatBrick;
use crate::kernels::payloads::{AttributeView, BrickView};
use crate::schedule::{BrickStates, ExecutorError, Load};
use crate::stream::{Item, Shared, Slot, Workers};
use bricks::{Brick, Resident, SceneFile};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// What is resident.
pub struct BrickCache {
    /// By [`Item::index`]; each at one of `places`.
    held: Vec<Option<Held>>,
    /// Bytes and owner of every place that is taken.
    places: BTreeMap<Slot, (u64, Item)>,
}

/// A payload and the place that it takes.
struct Held {
    place: Slot,
    bytes: Arc<[u8]>,
    /// Of geometry, whether rays have used it,
    is_used: bool,
    /// and the form that is walked faster, once it has been made.
    flat: Option<FlatBrick>,
}

impl BrickCache {
    /// Nothing of what `rows` rows by [`Item::index`] stand for.
    pub fn new(rows: usize) -> Self {
        Self { held: (0..rows).map(|_| None).collect(), places: BTreeMap::new() }
    }

    /// Has the workers bring payloads. What lay at their places is given up first, so that never more is held than the
    /// budget says.
    ///
    /// # Errors
    /// The first payload that cannot be read or verified; none of `loads` is resident then.
    pub fn load(&mut self, scene: &SceneFile, workers: &Workers, loads: &[Load]) -> Result<(), ExecutorError> {
        for load in loads {
            // What was evicted and not overwritten may come back elsewhere.
            if let Some(held) = self.held[load.item.index()].take() {
                self.places.remove(&held.place);
            }
            self.give_up(load.slot, scene.loaded_bytes(load.item.into()));
        }
        let requests = loads.iter().map(|load| (load.item, Shared::default())).collect();
        let loaded = workers.load(requests)?;
        for (load, (item, Shared(payload))) in loads.iter().zip(loaded) {
            self.places.insert(load.slot, (scene.loaded_bytes(item.into()), item));
            self.held[item.index()] = payload.map(|bytes| Held { place: load.slot, bytes, is_used: false, flat: None });
        }
        Ok(())
    }

    /// Frees everything that lies in the `bytes` from `slot` on.
    fn give_up(&mut self, slot: Slot, bytes: u64) {
        let end = u64::from(slot.offset) + bytes;
        // Places do not overlap: of those before, the last alone can reach in.
        let before =
            self.places.range(..slot).next_back().filter(|(at, (bytes, _))| {
                at.page == slot.page && u64::from(at.offset) + bytes > u64::from(slot.offset)
            });
        let within = self.places.range(slot..).take_while(|(at, _)| at.page == slot.page && u64::from(at.offset) < end);
        let overlapped: Vec<(Slot, Item)> =
            before.into_iter().chain(within).map(|(&at, &(_, item))| (at, item)).collect();
        for (at, item) in overlapped {
            self.places.remove(&at);
            self.held[item.index()] = None;
        }
    }

    /// Notes which bricks rays have used: whether each, by its number.
    pub fn note_uses(&mut self, uses: impl Iterator<Item = bool>) {
        for (number, _) in (0..).zip(uses).filter(|&(_, is_used)| is_used) {
            if let Some(held) = &mut self.held[Item::geometry(number).index()] {
                held.is_used = true;
            }
        }
    }

    /// The bricks whose geometry is resident and used, and could be flat.
    fn geometry_used<'a>(&'a mut self, resident: &'a Resident) -> impl Iterator<Item = (&'a Brick, &'a mut Held, u64)> {
        let first = Item::geometry(0).index();
        let held = self.held.iter_mut().skip(first).step_by(Item::geometry(1).index() - first);
        let all = resident.bricks.iter().zip(held);
        all.filter_map(|(brick, held)| {
            Some((brick, held.as_mut().filter(|held| held.is_used)?, FlatBrick::bytes_of(brick)?))
        })
    }

    /// Makes bricks flat that rays have used, as far as `room` bytes hold all that are, if so many rays have come as
    /// they have triangles: about so many gain what making them takes. Returns those rays.
    pub fn flatten(&mut self, resident: &Resident, rays: u64, room: u64) -> u64 {
        let (mut left, mut triangles) = (room, 0);
        let mut waiting = Vec::new();
        for (brick, held, bytes) in self.geometry_used(resident) {
            if held.flat.is_some() {
                left = left.saturating_sub(bytes);
            } else {
                waiting.push((brick, held, bytes));
            }
        }
        waiting.retain(|&(brick, _, bytes)| {
            let fits = bytes <= left;
            if fits {
                left -= bytes;
                triangles += u64::from(brick.triangle_count);
            }
            fits
        });
        if rays < triangles {
            return 0;
        }
        waiting.into_par_iter().for_each(|(brick, held, _)| {
            held.flat = BrickView::new(brick, &held.bytes, &[]).flattened(brick.triangle_count);
        });
        triangles
    }

    /// Every brick's geometry, with the table `opacity` ([`crate::kernels::opacity`]); of bricks that are not resident,
    /// nothing.
    ///
    /// # Errors
    /// A brick that `bricks` says is resident and was never loaded; with `all`, a brick that is not resident.
    pub fn geometry<'a>(
        &'a self,
        resident: &Resident,
        bricks: &BrickStates,
        all: bool,
        opacity: &'a [[u32; 4]],
    ) -> Result<Vec<BrickView<'a>>, ExecutorError> {
        let view = |(i, brick)| match &self.held[Item::geometry(i as u32).index()] {
            Some(held) => Ok(BrickView::new(brick, &held.bytes, opacity).with_flat(held.flat.as_ref())),
            None if all || bricks.geometry(i).is_some() => Err(missing(Item::geometry(i as u32))),
            None => Ok(BrickView::default()),
        };
        resident.bricks.iter().enumerate().map(view).collect()
    }

    /// Every brick's attributes; of bricks whose attributes are not resident, nothing.
    ///
    /// # Errors
    /// A brick whose attributes `bricks` says are resident and were never loaded.
    pub fn attributes(
        &self,
        resident: &Resident,
        bricks: &BrickStates,
    ) -> Result<Vec<AttributeView<'_>>, ExecutorError> {
        let view = |(i, brick)| match &self.held[Item::attributes(i as u32).index()] {
            Some(held) => Ok(AttributeView::new(brick, &held.bytes)),
            None if bricks.attributes(i).is_some() => Err(missing(Item::attributes(i as u32))),
            None => Ok(AttributeView::default()),
        };
        resident.bricks.iter().enumerate().map(view).collect()
    }

    /// The words of every tile; of tiles that are not resident, none.
    ///
    /// # Errors
    /// A tile that `bricks` says is resident and was never loaded.
    pub fn tiles(&self, bricks: &BrickStates) -> Result<Vec<&[u32]>, ExecutorError> {
        let words = |(tile, slot): (u32, &Option<Slot>)| match (&self.held[Item::tile(tile).index()], slot) {
            // What was evicted may still be held; it is not to be read.
            (Some(held), Some(_)) => Ok(bytemuck::cast_slice(&held.bytes)),
            (None, Some(_)) => Err(missing(Item::tile(tile))),
            (_, None) => Ok(&[][..]),
        };
        (0u32..).zip(bricks.tiles()).map(words).collect()
    }
}

fn missing(item: Item) -> ExecutorError {
    ExecutorError::Device(format!("was to use {item}, which it does not hold; this is a bug in brickwalk"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::probe;
    use crate::stream::{HostCache, PayloadSource};

    fn at(offset: u32) -> Slot {
        Slot { page: 0, offset }
    }

    #[test]
    fn what_is_overwritten_is_given_up_and_nothing_else() {
        let scene = Arc::new(probe::scene().unwrap());
        let workers = Workers::new(scene.clone(), HostCache::new(0), 1).unwrap();
        let mut cache = BrickCache::new(scene.sizes().rows());
        let mut load = |brick: u32, slot: Slot| {
            cache.load(&scene, &workers, &[Load { item: Item::geometry(brick), slot }]).unwrap();
            let held = |brick: u32| cache.held[Item::geometry(brick).index()].is_some();
            assert_eq!(cache.places.len(), cache.held.iter().flatten().count(), "one place each");
            [held(0), held(1), held(2)]
        };
        assert_eq!(load(0, at(0)), [true, false, false]);
        // Comes back elsewhere, and stays when its old place is taken.
        assert_eq!(load(0, at(1 << 20)), [true, false, false]);
        assert_eq!(load(1, at(0)), [true, true, false]);
        // Begins within one that lies before it.
        assert_eq!(load(2, at(16)), [true, false, true]);
        // Covers the beginning of one that lies behind it.
        assert_eq!(load(1, at((1 << 20) - 16)), [false, true, true]);
        // Another page is another place.
        assert_eq!(load(0, Slot { page: 1, offset: 16 }), [true, true, true]);
    }

    #[test]
    fn bricks_are_made_flat_that_are_used_and_fit_once_that_pays() {
        let scene = Arc::new(probe::scene().unwrap());
        let workers = Workers::new(scene.clone(), HostCache::new(0), 1).unwrap();
        let mut cache = BrickCache::new(scene.sizes().rows());
        let resident = scene.resident();
        let is_narrow = |&brick: &u32| FlatBrick::bytes_of(&resident.bricks[brick as usize]).is_some();
        let numbers: Vec<u32> = (0..resident.bricks.len() as u32).filter(is_narrow).take(3).collect();
        let load = |&brick: &u32| Load { item: Item::geometry(brick), slot: at(brick << 20) };
        cache.load(&scene, &workers, &numbers.iter().map(load).collect::<Vec<_>>()).unwrap();
        let record = |i: usize| &resident.bricks[numbers[i] as usize];
        let bytes = |i: usize| FlatBrick::bytes_of(record(i)).unwrap();
        let triangles = |i: usize| u64::from(record(i).triangle_count);
        let are_flat = |cache: &BrickCache| {
            let states = BrickStates::new(resident.bricks.len(), 0);
            let views = cache.geometry(resident, &states, false, &[]).unwrap();
            [0, 1, 2].map(|i: usize| views[numbers[i] as usize].flat.is_some())
        };
        assert_eq!(cache.flatten(resident, u64::MAX, u64::MAX), 0, "none is used");
        cache.note_uses((0..=numbers[2]).map(|brick| brick != numbers[1]));
        let both = triangles(0) + triangles(2);
        assert_eq!(cache.flatten(resident, both - 1, u64::MAX), 0, "too few rays");
        assert_eq!(cache.flatten(resident, both, bytes(0).min(bytes(2)) - 1), 0, "no room");
        assert_eq!(are_flat(&cache), [false; 3]);
        assert_eq!(cache.flatten(resident, both, bytes(0)), triangles(0), "room for the first");
        assert_eq!(cache.flatten(resident, both, bytes(0) + bytes(2) - 1), 0, "what is flat takes room");
        assert_eq!(are_flat(&cache), [true, false, false]);
        assert_eq!(cache.flatten(resident, triangles(2), bytes(0) + bytes(2)), triangles(2));
        assert_eq!(are_flat(&cache), [true, false, true]);
    }
}
