//! Fields of visibility: how they are made, by passes of their own, and which rays of frames they answer.

use super::field::best;
use super::kernels;
use super::maps::{DvfMaps, directions, sum};
use super::mask;
use super::renew::{Marked, Renewal};
use super::source::{Group, groups, groups_of_moved, triangles};
use super::strew::{Strewing, Strewn, Traced};
use super::{Areas, Cells, DvfField, DvfKept, DvfSettings, DvfUse, Fresh, MOST_TRIAL_BYTES, Shape, TRIAL_CELLS, Trial};
use crate::counters::{Counters, Record};
use crate::frame::{Displaced, Engine, FrameRecords, Plan as RayPlan, RenderError, Schedule, Secondary};
use crate::kernels::View;
use crate::kernels::frame::Frame;
use crate::kernels::layout::NONE;
use crate::scene::Camera;
use crate::schedule::{ExecutorError, Lamp, Pass, Step, demand, plain};
use bricks::SceneFile;
use glam::DVec3;
use std::sync::Arc;
use std::time::Instant;

pub use super::source::Region;

/// The pass of the rays that make a field.
pub const EFFECT: &str = "dvf";

/// The pass that these rays lie in.
pub(crate) const PASS: Pass = Pass::Shadow(Lamp::Environment);

/// The field of visibility of a walk.
#[derive(Default)]
pub struct Dvf {
    pub(crate) field: Option<Arc<DvfField>>,
    /// The same, with what has moved since it was made; `None`: nothing has.
    pub(crate) marked: Option<Marked>,
    pub(crate) renewal: Option<Renewal>,
    pub(crate) how: DvfUse,
    frame: Option<Frame>,
    sample: u32,
}

impl Dvf {
    /// Has `field` answer the rays to the environment.
    pub fn new(field: Arc<DvfField>, how: DvfUse) -> Self {
        Self { field: Some(field), how, ..Self::default() }
    }

    /// Has cells that what moves concerns be made anew; the field is that of the renewal.
    pub fn renewed_by(self, renewal: Renewal) -> Self {
        Self { renewal: Some(renewal), ..self }
    }

    /// The field.
    pub fn field(&self) -> Option<&Arc<DvfField>> {
        self.field.as_ref()
    }

    /// The field with what has moved, where something has.
    pub fn moved_field(&self) -> Option<&DvfField> {
        self.marked.as_ref().map(|marked| &*marked.field)
    }

    /// The cells of it that have been made anew since, ascending.
    pub fn renewed_cells(&self) -> impl Iterator<Item = u32> {
        self.marked.iter().flat_map(|marked| marked.renewed.iter().copied())
    }

    /// Whether the rays of `pass` are made and light is added as in the paper.
    fn is_paper(&self, pass: Pass) -> bool {
        self.how.paper && self.field.is_some() && pass == Pass::Shadow(Lamp::Environment)
    }
}

impl Secondary for Dvf {
    fn begin(&mut self, _camera: &Camera, view: &View) {
        (self.frame, self.sample) = (Some(view.frame), view.params.sample);
    }

    fn after_camera_rays(
        &mut self,
        engine: &mut Engine,
        records: &mut FrameRecords,
        view: &View,
    ) -> Result<(), ExecutorError> {
        self.renew(engine, records, view)
    }

    fn plan(&mut self, engine: &mut Engine, pass: Pass, plan: &mut RayPlan) -> Result<(), ExecutorError> {
        let is_of_pass = matches!(pass, Pass::Shadow(Lamp::Environment) | Pass::BounceShadow(Lamp::Environment));
        let (Some(field), Some(frame), true) = (&self.field, &self.frame, is_of_pass) else { return Ok(()) };
        let how = DvfUse { paper: self.is_paper(pass), ..self.how };
        let field = self.marked.as_ref().map_or(field, |marked| &marked.field);
        DvfMaps::to_answer(field, frame, how).give(&mut *engine.executor)?;
        if how.paper {
            (plan.generate, plan.add) = (kernels::cosine(self.sample), kernels::light());
        }
        plan.before.push(kernels::sift());
        Ok(())
    }

    fn scene_has_moved(&mut self, displaced: &Displaced) {
        let Displaced { still, instances, boxes, .. } = displaced;
        let field = self.field.as_ref().filter(|_| !boxes.is_empty());
        self.marked = field.map(|field| Marked::new(field, still, instances, boxes));
    }
}

/// A field that was made, and how.
#[derive(Clone, Debug)]
pub struct DvfMade {
    /// The field.
    pub field: DvfField,
    /// As it is kept.
    pub kept: DvfKept,
    /// Points that rays started from.
    pub points: u64,
    /// Triangles that they lie on, parts of triangles that were cut apart each.
    pub triangles: u64,
    /// Bricks that triangles were read of, once for areas and once for points.
    pub bricks_read: u64,
    /// How many times bricks were loaded until no ray waited for any.
    pub drains: u64,
    /// Grids that were tried, where the settings leave it open which it is to be.
    pub trials: Vec<Trial>,
    /// What the passes of its rays did, one record.
    pub record: Record,
    /// Seconds of the paper's compute shaders 1 to 3 (areas and their sums), 4 (points and rays, those of trials too)
    /// and 5 (widening and labels).
    pub seconds: [f64; 3],
}

/// How the rays of a field are traced while it is made: shows in time and loads alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DvfTracing {
    /// Lanes over which the rays of a point are shared out.
    pub lanes: u32,
    /// Most rays of all blocks in which some wait for bricks, a bit each on the device; one block in any case.
    pub pool: u64,
}

impl DvfTracing {
    /// Over so many lanes, with room for 512M rays: 64 MB.
    pub fn over(lanes: u32) -> Self {
        Self { lanes, pool: 512_000_000 }
    }
}

/// What a field is made of.
pub(crate) struct Plan {
    pub settings: DvfSettings,
    pub tracing: DvfTracing,
    pub region: Region,
    pub groups: Vec<Group>,
    pub directions: Arc<Vec<[f32; 4]>>,
    pub areas: Areas,
    /// That meet the region.
    pub triangles: u64,
    /// Which cells are made; `None`: all.
    pub fresh: Option<Arc<Fresh>>,
    /// In which frame.
    pub frame: u32,
}

impl Plan {
    /// Rays of a point that lanes share, where cells are made anew those of one of its sides.
    pub fn all_rays(&self) -> u32 {
        if self.settings.both && self.fresh.is_none() { 2 * self.settings.rays } else { self.settings.rays }
    }

    /// A site of it as it is being made in `frame`, by so many lanes a point.
    pub fn maps(&self, shape: &Shape, frame: &Frame, settings: &DvfSettings, lanes: u32) -> DvfMaps {
        let maps = DvfMaps::to_make(shape, frame, settings, lanes, &self.areas, &self.directions);
        match &self.fresh {
            Some(fresh) => maps.of_cells(fresh),
            None => maps,
        }
    }

    /// Whether rays from other points try grids.
    pub fn has_trials(&self) -> bool {
        self.settings.cells == Cells::Auto
    }
}

/// A brick that could not be read.
pub(crate) fn unread(error: bricks::Error) -> ExecutorError {
    ExecutorError::Device(format!("got no triangles: {error}"))
}

impl Engine {
    /// What cameras see: the box of the points that their rays meet, and the bricks that these lie in.
    ///
    /// # Errors
    /// A brick that cannot be read, or the device's.
    pub fn visible_region(&mut self, cameras: &[Camera]) -> Result<Region, RenderError> {
        let mut region =
            Region { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY, bricks: Some(std::collections::BTreeSet::new()) };
        for camera in cameras {
            let effects = self.settings.effects;
            let resident = self.scene.resident();
            let view =
                crate::frame::camera_view(resident, camera, &self.light, &effects, self.size, 0, self.settings.seed);
            let frame = view.frame;
            self.executor.begin_frame(&view);
            self.cache.begin_pass(EFFECT, 0);
            self.trace_block(Pass::Primary, &[Step::Generate], &mut Counters::default())?;
            let report = self.executor.run(Pass::Primary, &[Step::QueryHits], &self.cache.states)?;
            if let Some(bricks) = &mut region.bricks {
                bricks.extend(report.demand.iter().map(|demand| demand.brick));
            }
            let (rays, hits) = (self.executor.read_rays(Pass::Primary)?, self.executor.read_hits(Pass::Primary)?);
            for (ray, hit) in rays.iter().zip(&hits).filter(|(_, hit)| hit.id != NONE) {
                let at = |k: usize| f64::from(ray.origin[k]) + f64::from(hit.t) * f64::from(ray.direction[k]);
                let point = frame.origin + frame.unit * DVec3::new(at(0), at(1), at(2));
                (region.min, region.max) = (region.min.min(point), region.max.max(point));
            }
        }
        Ok(if region.min.x <= region.max.x { region } else { Region::scene(self.scene.resident()) })
    }

    /// Makes the field of a region. Its bits depend on scene, region and settings alone, not on the cache, the size of
    /// pictures, threads, the executor or `tracing`. `watch` is told how many of about how many rays are answered, and
    /// says whether to go on.
    ///
    /// # Errors
    /// A brick that cannot be read, the device's, or `watch` said no.
    pub fn make_dvf(
        &mut self,
        settings: &DvfSettings,
        region: &Region,
        tracing: DvfTracing,
        watch: &mut dyn FnMut(u64, u64) -> bool,
    ) -> Result<DvfMade, RenderError> {
        let finest = match settings.cells {
            Cells::Longest(longest) => longest,
            Cells::Auto => finest_trial(region, settings.octahedral),
        };
        let shape = Shape::new(region.min, region.max, finest, settings.octahedral);
        let mut plan = Plan {
            settings: *settings,
            tracing,
            region: region.clone(),
            groups: groups(self.scene.resident(), region),
            directions: Arc::new(directions(settings.rays)),
            areas: Areas { scale: 1.0, total: 0.0 },
            triangles: 0,
            fresh: None,
            frame: 0,
        };
        let place = Frame::near(self.scene.resident(), 0.5 * (region.min + region.max));
        let empty = DvfMaps { is_new: true, ..plan.maps(&shape, &place, settings, tracing.lanes) };
        empty.give(&mut *self.executor)?;
        let start = Instant::now();
        self.sum_areas(&mut plan, &shape)?;
        let areas = start.elapsed().as_secs_f64();
        let (strewn, record) = self.strew(&plan, &shape, watch)?;
        let mut trials = Vec::new();
        let mut kept = DvfField { shape, masks: kernels::read_field(&mut *self.executor)?.0, labels: Vec::new() };
        if settings.cells == Cells::Auto {
            kept = choose(kept, &strewn.trials, settings.dilate, &mut trials);
            let chosen = Arc::new(kept.clone());
            DvfMaps::to_answer(&chosen, &place, DvfUse::default()).give(&mut *self.executor)?;
        }
        let before = start.elapsed().as_secs_f64();
        let finish = kernels::finish(kept.shape.cells() as u32, settings.dilate);
        self.executor.run(PASS, &finish, &self.cache.states)?;
        let (masks, labels) = kernels::read_field(&mut *self.executor)?;
        let seconds = [areas, before - areas, start.elapsed().as_secs_f64() - before];
        // The masks on the device are no field's any more.
        empty.give(&mut *self.executor)?;
        let field = DvfField { shape: kept.shape, masks, labels };
        kept.labels = vec![mask::UNKNOWN; field.labels.len()];
        kept.finish(false);
        let kept = DvfKept { field: kept, areas: plan.areas };
        let bricks_read = 2 * plan.groups.iter().map(Group::bricks).sum::<u64>();
        let Strewn { points, drains, .. } = strewn;
        Ok(DvfMade { field, kept, points, triangles: plan.triangles, bricks_read, drains, trials, record, seconds })
    }

    /// Makes all of the field of a renewal for the scene as it stands now, some of whose instances stand elsewhere than
    /// in `still`, in which it was made: what each of its cells is that is made anew.
    ///
    /// # Errors
    /// A brick that cannot be read, the device's.
    pub fn remake_dvf(&mut self, renewal: &Renewal, still: &SceneFile) -> Result<DvfField, RenderError> {
        let Renewal { kept, settings, region, tracing, .. } = renewal;
        let (shape, resident) = (kept.field.shape, self.scene.resident());
        let displaced = crate::frame::moved::displaced(still.resident(), resident);
        let plan = Plan {
            settings: DvfSettings { cells: Cells::Longest(1), ..*settings },
            tracing: *tracing,
            region: region.clone(),
            groups: groups_of_moved(&groups(still.resident(), region), resident, region, &displaced),
            directions: Arc::new(directions(settings.rays)),
            areas: kept.areas,
            triangles: 0,
            fresh: None,
            frame: 0,
        };
        let place = Frame::near(resident, 0.5 * (region.min + region.max));
        DvfMaps { is_new: true, ..plan.maps(&shape, &place, settings, 1) }.give(&mut *self.executor)?;
        self.strew(&plan, &shape, &mut |_, _| true)?;
        let finish = kernels::finish(shape.cells() as u32, settings.dilate);
        self.executor.run(PASS, &finish, &self.cache.states)?;
        let (masks, labels) = kernels::read_field(&mut *self.executor)?;
        Ok(DvfField { shape, masks, labels })
    }

    /// Strews the points of a plan, traces their rays and enters them; what that did.
    fn strew(
        &mut self,
        plan: &Plan,
        shape: &Shape,
        watch: &mut dyn FnMut(u64, u64) -> bool,
    ) -> Result<(Strewn, Record), RenderError> {
        let mut records = FrameRecords::new(plan.frame);
        let mut strewn = Strewn::default();
        records.work(self, EFFECT, |r, stats| {
            let about = u64::from(plan.settings.points).max(plan.triangles) * u64::from(plan.all_rays());
            let mut watch = |rays: u64| watch(rays, about);
            strewn = Strewing::new(r, plan, shape, stats, &mut watch).run()?;
            Ok(())
        })?;
        if strewn.stopped {
            return Err(RenderError::Interrupted);
        }
        Ok((strewn, records.finish(self).pop().unwrap_or_default()))
    }

    /// Sums the areas of all triangles of the plan, and counts them.
    fn sum_areas(&mut self, plan: &mut Plan, shape: &Shape) -> Result<(), ExecutorError> {
        let resident = self.scene.resident();
        let (unit, manifest) = (Frame::near(resident, DVec3::ZERO).unit, &resident.manifest);
        let diagonal = (DVec3::from_array(manifest.max) - DVec3::from_array(manifest.min)).length() / unit;
        let most = (diagonal * diagonal).max(f64::MIN_POSITIVE);
        plan.areas = Areas::of(plan.groups.iter().map(|group| group.triangles).sum(), most);
        let (mut total, mut count) = (0u64, 0);
        for group in &plan.groups {
            let triangles = triangles(&self.scene, group, &plan.region, &|_| true).map_err(unread)?;
            if triangles.is_empty() {
                continue;
            }
            plan.maps(shape, &group.frame, &plan.settings, 1).give(&mut *self.executor)?;
            kernels::give_triangles(&mut *self.executor, &triangles, 0)?;
            let steps = kernels::areas(triangles.len() as u32);
            self.executor.run(PASS, &steps, &self.cache.states)?;
            total += kernels::read_sums(&mut *self.executor)?.last().map_or(0, |&words| sum(words));
            count += triangles.len() as u64;
        }
        plan.areas = plan.areas.with_sum(total.max(1));
        plan.triangles = count;
        Ok(())
    }

    /// Traces rays that have nothing in common with those of a frame.
    fn trace_block(&mut self, pass: Pass, first: &[Step], stats: &mut Counters) -> Result<(), ExecutorError> {
        let (executor, cache) = (&mut *self.executor, &mut self.cache);
        let trace = match self.settings.schedule {
            Schedule::Plain => plain::trace,
            Schedule::PlainBinary => plain::trace_binary,
            // Rays of points go everywhere: no tile of them agrees on what is near.
            Schedule::Chc | Schedule::Demand | Schedule::Auto => demand::trace,
        };
        trace(executor, cache, pass, first, &self.settings.tracing, stats)
    }
}

/// Most rays, of all, that a grid may answer wrongly: FLIP of Sponza stays below 0.002 by it
/// (`docs/results/dvf.md`).
pub const MOST_WRONG: f64 = 0.001;

/// Cells along the longest side of the finest grid that is tried: as many as there is room for.
fn finest_trial(region: &Region, octahedral: u32) -> u32 {
    let fits = |longest: &u32| Shape::new(region.min, region.max, *longest, octahedral).bytes() <= MOST_TRIAL_BYTES;
    let tried = std::iter::successors(Some(TRIAL_CELLS[0]), |longest| Some(longest / 2));
    tried.take_while(|&longest| longest >= TRIAL_CELLS[1]).find(fits).unwrap_or(TRIAL_CELLS[1])
}

/// Brings the cells of `finest` together as trials of rays from other points find best.
fn choose(finest: DvfField, rays: &[Traced], dilate: bool, trials: &mut Vec<Trial>) -> DvfField {
    let longest = finest.shape.size.into_iter().max().unwrap_or(1);
    let factors: Vec<u32> =
        (0..16).map(|log2| 1 << log2).take_while(|factor| longest.div_ceil(*factor) >= TRIAL_CELLS[1]).collect();
    for &factor in &factors {
        let mut tried = finest.coarser(factor);
        tried.finish(dilate);
        trials.push(tried.trial(rays, DvfUse::default()));
    }
    let factor = best(trials, MOST_WRONG).map_or(1, |i| factors[i]);
    finest.coarser(factor)
}
