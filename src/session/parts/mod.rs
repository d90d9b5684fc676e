//! Parts of a walk: frames that are rendered apart, in any order and on any machine, and joined in their order.
//!
//! A frame depends on those before it in two ways: denoising and anti-aliasing look at what they showed, and an
//! automatic exposure adapts. Both come after all rays are traced. So a part is a frame before that, and what joins
//! parts does the rest: the bytes are those of a walk that rendered all frames itself.
//!
//! Where settings ask for bands, each band of a frame is a part, so that several machines render one picture. Parts
//! are numbered frame by frame, from the top: of B bands part N is band N mod B of frame N / B.
//!
//! A part lies in a file of its own and says by a key what it is a part of: the same scene, settings and program.

mod columns;
mod key;

use super::bands;
use super::open::{Frame, Rendered, Session, Watch};
use super::opened::open_scene;
use super::settings::Settings;
use crate::counters::Record;
use crate::frame::{FrameOutput, Joint, Moved, PixelState, Pixels};
use crate::output::arrays::{Read, Writing};
use crate::remote::{self, Traffic};
use crate::scene::Camera;
use crate::secondary::Method;
use crate::settings::SettingsError;
use anyhow::{Context, Result, ensure};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Of a part: by whom it was rendered, and what it took.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Made {
    /// Who rendered it, as a machine and a process.
    pub worker: String,
    /// Seconds.
    pub seconds: f64,
    /// Bytes of bricks, attributes and textures that were loaded.
    pub bytes_loaded: u64,
    /// Requests for parts of a scene by URL.
    pub requests: u64,
    /// Bytes that they fetched.
    pub bytes_fetched: u64,
    /// Seconds of waiting for them.
    pub seconds_waiting: f64,
}

impl Made {
    /// Adds what another part took.
    pub fn add(&mut self, other: &Self) {
        self.seconds += other.seconds;
        self.bytes_loaded += other.bytes_loaded;
        self.requests += other.requests;
        self.bytes_fetched += other.bytes_fetched;
        self.seconds_waiting += other.seconds_waiting;
    }
}

/// A frame that was rendered apart, or a band of one.
pub struct Part {
    /// Its number.
    pub number: u32,
    /// Who made it.
    pub made: Made,
    /// Of the picture.
    size: (u32, u32),
    /// Of the picture, those that it has.
    rows: Range<u32>,
    rendered: Rendered,
}

/// How many parts a walk has.
pub fn count(settings: &Settings) -> u32 {
    settings.frames.saturating_mul(bands::asked(settings).len() as u32)
}

/// The parts of a frame.
pub fn of_frame(settings: &Settings, frame: u32) -> Range<u32> {
    let bands = bands::asked(settings).len() as u32;
    frame * bands..(frame + 1) * bands
}

/// The frame of a part, and the rows of it that the part has.
fn place(settings: &Settings, number: u32) -> (u32, Range<u32>) {
    let bands = bands::asked(settings);
    let (frame, band) = (number / bands.len() as u32, number as usize % bands.len());
    (frame, bands[band].clone())
}

/// Where a part lies in the folder of a walk.
pub fn file(output: &Path, number: u32) -> PathBuf {
    folder(output).join(format!("{number:04}.part"))
}

/// Where the parts of a walk lie.
pub fn folder(output: &Path) -> PathBuf {
    output.join("parts")
}

/// The name of this process on its machine.
pub fn worker() -> String {
    let host = sysinfo::System::host_name().unwrap_or_else(|| "unknown".into());
    format!("{host}:{}", std::process::id())
}

/// Refuses settings with which a frame depends on those before it while its rays are traced.
///
/// # Errors
/// Which one to leave out.
pub fn check(settings: &Settings) -> Result<(), SettingsError> {
    let others = [
        (settings.secondary.has(Method::Auto), "--secondary auto"),
        (settings.secondary.has(Method::Displacement), "--secondary displacement"),
        (settings.secondary.has(Method::Dvf) && settings.motion.is_some(), "--motion with --secondary dvf"),
        (settings.frame_budget().is_some(), "--frame-budget"),
        (settings.requests_out.is_some(), "--requests-out"),
        (settings.measure_left_out, "--measure-left-out"),
    ];
    if settings.bands > 1 && settings.lod_correct.is_some_and(|one_in| one_in > 0) {
        return Err(SettingsError::Conflict(format!(
            "--bands {}: what --lod-correct finds counts for the whole picture, so that its bands cannot be rendered \
             apart; leave one of them out",
            settings.bands
        )));
    }
    match others.into_iter().find(|(is_on, _)| *is_on) {
        Some((_, option)) => Err(SettingsError::Conflict(format!(
            "{option}: with it a frame depends on those before it, so that frames cannot be rendered apart; leave it \
             out, or walk on one machine"
        ))),
        None => Ok(()),
    }
}

impl Session {
    /// What parts of this walk are known by.
    ///
    /// # Errors
    /// A file that the settings name cannot be read.
    pub fn key(&self) -> Result<String> {
        key::key(&self.given, self.renderer.scene.checksum())
    }

    /// What was fetched of the scene so far: nothing of a file.
    fn traffic(&self) -> Traffic {
        remote::traffic(&self.file).unwrap_or_default()
    }

    /// Renders the part `number` of the walk; `None`: `watch` stopped it.
    ///
    /// # Errors
    /// As [`Session::frame_watched`]; settings with which frames cannot be rendered apart.
    pub fn part(&mut self, number: u32, watch: &mut dyn Watch) -> Result<Option<Part>> {
        check(&self.settings)?;
        let (start, before) = (Instant::now(), self.traffic());
        let (frame, rows) = place(&self.settings, number);
        self.place_after(frame)?;
        let camera = self.path.frame(frame, self.settings.frames);
        self.renderer.only_rows = Some(rows.clone());
        let rendered = self.render_alone(frame, &camera, watch);
        self.renderer.only_rows = None;
        let Some(rendered) = rendered? else { return Ok(None) };
        let traffic = self.traffic();
        let made = Made {
            worker: worker(),
            seconds: start.elapsed().as_secs_f64(),
            bytes_loaded: rendered.output.records.iter().map(Record::loaded_bytes).sum(),
            requests: traffic.requests - before.requests,
            bytes_fetched: traffic.bytes_fetched - before.bytes_fetched,
            seconds_waiting: traffic.seconds_waiting - before.seconds_waiting,
        };
        Ok(Some(Part { number, made, size: self.renderer.size, rows, rendered }))
    }

    /// Places what moves where it is in a frame, as seen from the frame before.
    fn place_after(&mut self, frame: u32) -> Result<()> {
        if let Some(before) = frame.checked_sub(1) {
            self.place(before)?;
            self.renderer.moved = Moved::default();
        }
        self.place(frame)
    }

    /// Reads the part `number` of the walk `key`.
    ///
    /// # Errors
    /// It is not there, damaged, or of another walk.
    pub fn read_part(&self, output: &Path, number: u32, key: &str) -> Result<Part> {
        let (frame, rows) = place(&self.settings, number);
        let part = Part::read(output, number, key, &self.path.frame(frame, self.settings.frames))?;
        ensure!(
            (part.size, &part.rows) == (self.renderer.size, &rows),
            "{}: this is a part of pictures of another size",
            file(output, number).display()
        );
        Ok(part)
    }

    /// Goes on with parts: the next frame, with all that depends on those before it. `part` has the part of a number;
    /// `None`: it was stopped.
    ///
    /// # Errors
    /// Those of `part`; the device's; a place that is too far out.
    pub fn frame_of_parts(
        &mut self,
        frame: u32,
        mut part: impl FnMut(&mut Self, u32) -> Result<Option<Part>>,
    ) -> Result<Option<Frame>> {
        let (width, height) = self.renderer.size;
        let mut all = Rendered::default();
        for number in of_frame(&self.settings, frame) {
            let Some(Part { rows, rendered, .. }) = part(self, number)? else { return Ok(None) };
            let [band, picture] = [rows.len(), height as usize].map(|rows| width as usize * rows);
            all.checkpoints.extend(rendered.checkpoints);
            all.output.append(rendered.output, Joint { band, picture });
        }
        self.place_after(frame)?;
        let moved = std::mem::take(&mut self.renderer.moved);
        if let Some(guides) = &mut all.output.guides {
            guides.moved = moved;
        }
        self.go_on_with(frame, all).map(Some)
    }
}

impl Part {
    /// Writes the part of the walk `key` into the folder of the walk.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, output: &Path, key: &str) -> Result<PathBuf> {
        let path = file(output, self.number);
        let FrameOutput { pixels, records, coverage, guides } = &self.rendered.output;
        let mut arrays = Writing::default();
        arrays.push("radiance", &pixels.radiance);
        arrays.push("depth", &pixels.depth);
        arrays.push("normal", &pixels.normal);
        arrays.push("id", &pixels.id);
        arrays.push("albedo", &pixels.albedo);
        arrays.push("state", &pixels.state.iter().map(|&state| state as u8).collect::<Vec<_>>());
        arrays.push("coverage", &coverage.iter().map(|&is_hit| u8::from(is_hit)).collect::<Vec<_>>());
        if let Some(guides) = guides {
            columns::push(&mut arrays, guides);
        }
        let records: serde_json::Result<Vec<Value>> = records.iter().map(Record::with_bricks).collect();
        let head = json!({
            "key": key,
            "part": self.number,
            "size": self.size,
            "rows": self.rows,
            "made": self.made,
            "sampled": guides.as_ref().map(|guides| (guides.jitter, guides.second.iter().flatten().count())),
            "records": records?,
            "checkpoints": self.rendered.checkpoints,
        });
        let Value::Object(head) = head else { return Ok(path) };
        arrays.write(&path, head)?;
        Ok(path)
    }

    /// Reads the part `number` of the walk `key`, which `camera` saw.
    fn read(output: &Path, number: u32, key: &str, camera: &Camera) -> Result<Self> {
        let path = file(output, number);
        let read = Read::open(&path)?;
        let name = || path.display().to_string();
        let text = |what: &str| read.head.get(what).cloned().unwrap_or_default();
        ensure!(text("key") == key && text("part") == number, "{}: this is a part of another walk", name());
        let wrong = || format!("{}: its head is none of a part", name());
        let size: (u32, u32) = serde_json::from_value(text("size")).with_context(wrong)?;
        let rows: Range<u32> = serde_json::from_value(text("rows")).with_context(wrong)?;
        ensure!(rows.start < rows.end && rows.end <= size.1, "{}: its head is none of a part", name());
        let pixels = size.0 as usize * rows.len();
        let made: Made = serde_json::from_value(text("made")).with_context(wrong)?;
        let sampled: Option<columns::Sampled> = serde_json::from_value(text("sampled")).with_context(wrong)?;
        let checkpoints = serde_json::from_value(text("checkpoints")).with_context(wrong)?;
        let records: Vec<Value> = serde_json::from_value(text("records")).with_context(wrong)?;
        let records: Option<Vec<Record>> = records.iter().map(Record::read).collect();
        let states: Vec<u8> = read.array("state", pixels)?;
        let shown = Pixels {
            radiance: read.array("radiance", pixels)?,
            depth: read.array("depth", pixels)?,
            normal: read.array("normal", pixels)?,
            id: read.array("id", pixels)?,
            albedo: read.array("albedo", pixels)?,
            state: states.into_iter().map(|state| PixelState::of_ray(state.into())).collect(),
        };
        ensure!(shown.radiance.len() == pixels, "{}: it has no radiance", name());
        let coverage: Vec<u8> = read.array("coverage", pixels)?;
        let guides = sampled.map(|sampled| columns::read(&read, (size, pixels), camera, sampled)).transpose()?;
        let output = FrameOutput {
            pixels: shown,
            records: records.with_context(wrong)?,
            coverage: coverage.into_iter().map(|is_hit| is_hit != 0).collect(),
            guides,
        };
        Ok(Self { number, made, size, rows, rendered: Rendered { output, checkpoints } })
    }
}

/// What parts of a walk through `scene` with `settings` are known by.
///
/// # Errors
/// A bad scene; a file that the settings name cannot be read.
pub fn key_of(scene: &Path, settings: &Settings) -> Result<String> {
    key::key(settings, open_scene(&remote::name(scene))?.checksum())
}

/// Whether the part `number` of the walk `key` is there and whole.
pub fn is_whole(output: &Path, number: u32, key: &str) -> bool {
    let read = Read::open(&file(output, number));
    read.is_ok_and(|read| read.head.get("key").is_some_and(|own| own == key) && read.head["part"] == number)
}
