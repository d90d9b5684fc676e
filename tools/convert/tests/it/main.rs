//! Importing and building: what input files become, and what scene files hold.

mod build;
mod import;
#[path = "../../../../tests/skip.rs"]
mod skip;
