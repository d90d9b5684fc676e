//! What an executor is told of bricks before a submission, and what its counters say after it.

use super::layout;
use crate::schedule::{BrickStates, Demand, ExecutorError, Report, Step};

/// Where every brick lies and its part in the pass.
pub fn slots(bricks: &BrickStates) -> Vec<layout::Slot> {
    let bit = |set: bool, bit: u32| if set { bit } else { 0 };
    let slot = |brick| {
        let geometry = bricks.geometry(brick);
        let attributes = bricks.attributes(brick);
        layout::Slot {
            geometry_page: geometry.map_or(0, |s| s.page),
            geometry_offset: geometry.map_or(0, |s| s.offset / 16),
            attributes_page: attributes.map_or(0, |s| s.page),
            attributes_offset: attributes.map_or(0, |s| s.offset / 16),
            state: bit(geometry.is_some(), layout::STATE_GEOMETRY)
                | bit(bricks.done(brick), layout::STATE_DONE)
                | bit(bricks.batch(brick), layout::STATE_BATCH)
                | bit(attributes.is_some(), layout::STATE_ATTRIBUTES),
            ..Default::default()
        }
    };
    (0..bricks.len()).map(slot).collect()
}

/// Moves the resident bricks that `steps` intersected from the report's demand to those used.
pub fn take_used(report: &mut Report, steps: &[Step], bricks: &BrickStates) {
    if steps.iter().any(|step| step.is_intersection()) {
        // Queries in the same submission ask for missing bricks, or for what is not done beside a batch, which is; of
        // the others rays have noted the use.
        let undone = steps.iter().any(|step| matches!(step, Step::Query(query) if query.undone));
        let is_used = |brick: usize| bricks.geometry(brick).is_some() && (!undone || bricks.done(brick));
        report.used = report.demand.extract_if(.., |d| is_used(d.brick as usize)).map(|d| d.brick).collect();
    }
}

/// The report of one submission from its counters and the demand of every brick.
///
/// # Errors
/// A traversal stack overflowed.
pub fn of_counters(counters: &[u32], demand: &[layout::Demand]) -> Result<Report, ExecutorError> {
    let count = |i: u32| u64::from(counters[i as usize]);
    if counters[layout::COUNTER_STACK_OVERFLOW as usize] > 0 {
        return Err(ExecutorError::StackOverflow(counters[layout::COUNTER_STACK_OVERFLOW as usize]));
    }
    let wanted = demand.iter().enumerate().filter(|(_, d)| d.rays > 0);
    let asked = |(brick, d): (usize, &layout::Demand)| Demand {
        brick: brick as u32,
        rays: d.rays,
        nearest: f32::from_bits(d.nearest),
        next: d.next,
    };
    Ok(Report {
        round_trips: 1,
        rays_capped: count(layout::COUNTER_ROMA_CAPPED) + count(layout::COUNTER_FIELD_CAPPED),
        own: std::array::from_fn(|i| count(layout::COUNTER_PILOTS + i as u32)),
        demand: wanted.map(asked).collect(),
        tiles: Vec::new(),
        used: Vec::new(),
        list_entries: counters[layout::COUNTER_LIST_ENTRIES as usize],
        pairs_tested: count(layout::COUNTER_PAIRS_TESTED),
        pairs_culled: count(layout::COUNTER_PAIRS_CULLED),
        pairs_visible: count(layout::COUNTER_PAIRS_VISIBLE),
        pairs_invisible: count(layout::COUNTER_PAIRS_INVISIBLE),
        pairs_intersected: count(layout::COUNTER_PAIRS_INTERSECTED),
        most_selected: counters[layout::COUNTER_MOST_SELECTED as usize],
        tiles_from_root: count(layout::COUNTER_TILES_FROM_ROOT),
        pairs_front_to_back: count(layout::COUNTER_FRONT_TO_BACK),
        tile_batches: count(layout::COUNTER_TILE_BATCHES),
        tile_batch_leaves: count(layout::COUNTER_TILE_BATCH_LEAVES),
        rays: count(layout::COUNTER_RAYS),
        rays_answered: count(layout::COUNTER_DVF_ANSWERED),
        nodes: count(layout::COUNTER_NODES),
        triangles: count(layout::COUNTER_TRIANGLES),
        non_finite: count(layout::COUNTER_NON_FINITE),
        unresolved: count(layout::COUNTER_UNRESOLVED),
        ms_phases: [0.0; 3],
        pair_rays: Vec::new(),
        queries_tightened: count(layout::COUNTER_TIGHTENED),
    })
}

/// What is said where the rays of each tile that see each leaf cannot be counted.
pub fn too_many_pairs(tiles: u32, leaves: usize) -> ExecutorError {
    let text = format!(
        "cannot count which of {leaves} leaves each of {tiles} tiles sees; use a larger --tile, or no --query-threshold"
    );
    ExecutorError::Device(text)
}
