//! Tracing against leaves that are given, whatever else the scene has: no query, no list of the tiles' own.

use super::{ExecutorError, Step, Tracer};
use crate::stream::Item;

/// Traces the rays of a pass, after the steps in `first` have made them, against `lists`, leaf nodes of the
/// binary top level for each tile.
/// Their bricks are `bricks`, which are loaded a few at a time.
///
/// # Errors
/// What the executor says.
pub fn trace(t: &mut Tracer, first: &[Step], lists: &[Vec<u32>], bricks: &[u32]) -> Result<(), ExecutorError> {
    let report = t.executor.run(t.pass, first, &t.cache.states)?;
    t.stats.add(report);
    t.executor.set_lists(lists)?;
    let items: Vec<Item> = bricks.iter().map(|&brick| Item::geometry(brick)).collect();
    let mut rest = &items[..];
    while !rest.is_empty() {
        let count = t.cache.load(t.executor, rest, usize::MAX, t.stats)?;
        let batch: Vec<u32> = rest[..count].iter().map(|item| item.number).collect();
        t.cache.states.set_batch(&batch);
        let report = t.run(&[Step::IntersectBatch])?;
        t.stats.add(report);
        rest = &rest[count..];
    }
    Ok(())
}
