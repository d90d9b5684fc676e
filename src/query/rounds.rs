//! Items that look for one thing each, in bricks that come as they are needed.
//!
//! In a round every item that is not done goes through those bricks on its way that are at hand, and asks for the
//! first of the others that may still matter to it. The bricks that most items ask for are read for the next round, as
//! many as the cache holds. What has been at hand once is not asked for again. So of a batch each brick is read at most
//! once, and none that no item needs.

use super::packet::{ALL, MANY};
use super::room::Room;
use super::space::Geometry;
use super::{Queries, Watch};
use crate::kernels::simd::isa::{Best, Isa, Work};
use crate::stream::Item;
use anyhow::Result;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

/// Items that a thread takes at a time, some times [`MANY`].
pub(super) const TASK: usize = 32 * MANY;

/// Items after which it is told how far work is, some times that.
pub(super) const TOLD: usize = 1 << 18;

/// What looks for something.
pub(super) trait Seek: Sync {
    /// Items side by side, set up.
    type Ready;

    /// What one has found.
    type Found: Send;

    /// Sets up the items from `first` on, [`MANY`] or as many as there are. Implementations are always inlined.
    fn ready<I: Isa>(&self, isa: I, first: usize) -> Self::Ready;

    /// Brings an item as far as it gets: by the bricks at hand, to the first that is away and may matter.
    /// Implementations are always inlined.
    fn go<I: Isa>(
        &self,
        isa: I,
        item: (&Self::Ready, usize),
        found: &mut Self::Found,
        bricks: &Bricks,
        room: &mut Room,
    ) -> Option<u32>;

    /// The same for [`MANY`] items, where they go faster together and nothing on their way is away. Returns which are
    /// to go alone after all, a bit each. Implementations are always inlined.
    #[inline(always)]
    fn go_together<I: Isa>(
        &self,
        _isa: I,
        _items: &Self::Ready,
        _found: &mut [Self::Found; MANY],
        _bricks: &Bricks,
        _room: &mut Room,
    ) -> u32 {
        ALL
    }
}

/// A brick, in a round.
#[derive(Clone, Copy)]
pub(super) enum State<'a> {
    /// It may be asked for.
    Away,
    /// Items go through it now.
    AtHand(&'a Geometry<'a>),
    /// Those to whom it may matter have gone through it, or nobody is to.
    Done,
}

/// All bricks, in a round.
pub(super) struct Bricks<'a>(Vec<State<'a>>);

impl<'a> Bricks<'a> {
    /// One of them. Levels of detail lie behind those of objects.
    #[inline(always)]
    pub(super) fn get(&self, brick: u32) -> State<'a> {
        self.0.get(brick as usize).copied().unwrap_or(State::Done)
    }
}

/// A round of some items.
struct Task<'a, 'b, S: Seek> {
    seek: &'a S,
    bricks: &'a Bricks<'b>,
    /// How many items ask for each brick.
    demand: &'a [AtomicU32],
    /// How many items are done.
    done: &'a AtomicU64,
    /// The number of the first.
    first: usize,
    found: &'a mut [S::Found],
    /// Of each [`MANY`] which are not done, a bit each.
    left: &'a mut [u8],
}

impl<S: Seek> Work for Task<'_, '_, S> {
    type Out = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let (mut room, mut done) = (Room::default(), 0);
        for (place, (found, left)) in self.found.chunks_mut(MANY).zip(self.left).enumerate() {
            let before = u32::from(*left);
            if before == 0 {
                continue;
            }
            let ready = self.seek.ready(isa, self.first + place * MANY);
            let mut alone = before;
            if before == ALL
                && let Some(found) = found.as_mut_array()
            {
                alone = self.seek.go_together(isa, &ready, found, self.bricks, &mut room);
            }
            let mut wait = 0;
            while alone != 0 {
                let i = alone.trailing_zeros() as usize;
                alone &= alone - 1;
                if let Some(brick) = self.seek.go(isa, (&ready, i), &mut found[i], self.bricks, &mut room) {
                    self.demand[brick as usize].fetch_add(1, Ordering::Relaxed);
                    wait |= 1 << i;
                }
            }
            *left = wait as u8;
            done += u64::from((before & !wait).count_ones());
        }
        self.done.fetch_add(done, Ordering::Relaxed);
    }
}

impl Queries {
    /// What each of `items` finds, which begins with `nothing`; `opacity` as of [`Geometry::new`].
    ///
    /// # Errors
    /// A damaged brick; what `watch` says.
    pub(super) fn seek<S: Seek>(
        &self,
        seek: &S,
        items: usize,
        nothing: impl Fn() -> S::Found + Sync,
        opacity: &[[u32; 4]],
        watch: &mut Watch,
    ) -> Result<Vec<S::Found>> {
        let (resident, isa) = (self.scene.resident(), Best::for_one());
        let count = resident.exact_bricks() as u32;
        // By the threads that need it then, so that it lies near them.
        let mut found: Vec<S::Found> =
            self.threads.install(|| (0..items).into_par_iter().with_min_len(TASK).map(|_| nothing()).collect());
        let mut left: Vec<u8> =
            (0..items).step_by(MANY).map(|first| (ALL >> MANY.saturating_sub(items - first)) as u8).collect();
        let demand: Vec<AtomicU32> = (0..count).map(|_| AtomicU32::new(0)).collect();
        let (mut is_done, done, mut told) = (vec![false; count as usize], AtomicU64::new(0), 0);
        let mut at_hand: Vec<(u32, Arc<[u8]>)> =
            (0..count).filter_map(|brick| Some((brick, self.store.at_hand(Item::geometry(brick))?))).collect();
        loop {
            let state = |&is_done: &bool| if is_done { State::Done } else { State::Away };
            let mut bricks = Bricks(is_done.iter().map(state).collect());
            let geometries: Vec<Geometry> =
                at_hand.iter().map(|(brick, bytes)| Geometry::new(resident, *brick, bytes, opacity)).collect();
            for ((brick, _), geometry) in at_hand.iter().zip(&geometries) {
                bricks.0[*brick as usize] = State::AtHand(geometry);
            }
            for (part, (found, left)) in found.chunks_mut(TOLD).zip(left.chunks_mut(TOLD / MANY)).enumerate() {
                let task = |(place, (found, left))| {
                    let first = part * TOLD + place * TASK;
                    isa.run(Task { seek, bricks: &bricks, demand: &demand, done: &done, first, found, left });
                };
                let tasks = found.par_chunks_mut(TASK).zip(left.par_chunks_mut(TASK / MANY)).enumerate();
                self.threads.install(|| tasks.for_each(task));
                let now = done.load(Ordering::Relaxed);
                watch(now - told)?;
                told = now;
            }
            drop(bricks);
            at_hand.drain(..).for_each(|(brick, _)| is_done[brick as usize] = true);
            let asked_for = |(brick, items): (u32, &AtomicU32)| {
                let items = items.swap(0, Ordering::Relaxed);
                (items > 0).then_some((Reverse(items), brick))
            };
            let mut wanted: Vec<_> = (0..count).zip(&demand).filter_map(asked_for).collect();
            if wanted.is_empty() {
                return Ok(found);
            }
            wanted.sort_unstable();
            let wanted: Vec<Item> = wanted.iter().map(|&(_, brick)| Item::geometry(brick)).collect();
            let wanted = &wanted[..self.store.together(&wanted)];
            self.store.for_each(wanted, |place, payloads| {
                at_hand.extend(wanted[place..].iter().map(|item| item.number).zip(payloads.iter().cloned()));
                watch(0)
            })?;
        }
    }
}
