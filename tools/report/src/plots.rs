//! Which plots a report has, and how each is read.

use crate::Field;
use crate::chart::{Across, Chart, Series, Shape, Unit};
use crate::ink::{BLACK, BLUE, GREEN, GREY, INKS, Ink, ORANGE, PURPLE, RED};
use crate::walk::{Pass, Walk};

/// A plot, or the reason why there is none.
#[derive(Debug)]
pub struct Plot {
    /// What is plotted.
    pub title: &'static str,
    /// How to read it, in one line.
    pub reading: &'static str,
    /// The plot; `None` where every series is empty or zero.
    pub chart: Option<Chart>,
    /// Series that are zero in all frames.
    pub zero: Vec<String>,
    /// Series of what was off.
    pub off: Vec<String>,
    /// Series that no record has, or that this walk did not measure.
    pub missing: Vec<String>,
}

/// A line or a layer of bars of a plot of one pass.
struct Line {
    name: &'static str,
    /// The sum of these fields is drawn.
    fields: &'static [&'static str],
    shape: Shape,
    ink: Ink,
}

const fn line(name: &'static str, fields: &'static [&'static str], ink: Ink) -> Line {
    Line { name, fields, shape: Shape::Line, ink }
}

const fn total(name: &'static str, fields: &'static [&'static str]) -> Line {
    Line { name, fields, shape: Shape::Total, ink: GREY }
}

const fn layer(name: &'static str, fields: &'static [&'static str], ink: Ink) -> Line {
    Line { name, fields, shape: Shape::Stacked, ink }
}

/// A plot that every pass has.
struct PassPlot {
    title: &'static str,
    reading: &'static str,
    unit: Unit,
    lines: &'static [Line],
    /// Whether the plot says nothing where needs were not measured.
    of_needs: bool,
    /// Whether frames are marked from which on another schedule traces.
    marks_schedules: bool,
}

/// The plot that most walks do not ask for, and that is not missed where there is no error.
const ERROR: &str = "Error";

const PASS_PLOTS: [PassPlot; 7] = [
    PassPlot {
        title: "Time per phase",
        of_needs: false,
        marks_schedules: true,
        reading: "Lower is faster. Phases 1 to 3 are device time (known work, queries, new work), loading and \
                  total are wall time; parts may overlap, so they need not add up.",
        unit: Unit::Milliseconds,
        lines: &[
            line("phase 1", &["ms_phase1"], BLUE),
            line("phase 2", &["ms_phase2"], ORANGE),
            line("phase 3", &["ms_phase3"], GREEN),
            line("loading", &["ms_stream"], PURPLE),
            total("total", &["ms"]),
        ],
    },
    PassPlot {
        title: "Queries",
        of_needs: false,
        marks_schedules: false,
        reading: "Pairs (tile, node) whose visibility was asked. Those culled by the interval test cost no ray; \
                  the visible ones lead to work. Multi-queries ask over several nodes at once and are repeated \
                  one by one if they fail.",
        unit: Unit::Count,
        lines: &[
            line("visible", &["queries_visible"], BLUE),
            line("culled by interval", &["queries_interval_culled"], ORANGE),
            line("multi-queries", &["multi_queries"], GREEN),
            line("multi-queries repeated", &["multi_queries_failed"], PURPLE),
            total("total", &["queries"]),
        ],
    },
    PassPlot {
        title: "Pairs",
        of_needs: false,
        marks_schedules: false,
        reading: "Pairs (tile, leaf). Visible and invisible: the cut at the end of the pass; intersected: the \
                  work done for it; pulled up: pairs whose children were merged.",
        unit: Unit::Count,
        lines: &[
            line("visible", &["pairs_visible"], BLUE),
            line("invisible", &["pairs_invisible"], ORANGE),
            line("pulled up", &["pulled_up"], PURPLE),
            line("intersected", &["pairs_intersected"], GREEN),
        ],
    },
    PassPlot {
        title: "Bytes moved",
        of_needs: false,
        marks_schedules: false,
        reading: "A bar is what one frame moved to the device. The line is what it needed and did not have: bars \
                  of BVH and geometry above the line were moved in vain.",
        unit: Unit::Bytes,
        lines: &[
            layer("BVH", &["bytes_bvh"], BLUE),
            layer("geometry", &["bytes_geometry"], ORANGE),
            layer("attributes", &["bytes_attributes"], GREEN),
            layer("textures", &["bytes_textures"], PURPLE),
            line("missing", &["bytes_needed_missing"], BLACK),
        ],
    },
    PassPlot {
        title: "Bytes needed",
        of_needs: true,
        marks_schedules: false,
        reading: "BVH and geometry. Needed: of all bricks that the rays had to look at; missing: of those not \
                  resident when the pass began; moved should be close to missing.",
        unit: Unit::Bytes,
        lines: &[
            line("needed", &["bytes_needed"], RED),
            line("missing", &["bytes_needed_missing"], BLACK),
            line("moved", &["bytes_bvh", "bytes_geometry"], BLUE),
        ],
    },
    PassPlot {
        title: ERROR,
        of_needs: false,
        marks_schedules: false,
        reading: "Mean absolute difference of the effect's part of the picture from the exact one, linear radiance: \
                  over all pixels, and over the tile where it is largest. Measured with --measure-error.",
        unit: Unit::Count,
        lines: &[line("all pixels", &["error_mean"], BLUE), line("worst tile", &["error_worst_tile"], RED)],
    },
    PassPlot {
        title: "Bricks",
        of_needs: false,
        marks_schedules: false,
        reading: "Needed and hit count bricks; loaded, loaded again and evicted count payloads (geometry and \
                  attributes are one each). Loaded again: within one pass, which means that the cache is too small; \
                  `brickwalk replay` counts reloads over the whole walk.",
        unit: Unit::Count,
        lines: &[
            total("needed", &["bricks_needed"]),
            line("hit", &["bricks_hit"], GREEN),
            line("loaded", &["bricks_loaded"], BLUE),
            line("loaded again", &["bricks_reloaded"], RED),
            line("evicted", &["bricks_evicted"], ORANGE),
        ],
    },
];

/// The plots of one pass.
pub fn of_pass(walk: &Walk, pass: &Pass, fields: &[Field]) -> Vec<Plot> {
    let is_off = |name: &str| fields.iter().any(|field| field.name == name && walk.is_off(field.only));
    let plots = PASS_PLOTS.iter().map(|plot| of_lines(plot, pass, &is_off));
    plots.filter(|plot| plot.title != ERROR || plot.chart.is_some()).collect()
}

fn of_lines(plot: &PassPlot, pass: &Pass, is_off: &dyn Fn(&str) -> bool) -> Plot {
    let (mut series, mut zero, mut off, mut missing) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let measured = pass.has_nonzero("bytes_needed");
    for line in plot.lines {
        let has_one = |field: &&&str| pass.rows.iter().any(|row| row.get(field).is_some());
        // Needs are measured on request; a walk that did not measure them records zero.
        let unmeasured = !measured && line.fields.iter().any(|field| field.starts_with("bytes_needed"));
        if unmeasured || line.fields.iter().find(has_one).is_none() {
            missing.push(line.name.to_string());
        } else if !line.fields.iter().any(|field| pass.has_nonzero(field)) {
            let undrawn = if line.fields.iter().all(|field| is_off(field)) { &mut off } else { &mut zero };
            undrawn.push(line.name.to_string());
        } else {
            let rows = pass.rows.iter().filter(|row| line.fields.iter().any(|f| row.get(f).is_some()));
            let points = rows.map(|row| (row.frame as f64, row.sum(line.fields))).collect();
            series.push(Series { name: line.name.into(), points, shape: line.shape, ink: line.ink });
        }
    }
    let drawn = !series.is_empty() && (measured || !plot.of_needs);
    let title = format!("{}, {}", plot.title, pass.name);
    let marks = if plot.marks_schedules { pass.switches() } else { Vec::new() };
    let chart = drawn.then_some(Chart { title, unit: plot.unit, across: Across::Frames, series, marks });
    Plot { title: plot.title, reading: plot.reading, chart, zero, off, missing }
}

/// The plots in which all passes are side by side.
pub fn of_walk(walk: &Walk) -> Vec<Plot> {
    let mut cache = of_field(
        walk,
        "Cache use",
        "Bytes of the cache in use when the pass ended, against its budget (dashed). At the budget, loads evict.",
        Unit::Bytes,
        "cache_used_bytes",
    );
    if let Some(chart) = &mut cache.chart {
        let budget = walk.passes.iter().flat_map(|pass| pass.series("cache_bytes")).max_by(|a, b| a.1.total_cmp(&b.1));
        if let (Some((_, budget)), Some(from), Some(to)) = (budget, walk.frames.first(), walk.frames.last())
            && budget > 0.0
        {
            let points = if from == to {
                vec![(*from as f64 - 0.5, budget), (*to as f64 + 0.5, budget)]
            } else {
                vec![(*from as f64, budget), (*to as f64, budget)]
            };
            chart.series.push(Series { name: "budget".into(), points, shape: Shape::Limit, ink: GREY });
        }
    }
    vec![
        of_field(
            walk,
            "Throughput",
            "Higher is faster: rays traced in a pass over its wall time, loading included.",
            Unit::MegaRays,
            "mrays_per_s",
        ),
        cache,
        of_field(
            walk,
            "Round trips",
            "Submissions that the host waited for; each costs a fixed time, whatever it computes.",
            Unit::Count,
            "round_trips",
        ),
    ]
}

/// A plot of one field with a line a pass.
fn of_field(walk: &Walk, title: &'static str, reading: &'static str, unit: Unit, field: &str) -> Plot {
    let drawn = walk.passes.iter().enumerate().filter(|(_, pass)| pass.has_nonzero(field));
    let series: Vec<Series> = drawn
        .map(|(k, pass)| Series {
            name: pass.name.clone(),
            points: pass.series(field),
            shape: Shape::Line,
            ink: INKS[k % INKS.len()],
        })
        .collect();
    let chart = (!series.is_empty()).then(|| Chart {
        title: title.into(),
        unit,
        across: Across::Frames,
        series,
        marks: Vec::new(),
    });
    let undrawn = |has: bool| {
        let passes = walk.passes.iter().filter(move |p| !p.has_nonzero(field) && p.series(field).is_empty() != has);
        passes.map(|pass| pass.name.clone()).collect()
    };
    Plot { title, reading, chart, zero: undrawn(true), off: Vec::new(), missing: undrawn(false) }
}
