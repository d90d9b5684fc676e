//! Options of `--secondary df`.

use super::Tracing;
use crate::settings::{Rule, settings};

/// Look-ups of shadow rays (Zeng et al., §7).
const SHADOW_STEPS: u32 = 16;

settings! {
    /// How distance fields answer rays.
    pub struct Options {
        /// With --secondary df: cells of a distance field on each axis. One of 128 takes 4.6 MiB for each of up to six
        /// sizes of cells.
        size: u32 = 128, "--df-size CELLS", Rule::OneOf(&[32, 64, 128, 256]), "cells", Methods, Expert;
        /// With --secondary df: look-ups that a ray makes at most. One that has made them goes free, and `rays_capped`
        /// counts it. [default: 64 for `ao`, 16 for `shadow`]
        steps: Option<u32> = None, "--df-steps N", Rule::Whole(1, 1024), "", Methods, Expert;
        /// With --secondary df: cells by which rays start off their surface. Less than 0.87 more than --df-hit, and
        /// some surfaces shade themselves.
        lift: f64 = 1.5, "--df-lift CELLS", Rule::Real(0.0, 8.0), "cells", Methods, Expert;
        /// With --secondary df: distance to the middle of an occupied cell within which a ray hits. 0.5 is the face of
        /// a cell in a layer of them; more is darker.
        hit: f64 = 0.5, "--df-hit CELLS", Rule::Real(0.01, 8.0), "cells", Methods, Expert;
    }
}

impl Options {
    /// Look-ups of an occlusion ray at most.
    pub fn occlusion_steps(&self) -> u32 {
        self.steps.unwrap_or(Tracing::default().iterations)
    }

    /// Look-ups of a shadow ray at most.
    pub fn shadow_steps(&self) -> u32 {
        self.steps.unwrap_or(SHADOW_STEPS)
    }
}
