//! The front door: open a scene, render frames, trace rays.

pub mod auto;
pub mod bands;
pub mod checkpoints;
pub mod device;
mod extent;
mod hidden;
pub mod left_out;
pub mod lighting;
mod live;
pub mod motion;
mod nodes;
mod open;
pub mod opened;
mod origin;
pub mod parts;
mod passed;
pub mod picture_bytes;
mod pictures;
pub mod renderer;
mod settings;
mod sight;
pub mod summary;
pub mod trace;
pub mod viewpoint;

pub use crate::output::npy::{Hit, Ray};
pub use extent::extent;
pub use nodes::{Named, SceneNode, find, nodes};
pub use open::{Frame, LeftOut, Session, Watch, developed, levelled};
pub use opened::{Opened, open_scene, open_unmapped};
pub use origin::{Origin, provenance};
pub use pictures::{Pictures, Preview};
pub use settings::{Settings, TRACE};
