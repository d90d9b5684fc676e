//! How much is measured.

use crate::settings::sizes::human_count;
use crate::settings::{ImageSize, Schedule};

/// What the options come to.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Triangles of the city, the plant and the terrain.
    pub triangles: u64,
    /// Triangles of the large city, where it is measured.
    pub large: Option<u64>,
    /// Copies of the plant, ascending, whose working sets are compared.
    pub copies: [u32; 3],
    /// Width and height in pixels.
    pub size: ImageSize,
    /// Frames of a walk.
    pub frames: u32,
    /// Walks of each way that are timed.
    pub repeat: u32,
    /// Samples of pictures that others are compared with.
    pub samples: u32,
    /// Samples of the frames of which popping is measured.
    pub popping_samples: u32,
    /// Edge of a tile, pixels.
    pub tile: u32,
    /// The schedule.
    pub schedule: Schedule,
}

impl Settings {
    /// Conditions of the targets that these settings do not meet.
    pub fn unmet(&self) -> Vec<String> {
        let Self { triangles, large, size: ImageSize { width, height }, samples, .. } = *self;
        let mut rules = vec![
            (triangles >= 12_000_000, format!("scenes of {} triangles, not 12,000,000", human_count(triangles))),
            ((width, height) == (640, 360), format!("{width}x{height} pixels, not 640x360")),
            (samples >= 256, format!("references of {samples} samples, not 256")),
        ];
        if let Some(large) = large {
            let text = format!("a large city of {} triangles, not 139,000,000", human_count(large));
            rules.push((large >= 139_000_000, text));
        }
        rules.into_iter().filter(|(is_met, _)| !is_met).map(|(_, text)| text).collect()
    }
}
