//! The tables, plots and recommendations of a study.

use super::args::Scale;
use super::pictures;
use super::row::Row;
use crate::lab::bench::results::{Column, log_plot, table, write_json};
use crate::lab::bench::store::Store;
use crate::output::atomic;
use crate::settings::sizes::counted;
use anyhow::Result;
use brickwalk_report::{Graph, GraphShape, Line, Point, Scatter, Section, Sheet, Table, Unit, Value, write_sheet};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;

/// Methods in the order of their colours.
const METHODS: [&str; 10] =
    ["exact", "roma", "levels", "sift", "df", "denoised", "dvf", "displacement", "threshold", "taa"];
/// Errors within which the fastest setting is named.
const WITHIN: [f64; 3] = [0.02, 0.05, 0.1];
/// Frames over which what is made before them is shared.
const FRAMES: [f64; 4] = [1.0, 10.0, 100.0, 1000.0];

const READING: &str = "FLIP: mean, 67 pixels per degree, 0 is equal. Same: against the exact picture of the same rays, \
                       which shows bias alone; converged: against many samples by other rays, bias and noise. Seconds \
                       are medians of whole frames, camera rays and all that a method makes for a frame among them; \
                       making: once, before the first. Settings took turns in one process.";

/// Measurements that are compared: of an effect, with a cache.
type Group<'a> = ((&'a str, u32, bool), Vec<&'a Row>);

/// Writes study.json, study.csv and report.html; returns what to print.
///
/// # Errors
/// The folder cannot be written.
pub fn write(folder: &Path, scale: &Scale, rows: &Store<Row>, planned: usize) -> Result<String> {
    let all = means(rows.all());
    let groups = groups(&all);
    let found: Vec<String> = groups.iter().flat_map(recommendations).collect();
    let header = &rows.header;
    let json = json!({
        "format": header.format,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": header.commit,
        "adapter": header.adapter,
        "settings": header.settings,
        "measured": rows.all().len(),
        "planned": planned,
        "recommendations": found,
        "rows": rows.all(),
    });
    write_json(folder, "study", &json)?;
    let every: Vec<&Row> = rows.all().iter().collect();
    atomic::write(&folder.join("study.csv"), of_rows("study", &every).to_csv().as_bytes())?;
    let most = groups.iter().map(|((_, cache, _), _)| *cache).max();
    let pictured = |group: &Group| {
        let ((effect, cache, is_cold), _) = group;
        let is_shown = Some(*cache) == most && !is_cold;
        let of =
            |row: &&Row| is_shown && row.view == 0 && row.effect == *effect && row.cache_percent == *cache && !row.cold;
        let pictures = pictures::shown(folder, &rows.all().iter().filter(of).collect::<Vec<_>>());
        Section { pictures, ..section(group) }
    };
    let summary = Section { title: "What to use".into(), tables: vec![choices(&groups)], ..Section::default() };
    let sections = std::iter::once(summary).chain(groups.iter().map(pictured)).collect();
    let done = rows.all().len();
    let rest = if done < planned { format!(" of {planned}; the same command goes on") } else { String::new() };
    let mut verdicts = vec![(format!("{done} measurements{rest}"), done < planned)];
    let first = groups.iter().filter(|((_, cache, is_cold), _)| Some(*cache) == most && !is_cold);
    verdicts.extend(first.flat_map(verdict).map(|line| (line, false)));
    let facts = [
        ("Scene", header.settings["scene"].as_str().unwrap_or_default().to_owned()),
        ("Device", header.adapter["name"].as_str().unwrap_or_default().to_owned()),
        ("Commit", header.commit.clone()),
        ("Pictures", scale.size.to_string()),
        ("Views", scale.views.to_string()),
        ("Turns", scale.repeat.to_string()),
    ];
    let mut sheet = Sheet {
        kicker: "brickwalk · study".into(),
        title: "Error against run time".into(),
        verdicts,
        facts: facts.into_iter().map(|(name, value)| (name.into(), value)).collect(),
        sections,
    };
    if let Some(first) = sheet.sections.first_mut() {
        first.reading = READING.into();
        first.tables.retain(|table| !table.rows.is_empty());
    }
    write_sheet(folder, &sheet)?;
    let mut text = String::new();
    for group in &groups {
        text += &format!("\n## {}\n\n{}", title(group), fronts(group).to_markdown());
    }
    text += "\n";
    found.iter().for_each(|line| text += &format!("- {line}\n"));
    Ok(text)
}

/// Means over views, a row a setting.
fn means(rows: &[Row]) -> Vec<Row> {
    let mut by_setting: BTreeMap<String, Vec<&Row>> = BTreeMap::new();
    for row in rows {
        by_setting.entry(row.key.replace(&format!("view {}", row.view), "")).or_default().push(row);
    }
    let mean = |rows: Vec<&Row>| {
        let of = |value: fn(&Row) -> f64| rows.iter().map(|row| value(row)).sum::<f64>() / rows.len() as f64;
        Row {
            seconds_frame: of(|row| row.seconds_frame),
            seconds_p95: of(|row| row.seconds_p95),
            seconds_making: of(|row| row.seconds_making),
            rays_traced: of(|row| row.rays_traced as f64) as u64,
            rays_answered: of(|row| row.rays_answered as f64) as u64,
            bytes_loaded: of(|row| row.bytes_loaded),
            flip_same: of(|row| row.flip_same),
            relmse_same: of(|row| row.relmse_same),
            bias_same: of(|row| row.bias_same),
            flip_converged: of(|row| row.flip_converged),
            relmse_converged: of(|row| row.relmse_converged),
            noise_flip: of(|row| row.noise_flip),
            ..rows[0].clone()
        }
    };
    by_setting.into_values().map(mean).collect()
}

fn groups(rows: &[Row]) -> Vec<Group<'_>> {
    let mut groups: BTreeMap<(&str, std::cmp::Reverse<u32>, bool), Vec<&Row>> = BTreeMap::new();
    for row in rows {
        groups.entry((&row.effect, std::cmp::Reverse(row.cache_percent), row.cold)).or_default().push(row);
    }
    groups.into_iter().map(|((effect, cache, cold), rows)| ((effect, cache.0, cold), rows)).collect()
}

fn title(((effect, cache, cold), _): &Group) -> String {
    format!("{effect}, cache {cache} %, {}", if *cold { "cold" } else { "warm" })
}

/// Whether no other setting is both faster and nearer to the converged picture.
fn is_on_front(row: &Row, rows: &[&Row]) -> bool {
    !rows.iter().any(|other| {
        let (time, error) = (other.seconds_frame, other.flip_converged);
        time <= row.seconds_frame
            && error <= row.flip_converged
            && (time < row.seconds_frame || error < row.flip_converged)
    })
}

/// What a setting is called: its options beside those of all.
fn name(row: &Row) -> String {
    let options: Vec<&str> = row.key.splitn(7, '/').skip(6).collect();
    let rays = counted(row.rays_per_pixel.into(), "ray");
    if options.is_empty() { rays } else { format!("{rays} {}", options.join("/")) }
}

/// Frames after which a setting with something made before them has taken less time than the fastest exact one that is
/// no farther from the converged picture.
fn break_even(row: &Row, rows: &[&Row]) -> Option<f64> {
    let exact = rows.iter().filter(|other| other.method == "exact" && other.flip_converged <= row.flip_converged);
    let exact = exact.map(|other| other.seconds_frame).min_by(f64::total_cmp)?;
    (row.seconds_making > 0.0 && exact > row.seconds_frame).then(|| row.seconds_making / (exact - row.seconds_frame))
}

fn of_rows(name: &str, rows: &[&Row]) -> Table {
    let columns: [Column<(&Row, bool)>; 21] = [
        ("effect", |(row, _)| row.effect.clone().into()),
        ("cache, %", |(row, _)| f64::from(row.cache_percent).into()),
        ("cache bytes", |(row, _)| (row.cache_bytes as f64).into()),
        ("cold", |(row, _)| if row.cold { "yes" } else { "no" }.into()),
        ("view", |(row, _)| f64::from(row.view).into()),
        ("method", |(row, _)| row.method.clone().into()),
        ("less of", |(row, _)| row.source.clone().into()),
        ("rays a pixel", |(row, _)| f64::from(row.rays_per_pixel).into()),
        ("seconds", |(row, _)| row.seconds_frame.into()),
        ("p95", |(row, _)| row.seconds_p95.into()),
        ("making", |(row, _)| row.seconds_making.into()),
        ("rays traced", |(row, _)| (row.rays_traced as f64).into()),
        ("rays answered", |(row, _)| (row.rays_answered as f64).into()),
        ("bytes loaded", |(row, _)| row.bytes_loaded.into()),
        ("FLIP same", |(row, _)| row.flip_same.into()),
        ("relMSE same", |(row, _)| row.relmse_same.into()),
        ("bias same", |(row, _)| row.bias_same.into()),
        ("FLIP converged", |(row, _)| row.flip_converged.into()),
        ("relMSE converged", |(row, _)| row.relmse_converged.into()),
        ("FLIP of noise", |(row, _)| row.noise_flip.into()),
        ("command", |(row, _)| row.command.clone().into()),
    ];
    table(name, "", rows.iter().map(|&row| (row, false)), &columns)
}

/// The settings of a group, the fastest first.
fn listed(group: &Group, all: bool) -> Table {
    let ((effect, cache, cold), rows) = group;
    let mut sorted: Vec<&Row> = rows.clone();
    sorted.sort_by(|a, b| a.seconds_frame.total_cmp(&b.seconds_frame));
    sorted.retain(|row| all || is_on_front(row, rows));
    let columns: [Column<(&Row, &[&Row])>; 9] = [
        ("method", |(row, _)| row.method.clone().into()),
        ("setting", |(row, _)| name(row).into()),
        ("best", |(row, rows)| if is_on_front(row, rows) { "yes" } else { "" }.into()),
        ("ms", |(row, _)| (1e3 * row.seconds_frame).into()),
        ("FLIP converged", |(row, _)| row.flip_converged.into()),
        ("FLIP same", |(row, _)| row.flip_same.into()),
        ("making, s", |(row, _)| row.seconds_making.into()),
        ("pays after frames", |(row, rows)| Value::number(break_even(row, rows))),
        ("MB a frame", |(row, _)| (1e-6 * row.bytes_loaded).into()),
    ];
    let state = if *cold { "cold" } else { "warm" };
    let caption = "The fastest first. Best: no other setting is both faster and nearer to the converged picture.";
    table(&format!("{effect}-{cache}-{state}"), caption, sorted.iter().map(|&row| (row, &rows[..])), &columns)
}

fn fronts(group: &Group) -> Table {
    listed(group, false)
}

fn section(group: &Group) -> Section {
    let (_, rows) = group;
    Section {
        title: title(group),
        tables: sources(group).into_iter().chain([listed(group, true)]).collect(),
        plots: [plot(group)].into_iter().chain(amortised(rows)).collect(),
        ..Section::default()
    }
}

/// Error over time, a point a setting.
fn plot(group: &Group) -> Graph {
    let (_, rows) = group;
    let point = |row: &&Row| Point {
        x: 1e3 * row.seconds_frame,
        y: row.flip_converged,
        kind: row.method.clone(),
        words: vec![
            format!("{}: {}", row.method, name(row)),
            format!("{:.1} ms, FLIP {:.4}", 1e3 * row.seconds_frame, row.flip_converged),
            row.command.clone(),
        ],
        is_best: is_on_front(row, rows),
    };
    let scatter = Scatter { axes: ["ms a frame", "FLIP"], kinds: &METHODS, points: rows.iter().map(point).collect() };
    let reading = "Lower and farther left is better. No setting is both faster and nearer than those on the line; \
                   others are faint.";
    let title = format!("FLIP over time: {}", title(group));
    Graph { title, reading: reading.into(), shape: GraphShape::Points(scatter) }
}

/// Time a frame over how many frames share what is made before them, where something is.
fn amortised(rows: &[&Row]) -> Option<Graph> {
    let made = |row: &&&Row| row.seconds_making > 0.01;
    let of = |row: &&Row| {
        let points = FRAMES.map(|frames| (frames, 1e3 * (row.seconds_frame + row.seconds_making / frames)));
        (format!("{} {}", row.method, name(row)), points.to_vec())
    };
    let mut lines: Vec<Line> = rows.iter().filter(made).map(of).collect();
    if lines.is_empty() {
        return None;
    }
    let exact = rows.iter().find(|row| row.method == "exact" && row.rays_per_pixel == super::USUAL);
    lines.extend(exact.iter().map(|row| of(row)));
    let reading = "What is made before the first frame is shared by all of them.";
    Some(log_plot("Time over frames".into(), reading, "frames", Unit::Milliseconds, lines))
}

/// What each source of error is worth: how much nearer to the exact picture of the same rays the method is with less of
/// it. `None` where no source was switched.
fn sources(group: &Group) -> Option<Table> {
    let ((effect, cache, cold), rows) = group;
    let switched: Vec<(&Row, &Row)> = rows.iter().filter_map(|row| Some((*row, as_it_is(row, rows)?))).collect();
    let columns: [Column<(&Row, &Row)>; 7] = [
        ("method", |(row, _)| row.method.clone().into()),
        ("less of", |(row, _)| row.source.clone().into()),
        ("FLIP as it is", |(_, own)| own.flip_same.into()),
        ("FLIP with less", |(row, _)| row.flip_same.into()),
        ("share of the error, %", |(row, own)| share(row, own).into()),
        ("ms as it is", |(_, own)| (1e3 * own.seconds_frame).into()),
        ("ms with less", |(row, _)| (1e3 * row.seconds_frame).into()),
    ];
    let state = if *cold { "cold" } else { "warm" };
    let caption = "One source of error at a time, by the same rays. A share below 0: with less of it the error grew, \
                   because another source had hidden behind it.";
    (!switched.is_empty()).then(|| table(&format!("{effect}-{cache}-{state}-sources"), caption, switched, &columns))
}

/// The same method with nothing switched, of a row with less of a source.
fn as_it_is<'a>(row: &Row, rows: &[&'a Row]) -> Option<&'a Row> {
    let is_own = |own: &&&Row| own.source.is_empty() && own.method == row.method;
    rows.iter().find(is_own).filter(|_| !row.source.is_empty()).copied()
}

/// By how much the error is less than that of the method as it is, percent.
fn share(row: &Row, own: &Row) -> f64 {
    if own.flip_same > 0.0 { 100.0 * (1.0 - row.flip_same / own.flip_same) } else { 0.0 }
}

/// Of each method the source that counts most, in words.
fn dominant(group: &Group) -> Vec<String> {
    let (_, rows) = group;
    let mut largest: BTreeMap<&str, (&Row, f64)> = BTreeMap::new();
    for row in rows {
        let Some(own) = as_it_is(row, rows) else { continue };
        let found = share(row, own);
        let most = largest.entry(&row.method).or_insert((row, found));
        if found > most.1 {
            *most = (row, found);
        }
    }
    let line = |(method, (row, share)): (&str, (&Row, f64))| {
        let what = format!("{}: {method}", title(group));
        if share > 0.0 {
            format!("{what}: what counts most is {}, {share:.0} % of its FLIP", row.source)
        } else {
            format!("{what}: no source that was switched makes it err less")
        }
    };
    largest.into_iter().map(line).collect()
}

/// The fastest setting within an error of the converged picture, and the fastest exact one.
fn fastest<'a>((_, rows): &Group<'a>, within: f64) -> (Option<&'a Row>, Option<&'a Row>) {
    let of = |is_exact: bool| {
        let fits = rows.iter().filter(|row| row.flip_converged <= within && (!is_exact || row.method == "exact"));
        fits.min_by(|a, b| a.seconds_frame.total_cmp(&b.seconds_frame)).copied()
    };
    (of(false), of(true))
}

/// What is fastest within an error: a name and a time.
fn choice(group: &Group, within: f64) -> Option<String> {
    let (best, exact) = fastest(group, within);
    let best = best?;
    let took = format!("{:.1} ms", 1e3 * best.seconds_frame);
    let Some(exact) = exact else {
        return Some(format!("{} ({}), {took}; no exact setting is within it", best.method, name(best)));
    };
    Some(if best.method == "exact" {
        format!("nothing beats exact rays ({}), {took}", name(best))
    } else {
        let ratio = exact.seconds_frame / best.seconds_frame;
        format!("{} ({}), {took}, {ratio:.1} times as fast as exact rays", best.method, name(best))
    })
}

/// What to use within errors, in words: a line for all errors of which the same is fastest.
fn recommendations(group: &Group) -> Vec<String> {
    let dominant = dominant(group);
    if !dominant.is_empty() {
        return dominant;
    }
    let mut found: Vec<(Vec<String>, String)> = Vec::new();
    for within in WITHIN {
        let Some(choice) = choice(group, within) else { continue };
        match found.last_mut().filter(|last| last.1 == choice) {
            Some(last) => last.0.push(within.to_string()),
            None => found.push((vec![within.to_string()], choice)),
        }
    }
    let line = |(errors, choice): (Vec<String>, String)| {
        format!("{}: within FLIP {} of the converged picture: {choice}", title(group), errors.join(", "))
    };
    found.into_iter().map(line).collect()
}

/// What a reader must know first of an effect.
fn verdict(group: &Group) -> Vec<String> {
    let ((effect, ..), _) = group;
    let dominant = dominant(group);
    if !dominant.is_empty() {
        return dominant;
    }
    let line = |choice| format!("{effect}, FLIP {} or less: {choice}", WITHIN[1]);
    choice(group, WITHIN[1]).map(line).into_iter().collect()
}

/// What to use within errors, a row an effect and a cache.
fn choices(groups: &[Group]) -> Table {
    type Of<'a> = &'a Group<'a>;
    let columns: [Column<Of>; 6] = [
        ("effect", |((effect, ..), _)| (*effect).into()),
        ("cache, %", |((_, cache, _), _)| f64::from(*cache).into()),
        ("begins", |((.., is_cold), _)| if *is_cold { "cold" } else { "warm" }.into()),
        ("FLIP 0.02 or less", |group| choice(group, WITHIN[0]).map_or(Value::Missing, Value::Text)),
        ("FLIP 0.05 or less", |group| choice(group, WITHIN[1]).map_or(Value::Missing, Value::Text)),
        ("FLIP 0.1 or less", |group| choice(group, WITHIN[2]).map_or(Value::Missing, Value::Text)),
    ];
    let caption = "The fastest setting whose picture is no farther than that from the converged one.";
    table("choices", caption, groups.iter().filter(|group| dominant(group).is_empty()), &columns)
}
