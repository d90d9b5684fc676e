//! The window: fly through a scene, and always know what is exact.
//!
//! | part | what it does |
//! | --- | --- |
//! | [`studio`] | a thread with a session: makes pictures of what is wished, answers questions |
//! | [`navigate`] | how a person moves the camera |
//! | [`viewer`] | both together, with all that a person sees and does, but without a window |
//! | `window` | the window, its panels, and how they get onto the screen; feature `viewer` |
//! | `serve` | the same behind a web page; feature `serve` |
//!
//! Rendering never holds input up: the studio has a thread of its own, and the latest wish counts. While the camera
//! moves a picture loads only what its budget allows ([`crate::frame::PixelState`]), and has as many pixels as there is
//! time for. When it rests, pictures become finer until they are what `walk` writes.

pub mod navigate;
#[cfg(feature = "serve")]
pub mod serve;
pub mod studio;
pub mod viewer;
#[cfg(feature = "viewer")]
pub mod window;
