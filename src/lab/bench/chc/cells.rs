//! `cells.jsonl`: a line a walk. What tables and plots have of it is recomputed from what the frames' records said.

use super::plan::{Case, key};
use crate::lab::bench::results::ratio;
use crate::lab::bench::store::{Entry, median};
use crate::settings::Effect;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Values of the frames of a walk by field of the records, and these by pass.
pub type Passes = BTreeMap<String, BTreeMap<String, Vec<f64>>>;

/// A finished walk, or the errors of a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// The case, as [`Case`] is written.
    pub case: String,
    /// Which walk of the case, from 0.
    pub repetition: u32,
    /// Which start of the bench, from 0.
    pub run: u32,
    /// What the records said.
    pub passes: Passes,
    /// Difference of the pictures from those of threshold 0, where it was asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<PictureError>,
}

impl Entry for Cell {
    fn key(&self) -> String {
        key(&self.case, self.repetition)
    }
}

/// Difference of pictures, of 255 levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PictureError {
    /// Mean absolute difference.
    pub mean: f64,
    /// That of the worst tile of any frame.
    pub worst_tile: f64,
}

/// Numbers from cells.
pub struct Measured<'a> {
    /// The cases that are looked at.
    pub cases: Vec<Case>,
    /// What was measured.
    pub cells: &'a [Cell],
    /// Frames at the start of a walk that are left out of times.
    pub skip: usize,
}

/// A pass of a case.
#[derive(Clone, Copy)]
pub struct Pass<'a> {
    measured: &'a Measured<'a>,
    /// The case.
    pub case: &'a Case,
    /// The pass.
    pub effect: Effect,
}

/// A quantity of a pass.
#[derive(Clone, Copy, Debug)]
pub enum Metric {
    /// Device time of the three phases of a frame, ms; unknown on a device without timestamps.
    Device,
    /// A field of the records.
    Field(&'static str),
}

/// Wall time of a frame, ms.
pub const WALL: Metric = Metric::Field("ms");

impl Metric {
    fn of(self, fields: &BTreeMap<String, Vec<f64>>) -> Option<Vec<f64>> {
        match self {
            Self::Field(name) => fields.get(name).cloned(),
            Self::Device => {
                let phases = ["ms_phase1", "ms_phase2", "ms_phase3"].map(|name| fields.get(name));
                let [Some(a), Some(b), Some(c)] = phases else { return None };
                let sums: Vec<f64> = a.iter().zip(b).zip(c).map(|((a, b), c)| a + b + c).collect();
                (sums.iter().sum::<f64>() > 0.0).then_some(sums)
            }
        }
    }
}

impl Measured<'_> {
    /// A pass of a case.
    pub fn pass<'a>(&'a self, case: &'a Case, effect: Effect) -> Pass<'a> {
        Pass { measured: self, case, effect }
    }

    /// Those of all cases that have been measured.
    pub fn passes(&self) -> impl Iterator<Item = Pass<'_>> {
        let all = self.cases.iter().flat_map(|case| case.effects.iter().map(|&effect| self.pass(case, effect)));
        all.filter(|pass| pass.median(WALL).is_some())
    }
}

impl<'a> Pass<'a> {
    fn walks(&self) -> impl Iterator<Item = &'a Cell> {
        let name = self.case.to_string();
        self.measured.cells.iter().filter(move |cell| cell.case == name)
    }

    /// What each walk has of a quantity, frame by frame.
    fn frames(&self, metric: Metric) -> Vec<Vec<f64>> {
        self.walks().filter_map(|cell| metric.of(cell.passes.get(self.effect.name())?)).collect()
    }

    /// Mean over the frames of each walk, median over its repetitions.
    pub fn median(&self, metric: Metric) -> Option<f64> {
        let mean = |values: Vec<f64>| {
            let late = values.get(self.measured.skip.min(values.len().saturating_sub(1))..)?;
            (!late.is_empty()).then(|| late.iter().sum::<f64>() / late.len() as f64)
        };
        median(self.frames(metric).into_iter().filter_map(mean).collect())
    }

    /// This ÷ the same of another case by the medians, when both are above zero.
    pub fn over(&self, other: &Case, metric: Metric) -> Option<f64> {
        ratio(self.median(metric), self.measured.pass(other, self.effect).median(metric))
    }

    /// The same of another case ÷ this.
    pub fn under(&self, other: &Case, metric: Metric) -> Option<f64> {
        self.measured.pass(other, self.effect).over(self.case, metric)
    }

    /// The median over the repetitions, frame by frame, of all frames.
    pub fn by_frame(&self, metric: Metric) -> Vec<(f64, f64)> {
        let walks = self.frames(metric);
        let frames = walks.iter().map(Vec::len).min().unwrap_or(0);
        let at = |frame: usize| median(walks.iter().map(|walk| walk[frame]).collect());
        (0..frames).filter_map(|frame| Some((frame as f64, at(frame)?))).collect()
    }

    /// Sums of a field over the first frame and over the others, of the first walk.
    pub fn first_and_rest(&self, field: &'static str) -> [f64; 2] {
        let frames = self.frames(Metric::Field(field));
        let split = frames.first().and_then(|walk| walk.split_first());
        split.map_or([0.0; 2], |(first, rest)| [*first, rest.iter().sum()])
    }

    /// The errors of the pictures of the case.
    pub fn error(&self) -> Option<PictureError> {
        self.walks().find_map(|cell| cell.error)
    }
}
