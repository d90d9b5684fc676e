//! Options of how radiance becomes pictures, and pictures a video.

use super::args::ranged;
use super::named::unknown;
use crate::picture::exposure::{Exposure, MOST_STOPS};
use crate::picture::tone_map::ToneMap;
use clap::Args;
use std::path::PathBuf;

/// Options of pictures.
#[derive(Clone, Debug, Args)]
pub struct PictureArgs {
    /// Exposure of PNGs and video in stops (EV), -32 to 32: radiance is multiplied by 2^EV before the tone map. auto:
    /// what brings the log-average luminance of a frame, in which nothing counts as darker than 1/256 of the mean, to
    /// middle grey (0.18); it adapts along the path, all but 1/e of the way in 0.5 seconds of the path's time. EXR
    /// keeps the radiance
    #[arg(long, value_name = "EV|auto", default_value = "0", allow_hyphen_values = true, value_parser = exposure)]
    pub exposure: Exposure,
    /// How PNGs and video show what is brighter than a display: none (cut off at 1), agx (AgX, base look), aces (Hill's
    /// fit of the ACES transforms), reinhard (on luminance; 4 is white). EXR keeps the radiance
    #[arg(long, value_name = "NAME", default_value = "none", value_parser = tone_map)]
    pub tone_map: ToneMap,
    /// Write all frames as an uncompressed video, too: YUV4MPEG2, 4:4:4, 8 bit, BT.709 in limited range, 3 bytes a
    /// pixel and frame; and print the ffmpeg commands that make an mp4 of it or of the PNGs [default: none]
    #[arg(long, value_name = "FILE.y4m")]
    pub video: Option<PathBuf>,
    /// Frames a second of the video, 1 to 1000
    #[arg(long, value_name = "N", default_value = "30", value_parser = |s: &str| ranged(s, 1, 1000))]
    pub video_fps: u32,
    /// Take the noise of few samples out of the frames: variance-guided filtering over frames and neighbours (SVGF),
    /// which trades noise for a small error; without it the picture is the unbiased estimate. It runs on the processor,
    /// whatever the device. EXR has the filtered radiance. summary.json says what energy was cut off fireflies
    /// (denoise)
    #[arg(long)]
    pub denoise: bool,
    /// Temporal anti-aliasing: samples lie at other points of their pixels in every frame, and frames are averaged
    /// where the world was seen before. AOVs are taken through the centres of pixels: not together with --aov
    #[arg(long)]
    pub taa: bool,
}

fn exposure(text: &str) -> Result<Exposure, String> {
    if text == "auto" {
        return Ok(Exposure::Auto);
    }
    let stops: f64 = text.parse().map_err(|_| "it must be a number of stops, or auto")?;
    if stops.abs() <= MOST_STOPS { Ok(Exposure::Fixed(stops)) } else { Err("it must be from -32 to 32".into()) }
}

fn tone_map(text: &str) -> Result<ToneMap, String> {
    let named = ToneMap::ALL.into_iter().find(|map| map.name() == text);
    named.ok_or_else(|| unknown(text, &ToneMap::ALL.map(ToneMap::name), &[]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_out_of_range_are_refused() {
        assert_eq!(exposure("auto"), Ok(Exposure::Auto));
        assert_eq!(exposure("-2.5"), Ok(Exposure::Fixed(-2.5)));
        for bad in ["", "bright", "nan", "33", "-33", "inf"] {
            assert!(exposure(bad).is_err(), "{bad}");
        }
        assert_eq!(tone_map("agx"), Ok(ToneMap::AgX));
        assert!(tone_map("filmic").unwrap_err().contains("aces"));
    }
}
