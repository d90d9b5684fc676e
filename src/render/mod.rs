//! A frame, from camera to radiance: primary rays, attributes of what they hit, shadows, occlusion, bounces, shading.

mod capture;
mod effects;
mod frame;
mod light;
mod pass_record;
mod view;

pub use capture::{Captures, EffectError};
pub use effects::{Effects, Occlusion};

pub use frame::{FrameOutput, Pixels, RenderError, RenderSettings, Renderer, Schedule};
pub use light::{Light, RectangleLight};
pub use view::camera_view;
