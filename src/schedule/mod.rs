//! Which bricks a pass needs, and when they are loaded and intersected. Speaks to an [`Executor`], never to a device.
//!
//! *Theory*: CHC+RT (Mattausch et al. 2015): occlusion queries of screen tiles against nodes of the hierarchy decide
//! what must be intersected; hit distances are the depth buffer. *Changed*: tiles walk the top level by an interval
//! test in one dispatch; queries go ray by ray only where they decide a load; what is resident is intersected first;
//! missing bricks are loaded nearest first, a few at a time, with a fresh query before each batch.
//!
//! The invariant: hits persist while bricks come and go, a brick that is *done* has been intersected with every ray
//! that could hit it nearer than its hit at the time, and hits only move nearer. So no brick is loaded twice in a pass,
//! and the final hits are those of brute force whatever the cache holds.

pub mod attributes;
pub mod auto;
pub mod cache;
mod chc;
pub mod cut;
mod demand;
mod executor;
#[cfg(feature = "lab")]
pub mod fronts;
pub mod listed;
#[cfg(feature = "lab")]
mod multi_query;
pub mod optimisations;
#[cfg(feature = "lab")]
mod pair_tree;
mod pass;
pub mod plain;
pub mod pool;
mod report;
mod states;
mod step;
mod tracer;

pub use executor::{Executor, ExecutorError, Load, Tracing};
pub use optimisations::{Optimisation, Optimisations, PartOf};
pub use pass::{Lamp, Pass};
pub use report::{Demand, OWN_COUNTERS, Report, TileDemand};
pub use states::BrickStates;
pub use step::{Over, Own, PairQuery, Query, Shading, Step};
pub use tracer::Tracer;

use crate::settings::Schedule;

/// Traces the rays of a pass by a schedule, after the steps in `first` have made them. Rays that `auto` has not
/// measured go by `demand`.
///
/// # Errors
/// A brick that cannot be read, or the device's.
pub fn trace(t: &mut Tracer, schedule: Schedule, first: &[Step]) -> Result<(), ExecutorError> {
    let by = if schedule == Schedule::Auto { Schedule::Demand } else { schedule };
    t.stats.schedule.push(by.name());
    match by {
        Schedule::Chc => chc::trace(t, first),
        Schedule::Demand | Schedule::Auto => demand::trace(t, first),
        Schedule::Plain => plain::trace(t, Step::IntersectAll, first),
        #[cfg(feature = "lab")]
        Schedule::PlainBinary => plain::trace(t, Step::IntersectBinary, first),
    }
}
