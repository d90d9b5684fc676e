//! The kernel of displacement fields, and the step that it is run by.

use super::twin::displacement_sift;
use crate::kernels;
use crate::kernels::layout::{
    DisplacementCarrier, DisplacementField, DisplacementNode, DisplacementOwn, DisplacementPosition,
};
use crate::kernels::table::{Family, FamilyBuffer};
use crate::schedule::{Own, Step};

kernels! {
    /// The kernel.
    static KERNELS, names;

    displacement_sift: "displacement/displacement_sift" Own [] |b, t| displacement_sift(b, t.buffers, t.own);
}

/// Number of the buffer of boxes over carriers.
pub const NODES: usize = 0;
/// Of carriers.
pub const CARRIERS: usize = 1;
/// Of fields.
pub const FIELDS: usize = 2;
/// Of positions.
pub const TABLE: usize = 3;
/// Of samples.
pub const CODES: usize = 4;
/// Of how many rays have asked a field.
pub const ASKED: usize = 5;

/// The kernel and its buffers.
pub static FAMILY: Family = Family {
    name: "displacement",
    what: "displacement fields",
    remedy: "give a smaller --displacement-memory",
    has_lamps: false,
    buffers: &[
        FamilyBuffer { name: "nodes", stride: size_of::<DisplacementNode>(), is_written: false },
        FamilyBuffer { name: "carriers", stride: size_of::<DisplacementCarrier>(), is_written: false },
        FamilyBuffer { name: "fields", stride: size_of::<DisplacementField>(), is_written: false },
        FamilyBuffer { name: "table", stride: size_of::<DisplacementPosition>(), is_written: false },
        FamilyBuffer { name: "codes", stride: 4, is_written: false },
        FamilyBuffer { name: "asked", stride: 4, is_written: true },
    ],
    kernels: KERNELS,
};

/// Answers the pass's rays: phase 3.
pub fn sift(own: &DisplacementOwn) -> Step {
    Own::new(names::displacement_sift, own).in_phase(2).into()
}
