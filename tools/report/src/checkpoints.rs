//! The error of frames against a reference, over samples and over seconds.

use crate::chart::{Across, Chart, Series, Shape, Unit};
use crate::ink::{BLUE, GREEN, GREY, Ink, ORANGE, PURPLE};
use crate::{ReportError, format, page};
use maud::{Markup, html};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// A line of `checkpoints.jsonl`.
#[derive(Clone, Copy, Debug, Deserialize)]
struct Row {
    frame: u64,
    samples: u64,
    seconds: f64,
    rmse: f64,
    rel_mse: f64,
    bias: f64,
    flip: f64,
}

/// What was measured; there may be nothing.
#[derive(Debug, Default)]
pub struct Checkpoints {
    rows: Vec<Row>,
}

/// Name, ink, shape and value of a curve.
type Curve = (&'static str, Ink, Shape, fn(&Row) -> f64);

const CURVES: [Curve; 4] = [
    ("RMSE", BLUE, Shape::Line, |row| row.rmse),
    ("relMSE", ORANGE, Shape::Dashed(0), |row| row.rel_mse),
    ("|bias|", GREEN, Shape::Dashed(1), |row| row.bias.abs()),
    ("FLIP", PURPLE, Shape::Dashed(2), |row| row.flip),
];

/// The means over frames of values at the same number of samples: samples, seconds, and those of the curves.
struct Mean {
    samples: f64,
    seconds: f64,
    values: [f64; CURVES.len()],
}

impl Checkpoints {
    /// Reads `dir/checkpoints.jsonl`; where there is none, there are no checkpoints.
    ///
    /// # Errors
    /// It cannot be read, or a line of it is no checkpoint.
    pub fn read(dir: &Path) -> Result<Self, ReportError> {
        let path = dir.join("checkpoints.jsonl");
        let text = match std::fs::read_to_string(&path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(Self::default()),
            text => text.map_err(|source| ReportError::Read { path: path.clone(), source })?,
        };
        let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let row = |(index, line): (usize, &str)| {
            let bad = |error: serde_json::Error| ReportError::Record {
                path: path.clone(),
                line: index + 1,
                reason: error.to_string(),
            };
            serde_json::from_str(line).map_err(bad)
        };
        Ok(Self { rows: lines.map(row).collect::<Result<_, _>>()? })
    }

    /// Whether nothing was measured.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// As comma-separated values.
    pub fn to_csv(&self) -> String {
        let line = |row: &Row| {
            let Row { frame, samples, seconds, rmse, rel_mse, bias, flip } = row;
            format!("{frame},{samples},{seconds},{rmse},{rel_mse},{bias},{flip}\n")
        };
        let head = "frame,samples,seconds,rmse,rel_mse,bias,flip\n".to_string();
        head + &self.rows.iter().map(line).collect::<String>()
    }

    fn means(&self) -> Vec<Mean> {
        let mut groups = BTreeMap::<u64, Vec<&Row>>::new();
        for row in &self.rows {
            groups.entry(row.samples).or_default().push(row);
        }
        let mean = |(samples, rows): (u64, Vec<&Row>)| {
            let mean = |of: fn(&Row) -> f64| rows.iter().map(|row| of(row)).sum::<f64>() / rows.len() as f64;
            Mean {
                samples: samples as f64,
                seconds: mean(|row| row.seconds),
                values: CURVES.map(|(.., value)| mean(value)),
            }
        };
        groups.into_iter().map(mean).collect()
    }

    /// The part of the page; empty where nothing was measured.
    ///
    /// # Errors
    /// A plot cannot be drawn.
    pub fn section(&self) -> Result<Markup, ReportError> {
        let means = self.means();
        let plots = [
            plot(&means, "Error over samples", "samples per pixel", |mean| mean.samples)?,
            plot(&means, "Error over seconds", "seconds per frame", |mean| mean.seconds)?,
        ];
        Ok(html! {
            @if !self.is_empty() {
                section {
                    h2 { "Error" }
                    p.reading {
                        "Against the reference, means over frames; FLIP is HDR-FLIP. Seconds are those of rendering, "
                        "without measuring."
                    }
                    div.plots { @for plot in plots.into_iter().flatten() { (plot) } }
                    details { summary { "Every checkpoint" } (self.table()) }
                    p { a href="checkpoints.csv" { "checkpoints.csv" } }
                }
            }
        })
    }

    fn table(&self) -> Markup {
        html! {
            div.wide { table {
                thead { tr {
                    th { "Frame" } th { "Samples" } th { "Seconds" }
                    th { "RMSE" } th { "relMSE" } th { "bias" } th { "FLIP" }
                } }
                tbody { @for row in &self.rows { tr {
                    th scope="row" { (row.frame) } td { (format::count(row.samples as f64)) }
                    @for value in [row.seconds, row.rmse, row.rel_mse, row.bias, row.flip] { td { (precise(value)) } }
                } } }
            } }
        }
    }
}

/// A value with four significant digits.
fn precise(value: f64) -> String {
    if value == 0.0 || (1e-3..1e4).contains(&value.abs()) { format!("{value:.5}") } else { format!("{value:.3e}") }
}

/// The means over `across`, with a line of slope -1/2 from the first RMSE; `None` where nothing is above zero.
fn plot(
    means: &[Mean],
    title: &'static str,
    across: &'static str,
    x: fn(&Mean) -> f64,
) -> Result<Option<Markup>, ReportError> {
    let curve = |(k, &(name, ink, shape, _)): (usize, &Curve)| Series {
        name: name.into(),
        points: means.iter().map(|mean| (x(mean), mean.values[k])).collect(),
        shape,
        ink,
    };
    let has_points = |series: &Series| series.points.iter().any(|point| point.0 > 0.0 && point.1 > 0.0);
    let mut series: Vec<Series> = CURVES.iter().enumerate().map(curve).filter(has_points).collect();
    if series.is_empty() {
        return Ok(None);
    }
    if let Some(first) = means.first().filter(|first| x(first) > 0.0 && first.values[0] > 0.0) {
        let points = means.iter().map(|mean| (x(mean), first.values[0] * (x(first) / x(mean)).sqrt())).collect();
        series.push(Series { name: "RMSE of noise alone".into(), points, shape: Shape::Limit, ink: GREY });
    }
    let chart =
        Chart { title: title.into(), unit: Unit::Count, across: Across::Log(across), series, marks: Vec::new() };
    let reading = "Lower is better. RMSE of an unbiased estimate falls as 1/√N (dashed grey), relMSE as 1/N; a curve \
                   that levels off shows a bias.";
    page::drawn(&chart, title, reading, None, |values| values.last().map(|last| format::number(*last))).map(Some)
}
