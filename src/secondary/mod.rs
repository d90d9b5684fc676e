//! Approximate visibility: what stands for geometry that is not looked at, and how rays are answered by it.

mod choice;
#[cfg(feature = "lab")]
pub mod df;
pub mod displacement;
pub mod dvf;
pub mod occupancy;
pub mod roma;
pub mod rsm;

use crate::kernels::table::Family;

pub use choice::{EffectMethods, Method};

/// The kernels of all methods: what is compared on both executors.
pub static FAMILIES: &[&Family] = &[
    #[cfg(feature = "lab")]
    &df::kernels::FAMILY,
    &displacement::kernels::FAMILY,
    &dvf::kernels::FAMILY,
    &roma::kernels::FAMILY,
    &rsm::kernels::FAMILY,
];
