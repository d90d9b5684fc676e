//! What becomes of a session's frames: a PNG and an EXR each, a frame of a video.

use super::open::{Frame, developed};
use crate::output::png;
use crate::output::video::{Video, ffmpeg_of_frames, ffmpeg_of_video};
use crate::picture::exposure::{Exposure, Meter};
use crate::picture::tone_map::ToneMap;
use crate::session::Settings;
use anyhow::{Context, Result, bail};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::{Builder, JoinHandle};

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

/// What writes frames, on a thread of its own.
struct Writer {
    folder: PathBuf,
    aov: bool,
    video: Option<Video>,
}

impl Writer {
    fn write(&mut self, frame: &Frame) -> Result<()> {
        let name = self.folder.join(format!("{:04}.png", frame.number));
        let picture = frame.picture();
        png::write(&name, frame.size.0, frame.size.1, &picture)?;
        if self.aov {
            frame.write_exr(&name.with_extension("exr"))?;
        }
        if let Some(video) = &mut self.video {
            video.push(&picture)?;
        }
        Ok(())
    }

    /// Writes frames as they come, up to the first that cannot be written; the video, then.
    fn run(mut self, frames: Receiver<Frame>) -> Result<Option<Video>> {
        frames.into_iter().try_for_each(|frame| self.write(&frame))?;
        Ok(self.video)
    }
}

/// Where frames are written.
enum Writing {
    /// At once: of pictures that are joined of bands there is no room for two.
    AtOnce(Writer),
    /// While the next is rendered.
    Meanwhile {
        /// Takes a frame once the one before is written.
        frames: SyncSender<Frame>,
        thread: JoinHandle<Result<Option<Video>>>,
    },
}

/// Writes the pictures of a walk, frame by frame.
pub struct Pictures {
    preview: Preview,
    writing: Option<Writing>,
    /// What summaries say of the video.
    note: Value,
    /// The commands that make an mp4 of the video and of the PNGs.
    commands: Vec<String>,
}

impl Pictures {
    /// Starts the pictures of a walk in `output`, where the folder `frames` exists. Frames of earlier walks go; files
    /// of other names stay. `are_joined`: they are rendered in bands, and each is written before the next begins; else
    /// while the next is rendered.
    ///
    /// # Errors
    /// An old frame cannot be removed; the video cannot be written.
    pub fn create(output: &Path, settings: &Settings, are_joined: bool) -> Result<Self> {
        let (size, fps) = ((settings.size.width, settings.size.height), settings.video_fps);
        let folder = output.join("frames");
        for old in frames_in(&folder)? {
            std::fs::remove_file(&old).with_context(|| format!("{}: cannot remove this old frame", old.display()))?;
        }
        let (mut commands, mut note, mut video) = (Vec::new(), Value::Null, None);
        if let Some(file) = &settings.video {
            let of_frames = ffmpeg_of_frames(&folder, size, fps, &output.join("frames.mp4"));
            commands = vec![ffmpeg_of_video(file, size, &file.with_extension("mp4")), of_frames];
            note = json!({ "file": file.to_string_lossy(), "frames_per_second": fps, "ffmpeg": commands });
            video = Some(Video::create(file, size.0, size.1, fps)?);
        }
        let file = output.join("preview.png");
        // Of a walk that was killed.
        let _ = std::fs::remove_file(&file);
        let preview = Preview { file, size, exposure: settings.exposure, tone_map: settings.tone_map, stops: None };
        let writer = Writer { folder, aov: settings.aov, video };
        let writing = if are_joined {
            Writing::AtOnce(writer)
        } else {
            // Without room for a frame to wait in: it is handed over when the one before is written.
            let (frames, to_write) = sync_channel(0);
            let thread = Builder::new().name("pictures".into()).spawn(move || writer.run(to_write));
            Writing::Meanwhile { frames, thread: thread.context("cannot start a thread that writes pictures")? }
        };
        Ok(Self { preview, writing: Some(writing), note, commands })
    }

    /// What shows the next frame while it is made.
    pub fn preview(&self) -> Preview {
        self.preview.clone()
    }

    /// Begins to write a frame. All before it are written when this returns.
    ///
    /// # Errors
    /// A file of one of those cannot be written.
    pub fn frame(&mut self, frame: Frame) -> Result<()> {
        self.preview.stops = Some(frame.exposure_ev);
        match &mut self.writing {
            Some(Writing::AtOnce(writer)) => writer.write(&frame),
            Some(Writing::Meanwhile { frames, .. }) if frames.send(frame).is_ok() => Ok(()),
            _ => self.wait().map(drop),
        }
    }

    /// Waits until all frames are written; the video, if it has not been given before.
    ///
    /// # Errors
    /// A file cannot be written.
    fn wait(&mut self) -> Result<Option<Video>> {
        match self.writing.take() {
            None => Ok(None),
            Some(Writing::AtOnce(writer)) => Ok(writer.video),
            Some(Writing::Meanwhile { frames, thread }) => {
                drop(frames);
                let written = thread.join();
                written.unwrap_or_else(|_| bail!("pictures cannot be written; this is a bug in brickwalk"))
            }
        }
    }

    /// Waits until all frames are written, and ends the video with them, unless the walk has `failed`; what summaries
    /// say of it, and the commands that encode it.
    ///
    /// # Errors
    /// A file cannot be written.
    pub fn finish(mut self, failed: bool) -> Result<(Value, Vec<String>)> {
        // There is one only where it was asked for.
        let _ = std::fs::remove_file(&self.preview.file);
        if let Some(video) = self.wait()?.filter(|_| !failed) {
            video.finish()?;
        }
        Ok((std::mem::take(&mut self.note), std::mem::take(&mut self.commands)))
    }
}

impl Drop for Pictures {
    /// What is begun is brought to an end.
    fn drop(&mut self) {
        let _ = self.wait();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Pixels;

    fn frame(number: u32) -> Frame {
        let pixels = Pixels { radiance: vec![[0.5; 3]; 6], ..Pixels::default() };
        let (records, checkpoints) = (Vec::new(), Vec::new());
        Frame { number, size: (3, 2), pixels, records, checkpoints, exposure_ev: 0.0, tone_map: ToneMap::None }
    }

    fn pictures(output: &Path, are_joined: bool) -> Pictures {
        std::fs::create_dir_all(output.join("frames")).unwrap();
        Pictures::create(output, &Settings::from_options("--size 3x2").unwrap(), are_joined).unwrap()
    }

    #[test]
    fn frames_are_written_one_after_the_other() {
        for are_joined in [false, true] {
            let folder = tempfile::tempdir().unwrap();
            let mut pictures = pictures(folder.path(), are_joined);
            let is_there = |number: u32| folder.path().join(format!("frames/{number:04}.png")).exists();
            for number in 0..5 {
                pictures.frame(frame(number)).unwrap();
                assert!((0..number + u32::from(are_joined)).all(is_there), "all before frame {number}");
            }
            pictures.finish(false).unwrap();
            assert!(is_there(4));
        }
    }

    #[test]
    fn what_was_begun_is_written_when_a_walk_fails() {
        let folder = tempfile::tempdir().unwrap();
        let mut pictures = pictures(folder.path(), false);
        pictures.frame(frame(0)).unwrap();
        drop(pictures);
        assert!(folder.path().join("frames/0000.png").exists());
    }

    #[test]
    fn a_frame_that_cannot_be_written_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let mut pictures = pictures(folder.path(), false);
        std::fs::remove_dir(folder.path().join("frames")).unwrap();
        pictures.frame(frame(0)).unwrap();
        let error = pictures.frame(frame(1)).unwrap_err();
        assert!(format!("{error:#}").contains("0000.png"), "{error:#}");
        // It is told once.
        pictures.finish(false).unwrap();
    }
}
