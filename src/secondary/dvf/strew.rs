//! The rays of points that are strewn over a region: made block by block, traced, and entered into the masks of a field
//! or kept as trials.
//!
//! Rays that wait for bricks are a bit each ([`crate::schedule::pool`]): a block is made anew from its numbers, but for
//! those that are answered. Of the groups of triangles in which rays wait the triangles are kept, so that no brick is
//! read for them again.

use super::plan::{EFFECT, PASS, Plan, unread};
use super::source::{Group, triangles};
use super::{DvfSettings, Fresh, Shape, kernels};
use crate::counters::Counters;
use crate::frame::{Engine, Schedule};
use crate::kernels::frame::Frame;
use crate::kernels::layout::{DvfTriangle, Hit, NONE, Params, Ray};
use crate::kernels::{Directions, View};
use crate::schedule::pool::Pool;
use crate::schedule::{self, ExecutorError, Report};
use glam::DVec3;

/// Most triangles that are kept of groups in which rays wait: 192 MiB.
const MOST_KEPT: usize = 1 << 22;
/// Most rays by which grids are tried.
const MOST_TRIAL_RAYS: u64 = 1 << 20;
/// Sides of points that are looked at together where cells are made anew: 32 MiB.
const SIDES_AT_ONCE: usize = 1 << 22;
/// Seed of their points, beside that of the field's.
const TRIAL_SEED: u32 = 0x9e37_79b9;
/// Turns of the directions that they take, of [`DvfSettings::rays`].
const TRIAL_TURNS: [(u32, u32); 2] = [(1, 4), (3, 4)];

/// A ray that was traced: where it starts, world units, its direction, whether it met anything.
pub type Traced = (DVec3, [f32; 3], bool);

/// What strewing did.
#[derive(Default)]
pub struct Strewn {
    /// Points that rays started from, but for those of trials.
    pub points: u64,
    /// Rays of trials.
    pub trials: Vec<Traced>,
    /// How many times bricks were loaded until no ray waited.
    pub drains: u64,
    /// Whether `watch` said to stop.
    pub stopped: bool,
}

/// What rays are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// They are entered into masks.
    Masks,
    /// They start from other points and are kept, but for some.
    Trial,
}

/// A group of triangles with its points.
struct Site {
    frame: Frame,
    /// None once no ray from it waits.
    triangles: Vec<DvfTriangle>,
    /// Of points.
    count: u32,
    /// Of a point.
    lanes: u32,
    /// Where cells are made anew: the numbers of the sides of points that rays start from.
    listed: Option<Vec<u32>>,
}

/// A block of the rays of a site.
struct Block {
    site: usize,
    kind: Kind,
    /// The first lane.
    first: u32,
    turn: u32,
    /// Rays that are not answered yet.
    left: u64,
    /// The place of its bits, where some may wait.
    place: Option<u32>,
}

/// Strews the points of a plan.
pub(crate) struct Strewing<'a> {
    pub(crate) renderer: &'a mut Engine,
    pub(crate) plan: &'a Plan,
    pub(crate) shape: &'a Shape,
    pub(crate) stats: &'a mut Counters,
    /// Told how many rays are answered; says whether to go on.
    pub watch: &'a mut dyn FnMut(u64) -> bool,
    state: State,
}

#[derive(Default)]
struct State {
    sites: Vec<Site>,
    /// Those in which rays wait.
    blocks: Vec<Block>,
    /// Places for the bits of blocks, free ones.
    places: Vec<u32>,
    /// Of all.
    waiting_words: usize,
    pool: Pool,
    /// Which bricks were resident when no ray had been made that may wait.
    resident: Vec<bool>,
    /// What the executor has.
    at: Option<(usize, Kind)>,
    answered: u64,
    /// Of trials one in so many points is kept.
    one_in: u32,
    strewn: Strewn,
}

/// What a frame of its own is seen from.
fn view(frame: Frame, seed: u32) -> View {
    View { frame, params: Params { seed, ..Params::default() }, directions: Directions::default(), rays: None }
}

impl<'a> Strewing<'a> {
    /// Of a plan.
    pub fn new(
        renderer: &'a mut Engine,
        plan: &'a Plan,
        shape: &'a Shape,
        stats: &'a mut Counters,
        watch: &'a mut dyn FnMut(u64) -> bool,
    ) -> Self {
        let capacity = u64::from(renderer.size.0 * renderer.size.1);
        let points = u64::from(plan.settings.points) + plan.triangles;
        let trials = points * TRIAL_TURNS.len() as u64;
        let lanes = plan.tracing.lanes.clamp(1, plan.all_rays());
        let turns = u64::from(plan.all_rays().div_ceil(lanes));
        let blocks = (points * u64::from(lanes) * turns + trials).div_ceil(capacity);
        // The last blocks of groups are not full.
        let blocks = blocks + plan.groups.len() as u64 * (turns + TRIAL_TURNS.len() as u64);
        let places = (plan.tracing.pool / capacity).clamp(1, blocks);
        let state = State {
            places: (0..places as u32).rev().collect(),
            waiting_words: places as usize * capacity.div_ceil(32) as usize,
            one_in: trials.div_ceil(MOST_TRIAL_RAYS).max(1) as u32,
            resident: renderer.cache.resident_geometry(),
            ..State::default()
        };
        Self { renderer, plan, shape, stats, watch, state }
    }

    /// Lanes of a block.
    fn capacity(&self) -> u32 {
        self.renderer.size.0 * self.renderer.size.1
    }

    /// Strews, group by group, and traces all rays.
    ///
    /// # Errors
    /// A brick that cannot be read, the device's.
    pub fn run(mut self) -> Result<Strewn, ExecutorError> {
        let plan = self.plan;
        for group in &plan.groups {
            if !self.group(group)? {
                break;
            }
        }
        if !self.state.strewn.stopped {
            self.drain()?;
        }
        Ok(self.state.strewn)
    }

    /// Strews the points of cells that are made anew. `choose` is told how many rays each entry takes, and says which
    /// are made; what it said.
    ///
    /// # Errors
    /// A brick that cannot be read, the device's.
    pub fn renew(
        mut self,
        fresh: &Fresh,
        choose: impl FnOnce(&[u64]) -> Vec<bool>,
    ) -> Result<Vec<bool>, ExecutorError> {
        let shape = self.shape;
        let counts = |bounds: [DVec3; 2]| shape.cells_of(bounds).any(|cell| fresh.entry(cell as usize).is_some());
        let mut costs = vec![0u64; fresh.entries()];
        let mut found = Vec::new();
        for group in &self.plan.groups {
            let triangles = triangles(&self.renderer.scene, group, &self.plan.region, &counts).map_err(unread)?;
            if !triangles.is_empty() {
                let site = self.site(group.frame, triangles)?;
                found.push((site, self.points(site, &mut costs)?));
            }
        }
        let chosen = choose(&costs);
        for (site, points) in found {
            let listed: Vec<u32> =
                points.into_iter().filter(|(_, entry)| chosen[*entry]).map(|(side, _)| side).collect();
            if !listed.is_empty() {
                self.share(site, listed.len() as u32);
                self.state.sites[site].listed = Some(listed);
                self.blocks(site, Kind::Masks)?;
            }
        }
        self.drain()?;
        Ok(chosen)
    }

    /// The sides of points of a site from which rays are made, and the entries of their cells; adds how many rays these
    /// take.
    fn points(&mut self, site: usize, costs: &mut [u64]) -> Result<Vec<(u32, usize)>, ExecutorError> {
        // The executor is to know how many points there are.
        self.state.at = None;
        self.place(site, Kind::Masks)?;
        let Engine { executor, cache, .. } = &mut *self.renderer;
        let sides = if self.plan.settings.both { 2 } else { 1 } * self.state.sites[site].count;
        let mut found = Vec::new();
        for first in (0..sides).step_by(SIDES_AT_ONCE) {
            let count = (sides - first).min(SIDES_AT_ONCE as u32);
            kernels::give_tally(&mut **executor, &vec![0; 2 * count as usize])?;
            executor.run(PASS, &[kernels::points(first, count)], &cache.states)?;
            let tally = kernels::read_tally(&mut **executor)?;
            for (side, [entry, rays]) in (first..).zip(tally.as_chunks::<2>().0).filter(|(_, [_, rays])| *rays > 0) {
                costs[*entry as usize] += u64::from(*rays);
                found.push((side, *entry as usize));
            }
        }
        Ok(found)
    }

    /// Takes triangles and shares points out over them; the number of the site.
    fn site(&mut self, frame: Frame, triangles: Vec<DvfTriangle>) -> Result<usize, ExecutorError> {
        let site = self.state.sites.len();
        self.state.sites.push(Site { frame, triangles, count: 0, lanes: 1, listed: None });
        self.place(site, Kind::Masks)?;
        let count = kernels::read_sums(&mut *self.renderer.executor)?.last().map_or(0, |words| words[0]);
        self.state.sites[site].count = count;
        Ok(site)
    }

    /// Strews the points of a group; whether to go on.
    fn group(&mut self, group: &Group) -> Result<bool, ExecutorError> {
        let triangles = triangles(&self.renderer.scene, group, &self.plan.region, &|_| true).map_err(unread)?;
        if triangles.is_empty() {
            return Ok(true);
        }
        let kept: usize = self.state.sites.iter().map(|site| site.triangles.len()).sum();
        if kept + triangles.len() > MOST_KEPT && !self.make_room(None)? {
            return Ok(false);
        }
        let site = self.site(group.frame, triangles)?;
        let count = self.state.sites[site].count;
        if count > 0 {
            self.share(site, count);
            let kinds = [Some(Kind::Masks), self.plan.has_trials().then_some(Kind::Trial)];
            for kind in kinds.into_iter().flatten() {
                if !self.blocks(site, kind)? {
                    return Ok(false);
                }
            }
            self.state.strewn.points += u64::from(count);
        }
        if self.state.blocks.iter().all(|block| block.site != site) {
            self.state.sites[site].triangles = Vec::new();
        }
        Ok(true)
    }

    /// Shares the rays of each of so many points of a site out over lanes.
    fn share(&mut self, site: usize, points: u32) {
        // A block holds a point's lanes, and all lanes of a group can be counted.
        let most = self.plan.all_rays().min(self.capacity()).min(u32::MAX / points);
        self.state.sites[site].lanes = self.plan.tracing.lanes.min(most).max(1);
        self.state.at = None;
    }

    /// Has the executor take a site for rays of a kind.
    fn place(&mut self, site: usize, kind: Kind) -> Result<(), ExecutorError> {
        if self.state.at == Some((site, kind)) {
            return Ok(());
        }
        let Self { renderer, plan, shape, state, .. } = self;
        let Site { frame, triangles, count, lanes, listed } = &state.sites[site];
        let (settings, lanes) = match kind {
            Kind::Masks => (plan.settings, *lanes),
            Kind::Trial => {
                let seed = plan.settings.seed ^ TRIAL_SEED;
                (DvfSettings { seed, hammersley: false, ..plan.settings }, 1)
            }
        };
        let executor = &mut renderer.executor;
        executor.begin_frame(&view(*frame, settings.seed));
        let mut maps = plan.maps(shape, frame, &settings, lanes);
        maps.waiting_words = state.waiting_words;
        maps.give(&mut **executor)?;
        kernels::give_triangles(&mut **executor, triangles, *count)?;
        let counts = kernels::counts(triangles.len() as u32);
        executor.run(PASS, &counts, &renderer.cache.states)?;
        if let Some(listed) = listed {
            kernels::give_tally(&mut **executor, listed)?;
        }
        state.at = Some((site, kind));
        Ok(())
    }

    /// Makes all blocks of a kind; whether to go on.
    fn blocks(&mut self, site: usize, kind: Kind) -> Result<bool, ExecutorError> {
        let (settings, capacity) = (&self.plan.settings, self.capacity());
        let Site { count, lanes, ref listed, .. } = self.state.sites[site];
        let count = listed.as_ref().map_or(count, |listed| listed.len() as u32);
        let (lanes, turns): (u32, Vec<u32>) = match kind {
            Kind::Masks => (lanes, (0..self.plan.all_rays().div_ceil(lanes)).collect()),
            Kind::Trial => (1, TRIAL_TURNS.iter().map(|(n, of)| n * settings.rays / of).collect()),
        };
        let all = u64::from(count) * u64::from(lanes);
        for first in (0..all).step_by(capacity as usize) {
            for &turn in &turns {
                if self.state.places.is_empty() && !self.make_room(Some(site))? {
                    return Ok(false);
                }
                let left = u64::from(capacity).min(all - first);
                if !self.first(Block { site, kind, first: first as u32, turn, left, place: None })? {
                    return Ok(false);
                }
            }
        }
        Ok(true)
    }

    /// Makes a block and traces it over what is resident; whether to go on.
    fn first(&mut self, mut block: Block) -> Result<bool, ExecutorError> {
        self.place(block.site, block.kind)?;
        let (tracing, schedule) = (self.renderer.settings.tracing, self.renderer.settings.schedule);
        let make = kernels::rays(block.first, block.turn, None);
        let enters = block.kind == Kind::Masks;
        let words = self.words();
        let Engine { executor, cache, .. } = &mut *self.renderer;
        // Rays of points go everywhere: no tile of them agrees on what is near.
        if matches!(schedule, Schedule::Chc | Schedule::Demand | Schedule::Auto) {
            let (steps, may_wait) = Pool::first(cache);
            // There is a free one: room has been made.
            block.place = may_wait.then(|| self.state.places.pop()).flatten();
            let waiting = block.place.map(|place| place * words);
            let steps = [&[make], steps, &[kernels::write(waiting, enters)]].concat();
            let report = executor.run(PASS, &steps, &cache.states)?;
            cache.touch_geometry(&report.used, may_wait, self.stats);
            return self.traced(block, report, tracing.measure_needed);
        }
        schedule::trace(&mut self.renderer.tracer(PASS, &[], self.stats), schedule, &[make])?;
        let Engine { executor, cache, .. } = &mut *self.renderer;
        let report = executor.run(PASS, &[kernels::write(None, enters)], &cache.states)?;
        self.traced(block, report, false)
    }

    /// Words of the bits of a block.
    fn words(&self) -> u32 {
        self.capacity().div_ceil(32)
    }

    /// Takes what was traced of a block; whether to go on. `measure`: asks which bricks were needed.
    fn traced(&mut self, block: Block, report: Report, measure: bool) -> Result<bool, ExecutorError> {
        let Self { renderer, state, stats, .. } = self;
        let left = state.pool.note(&report);
        stats.add(report);
        if block.kind == Kind::Trial {
            let (rays, hits) = (renderer.executor.read_rays(PASS)?, renderer.executor.read_hits(PASS)?);
            let frame = &state.sites[block.site].frame;
            let points = block.first..;
            let kept = points.zip(rays.iter().zip(&hits)).filter(|(point, _)| point % state.one_in == 0);
            // Those that wait are ended before their start.
            let ended = kept.filter(|(_, (ray, hit))| ray.t_min <= ray.t_max && hit.t >= ray.t_min);
            state.strewn.trials.extend(ended.map(|(_, (ray, hit))| in_world(frame, ray, hit)));
        }
        if measure {
            renderer.tracer(PASS, &[], stats).measure_needed(&state.resident)?;
        }
        state.answered += block.left - left;
        if left > 0 {
            state.blocks.push(Block { left, ..block });
        } else {
            state.places.extend(block.place);
        }
        state.strewn.stopped = !(self.watch)(state.answered);
        Ok(!state.strewn.stopped)
    }

    /// Loads bricks until no ray waits; whether to go on.
    fn drain(&mut self) -> Result<bool, ExecutorError> {
        let measure = self.renderer.settings.tracing.measure_needed;
        let words = self.words();
        self.state.strewn.drains += u64::from(!self.state.blocks.is_empty());
        loop {
            let Self { renderer, state, stats, .. } = self;
            let Engine { executor, cache, .. } = &mut **renderer;
            if !state.pool.load(&mut **executor, cache, stats)? {
                return Ok(true);
            }
            for block in std::mem::take(&mut state.blocks) {
                self.place(block.site, block.kind)?;
                let waiting = block.place.map(|place| place * words);
                let make = kernels::rays(block.first, block.turn, waiting);
                let write = kernels::write(waiting, block.kind == Kind::Masks);
                let steps = [&[make], Pool::NEXT, &[write]].concat();
                let Engine { executor, cache, .. } = &mut *self.renderer;
                let report = executor.run(PASS, &steps, &cache.states)?;
                if !self.traced(block, report, measure)? {
                    return Ok(false);
                }
            }
        }
    }

    /// Drains the pool for more rays, those of `site` among them; whether to go on.
    fn make_room(&mut self, site: Option<usize>) -> Result<bool, ExecutorError> {
        if !self.drain()? {
            return Ok(false);
        }
        // Points of cells that are made anew have been found on all sites before.
        let are_done = self.plan.fresh.is_none();
        let sites = self.state.sites.iter_mut().enumerate().filter(|(other, _)| are_done && Some(*other) != site);
        sites.for_each(|(_, site)| site.triangles = Vec::new());
        self.renderer.cache.begin_pass(EFFECT, self.plan.frame);
        self.state.resident = self.renderer.cache.resident_geometry();
        Ok(true)
    }
}

/// Where a ray of a frame starts in the world, its direction, and whether it met anything.
fn in_world(frame: &Frame, ray: &Ray, hit: &Hit) -> Traced {
    let origin = DVec3::from_array(ray.origin.map(f64::from));
    (frame.origin + frame.unit * origin, ray.direction, hit.id != NONE)
}
