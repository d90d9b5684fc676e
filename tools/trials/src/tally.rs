//! What was tried, a line a range of seeds, and what was found, a line each: a file of JSON lines that grows while
//! trials run, from which they go on, and which adds up with those of other machines.
//!
//! A line stands for a range, as one for each of ten million trials would be gigabytes.

use anyhow::{Context, Result};
use brickwalk::output::atomic::JsonLines;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

/// Trials of a kind with consecutive seeds.
#[derive(Clone, Debug, Default, Deserialize, PartialEq, Serialize)]
pub struct Range {
    /// The kind.
    pub kind: String,
    /// The first seed.
    pub from: u64,
    /// The seed after the last.
    pub to: u64,
    /// Trials that came through.
    pub passed: u64,
    /// Trials that were stopped as they should be.
    pub stopped: u64,
    /// Trials that found something.
    pub found: u64,
    /// Seconds.
    pub seconds: f64,
    /// Most bytes that a trial took.
    pub peak_bytes: u64,
    /// Commit of the program.
    pub commit: String,
    /// Seconds since 1970 when it ended.
    pub time: u64,
}

/// What a trial found.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
pub struct Finding {
    /// The kind.
    pub kind: String,
    /// The seed.
    pub seed: u64,
    /// What defects are told apart by.
    pub what: String,
    /// All that is known.
    pub text: String,
    /// The command that repeats it.
    pub command: String,
    /// Commit of the program.
    pub commit: String,
}

/// A line.
#[derive(Clone, Debug, Deserialize, PartialEq, Serialize)]
#[serde(tag = "line", rename_all = "snake_case")]
pub enum Line {
    /// A range.
    Trials(Range),
    /// A finding.
    Finding(Finding),
}

/// The file.
#[derive(Debug)]
pub struct Tally {
    lines: Vec<Line>,
    file: JsonLines,
}

/// Of a kind, over all ranges.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sum {
    /// Trials.
    pub trials: u64,
    /// Of these, came through.
    pub passed: u64,
    /// Were stopped.
    pub stopped: u64,
    /// Found something.
    pub found: u64,
    /// Seconds.
    pub seconds: f64,
    /// Most bytes that a trial took.
    pub peak_bytes: u64,
}

/// The lines of a file; none of one that is not there. The last line may be half written: it does not count. Also the
/// bytes of the whole lines.
///
/// # Errors
/// It cannot be read; a line is none.
pub fn read(path: &Path) -> Result<(Vec<Line>, u64)> {
    let name = path.display();
    let text = match std::fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok((Vec::new(), 0)),
        Err(error) => return Err(error).with_context(|| format!("{name}: cannot read the tallies")),
    };
    let whole = &text[..text.rfind('\n').map_or(0, |end| end + 1)];
    let lines = whole.lines().enumerate().map(|(number, line)| {
        serde_json::from_str(line).with_context(|| format!("{name}: line {}: no tally; remove the line", number + 1))
    });
    Ok((lines.collect::<Result<_>>()?, whole.len() as u64))
}

impl Tally {
    /// Opens a file, or begins it.
    ///
    /// # Errors
    /// As of [`read`]; it cannot be written.
    pub fn open(path: &Path) -> Result<Self> {
        let (lines, bytes) = read(path)?;
        let file = if path.exists() { JsonLines::append(path, bytes)? } else { JsonLines::create(path)? };
        Ok(Self { lines, file })
    }

    /// All lines.
    pub fn lines(&self) -> &[Line] {
        &self.lines
    }

    /// Appends a line.
    ///
    /// # Errors
    /// The disk is full.
    pub fn push(&mut self, line: Line) -> Result<()> {
        self.file.push(&line)?;
        self.lines.push(line);
        Ok(())
    }

    /// The first seed of a kind behind all that were tried.
    pub fn next(&self, kind: &str) -> u64 {
        let ends = self.lines.iter().filter_map(|line| match line {
            Line::Trials(range) if range.kind == kind => Some(range.to),
            _ => None,
        });
        ends.max().unwrap_or(0)
    }
}

/// Sums of all kinds.
pub fn sums(lines: &[Line]) -> BTreeMap<&str, Sum> {
    let mut sums: BTreeMap<&str, Sum> = BTreeMap::new();
    for line in lines {
        let Line::Trials(range) = line else { continue };
        let sum = sums.entry(&range.kind).or_default();
        sum.trials += range.to - range.from;
        sum.passed += range.passed;
        sum.stopped += range.stopped;
        sum.found += range.found;
        sum.seconds += range.seconds;
        sum.peak_bytes = sum.peak_bytes.max(range.peak_bytes);
    }
    sums
}

/// Findings told apart by kind and what they are: the first of each.
pub fn distinct(lines: &[Line]) -> Vec<&Finding> {
    let mut seen = std::collections::BTreeSet::new();
    let findings = lines.iter().filter_map(|line| match line {
        Line::Finding(finding) => Some(finding),
        Line::Trials(_) => None,
    });
    findings.filter(|finding| seen.insert((&finding.kind, &finding.what))).collect()
}

/// The same in fewer lines: ranges that follow each other are one, and of a sort of findings the first is left.
pub fn joined(lines: &[Line]) -> Vec<Line> {
    let mut ranges: Vec<Range> = Vec::new();
    for line in lines {
        if let Line::Trials(range) = line {
            ranges.push(range.clone());
        }
    }
    ranges.sort_by(|a, b| (&a.kind, a.from).cmp(&(&b.kind, b.from)));
    let mut joined: Vec<Range> = Vec::new();
    for range in ranges {
        match joined.last_mut() {
            Some(last) if last.kind == range.kind && last.commit == range.commit && last.to == range.from => {
                last.to = range.to;
                last.passed += range.passed;
                last.stopped += range.stopped;
                last.found += range.found;
                last.seconds += range.seconds;
                last.peak_bytes = last.peak_bytes.max(range.peak_bytes);
                last.time = last.time.max(range.time);
            }
            _ => joined.push(range),
        }
    }
    let findings = distinct(lines).into_iter().cloned().map(Line::Finding);
    joined.into_iter().map(Line::Trials).chain(findings).collect()
}
