//! What becomes of a session's frames: a PNG and an EXR each, a frame of a video.

use super::open::{Frame, developed};
use crate::output::png;
use crate::output::video::{Video, ffmpeg_of_frames, ffmpeg_of_video};
use crate::picture::exposure::{Exposure, Meter};
use crate::picture::tone_map::ToneMap;
use crate::session::Settings;
use anyhow::{Context, Result};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// The frames in a folder, by their names: a number of four digits or more, and the ending of a picture.
fn frames_in(folder: &Path) -> Result<Vec<PathBuf>> {
    let is_frame = |path: &Path| {
        let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        let ending = path.extension().and_then(|ending| ending.to_str());
        stem.len() >= 4 && stem.bytes().all(|b| b.is_ascii_digit()) && matches!(ending, Some("png" | "exr"))
    };
    let context = || format!("{}: cannot read this folder", folder.display());
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(context)? {
        found.extend(Some(entry.with_context(context)?.path()).filter(|path| is_frame(path)));
    }
    Ok(found)
}

/// Shows the frame in work, as it is so far, in the place of what was shown before; exposed as the frame before.
#[derive(Clone, Debug)]
pub struct Preview {
    file: PathBuf,
    size: (u32, u32),
    exposure: Exposure,
    tone_map: ToneMap,
    /// The stops of the frame before.
    stops: Option<f64>,
}

impl Preview {
    /// Writes what the samples of a frame come to so far.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, radiance: &[[f32; 3]]) -> Result<()> {
        let stops = match (self.stops, self.exposure) {
            (Some(stops), _) | (None, Exposure::Fixed(stops)) => stops,
            (None, auto) => Meter::new(auto, self.tone_map.white()).stops(radiance, &[], 0.0),
        };
        png::write(&self.file, self.size.0, self.size.1, &developed(radiance, stops, self.tone_map))
    }
}

/// Writes the pictures of a walk, frame by frame.
pub struct Pictures {
    folder: PathBuf,
    aov: bool,
    preview: Preview,
    video: Option<(PathBuf, u32, Video)>,
    /// The commands that make an mp4 of the video and of the PNGs.
    commands: Vec<String>,
}

impl Pictures {
    /// Starts the pictures of a walk in `output`, where the folder `frames` exists. Frames of earlier walks go; files
    /// of other names stay.
    ///
    /// # Errors
    /// An old frame cannot be removed; the video cannot be written.
    pub fn create(output: &Path, settings: &Settings) -> Result<Self> {
        let (size, fps) = ((settings.size.width, settings.size.height), settings.video_fps);
        let folder = output.join("frames");
        for old in frames_in(&folder)? {
            std::fs::remove_file(&old).with_context(|| format!("{}: cannot remove this old frame", old.display()))?;
        }
        let mut commands = Vec::new();
        let mut video = None;
        if let Some(file) = &settings.video {
            let of_frames = ffmpeg_of_frames(&folder, size, fps, &output.join("frames.mp4"));
            commands = vec![ffmpeg_of_video(file, size, &file.with_extension("mp4")), of_frames];
            video = Some((file.clone(), fps, Video::create(file, size.0, size.1, fps)?));
        }
        let file = output.join("preview.png");
        // Of a walk that was killed.
        let _ = std::fs::remove_file(&file);
        let preview = Preview { file, size, exposure: settings.exposure, tone_map: settings.tone_map, stops: None };
        Ok(Self { folder, aov: settings.aov, preview, video, commands })
    }

    /// What shows the next frame while it is made.
    pub fn preview(&self) -> Preview {
        self.preview.clone()
    }

    /// Writes a frame.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn frame(&mut self, frame: &Frame) -> Result<()> {
        let name = self.folder.join(format!("{:04}.png", frame.number));
        self.preview.stops = Some(frame.exposure_ev);
        let picture = frame.picture();
        let (width, height) = self.preview.size;
        png::write(&name, width, height, &picture)?;
        if self.aov {
            frame.write_exr(&name.with_extension("exr"))?;
        }
        if let Some((_, _, video)) = &mut self.video {
            video.push(&picture)?;
        }
        Ok(())
    }

    /// Ends the video with the frames that there are; what summaries say of it, and the commands that encode it.
    ///
    /// # Errors
    /// The video cannot be written.
    pub fn finish(self) -> Result<(Value, Vec<String>)> {
        // There is one only where it was asked for.
        let _ = std::fs::remove_file(&self.preview.file);
        let Some((file, fps, video)) = self.video else { return Ok((Value::Null, Vec::new())) };
        video.finish()?;
        let note = json!({
            "file": file.to_string_lossy(),
            "frames_per_second": fps,
            "ffmpeg": self.commands,
        });
        Ok((note, self.commands))
    }
}
