//! `brickwalk bench roma`: the experiments of Zeng et al. 2023 on the generated scenes: times of making and tracing
//! ray-aligned occupancy maps, and distance fields beside them, and how far pictures by them are from exact ones.
//!
//! A *view* is a scene, a light and a cache with one renderer, in which the ways to answer rays take turns. Each
//! finished measurement is a line of `rows.jsonl`, from which alone tables, plots and pages are made.

pub mod args;
mod leaks;
mod output;
mod plan;
mod seams;
mod view;

use super::args::wanted;
use super::runner::Runner;
use super::scenes::Scenes;
use super::store::{Header, Row, Rows, Values, median};
use crate::lab::console::Console;
use crate::output::atomic;
use anyhow::Result;
use args::{RomaBenchArgs, Settings};
use plan::{Job, Stage, Way};
use seams::Seams;
use serde_json::json;
use std::collections::{BTreeMap, BTreeSet};
use view::View;

/// Raised when a value changes its meaning.
const FORMAT: u32 = 2;

/// Runs the command.
///
/// # Errors
/// The folder holds other measurements or cannot be written; a scene cannot be generated or read; the device's.
pub fn run(args: &RomaBenchArgs, console: Console) -> Result<()> {
    let (settings, console) = (args.settings(), console.within(args.minutes));
    let stages = wanted(Stage::ALL, &args.stages);
    let mut jobs = plan::jobs(&settings, args.sponza.is_some());
    jobs.retain(|job| stages.contains(&job.stage));
    let leaks = if stages.contains(&Stage::Leaks) { &LEAKS[..] } else { &[] };
    atomic::create_folder(&args.output)?;
    let triangles = [settings.triangles; 3];
    let scenes = Scenes::new(args.scenes.as_deref(), &args.output, triangles, args.sponza.as_deref(), console);
    let own = json!({
        "triangles": settings.triangles,
        "size": settings.size.to_string(),
        "repetitions": settings.repeat,
        "samples": settings.samples,
        "ao_length": settings.ao_length,
        "sponza": scenes.sponza_name(),
    });
    let mut rows = Rows::open(args.output.join("rows.jsonl"), Header::new(FORMAT, &args.adapter, own)?, false)?;
    let mut runner = Runner::new(console);
    // Ways are compared with each other, so that all of a job are measured together.
    let keys = |job: &Job| job.ways.iter().map(|way| job.key(way)).collect();
    runner.measure(&mut rows, &jobs, keys, |job| measure(job, args, &settings, &scenes, console))?;
    runner.measure(
        &mut rows,
        leaks,
        |(name, _)| vec![leak_key(name)],
        |(name, is_raster)| Ok(vec![Row { key: leak_key(name), values: leak_values(*is_raster) }]),
    )?;
    let planned = jobs.iter().map(|job| job.ways.len()).sum::<usize>() + leaks.len();
    let text = output::write(&args.output, &settings, &rows, planned)?;
    runner.end(&args.output, &text)
}

/// How base maps are made whose leaks are measured, and whether that is by rasterising.
const LEAKS: [(&str, bool); 2] = [("raster", true), ("conservative", false)];

fn leak_key(name: &str) -> String {
    format!("{}/{name}", Stage::Leaks.name())
}

/// Per cent of columns, by the width of maps and the number of look-ups.
fn leak_values(is_raster: bool) -> Values {
    let of = |(wide, values): (usize, [f64; 3])| {
        leaks::SAMPLES.into_iter().zip(values).map(move |(samples, value)| (leak_name(wide, samples), value))
    };
    leaks::leaks(is_raster).into_iter().enumerate().flat_map(of).collect()
}

/// The name of the value of map width number `wide`.
fn leak_name(wide: usize, samples: u32) -> String {
    format!("wide {wide}, {samples} samples")
}

/// Everything that is measured of the ways of a job.
fn measure(
    job: &Job,
    args: &RomaBenchArgs,
    settings: &Settings,
    scenes: &Scenes,
    console: Console,
) -> Result<Vec<Row>> {
    let place = scenes.place(job.scene)?;
    let mut all: Vec<(Way, Values)> = job.ways.iter().map(|way| (*way, Values::new())).collect();
    let mut view = View::open(job, &place, settings, &args.adapter, console)?;
    if job.times {
        // In turns: a drift of the machine meets all ways alike. What the first turn brings in is not counted.
        let mut turns: Vec<Vec<Values>> = vec![Vec::new(); all.len()];
        for turn in 0..=settings.repeat {
            for (k, (way, _)) in all.iter().enumerate() {
                let picture = view.picture(way, 1, turn)?;
                if turn > 0 || job.is_cold {
                    turns[k].push(picture.values);
                }
            }
        }
        for ((_, values), turns) in all.iter_mut().zip(turns) {
            values.extend(by_name(&turns, median));
        }
    }
    if job.stage == Stage::Seams {
        measure_seams(&mut view, &mut all, job, settings)?;
    } else if job.errors {
        measure_errors(&mut view, &mut all, job, settings)?;
    }
    Ok(all.into_iter().map(|(way, values)| Row { key: job.key(&way), values }).collect())
}

/// Errors, means over the frames.
fn measure_errors(view: &mut View, all: &mut [(Way, Values)], job: &Job, settings: &Settings) -> Result<()> {
    let mut found = vec![Vec::new(); all.len()];
    for &frame in job.frames {
        view.look(frame);
        let exact = view.picture(&Way::Exact, settings.samples, 0)?;
        for ((way, _), found) in all.iter().zip(&mut found) {
            // What the reference's own noise is: another one, of other samples.
            let seed = u32::from(*way == Way::Exact);
            let converged = view.picture(way, settings.samples, seed)?;
            let mut errors: Values = view.errors("converged", &converged, &exact)?.into_iter().collect();
            errors.extend(view.cells());
            if *way != Way::Exact {
                let single = view.picture(way, 1, 0)?;
                errors.extend(view.errors("single", &single, &exact)?);
            }
            found.push(errors);
        }
    }
    for ((_, values), found) in all.iter_mut().zip(found) {
        values.extend(by_name(&found, |values| Some(values.iter().sum::<f64>() / values.len() as f64)));
    }
    Ok(())
}

/// Errors by the distance from seams, of several frames together.
fn measure_seams(view: &mut View, all: &mut [(Way, Values)], job: &Job, settings: &Settings) -> Result<()> {
    let mut found = vec![Seams::default(); all.len()];
    for &frame in job.frames {
        view.look(frame);
        let exact = view.picture(&Way::Exact, settings.samples, 0)?;
        for ((way, _), seams) in all.iter().zip(&mut found).filter(|((way, _), _)| *way != Way::Exact) {
            let picture = view.picture(way, settings.samples, 0)?;
            view.add_seams(seams, &picture, &exact);
        }
    }
    for ((_, values), seams) in all.iter_mut().zip(found) {
        for (bin, (count, bias, size)) in seams.errors() {
            let own = [("pixels", count as f64), ("bias", bias), ("error", size)];
            values.extend(own.map(|(name, x)| (format!("{name} at {bin}"), x)));
        }
    }
    Ok(())
}

/// What `of` makes of the values of each name.
fn by_name(all: &[Values], of: impl Fn(Vec<f64>) -> Option<f64>) -> Values {
    let names: BTreeSet<&String> = all.iter().flat_map(BTreeMap::keys).collect();
    let named = |name: &String| of(all.iter().filter_map(|values| values.get(name).copied()).collect());
    names.into_iter().filter_map(|name| Some((name.clone(), named(name)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_are_taken_value_by_value() {
        let turn = |a: f64, b: Option<f64>| {
            let mut values = Values::from([("a".to_string(), a)]);
            values.extend(b.map(|b| ("b".to_string(), b)));
            values
        };
        let all = by_name(&[turn(3.0, None), turn(1.0, Some(7.0)), turn(2.0, None)], median);
        assert_eq!(all, turn(2.0, Some(7.0)));
        assert!(by_name(&[], median).is_empty());
        let sums = by_name(&[turn(3.0, None), turn(1.0, Some(7.0))], |values| Some(values.iter().sum()));
        assert_eq!(sums, turn(4.0, Some(7.0)));
    }
}
