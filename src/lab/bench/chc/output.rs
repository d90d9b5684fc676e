//! What the bench writes, and what it prints.

use super::cells::{Cell, Measured};
use super::plan::{Case, Walk};
use super::{paper, plots, tables};
use crate::lab::bench::args::Settings;
use crate::lab::bench::results::Results;
use crate::lab::bench::scenes::SceneId;
use crate::lab::bench::store::Store;
use crate::settings::sizes::human_count;
use anyhow::Result;
use brickwalk_report::{Section, Table, Value};
use serde_json::json;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

const TITLE: &str = "The experiments of CHC+RT";
const READING: &str = "Ratios compare medians over repetitions of the mean frame; what is compared takes turns in one \
                       process. The paper: Mattausch et al. 2015, an NVIDIA Titan, 1920 x 1080, 20 secondary rays per \
                       pixel; its scenes resemble ours in size and kind, not the same.";

/// Writes the results; returns what to print.
///
/// # Errors
/// The folder cannot be written.
pub fn write(
    folder: &Path,
    settings: &Settings,
    store: &Store<Cell>,
    walks: &[Walk],
    notes: &[String],
) -> Result<String> {
    let cases: Vec<Case> = walks.iter().filter(|walk| walk.1 == 0).map(|walk| walk.0).collect();
    let measured = Measured { cases, cells: store.all(), skip: settings.skip as usize };
    let mut sections = tables::all(&measured);
    let (done, planned) = (store.all().len(), walks.len());
    let runs = store.all().iter().map(|cell| cell.run).collect::<BTreeSet<u32>>().len();
    let unmet = settings.unmet();
    let json = json!({
        "rules_not_met": unmet,
        "not_measured": notes,
        "walks": done,
        "walks_planned": planned,
        "runs": runs,
        "cells": store.all(),
    });
    let part = (done < planned).then(|| format!("{done} of {planned} walks are measured"));
    let unmet = unmet.iter().map(|rule| format!("rule not met: {rule}"));
    let notes = notes.iter().map(|note| format!("not measured: {note}"));
    let apart = (runs > 1).then(|| format!("measured in {runs} runs: walks of different runs were not interleaved"));
    let warnings: Vec<String> = part.into_iter().chain(unmet).chain(notes).chain(apart).collect();
    let whole = (done >= planned).then(|| (format!("all {planned} walks are measured"), false));
    let verdicts = whole.into_iter().chain(warnings.iter().map(|text| (text.clone(), true))).collect();
    let text = summary(folder, (done, planned), &sections, &warnings);
    let size = (settings.size.width, settings.size.height);
    let drawn = [
        ("Figure 5", plots::tiles(&measured, size, settings.tile)),
        ("Figure 7", plots::frame_times(&measured)),
        ("Figure 8", plots::phases(&measured)),
    ];
    sections.extend(drawn.map(|(title, plots)| Section { title: title.into(), plots, ..Section::default() }));
    let header = &store.header;
    let facts = facts(settings);
    Results { name: "chc", title: TITLE, reading: READING, header, facts, verdicts, json, sections }.write(folder)?;
    Ok(text)
}

fn facts(settings: &Settings) -> Vec<(&'static str, String)> {
    let Settings { size, tile, rays, frames, skip, repeat, .. } = settings;
    let beside = |scene: &SceneId| Some(format!("{scene}: {}", paper::scene(*scene)?.name));
    vec![
        ("Scenes beside the paper's", SceneId::ALL.iter().filter_map(beside).collect::<Vec<_>>().join("; ")),
        ("Triangles of city, large city, pipes", settings.triangles.map(human_count).join(", ")),
        ("Resolution", size.to_string()),
        ("Tile", format!("{tile} px")),
        ("Rays a pixel", format!("1 primary, {rays} of ao, {rays} of diffuse")),
        ("Frames", format!("{frames}, of which the first {skip} left out of times")),
        ("Walks of each case", repeat.to_string()),
    ]
}

/// The ratios that stand beside one of the paper's, in lines for a terminal.
fn summary(folder: &Path, (done, planned): (usize, usize), sections: &[Section], warnings: &[String]) -> String {
    let mut text = String::new();
    // Writing to a string does not fail.
    let mut line = |row: [&str; 4]| {
        let [name, plain, binary, paper] = row;
        let _ = writeln!(text, "{name:<40} {plain:>10} {binary:>16} {paper:>10}");
    };
    let table2 = sections.iter().flat_map(|section| &section.tables).find(|table| table.name == "table2");
    if let Some(Table { columns, rows, .. }) = table2 {
        line(["speed-up in core, wall time", "over plain", "over plain-bvh2", "paper"]);
        let entry =
            |row: &[Value], name: &str| columns.iter().position(|column| column == name).map(|at| row[at].clone());
        for row in rows {
            let all =
                ["speed-up over plain, wall", "speed-up over plain-bvh2, wall", "paper"].map(|name| entry(row, name));
            let [Some(plain), Some(binary), Some(paper)] = all else { continue };
            if paper != Value::Missing {
                let name = row[..4].iter().map(Value::show).collect::<Vec<_>>().join(" ");
                line([&name, &plain.show(), &binary.show(), &paper.show()]);
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
