//! A frame, from camera to radiance: primary rays, attributes of what they hit, sun shadow, shading.

mod frame;
mod light;
mod view;

pub use frame::{FrameOutput, Pixels, RenderError, RenderSettings, Renderer, Schedule};
pub use light::Light;
pub use view::camera_view;
