//! What a field of visibility is made of, and how its rays are traced.

use super::maps::DvfMaps;
use super::source::{Group, Region};
use super::{Areas, Cells, DvfKept, DvfSettings, Fresh, Shape};
use crate::kernels::frame::Frame;
use crate::schedule::{ExecutorError, Lamp, Pass};
use std::sync::Arc;

/// The pass of the rays that make a field.
pub const EFFECT: &str = "dvf";

/// The pass that these rays lie in.
pub(crate) const PASS: Pass = Pass::Shadow(Lamp::Environment);

/// How the rays of a field are traced while it is made: shows in time and loads alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DvfTracing {
    /// Lanes over which the rays of a point are shared out.
    pub lanes: u32,
    /// Most rays of all blocks in which some wait for bricks, a bit each on the device; one block in any case.
    pub pool: u64,
}

impl DvfTracing {
    /// Over so many lanes, with room for 512M rays: 64 MB.
    pub fn over(lanes: u32) -> Self {
        Self { lanes, pool: 512_000_000 }
    }
}

/// What a field is made of.
pub(crate) struct Plan {
    pub settings: DvfSettings,
    pub tracing: DvfTracing,
    pub region: Region,
    pub groups: Vec<Group>,
    pub directions: Arc<Vec<[f32; 4]>>,
    pub areas: Areas,
    /// That meet the region.
    pub triangles: u64,
    /// Which cells are made; `None`: all.
    pub fresh: Option<Arc<Fresh>>,
    /// In which frame.
    pub frame: u32,
}

impl Plan {
    /// Rays of a point that lanes share, where cells are made anew those of one of its sides.
    pub fn all_rays(&self) -> u32 {
        if self.settings.both && self.fresh.is_none() { 2 * self.settings.rays } else { self.settings.rays }
    }

    /// A site of it as it is being made in `frame`, by so many lanes a point.
    pub fn maps(&self, shape: &Shape, frame: &Frame, settings: &DvfSettings, lanes: u32) -> DvfMaps {
        let maps = DvfMaps::to_make(shape, frame, settings, lanes, &self.areas, &self.directions);
        match &self.fresh {
            Some(fresh) => maps.of_cells(fresh),
            None => maps,
        }
    }

    /// Whether rays from other points try grids.
    pub fn has_trials(&self) -> bool {
        self.settings.cells == Cells::Auto
    }
}

/// How a field is kept up in a scene in which something moves.
#[derive(Clone, Debug)]
pub struct Renewal {
    /// The field as it was made.
    pub kept: Arc<DvfKept>,
    /// How it was made.
    pub settings: DvfSettings,
    /// Of what.
    pub region: Region,
    /// How rays are traced.
    pub tracing: DvfTracing,
    /// Most rays a frame; 0: no cell is made anew.
    pub rays: u64,
    /// A cell is made anew if that saves what it takes within so many frames like this one, 1 or more.
    pub frames: u32,
}

/// A brick that could not be read.
pub(crate) fn unread(error: bricks::Error) -> ExecutorError {
    ExecutorError::Device(format!("got no triangles: {error}"))
}
