//! The schedule `chc`: lists per tile, resident bricks first, then missing ones nearest first with a query before each
//! batch.

use super::{ExecutorError, Step, Tracer};

/// Traces the rays of a pass, after the steps in `first` have made them.
///
/// # Errors
/// What the executor says.
pub fn trace(t: &mut Tracer, first: &[Step]) -> Result<(), ExecutorError> {
    let resident_before = t.cache.resident_geometry();
    let on = &t.tracing.optimisations;
    let some_missing = !t.cache.states.all_geometry_resident();
    let resident_first = on.resident_first || !some_missing;
    let mut steps = first.to_vec();
    let is_short = on.root_walk && on.by_tile && on.front_to_back;
    steps.push(if is_short { Step::ShortLists } else { Step::Lists });
    if !on.front_to_back {
        steps.push(Step::SortByNumber);
    }
    if resident_first {
        steps.push(Step::IntersectResident);
    }
    if some_missing {
        steps.extend([Step::CullPairs { undone: !resident_first }, on.query(Step::IntersectBatch)]);
    }
    let report = t.run(&steps)?;
    if resident_first {
        t.cache.finish_resident(&report.used, some_missing, t.stats);
    }
    t.load_and_intersect(Step::IntersectBatch, report)?;
    t.measure_needed(&resident_before)
}
