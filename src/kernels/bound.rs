//! What every kernel of a submission reads: the resident part of the scene in the frame, bricks where they lie,
//! parameters; and what all of them add to.

use super::frame::{Frame, Placement};
use super::lamps::LampTables;
use super::layout;
use super::layout::{Origin, PARAM_BOUNCE, Params};
use super::levels::LevelTable;
use super::payloads::BrickView;
use super::simd::isa::Best;
use crate::schedule::Own;
use bricks::{Node, Resident};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

/// The resident part of a scene, relative to the reference point of a frame: group 0 of the kernels.
#[derive(Default)]
pub struct Scene {
    /// The wide top level.
    pub top8: Vec<Node>,
    /// The binary top level.
    pub top2: Vec<layout::TopNode2>,
    /// Leaves of both.
    pub leaves: Vec<layout::Leaf>,
    /// Instances.
    pub instances: Vec<layout::Instance>,
    /// Roots of the bricks.
    pub roots: Vec<Node>,
    /// Relative padding of top-level boxes for the rounding of instance rays.
    pub instance_pad: f32,
    /// What selection of levels of detail goes by; empty where none are in use.
    pub levels: LevelTable,
    /// Global ids at which hiding begins and ends in turns: [`super::FrameExecutor::set_hidden`].
    pub hidden: Vec<u32>,
    marks: Arc<[bool]>,
    frame: Option<Frame>,
}

impl Scene {
    /// What does not depend on the frame.
    pub fn new(resident: &Resident) -> Self {
        Self { roots: resident.bricks.iter().map(|b| b.root).collect(), ..Self::default() }
    }

    /// Has the next frame place everything anew.
    pub fn forget_frame(&mut self) {
        self.frame = None;
    }

    /// Moves everything to `frame`, if it is not there yet.
    pub fn rebase(&mut self, resident: &Resident, frame: Frame) {
        if self.frame != Some(frame) {
            self.frame = Some(frame);
            let Placement { instances, leaves, top2, top8, instance_pad } = Placement::new(resident, &frame);
            (self.instances, self.leaves, self.top2, self.top8) = (instances, leaves, top2, top8);
            self.instance_pad = instance_pad;
            if resident.has_levels_in_use() {
                self.levels = LevelTable::new(resident, &frame);
                self.levels.mark(&self.marks);
            }
        }
    }

    /// Marks leaves: [`crate::schedule::Executor::mark_leaves`].
    pub fn mark_leaves(&mut self, marks: &Arc<[bool]>) {
        self.marks = marks.clone();
        self.levels.mark(marks);
    }
}

/// What rays ask of a brick, or of a pair.
#[derive(Debug)]
pub struct Demand {
    /// How many.
    pub rays: AtomicU32,
    /// Bits of the least entry distance.
    pub nearest: AtomicU32,
    /// How many enter it before any other brick that they ask for; of a pair, none.
    pub next: AtomicU32,
}

/// Words that several threads write.
pub fn atomic(words: &mut [u32]) -> &[AtomicU32] {
    // SAFETY: an AtomicU32 has the size and alignment of a u32, every bit pattern of either is one of the other, and
    // the exclusive borrow leaves no other way to the words while the result lives.
    unsafe { &*(std::ptr::from_mut(words) as *const [AtomicU32]) }
}

/// Bits of the distance at which a ray enters, ordered as distances are.
#[inline(always)]
pub fn entry_bits(near: f32) -> u32 {
    if near > 0.0 { near.to_bits() } else { 0 }
}

impl Default for Demand {
    fn default() -> Self {
        Self { rays: AtomicU32::new(0), nearest: AtomicU32::new(u32::MAX), next: AtomicU32::new(0) }
    }
}

impl Demand {
    /// Adds `rays` that enter at `nearest`, as bits of a distance that is not negative.
    pub fn add(&self, rays: u32, nearest: u32) {
        self.rays.fetch_add(rays, Ordering::Relaxed);
        // Reading leaves the line to all cores.
        if nearest < self.nearest.load(Ordering::Relaxed) {
            self.nearest.fetch_min(nearest, Ordering::Relaxed);
        }
    }

    /// Adds a ray that enters at `near`.
    pub fn add_ray(&self, near: f32) {
        self.add(1, entry_bits(near));
    }

    /// What was asked.
    pub fn get(&self) -> layout::Demand {
        let [rays, nearest, next] = [&self.rays, &self.nearest, &self.next].map(|x| x.load(Ordering::Relaxed));
        layout::Demand { rays, nearest, next }
    }

    /// What was asked of a pair; nothing is asked from now on.
    pub fn take(&self) -> layout::PairDemand {
        let rays = self.rays.swap(0, Ordering::Relaxed);
        layout::PairDemand { rays, nearest: self.nearest.swap(u32::MAX, Ordering::Relaxed) }
    }
}

/// What the rays of one task ask of bricks, added up before what all tasks write is touched: rays of a bounce ask for
/// the same few bricks in no order, and cores would wait for one another's.
#[derive(Default)]
pub struct DemandTally(Vec<Asked>);

/// Of one brick.
#[derive(Clone)]
struct Asked {
    brick: u32,
    rays: u32,
    nearest: u32,
    next: u32,
}

impl Asked {
    const NOTHING: Self = Self { brick: layout::NONE, rays: 0, nearest: u32::MAX, next: 0 };

    fn tell(&self, demand: &[Demand]) {
        if self.brick == layout::NONE {
            return;
        }
        let all = &demand[self.brick as usize];
        if self.rays > 0 {
            all.add(self.rays, self.nearest);
        }
        if self.next > 0 {
            all.next.fetch_add(self.next, Ordering::Relaxed);
        }
    }
}

impl DemandTally {
    /// A power of two.
    const BRICKS: usize = 256;

    #[inline(always)]
    fn of(&mut self, demand: &[Demand], brick: usize) -> &mut Asked {
        if self.0.is_empty() {
            self.0.resize(Self::BRICKS, Asked::NOTHING);
        }
        let asked = &mut self.0[brick % Self::BRICKS];
        if asked.brick != brick as u32 {
            asked.tell(demand);
            *asked = Asked { brick: brick as u32, ..Asked::NOTHING };
        }
        asked
    }

    /// Adds a ray that enters a brick at `near`.
    #[inline(always)]
    pub fn add_ray(&mut self, demand: &[Demand], brick: usize, near: f32) {
        self.add(demand, brick, 1, entry_bits(near));
    }

    /// Adds `rays` that enter a brick, the first at `nearest`, as [`Demand::add`] takes it.
    #[inline(always)]
    pub fn add(&mut self, demand: &[Demand], brick: usize, rays: u32, nearest: u32) {
        let asked = self.of(demand, brick);
        asked.rays += rays;
        asked.nearest = asked.nearest.min(nearest);
    }

    /// Adds a ray that enters a brick before any other that it asks for.
    #[inline(always)]
    pub fn add_next(&mut self, demand: &[Demand], brick: usize) {
        self.of(demand, brick).next += 1;
    }

    /// Tells what has been added up.
    pub fn finish(&mut self, demand: &[Demand]) {
        self.0.drain(..).for_each(|asked| asked.tell(demand));
    }
}

/// The counters of a submission.
#[derive(Default)]
pub struct Counters([AtomicU32; layout::COUNTERS]);

impl Counters {
    /// Adds what `tally` counted.
    pub fn add(&self, tally: &Tally) {
        for (counter, &amount) in self.0.iter().zip(&tally.0).filter(|(_, amount)| **amount > 0) {
            counter.fetch_add(amount, Ordering::Relaxed);
        }
    }

    /// Raises a counter to at least `value`.
    pub fn raise(&self, counter: u32, value: u32) {
        self.0[counter as usize].fetch_max(value, Ordering::Relaxed);
    }

    /// All of them.
    pub fn get(&self) -> Vec<u32> {
        self.0.iter().map(|counter| counter.load(Ordering::Relaxed)).collect()
    }
}

/// What one task counts before it adds to the counters of all.
#[derive(Default)]
pub struct Tally([u32; layout::COUNTERS]);

impl Tally {
    /// Adds to a counter.
    #[inline(always)]
    pub fn add(&mut self, counter: u32, amount: u32) {
        self.0[counter as usize] = self.0[counter as usize].wrapping_add(amount);
    }
}

/// What a dispatch binds beside rays, tiles and pixels.
#[derive(Clone, Copy)]
pub struct Bound<'a> {
    /// Parameters.
    pub params: &'a Params,
    /// What a method's kernel is told beside these ([`Own::block`]).
    pub block: &'a [u32; Own::WORDS],
    /// The scene.
    pub scene: &'a Scene,
    /// Geometry of the bricks; empty of those that are not resident.
    pub bricks: &'a [BrickView<'a>],
    /// States of the bricks.
    pub slots: &'a [layout::Slot],
    /// What is asked of the bricks.
    pub demand: &'a [Demand],
    /// Counters.
    pub counters: &'a Counters,
    /// The environment and the emitters.
    pub lamps: &'a LampTables,
    /// Whether nodes and triangles are counted.
    pub count: bool,
    /// The instruction set.
    pub isa: Best,
}

impl<'a> Bound<'a> {
    /// Whether the params have a flag.
    #[inline(always)]
    pub fn has(&self, flag: u32) -> bool {
        self.params.flags & flag != 0
    }

    /// The pixel of the band that a hit of the shaded set belongs to.
    #[inline(always)]
    pub fn own_pixel(&self, index: usize, origins: &[Origin]) -> u32 {
        if self.has(PARAM_BOUNCE) { origins[index].pixel } else { index as u32 }
    }

    /// That of the picture: random numbers are drawn by it, not by a ray's place in a band or in its set.
    #[inline(always)]
    pub fn pixel_of(&self, index: usize, origins: &[Origin]) -> u32 {
        self.params.first_row.wrapping_mul(self.params.width).wrapping_add(self.own_pixel(index, origins))
    }

    /// What a method's kernel is told, as its WGSL declares it.
    #[inline(always)]
    pub fn own<T: bytemuck::Pod>(&self) -> &'a T {
        bytemuck::from_bytes(&bytemuck::bytes_of(self.block)[..size_of::<T>()])
    }

    /// The brick of a leaf.
    #[inline(always)]
    pub fn brick_of(&self, leaf: u32) -> usize {
        self.scene.leaves[leaf as usize].brick as usize
    }

    /// Whether a brick is in the state that the dispatch selects.
    #[inline(always)]
    pub fn is_selected(&self, brick: usize) -> bool {
        self.slots[brick].state & self.params.select_mask == self.params.select_want
    }

    /// Whether [`Bound::note_use`] has been told of the brick of a leaf in this submission.
    #[inline(always)]
    pub fn is_used(&self, leaf: u32) -> bool {
        self.demand[self.brick_of(leaf)].rays.load(Ordering::Relaxed) != 0
    }

    /// Notes that a ray enters a child box of the brick's root: what a resident brick's demand says (the host knows
    /// which are). Most rays find it noted, and only read.
    #[inline(always)]
    pub fn note_use(&self, leaf: u32) {
        let rays = &self.demand[self.brick_of(leaf)].rays;
        if rays.load(Ordering::Relaxed) == 0 {
            rays.store(1, Ordering::Relaxed);
        }
    }
}
