//! Fields of visibility made, by passes of their own.

use super::field::best;
use super::maps::{DvfMaps, directions, sum};
use super::plan::{DvfTracing, EFFECT, PASS, Plan, Renewal, unread};
use super::source::{Group, Region, groups, groups_of_moved, triangles};
use super::strew::{Strewing, Strewn, Traced};
use super::{
    Areas, Cells, DvfField, DvfKept, DvfSettings, DvfUse, MOST_TRIAL_BYTES, Shape, TRIAL_CELLS, Trial, kernels, mask,
};
use crate::counters::{Counters, Record};
use crate::frame::{Engine, FrameRecords, RenderError, Schedule};
use crate::kernels::frame::Frame;
use crate::kernels::layout::NONE;
use crate::scene::Camera;
use crate::schedule::{self, ExecutorError, Pass, Step};
use bricks::SceneFile;
use glam::DVec3;
use std::sync::Arc;
use std::time::Instant;

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
                bricks.extend(report.hit);
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
        // Rays of points go everywhere: no tile of them agrees on what is near.
        let by = Some(self.settings.schedule).filter(|by| *by != Schedule::Chc).unwrap_or(Schedule::Demand);
        schedule::trace(&mut self.tracer(pass, &[], stats), by, first)
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
