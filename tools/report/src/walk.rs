//! The records and the summary of a walk, as read from its folder.

use crate::ReportError;
use serde_json::{Map, Value};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::Path;

/// The summary's format that this crate knows; a higher number means that a field has another meaning.
const SUMMARY_FORMAT: u64 = 2;

/// One frame of one pass.
#[derive(Debug)]
pub struct Row {
    /// Frame, from 0.
    pub frame: u64,
    /// The schedules that its rays were traced by; empty where it had none, or where they are not recorded.
    pub schedule: String,
    /// The methods that answered its rays; empty where none did, or where they are not recorded.
    pub methods: String,
    /// The numeric fields by name, `frame` left out. Integers are exact up to 2⁵³.
    values: HashMap<String, f64>,
}

impl Row {
    /// A field's value; `None` where the record lacks it.
    pub fn get(&self, field: &str) -> Option<f64> {
        self.values.get(field).copied()
    }

    /// Who traced and answered its rays.
    pub fn by(&self) -> String {
        match (&self.schedule[..], &self.methods[..]) {
            ("", "") => "none".into(),
            (one, "") | ("", one) => one.into(),
            (schedule, methods) => format!("{schedule}, {methods}"),
        }
    }

    /// The sum of those of `fields` that the record has; 0 of none.
    pub fn sum(&self, fields: &[&str]) -> f64 {
        fields.iter().filter_map(|f| self.get(f)).sum()
    }
}

/// All frames of one pass, by ascending frame. There is at least one.
#[derive(Debug)]
pub struct Pass {
    /// The pass's name as recorded.
    pub name: String,
    /// Its frames.
    pub rows: Vec<Row>,
}

impl Pass {
    /// The values of a field over the frames, as (frame, value); frames without the field are skipped.
    pub fn series(&self, field: &str) -> Vec<(f64, f64)> {
        self.rows.iter().filter_map(|row| Some((row.frame as f64, row.get(field)?))).collect()
    }

    /// Frames whose rays another schedule traced, or other methods answered, than the frame's before, with what did.
    pub fn switches(&self) -> Vec<(f64, String)> {
        let changes = self.rows.windows(2).filter(|pair| pair[0].by() != pair[1].by());
        changes.map(|pair| (pair[1].frame as f64, pair[1].by())).collect()
    }

    /// The frames by schedule and methods, in the order in which these were used first.
    pub fn by_schedule(&self) -> Vec<(String, Vec<&Row>)> {
        let mut groups: Vec<(String, Vec<&Row>)> = Vec::new();
        for row in &self.rows {
            match groups.iter_mut().find(|(name, _)| *name == row.by()) {
                Some((_, rows)) => rows.push(row),
                None => groups.push((row.by(), vec![row])),
            }
        }
        groups
    }

    /// Statistics of a field over the frames; `None` where no record has it.
    pub fn statistics(&self, field: &str) -> Option<Statistics> {
        Statistics::of(self.rows.iter().filter_map(|row| row.get(field)).collect())
    }

    /// Statistics of the sum of some fields over the frames; `None` where no record has any of them.
    pub fn statistics_of_sum(&self, fields: &[&str]) -> Option<Statistics> {
        let has_one = |row: &&Row| fields.iter().any(|f| row.get(f).is_some());
        Statistics::of(self.rows.iter().filter(has_one).map(|row| row.sum(fields)).collect())
    }

    /// Whether some record of the pass has a value other than zero in this field.
    pub fn has_nonzero(&self, field: &str) -> bool {
        self.rows.iter().any(|row| row.get(field).is_some_and(|v| v != 0.0))
    }
}

/// Statistics of one field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics {
    /// The sum.
    pub total: f64,
    /// The value of the first frame.
    pub first: f64,
    /// The median.
    pub median: f64,
    /// The 95th percentile, linear between neighbours.
    pub p95: f64,
}

impl Statistics {
    /// Statistics of values in the order of their frames; `None` of none.
    pub fn of(values: Vec<f64>) -> Option<Self> {
        let first = *values.first()?;
        let total = values.iter().sum();
        let mut sorted = values;
        sorted.sort_by(f64::total_cmp);
        Some(Self { total, first, median: quantile(&sorted, 0.5), p95: quantile(&sorted, 0.95) })
    }
}

/// The quantile `q` in 0..=1 of ascending values, linear between neighbours; 0 of none.
fn quantile(values: &[f64], q: f64) -> f64 {
    let Some(last) = values.len().checked_sub(1) else { return 0.0 };
    let at = q * last as f64;
    let (low, high) = (at.floor() as usize, at.ceil() as usize);
    values[low] + (values[high] - values[low]) * (at - low as f64)
}

/// A walk: its records by pass, and its summary.
#[derive(Debug)]
pub struct Walk {
    /// The passes in the order of their first records.
    pub passes: Vec<Pass>,
    /// Names of the numeric fields in the order in which the records have them, `frame` left out.
    pub fields: Vec<String>,
    /// The frames that have a record.
    pub frames: BTreeSet<u64>,
    /// `summary.json`.
    pub summary: Map<String, Value>,
}

impl Walk {
    /// Reads `records.jsonl` and `summary.json` of a folder.
    ///
    /// # Errors
    /// One of them is missing, unreadable or malformed.
    pub fn read(dir: &Path) -> Result<Self, ReportError> {
        let mut walk =
            Self { passes: Vec::new(), fields: Vec::new(), frames: BTreeSet::new(), summary: read_summary(dir)? };
        let path = dir.join("records.jsonl");
        let bytes = std::fs::read(&path).map_err(|source| ReportError::Read { path: path.clone(), source })?;
        for (index, line) in bytes.split(|&b| b == b'\n').enumerate() {
            if line.trim_ascii().is_empty() {
                continue;
            }
            let bad = |reason| ReportError::Record { path: path.clone(), line: index + 1, reason };
            let (pass, row) = walk.record(line).map_err(bad)?;
            walk.add(&pass, row);
        }
        for pass in &mut walk.passes {
            pass.rows.sort_by_key(|row| row.frame);
        }
        Ok(walk)
    }

    /// Parses one line into the name of its pass and its row, and notes fields that are new.
    fn record(&mut self, line: &[u8]) -> Result<(String, Row), String> {
        let value: Value = serde_json::from_slice(line).map_err(|e| without_position(&e))?;
        let Value::Object(object) = value else { return Err("a record must be a JSON object".into()) };
        let pass = match object.get("pass") {
            Some(Value::String(name)) => name.clone(),
            Some(_) => return Err("\"pass\" must be a string".into()),
            None => return Err("the record has no \"pass\"".into()),
        };
        let frame = match object.get("frame") {
            Some(value) => value.as_u64().ok_or("\"frame\" must be an integer from 0")?,
            None => return Err("the record has no \"frame\"".into()),
        };
        let (mut values, mut schedule, mut methods) = (HashMap::new(), String::new(), String::new());
        for (key, value) in object {
            if key == "frame" || key == "pass" {
                continue;
            }
            match value {
                Value::String(text) if key == "schedule" => schedule = text,
                Value::String(text) if key == "methods" => methods = text,
                // An optional field may be spelled out as absent.
                Value::Null => {}
                Value::Number(number) => {
                    let number = number.as_f64().filter(|n| n.is_finite() && *n >= 0.0);
                    let number = number.ok_or_else(|| format!("\"{key}\" must be a finite number from 0"))?;
                    if !self.fields.contains(&key) {
                        self.fields.push(key.clone());
                    }
                    values.insert(key, number);
                }
                _ => return Err(format!("\"{key}\" must be a number")),
            }
        }
        Ok((pass, Row { frame, schedule, methods, values }))
    }

    fn add(&mut self, pass: &str, row: Row) {
        self.frames.insert(row.frame);
        match self.passes.iter_mut().find(|p| p.name == pass) {
            Some(pass) => pass.rows.push(row),
            None => self.passes.push(Pass { name: pass.to_string(), rows: vec![row] }),
        }
    }

    /// A value of the summary by its path, such as `scene/file`; `None` where it is missing or null.
    pub fn summary(&self, path: &str) -> Option<&Value> {
        let mut parts = path.split('/');
        let first = self.summary.get(parts.next()?)?;
        parts.try_fold(first, |value, part| value.get(part)).filter(|value| !value.is_null())
    }

    /// A number of the summary.
    pub fn number(&self, path: &str) -> Option<f64> {
        self.summary(path)?.as_f64()
    }

    /// Whether what a field counts was off: `only` says with which option it is not zero.
    pub fn is_off(&self, only: &str) -> bool {
        let Some(options) = self.summary("options") else { return false };
        let Some(flag) = only.split("--").nth(1) else { return false };
        let key: String = flag.chars().take_while(|c| c.is_alphanumeric() || *c == '-').collect();
        match options.get(key.replace('-', "_")) {
            None | Some(Value::Null | Value::Bool(false)) => true,
            Some(Value::String(text)) => ["off", "none", "exact"].contains(&text.as_str()),
            Some(_) => false,
        }
    }

    /// A text of the summary; numbers and truth values are spelled as JSON spells them.
    pub fn text(&self, path: &str) -> Option<String> {
        match self.summary(path)? {
            Value::String(text) => Some(text.clone()),
            Value::Object(_) | Value::Array(_) => None,
            value => Some(value.to_string()),
        }
    }

    /// The sum of a field over all records.
    pub fn total(&self, field: &str) -> f64 {
        self.passes.iter().flat_map(|pass| &pass.rows).filter_map(|row| row.get(field)).sum()
    }

    /// The sum of some fields over the passes, by ascending frame, as (frame, value); frames without any are skipped.
    pub fn per_frame(&self, fields: &[&str]) -> Vec<(u64, f64)> {
        let mut sums = BTreeMap::<u64, f64>::new();
        for row in self.passes.iter().flat_map(|pass| &pass.rows) {
            if fields.iter().any(|field| row.get(field).is_some()) {
                *sums.entry(row.frame).or_default() += row.sum(fields);
            }
        }
        sums.into_iter().collect()
    }
}

fn read_summary(dir: &Path) -> Result<Map<String, Value>, ReportError> {
    let path = dir.join("summary.json");
    let bytes = std::fs::read(&path).map_err(|source| ReportError::Read { path: path.clone(), source })?;
    let bad = |line, reason: String| ReportError::Summary { path: path.clone(), line, reason };
    let value: Value = serde_json::from_slice(&bytes).map_err(|e| bad(e.line(), without_position(&e)))?;
    let Value::Object(summary) = value else { return Err(bad(1, "a summary must be a JSON object".into())) };
    match summary.get("format").map(Value::as_u64) {
        None | Some(Some(SUMMARY_FORMAT)) => Ok(summary),
        Some(_) => {
            Err(bad(1, format!("this program reads summaries of format {SUMMARY_FORMAT}, not {}", summary["format"])))
        }
    }
}

/// The parser's reason with the column only: the caller names the line of the file.
fn without_position(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let reason = text.split(" at line ").next().unwrap_or(&text);
    format!("{reason} at column {}", error.column())
}
