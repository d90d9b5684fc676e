//! What an executor is told of bricks before a submission, and what its counters say after it.

use super::layout;
use crate::counters::{Counters, device_words};
use crate::schedule::{BrickStates, Demand, ExecutorError, Report, Step};

/// The words of the device that are counters, and which.
#[allow(clippy::type_complexity)]
const DEVICE_WORDS: &[(u32, fn(&mut Counters) -> &mut u64)] = device_words!();

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

/// Moves what `steps` say of bricks that nobody asks for out of the report's demand: the resident ones that were
/// intersected, and those that hold hits.
pub fn take_used(report: &mut Report, steps: &[Step], bricks: &BrickStates) {
    let asks_hits = steps.contains(&Step::QueryHits);
    if asks_hits {
        // No other query runs beside it, and what intersections note has no distance.
        report.hit = report.demand.iter().filter(|d| d.nearest == 0.0).map(|d| d.brick).collect();
    }
    if steps.iter().any(|step| step.is_intersection()) {
        // Queries in the same submission ask for missing bricks, or for what is not done beside a batch, which is; of
        // the others rays have noted the use.
        let undone = steps.iter().any(|step| matches!(step, Step::Query(query) if query.undone));
        let is_used = |brick: usize| bricks.geometry(brick).is_some() && (!undone || bricks.done(brick));
        report.used = report.demand.extract_if(.., |d| is_used(d.brick as usize)).map(|d| d.brick).collect();
    }
    if asks_hits {
        report.demand.clear();
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
    let mut counted = Counters { round_trips: 1, ..Counters::default() };
    for (word, counter) in DEVICE_WORDS {
        *counter(&mut counted) = count(*word);
    }
    Ok(Report {
        counters: counted,
        own: std::array::from_fn(|i| count(layout::COUNTER_PILOTS + i as u32)),
        demand: wanted.map(asked).collect(),
        list_entries: counters[layout::COUNTER_LIST_ENTRIES as usize],
        paths: counters[layout::COUNTER_PATHS as usize],
        most_selected: counters[layout::COUNTER_MOST_SELECTED as usize],
        ..Report::default()
    })
}

/// What is said where the rays of each tile that see each leaf cannot be counted.
pub fn too_many_pairs(tiles: u32, leaves: usize) -> ExecutorError {
    let text = format!(
        "cannot count which of {leaves} leaves each of {tiles} tiles sees; use a larger --tile, or no --query-threshold"
    );
    ExecutorError::Device(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counters::{COLUMNS, Source};

    #[test]
    fn what_kernels_count_arrives_under_its_name() {
        let mut words: Vec<u32> = (0..layout::COUNTERS as u32).map(|word| 100 + word).collect();
        words[layout::COUNTER_STACK_OVERFLOW as usize] = 0;
        let report = of_counters(&words, &[]).expect("no overflow");
        let traced = 100 + u64::from(layout::COUNTER_RAYS_TRACED);
        let not_finite = 100 + u64::from(layout::COUNTER_NON_FINITE);
        assert_eq!((report.counters.rays_traced, report.counters.non_finite), (traced, not_finite));
        let counted = report.counters.counted_by_device();
        let of_table = COLUMNS.iter().filter(|column| column.source == Source::Device);
        assert!(of_table.map(|column| column.name).eq(counted.iter().map(|(name, _)| *name)));
        let mut values: Vec<u64> = counted.iter().map(|(_, value)| *value).collect();
        values.sort_unstable();
        values.dedup();
        assert_eq!(values.len(), counted.len(), "each has a word of its own: {counted:?}");
        words[layout::COUNTER_STACK_OVERFLOW as usize] = 1;
        assert!(matches!(of_counters(&words, &[]), Err(ExecutorError::StackOverflow(1))));
    }
}
