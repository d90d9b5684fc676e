//! Settings: everything that can be chosen about what renders, once, as plain data.
//!
//! [`Settings`] is a structure with a default. The table that declares it (`settings!`) also says what each setting
//! does, its unit, its range, its form on the command line and who needs it. The command line, settings files,
//! `--print-settings`, `docs/options.md` and `summary.json` are views of that table. A new setting is one row there.
//!
//! A method of `secondary/` declares its options in its own folder; here it is one line.

mod all;
mod declare;
pub mod file;
pub mod names;
pub mod page;
pub mod removed;
pub mod sizes;
mod types;
pub mod value;

#[cfg(test)]
mod tests;

pub use all::{Settings, TRACE};
pub use declare::{Entry, Field, Group, Heading, Level, SettingsError};
pub use sizes::{CacheSize, ImageSize};
pub use types::{Adapter, Direction, Effect, EffectList, Environment, Rectangle, Schedule, Secondary, Turn};
pub use value::{Lines, Plain, Rule, Value};

pub(crate) use declare::settings;
