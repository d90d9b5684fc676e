//! Options of the commands. Those of what renders are views of [`crate::settings`].

pub mod args;
pub mod group_args;
pub mod inputs;
pub mod job_args;
pub mod query_args;
pub mod removed;
pub mod render_args;
pub mod scene_args;
pub mod scene_kind;
pub mod scene_name;
pub mod units;
