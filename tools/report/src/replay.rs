//! The page of a replay: what caches of every size and policy make of one trace of requests.

use crate::chart::{Across, Chart, Series, Shape, Unit};
use crate::ink::INKS;
use crate::{ReportError, csv, format, page};
use maud::{Markup, html};
use serde_json::Value;

/// The policy that knows the future, which the others are measured by.
const BOUND: &str = "belady-greedy";

/// One policy's result in one cache.
#[derive(Clone, Copy)]
struct Row<'a> {
    policy: &'a str,
    cache_bytes: f64,
    percent: f64,
    recorded: bool,
    loads: f64,
    loaded_bytes: f64,
    hit_rate: f64,
    /// Percent of bytes loaded beyond those of [`BOUND`] in the same cache; 0 where it loads less, or is not there.
    beyond: f64,
}

/// Title, reading, unit and value of a plot with a curve a policy.
type Curve = (&'static str, &'static str, Unit, fn(&Row) -> f64);

const CURVES: [Curve; 4] = [
    (
        "Loaded beyond the bound",
        "Lower is better: bytes loaded beyond those of belady-greedy in the same cache.",
        Unit::Percent,
        |row| row.beyond,
    ),
    (
        "Bytes loaded",
        "Lower is better. Where a curve is level, the cache holds all that is asked for again.",
        Unit::Bytes,
        |row| row.loaded_bytes,
    ),
    (
        "Loads",
        "Payloads loaded: geometry or attributes of a brick. Those beyond the first load of each are reloads.",
        Unit::Count,
        |row| row.loads,
    ),
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
    let rows = replay["results"].as_array().map_or(&[][..], Vec::as_slice).iter().filter_map(row);
    let rows = beyond_bound(rows.collect());
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
            p.reading {
                "Every cache begins empty. belady-greedy knows the future (it evicts what is used again last): a "
                "bound for the others."
            }
            div.plots { @for plot in plots.into_iter().flatten() { (plot) } }
        }
        section {
            h2 { "Numbers" }
            (table(&policies, &rows))
            p { a href=(data_link(&rows)) download="replay.csv" { "CSV" } }
        }
    };
    Ok(page::whole(&format!("Replay of {name}"), &head, &main))
}

/// The rows with what each policy loads beyond the bound.
fn beyond_bound(rows: Vec<Row>) -> Vec<Row> {
    let bound = |cache: f64| rows.iter().find(|row| row.policy == BOUND && row.cache_bytes == cache);
    let beyond = |row: &Row| {
        let least = bound(row.cache_bytes).map(|bound| bound.loaded_bytes).filter(|bytes| *bytes > 0.0);
        least.map_or(0.0, |least| (100.0 * (row.loaded_bytes / least - 1.0)).max(0.0))
    };
    rows.iter().map(|row| Row { beyond: beyond(row), ..*row }).collect()
}

/// The rows as a link that holds them as comma-separated values.
fn data_link(rows: &[Row]) -> String {
    let mut text = String::from("cache_bytes,cache_percent,policy,loads,loaded_bytes,hit_rate\n");
    for row in rows {
        let Row { policy, cache_bytes, percent, loads, loaded_bytes, hit_rate, .. } = row;
        let policy = csv::quoted(policy);
        text += &format!("{cache_bytes},{percent},{policy},{loads},{loaded_bytes},{hit_rate}\n");
    }
    format!("data:text/csv;base64,{}", format::base64(text.as_bytes()))
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
        beyond: 0.0,
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
        // Curves often lie on each other: gaps of one show the other.
        shape: k.checked_sub(1).map_or(Shape::Line, Shape::Dashed),
        ink: INKS[k % INKS.len()],
    };
    let is_drawn = |(_, policy): &(usize, &&str)| rows.iter().any(|row| row.policy == **policy && value(row) > 0.0);
    let series = policies.iter().enumerate().filter(is_drawn).map(series).collect();
    let chart = Chart { title: title.into(), unit, across: Across::Shares, series, marks: Vec::new() };
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
