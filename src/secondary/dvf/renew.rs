//! Fields of visibility in scenes in which something moves: cells that this concerns are made anew in every frame,
//! within a budget of rays.
//!
//! *Theory.* Günay and Akyüz (2025) make all of a field anew for every frame. A field that is told what has moved stays
//! right without ([`DvfField::marked`]), but has rays traced that it would answer. Of these, the ones in the cells that
//! the camera sees count.
//!
//! *What we changed.* Only cells in which primary hits of the frame lie are made anew, and in each only directions that
//! what moves concerns ([`Fresh`]). Which come first, and whether at all, is decided by counts: those with the most
//! primary hits, and only where what this saves is as much as it takes, weighed in rays traced meanwhile, as far as
//! hits and what the field answered before tell: a cell that is at rest for n frames more may take n times as much, so
//! that never more than about twice is spent what waiting would have cost (the ski rental: Karlin et al. 1988). So
//! pictures depend on the frame and on how many frames ago something moved last alone, never on time, cache or threads.
//!
//! *Practice.* What a cell takes is first expected from the numbers of triangles of bricks, so that neither is a brick
//! read nor a point looked at where that cannot pay ([`super::worth`]). Then rays are counted before a cell is
//! accepted: the budget is never exceeded. Rays of points are made, wait for bricks and are entered as those of a whole
//! field are ([`super::strew`]).

use super::maps::{DvfMaps, directions};
use super::plan::{DvfTracing, EFFECT, PASS, Plan, Renewal};
use super::source::{groups, groups_of_moved};
use super::strew::Strewing;
use super::worth::{Candidate, MADE, Worth};
use super::{Cells, Concerned, DvfField, DvfKept, DvfSettings, DvfUse, Fresh, kernels};
use crate::counters::Counters;
use crate::frame::{Engine, FrameRecords};
use crate::kernels::View;
use crate::schedule::ExecutorError;
use bricks::SceneFile;
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Share of the rays that are saved in cells of which nothing was known: of half of all directions, which lead above
/// surfaces, half are answered.
const NEW: f64 = 0.25;

/// A field with what has moved since it was made.
pub(crate) struct Marked {
    /// That answers rays.
    pub field: Arc<DvfField>,
    /// Where it was made.
    still: Arc<SceneFile>,
    /// Instances that stand elsewhere, ascending.
    displaced: Vec<u32>,
    /// What that concerns.
    concerned: Concerned,
    /// Cells made anew.
    pub renewed: BTreeSet<u32>,
    /// Frames rendered since.
    frames: u32,
}

impl Marked {
    pub fn new(field: &DvfField, still: &Arc<SceneFile>, displaced: &[u32], boxes: &[[DVec3; 2]]) -> Self {
        let concerned = field.concerned(boxes);
        Self {
            field: Arc::new(field.marked(&concerned)),
            still: still.clone(),
            displaced: displaced.to_vec(),
            concerned,
            renewed: BTreeSet::new(),
            frames: 0,
        }
    }
}

/// What the field answered before something moved, and how.
pub(crate) type Answers<'a> = (Option<&'a Arc<DvfField>>, DvfUse);

/// Makes cells of the field anew, where something has moved and primary hits of the frame, which are traced, lie.
///
/// # Errors
/// A brick that cannot be read, the device's.
pub(crate) fn renew(
    engine: &mut Engine,
    records: &mut FrameRecords,
    view: &View,
    renewal: &Renewal,
    marked: &mut Marked,
    answers: Answers,
) -> Result<(), ExecutorError> {
    if renewal.rays == 0 || !engine.draws_environment() {
        return Ok(());
    }
    let frame = records.frame();
    records.work(engine, EFFECT, |engine, stats| {
        let done = renew_cells(engine, frame, view, renewal, marked, answers, stats);
        marked.frames = marked.frames.saturating_add(1);
        done
    })
}

fn renew_cells(
    engine: &mut Engine,
    frame: u32,
    view: &View,
    renewal: &Renewal,
    marked: &mut Marked,
    answers: Answers,
    stats: &mut Counters,
) -> Result<(), ExecutorError> {
    let Renewal { kept, settings, .. } = renewal;
    let shape = kept.field.shape;
    let frames = f64::from(marked.frames) + f64::from(renewal.frames.max(1));
    let hits = frames * f64::from(engine.settings.samples);
    let candidates = candidates(engine, view, kept, marked, hits, answers)?;
    let all = candidates.len() as u64;
    stats.cells_left = all;
    let resident = engine.scene.resident();
    let still = groups(marked.still.resident(), &renewal.region);
    let groups = groups_of_moved(&still, resident, &renewal.region, &marked.displaced);
    let leaves: Vec<_> = groups.iter().flat_map(|group| group.boxes(resident)).collect();
    let Worth { candidates, read } = Worth::of(renewal, &leaves, candidates);
    if candidates.is_empty() {
        return Ok(());
    }
    let texels = candidates.iter().map(|candidate| (candidate.cell, &candidate.texels[..]));
    let fresh = Arc::new(Fresh::new(&shape, texels));
    let meets = |bounds: [DVec3; 2]| shape.cells_of(bounds).any(|cell| fresh.entry(cell as usize).is_some());
    let rests = groups.iter().map(|group| group.only(resident, |_, bounds| meets(bounds)));
    let plan = Plan {
        settings: DvfSettings { cells: Cells::Longest(1), ..*settings },
        tracing: DvfTracing { pool: renewal.tracing.pool.min(4 * renewal.rays), ..renewal.tracing },
        region: renewal.region.clone(),
        groups: rests.filter(|group| group.bricks() > 0).collect(),
        directions: Arc::new(directions(settings.rays)),
        areas: kept.areas,
        triangles: 0,
        fresh: Some(fresh.clone()),
        frame,
    };
    let empty = plan.maps(&shape, &view.frame, settings, 1);
    DvfMaps { is_new: true, ..empty }.give(&mut *engine.executor)?;
    let saves: Vec<f64> = candidates.iter().map(|candidate| candidate.saves).collect();
    let choose = |costs: &[u64]| within(renewal.rays.saturating_sub(read), costs, &saves);
    let chosen = Strewing::new(engine, &plan, &shape, stats, &mut |_| true).renew(&fresh, choose)?;
    let (met, _) = kernels::read_field(&mut *engine.executor)?;
    let (field, words) = (Arc::make_mut(&mut marked.field), shape.words());
    for (entry, met) in met.chunks_exact(words).enumerate().filter(|(entry, _)| chosen[*entry]) {
        fresh.enter(entry, met, kept, settings.dilate, field);
        marked.renewed.insert(fresh.cells()[entry]);
    }
    stats.cells_renewed = chosen.iter().filter(|is_chosen| **is_chosen).count() as u64;
    stats.cells_left = all - stats.cells_renewed;
    engine.executor.begin_frame(view);
    Ok(())
}

/// The cells in which primary hits of the frame lie and that what has moved concerns, but for those that are
/// renewed and those in which nothing would be saved: first those with the most hits, then by number. Each primary
/// hit stands for `hits` rays.
fn candidates(
    engine: &mut Engine,
    view: &View,
    kept: &DvfKept,
    marked: &Marked,
    hits: f64,
    (field, how): Answers,
) -> Result<Vec<Candidate>, ExecutorError> {
    DvfMaps::to_answer(&marked.field, &view.frame, DvfUse::default()).give(&mut *engine.executor)?;
    kernels::give_tally(&mut *engine.executor, &vec![0; kept.field.labels.len()])?;
    engine.executor.run(PASS, &[kernels::seen()], &engine.cache.states)?;
    let counts = kernels::read_tally(&mut *engine.executor)?;
    let is_open = |(cell, seen): &(u32, u32)| *seen > 0 && !marked.renewed.contains(cell);
    let candidate = |(cell, seen): (u32, u32)| {
        let texels = marked.concerned.texels(cell)?.to_vec();
        let mut candidate = Candidate { cell, seen, texels, saves: 0.0, takes: 0.0 };
        let answered = field.and_then(|field| field.answered(cell, &candidate.texels, how));
        candidate.saves = hits * f64::from(seen) * answered.unwrap_or(NEW * candidate.share());
        (candidate.saves > 0.0).then_some(candidate)
    };
    let mut all: Vec<Candidate> = (0..).zip(counts).filter(is_open).filter_map(candidate).collect();
    all.sort_by_key(|candidate| (Reverse(candidate.seen), candidate.cell));
    Ok(all)
}

/// Which of cells that take `costs` rays and save `saves` are made anew, in their order, for at most `rays` rays in
/// all: those that save more than they take.
fn within(rays: u64, costs: &[u64], saves: &[f64]) -> Vec<bool> {
    let mut left = rays;
    let takes = |(&cost, &saves): (&u64, &f64)| {
        let is_taken = cost <= left && MADE * cost as f64 <= saves;
        left -= if is_taken { cost } else { 0 };
        is_taken
    };
    costs.iter().zip(saves).map(takes).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_rays_are_taken_than_there_are_and_none_that_save_fewer() {
        assert_eq!(within(10, &[4, 7, 3, 3, 1], &[9.0 * MADE; 5]), [true, false, true, true, false]);
        assert_eq!(within(10, &[4, 0, 3], &[3.9 * MADE, 0.0, 3.0 * MADE]), [false, true, true]);
        assert_eq!(within(0, &[1, 0], &[9.0; 2]), [false, true]);
    }
}
