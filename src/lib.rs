//! brickwalk ray traces scenes that do not fit in GPU memory, and walks a camera through them.
//!
#![doc = include_str!("../docs/session.svg")]
//!
//! # The model
//!
//! - A *scene* is converted once into *bricks*: subtrees of a BVH with their triangles, in one memory-mapped file.
//!   `brickwalk convert` and `brickwalk scene` write it.
//! - A [`Session`] opens a scene on a device, a GPU or the processor. It streams the bricks that rays need through a
//!   small cache. Whatever the cache holds, the picture is the same: its size changes time alone.
//! - [`Settings`] say what to render. Each has a default, its unit, range and meaning ([`settings`]), and a place in a
//!   settings file and on the command line.
//! - [`Session::frame`] makes a picture for a camera, and a record of what each pass did. [`Session::trace`] finds the
//!   closest hits of given rays.
//!
//! # A picture and a ray
//!
//! ```
//! use brickwalk::scene::Camera;
//! use brickwalk::session::Ray;
//! use brickwalk::settings::{Adapter, CacheSize, ImageSize};
//! use brickwalk::{Session, Settings};
//! use glam::DVec3;
//! # use brickwalk_convert::{build::{BuildSettings, build}, progress::Progress, source::Primitive};
//! # fn main() -> anyhow::Result<()> {
//! # let folder = tempfile::tempdir()?;
//! # let file = folder.path().join("floor.bricks");
//! # let positions = vec![[-9.0, 0.0, -9.0], [-9.0, 0.0, 9.0], [9.0, 0.0, 9.0], [9.0, 0.0, -9.0]];
//! # let floor = Primitive { positions, indices: vec![0, 1, 2, 0, 2, 3], ..Primitive::default() };
//! # build(brickwalk_scenes::one_mesh("floor", floor), &BuildSettings::default(), &file, &Progress::hidden())?;
//!
//! // `file` is what `brickwalk convert` or `brickwalk scene` wrote: here a floor at y = 0.
//! let settings = Settings {
//!     size: ImageSize { width: 64, height: 36 },
//!     cache: CacheSize::Percent(100.0),
//!     adapter: Adapter::Cpu,
//!     ..Settings::default()
//! };
//! let mut session = Session::open(&file, &settings)?;
//!
//! // A frame: its pixels, and a record of what each pass did.
//! let camera = Camera { position: DVec3::new(0.0, 2.0, 5.0), target: DVec3::ZERO, up: DVec3::Y, fov_y: 0.8 };
//! let frame = session.frame(&camera)?;
//! assert_eq!(frame.pixels.radiance.len(), 64 * 36);
//! assert_eq!(frame.records[0].pass, "primary");
//! frame.write_png(&file.with_extension("png"))?;
//!
//! // A ray, from a height of 3 straight down.
//! let down = Ray { origin: [0.5, 3.0, 0.0], direction: [0.0, -1.0, 0.0], t_min: 0.0, t_max: f64::INFINITY };
//! let hits = session.trace(&[down], false)?;
//! assert_eq!(hits[0].t, 3.0);
//! # Ok(())
//! # }
//! ```
//!
//! `examples/minimal.rs` is the same as a program that makes its scene itself.
//!
//! # Where things are
//!
//! Each module knows those above it: [`settings`] and [`scene`] are plain data; [`stream`] brings bricks to the device;
//! [`schedule`] decides which bricks a pass needs; [`mod@kernels`] run on the executors [`gpu`] and [`cpu`]; [`frame`]
//! makes a frame of passes; [`secondary`] has the approximations of secondary rays; [`session`] brings all together.
//! `ARCHITECTURE.md` is the tour of the house.
//!
//! # Features
//!
//! `cli` (default): the command line. `lab` (default): benchmarks and the selftest. Without them this is a library
//! alone.

// Compilers to come count the levels of wgpu's types, of which `Send` for mapped ranges is proved, up to this.
#![recursion_limit = "256"]

#[cfg(feature = "cli")]
pub mod cli;
pub mod counters;
pub mod cpu;
pub mod frame;
pub mod gpu;
pub mod kernels;
#[cfg(feature = "lab")]
pub mod lab;
pub mod math;
pub mod metrics;
pub mod output;
pub mod picture;
pub mod query;
#[cfg(feature = "lab")]
pub mod reference;
pub mod remote;
pub mod scene;
pub mod schedule;
pub mod secondary;
pub mod session;
pub mod settings;
#[cfg(test)]
#[path = "../tests/skip.rs"]
mod skip;
pub mod stream;
#[cfg(any(feature = "serve", feature = "viewer"))]
pub mod view;

pub use session::{Session, Settings};

/// The commit that this program was built from, `unknown` without git.
pub const COMMIT: &str = env!("BRICKWALK_COMMIT");
