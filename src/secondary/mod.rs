//! Approximate visibility: what stands for geometry that is not looked at, and how rays are answered by it.

#[cfg(feature = "lab")]
pub mod df;
pub mod dvf;
pub mod occupancy;
pub mod roma;
pub mod rsm;

use crate::kernels::table::Family;
use crate::settings::names;

names! {
    /// How secondary rays are answered.
    Method {
        /// By tracing them.
        Exact = "exact",
        /// By occupancy maps, those that these can answer.
        Roma = "roma",
        /// By occupancy maps where these find them free, else by tracing them.
        Auto = "auto",
        /// By distance fields, those that occupancy maps can answer: a baseline.
        #[cfg(feature = "lab")]
        Df = "df",
        /// By fields of visibility, those to the environment.
        Dvf = "dvf",
    } later &["displacement"]
}

/// The kernels of all methods: what is compared on both executors.
pub static FAMILIES: &[&Family] = &[
    #[cfg(feature = "lab")]
    &df::kernels::FAMILY,
    &dvf::kernels::FAMILY,
    &roma::kernels::FAMILY,
    &rsm::kernels::FAMILY,
];
