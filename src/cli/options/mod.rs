//! Options of the commands.

pub mod args;
pub mod dvf_args;
pub mod field_args;
pub mod inputs;
pub mod light_args;
pub mod named;
pub mod optimisation_args;
pub mod picture_args;
pub mod removed;
pub mod roma_args;
pub mod scene_kind;
pub mod sizes;
