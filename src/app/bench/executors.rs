//! `brickwalk bench executors`: the same frames on every device that is present, frame by frame in turns.
//!
//! The first repetition brings in what frames need, and its pictures are compared with those of the first device; times are those
//! of the others.

use super::args::{ExecutorsArgs, Settings};
use super::measure::walk_args;
use super::plan::{SceneId, View};
use super::scenes;
use crate::app::device::Adapter;
use crate::app::output::atomic;
use crate::app::session::{Session, open_scene};
use crate::app::{interrupt, walk};
use crate::gpu::device::candidates;
use crate::kernel::{DeviceInfo, Extent};
use crate::render::{Pixels, Renderer};
use anyhow::{Context, Result, bail};
use brickwalk_convert::progress::Progress;
use brickwalk_report::{Table, Value};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::Ordering;

/// Raised when a field of `executors.json` changes its meaning.
const FORMAT: u32 = 1;

/// A device with all that it renders with.
struct Side {
    renderer: Renderer,
    info: DeviceInfo,
    /// Rays and wall time of every pass of a frame, by effect.
    passes: BTreeMap<&'static str, Vec<(u64, f64)>>,
    differences: Differences,
}

/// How pictures differ from those of the first device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Differences {
    /// Pixels whose triangles differ.
    ids: u64,
    /// The greatest difference of depths where they do not, in units of the last place.
    depth_ulps: u32,
}

impl Differences {
    /// Adds those of a frame.
    fn add(&mut self, one: &Pixels, other: &Pixels) {
        for i in 0..one.id.len().max(other.id.len()) {
            if one.id.get(i) != other.id.get(i) {
                self.ids += 1;
            } else if let (Some(a), Some(b)) = (one.depth.get(i), other.depth.get(i)) {
                self.depth_ulps = self.depth_ulps.max(a.to_bits().abs_diff(b.to_bits()));
            }
        }
    }
}

/// Runs the command.
///
/// # Errors
/// The folder cannot be written; a scene that cannot be generated or read; a device that was asked for and cannot be had.
pub fn run(args: &ExecutorsArgs) -> Result<()> {
    let settings = args.settings();
    atomic::create_folder(&args.output)?;
    let folder = args.scenes.clone().unwrap_or_else(|| args.output.join("scenes"));
    let place = scenes::place(SceneId::City, &folder, &settings, None)?;
    let mut notes = Vec::new();
    let mut sides = Vec::new();
    for adapter in wanted(args) {
        match open(args, &settings, &place.scene, &adapter) {
            Ok(side) => sides.push(side),
            Err(error) if args.adapters.is_empty() => notes.push(format!("{adapter}: left out: {error:#}")),
            Err(error) => return Err(error),
        }
    }
    let path = place.path(View::Near)?;
    let progress = Progress::new();
    progress.phase("frames", u64::from(settings.repeat + 1) * u64::from(settings.frames));
    for repetition in 0..=settings.repeat {
        for frame in 0..settings.frames {
            let camera = path.frame(frame, settings.frames.max(30));
            let mut first: Option<Pixels> = None;
            for side in &mut sides {
                if interrupt::flag().load(Ordering::Relaxed) {
                    bail!("interrupted; nothing has been written to {}", args.output.display());
                }
                let output = side.renderer.frame(frame, &camera).with_context(|| side.info.name.clone())?;
                if repetition == 0 {
                    match &first {
                        None => first = Some(output.pixels),
                        Some(first) => side.differences.add(first, &output.pixels),
                    }
                    continue;
                }
                for record in output.records {
                    side.passes.entry(record.pass).or_default().push((record.rays, record.ms));
                }
            }
            progress.advance(1);
        }
    }
    progress.finish();
    let text = write(args, &settings, &sides, &notes)?;
    crate::app::print(&text)
}

/// The devices to be measured: those asked for, else the processor and every graphics adapter that has what is needed.
fn wanted(args: &ExecutorsArgs) -> Vec<Adapter> {
    if !args.adapters.is_empty() {
        return args.adapters.clone();
    }
    let mut all = vec![Adapter::Cpu];
    for candidate in candidates().iter().filter(|candidate| candidate.flaw.is_none()) {
        let adapter = Adapter::Named(candidate.info.name.clone());
        // One that several systems of graphics show is measured once.
        if !all.contains(&adapter) {
            all.push(adapter);
        }
    }
    all
}

fn open(args: &ExecutorsArgs, settings: &Settings, scene: &Path, adapter: &Adapter) -> Result<Side> {
    let line = format!(
        "--effects {} --cache {} --schedule {} --tile {} --size {} --ao-rays {rays} --diffuse-rays {rays} --aov",
        args.effects,
        args.cache,
        args.schedule,
        settings.tile,
        settings.size,
        rays = settings.rays
    );
    let walk_args = walk_args(&line, scene, adapter)?;
    let extent = Extent { width: settings.size.width, height: settings.size.height, tile: settings.tile };
    let session = Session::open(open_scene(scene)?, scene, &walk_args.stream, extent)?;
    let renderer = walk::renderer(session, &walk_args);
    let info = renderer.executor.device();
    Ok(Side { renderer, info, passes: BTreeMap::new(), differences: Differences::default() })
}

/// The median, of an even number of values the upper one.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

/// The table of all devices and passes.
fn table(sides: &[Side]) -> Table {
    let columns = ["device", "pass", "rays a frame", "ms", "Mray/s", "over the first", "other ids", "depth, ulps"];
    let mut rows = Vec::new();
    let ms = |side: &Side, pass: &str| side.passes.get(pass).map(|all| median(all.iter().map(|(_, ms)| *ms).collect()));
    for side in sides {
        for (&pass, all) in &side.passes {
            let rays = median(all.iter().map(|(rays, _)| *rays as f64).collect());
            let own = ms(side, pass);
            let first = sides.first().and_then(|first| ms(first, pass));
            rows.push(vec![
                Value::Text(side.info.name.clone()),
                Value::Text(pass.into()),
                Value::Number(rays),
                Value::number(own),
                Value::number(own.map(|ms| rays * 1e-3 / ms)),
                Value::ratio(own.zip(first).map(|(own, first)| first / own)),
                Value::Number(side.differences.ids as f64),
                Value::Number(f64::from(side.differences.depth_ulps)),
            ]);
        }
    }
    let caption = "Medians over frames and repetitions of the wall time of a pass; \"other ids\": pixels of all frames whose triangle \
                   is not that of the first device.";
    Table { name: "executors".into(), caption: caption.into(), columns: columns.map(String::from).to_vec(), rows }
}

/// Writes the results; returns what to print.
fn write(args: &ExecutorsArgs, settings: &Settings, sides: &[Side], notes: &[String]) -> Result<String> {
    let table = table(sides);
    let devices: Vec<serde_json::Value> = sides
        .iter()
        .map(|side| {
            let DeviceInfo { name, driver, driver_info, backend, .. } = &side.info;
            json!({ "name": name, "driver": driver, "driver_info": driver_info, "backend": backend })
        })
        .collect();
    let json = json!({
        "format": FORMAT,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": env!("BRICKWALK_COMMIT"),
        "devices": devices,
        "settings": {
            "triangles": settings.triangles[0],
            "size": settings.size.to_string(),
            "cache": args.cache,
            "schedule": args.schedule,
            "effects": args.effects,
            "frames": settings.frames,
            "repetitions": settings.repeat,
            "rays": settings.rays,
            "tile": settings.tile,
        },
        "left_out": notes,
        "table": table,
    });
    atomic::write(&args.output.join("executors.json"), (serde_json::to_string_pretty(&json)? + "\n").as_bytes())?;
    let mut text = format!(
        "# The same frames on every device\n\nCity of {} triangles, {}, cache {}, schedule {}, {} frames, {} repetitions.\n\n",
        settings.triangles[0], settings.size, args.cache, args.schedule, settings.frames, settings.repeat
    );
    for side in sides {
        text +=
            &format!("- {}: {} {} ({})\n", side.info.name, side.info.driver, side.info.driver_info, side.info.backend);
    }
    for note in notes {
        text += &format!("- {note}\n");
    }
    text += &format!("\n{}\n\n{}", table.caption, table.to_markdown());
    atomic::write(&args.output.join("executors.md"), text.as_bytes())?;
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_count_triangles_and_measure_depths() {
        let pixels = |id: &[u32], depth: &[f32]| Pixels { id: id.to_vec(), depth: depth.to_vec(), ..Pixels::default() };
        let one = pixels(&[1, 2, 3], &[1.0, 2.0, f32::INFINITY]);
        let mut all = Differences::default();
        all.add(&one, &one);
        assert_eq!(all, Differences::default());
        all.add(&one, &pixels(&[1, 5, 3], &[1.0f32.next_up().next_up(), 9.0, f32::INFINITY]));
        assert_eq!(all, Differences { ids: 1, depth_ulps: 2 });
        // A picture that ends early differs in what it lacks.
        all.add(&one, &pixels(&[1], &[1.0]));
        assert_eq!(all.ids, 3);
    }
}
