//! The cache as a schedule uses it: residency, brick states, and the request trace.

use super::{BrickStates, Executor, ExecutorError, Load};
use crate::counters::Counters;
use crate::settings::FrameBudget;
use crate::stream::{Item, Kind, Residency, Sizes, Trace};
use std::time::{Duration, Instant};

/// Most bricks loaded between two queries where some of them may turn out to be hidden by others.
pub const BATCH_BRICKS: usize = 8;

/// Most bytes loaded at once: they take as much memory on their way to the device.
const BATCH_BYTES: u64 = 64 << 20;

/// Groups of bricks that do not fit into a full cache, after which no others are tried.
const MOST_REFUSED: u32 = 4;

/// What a frame may still load.
#[derive(Clone, Copy, Debug)]
pub struct Allowance {
    bytes: u64,
    until: Option<Instant>,
}

impl Allowance {
    /// Of a frame that begins now; `least` bytes at least.
    fn new(budget: FrameBudget, least: u64) -> Self {
        match budget {
            FrameBudget::Bytes(bytes) => Self { bytes: bytes.max(least), until: None },
            FrameBudget::Time(ms) => {
                Self { bytes: u64::MAX, until: Some(Instant::now() + Duration::from_secs_f64(ms / 1e3)) }
            }
        }
    }

    /// Bytes that may still be loaded.
    pub fn left(&self) -> u64 {
        if self.until.is_some_and(|until| Instant::now() >= until) { 0 } else { self.bytes }
    }

    /// Whether something may still be loaded after what takes so long.
    pub fn outlasts(&self, time: Duration) -> bool {
        self.bytes > 0 && self.until.is_none_or(|until| Instant::now() + time < until)
    }

    /// Takes off what has been loaded.
    pub fn spend(&mut self, bytes: u64) {
        self.bytes = self.bytes.saturating_sub(bytes);
    }
}

/// What is resident, what everything weighs, and what was asked for.
pub struct Cache {
    /// Placement and eviction.
    pub residency: Residency,
    /// Its mirror for executors, with each brick's part in the pass.
    pub states: BrickStates,
    /// Bytes of everything.
    pub sizes: Sizes,
    /// Of bricks' geometry, bytes of nodes; of bricks beyond these it is not told apart.
    pub nodes: Vec<u64>,
    /// Requests in order, when they are recorded.
    pub trace: Option<Trace>,
    /// What may still be loaded in this frame; `None` where everything is waited for.
    pub allowance: Option<Allowance>,
    /// The frame, from 1, and per item the frame that loaded it last.
    frame: u32,
    loaded_in: Vec<u32>,
}

impl Cache {
    /// An empty cache over bricks and tiles of the given sizes.
    pub fn new(residency: Residency, sizes: Sizes, nodes: Vec<u64>, trace: Option<Trace>) -> Self {
        let states = BrickStates::new(sizes.bricks.len(), sizes.tiles.len());
        let loaded_in = vec![0; sizes.rows()];
        Self { residency, states, sizes, nodes, trace, allowance: None, frame: 0, loaded_in }
    }

    /// Starts a pass: nothing is done, nothing is pinned.
    pub fn begin_pass(&mut self, name: &str, frame: u32) {
        self.residency.begin_pass();
        self.residency.unpin_all();
        self.states.begin_pass();
        self.frame = frame + 1;
        if let Some(trace) = &mut self.trace {
            trace.begin_pass(frame, name);
        }
    }

    /// Starts a frame that may load so much, one payload at least; with `None` it waits for everything.
    pub fn begin_frame(&mut self, budget: Option<FrameBudget>) {
        self.allowance = budget.map(|budget| {
            let bricks = self.sizes.bricks.iter().flat_map(|&(geometry, attributes)| [geometry, attributes]);
            let largest = bricks.chain(self.sizes.tiles.iter().copied()).max().unwrap_or(0);
            Allowance::new(budget, largest)
        });
    }

    /// Which bricks' geometry is resident.
    pub fn resident_geometry(&self) -> Vec<bool> {
        (0..self.states.len()).map(|brick| self.states.geometry(brick).is_some()).collect()
    }

    /// Notes the use of what is resident.
    pub fn touch(&mut self, item: Item) {
        self.residency.touch(item);
        if let Some(trace) = &mut self.trace {
            trace.request(item);
        }
    }

    /// Marks what is resident as done, its intersection being under way, and notes the use of the bricks that rays
    /// entered. `ahead`: some bricks are missing, which are asked for only now.
    pub fn finish_resident(&mut self, used: &[u32], ahead: bool, stats: &mut Counters) {
        self.states.finish_resident();
        self.touch_geometry(used, ahead, stats);
    }

    /// Notes the use of resident bricks that rays entered.
    pub fn touch_geometry(&mut self, used: &[u32], ahead: bool, stats: &mut Counters) {
        for &brick in used {
            self.touch(Item::geometry(brick));
        }
        if ahead {
            stats.bricks_resident_first += used.len() as u64;
        }
        stats.bricks_entered.extend(used.iter().copied());
    }

    /// Loads as many of `items` as fit without evicting each other, at least one and at most `most` and 64 MiB; returns
    /// how many, from the front. Those that are resident stay, and count among them.
    ///
    /// # Errors
    /// What the executor says; nothing of the batch is resident then.
    pub fn load(
        &mut self,
        executor: &mut dyn Executor,
        items: &[Item],
        most: usize,
        stats: &mut Counters,
    ) -> Result<usize, ExecutorError> {
        self.begin_batch();
        self.load_beside(executor, items, (most, u64::MAX), stats)
    }

    /// Loads all of `items`, at most so many at a time; a cache that does not hold them all keeps the last.
    ///
    /// # Errors
    /// What the executor says.
    pub fn load_all(
        &mut self,
        executor: &mut dyn Executor,
        mut items: &[Item],
        most: usize,
        stats: &mut Counters,
    ) -> Result<(), ExecutorError> {
        while !items.is_empty() {
            let count = self.load(executor, items, most, stats)?;
            items = &items[count..];
        }
        Ok(())
    }

    /// The same without these limits: as many as the cache holds.
    ///
    /// # Errors
    /// As of [`Self::load`].
    pub fn fill(
        &mut self,
        executor: &mut dyn Executor,
        items: &[Item],
        stats: &mut Counters,
    ) -> Result<usize, ExecutorError> {
        self.begin_batch();
        let mut taken = 0;
        while taken < items.len() {
            let count = self.load_beside(executor, &items[taken..], (usize::MAX, u64::MAX), stats)?;
            if count == 0 {
                break;
            }
            taken += count;
        }
        Ok(taken)
    }

    /// Loads `groups` of items that are of use together only, the most urgent first, as far as the frame's allowance
    /// goes. One that does not fit whole beside `kept` and those before it is left out: its parts would put out others
    /// for nothing, frame after frame. Returns whether anything was loaded.
    ///
    /// # Errors
    /// As of [`Self::load`].
    pub fn load_within(
        &mut self,
        executor: &mut dyn Executor,
        groups: &[Vec<Item>],
        kept: &[Item],
        stats: &mut Counters,
    ) -> Result<bool, ExecutorError> {
        self.begin_batch();
        for &item in kept {
            self.residency.pin(item);
        }
        let (mut loaded, mut refused) = (0, 0);
        let (mut batch, mut trial) = (Vec::new(), None);
        for group in groups {
            let trial_of_batch = trial.get_or_insert_with(|| self.residency.clone());
            // What is resident of a group must not make room for the rest of it.
            let (resident, missing): (Vec<Item>, Vec<Item>) =
                group.iter().partition(|&&item| trial_of_batch.slot(item).is_some());
            let in_order = [resident, missing].concat();
            let has_room = in_order.iter().all(|&item| trial_of_batch.insert(item).is_ok() && trial_of_batch.pin(item));
            if has_room {
                batch.extend(in_order);
            } else {
                refused += 1;
            }
            if !has_room || batch.len() >= 2 * BATCH_BRICKS {
                trial = None;
                if !self.load_batch(executor, &std::mem::take(&mut batch), &mut loaded, stats)? {
                    return Ok(loaded > 0);
                }
            }
            if refused == MOST_REFUSED {
                break;
            }
        }
        self.load_batch(executor, &batch, &mut loaded, stats)?;
        Ok(loaded > 0)
    }

    /// Loads what is missing of `items`, as far as the frame's allowance goes, and adds its bytes to `loaded`. Returns
    /// whether that was all of it.
    fn load_batch(
        &mut self,
        executor: &mut dyn Executor,
        items: &[Item],
        loaded: &mut u64,
        stats: &mut Counters,
    ) -> Result<bool, ExecutorError> {
        let before = self.residency.counters().total().loaded_bytes;
        let mut taken = 0;
        while taken < items.len() {
            let left = self.allowance.map_or(0, |allowance| allowance.left());
            let so_far = self.residency.counters().total().loaded_bytes;
            let count = self.load_beside(executor, &items[taken..], (usize::MAX, left), stats)?;
            self.spend(self.residency.counters().total().loaded_bytes - so_far);
            if count == 0 {
                break;
            }
            taken += count;
        }
        *loaded += self.residency.counters().total().loaded_bytes - before;
        Ok(taken == items.len())
    }

    /// Takes bytes that have been loaded off the frame's allowance.
    pub fn spend(&mut self, bytes: u64) {
        if let Some(allowance) = &mut self.allowance {
            allowance.spend(bytes);
        }
    }

    fn begin_batch(&mut self) {
        self.residency.unpin_all();
        if let Some(trace) = &mut self.trace {
            trace.begin_batch();
        }
    }

    /// [`Self::load`] beside what the batch has loaded: so many items and bytes at most, none where no more fit.
    fn load_beside(
        &mut self,
        executor: &mut dyn Executor,
        items: &[Item],
        (most, most_bytes): (usize, u64),
        stats: &mut Counters,
    ) -> Result<usize, ExecutorError> {
        let start = Instant::now();
        let (before, head) = (self.residency.counters(), self.residency.head());
        let (mut taken, mut loads, mut bytes) = (0, Vec::new(), 0);
        for &item in items.iter().take(most) {
            let is_resident = self.residency.slot(item).is_some();
            bytes += if is_resident { 0 } else { self.residency.bytes(item) };
            if bytes > most_bytes || bytes > BATCH_BYTES && taken > 0 {
                break;
            }
            let Ok(placed) = self.residency.insert(item) else { break };
            taken += 1;
            self.residency.pin(item);
            self.states.place(item, &placed);
            if let Some(trace) = &mut self.trace {
                trace.request(item);
            }
            if !is_resident {
                loads.push(Load { item, slot: placed.slot });
            }
        }
        if loads.is_empty() {
            return Ok(taken);
        }
        if let Err(error) = executor.load(&loads) {
            for load in &loads {
                self.residency.withdraw(load.item);
                self.states.forget(load.item);
            }
            self.residency.rewind(head);
            return Err(error);
        }
        for load in &loads {
            let bytes = self.residency.bytes(load.item);
            match load.item.kind {
                Kind::Geometry => {
                    let bvh = self.nodes.get(load.item.number as usize).map_or(0, |&bytes| bytes);
                    stats.bytes_bvh += bvh;
                    stats.bytes_geometry += bytes - bvh;
                }
                Kind::Attributes => stats.bytes_attributes += bytes,
                Kind::Tile => stats.bytes_textures += bytes,
            }
            if std::mem::replace(&mut self.loaded_in[load.item.index()], self.frame) == self.frame {
                stats.bricks_reloaded_frame += 1;
                stats.bytes_reloaded_frame += self.residency.bytes(load.item);
            }
        }
        let change = self.residency.counters().since(&before).total();
        stats.bricks_loaded += change.loaded;
        stats.bricks_reloaded += change.reloaded;
        stats.bricks_evicted += change.evicted;
        stats.load_batches += 1;
        stats.ms_stream += start.elapsed().as_secs_f64() * 1e3;
        Ok(taken)
    }
}
