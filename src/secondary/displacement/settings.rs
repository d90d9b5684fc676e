//! Options of `--secondary displacement`.

use crate::kernels::layout::{
    DISPLACEMENT_ABSENT, DISPLACEMENT_AIMED, DISPLACEMENT_DIRECTIONS, DISPLACEMENT_POSITIONS,
};
use crate::settings::{Rule, names, settings};

names! {
    /// Against what fields answer.
    Against {
        /// Bricks that are not resident, and objects that are placed more than once.
        Absent = "absent",
        /// Everything that has a field, so that frames do not depend on the cache.
        All = "all",
    }
}

names! {
    /// Between which samples is weighed.
    Interpolation {
        /// None: the nearest is taken.
        None = "none",
        /// Positions on the sphere.
        Positions = "positions",
        /// Directions.
        Directions = "directions",
        /// Both.
        Both = "both",
    }
}

settings! {
    /// How displacement fields answer rays.
    pub struct Options {
        /// With --secondary displacement: bytes of fields that are kept on the device. Of more than these, fields are
        /// kept by the rays that asked them, times the bytes of geometry that they stand for.
        memory: u64 = 256 << 20, "--displacement-memory SIZE", Rule::Bytes(0), "bytes", Methods, Expert;
        /// With --secondary displacement: up to so many cells of positions a ray is traced from its start. A cell is
        /// the distance between two positions on a field's sphere: larger where a field has few.
        near: f64 = 2.0, "--displacement-near CELLS", Rule::Real(0.0, 64.0), "cells", Methods, Expert;
        /// With --secondary displacement: against what fields answer. `absent`: bricks that are not resident, and
        /// objects that are placed more than once. `all`: whatever has a field, so that frames are the same for every
        /// cache.
        against: Against = Against::Absent, "--displacement-against WHAT", Rule::Any, "", Methods, Expert;
        /// With --secondary displacement: between which samples of a field is weighed: none, positions, directions,
        /// both.
        interpolate: Interpolation = Interpolation::None, "--displacement-interpolate WHAT", Rule::Any, "", Methods,
            Expert;
    }
}

impl Interpolation {
    /// What the kernel is told.
    pub fn look(self) -> u32 {
        match self {
            Interpolation::None => 0,
            Interpolation::Positions => DISPLACEMENT_POSITIONS,
            Interpolation::Directions => DISPLACEMENT_DIRECTIONS,
            Interpolation::Both => DISPLACEMENT_POSITIONS | DISPLACEMENT_DIRECTIONS,
        }
    }
}

impl Options {
    /// How fields are asked.
    pub fn look(&self) -> u32 {
        let absent = if self.against == Against::Absent { DISPLACEMENT_ABSENT } else { 0 };
        self.interpolate.look() | absent | DISPLACEMENT_AIMED
    }
}
