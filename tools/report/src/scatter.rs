//! A plot of points, each with words of its own, on logarithmic axes: settings by time and error. Those on the front,
//! which no other beats in both, are joined by a line; others are faint.

use crate::axis::{log_ticks, tick_label};
use crate::ink::{AXIS, GREY, GRID, INKS, Ink, LABEL_HEX};
use maud::{Markup, html};

/// The box in user units.
const WIDTH: f64 = 440.0;
const HEIGHT: f64 = 300.0;
/// Margins in user units: left, top, right, bottom.
const MARGINS: [f64; 4] = [52.0, 10.0, 20.0, 40.0];

/// A point.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// Along the horizontal axis, above 0.
    pub x: f64,
    /// Along the vertical axis; 0 stands at its lower end.
    pub y: f64,
    /// What it is one of: a name of the legend.
    pub kind: String,
    /// What is shown where the pointer is, a line each.
    pub words: Vec<String>,
    /// Whether no other point is farther left and lower.
    pub is_best: bool,
}

/// A plot of points.
#[derive(Clone, Debug, PartialEq)]
pub struct Scatter {
    /// What runs along the axes.
    pub axes: [&'static str; 2],
    /// Kinds in the order of their looks, whether there are points of them or not: a page's plots look alike. Others
    /// follow.
    pub kinds: &'static [&'static str],
    /// The points.
    pub points: Vec<Point>,
}

/// How points of a kind look.
#[derive(Clone, Copy)]
struct Mark {
    ink: Ink,
    is_square: bool,
}

impl Default for Mark {
    fn default() -> Self {
        Self { ink: GREY, is_square: false }
    }
}

impl Mark {
    /// At a place, so large; with the words of `point`, which is faint unless it is of the best.
    fn drawn(self, (x, y): (f64, f64), radius: f64, point: Option<&Point>) -> Markup {
        let fill = self.ink.light_hex();
        let words = point.map(|point| point.words.join("\n"));
        let opacity = point.map(|point| if point.is_best { "1" } else { "0.3" });
        let index = point.map(|_| "0");
        let at = |offset: f64| (format!("{:.1}", x + offset), format!("{:.1}", y + offset));
        html! {
            @if self.is_square {
                @let (left, top) = at(-0.9 * radius);
                rect x=(left) y=(top) width=(1.8 * radius) height=(1.8 * radius) fill=(fill) opacity=[opacity]
                    data-words=[&words] tabindex=[index] { @if let Some(words) = &words { title { (words) } } }
            } @else {
                @let (x, y) = at(0.0);
                circle cx=(x) cy=(y) r=(radius) fill=(fill) opacity=[opacity]
                    data-words=[&words] tabindex=[index] { @if let Some(words) = &words { title { (words) } } }
            }
        }
    }
}

/// A logarithmic axis.
struct Scale {
    ticks: Vec<f64>,
    from: f64,
    to: f64,
}

impl Scale {
    /// Of these values, of which those above 0 count, drawn between two places.
    fn of(values: impl Iterator<Item = f64> + Clone, [from, to]: [f64; 2]) -> Self {
        let shown = values.filter(|value| *value > 0.0 && value.is_finite());
        let (least, most) = shown.fold((f64::INFINITY, 0.0), |(a, b): (f64, f64), x| (a.min(x), b.max(x)));
        let ticks = if most > 0.0 { log_ticks(least, most) } else { vec![1.0, 10.0] };
        Self { ticks, from, to }
    }

    fn place(&self, value: f64) -> f64 {
        let [low, high] = [self.ticks[0], self.ticks[self.ticks.len() - 1]];
        let share = (value.max(low) / low).ln() / (high / low).ln();
        self.from + (self.to - self.from) * share.clamp(0.0, 1.0)
    }
}

impl Scatter {
    /// Kinds that there are points of, in their order, each with its colour; those of the second round of colours are
    /// squares.
    fn kinds(&self) -> Vec<(&str, Mark)> {
        let mut kinds: Vec<&str> = self.kinds.to_vec();
        for point in &self.points {
            if !kinds.contains(&&*point.kind) {
                kinds.push(&point.kind);
            }
        }
        let mark = |k: usize| Mark { ink: INKS[k % INKS.len()], is_square: k / INKS.len() % 2 == 1 };
        let has = |kind: &str| self.points.iter().any(|point| point.kind == kind);
        let marked = kinds.into_iter().enumerate().map(|(k, kind)| (kind, mark(k)));
        marked.filter(|(kind, _)| has(kind)).collect()
    }

    /// As a figure; `None` without points.
    pub fn figure(&self, title: &str, reading: &str) -> Option<Markup> {
        if self.points.is_empty() {
            return None;
        }
        let [left, top, right, bottom] = MARGINS;
        let across = Scale::of(self.points.iter().map(|point| point.x), [left, WIDTH - right]);
        let upward = Scale::of(self.points.iter().map(|point| point.y), [HEIGHT - bottom, top]);
        let kinds = self.kinds();
        let mark = |kind: &str| kinds.iter().find(|(own, _)| *own == kind).map_or(Mark::default(), |(_, mark)| *mark);
        let place = |point: &Point| (across.place(point.x), upward.place(point.y));
        let mut front: Vec<&Point> = self.points.iter().filter(|point| point.is_best).collect();
        front.sort_by(|a, b| a.x.total_cmp(&b.x));
        let line = front.iter().map(|point| {
            let (x, y) = place(point);
            format!("{x:.1},{y:.1} ")
        });
        let line: String = line.collect();
        let (grid, axis, label) = (GRID.light_hex(), AXIS.light_hex(), LABEL_HEX);
        Some(html! {
            figure.plot {
                figcaption {
                    h3 { (title) }
                    ul.legend { @for (kind, mark) in &kinds { li {
                        svg.key viewBox="0 0 16 10" aria-hidden="true" { (mark.drawn((8.0, 5.0), 4.0, None)) }
                        (kind)
                    } } }
                }
                svg.scatter viewBox={ "0 0 " (WIDTH) " " (HEIGHT) } role="img" aria-label=(title) {
                    @for &tick in &upward.ticks {
                        @let y = upward.place(tick);
                        line x1=(left) x2=(WIDTH - right) y1=(y) y2=(y) stroke=(grid) {}
                        text x=(left - 6.0) y=(y + 4.0) font-size="12" text-anchor="end" fill=(label) {
                            (tick_label(tick))
                        }
                    }
                    @for &tick in &across.ticks {
                        @let x = across.place(tick);
                        line x1=(x) x2=(x) y1=(HEIGHT - bottom) y2=(HEIGHT - bottom + 4.0) stroke=(axis) {}
                        text x=(x) y=(HEIGHT - bottom + 17.0) font-size="12" text-anchor="middle" fill=(label) {
                            (tick_label(tick))
                        }
                    }
                    line x1=(left) x2=(WIDTH - right) y1=(HEIGHT - bottom) y2=(HEIGHT - bottom) stroke=(axis) {}
                    text x=(WIDTH - right) y=(HEIGHT - 6.0) font-size="12" text-anchor="end" fill=(label) {
                        (self.axes[0])
                    }
                    text x=(left) y=(HEIGHT - 6.0) font-size="12" fill=(label) { "up: " (self.axes[1]) }
                    polyline points=(line.trim_end()) fill="none" stroke=(axis) stroke-width="1.5" {}
                    // Those that count are drawn last.
                    @for is_best in [false, true] {
                        @for point in self.points.iter().filter(|point| point.is_best == is_best) {
                            @let (x, y) = place(point);
                            (mark(&point.kind).drawn((x, y), if is_best { 5.0 } else { 4.0 }, Some(point)))
                        }
                    }
                }
                div { p.reading { (reading) } }
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(x: f64, y: f64, kind: &str, is_best: bool) -> Point {
        Point { x, y, kind: kind.into(), words: vec![format!("{kind} <{x}>"), "a command".into()], is_best }
    }

    #[test]
    fn points_stand_where_their_values_are_and_say_what_they_are() {
        let points = vec![
            point(1.0, 1.0, "exact", true),
            point(10.0, 0.1, "exact", true),
            point(100.0, 0.01, "maps", true),
            point(100.0, 1.0, "maps", false),
            point(10.0, 0.0, "maps", false),
        ];
        let scatter = Scatter { axes: ["ms", "FLIP"], kinds: &[], points };
        let text = scatter.figure("a title", "how to read it").expect("a figure").into_string();
        assert_eq!(text.matches("<circle").count(), 5 + 2, "points and the legend");
        assert!(text.contains("maps &lt;100&gt;\na command") && !text.contains("maps <100>"));
        // Equal ratios are equal lengths: the front is straight.
        let line = text.split("polyline points=\"").nth(1).and_then(|rest| rest.split('"').next()).expect("the front");
        let places: Vec<f64> = line.split([',', ' ']).map(|text| text.parse().expect("a number")).collect();
        assert_eq!(places.len(), 6);
        assert!((places[2] - places[0] - (places[4] - places[2])).abs() < 0.3, "{places:?}");
        assert!((places[3] - places[1] - (places[5] - places[3])).abs() < 0.3 && places[5] > places[1], "{places:?}");
        // Kinds keep their looks where others are missing.
        let listed = Scatter { kinds: &["fields", "maps", "exact"], ..scatter.clone() };
        assert_eq!(listed.kinds().iter().map(|(kind, _)| *kind).collect::<Vec<_>>(), ["maps", "exact"]);
        assert!(listed.kinds()[0].1.ink == INKS[1] && scatter.kinds()[0].1.ink == INKS[0]);
        assert!(Scatter { points: vec![], ..scatter }.figure("", "").is_none());
    }
}
