//! Runs the steps of a schedule as [`Optimisations::by_tile`] says: all selected leaves of a tile in one dispatch, or
//! one leaf a dispatch.

use super::{BrickStates, Executor, ExecutorError, Optimisations, Pass, Report, Step};
use crate::counters::Counters;

/// Most dispatches with one leaf a tile that go into a submission.
const MOST_SINGLE_LEAVES: usize = 24;

/// Runs `steps`. Without [`Optimisations::by_tile`] each intersection of selected leaves becomes dispatches of one leaf
/// a tile, and one round trip more, which says how many. What came back before the last submission is added to `stats`.
///
/// # Errors
/// What the executor says.
pub fn run(
    executor: &mut dyn Executor,
    pass: Pass,
    steps: &[Step],
    bricks: &BrickStates,
    optimisations: &Optimisations,
    stats: &mut Counters,
) -> Result<Report, ExecutorError> {
    if optimisations.by_tile {
        return executor.run(pass, steps, bricks);
    }
    let mut rest = Vec::new();
    let mut used = Vec::new();
    for &step in steps {
        let is_batch = match step {
            Step::IntersectResident => false,
            Step::IntersectBatch => true,
            other => {
                rest.push(other);
                continue;
            }
        };
        rest.push(if is_batch { Step::SelectBatch } else { Step::SelectResident });
        let report = executor.run(pass, &rest, bricks)?;
        let most = report.most_selected;
        used.extend(&report.used);
        stats.add(report);
        rest = (0..most).map(|leaf| Step::IntersectOne { leaf, is_batch }).collect();
        while rest.len() > MOST_SINGLE_LEAVES {
            let later = rest.split_off(MOST_SINGLE_LEAVES);
            let report = executor.run(pass, &rest, bricks)?;
            used.extend(&report.used);
            stats.add(report);
            rest = later;
        }
    }
    let mut report = if rest.is_empty() { Report::default() } else { executor.run(pass, &rest, bricks)? };
    report.used.append(&mut used);
    report.used.sort_unstable();
    report.used.dedup();
    Ok(report)
}
