//! One plot over the frames of a walk, or over sizes of a cache, drawn as SVG.
//!
//! The picture is scaled by its viewBox, so its text has to stay legible at the width of a phone: the box is narrow,
//! and legend, title and reading aid are HTML beside it. Beside the picture goes its data, for the script that shows
//! values where the pointer is.

use crate::axis::{Axis, frame_ticks, log_ticks, tick_label, ticks};
use crate::ink::{AXIS, GRID, Ink, LABEL};
use crate::{ReportError, format};
use plotters::prelude::*;
use serde_json::json;

/// The box in user units; the drawing library places on integers, hence a grid [`FINE`] times as fine.
const WIDTH: u32 = 440;
const HEIGHT: u32 = 270;
const FINE: u32 = 4;
/// Margins in user units: left, top, right, bottom.
const MARGINS: [u32; 4] = [58, 10, 12, 46];
/// Line height of text in user units; the drawing library makes the letters 1.24 times smaller.
const TEXT: u32 = 18;
/// Dashes of lines, in user units: lengths of a dash and of a gap.
const DASHES: [(u32, u32); 3] = [(10, 4), (5, 4), (2, 3)];
/// Dash of limits.
const LIMIT: (u32, u32) = (6, 4);
/// Dash of marks.
const MARK: (u32, u32) = (3, 2);
/// Above so many marks the notes count the rest.
const NOTED_MARKS: usize = 8;
/// Above so many frames single values are no longer marked.
const MARKED_FRAMES: usize = 40;
/// Above so many frames neighbours are drawn as one point, their mean: more would be a solid band.
const DRAWN_FRAMES: u64 = 200;

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A line.
    Line,
    /// A dashed line; its number chooses the dash.
    Dashed(usize),
    /// A thicker line, of a total.
    Total,
    /// A dashed line, of a limit.
    Limit,
    /// Bars that stand on those of the stacked series before.
    Stacked,
}

impl Shape {
    /// Lengths of its dashes and of the gaps between them; `None`: it has none.
    pub fn dash(self) -> Option<(u32, u32)> {
        match self {
            Self::Dashed(number) => Some(DASHES[number % DASHES.len()]),
            Self::Limit => Some(LIMIT),
            Self::Line | Self::Total | Self::Stacked => None,
        }
    }
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
    /// What the name says; both axes are logarithmic.
    Log(&'static str),
}

impl Across {
    /// What stands at the axis.
    fn name(self) -> &'static str {
        match self {
            Self::Frames => "frame",
            Self::Shares => "cache, % of all bricks",
            Self::Named(name) | Self::Log(name) => name,
        }
    }
}

impl Unit {
    /// The unit of the axis of a plot up to `max`, and its size in the recorded unit.
    fn scale(self, max: f64) -> (&'static str, f64) {
        match self {
            Self::Milliseconds => ("ms", 1.0),
            Self::MegaRays => ("Mrays/s", 1.0),
            Self::Bytes => format::byte_unit(max),
            Self::Percent => ("%", 1.0),
            Self::Count if max >= 1e9 => ("billions", 1e9),
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
    /// Where something changed, and to what: dashed upright lines.
    pub marks: Vec<(f64, String)>,
}

/// A drawn plot.
#[derive(Debug)]
pub struct Drawing {
    /// The contents of an `svg` element with the viewBox [`Drawing::view_box`].
    pub svg: String,
    /// The unit of the vertical axis; empty for plain counts.
    pub unit: &'static str,
    /// Sentences on values beyond the vertical axis, on frames drawn as one and on marks; empty where there are none.
    pub notes: String,
    /// The plot's data as JSON that HTML may hold: axes, series and values as they are shown.
    pub data: String,
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
        if group == 1 || self.across != Across::Frames {
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
        let (unit, size) = if self.is_log() { (self.unit.scale(1.0).0, 1.0) } else { self.unit.scale(max) };
        let axes = chart.axes(&extent, max / size, group as f64);
        let mut text = String::new();
        let failed = |reason| ReportError::Draw { plot: self.title.clone(), reason };
        chart.draw_into(&mut text, &extent, &axes, size, group as f64).map_err(failed)?;
        let mut notes = Vec::new();
        if cut && extent.first > axes[1].high * size {
            notes.push(format!("Frame {:.0} is beyond the axis with {}.", extent.from, self.unit.show(extent.first)));
        }
        if group > 1 {
            notes.push(format!("Each point is the mean of {group} frames."));
        }
        if let Some((_, last)) = self.marks.last() {
            let marks = &self.marks;
            let mut named: Vec<String> =
                marks.iter().take(NOTED_MARKS).map(|(frame, what)| format!("{what} from frame {frame:.0}")).collect();
            if let more @ 1.. = marks.len().saturating_sub(NOTED_MARKS) {
                named.push(format!("{more} more, {last} at last"));
            }
            notes.push(format!("Dashed upright: auto changed the schedule: {}.", named.join(", ")));
        }
        let data = chart.data(&axes[0]);
        Ok(Drawing { svg: inner(&text).to_string(), unit, notes: notes.join(" "), data })
    }

    /// Whether both axes are logarithmic.
    fn is_log(&self) -> bool {
        matches!(self.across, Across::Log(_))
    }

    /// The horizontal axis, and the vertical one up to `max` of its units.
    fn axes(&self, extent: &Extent, max: f64, group: f64) -> [Axis; 2] {
        let &Extent { from, to, .. } = extent;
        if self.is_log() {
            let all = || self.series.iter().flat_map(|s| &s.points).filter(|p| p.0 > 0.0 && p.1 > 0.0);
            let least = |of: fn(&(f64, f64)) -> f64| all().map(of).fold(f64::INFINITY, f64::min);
            let most = |of: fn(&(f64, f64)) -> f64| all().map(of).fold(0.0, f64::max);
            return [(least(|p| p.0), most(|p| p.0)), (least(|p| p.1), most(|p| p.1))].map(|(least, most)| {
                let ticks = log_ticks(least, most);
                Axis { low: ticks[0], high: ticks[ticks.len() - 1], ticks, is_log: true }
            });
        }
        let has_bars = self.series.iter().any(|s| s.shape == Shape::Stacked);
        // A still needs a range, and the outer bars stand half outside of the range of frames.
        let margin = if has_bars || from == to { 0.6 * group } else { (to - from) * 0.01 };
        let ticks = ticks(max, 4);
        let frames = frame_ticks(from, to);
        [
            Axis { low: from - margin, high: to + margin, ticks: frames, is_log: false },
            Axis { low: 0.0, high: ticks.last().copied().unwrap_or(1.0), ticks, is_log: false },
        ]
    }

    /// What a reader's pointer is told.
    fn data(&self, across: &Axis) -> String {
        let [left, top, right, bottom] = MARGINS;
        let point = |&(x, value): &(f64, f64)| json!([x, self.unit.show(value)]);
        let series = |s: &Series| {
            let points: Vec<_> = s.points.iter().map(point).collect();
            json!({ "name": s.name, "ink": s.ink.light_hex(), "points": points })
        };
        // A limit is the same everywhere.
        let drawn = self.series.iter().filter(|s| s.shape != Shape::Limit || self.is_log());
        let data = json!({
            "across": self.across.name(),
            "from": across.low,
            "to": across.high,
            "log": across.is_log,
            "box": [left * FINE, top * FINE, (WIDTH - right) * FINE, (HEIGHT - bottom) * FINE],
            "series": drawn.map(series).collect::<Vec<_>>(),
            "marks": self.marks,
        });
        // A script ends at its end tag, whatever is around it.
        data.to_string().replace('<', "\\u003c")
    }

    /// Draws on `axes`, the vertical one in units of `size`, where a point stands for `group` frames.
    fn draw_into(
        &self,
        text: &mut String,
        extent: &Extent,
        axes: &[Axis; 2],
        size: f64,
        group: f64,
    ) -> Result<(), String> {
        let [x_axis, y_axis] = axes.clone();
        let (low, top) = (y_axis.low, y_axis.high);
        let is_shown = |point: &&(f64, f64)| !self.is_log() || (point.0 > 0.0 && point.1 > 0.0);
        let clip = |value: f64| (value / size).clamp(low, top);
        let marked = extent.frames <= MARKED_FRAMES;
        let half_bar = if marked { 0.36 } else { 0.5 * group };
        let [left, above, right, below] = MARGINS.map(|margin| margin * FINE);
        let root = SVGBackend::with_string(text, (WIDTH * FINE, HEIGHT * FINE)).into_drawing_area();
        let mut chart = ChartBuilder::on(&root)
            .margin_top(above)
            .margin_right(right)
            .set_label_area_size(LabelAreaPosition::Left, left)
            .set_label_area_size(LabelAreaPosition::Bottom, below)
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
            .x_desc(self.across.name())
            .set_all_tick_mark_size(4 * FINE)
            .x_label_formatter(&|x| if self.is_log() { tick_label(*x) } else { format::count(*x) })
            .y_label_formatter(&|value| tick_label(*value))
            .draw()
            .map_err(|e| e.to_string())?;
        for &(at, _) in &self.marks {
            let (dash, gap) = MARK;
            let style = LABEL.rgb().stroke_width(FINE * 3 / 2);
            let line = DashedLineSeries::new([(at, low), (at, top)], dash * FINE, gap * FINE, style);
            chart.draw_series(line).map_err(|e| e.to_string())?;
        }
        for (ink, bars) in self.bars() {
            let rectangle = |(frame, low, high): Bar| {
                Rectangle::new([(frame - half_bar, clip(low)), (frame + half_bar, clip(high))], ink.rgb().filled())
            };
            let seen = bars.into_iter().filter(|&(_, low, high)| high > low && clip(low) < top);
            chart.draw_series(seen.map(rectangle)).map_err(|e| e.to_string())?;
        }
        for series in self.series.iter().filter(|s| s.shape != Shape::Stacked) {
            let points = series.points.iter().filter(is_shown);
            let points: Vec<(f64, f64)> = points.map(|&(frame, value)| (frame, clip(value))).collect();
            let width = FINE * if series.shape == Shape::Total { 5 } else { 4 } / 2;
            let style = series.ink.rgb().stroke_width(width);
            if marked && series.shape != Shape::Limit {
                let radius = FINE * if extent.frames == 1 && !self.is_log() { 5 } else { 2 };
                let dots = points.iter().map(|&point| Circle::new(point, radius, series.ink.rgb().filled()));
                chart.draw_series(dots).map_err(|e| e.to_string())?;
            }
            match series.shape.dash() {
                Some((dash, gap)) => {
                    let line = DashedLineSeries::new(points, dash * FINE, gap * FINE, style);
                    chart.draw_series(line).map_err(|e| e.to_string())?;
                }
                None => {
                    chart.draw_series(LineSeries::new(points, style)).map_err(|e| e.to_string())?;
                }
            }
        }
        root.present().map_err(|e| e.to_string())
    }
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

/// What is inside of the drawing library's `svg` element: the page has its own, which scales.
fn inner(svg: &str) -> &str {
    let start = svg.find('>').map_or(0, |at| at + 1);
    let end = svg.rfind("</svg>").unwrap_or(svg.len());
    svg.get(start..end).unwrap_or_default().trim()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ink::BLUE;

    fn chart(points: Vec<(f64, f64)>, shape: Shape) -> Chart {
        let series = vec![Series { name: "one".into(), points, shape, ink: BLUE }];
        Chart { title: "a title".into(), unit: Unit::Milliseconds, across: Across::Frames, series, marks: Vec::new() }
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
    fn marks_are_drawn_and_named() {
        let mut chart = chart((0..6).map(|k| (f64::from(k), 1.0)).collect(), Shape::Line);
        let without = chart.draw().unwrap().svg;
        chart.marks = vec![(1.0, "demand".into()), (2.0, "chc".into())];
        let drawing = chart.draw().unwrap();
        assert!(drawing.svg.len() > without.len());
        assert!(drawing.notes.ends_with("auto changed the schedule: demand from frame 1, chc from frame 2."));
        chart.marks = (1..=11).map(|k| (f64::from(k), format!("s{k}"))).collect();
        assert!(chart.draw().unwrap().notes.ends_with("s8 from frame 8, 3 more, s11 at last."));
    }

    #[test]
    fn logarithmic_plots_leave_out_what_has_no_logarithm() {
        let points = vec![(0.0, 3.0), (1.0, 1.0), (4.0, 0.5), (16.0, 0.0), (64.0, 0.125)];
        let mut chart = chart(points, Shape::Line);
        chart.across = Across::Log("samples");
        let drawing = chart.draw().unwrap();
        assert_eq!(drawing.svg.matches("<circle").count(), 3);
        let data: serde_json::Value = serde_json::from_str(&drawing.data).unwrap();
        assert_eq!(
            (data["from"].as_f64(), data["to"].as_f64(), data["log"].as_bool()),
            (Some(1.0), Some(100.0), Some(true))
        );
        // A slope of -1/2 is a straight line: equal ratios are equal lengths.
        let heights: Vec<f64> =
            drawing.svg.split("cy=\"").skip(1).map(|t| t.split('"').next().unwrap().parse().unwrap()).collect();
        assert!(((heights[1] - heights[0]) * 2.0 - (heights[2] - heights[1])).abs() < 4.0, "{heights:?}");
    }

    #[test]
    fn data_is_what_the_plot_shows() {
        let mut chart = chart(vec![(0.0, 1.0), (1.0, 2.0)], Shape::Line);
        chart.series[0].name = "</script>".into();
        let data = chart.draw().unwrap().data;
        assert!(!data.contains('<'));
        let data: serde_json::Value = serde_json::from_str(&data).unwrap();
        assert_eq!(data["series"][0]["name"], "</script>");
        assert_eq!(data["series"][0]["points"], json!([[0.0, "1.00 ms"], [1.0, "2.00 ms"]]));
    }

    #[test]
    fn bars_stand_on_each_other() {
        let mut chart = chart(vec![(0.0, 1.0), (1.0, 2.0)], Shape::Stacked);
        chart.series.push(Series { points: vec![(1.0, 5.0)], ..chart.series[0].clone() });
        assert_eq!(chart.bars()[1].1, [(1.0, 2.0, 7.0)]);
        assert_eq!(chart.extent().rest, 7.0);
    }
}
