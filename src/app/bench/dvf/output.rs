//! What the bench writes: one JSON file, a CSV a table, Markdown and an offline page, all of the same tables.

use super::args::{DvfBenchArgs, Stage};
use super::{FORMAT, file, key};
use crate::app::bench::roma::rows::Rows;
use crate::app::output::atomic;
use crate::app::sizes::human_count;
use anyhow::Result;
use brickwalk_report::{Section, Sheet, Table, Value, write_sheet};
use serde_json::json;
use std::fmt::Write;

const TITLE: &str = "The experiments of discrete visibility fields";
const READING: &str = "Fewer rays: rays to the environment without a field over those that are traced with it; all of them are the same rays, so \
                       errors are those of the field alone (in the mode of the paper: of other rays, too). Errors are those of linear radiance; FLIP at 67 \
                       pixels per degree. Paper: Günay and Akyüz 2025, Sponza, 128 rays a pixel, an RTX 4060.";

/// What the paper has of Sponza: options, then RMSE and FLIP. Figure 13 has 80K and 400K points of 77 cells, figure 14 10M points.
const PAPER: [(&str, f64, f64); 11] = [
    ("--dvf-points 80000 rounding hash", 0.330940, 0.499832),
    ("--dvf-points 80000 ceiling hash", 0.113394, 0.090513),
    ("--dvf-points 80000 ceiling hammersley", 0.109425, 0.145041),
    ("--dvf-points 400000 rounding hash", 0.209978, 0.215490),
    ("--dvf-points 400000 ceiling hash", 0.013245, 0.022700),
    ("--dvf-points 400000 ceiling hammersley", 0.028231, 0.054061),
    ("--dvf-cells 155", 0.006531, 0.008956),
    ("--dvf-cells 77", 0.002604, 0.001792),
    ("--dvf-cells 40", 0.001072, 0.000357),
    ("--dvf-cells 21", 0.000423, 0.000082),
    ("--dvf-cells 12", 0.000120, 0.000010),
];

/// What the paper has of a measurement of Sponza: RMSE and FLIP.
fn paper(stage: Stage, scene: &str, options: &str) -> [Option<f64>; 2] {
    let first = match stage {
        Stage::Points => "--dvf-points",
        Stage::Grid => "--dvf-cells",
        _ => return [None; 2],
    };
    let options: Vec<&str> = options.split_whitespace().collect();
    let has = |words: &str| words.starts_with(first) && words.split_whitespace().all(|word| options.contains(&word));
    let found = PAPER.iter().find(|(words, ..)| scene.contains("sponza") && has(words));
    [found.map(|paper| paper.1), found.map(|paper| paper.2)]
}

/// Writes the results; returns what to print.
///
/// # Errors
/// The folder cannot be written.
pub fn write(args: &DvfBenchArgs, scenes: &[&str], rows: &Rows, planned: usize) -> Result<String> {
    let tables: Vec<(Stage, Table)> = Stage::ALL
        .into_iter()
        .map(|stage| (stage, table(args, scenes, stage, rows)))
        .filter(|(_, table)| !table.rows.is_empty())
        .collect();
    let header = rows.header();
    let json = json!({
        "format": FORMAT,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": header.commit,
        "adapter": header.adapter,
        "settings": header.settings,
        "tables": tables.iter().map(|(_, table)| table).collect::<Vec<_>>(),
        "rows": rows.all(),
    });
    let folder = &args.output;
    atomic::write(&file(folder, "dvf.json"), (serde_json::to_string_pretty(&json)? + "\n").as_bytes())?;
    for (_, table) in &tables {
        atomic::write(&file(folder, &format!("{}.csv", table.name)), table.to_csv().as_bytes())?;
    }
    let text = |value: &serde_json::Value| value.as_str().unwrap_or("unknown").to_string();
    let facts: Vec<(String, String)> = [
        ("Adapter", format!("{} ({})", text(&header.adapter["name"]), text(&header.adapter["backend"]))),
        ("Commit", header.commit.clone()),
        ("Resolution", args.size.to_string()),
        ("Rays a pixel", args.samples.to_string()),
        ("Most points", human_count(args.points.into())),
    ]
    .map(|(name, value)| (name.to_string(), value))
    .to_vec();
    let mut page = format!("# {TITLE}\n\n{READING}\n\n");
    // Writing to a string does not fail.
    for (name, value) in &facts {
        let _ = writeln!(page, "- {name}: {value}");
    }
    for (stage, table) in &tables {
        let _ = write!(page, "\n## {}\n\n{}", stage.title(), table.to_markdown());
    }
    atomic::write(&file(folder, "dvf.md"), page.as_bytes())?;
    let section = |(stage, table): (Stage, Table)| Section {
        title: stage.title().into(),
        tables: vec![table],
        ..Section::default()
    };
    let mut sections: Vec<Section> = tables.into_iter().map(section).collect();
    if let Some(first) = sections.first_mut() {
        first.reading = READING.into();
    }
    let done = rows.all().len();
    let verdicts = vec![(format!("{done} measurements; {planned} were asked for"), done < planned)];
    let sheet = Sheet { kicker: "brickwalk · bench dvf".into(), title: TITLE.into(), verdicts, facts, sections };
    write_sheet(folder, &sheet)?;
    Ok(page)
}

/// What a measurement is called in its row: its options without those that all have.
fn short(options: &str) -> String {
    options.replace("--dvf-", "")
}

fn table(args: &DvfBenchArgs, scenes: &[&str], stage: Stage, rows: &Rows) -> Table {
    let mut columns = vec![
        "scene",
        "options",
        "points",
        "cells",
        "fewer rays",
        "faster",
        "FLIP",
        "RMSE",
        "pixels that differ, %",
        "field, s",
    ];
    match stage {
        Stage::Points | Stage::Grid => columns.extend(["RMSE, paper", "FLIP, paper"]),
        Stage::Memory => {
            columns.extend(["bricks loaded", "needed", "loaded ÷ needed", "read", "pixels other than in core"])
        }
        _ => {}
    }
    let mut lines = Vec::new();
    for scene in scenes {
        for options in args.measurements(stage) {
            let key = key(scene, stage, &options);
            if !rows.has(&key) {
                continue;
            }
            let value = |name: &str| rows.value(&key, name);
            let mut line = vec![
                Value::Text(scene.to_string()),
                Value::Text(short(&options)),
                Value::number(value("points")),
                Value::number(value("longest")),
                Value::ratio(value("fewer")),
                Value::ratio(value("faster")),
                Value::number(value("flip")),
                Value::number(value("rmse")),
                Value::number(value("pixels_that_differ").map(|share| 100.0 * share)),
                Value::number(value("seconds")),
            ];
            match stage {
                Stage::Points | Stage::Grid => line.extend(paper(stage, scene, &options).map(Value::number)),
                Stage::Memory => line.extend([
                    Value::number(value("bricks_loaded")),
                    Value::number(value("bricks_needed")),
                    Value::ratio(value("bricks_loaded").zip(value("bricks_needed")).map(|(a, b)| a / b.max(1.0))),
                    Value::number(value("bricks_read")),
                    Value::number(value("differ_from_in_core")),
                ]),
                _ => {}
            }
            lines.push(line);
        }
    }
    let columns = columns.into_iter().map(String::from).collect();
    Table { name: stage.name().into(), caption: READING.into(), columns, rows: lines }
}
