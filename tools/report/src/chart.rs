//! One plot over the frames of a walk, or over sizes of a cache, drawn as SVG.
//!
//! The picture is scaled by its viewBox, so its text has to stay legible at the width of a phone: the box is narrow,
//! and legend, title and reading aid are HTML beside it. Colours are written as plain SVG attributes, which the rules
//! of [`colour_rules`] override where the reader prefers a dark page.

use crate::{ReportError, format};
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint};
use plotters::prelude::*;
use std::fmt::Write as _;

/// The box in user units; the drawing library places on integers, hence a grid [`FINE`] times as fine.
const WIDTH: u32 = 440;
const HEIGHT: u32 = 270;
const FINE: u32 = 4;
/// Line height of text in user units; the drawing library makes the letters 1.24 times smaller.
const TEXT: u32 = 18;
/// Above so many frames single values are no longer marked.
const MARKED_FRAMES: usize = 40;
/// Above so many frames neighbours are drawn as one point, their mean: more would be a solid band.
const DRAWN_FRAMES: u64 = 200;

/// A series' colour: on a light and on a dark page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ink {
    light: [u8; 3],
    dark: [u8; 3],
}

/// Colours that stay apart in both modes and for colour-blind readers; a quantity keeps its ink in all plots.
pub const BLUE: Ink = Ink { light: [0x1f, 0x6f, 0xd0], dark: [0x6c, 0xae, 0xff] };
/// See [`BLUE`].
pub const ORANGE: Ink = Ink { light: [0xe0, 0x70, 0x10], dark: [0xff, 0xa1, 0x4a] };
/// See [`BLUE`].
pub const GREEN: Ink = Ink { light: [0x12, 0x96, 0x72], dark: [0x3f, 0xd0, 0xa4] };
/// See [`BLUE`].
pub const PURPLE: Ink = Ink { light: [0x9a, 0x47, 0xb8], dark: [0xd2, 0x92, 0xee] };
/// See [`BLUE`].
pub const RED: Ink = Ink { light: [0xc8, 0x28, 0x4e], dark: [0xff, 0x7f, 0x9c] };
/// See [`BLUE`]; of totals and limits.
pub const GREY: Ink = Ink { light: [0x56, 0x60, 0x6c], dark: [0xb4, 0xbe, 0xca] };
/// See [`BLUE`]; of what is read against bars.
pub const BLACK: Ink = Ink { light: [0x1a, 0x1f, 0x25], dark: [0xff, 0xff, 0xff] };
/// The inks in the order in which passes take them.
pub const INKS: [Ink; 6] = [BLUE, ORANGE, GREEN, PURPLE, RED, GREY];

/// Ink of the axes.
const AXIS: Ink = Ink { light: [0x8a, 0x93, 0x9e], dark: [0x6f, 0x79, 0x85] };
/// Ink of the grid.
const GRID: Ink = Ink { light: [0xe2, 0xe6, 0xea], dark: [0x2d, 0x34, 0x3c] };
/// Ink of the axes' labels.
const LABEL: Ink = Ink { light: [0x4a, 0x53, 0x5e], dark: [0xb0, 0xba, 0xc6] };

/// [`LABEL`] as it is written.
pub const LABEL_HEX: &str = "#4A535E";

impl Ink {
    fn rgb(self) -> RGBColor {
        RGBColor(self.light[0], self.light[1], self.light[2])
    }

    /// The colour as the drawing library writes it.
    pub fn light_hex(self) -> String {
        let [r, g, b] = self.light;
        format!("#{r:02X}{g:02X}{b:02X}")
    }

    fn dark_hex(self) -> String {
        let [r, g, b] = self.dark;
        format!("#{r:02X}{g:02X}{b:02X}")
    }
}

/// Style rules, for use under a query for dark pages, that replace every light ink of a plot by its dark one.
pub fn colour_rules() -> String {
    let mut rules = String::new();
    for ink in INKS.into_iter().chain([BLACK, AXIS, GRID, LABEL]) {
        let (light, dark) = (ink.light_hex(), ink.dark_hex());
        // Writing to a string cannot fail.
        let _ = write!(rules, ".plot [stroke=\"{light}\"]{{stroke:{dark}}}.plot [fill=\"{light}\"]{{fill:{dark}}}");
    }
    rules
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A line.
    Line,
    /// A thicker line, of a total.
    Total,
    /// A dashed line, of a limit.
    Limit,
    /// Bars that stand on those of the stacked series before.
    Stacked,
}

/// What a plot's values count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// Milliseconds.
    Milliseconds,
    /// Millions of rays per second.
    MegaRays,
    /// A count of something that the title names.
    Count,
    /// Bytes.
    Bytes,
    /// Hundredths.
    Percent,
}

/// What a plot runs over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Across {
    /// Frames from 0; the first starts with an empty cache.
    Frames,
    /// Sizes of a cache, in percent of all bricks.
    Shares,
    /// What the name says, from 0.
    Named(&'static str),
}

impl Unit {
    /// The unit of the axis of a plot up to `max`, and its size in the recorded unit.
    fn scale(self, max: f64) -> (&'static str, f64) {
        match self {
            Self::Milliseconds => ("ms", 1.0),
            Self::MegaRays => ("Mrays/s", 1.0),
            Self::Bytes => format::byte_unit(max),
            Self::Percent => ("%", 1.0),
            Self::Count if max >= 1e9 => ("thousand millions", 1e9),
            Self::Count if max >= 2e6 => ("millions", 1e6),
            Self::Count if max >= 2e4 => ("thousands", 1e3),
            Self::Count => ("", 1.0),
        }
    }

    /// One value with its unit.
    pub fn show(self, value: f64) -> String {
        match self {
            Self::Milliseconds => format!("{} ms", format::number(value)),
            Self::MegaRays => format!("{} Mrays/s", format::number(value)),
            Self::Bytes => format::bytes(value),
            Self::Percent => format!("{} %", format::number(value)),
            Self::Count if value.fract() == 0.0 => format::count(value),
            Self::Count => format::number(value),
        }
    }
}

/// Values over the frames.
#[derive(Clone, Debug)]
pub struct Series {
    /// What the legend says.
    pub name: String,
    /// (frame or share, value), ascending.
    pub points: Vec<(f64, f64)>,
    /// How it is drawn.
    pub shape: Shape,
    /// Its colour.
    pub ink: Ink,
}

/// A bar: frame, low end, high end.
type Bar = (f64, f64, f64);

/// A plot. Each series has a point at least, and some point is above zero.
#[derive(Clone, Debug)]
pub struct Chart {
    /// What is plotted.
    pub title: String,
    /// What the values count.
    pub unit: Unit,
    /// What they run over.
    pub across: Across,
    /// The series in drawing order; stacked ones from the bottom.
    pub series: Vec<Series>,
}

/// A drawn plot.
#[derive(Debug)]
pub struct Drawing {
    /// The contents of an `svg` element with the viewBox [`Drawing::view_box`].
    pub svg: String,
    /// The unit of the vertical axis; empty for plain counts.
    pub unit: &'static str,
    /// Sentences on values beyond the vertical axis and on frames drawn as one; empty where there are none.
    pub notes: String,
}

impl Drawing {
    /// Width of the drawing in the units of its text.
    pub const WIDTH: u32 = WIDTH;

    /// The `viewBox` of the drawing.
    pub fn view_box() -> String {
        format!("0 0 {} {}", WIDTH * FINE, HEIGHT * FINE)
    }
}

impl Chart {
    /// The stacked series with each point replaced by its bar (frame, low, high).
    fn bars(&self) -> Vec<(Ink, Vec<Bar>)> {
        let mut tops = std::collections::HashMap::<u64, f64>::new();
        let stacked = self.series.iter().filter(|s| s.shape == Shape::Stacked);
        stacked
            .map(|series| {
                let bar = |&(frame, value): &(f64, f64)| {
                    let top = tops.entry(frame as u64).or_default();
                    let low = *top;
                    *top += value;
                    (frame, low, *top)
                };
                (series.ink, series.points.iter().map(bar).collect())
            })
            .collect()
    }

    /// The frames from and to, and the highest value of the first frame and of the others.
    fn extent(&self) -> Extent {
        let mut extent = Extent { from: f64::INFINITY, to: 0.0, first: 0.0, rest: 0.0, frames: 0 };
        let mut frames = std::collections::BTreeSet::new();
        for &(frame, _) in self.series.iter().flat_map(|s| &s.points) {
            extent.from = extent.from.min(frame);
            extent.to = extent.to.max(frame);
            frames.insert(frame as u64);
        }
        extent.frames = frames.len();
        let bars = self.bars();
        let tops = bars.iter().flat_map(|(_, bars)| bars.iter().map(|&(frame, _, high)| (frame, high)));
        let lines = self.series.iter().filter(|s| s.shape != Shape::Stacked).flat_map(|s| s.points.iter().copied());
        for (frame, value) in tops.chain(lines) {
            let max = if frame == extent.from { &mut extent.first } else { &mut extent.rest };
            *max = max.max(value);
        }
        extent
    }

    /// The chart with the means of groups of neighbouring frames, and how many frames a group has. The first frame
    /// stays alone, because it starts with an empty cache.
    fn grouped(&self) -> (Self, u64) {
        let extent = self.extent();
        let group = ((extent.to - extent.from) as u64).div_ceil(DRAWN_FRAMES).max(1);
        let mut chart = self.clone();
        if group == 1 || self.across == Across::Shares {
            return (chart, 1);
        }
        for series in chart.series.iter_mut().filter(|s| s.shape != Shape::Limit) {
            // Sums and counts by the group's middle frame.
            let mut groups = std::collections::BTreeMap::<u64, (f64, u32)>::new();
            for &(frame, value) in &series.points {
                let (first, frame) = (extent.from as u64, frame as u64);
                let middle = match frame - first {
                    0 => first,
                    later => first + 1 + (later - 1) / group * group + group / 2,
                };
                let (sum, count) = groups.entry(middle).or_default();
                *sum += value;
                *count += 1;
            }
            series.points = groups.into_iter().map(|(at, (sum, count))| (at as f64, sum / f64::from(count))).collect();
        }
        (chart, group)
    }

    /// Draws the plot.
    ///
    /// # Errors
    /// The drawing library fails.
    pub fn draw(&self) -> Result<Drawing, ReportError> {
        let (chart, group) = self.grouped();
        let extent = chart.extent();
        let cut = self.across == Across::Frames && extent.first_is_beyond();
        let max = if cut { extent.rest } else { extent.first.max(extent.rest) };
        let (unit, size) = self.unit.scale(max);
        let ticks = ticks(max / size, 4);
        let top = ticks.last().copied().unwrap_or(1.0);
        let scale = Scale { ticks, top, size, group: group as f64 };
        let mut text = String::new();
        let failed = |reason| ReportError::Draw { plot: self.title.clone(), reason };
        chart.draw_into(&mut text, &extent, &scale).map_err(failed)?;
        let mut notes = Vec::new();
        if cut && extent.first > top * size {
            notes.push(format!("Frame {:.0} is beyond the axis with {}.", extent.from, self.unit.show(extent.first)));
        }
        if group > 1 {
            notes.push(format!("Each point is the mean of {group} frames."));
        }
        Ok(Drawing { svg: inner(&text).to_string(), unit, notes: notes.join(" ") })
    }

    fn draw_into(&self, text: &mut String, extent: &Extent, scale: &Scale) -> Result<(), String> {
        let Scale { top, size, .. } = *scale;
        let clip = |value: f64| (value / size).min(top);
        let marked = extent.frames <= MARKED_FRAMES;
        let half_bar = if marked { 0.36 } else { 0.5 * scale.group };
        let has_bars = self.series.iter().any(|s| s.shape == Shape::Stacked);
        // A still needs a range, and the outer bars stand half outside of the range of frames.
        let margin =
            if has_bars || extent.from == extent.to { 0.6 * scale.group } else { (extent.to - extent.from) * 0.01 };
        let frames = frame_ticks(extent.from, extent.to);
        let x_axis = Axis { low: extent.from - margin, high: extent.to + margin, ticks: frames };
        let y_axis = Axis { low: 0.0, high: top, ticks: scale.ticks.clone() };
        let root = SVGBackend::with_string(text, (WIDTH * FINE, HEIGHT * FINE)).into_drawing_area();
        let mut chart = ChartBuilder::on(&root)
            .margin_top(10 * FINE)
            .margin_right(12 * FINE)
            .set_label_area_size(LabelAreaPosition::Left, 58 * FINE)
            .set_label_area_size(LabelAreaPosition::Bottom, 46 * FINE)
            .build_cartesian_2d(x_axis, y_axis)
            .map_err(|e| e.to_string())?;
        let label = ("sans-serif", TEXT * FINE).into_font().color(&LABEL.rgb());
        chart
            .configure_mesh()
            .disable_x_mesh()
            .bold_line_style(GRID.rgb().stroke_width(FINE))
            .light_line_style(TRANSPARENT)
            .axis_style(AXIS.rgb().stroke_width(FINE))
            .label_style(label.clone())
            .axis_desc_style(label)
            .x_desc(match self.across {
                Across::Frames => "frame",
                Across::Shares => "cache, % of all bricks",
                Across::Named(name) => name,
            })
            .set_all_tick_mark_size(4 * FINE)
            .x_label_formatter(&|frame| format::count(*frame))
            .y_label_formatter(&|value| tick_label(*value))
            .draw()
            .map_err(|e| e.to_string())?;
        for (ink, bars) in self.bars() {
            let rectangle = |(frame, low, high): Bar| {
                Rectangle::new([(frame - half_bar, clip(low)), (frame + half_bar, clip(high))], ink.rgb().filled())
            };
            let seen = bars.into_iter().filter(|&(_, low, high)| high > low && clip(low) < top);
            chart.draw_series(seen.map(rectangle)).map_err(|e| e.to_string())?;
        }
        for series in self.series.iter().filter(|s| s.shape != Shape::Stacked) {
            let points: Vec<(f64, f64)> = series.points.iter().map(|&(frame, value)| (frame, clip(value))).collect();
            let width = FINE * if series.shape == Shape::Total { 5 } else { 4 } / 2;
            let style = series.ink.rgb().stroke_width(width);
            if series.shape == Shape::Limit {
                let line = DashedLineSeries::new(points, 6 * FINE, 4 * FINE, style);
                chart.draw_series(line).map_err(|e| e.to_string())?;
                continue;
            }
            if marked {
                let radius = FINE * if extent.frames == 1 { 5 } else { 2 };
                let dots = points.iter().map(|&point| Circle::new(point, radius, series.ink.rgb().filled()));
                chart.draw_series(dots).map_err(|e| e.to_string())?;
            }
            chart.draw_series(LineSeries::new(points, style)).map_err(|e| e.to_string())?;
        }
        root.present().map_err(|e| e.to_string())
    }
}

/// A linear axis with labels at chosen values: the library's own choice has fractions of frames.
#[derive(Clone, Debug)]
struct Axis {
    low: f64,
    high: f64,
    ticks: Vec<f64>,
}

impl Ranged for Axis {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let along = (value - self.low) / (self.high - self.low);
        limit.0 + (f64::from(limit.1 - limit.0) * along).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() { Vec::new() } else { self.ticks.clone() }
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.low..self.high
    }
}

/// The vertical axis, and how coarse the horizontal one is.
#[derive(Debug)]
struct Scale {
    /// Labelled values in units of the axis, from 0.
    ticks: Vec<f64>,
    /// The last of them.
    top: f64,
    /// The unit of the axis in recorded units.
    size: f64,
    /// Frames a point stands for.
    group: f64,
}

/// What a plot spans, in recorded units.
#[derive(Debug)]
struct Extent {
    from: f64,
    to: f64,
    first: f64,
    rest: f64,
    frames: usize,
}

impl Extent {
    /// Whether the first frame, which starts with an empty cache, would flatten all others.
    fn first_is_beyond(&self) -> bool {
        self.frames >= 5 && self.rest > 0.0 && self.first > 4.0 * self.rest
    }
}

/// Round numbers from 0 to at least `max`, about `parts` steps.
fn ticks(max: f64, parts: u32) -> Vec<f64> {
    let max = if max > 0.0 && max.is_finite() { max } else { 1.0 };
    let rough = max / f64::from(parts);
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 2.5, 5.0, 10.0].into_iter().map(|s| s * power).find(|s| *s >= rough * 0.999).unwrap_or(rough);
    let count = (max / step * 0.9999).ceil().max(1.0) as u32;
    (0..=count).map(|k| f64::from(k) * step).collect()
}

/// At most seven frames for the horizontal axis, at round numbers.
fn frame_ticks(from: f64, to: f64) -> Vec<f64> {
    let steps = (0..).flat_map(|power| [1.0, 2.0, 5.0].map(|s| s * 10f64.powi(power)));
    let step = steps.into_iter().find(|step| (to - from) / step <= 6.0).unwrap_or(1.0);
    let first = (from / step).ceil();
    let count = ((to / step).floor() - first).max(0.0) as u32;
    (0..=count).map(|k| (first + f64::from(k)) * step).collect()
}

/// A tick's value without digits that say nothing: `0`, `0.25`, `2.5`, `1,000`.
fn tick_label(value: f64) -> String {
    if value >= 1000.0 {
        return format::count(value);
    }
    if value != 0.0 && value < 0.001 {
        return format!("{value:.0e}");
    }
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_string()
}

/// What is inside of the drawing library's `svg` element: the page has its own, which scales.
fn inner(svg: &str) -> &str {
    let start = svg.find('>').map_or(0, |at| at + 1);
    let end = svg.rfind("</svg>").unwrap_or(svg.len());
    svg.get(start..end).unwrap_or_default().trim()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>, shape: Shape) -> Chart {
        let series = vec![Series { name: "one".into(), points, shape, ink: BLUE }];
        Chart { title: "a title".into(), unit: Unit::Milliseconds, across: Across::Frames, series }
    }

    #[test]
    fn ticks_are_round_and_cover_the_maximum() {
        assert_eq!(ticks(4.0, 4), [0.0, 1.0, 2.0, 3.0, 4.0]);
        assert_eq!(ticks(90.0, 4), [0.0, 25.0, 50.0, 75.0, 100.0]);
        for exponent in -12..12 {
            for mantissa in 1..100 {
                let max = f64::from(mantissa) * 10f64.powi(exponent);
                let ticks = ticks(max, 4);
                assert!(ticks[ticks.len() - 1] >= max * 0.999, "{max}: {ticks:?}");
                assert!((2..=6).contains(&ticks.len()), "{max}: {ticks:?}");
            }
        }
        assert_eq!(ticks(0.0, 4).first(), Some(&0.0));
    }

    #[test]
    fn frame_ticks_are_integers_within_the_range() {
        assert_eq!(frame_ticks(0.0, 0.0), [0.0]);
        assert_eq!(frame_ticks(7.0, 7.0), [7.0]);
        assert_eq!(frame_ticks(0.0, 29.0), [0.0, 5.0, 10.0, 15.0, 20.0, 25.0]);
        for to in 0..3000 {
            let ticks = frame_ticks(3.0, 3.0 + f64::from(to));
            assert!(ticks.len() <= 7, "{ticks:?}");
            assert!(ticks.iter().all(|t| t.fract() == 0.0 && (3.0..=3.0 + f64::from(to)).contains(t)), "{ticks:?}");
        }
    }

    #[test]
    fn tick_labels_keep_what_tells_them_apart() {
        assert_eq!(tick_label(0.0), "0");
        assert_eq!(tick_label(0.25), "0.25");
        assert_eq!(tick_label(10.0), "10");
        assert_eq!(tick_label(2500.0), "2,500");
        assert_eq!(tick_label(0.0001), "1e-4");
    }

    #[test]
    fn a_dominating_first_frame_is_cut_and_said() {
        let mut points: Vec<(f64, f64)> = (0..10).map(|k| (f64::from(k), 10.0)).collect();
        assert_eq!(chart(points.clone(), Shape::Line).draw().unwrap().notes, "");
        points[0].1 = 500.0;
        for shape in [Shape::Line, Shape::Stacked] {
            let drawing = chart(points.clone(), shape).draw().unwrap();
            assert_eq!(drawing.notes, "Frame 0 is beyond the axis with 500 ms.");
            assert!(!drawing.svg.contains("500"), "the axis must follow the other frames");
        }
    }

    #[test]
    fn many_frames_are_drawn_as_means_of_groups() {
        let few = chart((0..=200).map(|k| (f64::from(k), 1.0)).collect(), Shape::Line);
        assert_eq!(few.grouped().1, 1);
        assert_eq!(few.grouped().0.series[0].points, few.series[0].points);
        let many = chart((10..=610).map(|k| (f64::from(k), f64::from(k))).collect(), Shape::Line);
        let (grouped, group) = many.grouped();
        assert_eq!(group, 3);
        // 11, 12, 13 have the mean and the middle 12; frame 10 stays alone.
        assert_eq!(grouped.series[0].points[..3], [(10.0, 10.0), (12.0, 12.0), (15.0, 15.0)]);
        assert_eq!(grouped.series[0].points.len(), 201);
        assert_eq!(many.draw().unwrap().notes, "Each point is the mean of 3 frames.");
    }

    #[test]
    fn each_shape_draws_its_element() {
        let points = vec![(0.0, 1.0), (1.0, 2.0)];
        let line = chart(points.clone(), Shape::Line).draw().unwrap().svg;
        assert!(line.contains("<polyline") && line.contains("<circle"));
        let bars = chart(points.clone(), Shape::Stacked).draw().unwrap().svg;
        assert_eq!(bars.matches("<rect").count(), 2);
        assert!(!bars.contains("<circle"));
        let one = chart(vec![(4.0, 2.0)], Shape::Line).draw().unwrap().svg;
        assert!(one.contains("<circle"), "a single frame must be seen");
    }

    #[test]
    fn bars_stand_on_each_other() {
        let mut chart = chart(vec![(0.0, 1.0), (1.0, 2.0)], Shape::Stacked);
        chart.series.push(Series { points: vec![(1.0, 5.0)], ..chart.series[0].clone() });
        assert_eq!(chart.bars()[1].1, [(1.0, 2.0, 7.0)]);
        assert_eq!(chart.extent().rest, 7.0);
    }
}
