//! Graphics devices that allow less, or are lost: the pixels of a device that is whole, or one line that names it.

use crate::kind::{Fault, Kind, Limits, Outcome, Trial};
use crate::random::Random;
use crate::scenes;
use anyhow::{Context, Result};
use bricks::SceneFile;
use brickwalk::Settings;
use brickwalk::frame::{Pixels, Renderer};
use brickwalk::gpu::device::{Candidate, Gpu, candidates};
use brickwalk::kernels::Keep;
use brickwalk::session::device::Device;
use brickwalk::session::opened::Opened;
use brickwalk::session::renderer::renderer;
use brickwalk::settings::Group;
use std::path::Path;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// Bytes that a trial may take: a software device compiles kernels in this process.
const MOST_BYTES: u64 = 2 << 30;

/// What is rendered: some of everything.
const VIEW: &str = "--size 48x32 --aov --effects shadow,ao,diffuse --spp 1 --ao-rays 1 --tile 16";

/// A scene, and its frames on a device that is whole.
struct Sound {
    file: Arc<SceneFile>,
    frames: Vec<Vec<u32>>,
}

fn candidate() -> Option<Candidate> {
    candidates().into_iter().find(|candidate| candidate.flaw.is_none())
}

fn lacks() -> Option<String> {
    static IS_THERE: OnceLock<bool> = OnceLock::new();
    let is_there = *IS_THERE.get_or_init(|| candidate().is_some());
    (!is_there).then(|| "there is no Vulkan driver; install one".to_owned())
}

fn refused(error: &anyhow::Error) -> Fault {
    Fault::new("a whole device is refused", format!("{error:#}"))
}

/// The scene of all trials.
fn sound(folder: &Path) -> Result<&'static Sound, Fault> {
    static SOUND: OnceLock<Sound> = OnceLock::new();
    if let Some(sound) = SOUND.get() {
        return Ok(sound);
    }
    let mut random = Random::new("device", 7);
    let source = scenes::source(&mut random);
    let mut settings = scenes::settings(&mut random, &source);
    settings.brick_triangles = 64;
    let path = folder.join("scene.bricks");
    scenes::convert(source.scene, &settings, &path)?;
    let make = || -> Result<Sound> {
        let file = Arc::new(SceneFile::from_bytes("scene.bricks", std::fs::read(&path)?)?);
        let device = candidate().context("there is no device")?.open()?;
        let mut renderer = open(file.clone(), device, "--cache 100%")?;
        let frames = scenes::frames(&mut renderer, 2)?.iter().map(scenes::bits).collect();
        Ok(Sound { file, frames })
    };
    let made = make().map_err(|error| refused(&error))?;
    Ok(SOUND.get_or_init(|| made))
}

fn open(file: Arc<SceneFile>, device: Gpu, options: &str) -> Result<Renderer> {
    let mut settings = Settings::exact();
    settings.set_options(&format!("{VIEW} {options}"))?;
    let name = Path::new("scene.bricks");
    let opened = Opened::open_with(&Device::Gpu(Box::new(device)), file, name, &settings, Keep::default())?;
    renderer(opened, name, &settings)
}

/// One line; errors of devices are about the device, not the scene.
fn told(error: &anyhow::Error) -> Result<Outcome, Fault> {
    let line = format!("{error:#}");
    let is_line = !line.contains('\n') && line.chars().count() < 2000;
    if is_line { Ok(Outcome::Stopped) } else { Err(Fault::new("an error is not one line", line)) }
}

/// What a trial chooses of caches and schedules.
fn options(random: &mut Random) -> String {
    let cache = random.pick(["100%", "40%", "1%"]);
    let schedule = random.pick(["chc", "demand", "auto"]);
    format!("--cache {cache} --schedule {schedule}")
}

/// Frames of a renderer beside those that are right.
fn compare(frames: &[Pixels], sound: &Sound, about: &str) -> Result<Outcome, Fault> {
    let is_same = frames.iter().zip(&sound.frames).all(|(frame, right)| scenes::bits(frame) == *right);
    if is_same { Ok(Outcome::Passed) } else { Err(Fault::new("wrong pixels", about)) }
}

/// Limits.
pub struct Lowered;

/// Lowers one limit, or makes one coarser; its name.
fn lower(random: &mut Random, limits: &mut wgpu::Limits) -> String {
    macro_rules! one {
        ($($name:ident),*) => {{
            let all: [(&str, &mut u32); [$(stringify!($name)),*].len()] =
                [$((stringify!($name), &mut limits.$name)),*];
            let at = random.below(all.len());
            let mut all = all;
            let (name, value) = &mut all[at];
            let shift = random.within(1, 8);
            **value = match random.below(4) {
                0 => 0,
                1 => value.saturating_sub(1),
                _ => **value >> shift,
            };
            format!("{name} = {value}")
        }};
    }
    match random.below(4) {
        0 => {
            let bytes = 1u64 << random.within(8, 30);
            limits.max_buffer_size = bytes;
            limits.max_storage_buffer_binding_size = limits.max_storage_buffer_binding_size.min(bytes);
            format!("max_buffer_size = {bytes}")
        }
        1 => {
            limits.max_storage_buffer_binding_size = 1 << random.within(8, 27);
            format!("max_storage_buffer_binding_size = {}", limits.max_storage_buffer_binding_size)
        }
        2 => {
            let most = limits.max_storage_buffers_per_shader_stage as usize;
            limits.max_storage_buffers_per_shader_stage = random.within(16, most.clamp(16, 64)) as u32;
            format!("max_storage_buffers_per_shader_stage = {}", limits.max_storage_buffers_per_shader_stage)
        }
        _ => one!(
            max_bind_groups,
            max_bindings_per_bind_group,
            max_dynamic_uniform_buffers_per_pipeline_layout,
            max_dynamic_storage_buffers_per_pipeline_layout,
            max_storage_buffers_per_shader_stage,
            max_uniform_buffers_per_shader_stage,
            max_compute_workgroup_storage_size,
            max_compute_invocations_per_workgroup,
            max_compute_workgroup_size_x,
            max_compute_workgroup_size_y,
            max_compute_workgroup_size_z,
            max_compute_workgroups_per_dimension
        ),
    }
}

impl Kind for Lowered {
    fn name(&self) -> &'static str {
        "device/limits"
    }

    fn about(&self) -> &'static str {
        "Frames on a device one of whose limits is lower: the same pixels, or one line"
    }

    fn limits(&self) -> Limits {
        Limits { seconds: 120.0, bytes: MOST_BYTES }
    }

    fn lacks(&self) -> Option<String> {
        lacks()
    }

    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault> {
        let mut random = Random::new(self.name(), trial.seed);
        let sound = sound(trial.folder)?;
        let mut candidate = candidate().ok_or_else(|| Fault::new("the device is gone", ""))?;
        let options = options(&mut random);
        let about = format!("{}, {options}", lower(&mut random, &mut candidate.limits));
        let rendered = candidate.open().map_err(anyhow::Error::from).and_then(|device| {
            let mut renderer = open(sound.file.clone(), device, &options)?;
            scenes::frames(&mut renderer, 2)
        });
        if let Some(keep) = trial.keep {
            let said = rendered.as_ref().map_or_else(|error| format!("{error:#}"), |_| "frames".to_owned());
            let written = std::fs::write(keep.join("said.txt"), format!("{about}\n{said}\n"));
            written.map_err(|error| Fault::new("nothing can be kept", error.to_string()))?;
        }
        match rendered {
            Ok(frames) => compare(&frames, sound, &about),
            Err(error) => told(&error).map_err(|fault| Fault::new(&fault.what, format!("{about}: {}", fault.text))),
        }
    }
}

/// A device that is lost.
pub struct Lost;

impl Kind for Lost {
    fn name(&self) -> &'static str {
        "device/lost"
    }

    fn about(&self) -> &'static str {
        "Frames on a device that is lost before, between or while they are rendered: right pixels, then one line"
    }

    fn limits(&self) -> Limits {
        Limits { seconds: 120.0, bytes: MOST_BYTES }
    }

    fn lacks(&self) -> Option<String> {
        lacks()
    }

    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault> {
        let mut random = Random::new(self.name(), trial.seed);
        let sound = sound(trial.folder)?;
        let options = options(&mut random);
        let opened = candidate().ok_or_else(|| Fault::new("the device is gone", ""))?.open();
        let device = opened.map_err(|error| refused(&error.into()))?;
        let own = device.clone();
        let before = random.below(4);
        if before == 0 {
            own.device.destroy();
        }
        let mut renderer = match open(sound.file.clone(), device, &options) {
            Ok(renderer) => renderer,
            Err(error) if before == 0 => return told(&error),
            Err(error) => return Err(refused(&error)),
        };
        if before == 1 {
            own.device.destroy();
        }
        let wait = Duration::from_micros(random.within(0, 40_000) as u64);
        let ended = std::thread::scope(|scope| {
            if before > 1 {
                scope.spawn(|| {
                    std::thread::sleep(wait);
                    own.device.destroy();
                });
            }
            scenes::frames(&mut renderer, 2)
        });
        let about = format!("{options}: lost at {before}, after {wait:?}");
        match ended {
            Ok(frames) => compare(&frames, sound, &about)?,
            Err(error) => told(&error)?,
        };
        // What is lost stays lost, and every later call says so.
        match scenes::frame(&mut renderer, 0, 2) {
            Ok(_) => Err(Fault::new("a frame on a device that was lost", about)),
            Err(error) => told(&error),
        }
    }
}
