//! Trials: hostile inputs and kills, each of which is repeated from its kind and a number. `docs/trials.md` says how to
//! run them and what each kind promises.
//!
//! A trial ([`kind::Kind::trial`]) runs in a worker process ([`worker`]) that catches panics and counts memory. Who
//! watches it ([`mod@slice`]) ends one that hangs and follows up one that dies. A [`campaign`] shares time out over
//! kinds and keeps a [`tally`].
//!
//! A new kind is a file beside those of its sort (`inputs/`, `kills/`, `faults/`, `differences/`, `device`, `threads/`)
//! and a line in [`kinds`].
#![cfg(unix)]

pub mod board;
pub mod campaign;
pub mod command;
pub mod device;
pub mod differences;
pub mod faults;
pub mod inputs;
pub mod kills;
pub mod kind;
pub mod kinds;
pub mod memory;
pub mod mutate;
pub mod own;
pub mod page;
#[cfg(feature = "planted")]
pub mod planted;
pub mod random;
pub mod scenes;
mod settings;
pub mod slice;
mod stream;
pub mod tally;
pub mod threads;
pub mod worker;
