//! What a case is, and what it finds.

use super::lab::Lab;
use crate::reference::Tally;
use anyhow::Result;
use serde::Serialize;
use std::fmt::Display;

/// Where truth comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// Exact arithmetic: integers.
    Exact,
    /// f64, brute force, with exact predicates where it does not decide.
    Reference,
    /// A closed form.
    Analytic,
    /// Two paths of the program, bit for bit.
    Paths,
    /// What is expected is a statement: an error, a count, a bound.
    Unit,
}

/// A case of the list.
#[derive(Clone, Copy)]
pub struct Case {
    /// Its number, from 1 to 60.
    pub number: u32,
    /// What it is about.
    pub title: &'static str,
    /// Where truth comes from.
    pub truth: Source,
    /// Measures it; `None`: it has been measured, by the start-up probe.
    pub run: Option<fn(&mut Lab, &mut Checks) -> Result<()>>,
}

/// One comparison of a case.
#[derive(Clone, Debug, Serialize)]
pub struct Check {
    /// What was measured, with its value.
    pub measured: String,
    /// What it must be.
    pub bound: String,
    /// Whether it is.
    pub passed: bool,
}

/// The comparisons of a case.
#[derive(Clone, Debug, Default)]
pub struct Checks(pub Vec<Check>);

impl Checks {
    fn push(&mut self, measured: String, bound: String, passed: bool) {
        self.0.push(Check { measured, bound, passed });
    }

    /// `found` is at most `bound`; fails for a NaN.
    pub fn at_most<T: PartialOrd + Display>(&mut self, what: &str, found: T, bound: T) {
        self.push(format!("{what}: {found}"), format!("at most {bound}"), found <= bound);
    }

    /// `found` is at least `bound`: that enough was tested.
    pub fn at_least<T: PartialOrd + Display>(&mut self, what: &str, found: T, bound: T) {
        self.push(format!("{what}: {found}"), format!("at least {bound}"), found >= bound);
    }

    /// `found` is `expected`.
    pub fn equal<T: PartialEq + Display>(&mut self, what: &str, found: T, expected: T) {
        self.push(format!("{what}: {found}"), expected.to_string(), found == expected);
    }

    /// Nothing of `of` is wrong.
    pub fn none(&mut self, what: &str, wrong: u64, of: u64) {
        self.push(format!("{what}: {wrong} of {of}"), "0".into(), wrong == 0 && of > 0);
    }

    /// What is said is so.
    pub fn holds(&mut self, what: &str, is_so: bool) {
        self.push(format!("{what}: {}", if is_so { "yes" } else { "no" }), "yes".into(), is_so);
    }

    /// The judge of hits excuses every difference from truth.
    pub fn judged(&mut self, what: &str, tally: &Tally) {
        let text = format!("{what}: unexcused differences from truth ({} excused)", tally.excused());
        self.none(&text, tally.mismatches, tally.total());
        if let Some((index, fault)) = &tally.first {
            self.equal(&format!("{what}: ray {index}"), format!("{fault:?}"), "no fault".into());
        }
    }

    /// An error was given whose text has all `words`.
    pub fn refuses<T>(&mut self, what: &str, result: Result<T>, words: &[&str]) {
        let text = match result {
            Ok(_) => "accepted".into(),
            Err(error) => format!("{error:#}"),
        };
        let passed = words.iter().all(|word| text.contains(word));
        self.push(format!("{what}: {text}"), format!("an error that names {}", words.join(", ")), passed);
    }

    /// Whether all hold, and there are some.
    pub fn passed(&self) -> bool {
        !self.0.is_empty() && self.0.iter().all(|check| check.passed)
    }
}

/// How a case ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub enum Status {
    /// All its comparisons hold.
    #[serde(rename = "pass")]
    Pass,
    /// One does not, or the case ended with an error.
    #[serde(rename = "fail")]
    Fail,
    /// The part of the program that it is about is not there.
    #[serde(rename = "not built yet")]
    NotBuilt,
}

impl Status {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Fail => "FAIL",
            Self::NotBuilt => "not built yet",
        }
    }
}

/// A line of the result.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// Number of the case; 0: the probe of the device's arithmetic.
    pub case: u32,
    /// What it is about.
    pub title: &'static str,
    /// Where truth comes from.
    pub truth: Source,
    /// How it ended.
    pub status: Status,
    /// Its comparisons.
    pub checks: Vec<Check>,
    /// The error that ended it.
    pub error: Option<String>,
    /// Wall time, milliseconds.
    pub ms: f64,
    /// The command that repeats it, where it failed.
    pub replay: Option<String>,
}
