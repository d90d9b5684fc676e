//! The page of a replay: what caches of every size and policy make of one trace of requests.

use crate::chart::{Across, Chart, INKS, Series, Shape, Unit};
use crate::{ReportError, format, page};
use maud::{Markup, html};
use serde_json::Value;

/// One policy's result in one cache.
struct Row<'a> {
    policy: &'a str,
    cache_bytes: f64,
    percent: f64,
    recorded: bool,
    loads: f64,
    loaded_bytes: f64,
    hit_rate: f64,
}

/// Title, reading, unit and value of a plot with a curve a policy.
type Curve = (&'static str, &'static str, Unit, fn(&Row) -> f64);

const CURVES: [Curve; 3] = [
    (
        "Bytes loaded",
        "Lower is better. Where a curve is level, the cache holds all that is asked for again.",
        Unit::Bytes,
        |row| row.loaded_bytes,
    ),
    ("Loads", "Payloads loaded: geometry or attributes of a brick.", Unit::Count, |row| row.loads),
    (
        "Hit rate",
        "Higher is better: requests for what was resident. No policy can do better than the first \
         request of each payload allows.",
        Unit::Percent,
        |row| 100.0 * row.hit_rate,
    ),
];

/// The page for what `brickwalk replay --json` prints; `name` is that of the trace. Rows without a number are left out.
pub fn render(name: &str, replay: &Value) -> Result<String, ReportError> {
    let rows: Vec<Row> = replay["results"].as_array().map_or(&[][..], Vec::as_slice).iter().filter_map(row).collect();
    let mut policies: Vec<&str> = Vec::new();
    for row in &rows {
        if !policies.contains(&row.policy) {
            policies.push(row.policy);
        }
    }
    let plots = CURVES.iter().map(|curve| plot(curve, &policies, &rows)).collect::<Result<Vec<_>, _>>()?;
    let number = |path: &str| replay.pointer(path).and_then(Value::as_f64);
    let head = html! {
        p.kicker { "brickwalk · replay" }
        h1 { (name) }
        dl.facts {
            @for (name, value) in [
                ("Bricks", [number("/bricks").map(format::count), number("/brick_bytes").map(format::bytes)]),
                ("Requests", [
                    number("/requests").map(format::count),
                    number("/passes").map(|n| format!("{} passes", format::count(n))),
                ]),
                ("Payloads asked for", [
                    number("/distinct").map(format::count),
                    number("/distinct_bytes").map(format::bytes),
                ]),
                ("Recorded with", [
                    replay.pointer("/recorded/policy").and_then(Value::as_str).map(str::to_owned),
                    number("/recorded/cache_bytes").map(format::bytes),
                ]),
            ] {
                div { dt { (name) } dd { (value.into_iter().flatten().collect::<Vec<_>>().join(", ")) } }
            }
        }
    };
    let main = html! {
        section {
            h2 { "Against the size of the cache" }
            p.reading { "Every cache begins empty. belady-greedy knows the future: a bound for the others." }
            div.plots { @for plot in plots.into_iter().flatten() { (plot) } }
        }
        section { h2 { "Numbers" } (table(&policies, &rows)) }
    };
    Ok(page::whole(&format!("Replay of {name}"), &head, &main))
}

fn row(value: &Value) -> Option<Row<'_>> {
    let number = |field: &str| value.get(field).and_then(Value::as_f64);
    Some(Row {
        policy: value.get("policy")?.as_str()?,
        cache_bytes: number("cache_bytes")?,
        percent: number("cache_percent")?,
        recorded: value.get("recorded").and_then(Value::as_bool).unwrap_or(false),
        loads: number("loads")?,
        loaded_bytes: number("loaded_bytes")?,
        hit_rate: number("hit_rate")?,
    })
}

fn plot(curve: &Curve, policies: &[&str], rows: &[Row]) -> Result<Option<Markup>, ReportError> {
    let &(title, reading, unit, value) = curve;
    if !rows.iter().any(|row| value(row) > 0.0) {
        return Ok(None);
    }
    let series = |(k, &policy): (usize, &&str)| Series {
        name: policy.to_owned(),
        points: rows.iter().filter(|row| row.policy == policy).map(|row| (row.percent, value(row))).collect(),
        shape: Shape::Line,
        ink: INKS[k % INKS.len()],
    };
    let series = policies.iter().enumerate().map(series).collect();
    let chart = Chart { title: title.into(), unit, across: Across::Shares, series };
    page::drawn(&chart, title, reading, None, |_| None).map(Some)
}

/// A row a cache, and of every policy loads, MiB loaded and hits.
fn table(policies: &[&str], rows: &[Row]) -> Markup {
    html! {
        div.wide { table {
            thead {
                tr {
                    th rowspan="2" { "Cache" } th rowspan="2" { "% of all" }
                    @for policy in policies { th.group colspan="3" { (policy) } }
                }
                tr { @for _ in policies { th { "loads" } th { "MiB" } th { "hits, %" } } }
            }
            tbody {
                // Rows of one size lie together.
                @for size in rows.chunk_by(|a, b| a.cache_bytes == b.cache_bytes) {
                    tr {
                        th scope="row" {
                            (format::bytes(size[0].cache_bytes))
                            @if size.iter().any(|row| row.recorded) { " (recorded)" }
                        }
                        td { (format::number(size[0].percent)) }
                        @for policy in policies {
                            @match size.iter().find(|row| row.policy == *policy) {
                                Some(row) => {
                                    td { (format::count(row.loads)) } td { (format::mebibytes(row.loaded_bytes)) }
                                    td { (format::number(100.0 * row.hit_rate)) }
                                }
                                None => { td { "–" } td { "–" } td { "–" } }
                            }
                        }
                    }
                }
            }
        } }
    }
}
