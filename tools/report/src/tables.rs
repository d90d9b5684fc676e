//! The tables of a report.

use crate::walk::{Pass, Row, Statistics, Walk};
use crate::{Field, format};
use maud::{Markup, html};
use serde_json::Value;

/// Everything that a pass can move to the device.
pub const MOVED: [&str; 4] = ["bytes_bvh", "bytes_geometry", "bytes_attributes", "bytes_textures"];
/// What of it the needed bytes speak of.
const MOVED_GEOMETRY: [&str; 2] = ["bytes_bvh", "bytes_geometry"];
/// What stands for a value that is not recorded.
const NONE: &str = "–";
/// What stands for a count of what is off.
const OFF: &str = "off";

fn cell(value: Option<f64>, show: fn(f64) -> String) -> String {
    value.map_or_else(|| NONE.into(), show)
}

/// A count without, a measured value with a fraction.
pub fn value(value: f64) -> String {
    if value.fract() == 0.0 { format::count(value) } else { format::number(value) }
}

/// Throughput, queries and bytes moved of every pass: the columns of CHC+RT, Table 3, and time.
pub fn out_of_core(walk: &Walk) -> Markup {
    html! {
        div.wide { table {
            thead { tr {
                th.text { "Pass" } th.text { "Over the frames" } th { "Rays traced" } th { "answered" } th { "Mray/s" }
                th { "ms" } th { "Queries" }
                th { "MiB moved" } th { "of it BVH" } th { "geometry" } th { "attributes" } th { "textures" }
            } }
            @for pass in &walk.passes {
                tbody {
                    @for (row, (name, pick)) in PICKS.iter().enumerate() {
                        tr {
                            @if row == 0 { th scope="rowgroup" rowspan=(PICKS.len()) { (pass.name) } }
                            th scope="row" { (name) }
                            @for field in RAYS { td { (picked(pass, field, *pick, value)) } }
                            @if *name == "total" { td { (cell(overall_throughput(pass), format::number)) } }
                            @else { td { (picked(pass, "mrays_per_s", *pick, format::number)) } }
                            td { (picked(pass, "ms", *pick, format::number)) }
                            td { (picked(pass, "queries", *pick, value)) }
                            td { (cell(pass.statistics_of_sum(&MOVED).map(pick), format::mebibytes)) }
                            @for field in MOVED { td { (picked(pass, field, *pick, format::mebibytes)) } }
                        }
                    }
                }
            }
        } }
    }
}

/// The schedules of every pass: in how many frames, and how long these took; `None` where records do not say.
pub fn schedules(walk: &Walk) -> Option<Markup> {
    let is_recorded = walk.passes.iter().any(|pass| pass.rows.iter().any(|row| !row.schedule.is_empty()));
    let ms = |rows: &[&Row]| Statistics::of(rows.iter().filter_map(|row| row.get("ms")).collect());
    is_recorded.then(|| {
        html! {
            h3 { "Schedules" }
            p.reading {
                "With auto, a pass now and then tries a schedule that was slower before; such frames stand out in "
                "plots. A pass with several schedules has directions, lamps or samples that were traced by either. "
                "Methods that answered rays stand behind the schedule."
            }
            div.wide { table {
                thead { tr {
                    th.text { "Pass" } th.text { "Schedule" } th { "Frames" } th { "median ms" } th { "p95 ms" }
                } }
                tbody {
                    @for pass in &walk.passes {
                        @for (schedule, rows) in pass.by_schedule() {
                            @let ms = ms(&rows);
                            tr {
                                th scope="row" { (pass.name) } td.text { (schedule) }
                                td { (format::count(rows.len() as f64)) }
                                td { (cell(ms.map(|s| s.median), format::number)) }
                                td { (cell(ms.map(|s| s.p95), format::number)) }
                            }
                        }
                    }
                }
            } }
        }
    })
}

/// Rays that were traced, and those that a method answered besides.
const RAYS: [&str; 2] = ["rays_traced", "rays_answered"];

/// Picks one of a field's statistics.
type Pick = fn(Statistics) -> f64;

/// The statistics that a table has a row of.
const PICKS: [(&str, Pick); 4] =
    [("first frame", |s| s.first), ("median", |s| s.median), ("p95", |s| s.p95), ("total", |s| s.total)];

fn picked(pass: &Pass, field: &str, pick: Pick, show: fn(f64) -> String) -> String {
    cell(pass.statistics(field).map(pick), show)
}

/// The total of a field whose values add up to `sum`; `None` where a total has no meaning.
fn total(pass: &Pass, field: &str, known: Option<&Field>, sum: f64) -> Option<f64> {
    if field == "mrays_per_s" { overall_throughput(pass) } else { known.is_none_or(|f| f.adds_up).then_some(sum) }
}

/// All rays traced in a pass over all of its time, millions per second; `None` where either is unknown or no time
/// passed.
fn overall_throughput(pass: &Pass) -> Option<f64> {
    let (rays, ms) = (pass.statistics("rays_traced")?.total, pass.statistics("ms")?.total);
    (ms > 0.0).then(|| rays / ms * 1e-3)
}

/// Bytes moved against bytes needed, cold and steady; `None` where no need was measured.
pub fn needs(walk: &Walk) -> Option<Markup> {
    let measured: Vec<&Pass> = walk.passes.iter().filter(|pass| pass.has_nonzero("bytes_needed")).collect();
    if measured.is_empty() {
        return None;
    }
    let ratio = |moved: f64, needed: f64| if needed > 0.0 { format::number(moved / needed) } else { NONE.into() };
    Some(html! {
        div.wide { table {
            thead { tr {
                th.text { "Pass" } th.text { "Frames" } th { "MiB moved" } th { "MiB needed" } th { "MiB missing" }
                th { "moved ÷ needed" } th { "moved ÷ missing" }
            } }
            @for pass in measured {
                tbody {
                    @let parts = [("first", &pass.rows[..1]), ("all later", &pass.rows[1..])];
                    @for (row, (name, rows)) in parts.into_iter().enumerate() {
                        @let sum = |fields: &[&str]| rows.iter().map(|row| row.sum(fields)).sum::<f64>();
                        @let moved = sum(&MOVED_GEOMETRY);
                        @let (needed, missing) = (sum(&["bytes_needed"]), sum(&["bytes_needed_missing"]));
                        tr {
                            @if row == 0 { th scope="rowgroup" rowspan="2" { (pass.name) } }
                            th scope="row" { (name) }
                            @for bytes in [moved, needed, missing] { td { (format::mebibytes(bytes)) } }
                            td { (ratio(moved, needed)) } td { (ratio(moved, missing)) }
                        }
                    }
                }
            }
        } }
    })
}

/// Total, median and 95th percentile of every field of every pass.
pub fn all_fields(walk: &Walk, known: &[Field]) -> Markup {
    html! {
        div.wide { table.fields {
            thead {
                tr {
                    th rowspan="2" { "Field" }
                    @for pass in &walk.passes { th.group colspan="3" { (pass.name) } }
                    th.text rowspan="2" { "Meaning" }
                }
                tr { @for _ in &walk.passes { th { "total" } th { "median" } th { "p95" } } }
            }
            tbody {
                @for field in &walk.fields {
                    @let known = known.iter().find(|known| known.name == field);
                    @let is_off = known.is_some_and(|known| walk.is_off(known.only));
                    tr {
                        th scope="row" { code { (field) } }
                        @for pass in &walk.passes {
                            @match pass.statistics(field) {
                                Some(s) if is_off && s.total == 0.0 => { td { (OFF) } td { (OFF) } td { (OFF) } }
                                Some(s) => {
                                    td { (cell(total(pass, field, known, s.total), value)) }
                                    td { (value(s.median)) } td { (value(s.p95)) }
                                }
                                None => { td { (NONE) } td { (NONE) } td { (NONE) } }
                            }
                        }
                        td.text { @if let Some(known) = known { (known.meaning) } }
                    }
                }
            }
        } }
    }
}

/// The columns of [`out_of_core`] for every frame and pass.
pub fn per_frame(walk: &Walk) -> Markup {
    html! {
        div.wide { table {
            thead { tr {
                th { "Frame" } th.text { "Pass" } th.text { "Schedule" }
                th { "Rays traced" } th { "answered" } th { "Mray/s" } th { "ms" }
                th { "Queries" } th { "MiB moved" } th { "of it BVH" } th { "geometry" }
                th { "Loaded" } th { "Evicted" }
            } }
            tbody {
                @for frame in &walk.frames {
                    @for pass in &walk.passes {
                        // Rows are in the order of their frames.
                        @let start = pass.rows.partition_point(|row| row.frame < *frame);
                        @for row in pass.rows[start..].iter().take_while(|row| row.frame == *frame) {
                            tr {
                                th scope="row" { (frame) } td.text { (pass.name) } td.text { (row.by()) }
                                @for field in RAYS { td { (cell(row.get(field), value)) } }
                                @for field in ["mrays_per_s", "ms"] { td { (cell(row.get(field), format::number)) } }
                                td { (cell(row.get("queries"), value)) } td { (format::mebibytes(row.sum(&MOVED))) }
                                @for field in MOVED_GEOMETRY { td { (cell(row.get(field), format::mebibytes)) } }
                                @for field in ["bricks_loaded", "bricks_evicted"] {
                                    td { (cell(row.get(field), value)) }
                                }
                            }
                        }
                    }
                }
            }
        } }
    }
}

/// A part of the summary as a table of names and values; `None` where there is nothing in it.
pub fn pairs(value: &Value) -> Option<Markup> {
    let mut rows = Vec::new();
    flatten("", value, &mut rows);
    (!rows.is_empty()).then(|| {
        html! {
            div.wide { table.pairs { tbody {
                @for (name, value) in rows { tr { th scope="row" { code { (name) } } td.text { (value) } } }
            } } }
        }
    })
}

/// The leaves of a JSON value as dotted names and readable values.
fn flatten(prefix: &str, value: &Value, rows: &mut Vec<(String, String)>) {
    if let Value::Object(object) = value {
        for (key, value) in object {
            let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
            flatten(&name, value, rows);
        }
    } else {
        rows.push((prefix.to_string(), readable(prefix, value)));
    }
}

fn readable(name: &str, value: &Value) -> String {
    let numbers_of = |text: &str| name.ends_with(text);
    match value {
        Value::Null => OFF.into(),
        Value::Bool(yes) => if *yes { "yes" } else { "no" }.into(),
        Value::String(text) => text.clone(),
        Value::Array(items) => items.iter().map(|item| readable(name, item)).collect::<Vec<_>>().join(", "),
        Value::Object(_) => value.to_string(),
        Value::Number(number) => match number.as_f64() {
            Some(bytes) if (numbers_of("_bytes") || numbers_of("bytes_resident")) && bytes >= 10_240.0 => {
                format!("{} ({} bytes)", format::bytes(bytes), format::count(bytes))
            }
            Some(bytes) if numbers_of("_bytes") => format::bytes(bytes),
            Some(percent) if numbers_of("_percent") => format!("{} %", format::number(percent)),
            Some(count) if count.fract() == 0.0 && count.abs() >= 10_000.0 && !numbers_of("seed") => {
                format::count(count)
            }
            _ => number.to_string(),
        },
    }
}
