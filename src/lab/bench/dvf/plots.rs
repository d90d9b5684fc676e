//! Plots of the bench: what its figures show, of every scene that was measured.

use super::args::{DvfBenchArgs, Stage, Way};
use super::flicker::FRAMES;
use super::key;
use crate::lab::bench::rows::Rows;
use brickwalk_report::{Graph, GraphShape, Line, Unit};

/// A plot of the measurements of a stage: a line for each set of options but the one that runs along the axis.
struct Plot {
    /// The title, before the scene's name.
    title: &'static str,
    /// How to read it.
    reading: &'static str,
    /// The option that runs along the horizontal axis.
    option: &'static str,
    /// What that is called.
    across: &'static str,
    /// The value that runs upward, and by what it is multiplied.
    value: (&'static str, f64),
    unit: Unit,
}

/// Hundredths of FLIP.
const FLIP: (&str, f64) = ("flip", 100.0);

/// The plots of a stage.
fn plots(stage: Stage) -> Vec<Plot> {
    let plot = |title, option, across, value, unit| Plot { title, reading: "", option, across, value, unit };
    match stage {
        Stage::Points => vec![Plot {
            reading: "Hundredths of FLIP. Points are those asked for.",
            ..plot("Error over points", "--dvf-points", "points", FLIP, Unit::Percent)
        }],
        Stage::Grid => vec![
            Plot {
                reading: "Hundredths of FLIP.",
                ..plot("Error over cells along the longest side", "--dvf-cells", "cells", FLIP, Unit::Percent)
            },
            Plot {
                reading: "Rays without a field over rays traced with it, and the ratio of their times, in the next plot.",
                ..plot(
                    "Fewer rays over cells along the longest side",
                    "--dvf-cells",
                    "cells",
                    ("fewer", 1.0),
                    Unit::Count,
                )
            },
            plot("Faster over cells along the longest side", "--dvf-cells", "cells", ("faster", 1.0), Unit::Count),
        ],
        Stage::Rays => vec![Plot {
            reading: "Hundredths of FLIP.",
            ..plot("Error over rays of a point", "--dvf-rays", "rays", FLIP, Unit::Percent)
        }],
        Stage::Lanes => vec![plot(
            "Time of making a field over lanes",
            "--dvf-lanes",
            "lanes",
            ("seconds", 1e3),
            Unit::Milliseconds,
        )],
        _ => Vec::new(),
    }
}

/// The value of an option, and the options without it.
fn split(options: &str, option: &str) -> Option<(f64, String)> {
    let words: Vec<&str> = options.split_whitespace().collect();
    let at = words.iter().position(|word| *word == option)?;
    let value = words.get(at + 1)?.parse().ok()?;
    Some((value, [&words[..at], &words[at + 2..]].concat().join(" ")))
}

/// All plots of a stage, of the scenes of which there is something to draw.
pub fn of(stage: Stage, args: &DvfBenchArgs, scenes: &[&str], rows: &Rows) -> Vec<Graph> {
    if stage == Stage::Flicker {
        return scenes.iter().filter_map(|scene| over_frames(args, scene, rows)).collect();
    }
    let all = plots(stage);
    let of_scene =
        |scene: &&str| all.iter().filter_map(|plot| drawn(plot, stage, args, scene, rows)).collect::<Vec<_>>();
    scenes.iter().flat_map(of_scene).collect()
}

fn drawn(plot: &Plot, stage: Stage, args: &DvfBenchArgs, scene: &str, rows: &Rows) -> Option<Graph> {
    let mut lines: Vec<Line> = Vec::new();
    for options in args.names(stage) {
        let Some((x, rest)) = split(&options, plot.option) else { continue };
        let Some(y) = rows.value(&key(scene, stage, &options), plot.value.0) else { continue };
        let (name, point) = (rest.replace("--dvf-", ""), (x, plot.value.1 * y));
        match lines.iter_mut().find(|(other, _)| *other == name) {
            Some((_, points)) => points.push(point),
            None => lines.push((name, vec![point])),
        }
    }
    lines.iter_mut().for_each(|(_, points)| points.sort_by(|a, b| a.0.total_cmp(&b.0)));
    let title = format!("{}, {scene}", plot.title);
    let shape = GraphShape::Lines { across: plot.across, unit: plot.unit, lines };
    let is_empty = matches!(&shape, GraphShape::Lines { lines, .. } if lines.is_empty());
    (!is_empty).then(|| Graph { title, reading: plot.reading.into(), shape })
}

/// What pixels change by in every frame.
fn over_frames(args: &DvfBenchArgs, scene: &str, rows: &Rows) -> Option<Graph> {
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
    let lines: Vec<Line> = args.names(Stage::Flicker).into_iter().filter_map(line).collect();
    (!lines.is_empty()).then(|| Graph {
        title: format!("Greatest change over frames, {scene}"),
        reading: "Of pixels whose rays have the same answers, in parts of what 99 of 100 pixels differ by noise."
            .into(),
        shape: GraphShape::Lines { across: "frame", unit: Unit::Count, lines },
    })
}
