//! Importing: features and defects on small files made here, the scene files of BRICKWALK_SCENES, mutated bytes.

mod defects;
mod features;
mod formats;
mod fuzz;
mod implicit;
mod instanced;
mod oracle;
mod reach;
mod scenes;
mod surfaces;
mod tiles;
mod writer;
