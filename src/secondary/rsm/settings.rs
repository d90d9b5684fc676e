//! Options of reflective shadow maps, which light what diffuse rays meet by `--secondary roma`.

use super::RsmSettings;
use crate::settings::{Rule, settings};

settings! {
    /// How reflective shadow maps are made.
    pub struct Options {
        /// With --secondary roma and `diffuse`: texels of the longer side of the maps of what lamps light. A map of the
        /// sun covers what a map of cells does; a point has six of half as many on both sides.
        size: u32 = 256, "--rsm-size TEXELS", Rule::Whole(32, 2048), "texels", Methods, Expert;
        /// With --secondary roma and `diffuse`: points, spots and distant lights that have such maps, the strongest.
        /// What others light does not light diffuse rays. The sun has maps besides.
        lamps: u32 = 8, "--rsm-lamps N", Rule::Whole(0, 64), "", Methods, Expert;
    }
}

impl Options {
    /// How maps are made.
    pub fn settings(&self) -> RsmSettings {
        RsmSettings { size: self.size, lamps: self.lamps }
    }
}
