//! The page: headline facts, frames, plots, tables.

use crate::chart::{Chart, Drawing, Shape};
use crate::checkpoints::Checkpoints;
use crate::frames::{Gallery, Picture, dimensions};
use crate::plots::{self, Plot};
use crate::walk::{Pass, Statistics, Walk};
use crate::{Field, ReportError, format, ink, tables};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde_json::Value;

const STYLE: &str = include_str!("style.css");
/// Values under the pointer, sorting, CSV.
const SCRIPT: &str = include_str!("script.js");
/// Parts of the summary that the page shows in places of their own, or computes from the records.
const SHOWN_APART: [&str; 8] =
    ["settings", "scene", "adapter", "left_out", "memory", "parts", "passes", "texture_bytes_resident"];

/// The whole page as HTML.
///
/// # Errors
/// A plot cannot be drawn.
pub fn render(
    walk: &Walk,
    gallery: &Gallery,
    checkpoints: &Checkpoints,
    fields: &[Field],
) -> Result<String, ReportError> {
    let scene = walk.text("scene/file").unwrap_or_else(|| "unnamed scene".into());
    let head = html! {
        p.kicker { "brickwalk · walk" }
        h1 { (scene) }
        (verdict(walk))
        (facts(walk))
    };
    let main = html! {
        (medians(walk))
        section { h2 { "Frames" } (frames(walk, gallery)) }
        (checkpoints.section()?)
        (all_plots(walk, fields)?)
        (all_tables(walk, fields))
    };
    Ok(whole(&format!("Walk through {scene}"), &head, &main))
}

/// A page from its parts.
pub fn whole(title: &str, head: &Markup, main: &Markup) -> String {
    let dark = ink::colour_rules();
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) }
                style { (PreEscaped(STYLE)) "@media (prefers-color-scheme: dark){" (PreEscaped(dark)) "}" }
            }
            body { header { (head) } main { (main) } script { (PreEscaped(SCRIPT)) } }
        }
    };
    page.into_string()
}

/// How many frames there are, and whether all of their pixels can be trusted.
fn verdict(walk: &Walk) -> Markup {
    let finished = walk.number("frames").unwrap_or(walk.frames.len() as f64);
    let asked = walk.number("settings/frames").unwrap_or(finished);
    let interrupted = finished < asked;
    let (unresolved, non_finite) = (walk.total("unresolved_pixels"), walk.total("non_finite"));
    html! {
        ul.verdict {
            li.warn[interrupted] {
                @if interrupted { "Interrupted after " }
                (format::count(finished)) " of " (format::count(asked)) " frames"
                @if !interrupted { " finished" }
            }
            @if !walk.passes.is_empty() {
                @if unresolved > 0.0 { li.warn { (format::count(unresolved)) " pixels are not final" } }
                @if non_finite > 0.0 { li.warn { (format::count(non_finite)) " pixels were not finite" } }
                @if unresolved == 0.0 && non_finite == 0.0 { li { "every pixel is final and finite" } }
            }
        }
    }
}

/// The headline facts.
fn facts(walk: &Walk) -> Markup {
    let count = |path: &str| walk.number(path).map(format::count);
    let bytes = |path: &str| walk.number(path).map(format::bytes);
    let joined = |parts: [Option<String>; 2], separator: &str| {
        let parts: Vec<String> = parts.into_iter().flatten().filter(|part| !part.is_empty()).collect();
        (!parts.is_empty()).then(|| parts.join(separator))
    };
    let size = match (count("settings/width"), count("settings/height")) {
        (Some(width), Some(height)) => Some(format!("{} × {} px", width.replace(',', ""), height.replace(',', ""))),
        _ => None,
    };
    let percent = walk.number("settings/cache_percent").map(|p| format!("{} % of the bricks", format::number(p)));
    let fronts = walk.text("settings/fronts").map(|fronts| format!("fronts {fronts}"));
    let version = walk.text("version").map(|version| format!("version {version}"));
    let driver = joined([walk.text("adapter/driver"), walk.text("adapter/driver_info")], " ");
    let backend = walk.text("adapter/backend").map(|backend| format!("({backend})"));
    let facts = [
        ("Triangles", count("scene/triangles")),
        ("Bricks", joined([count("scene/bricks"), bytes("scene/brick_bytes")], ", ")),
        ("Scene file", bytes("scene/file_bytes")),
        ("Frame size", size),
        ("Cache", joined([bytes("settings/cache_bytes"), percent], ", ")),
        ("Schedule", joined([walk.text("settings/schedule"), fronts], ", ")),
        ("Adapter", joined([walk.text("adapter/name"), backend], " ")),
        ("Driver", driver),
        ("Commit", joined([walk.text("commit"), version], ", ")),
    ];
    html! {
        dl.facts {
            @for (name, value) in facts {
                div { dt { (name) } dd { (value.unwrap_or_else(|| "not recorded".into())) } }
            }
        }
    }
}

/// A row of medians, so that the page's first screen answers how fast the walk was.
fn medians(walk: &Walk) -> Markup {
    let median = |fields: &[&str]| {
        let values = walk.per_frame(fields).into_iter().map(|(_, value)| value).collect();
        Statistics::of(values).map(|s| s.median)
    };
    html! {
        @if !walk.passes.is_empty() {
            section {
                h2 { "Median frame" }
                ul.tiles {
                    @if let Some(ms) = median(&["ms"]) { li { b { (format::number(ms)) } " ms, all passes" } }
                    @for pass in &walk.passes {
                        @if let Some(s) = pass.statistics("mrays_per_s") {
                            li { b { (format::number(s.median)) } " Mrays/s, " (pass.name) }
                        }
                    }
                    @if let Some(bytes) = median(&tables::MOVED) { li { b { (format::bytes(bytes)) } " moved" } }
                    @if let Some(trips) = median(&["round_trips"]) {
                        li { b { (tables::value(trips)) } " round trips" }
                    }
                }
            }
        }
    }
}

/// The gallery: a tap or click on a frame enlarges it; no script is needed.
fn frames(walk: &Walk, gallery: &Gallery) -> Markup {
    let (embedded, linked): (Vec<&Picture>, Vec<&Picture>) = gallery.pictures.iter().partition(|p| p.png.is_some());
    let times = walk.per_frame(&["ms"]);
    let time = |frame: u64| times.binary_search_by_key(&frame, |t| t.0).ok().map(|at| times[at].1);
    html! {
        @if gallery.pictures.is_empty() {
            p {
                @if walk.frames.is_empty() { "No frame was finished, so there is nothing to show or to plot." }
                @else { "The folder holds no pictures of these frames." }
            }
        }
        @if !embedded.is_empty() {
            p.reading { "Click a frame to enlarge it. Its number links to the file." }
            div.gallery {
                @for picture in &embedded { (figure(picture, time(picture.frame))) }
            }
        }
        @if !linked.is_empty() {
            details {
                summary { (linked.len()) " more frames" }
                p.links { @for picture in &linked { a href={ "frames/" (picture.name) } { (picture.frame) } " " } }
            }
        }
        @if !gallery.left_out.is_empty() {
            p.note {
                "Skipped, because they are not of this walk or not PNG files: "
                (gallery.left_out.join(", ")) "."
            }
        }
    }
}

/// A picture that a click enlarges.
pub(crate) fn enlarged(png: &[u8], name: &str) -> Markup {
    let size = dimensions(png);
    let source = format!("data:image/png;base64,{}", format::base64(png));
    html! {
        label {
            input type="checkbox" aria-label={ "enlarge " (name) };
            img src=(PreEscaped(source)) alt=(name) width=[size.map(|s| s.0)] height=[size.map(|s| s.1)];
        }
    }
}

fn figure(picture: &Picture, ms: Option<f64>) -> Markup {
    let png = picture.png.as_deref().unwrap_or_default();
    html! {
        figure {
            (enlarged(png, &format!("frame {}", picture.frame)))
            figcaption {
                a href={ "frames/" (picture.name) } { "frame " (picture.frame) }
                @if let Some(ms) = ms { " · " (format::number(ms)) " ms" }
            }
        }
    }
}

fn all_plots(walk: &Walk, fields: &[Field]) -> Result<Markup, ReportError> {
    if walk.passes.is_empty() {
        return Ok(html! {});
    }
    let shared = section_of("All passes", &plots::of_walk(walk), tables::schedules(walk))?;
    let of_pass = |pass: &Pass| section_of(&format!("Pass: {}", pass.name), &plots::of_pass(walk, pass, fields), None);
    let passes = walk.passes.iter().map(of_pass).collect::<Result<Vec<_>, _>>()?;
    Ok(html! { (shared) @for pass in passes { (pass) } })
}

fn section_of(title: &str, plots: &[Plot], table: Option<Markup>) -> Result<Markup, ReportError> {
    let drawn = plots.iter().map(plot).collect::<Result<Vec<_>, _>>()?;
    Ok(html! {
        section {
            h2 { (title) }
            p.reading { "Numbers beside names are medians over the frames. Point at a plot for the values of a frame." }
            div.plots { @for figure in drawn.into_iter().flatten() { (figure) } }
            @for plot in plots.iter().filter(|plot| plot.chart.is_none()) {
                p.note { (plot.title) ": not drawn, because " (undrawn(plot)) "." }
            }
            @if let Some(table) = table { (table) }
        }
    })
}

/// Why series are not drawn: which are zero, which are off and which are not measured.
fn undrawn(plot: &Plot) -> String {
    fn are(names: &[String], what: &str) -> Option<String> {
        let verb = if names.len() == 1 { "is" } else { "are" };
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        (!names.is_empty()).then(|| format!("{} {verb} {what}", format::list(&names)))
    }
    let parts = [are(&plot.zero, "zero in every frame"), are(&plot.off, "off"), are(&plot.missing, "not measured")];
    parts.into_iter().flatten().collect::<Vec<_>>().join("; ")
}

fn plot(plot: &Plot) -> Result<Option<Markup>, ReportError> {
    let Some(chart) = &plot.chart else { return Ok(None) };
    let undrawn = undrawn(plot);
    let left_out = (!undrawn.is_empty()).then(|| format!("Left out: {undrawn}."));
    let median = |values| Statistics::of(values).map(|s| chart.unit.show(s.median));
    Ok(Some(drawn(chart, plot.title, plot.reading, left_out.as_deref(), median)?))
}

/// A chart with its title, its legend, in which `value` stands beside each name, and how to read it.
pub fn drawn(
    chart: &Chart,
    title: &str,
    reading: &str,
    note: Option<&str>,
    value: impl Fn(Vec<f64>) -> Option<String>,
) -> Result<Markup, ReportError> {
    let drawing = chart.draw()?;
    Ok(html! {
        figure.plot {
            figcaption {
                h3 { (title) @if !drawing.unit.is_empty() { span.unit { ", " (drawing.unit) } } }
                ul.legend {
                    @for series in &chart.series {
                        li {
                            svg.key viewBox="0 0 16 10" aria-hidden="true" {
                                (key(series.shape, &series.ink.light_hex()))
                            }
                            (series.name) " "
                            @if let Some(value) = value(series.points.iter().map(|p| p.1).collect()) {
                                span.value { (value) }
                            }
                        }
                    }
                }
            }
            svg viewBox=(Drawing::view_box()) role="img" aria-label=(chart.title) {
                (PreEscaped(drawing.svg)) line.cursor stroke="currentColor" {}
            }
            script type="application/json" { (PreEscaped(drawing.data)) }
            div {
                p.reading { (reading) }
                @if !drawing.notes.is_empty() { p.note { (drawing.notes) } }
                @if let Some(note) = note { p.note { (note) } }
            }
        }
    })
}

/// A legend's sample of a series.
pub fn key(shape: Shape, colour: &str) -> Markup {
    html! {
        @match shape {
            Shape::Stacked => { rect x="2" y="0" width="12" height="10" fill=(colour) {} }
            Shape::Line => { line x1="0" y1="5" x2="16" y2="5" stroke=(colour) stroke-width="2.5" {} }
            Shape::Total => { line x1="0" y1="5" x2="16" y2="5" stroke=(colour) stroke-width="3.5" {} }
            Shape::Dashed(_) | Shape::Limit => {
                @let (dash, gap) = shape.dash().unwrap_or_default();
                line x1="0" y1="5" x2="20" y2="5" stroke=(colour) stroke-width="2.5"
                    stroke-dasharray={ (dash) " " (gap) } {}
            }
        }
    }
}

fn all_tables(walk: &Walk, fields: &[Field]) -> Markup {
    html! {
        @if !walk.passes.is_empty() {
            section {
                h2 { "Throughput, queries and bytes moved" }
                p.reading {
                    "The columns of Table 3 of CHC+RT, in MiB. Median and p95 are per frame; for Mray/s a high p95 is "
                    "the fast end, and its total is all rays traced over all time."
                }
                (tables::out_of_core(walk))
            }
            section {
                h2 { "Moved against needed" }
                @match tables::needs(walk) {
                    Some(table) => {
                        p.reading {
                            "BVH and geometry. The first frame starts cold: its target is moved ÷ needed near 1. Later "
                            "frames keep what is resident: their target is moved ÷ missing near 1."
                        }
                        (table)
                    }
                    None => p.note { "Not measured: walk with --measure-needed." },
                }
            }
            section {
                h2 { "Every field" }
                details {
                    summary { "Total, median and p95 of " (walk.fields.len()) " fields" }
                    (tables::all_fields(walk, fields))
                }
                details { summary { "Frame by frame" } (tables::per_frame(walk)) }
                p { a href="records.csv" { "records.csv" } ", " a href="records.jsonl" { "records.jsonl" } }
            }
        }
        @if let Some(workers) = workers(walk) { section { h2 { "Workers" } (workers) } }
        section { h2 { "Left out, and why" } (left_out(walk)) }
        section { h2 { "Memory" } (memory(walk)) }
        section {
            h2 { "Settings" }
            @for (title, part) in [("Walk", "settings"), ("Scene", "scene"), ("Adapter", "adapter")] {
                details open[part == "settings"] {
                    summary { (title) }
                    @match walk.summary(part).and_then(tables::pairs) {
                        Some(table) => (table),
                        None => p.note { "Not recorded." },
                    }
                }
            }
            @let others = walk.summary.iter().filter(|(key, _)| !SHOWN_APART.contains(&key.as_str()));
            @let others = Value::Object(others.map(|(key, value)| (key.clone(), value.clone())).collect());
            @if let Some(table) = tables::pairs(&others) { details { summary { "Also in the summary" } (table) } }
        }
    }
}

/// Who rendered frames that were joined, a row each; `None` of a walk that rendered its frames itself.
fn workers(walk: &Walk) -> Option<Markup> {
    let rows = walk.summary("parts/workers")?.as_array().filter(|rows| !rows.is_empty())?;
    let number = |row: &Value, name: &str| row.get(name).and_then(Value::as_f64).unwrap_or_default();
    Some(html! {
        p.reading { "Frames, or bands of them, were rendered apart and joined in their order. Seconds are those of rendering." }
        div.wide { table {
            thead { tr { th { "worker" } th { "parts" } th { "seconds" } th { "seconds a part" } th { "loaded" } } }
            tbody { @for row in rows {
                @let [parts, seconds] = [number(row, "parts"), number(row, "seconds")];
                tr {
                    th scope="row" { (row.get("worker").and_then(Value::as_str).unwrap_or_default()) }
                    td { (format::count(parts)) }
                    td { (format::number(seconds)) }
                    td { (format::number(seconds / parts.max(1.0))) }
                    td { (format::bytes(number(row, "bytes_loaded"))) }
                }
            } }
        } }
    })
}

/// What rendering left out because the scene does not need it.
fn left_out(walk: &Walk) -> Markup {
    let items = walk.summary("left_out").and_then(Value::as_array);
    html! {
        @match items.map(Vec::as_slice) {
            Some([]) => p { "Nothing." },
            Some(items) => ul {
                @for item in items {
                    @match (item.get("what").and_then(Value::as_str), item.get("why").and_then(Value::as_str)) {
                        (Some(what), Some(why)) => li { b { (what) } ": " (why) },
                        _ => li { (item.as_str().map_or_else(|| item.to_string(), str::to_string)) },
                    }
                }
            },
            None => p.note { "Not recorded." },
        }
    }
}

fn memory(walk: &Walk) -> Markup {
    html! {
        @match walk.summary("memory").and_then(tables::pairs) {
            Some(table) => {
                p.reading {
                    "Peak of the process without mapped files, which are listed apart. With a software adapter or on "
                    "the processor it includes the cache."
                }
                (table)
            }
            None => p.note { "Not known on this system." },
        }
        @if let Some(bytes) = walk.number("texture_bytes_resident") {
            p { "Coarse levels of textures on the device: " (format::bytes(bytes)) ", outside of the cache's budget." }
        }
    }
}
