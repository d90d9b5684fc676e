//! `brickwalk bench executors`: the same frames on every device that is present, frame by frame in turns.
//!
//! The first repetition brings in what frames need, and its pictures are compared with those of the first device; times
//! are those of the others.

use super::args::{ExecutorsArgs, Settings};
use super::results::{Column, table, write_json};
use super::scenes::{self, SceneId, Scenes, View};
use super::store::{device, median};
use crate::frame::{Pixels, Renderer};
use crate::gpu::device::candidates;
use crate::kernels::DeviceInfo;
use crate::lab::console::Console;
use crate::output::atomic;
use crate::session::Settings as WalkSettings;
use crate::settings::Adapter;
use crate::settings::sizes::human_count;
use anyhow::{Context, Result, bail};
use brickwalk_convert::progress::Progress;
use brickwalk_report::{Table, Value};
use serde_json::json;
use std::path::Path;

/// Raised when a field of `executors.json` changes its meaning.
const FORMAT: u32 = 2;

/// A device with all that it renders with.
struct Side {
    renderer: Renderer,
    info: DeviceInfo,
    /// Rays and wall times of all frames, by pass, in the order of passes.
    passes: Vec<(&'static str, Vec<(u64, f64)>)>,
    differences: Differences,
}

/// How pictures differ from those of the first device.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Differences {
    /// Pixels of all pictures.
    pixels: u64,
    /// Pixels whose triangles differ.
    ids: u64,
    /// The greatest difference of depths where they do not, in units of the last place.
    depth_ulps: u32,
    /// The sum of the squares of the differences of radiance, over pixels and channels.
    squares: f64,
}

impl Differences {
    /// Adds those of a frame of the same size.
    fn add(&mut self, one: &Pixels, other: &Pixels) {
        self.pixels += one.radiance.len() as u64;
        for ((a, b), (da, db)) in one.id.iter().zip(&other.id).zip(one.depth.iter().zip(&other.depth)) {
            if a == b {
                self.depth_ulps = self.depth_ulps.max(da.to_bits().abs_diff(db.to_bits()));
            } else {
                self.ids += 1;
            }
        }
        let squared = |a: &f32, b: &f32| (f64::from(*a) - f64::from(*b)).powi(2);
        let channels = one.radiance.as_flattened().iter().zip(other.radiance.as_flattened());
        self.squares += channels.map(|(a, b)| squared(a, b)).sum::<f64>();
    }

    /// The root of the mean square of the differences of radiance.
    fn radiance_rmse(&self) -> f64 {
        (self.squares / (3 * self.pixels.max(1)) as f64).sqrt()
    }
}

impl Side {
    /// Median rays of a frame, and milliseconds, of a pass, if the device has one of this name.
    fn medians(&self, pass: &str) -> Option<(f64, f64)> {
        let (_, all) = self.passes.iter().find(|(name, _)| *name == pass)?;
        let (rays, ms) = all.iter().map(|&(rays, ms)| (rays as f64, ms)).unzip();
        median(rays).zip(median(ms))
    }
}

/// Runs the command.
///
/// # Errors
/// The folder cannot be written; a scene that cannot be generated or read; a device that was asked for and cannot be
/// had.
pub fn run(args: &ExecutorsArgs, console: Console) -> Result<()> {
    let settings = args.settings();
    atomic::create_folder(&args.output)?;
    let place =
        Scenes::new(args.scenes.as_deref(), &args.output, settings.triangles, None, console).place(SceneId::City)?;
    let mut notes = Vec::new();
    let mut sides = Vec::new();
    for adapter in wanted(args) {
        match open(args, &settings, &place.scene, &adapter) {
            Ok(side) => sides.push(side),
            Err(error) if args.adapters.0.is_empty() => notes.push(format!("{adapter}: left out: {error:#}")),
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
                if console.is_stopped() {
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
                    let one = (record.rays_traced, record.ms);
                    match side.passes.iter_mut().find(|(name, _)| *name == record.pass) {
                        Some((_, all)) => all.push(one),
                        None => side.passes.push((record.pass, vec![one])),
                    }
                }
            }
            progress.advance(1);
        }
    }
    progress.finish();
    let text = write(args, &settings, &sides, &notes)?;
    console.show(&text)
}

/// The devices to be measured: those asked for, else the processor and every graphics adapter that has what is needed.
fn wanted(args: &ExecutorsArgs) -> Vec<Adapter> {
    if !args.adapters.0.is_empty() {
        return args.adapters.0.clone();
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
    let own = WalkSettings {
        effects: args.effects,
        cache: args.cache,
        schedule: args.schedule,
        tile: settings.tile,
        size: settings.size,
        ao_rays: settings.rays,
        diffuse_rays: settings.rays,
        aov: true,
        adapter: adapter.clone(),
        ..WalkSettings::exact()
    };
    let renderer = scenes::open(scene, &own)?;
    let info = renderer.executor.device();
    Ok(Side { renderer, info, passes: Vec::new(), differences: Differences::default() })
}

/// The table of all devices and passes.
fn passes<'s>(sides: &'s [Side]) -> Table {
    /// A device, the first one, and the name of a pass.
    type Pass<'a> = (&'a Side, &'a Side, &'static str);
    let columns: [Column<Pass>; 6] = [
        ("device", |(side, ..)| side.info.name.clone().into()),
        ("pass", |(.., name)| (*name).into()),
        ("rays a frame", |(side, _, name)| Value::number(side.medians(name).map(|(rays, _)| rays))),
        ("ms", |(side, _, name)| Value::number(side.medians(name).map(|(_, ms)| ms))),
        ("Mray/s", |(side, _, name)| Value::number(side.medians(name).map(|(rays, ms)| rays * 1e-3 / ms))),
        ("over the first", |(side, first, name)| {
            Value::ratio(side.medians(name).zip(first.medians(name)).map(|((_, own), (_, first))| first / own))
        }),
    ];
    let of_side = |side: &'s Side| side.passes.iter().map(move |(name, _)| (side, &sides[0], *name));
    let caption = "Medians over frames and repetitions of the wall time of a pass.";
    table("executors", caption, sides.iter().flat_map(of_side), &columns)
}

/// How the pictures of each device but the first differ from those of the first, a line each.
fn differences(sides: &[Side]) -> String {
    let Some((first, others)) = sides.split_first() else { return String::new() };
    let line = |side: &Side| {
        let d = &side.differences;
        format!(
            "- {} beside {}: {} of {} pixels show another triangle; where it is the same, depths differ by at most {} \
             ulps; radiance differs by an RMSE of {}.\n",
            side.info.name,
            first.info.name,
            human_count(d.ids),
            human_count(d.pixels),
            human_count(u64::from(d.depth_ulps)),
            Value::Number(d.radiance_rmse()).show()
        )
    };
    others.iter().map(line).collect()
}

/// Writes the results; returns what to print.
fn write(args: &ExecutorsArgs, settings: &Settings, sides: &[Side], notes: &[String]) -> Result<String> {
    let table = passes(sides);
    let of_side = |side: &Side| {
        let d = &side.differences;
        let mut json = device(&side.info);
        json["pixels_compared"] = d.pixels.into();
        json["other_ids"] = d.ids.into();
        json["depth_ulps"] = d.depth_ulps.into();
        json["radiance_rmse"] = d.radiance_rmse().into();
        json
    };
    let json = json!({
        "format": FORMAT,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": env!("BRICKWALK_COMMIT"),
        "devices": sides.iter().map(of_side).collect::<Vec<_>>(),
        "settings": {
            "triangles": settings.triangles[0],
            "size": settings.size.to_string(),
            "cache": args.cache.to_string(),
            "schedule": args.schedule.name(),
            "effects": args.effects.to_string(),
            "frames": settings.frames,
            "repetitions": settings.repeat,
            "rays": settings.rays,
            "tile": settings.tile,
        },
        "left_out": notes,
        "table": table,
    });
    write_json(&args.output, "executors", &json)?;
    let mut text = format!(
        "# The same frames on every device\n\nCity of {} triangles, {}, cache {}, schedule {}, {} frames, {} \
         repetitions.\n\n",
        human_count(settings.triangles[0]),
        settings.size,
        args.cache,
        args.schedule,
        settings.frames,
        settings.repeat
    );
    for side in sides {
        text +=
            &format!("- {}: {} {} ({})\n", side.info.name, side.info.driver, side.info.driver_info, side.info.backend);
    }
    for note in notes {
        text += &format!("- {note}\n");
    }
    text += &format!("\n{}\n\n{}", table.caption, table.to_markdown());
    if sides.len() > 1 {
        text += &format!("\n{}", differences(sides));
    }
    atomic::write(&args.output.join("executors.md"), text.as_bytes())?;
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_count_triangles_and_measure_depths_and_radiance() {
        let pixels = |id: [u32; 3], depth: [f32; 3], red: f32| Pixels {
            id: id.to_vec(),
            depth: depth.to_vec(),
            radiance: vec![[red, 0.5, 0.5]; 3],
            ..Pixels::default()
        };
        let one = pixels([1, 2, 3], [1.0, 2.0, f32::INFINITY], 0.25);
        let mut all = Differences::default();
        all.add(&one, &one);
        assert_eq!(all, Differences { pixels: 3, ..Differences::default() });
        all.add(&one, &pixels([1, 5, 3], [1.0f32.next_up().next_up(), 9.0, f32::INFINITY], 0.75));
        assert_eq!((all.pixels, all.ids, all.depth_ulps), (6, 1, 2));
        // Half of the pixels differ by 0.5 in one of three channels.
        assert_eq!(all.radiance_rmse(), (0.25f64 / 6.0).sqrt());
    }
}
