//! The scene file: its layout, what the writer writes, what the reader refuses.

mod access;
mod common;
mod corruption;
mod displacement;
mod exercise;
mod format;
mod golden;
mod levels;
mod malformed;
mod malformed_payloads;
mod occupancy;
mod random;
mod sources;
mod surfaces;
mod writer;
