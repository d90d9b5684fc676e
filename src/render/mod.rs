//! A frame, from camera to picture: primary rays, attributes of what they hit, shadows, occlusion, bounces, shading, the sum of the
//! samples, exposure and tone map.

mod accumulate;
mod capture;
mod effects;
mod exposure;
mod frame;
mod light;
mod pass_record;
mod tone_map;
mod view;

pub use accumulate::{Accumulation, BATCH_SAMPLES};
pub use capture::{Captures, EffectError};
pub use effects::{Effects, Occlusion};
pub use exposure::{Exposure, MOST_STOPS, Meter};
pub use frame::{FrameOutput, Pixels, RenderError, RenderSettings, Renderer, Schedule};
pub use light::{Light, RectangleLight};
pub use tone_map::ToneMap;
pub use view::camera_view;
