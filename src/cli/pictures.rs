//! What becomes of a frame's pixels: a PNG, an EXR, a frame of a video.

use super::options::args::WalkArgs;
use crate::frame::Pixels;
use crate::output::video::{Video, ffmpeg_of_frames, ffmpeg_of_video};
use crate::output::{exr, png, srgb};
use crate::picture::exposure::{Exposure, Meter};
use crate::picture::tone_map::ToneMap;
use anyhow::Result;
use serde_json::{Value, json};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes the pictures of a walk, frame by frame.
pub struct Pictures {
    folder: PathBuf,
    /// The frame in work, as it is so far.
    preview: PathBuf,
    size: (u32, u32),
    aov: bool,
    exposure: Exposure,
    tone_map: ToneMap,
    meter: Meter,
    /// The stops of every frame so far.
    stops: Vec<f64>,
    video: Option<Video>,
    /// The commands that make an mp4 of the video and of the PNGs.
    commands: Vec<String>,
}

/// Radiance as sRGB bytes: exposed by so many stops, mapped, encoded.
fn developed(radiance: &[[f32; 3]], stops: f64, tone_map: ToneMap) -> Vec<[u8; 3]> {
    if stops == 0.0 && tone_map == ToneMap::None {
        return srgb::pixels(radiance);
    }
    let gain = stops.exp2() as f32;
    let shown: Vec<[f32; 3]> = radiance.iter().map(|c| tone_map.apply(c.map(|x| x * gain))).collect();
    srgb::pixels(&shown)
}

impl Pictures {
    /// Starts the pictures of a walk in `folder`, which exists.
    ///
    /// # Errors
    /// The video cannot be written.
    pub fn create(folder: &Path, args: &WalkArgs) -> Result<Self> {
        let size = (args.size.width, args.size.height);
        let options = &args.pictures;
        let video = options.video.as_ref().map(|file| Video::create(file, size.0, size.1, options.video_fps));
        let commands = options.video.as_ref().map_or(Vec::new(), |file| {
            let of_frames = ffmpeg_of_frames(folder, size, options.video_fps, &args.output.join("frames.mp4"));
            vec![ffmpeg_of_video(file, size, &file.with_extension("mp4")), of_frames]
        });
        Ok(Self {
            folder: folder.into(),
            preview: args.output.join("preview.png"),
            size,
            aov: args.aov,
            exposure: options.exposure,
            tone_map: options.tone_map,
            meter: Meter::new(options.exposure),
            stops: Vec::new(),
            video: video.transpose()?,
            commands,
        })
    }

    /// Shows what the samples of a frame come to so far, in the place of what was shown before; exposed as the frame
    /// before.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn preview(&self, radiance: &[[f32; 3]]) -> Result<()> {
        let stops = match (self.stops.last(), self.exposure) {
            (Some(&stops), _) | (None, Exposure::Fixed(stops)) => stops,
            (None, Exposure::Auto) => Meter::new(Exposure::Auto).stops(radiance, 0.0),
        };
        png::write(&self.preview, self.size.0, self.size.1, &developed(radiance, stops, self.tone_map))
    }

    /// Writes frame number `frame`, `seconds` of the path after the one before.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn frame(&mut self, frame: u32, seconds: f64, pixels: &Pixels) -> Result<()> {
        let (width, height) = self.size;
        let name = self.folder.join(format!("{frame:04}.png"));
        let stops = self.meter.stops(&pixels.radiance, seconds);
        self.stops.push(stops);
        let picture = developed(&pixels.radiance, stops, self.tone_map);
        png::write(&name, width, height, &picture)?;
        if self.aov {
            let aovs = exr::Aovs {
                width,
                height,
                radiance: &pixels.radiance,
                depth: &pixels.depth,
                normal: &pixels.normal,
                triangle: &pixels.id,
                albedo: &pixels.albedo,
            };
            exr::write(&name.with_extension("exr"), &aovs)?;
        }
        if let Some(video) = &mut self.video {
            video.push(&picture)?;
        }
        Ok(())
    }

    /// Ends the video with the frames that there are, and says how to encode it: on standard output, or beside it where
    /// `records` go there.
    ///
    /// # Errors
    /// The video cannot be written.
    pub fn finish(&mut self, records: bool) -> Result<()> {
        // There is one only where it was asked for.
        let _ = std::fs::remove_file(&self.preview);
        let Some(video) = self.video.take() else { return Ok(()) };
        video.finish()?;
        let text: String = self.commands.iter().map(|command| format!("{command}\n")).collect();
        if !records {
            return super::print(&text);
        }
        // Whoever closed standard error does not want to know.
        let _ = std::io::stderr().write_all(text.as_bytes());
        Ok(())
    }

    /// What was done, for the summary.
    pub fn summary(&self, args: &WalkArgs) -> Value {
        let exposure = match self.exposure {
            Exposure::Fixed(stops) => json!(stops),
            Exposure::Auto => json!("auto"),
        };
        json!({
            "exposure": exposure,
            "exposure_ev": self.stops,
            "tone_map": self.tone_map.name(),
            "video": args.pictures.video.as_ref().map(|file| json!({
                "file": file.to_string_lossy(),
                "frames_per_second": args.pictures.video_fps,
                "ffmpeg": self.commands,
            })),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exposure_comes_before_the_tone_map() {
        let radiance = [[0.25, 0.5, 1.0], [0.0, 4.0, f32::NAN]];
        assert_eq!(developed(&radiance, 0.0, ToneMap::None), srgb::pixels(&radiance));
        assert_eq!(developed(&radiance, -1.0, ToneMap::None), srgb::pixels(&radiance.map(|c| c.map(|x| 0.5 * x))));
        let mapped = radiance.map(|c| ToneMap::Aces.apply(c.map(|x| 2.0 * x)));
        assert_eq!(developed(&radiance, 1.0, ToneMap::Aces), srgb::pixels(&mapped));
        // The control: the other way round it is something else.
        assert_ne!(srgb::pixels(&mapped), srgb::pixels(&radiance.map(|c| ToneMap::Aces.apply(c).map(|x| 2.0 * x))));
    }
}
