//! What has been measured, a line each, and the line of settings before them: it grows while a bench runs and is where
//! a later start goes on. `cells.jsonl` has a line a walk.

use super::plan::{Case, Effect};
use crate::output::atomic::JsonLines;
use anyhow::{Context, Result, bail, ensure};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Raised when a field changes its meaning.
pub const FORMAT: u32 = 2;

/// Values of the frames of a walk by field of the records, and these by pass.
pub type Passes = BTreeMap<String, BTreeMap<String, Vec<f64>>>;

/// The first line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// [`FORMAT`].
    pub format: u32,
    /// Everything that decides what is measured.
    pub settings: Value,
    /// Name, driver and backend of the adapter.
    pub adapter: Value,
    /// Commit of the program.
    pub commit: String,
}

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

/// Difference of pictures, of 255 levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PictureError {
    /// Mean absolute difference.
    pub mean: f64,
    /// That of the worst tile of any frame.
    pub worst_tile: f64,
}

/// A file of measurements.
pub struct Journal<T> {
    header: Header,
    entries: Vec<T>,
    lines: JsonLines,
    file: PathBuf,
}

impl<T: Serialize + DeserializeOwned> Journal<T> {
    /// Opens the measurements of `file`, or begins them.
    ///
    /// # Errors
    /// The file is none of measurements, or of others than `header` says; it cannot be read or written.
    pub fn open(file: PathBuf, header: Header, must_exist: bool) -> Result<Self> {
        let name = file.display();
        let text = match std::fs::read_to_string(&file) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound && !must_exist => String::new(),
            Err(error) => {
                return Err(error).with_context(|| format!("{name}: cannot read the measurements to go on with"));
            }
        };
        // A line without an end was being written when the process was killed.
        let whole = &text[..text.rfind('\n').map_or(0, |end| end + 1)];
        let mut lines = whole.lines();
        let Some(first) = lines.next() else {
            let mut lines = JsonLines::create(&file)?;
            lines.push(&header)?;
            return Ok(Self { header, entries: Vec::new(), lines, file });
        };
        let found: Header =
            serde_json::from_str(first).ok().filter(|found: &Header| found.format == header.format).with_context(
                || format!("{name}: line 1 holds no settings of this version; choose another folder with -o"),
            )?;
        if found != header {
            bail!(
                "{name}: measured with {}; choose another folder with -o, or the same settings",
                difference(&found, &header)
            );
        }
        let mut entries = Vec::new();
        for (number, line) in lines.enumerate() {
            let entry = serde_json::from_str(line)
                .with_context(|| format!("{name}: line {}: no measurement; remove the line", number + 2))?;
            entries.push(entry);
        }
        let lines = JsonLines::append(&file, whole.len() as u64)?;
        Ok(Self { header, entries, lines, file })
    }

    /// The settings.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// All of them.
    pub fn all(&self) -> &[T] {
        &self.entries
    }

    /// Appends one.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn push(&mut self, entry: T) -> Result<()> {
        self.lines.push(&entry)?;
        self.entries.push(entry);
        Ok(())
    }
}

/// Finished walks.
pub struct Cells {
    journal: Journal<Cell>,
    /// The number of this start.
    run: u32,
}

impl Cells {
    /// Opens the measurements of `folder`, or begins them.
    ///
    /// # Errors
    /// As those of [`Journal::open`].
    pub fn open(folder: &Path, header: Header, must_exist: bool) -> Result<Self> {
        let journal = Journal::open(folder.join("cells.jsonl"), header, must_exist)?;
        let run = journal.all().iter().map(|cell: &Cell| cell.run + 1).max().unwrap_or(0);
        Ok(Self { journal, run })
    }

    /// The settings.
    pub fn header(&self) -> &Header {
        self.journal.header()
    }

    /// All of them.
    pub fn all(&self) -> &[Cell] {
        self.journal.all()
    }

    /// Number of starts of the bench in which something was measured.
    pub fn runs(&self) -> usize {
        let runs: std::collections::BTreeSet<u32> = self.all().iter().map(|cell| cell.run).collect();
        runs.len()
    }

    /// Whether a walk is finished.
    pub fn has(&self, case: &Case, repetition: u32) -> bool {
        let name = case.to_string();
        self.all().iter().any(|cell| cell.case == name && cell.repetition == repetition)
    }

    /// Appends a finished walk.
    ///
    /// # Errors
    /// The file cannot be written; a value is not finite.
    pub fn push(&mut self, case: &Case, repetition: u32, passes: Passes, error: Option<PictureError>) -> Result<()> {
        let mut values = passes.values().flat_map(BTreeMap::values).flatten();
        ensure!(
            values.all(|value| value.is_finite()),
            "{}: {case} has a value that is no number",
            self.journal.file.display()
        );
        let cell = Cell { case: case.to_string(), repetition, run: self.run, passes, error };
        self.journal.push(cell)
    }
}

/// The settings in which two headers differ, with their values in the first.
fn difference(found: &Header, wanted: &Header) -> String {
    let mut parts = Vec::new();
    let (before, now) = (&found.settings, &wanted.settings);
    for (name, value) in before.as_object().into_iter().flatten() {
        if now.get(name) != Some(value) {
            parts.push(format!("{name} {value} rather than {}", now.get(name).unwrap_or(&Value::Null)));
        }
    }
    if found.adapter != wanted.adapter {
        parts.push(format!("adapter {}", found.adapter["name"]));
    }
    if found.commit != wanted.commit {
        parts.push(format!("commit {}", found.commit));
    }
    if parts.is_empty() { "other settings".into() } else { parts.join(", ") }
}

/// A quantity of a pass.
#[derive(Clone, Copy, Debug)]
pub enum Metric {
    /// Wall time of a frame, ms.
    Wall,
    /// Device time of the three phases of a frame, ms; unknown on a device without timestamps.
    Device,
    /// A field of the records.
    Field(&'static str),
}

impl Metric {
    fn of(self, fields: &BTreeMap<String, Vec<f64>>) -> Option<Vec<f64>> {
        match self {
            Self::Wall => fields.get("ms").cloned(),
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

/// Numbers from cells: each is recomputed from what the frames' records said.
pub struct Measured<'a> {
    cells: &'a [Cell],
    /// Frames at the start of a walk that are left out of times.
    skip: usize,
}

impl<'a> Measured<'a> {
    /// Over `cells`, times without the first `skip` frames of a walk.
    pub fn new(cells: &'a [Cell], skip: usize) -> Self {
        Self { cells, skip }
    }

    fn walks(&self, case: &Case) -> impl Iterator<Item = &'a Cell> {
        let name = case.to_string();
        self.cells.iter().filter(move |cell| cell.case == name)
    }

    /// Mean over the frames of each walk, median over its repetitions.
    pub fn median(&self, case: &Case, pass: Effect, metric: Metric) -> Option<f64> {
        let walk = |cell: &Cell| {
            let values = metric.of(cell.passes.get(pass.name())?)?;
            let late = values.get(self.skip.min(values.len().saturating_sub(1))..)?;
            (!late.is_empty()).then(|| late.iter().sum::<f64>() / late.len() as f64)
        };
        median(self.walks(case).filter_map(walk).collect())
    }

    /// `of` ÷ `over` by the medians, when both are above zero.
    pub fn ratio(&self, of: &Case, over: &Case, pass: Effect, metric: Metric) -> Option<f64> {
        let (of, over) = (self.median(of, pass, metric)?, self.median(over, pass, metric)?);
        (of > 0.0 && over > 0.0).then(|| of / over)
    }

    /// The median over the repetitions, frame by frame, of all frames.
    pub fn frames(&self, case: &Case, pass: Effect, metric: Metric) -> Vec<(f64, f64)> {
        let walks: Vec<Vec<f64>> =
            self.walks(case).filter_map(|cell| metric.of(cell.passes.get(pass.name())?)).collect();
        let frames = walks.iter().map(Vec::len).min().unwrap_or(0);
        let at = |frame: usize| median(walks.iter().map(|walk| walk[frame]).collect());
        (0..frames).filter_map(|frame| Some((frame as f64, at(frame)?))).collect()
    }

    /// Sums of a field over the first frame and over the others, of the first walk.
    pub fn first_and_rest(&self, case: &Case, pass: Effect, field: &str) -> Option<(f64, f64)> {
        let cell = self.walks(case).next()?;
        let (first, rest) = cell.passes.get(pass.name())?.get(field)?.split_first()?;
        Some((*first, rest.iter().sum()))
    }

    /// The errors of the pictures of a case.
    pub fn error(&self, case: &Case) -> Option<PictureError> {
        self.walks(case).find_map(|cell| cell.error)
    }
}

/// The median; the mean of the middle two of an even number.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some(0.5 * (values[last / 2] + values[last.div_ceil(2)]))
}
