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

/// The kernels of all methods, those that denoise, and those that stop pixels: what is compared on both executors
/// beside those that all frames take.
pub static FAMILIES: &[&Family] = &[
    #[cfg(feature = "lab")]
    &df::kernels::FAMILY,
    &displacement::kernels::FAMILY,
    &crate::kernels::denoise::FAMILY,
    &crate::kernels::noise::FAMILY,
    &dvf::kernels::FAMILY,
    &roma::kernels::FAMILY,
    &rsm::kernels::FAMILY,
];
