//! Approximate visibility: what stands for geometry that is not looked at, and how rays are answered by it.

pub mod df;
pub mod dvf;
pub mod occupancy;
pub mod roma;
pub mod rsm;

use crate::kernels::table::Family;

/// The kernels of all methods: what is compared on both executors.
pub static FAMILIES: [&Family; 4] =
    [&df::kernels::FAMILY, &dvf::kernels::FAMILY, &roma::kernels::FAMILY, &rsm::kernels::FAMILY];
