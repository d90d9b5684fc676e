//! Which bricks a pass needs, and when they are loaded and intersected. Speaks to an [`Executor`], never to a device.
//!
//! *Theory*: CHC+RT (Mattausch et al. 2015): occlusion queries of screen tiles against nodes of the hierarchy decide what
//! must be intersected; hit distances are the depth buffer. *Changed*: tiles walk the top level by an interval test in
//! one dispatch; queries go ray by ray only where they decide a load; what is resident is intersected first; missing
//! bricks are loaded nearest first, a few at a time, with a fresh query before each batch.
//!
//! The invariant: hits persist while bricks come and go, a brick that is *done* has been intersected with every ray that
//! could hit it nearer than its hit at the time, and hits only move nearer. So no brick is loaded twice in a pass, and the
//! final hits are those of brute force whatever the cache holds.

pub mod attributes;
pub mod auto;
pub mod cache;
pub mod chc;
pub mod demand;
pub mod fronts;
mod multi_query;
pub mod optimisations;
mod pair_tree;
pub mod plain;
pub mod pool;
mod states;
mod types;

pub use optimisations::{Optimisation, Optimisations, PartOf};
pub use states::BrickStates;
pub use types::{
    Demand, Executor, ExecutorError, Lamp, Load, PairQuery, Pass, PassStats, Pilots, Query, Report, RomaPart, Shading,
    Sift, Step, TileDemand, Tracing,
};
