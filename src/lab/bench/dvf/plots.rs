//! Plots of the bench: what its figures show, of every scene that was measured.

use super::args::{DvfBenchArgs, Stage, Way};
use super::flicker::FRAMES;
use super::key;
use crate::lab::bench::results::plot;
use crate::lab::bench::store::Rows;
use brickwalk_report::{Graph, Line, Unit};

/// A plot of the measurements of a stage: a line for each set of options but the one that runs along the axis.
struct Plot {
    stage: Stage,
    /// The title, before the scene's name.
    title: &'static str,
    /// How to read it.
    reading: &'static str,
    /// The option that runs along the horizontal axis, and what that is called.
    across: (&'static str, &'static str),
    /// The value that runs upward, and by what it is multiplied.
    value: (&'static str, f64),
    unit: Unit,
}

/// A plot of errors.
const fn errors(
    stage: Stage,
    title: &'static str,
    across: (&'static str, &'static str),
    reading: &'static str,
) -> Plot {
    Plot { stage, title, reading, across, value: ("flip", 100.0), unit: Unit::Percent }
}

const CELLS: (&str, &str) = ("--dvf-cells", "cells");

/// Plots whose horizontal axis is an option.
const PLOTS: [Plot; 6] = [
    errors(
        Stage::Points,
        "Error over points",
        ("--dvf-points", "points"),
        "Hundredths of FLIP. Points are those asked for.",
    ),
    errors(Stage::Grid, "Error over cells along the longest side", CELLS, "Hundredths of FLIP."),
    Plot {
        value: ("fewer", 1.0),
        unit: Unit::Count,
        ..errors(
            Stage::Grid,
            "Fewer rays over cells along the longest side",
            CELLS,
            "Rays without a field over rays traced with it, and the ratio of their times, in the next plot.",
        )
    },
    Plot {
        value: ("faster", 1.0),
        unit: Unit::Count,
        ..errors(Stage::Grid, "Faster over cells along the longest side", CELLS, "")
    },
    errors(Stage::Rays, "Error over rays of a point", ("--dvf-rays", "rays"), "Hundredths of FLIP."),
    Plot {
        value: ("seconds", 1e3),
        unit: Unit::Milliseconds,
        ..errors(Stage::Lanes, "Time of making a field over lanes", ("--dvf-lanes", "lanes"), "")
    },
];

/// What a measurement is called in its row: its options without those that all have.
pub fn short(options: &str) -> String {
    options.replace("--dvf-", "")
}

/// The value of an option, and the options without it.
fn split(options: &str, option: &str) -> Option<(f64, String)> {
    let words: Vec<&str> = options.split_whitespace().collect();
    let at = words.iter().position(|word| *word == option)?;
    let value = words.get(at + 1)?.parse().ok()?;
    Some((value, [&words[..at], &words[at + 2..]].concat().join(" ")))
}

/// All plots of a stage.
pub fn of(stage: Stage, args: &DvfBenchArgs, scenes: &[&str], rows: &Rows) -> Vec<Graph> {
    let of_scene = |scene: &&str| -> Vec<Graph> {
        if stage == Stage::Flicker {
            return vec![over_frames(args, scene, rows)];
        }
        PLOTS.iter().filter(|plot| plot.stage == stage).map(|plot| drawn(plot, args, scene, rows)).collect()
    };
    scenes.iter().flat_map(of_scene).collect()
}

fn drawn(own: &Plot, args: &DvfBenchArgs, scene: &str, rows: &Rows) -> Graph {
    let mut lines: Vec<Line> = Vec::new();
    for options in args.names(own.stage) {
        let Some((x, rest)) = split(&options, own.across.0) else { continue };
        let Some(y) = rows.value(&key(scene, own.stage, &options), own.value.0) else { continue };
        let (name, point) = (short(&rest), (x, own.value.1 * y));
        match lines.iter_mut().find(|(other, _)| *other == name) {
            Some((_, points)) => points.push(point),
            None => lines.push((name, vec![point])),
        }
    }
    plot(format!("{}, {scene}", own.title), own.reading, own.across.1, own.unit, lines)
}

/// What pixels change by in every frame.
fn over_frames(args: &DvfBenchArgs, scene: &str, rows: &Rows) -> Graph {
    let line = |options: String| -> Option<Line> {
        let key = key(scene, Stage::Flicker, &options);
        let noise = rows.value(&key, "noise_p99")?;
        let at =
            |frame: u32| Some((f64::from(frame), rows.value(&key, &format!("change_greatest at {frame}"))? / noise));
        let name = options.split("--dvf-mode ").last().unwrap_or_default();
        let way = [Way::Anew, Way::Renewed].into_iter().find(|way| options.starts_with(way.name()));
        let name = way.map_or_else(|| name.to_string(), |way| format!("{name}, {}", way.name().trim_end()));
        Some((name, (1..FRAMES).filter_map(at).collect()))
    };
    let reading = "Of pixels whose rays have the same answers, in parts of what 99 of 100 pixels differ by noise.";
    let lines = args.names(Stage::Flicker).into_iter().filter_map(line).collect();
    plot(format!("Greatest change over frames, {scene}"), reading, "frame", Unit::Count, lines)
}
