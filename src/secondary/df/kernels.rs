//! The kernels of distance fields, and the steps that they are run by.

use super::maps::DfMaps;
use super::twin::{df_trace, flood_distances, flood_seeds, halve_distances, jump_flood};
use super::{LEVELS, flood_steps};
use crate::kernels;
use crate::kernels::layout::{DfOwn, Level};
use crate::kernels::table::{Family, FamilyBuffer};
use crate::schedule::{Over, Own, Step};

kernels! {
    /// The kernels.
    static KERNELS, names;

    flood_seeds: "df/flood_seeds" Own [] |b, t| flood_seeds(b, t.buffers);
    jump_flood: "df/jump_flood" Own [] |b, t| jump_flood(b, t.buffers);
    flood_distances: "df/flood_distances" Own [] |b, t| flood_distances(b, t.buffers);
    halve_distances: "df/halve_distances" Own [] |b, t| halve_distances(b, t.buffers);
    df_trace: "df/df_trace" Own [] |b, t| df_trace(b, t.buffers, t.own, t.seen);
}

/// Number of the buffer of base maps in the frame.
pub const MAPS: usize = 0;
/// Of their bits.
pub const BOMS: usize = 1;
/// Of the distances of all fields, level by level: two f16 a word.
pub const DISTANCES: usize = 3;

/// The kernels and their buffers.
pub static FAMILY: Family = Family {
    name: "df",
    what: "distance fields",
    remedy: "give a smaller --df-size",
    has_lamps: false,
    buffers: &[
        FamilyBuffer { name: "levels", stride: size_of::<Level>(), is_written: false },
        FamilyBuffer { name: "boms", stride: 4, is_written: false },
        FamilyBuffer { name: "nearest", stride: 4, is_written: true },
        FamilyBuffer { name: "distances", stride: 4, is_written: true },
    ],
    kernels: KERNELS,
};

impl DfMaps {
    /// What all kernels are told of these fields.
    fn own(&self) -> DfOwn {
        DfOwn { cells: self.cells(), levels: self.levels.len() as u32, hit: self.hit, ..DfOwn::default() }
    }

    /// Makes the fields: phase 1.
    pub fn make(&self) -> Vec<Step> {
        (0..self.levels.len() as u32).flat_map(|level| self.make_level(level)).collect()
    }

    /// Makes the field of a base map.
    fn make_level(&self, level: u32) -> Vec<Step> {
        let own = DfOwn { level, ..self.own() };
        let cells = |mip: u32| (own.cells >> mip).pow(3);
        // A thread a cell, or two cells.
        let step = |kernel, own: DfOwn, count| Own::new(kernel, &own).over(Over::Elements(count)).in_phase(0).into();
        let mut all = vec![step(names::flood_seeds, own, cells(0))];
        let mut half = 0;
        for away in flood_steps(own.cells) {
            all.push(step(names::jump_flood, DfOwn { step: away, half, ..own }, cells(0)));
            half = 1 - half;
        }
        all.push(step(names::flood_distances, DfOwn { half, ..own }, cells(0) / 2));
        for mip in 1..LEVELS as u32 {
            all.push(step(names::halve_distances, DfOwn { mip, ..own }, cells(mip) / 2));
        }
        all
    }

    /// Answers the pass's rays, and counts them: phase 3. `steps`: look-ups of a ray at most; one that has made them
    /// goes free.
    pub fn trace(&self, steps: u32) -> Step {
        Own::new(names::df_trace, &DfOwn { steps, ..self.own() }).in_phase(2).into()
    }
}
