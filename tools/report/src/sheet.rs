//! A page of tables and plots whose contents the caller gives: the results of measurements. The same tables go into CSV
//! and Markdown, so that all of them say the same.

use crate::chart::{Across, Chart, Drawing, Series, Shape, Unit};
use crate::csv::quoted;
use crate::ink::{INKS, LABEL_HEX};
use crate::scatter::Scatter;
use crate::walk::Statistics;
use crate::{ReportError, format, page};
use maud::{Markup, html};
use serde::{Serialize, Serializer};
use std::path::Path;

/// A page.
#[derive(Clone, Debug, Default)]
pub struct Sheet {
    /// What kind of page it is.
    pub kicker: String,
    /// Its title.
    pub title: String,
    /// What a reader must know first; true: a warning.
    pub verdicts: Vec<(String, bool)>,
    /// Names and values.
    pub facts: Vec<(String, String)>,
    /// Its sections.
    pub sections: Vec<Section>,
}

/// A part of a page.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// Its title.
    pub title: String,
    /// How to read it.
    pub reading: String,
    /// Tables.
    pub tables: Vec<Table>,
    /// Plots.
    pub plots: Vec<Graph>,
    /// Pictures.
    pub pictures: Vec<Shown>,
}

/// A picture with what is below it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shown {
    /// What it shows.
    pub caption: String,
    /// A PNG file.
    pub png: Vec<u8>,
}

/// A table.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Table {
    /// Its short name, which names its file.
    pub name: String,
    /// What it shows.
    pub caption: String,
    /// Heads of the columns.
    pub columns: Vec<String>,
    /// Rows, as long as the columns.
    pub rows: Vec<Vec<Value>>,
}

/// An entry of a table; as JSON a text, a number or null.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Words.
    Text(String),
    /// A number.
    Number(f64),
    /// A number that a unit of one character follows, such as × or %.
    Of(f64, char),
    /// Not known.
    Missing,
}

impl Value {
    /// `value`, or that it is not known.
    pub fn number(value: Option<f64>) -> Self {
        value.map_or(Self::Missing, Self::Number)
    }

    /// `value` times, or that it is not known.
    pub fn ratio(value: Option<f64>) -> Self {
        value.map_or(Self::Missing, |value| Self::Of(value, '×'))
    }

    /// As people read it.
    pub fn show(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number(value) => format::number(*value),
            Self::Of(value, unit) => format!("{}{unit}", format::number(*value)),
            Self::Missing => "–".into(),
        }
    }
}

impl Serialize for Value {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Text(text) => serializer.serialize_str(text),
            Self::Number(value) | Self::Of(value, _) => serializer.serialize_f64(*value),
            Self::Missing => serializer.serialize_none(),
        }
    }
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Self::Text(text.into())
    }
}

impl From<String> for Value {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Value {
    fn from(value: f64) -> Self {
        Self::Number(value)
    }
}

impl Table {
    /// As comma-separated values (RFC 4180), numbers in full.
    pub fn to_csv(&self) -> String {
        let value = |value: &Value| match value {
            Value::Text(text) => quoted(text),
            Value::Number(value) | Value::Of(value, _) => value.to_string(),
            Value::Missing => String::new(),
        };
        let head = self.columns.iter().map(|column| quoted(column)).collect();
        let rows = self.rows.iter().map(|row| row.iter().map(value).collect());
        let lines = std::iter::once(head).chain(rows).map(|row: Vec<String>| row.join(",") + "\n");
        lines.collect()
    }

    /// Whether a column holds words: these begin where its head does, and numbers end where it does.
    fn is_of_words(&self, column: usize) -> bool {
        self.rows.iter().any(|row| matches!(row[column], Value::Text(_)))
    }

    /// As a table of Markdown whose columns are aligned in its text as well.
    pub fn to_markdown(&self) -> String {
        let rows = self.rows.iter().map(|row| row.iter().map(|value| value.show().replace('|', "/")).collect());
        let rows: Vec<Vec<String>> = std::iter::once(self.columns.clone()).chain(rows).collect();
        let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0).max(3);
        let columns: Vec<(usize, bool)> =
            (0..self.columns.len()).map(|column| (width(column), self.is_of_words(column))).collect();
        let line = |row: &Vec<String>| {
            let cell = |(text, &(width, is_of_words)): (&String, &(usize, bool))| {
                if is_of_words { format!("{text:<width$}") } else { format!("{text:>width$}") }
            };
            format!("| {} |\n", row.iter().zip(&columns).map(cell).collect::<Vec<_>>().join(" | "))
        };
        let rule = |&(width, is_of_words): &(usize, bool)| {
            if is_of_words { "-".repeat(width) } else { "-".repeat(width - 1) + ":" }
        };
        let rule = line(&columns.iter().map(rule).collect());
        line(&rows[0]) + &rule + &rows[1..].iter().map(line).collect::<String>()
    }

    fn html(&self) -> Markup {
        html! {
            @if !self.caption.is_empty() { p.reading { (self.caption) } }
            div.wide { table.sheet {
                thead { tr {
                    @for (k, column) in self.columns.iter().enumerate() {
                        th class=[self.is_of_words(k).then_some("name")] { (column) }
                    }
                } }
                tbody {
                    @for row in &self.rows { tr {
                        @for value in row {
                            td class=[matches!(value, Value::Text(_)).then_some("name")] { (value.show()) }
                        }
                    } }
                }
            } }
        }
    }
}

/// A plot.
#[derive(Clone, Debug)]
pub struct Graph {
    /// What is plotted.
    pub title: String,
    /// How to read it.
    pub reading: String,
    /// What is drawn.
    pub shape: GraphShape,
}

/// A line's name and points.
pub type Line = (String, Vec<(f64, f64)>);

/// What a plot draws.
#[derive(Clone, Debug)]
pub enum GraphShape {
    /// A line each.
    Lines {
        /// What runs along the horizontal axis.
        across: &'static str,
        /// What runs upward.
        unit: Unit,
        /// Whether both axes are logarithmic; points with a coordinate of 0 are then left out.
        is_log: bool,
        /// Names and points, by ascending first coordinate, not negative.
        lines: Vec<Line>,
    },
    /// Points on logarithmic axes.
    Points(Scatter),
    /// A bar each, of parts that stand beside one another.
    Bars {
        /// The unit of their lengths.
        unit: Unit,
        /// Names of the parts.
        parts: Vec<String>,
        /// Names of the bars, and the lengths of their parts, not negative.
        bars: Vec<(String, Vec<f64>)>,
    },
}

/// Writes `dir/report.html`. It appears complete or not at all.
///
/// # Errors
/// A plot cannot be drawn, or the page cannot be written.
pub fn write_sheet(dir: &Path, sheet: &Sheet) -> Result<(), ReportError> {
    let head = html! {
        p.kicker { (sheet.kicker) }
        h1 { (sheet.title) }
        ul.verdict { @for (text, warns) in &sheet.verdicts { li.warn[*warns] { (text) } } }
        dl.facts { @for (name, value) in &sheet.facts { div { dt { (name) } dd { (value) } } } }
    };
    let sections = sheet.sections.iter().map(section).collect::<Result<Vec<_>, _>>()?;
    let main = html! { @for section in sections { (section) } };
    crate::publish(dir.join("report.html"), page::whole(&sheet.title, &head, &main).as_bytes())
}

fn section(section: &Section) -> Result<Markup, ReportError> {
    let plots = section.plots.iter().map(graph).collect::<Result<Vec<_>, _>>()?;
    Ok(html! {
        section {
            h2 { (section.title) }
            @if !section.reading.is_empty() { p.reading { (section.reading) } }
            @if !plots.is_empty() { div.plots { @for plot in plots.into_iter().flatten() { (plot) } } }
            @if !section.pictures.is_empty() { div.gallery { @for shown in &section.pictures {
                figure { (page::enlarged(&shown.png, &shown.caption)) figcaption { (shown.caption) } }
            } } }
            @for table in &section.tables { (table.html()) }
        }
    })
}

/// A drawn plot; `None` where there is nothing above zero.
fn graph(graph: &Graph) -> Result<Option<Markup>, ReportError> {
    match &graph.shape {
        GraphShape::Lines { across, unit, is_log, lines } => {
            let series = |(k, (name, points)): (usize, &Line)| Series {
                name: name.clone(),
                points: points.clone(),
                shape: Shape::Line,
                ink: INKS[k % INKS.len()],
            };
            let series: Vec<Series> =
                lines.iter().filter(|line| line.1.iter().any(|p| p.1 > 0.0)).enumerate().map(series).collect();
            if series.is_empty() {
                return Ok(None);
            }
            let chart = Chart {
                title: graph.title.clone(),
                across: if *is_log { Across::Log(across) } else { Across::Named(across) },
                unit: *unit,
                series,
                marks: Vec::new(),
            };
            let median = |values| Statistics::of(values).map(|s| chart.unit.show(s.median));
            Ok(Some(page::drawn(&chart, &graph.title, &graph.reading, None, median)?))
        }
        GraphShape::Points(scatter) => Ok(scatter.figure(&graph.title, &graph.reading)),
        GraphShape::Bars { unit, parts, bars } => {
            let drawn = bars.iter().any(|(_, lengths)| lengths.iter().sum::<f64>() > 0.0);
            Ok(drawn.then(|| bar_figure(graph, *unit, parts, bars)))
        }
    }
}

/// Height of a bar with its name, in user units.
const BAR: usize = 34;

fn bar_figure(graph: &Graph, unit: Unit, parts: &[String], bars: &[(String, Vec<f64>)]) -> Markup {
    let width = Drawing::WIDTH as f64;
    let longest = bars.iter().map(|(_, lengths)| lengths.iter().sum::<f64>()).fold(0.0, f64::max);
    let scale = (width - 4.0) / longest;
    let colour = |part: usize| INKS[part % INKS.len()].light_hex();
    // Start, length and colour of every part.
    let pieces = |lengths: &[f64]| -> Vec<(f64, f64, String)> {
        let mut at = 0.0;
        let piece = |(part, &length): (usize, &f64)| {
            at += length;
            ((at - length) * scale, length * scale, colour(part))
        };
        lengths.iter().enumerate().map(piece).collect()
    };
    html! {
        figure.plot {
            figcaption {
                h3 { (graph.title) }
                ul.legend { @for (part, name) in parts.iter().enumerate() { li {
                    svg.key viewBox="0 0 16 10" aria-hidden="true" { (page::key(Shape::Stacked, &colour(part))) }
                    (name)
                } } }
            }
            svg viewBox=(format!("0 0 {width} {}", bars.len() * BAR)) role="img" aria-label=(graph.title) {
                @for (row, (name, lengths)) in bars.iter().enumerate() {
                    text x="0" y=(row * BAR + 13) font-size="13" fill=(LABEL_HEX) {
                        (name) ": " (unit.show(lengths.iter().sum()))
                    }
                    @for (at, length, colour) in pieces(lengths) {
                        rect x=(format!("{at:.2}")) y=(row * BAR + 17) width=(format!("{length:.2}")) height="12"
                            fill=(colour) {}
                    }
                }
            }
            div { p.reading { (graph.reading) } }
        }
    }
}
