//! What the bench writes: one JSON file, a CSV a table, Markdown and an offline page, all of the same tables.

use super::args::Settings;
use super::cells::{Cells, FORMAT, Measured};
use super::paper::PaperScene;
use super::plan::{Case, Group, SceneId};
use super::{counts, plots, tables};
use crate::output::atomic;
use anyhow::Result;
use brickwalk_report::{Section, Sheet, Table, Value, write_sheet};
use serde_json::json;
use std::fmt::Write;
use std::path::Path;

const TITLE: &str = "The experiments of CHC+RT";
const READING: &str = "Ratios are of medians over the repetitions of the mean frame; what is compared takes turns in one process. The \
                       paper: Mattausch et al. 2015, an NVIDIA Titan, 1920 x 1080, 20 secondary rays a pixel; its scenes are like ours \
                       in size and kind, not the same.";

/// Writes the results; returns what to print.
///
/// # Errors
/// The folder cannot be written.
pub fn write(folder: &Path, settings: &Settings, cells: &Cells, groups: &[Group], notes: &[String]) -> Result<String> {
    let cases: Vec<Case> = groups.iter().flat_map(|group| group.cases.iter().copied()).collect();
    let measured = Measured::new(cells.all(), settings.skip as usize);
    let tables = tables::all(&cases, &measured);
    let planned: u64 = groups.iter().map(|group| u64::from(group.repetitions) * group.cases.len() as u64).sum();
    let done = cells.all().len() as u64;
    let header = cells.header();
    let unmet = settings.unmet();
    let json = json!({
        "format": FORMAT,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": header.commit,
        "adapter": header.adapter,
        "settings": header.settings,
        "rules_not_met": unmet,
        "not_measured": notes,
        "walks": done,
        "walks_planned": planned,
        "runs": cells.runs(),
        "tables": tables,
        "cells": cells.all(),
    });
    atomic::write(&folder.join("chc.json"), (serde_json::to_string_pretty(&json)? + "\n").as_bytes())?;
    for table in &tables {
        atomic::write(&folder.join(format!("{}.csv", table.name)), table.to_csv().as_bytes())?;
    }
    let facts = facts(settings, cells);
    let mut warnings: Vec<String> = unmet.iter().map(|rule| format!("rule not met: {rule}")).collect();
    warnings.extend(notes.iter().map(|note| format!("not measured: {note}")));
    if done < planned {
        warnings.insert(0, format!("{done} of {planned} walks are measured"));
    }
    if cells.runs() > 1 {
        warnings.push(format!("measured in {} runs: walks of different runs were not interleaved", cells.runs()));
    }
    atomic::write(&folder.join("chc.md"), markdown(&facts, &warnings, &tables).as_bytes())?;
    let mut verdicts: Vec<(String, bool)> = warnings.iter().map(|text| (text.clone(), true)).collect();
    if done >= planned {
        verdicts.insert(0, (format!("all {planned} walks are measured"), false));
    }
    let mut sections: Vec<Section> = tables.iter().map(section).collect();
    let size = (settings.size.width, settings.size.height);
    let drawn = [
        ("Figure 5", plots::tiles(&cases, &measured, size)),
        ("Figure 7", plots::frame_times(&cases, &measured)),
        ("Figure 8", plots::phases(&cases, &measured)),
    ];
    sections.extend(drawn.map(|(title, plots)| Section { title: title.into(), plots, ..Section::default() }));
    if let Some(first) = sections.first_mut() {
        first.reading = READING.into();
    }
    let sheet = Sheet { kicker: "brickwalk · bench chc".into(), title: TITLE.into(), verdicts, facts, sections };
    write_sheet(folder, &sheet)?;
    Ok(summary(folder, done, planned, &tables, &warnings))
}

fn section(table: &Table) -> Section {
    let title = match table.name.as_str() {
        "table2" => "Table 2: in core",
        "table3" => "Table 3: out of core",
        "table4" => "Table 4: aggressive culling",
        "table5" => "Table 5: random turns",
        "figure5" => "Sizes of tiles",
        "targets" => "Moved against needed",
        _ => "What size costs",
    };
    Section { title: title.into(), tables: vec![table.clone()], ..Section::default() }
}

fn facts(settings: &Settings, cells: &Cells) -> Vec<(String, String)> {
    let header = cells.header();
    let text = |value: &serde_json::Value| value.as_str().unwrap_or("unknown").to_string();
    let driver = format!("{} {}", text(&header.adapter["driver"]), text(&header.adapter["driver_info"]));
    let scenes = [SceneId::City, SceneId::CityLarge, SceneId::Pipes, SceneId::Pipes16];
    let beside = scenes.map(|scene| format!("{}: {}", scene.name(), scene.paper().map_or("none", PaperScene::name)));
    let facts = [
        ("Scenes beside the paper's", beside.join("; ")),
        ("Adapter", format!("{} ({})", text(&header.adapter["name"]), text(&header.adapter["backend"]))),
        ("Driver", driver.trim().to_string()),
        ("Commit", header.commit.clone()),
        ("Triangles of city, large city, pipes", counts(settings)),
        ("Resolution", settings.size.to_string()),
        ("Tile", format!("{} px", header.settings["tile"])),
        ("Rays a pixel", format!("1 primary, {} of ao, {} of diffuse", settings.rays, settings.rays)),
        ("Frames", format!("{}, of which the first {} left out of times", settings.frames, settings.skip)),
        ("Walks of each case", settings.repeat.to_string()),
    ];
    facts.map(|(name, value)| (name.to_string(), value)).to_vec()
}

fn markdown(facts: &[(String, String)], warnings: &[String], tables: &[Table]) -> String {
    let mut text = format!("# {TITLE}\n\n{READING}\n\n");
    // Writing to a string does not fail.
    for (name, value) in facts {
        let _ = writeln!(text, "- {name}: {value}");
    }
    for warning in warnings {
        let _ = writeln!(text, "- **{warning}**");
    }
    for table in tables {
        let _ = write!(text, "\n## {}\n\n{}\n\n{}", section(table).title, table.caption, table.to_markdown());
    }
    text
}

/// The ratios that stand beside one of the paper's, in lines for a terminal.
fn summary(folder: &Path, done: u64, planned: u64, tables: &[Table], warnings: &[String]) -> String {
    let mut text = String::new();
    if let Some(table2) = tables.iter().find(|table| table.name == "table2") {
        let column = |name: &str| table2.columns.iter().position(|column| column == name);
        let columns = ["over plain, wall", "over plain-bvh2, wall", "paper"].map(column);
        if let [Some(plain), Some(binary), Some(paper)] = columns {
            let _ = writeln!(
                text,
                "{:<40} {:>10} {:>16} {:>10}",
                "in core, wall time", "over plain", "over plain-bvh2", "paper"
            );
            for row in table2.rows.iter().filter(|row| row[paper] != Value::Missing) {
                let name = row[..4].iter().map(Value::show).collect::<Vec<_>>().join(" ");
                let [plain, binary, paper] = [plain, binary, paper].map(|at| row[at].show());
                let _ = writeln!(text, "{name:<40} {plain:>10} {binary:>16} {paper:>10}");
            }
        }
    }
    for warning in warnings {
        let _ = writeln!(text, "{warning}");
    }
    let report = folder.join("report.html");
    let _ = writeln!(text, "{done} of {planned} walks; {}", report.display());
    text
}
