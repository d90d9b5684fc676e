//! `calibrate`: the rates of a device, which `--secondary auto` decides by.

use super::interrupt;
use super::options::args::CalibrateArgs;
use super::output::note;
use crate::session::auto::calibrate::{Measured, measure};
use crate::session::auto::rates::{RateFile, Rates, SceneRates, default_file, scene_key};
use crate::session::{Settings, auto::candidates::CANDIDATES, auto::model::Counts, auto::model::method_seconds};
use anyhow::{Context, Result, bail};
use brickwalk_convert::build::{BuildSettings, build_source};
use brickwalk_convert::progress::Progress;
use brickwalk_scenes::{Kind, Settings as Generated, generate, write_paths};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Scenes for rates of any: a city of houses that are placed once, a plant of thin pipes.
const ANY: [Kind; 2] = [Kind::City, Kind::Pipes];
/// Triangles of each.
const TRIANGLES: u64 = 300_000;

/// Runs `calibrate`.
///
/// # Errors
/// A scene that cannot be read; the device's; the file cannot be written; it was interrupted, which keeps the rates of
/// scenes that are finished.
pub fn run(args: &CalibrateArgs) -> Result<()> {
    let Some(file) = args.rates.clone().or_else(default_file) else {
        bail!("the system names no folder for settings; name a file with --rates");
    };
    let (path, size, adapter) = (args.path.clone(), args.size, args.adapter.clone());
    let settings = Settings { path, size, adapter, ..Settings::default() };
    if args.scenes.is_empty() {
        let folder = tempfile::tempdir()?;
        let mut all: Option<(String, Rates)> = None;
        for kind in ANY {
            let (scene, path) = made(kind, folder.path())?;
            let measured = told(&scene, &Settings { path: Some(path), ..settings.clone() })?;
            let rates = match all {
                Some((_, before)) => before.cautious(&measured.rates),
                None => measured.rates,
            };
            all = Some((measured.device, rates));
        }
        if let Some((device, rates)) = all {
            keep(&file, |rate_file| rate_file.devices.entry(device).or_default().any = Some(rates))?;
        }
    }
    for scene in &args.scenes {
        let Measured { device, scene: checksum, rates } = told(scene, &settings)?;
        let name = scene.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let own = SceneRates { name, rates };
        keep(&file, |rate_file| {
            rate_file.devices.entry(device).or_default().scenes.insert(scene_key(checksum), own);
        })?;
    }
    note(&format!("{}: rates\n", file.display()))
}

/// Changes the file, which others may have changed meanwhile.
fn keep(file: &Path, change: impl FnOnce(&mut RateFile)) -> Result<()> {
    let mut rates = RateFile::read(file)?.unwrap_or_default();
    change(&mut rates);
    rates.write(file)
}

/// Generates a scene; its file, and a path through it.
fn made(kind: Kind, folder: &Path) -> Result<(PathBuf, PathBuf)> {
    let (file, progress) = (folder.join(format!("{kind}.bricks")), interrupt::job());
    let settings = Generated { kind, triangles: TRIANGLES, seed: 0, instanced: false, copies: 1 };
    let scene = generate(&settings, &progress)?;
    build_source(&scene, &BuildSettings::default(), &file, &progress).context("a scene to measure")?;
    progress.finish();
    let paths = write_paths(&scene, &file)?;
    let near = paths.iter().find(|path| path.to_string_lossy().ends_with(".near.json"));
    let path = near.or(paths.first()).cloned().context("generated scenes have paths")?;
    Ok((file, path))
}

/// Measures a scene, and says what it found.
fn told(scene: &Path, settings: &Settings) -> Result<Measured> {
    let (progress, stop) = (Progress::new(), interrupt::flag());
    let mut shown: Option<String> = None;
    let mut watch = |what: &str, done: u32, all: u32| {
        if shown.as_deref() != Some(what) {
            progress.phase("effects", all.into());
            progress.advance(done.into());
            shown = Some(what.into());
        }
        !stop.load(std::sync::atomic::Ordering::Relaxed)
    };
    let measured = measure(scene, settings, &mut watch)?;
    progress.finish();
    note(&table(scene, settings, &measured))?;
    Ok(measured)
}

/// Rates as milliseconds of a picture of the size that was measured.
fn table(scene: &Path, settings: &Settings, measured: &Measured) -> String {
    let Measured { device, rates, .. } = measured;
    let pixels = f64::from(settings.size.width) * f64::from(settings.size.height);
    let mut text = format!("{} on {device}, {} pixels with a ray each that hits:\n", scene.display(), settings.size);
    for (effect, seconds) in &rates.exact {
        let exact = seconds * pixels;
        let _ = writeln!(text, "  {effect:12} {:22} {:8.1} ms", "exact", 1e3 * exact);
        for rate in rates.methods.iter().filter(|rate| rate.effect == *effect) {
            let Some(candidate) = CANDIDATES.iter().find(|own| own.effect == effect && own.name == rate.name) else {
                continue;
            };
            let counts = Counts { rays: pixels, samples: 1.0, missing: 0.0 };
            let own = method_seconds(rates, rate, candidate, &counts);
            let making = if rate.making > 0.0 { format!(", made in {:.1} s", rate.making) } else { String::new() };
            let _ = writeln!(
                text,
                "  {effect:12} {:22} {:8.1} ms, {:.2} times exact{making}; errors to {:.1} %, FLIP to {:.3}",
                rate.name,
                1e3 * own,
                own / exact,
                rate.percent[1],
                rate.flip_error[1]
            );
        }
    }
    text
}
