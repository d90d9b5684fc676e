//! What a task keeps from ray to ray: its counts, and the stacks of traversals.

use super::walk_brick::{STACK_SIZE, Stack};
use crate::kernels::bound::{DemandTally, Tally};

/// What a task keeps from ray to ray.
pub struct Scratch {
    /// What it counts.
    pub tally: Tally,
    /// What its rays ask for.
    pub demand: DemandTally,
    /// The stack of a traversal.
    pub stack: Stack,
    /// That of a traversal over single nodes.
    pub nodes: Vec<u32>,
    /// The same, and where the ray enters them.
    pub entered: Vec<(u32, f32)>,
}

impl Default for Scratch {
    fn default() -> Self {
        let (tally, stack) = (Tally::default(), [Default::default(); STACK_SIZE]);
        Self { tally, demand: DemandTally::default(), stack, nodes: Vec::new(), entered: Vec::new() }
    }
}
