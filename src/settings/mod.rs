//! What settings are: values with a default, a unit, a range and a meaning, in groups.
//!
//! A group is declared once, as a table (`settings!`). The table says what each setting does, its unit, its range, its
//! form on the command line and who needs it. The command line, settings files, `--print-settings`, `docs/options.md`
//! and `options` in `summary.json` are views of that table. A new setting is one row there, and what reads it.
//!
//! The table of what renders is `session/settings.rs`. A method of `secondary/` has one in its own folder. Beside
//! `options`, `summary.json` has some settings as `settings`: `session/summary.rs` lists these by hand, as they are in
//! force, for reports and for older scripts.

mod declare;
pub mod file;
pub mod folder;
mod group;
pub mod names;
#[cfg(test)]
pub mod page;
pub mod removed;
pub mod sizes;
mod types;
pub mod value;

pub use group::{Entry, Field, Group, Heading, Level, SettingsError};
pub use sizes::{CacheSize, ErrorLimit, FrameBudget, HostCacheSize, ImageSize};
pub use types::{
    Adapter, Bounces, Direction, Effect, EffectList, Environment, Length, Plane, Policy, Rectangle, Schedule, Turn,
};
pub use value::{Lines, Plain, Rule, Value};

pub(crate) use declare::settings;
pub(crate) use names::names;
