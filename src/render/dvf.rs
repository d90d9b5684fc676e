//! Fields of visibility: how they are made, by passes of their own, and which rays of frames they answer.

use super::Renderer;
use super::dvf_source::{Group, groups, triangles};
use super::frame::{RenderError, Schedule};
use super::pass_record::FrameRecords;
use crate::kernel::dvf::{Areas, DvfMaps, directions, sum};
use crate::kernel::frame::Frame;
use crate::kernel::layout::{Hit, NONE, Params, Ray};
use crate::kernel::{Directions, FrameExecutor, View};
use crate::scene::Camera;
use crate::schedule::{ExecutorError, Lamp, Pass, PassStats, Step, demand, plain};
use crate::stats::Record;
use crate::visibility::dvf::field::best;
use crate::visibility::dvf::{Cells, DvfField, DvfSettings, DvfUse, MOST_TRIAL_BYTES, Shape, TRIAL_CELLS, Trial};
use glam::DVec3;
use std::sync::Arc;
use std::time::Instant;

pub use super::dvf_source::Region;

/// The pass of the rays that make a field.
pub const EFFECT: &str = "dvf";

/// The pass that these rays lie in.
const PASS: Pass = Pass::Shadow(Lamp::Environment);

/// Most rays by which grids are tried.
const MOST_TRIAL_RAYS: u64 = 1 << 20;
/// Seed of their points, beside that of the field's.
const TRIAL_SEED: u32 = 0x9e37_79b9;
/// Turns of the directions that they take, of [`DvfSettings::rays`].
const TRIAL_TURNS: [(u32, u32); 2] = [(1, 4), (3, 4)];

/// The field of visibility of a walk.
#[derive(Default)]
pub struct Dvf {
    field: Option<Arc<DvfField>>,
    /// The same, with what has moved since it was made; `None`: nothing has.
    marked: Option<Arc<DvfField>>,
    how: DvfUse,
    frame: Option<Frame>,
}

impl Dvf {
    /// Has `field` answer the rays to the environment.
    pub fn new(field: Arc<DvfField>, how: DvfUse) -> Self {
        Self { field: Some(field), how, ..Self::default() }
    }

    /// The field.
    pub fn field(&self) -> Option<&Arc<DvfField>> {
        self.field.as_ref()
    }

    /// Notes that what was in some of `boxes`, world units, when the field was made is in others of them now.
    pub fn scene_has_moved(&mut self, boxes: &[[DVec3; 2]]) {
        let marked = self.field.as_ref().filter(|_| !boxes.is_empty()).map(|field| Arc::new(field.with_movers(boxes)));
        self.marked = marked;
    }

    /// Begins a sample.
    pub fn begin(&mut self, view: &View) {
        self.frame = Some(view.frame);
    }

    /// Has the executor take the field for the rays of `pass`; the step that answers those which it tells. `None` where all are traced.
    ///
    /// # Errors
    /// The executor's.
    pub fn prepare(&self, executor: &mut dyn FrameExecutor, pass: Pass) -> Result<Option<Step>, ExecutorError> {
        let is_of_pass = matches!(pass, Pass::Shadow(Lamp::Environment) | Pass::BounceShadow(Lamp::Environment));
        let (Some(field), Some(frame), true) = (&self.field, &self.frame, is_of_pass) else { return Ok(None) };
        let how = DvfUse { paper: self.is_paper(pass), ..self.how };
        executor.set_dvf(&DvfMaps::to_answer(self.marked.as_ref().unwrap_or(field), frame, how))?;
        Ok(Some(Step::DvfSift))
    }

    /// Whether the rays of `pass` are made and light is added as in the paper.
    pub fn is_paper(&self, pass: Pass) -> bool {
        self.how.paper && self.field.is_some() && pass == Pass::Shadow(Lamp::Environment)
    }
}

/// A field that was made, and how.
#[derive(Clone, Debug)]
pub struct DvfMade {
    /// The field.
    pub field: DvfField,
    /// Points that rays started from.
    pub points: u64,
    /// Triangles that they lie on, parts of triangles that were cut apart each.
    pub triangles: u64,
    /// Bricks that triangles were read of, once for areas and once for points.
    pub bricks_read: u64,
    /// Grids that were tried, where the settings leave it open which it is to be.
    pub trials: Vec<Trial>,
    /// What the passes of its rays did, one record.
    pub record: Record,
    /// Seconds of the paper's compute shaders 1 to 3 (areas and their sums), 4 (points and rays, those of trials too) and 5 (widening and labels).
    pub seconds: [f64; 3],
}

/// What a field is made of.
struct Plan {
    settings: DvfSettings,
    region: Region,
    groups: Vec<Group>,
    directions: Arc<Vec<[f32; 4]>>,
    areas: Areas,
    lanes: u32,
}

/// What is done with the rays of a block once they are traced.
enum Sink<'a> {
    /// They are entered into masks.
    Masks,
    /// One in so many is kept: where it starts, its direction, whether it met anything.
    Trial { one_in: u64, rays: &'a mut Vec<(DVec3, [f32; 3], bool)> },
}

/// What a frame of its own is seen from.
fn view(frame: Frame, seed: u32) -> View {
    View { frame, params: Params { seed, surface_share: 1.0, ..Params::default() }, directions: Directions::default() }
}

/// A brick that could not be read.
fn unread(error: bricks::Error) -> ExecutorError {
    ExecutorError::Device(format!("got no triangles: {error}"))
}

impl Renderer {
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
            let view = super::camera_view(resident, camera, &self.light, &effects, self.size, 0, self.settings.seed);
            let frame = view.frame;
            self.executor.begin_frame(&view);
            self.cache.begin_pass(EFFECT, 0);
            self.trace_block(Pass::Primary, &[Step::Generate], &mut PassStats::default())?;
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

    /// Makes the field of a region. Its bits depend on scene, region and settings alone, not on the cache, the size of pictures, threads or the
    /// executor; `lanes` is over how many lanes the rays of a point are shared out. `watch` is told how many of about how many rays are traced, and says
    /// whether to go on.
    ///
    /// # Errors
    /// A brick that cannot be read, the device's, or `watch` said no.
    pub fn make_dvf(
        &mut self,
        settings: &DvfSettings,
        region: &Region,
        lanes: u32,
        watch: &mut dyn FnMut(u64, u64) -> bool,
    ) -> Result<DvfMade, RenderError> {
        let finest = match settings.cells {
            Cells::Longest(longest) => longest,
            Cells::Auto => finest_trial(region, settings.octahedral),
        };
        let shape = Shape::new(region.min, region.max, finest, settings.octahedral);
        let mut plan = Plan {
            settings: *settings,
            region: region.clone(),
            groups: groups(self.scene.resident(), region),
            directions: Arc::new(directions(settings.rays)),
            areas: Areas { scale: 1.0, total: 0.0 },
            lanes,
        };
        let place = Frame::near(self.scene.resident(), 0.5 * (region.min + region.max));
        let empty = DvfMaps {
            is_new: true,
            ..DvfMaps::to_make(&shape, &place, settings, lanes, &plan.areas, &plan.directions)
        };
        self.executor.set_dvf(&empty)?;
        let start = Instant::now();
        let triangles = self.sum_areas(&mut plan, &shape)?;
        let areas = start.elapsed().as_secs_f64();
        let mut records = FrameRecords::new(0);
        let mut points = 0;
        let mut stopped = false;
        records.pass(self, EFFECT, |r, stats| {
            let all_rays = if settings.both { 2 * settings.rays } else { settings.rays };
            let about = u64::from(settings.points.max(triangles as u32)) * u64::from(all_rays);
            let mut watch = |rays: u64| watch(rays, about);
            (points, stopped) = r.strew(&plan, &shape, &mut Sink::Masks, stats, &mut watch)?;
            Ok(())
        })?;
        if stopped {
            return Err(RenderError::Interrupted);
        }
        let mut trials = Vec::new();
        let mut field = DvfField { shape, masks: Vec::new(), labels: Vec::new() };
        if settings.cells == Cells::Auto {
            field.masks = self.executor.read_dvf()?.0;
            field = self.choose(&plan, field, &mut records, &mut trials)?;
            let chosen = Arc::new(field.clone());
            self.executor.set_dvf(&DvfMaps::to_answer(&chosen, &place, DvfUse::default()))?;
        }
        let before = start.elapsed().as_secs_f64();
        let finish = Step::DvfFinish { cells: field.shape.cells() as u32, dilate: settings.dilate };
        self.executor.run(PASS, &[finish], &self.cache.states)?;
        (field.masks, field.labels) = self.executor.read_dvf()?;
        let seconds = [areas, before - areas, start.elapsed().as_secs_f64() - before];
        // The masks on the device are no field's any more.
        self.executor.set_dvf(&empty)?;
        let bricks_read = 2 * plan.groups.iter().map(Group::bricks).sum::<u64>();
        let record = records.finish(self).pop().unwrap_or_default();
        Ok(DvfMade { field, points, triangles, bricks_read, trials, record, seconds })
    }

    /// Sums the areas of all triangles of the plan; their number.
    fn sum_areas(&mut self, plan: &mut Plan, shape: &Shape) -> Result<u64, ExecutorError> {
        let resident = self.scene.resident();
        let (unit, manifest) = (Frame::near(resident, DVec3::ZERO).unit, &resident.manifest);
        let diagonal = (DVec3::from_array(manifest.max) - DVec3::from_array(manifest.min)).length() / unit;
        let most = (diagonal * diagonal).max(f64::MIN_POSITIVE);
        plan.areas = Areas::of(plan.groups.iter().map(|group| group.triangles).sum(), most);
        let (mut total, mut count) = (0u64, 0);
        for group in &plan.groups {
            let frame = Frame::near(self.scene.resident(), group.middle);
            let triangles = triangles(&self.scene, group, &plan.region, &frame).map_err(unread)?;
            if triangles.is_empty() {
                continue;
            }
            let maps = DvfMaps::to_make(shape, &frame, &plan.settings, plan.lanes, &plan.areas, &plan.directions);
            self.executor.set_dvf(&maps)?;
            self.executor.set_dvf_triangles(&triangles, 0)?;
            let step = Step::DvfAreas { triangles: triangles.len() as u32 };
            self.executor.run(PASS, &[step], &self.cache.states)?;
            total += self.executor.read_dvf_sums()?.last().map_or(0, |&words| sum(words));
            count += triangles.len() as u64;
        }
        plan.areas = plan.areas.with_sum(total.max(1));
        Ok(count)
    }

    /// Strews the points of the plan, group by group, each in a frame of its own, and traces their rays; how many points, and whether `watch`
    /// said to stop.
    fn strew(
        &mut self,
        plan: &Plan,
        shape: &Shape,
        sink: &mut Sink,
        stats: &mut PassStats,
        watch: &mut dyn FnMut(u64) -> bool,
    ) -> Result<(u64, bool), ExecutorError> {
        let settings = &plan.settings;
        let all_rays = if settings.both { 2 * settings.rays } else { settings.rays };
        let capacity = self.size.0 * self.size.1;
        let mut points = 0;
        let mut traced = 0;
        for group in &plan.groups {
            let frame = Frame::near(self.scene.resident(), group.middle);
            let triangles = triangles(&self.scene, group, &plan.region, &frame).map_err(unread)?;
            if triangles.is_empty() {
                continue;
            }
            self.executor.begin_frame(&view(frame, settings.seed));
            let maps = DvfMaps::to_make(shape, &frame, settings, plan.lanes, &plan.areas, &plan.directions);
            self.executor.set_dvf(&maps)?;
            self.executor.set_dvf_triangles(&triangles, 0)?;
            let counts = Step::DvfCounts { triangles: triangles.len() as u32 };
            self.executor.run(PASS, &[counts], &self.cache.states)?;
            let count = self.executor.read_dvf_sums()?.last().map_or(0, |words| words[0]);
            if count == 0 {
                continue;
            }
            // A block holds a point's lanes, and all lanes of a group can be counted.
            let lanes = plan.lanes.min(all_rays).min(capacity).min(u32::MAX / count).max(1);
            let mut maps = maps;
            maps.grid.lanes = lanes;
            self.executor.set_dvf(&maps)?;
            self.executor.set_dvf_triangles(&triangles, count)?;
            let turns: Vec<u32> = match sink {
                Sink::Masks => (0..all_rays.div_ceil(lanes)).collect(),
                Sink::Trial { .. } => TRIAL_TURNS.iter().map(|(n, of)| n * settings.rays / of).collect(),
            };
            for first in (0..u64::from(count) * u64::from(lanes)).step_by(capacity as usize) {
                for &turn in &turns {
                    self.cache.begin_pass(EFFECT, 0);
                    self.trace_block(PASS, &[Step::DvfRays { first: first as u32, turn }], stats)?;
                    match sink {
                        Sink::Masks => stats.add(self.executor.run(PASS, &[Step::DvfWrite], &self.cache.states)?),
                        Sink::Trial { one_in, rays } => {
                            let (all, hits) = (self.executor.read_rays(PASS)?, self.executor.read_hits(PASS)?);
                            let kept = all.iter().zip(&hits).filter(|(ray, _)| ray.t_min <= ray.t_max);
                            rays.extend(kept.step_by(*one_in as usize).map(|(ray, hit)| in_world(&frame, ray, hit)));
                        }
                    }
                    traced += u64::from(capacity).min(u64::from(count) * u64::from(lanes) - first);
                    if !watch(traced) {
                        return Ok((points, true));
                    }
                }
            }
            points += u64::from(count);
        }
        Ok((points, false))
    }

    /// Brings the cells of `finest` together as trials of rays from other points find best.
    fn choose(
        &mut self,
        plan: &Plan,
        finest: DvfField,
        records: &mut FrameRecords,
        trials: &mut Vec<Trial>,
    ) -> Result<DvfField, ExecutorError> {
        let settings = DvfSettings { seed: plan.settings.seed ^ TRIAL_SEED, hammersley: false, ..plan.settings };
        let trial = Plan {
            settings,
            lanes: 1,
            region: plan.region.clone(),
            groups: plan.groups.clone(),
            directions: plan.directions.clone(),
            areas: plan.areas,
        };
        let triangles: u64 = plan.groups.iter().map(|group| group.triangles).sum();
        let expected = (triangles + u64::from(settings.points)) * TRIAL_TURNS.len() as u64;
        let mut rays = Vec::new();
        let mut sink = Sink::Trial { one_in: expected.div_ceil(MOST_TRIAL_RAYS), rays: &mut rays };
        records.more(self, EFFECT, |r, stats| {
            r.strew(&trial, &finest.shape, &mut sink, stats, &mut |_| true)?;
            Ok(())
        })?;
        let longest = finest.shape.size.into_iter().max().unwrap_or(1);
        let factors: Vec<u32> =
            (0..16).map(|log2| 1 << log2).take_while(|factor| longest.div_ceil(*factor) >= TRIAL_CELLS[1]).collect();
        for &factor in &factors {
            let mut tried = finest.coarser(factor);
            tried.finish(settings.dilate);
            trials.push(tried.trial(&rays, DvfUse::default()));
        }
        let factor = best(trials, MOST_WRONG).map_or(1, |i| factors[i]);
        Ok(finest.coarser(factor))
    }

    /// Traces rays that have nothing in common with those of a frame.
    fn trace_block(&mut self, pass: Pass, first: &[Step], stats: &mut PassStats) -> Result<(), ExecutorError> {
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

/// Most rays, of all, that a grid may answer wrongly: FLIP of Sponza stays below 0.002 by it (`benches/results/dvf.md`).
pub const MOST_WRONG: f64 = 0.001;

/// Cells along the longest side of the finest grid that is tried: as many as there is room for.
fn finest_trial(region: &Region, octahedral: u32) -> u32 {
    let fits = |longest: &u32| Shape::new(region.min, region.max, *longest, octahedral).bytes() <= MOST_TRIAL_BYTES;
    let tried = std::iter::successors(Some(TRIAL_CELLS[0]), |longest| Some(longest / 2));
    tried.take_while(|&longest| longest >= TRIAL_CELLS[1]).find(fits).unwrap_or(TRIAL_CELLS[1])
}

/// Where a ray of a frame starts in the world, its direction, and whether it met anything.
fn in_world(frame: &Frame, ray: &Ray, hit: &Hit) -> (DVec3, [f32; 3], bool) {
    let origin = DVec3::from_array(ray.origin.map(f64::from));
    (frame.origin + frame.unit * origin, ray.direction, hit.id != NONE)
}
