//! A frame, from camera to picture: primary rays, attributes of what they hit, shadows, occlusion, bounces, shading, the sum of the
//! samples, denoising, exposure and tone map.

mod accumulate;
mod capture;
pub mod denoise;
mod dvf;
mod dvf_renew;
mod dvf_source;
mod dvf_strew;
mod dvf_worth;
mod effects;
mod emissive;
mod environment;
mod exposure;
mod field;
mod frame;
mod handover;
mod light;
mod moved;
mod pass_record;
mod raster;
mod roma;
mod rsm;
mod sky_model;
mod tone_map;
mod triangles;
mod view;

pub use accumulate::{Accumulation, BATCH_SAMPLES};
pub use capture::{Captures, EffectError};
pub use dvf::{Dvf, DvfMade, DvfTracing, EFFECT as DVF_EFFECT, Region};
pub use dvf_renew::Renewal;
pub use effects::{Effects, Occlusion};
pub use emissive::{MOST_TRIANGLES, ShiningTriangles, emissive_triangles};
pub use environment::{EnvironmentNotes, Equirectangular, environment};
pub use exposure::{Exposure, MOST_STOPS, Meter};
pub use field::Field;
pub use frame::{FrameOutput, Pixels, RenderError, RenderSettings, Renderer, Schedule};
pub use handover::{Handover, Trust};
pub use light::Light;
pub use moved::{InstanceMotion, Moved};
pub use roma::Roma;
pub use rsm::Rsm;
pub use sky_model::SkyModel;
pub use tone_map::ToneMap;
pub use view::camera_view;
