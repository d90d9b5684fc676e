//! Tests of the streaming modules, no device needed.

mod host_cache;
mod model;
mod residency;
mod scene_file;
mod trace;
mod workers;
