//! A frame, from camera to radiance: primary rays, attributes of what they hit, shadows, occlusion, bounces, shading,
//! the sum of the samples.

mod accumulate;
mod answers;
mod bands;
mod budget;
mod capture;
pub mod correct;
mod effects;
mod emissive;
pub mod engine;
mod environment;
mod guides;
pub mod half_rate;
mod light;
pub mod moved;
pub mod noise;
mod pass_record;
mod pixels;
mod place;
pub mod render;
pub mod secondary;
mod sky_model;
pub mod triangles;
pub mod view;
mod voxels;

pub use accumulate::{Accumulation, BATCH_SAMPLES};
pub use answers::{Answered, Answers};
pub use bands::Joint;
pub use budget::Budgeted;
pub use capture::{Captures, EffectError};
pub use effects::{Effects, Occlusion};
pub use emissive::{MOST_TRIANGLES, ShiningTriangles, emissive_triangles};
pub use engine::{Engine, FrameBudget, RenderSettings, Schedule};
pub use environment::{EnvironmentNotes, Equirectangular, environment, luminance};
pub use guides::{GuideReader, Guides, SampleNoise, Second, Seen};
pub use light::Light;
pub use moved::{InstanceMotion, Moved};
pub use pass_record::FrameRecords;
pub use pixels::{PixelState, Pixels};
pub use render::{FrameOutput, FrameWatch, RenderError, Renderer};
pub use secondary::{Displaced, Methods, Plan, Secondary};
pub use sky_model::SkyModel;
pub use view::camera_view;
