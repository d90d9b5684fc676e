//! What the probe compared, and what it says where results differ.

use serde::Serialize;

/// What results of exact arithmetic are compared with.
pub(super) const TWIN: &str = "its twin";

/// One function or property, over all cases that concern it.
#[derive(Clone, Debug, Serialize)]
pub struct Check {
    /// Function of the exact arithmetic, the property, or the pipeline.
    pub name: &'static str,
    /// What it was compared with.
    pub against: &'static str,
    /// Cases compared.
    pub cases: u32,
    /// Cases with another result.
    pub different: u32,
    /// The first of these, in words.
    pub first: Option<String>,
}

impl Check {
    /// Without cases yet.
    pub(super) fn new(name: &'static str, against: &'static str) -> Self {
        Self { name, against, cases: 0, different: 0, first: None }
    }

    /// Compares words of a result; +0 and -0 are one value.
    pub(super) fn compare(&mut self, found: &[u32], expected: &[u32], case: &dyn std::fmt::Debug) {
        let value = |x: &u32| if *x == 1 << 31 { 0 } else { *x };
        self.count(found.iter().map(value).eq(expected.iter().map(value)), found, expected, case);
    }

    /// Compares words of a result bit for bit.
    pub(super) fn compare_bits(&mut self, found: &[u32], expected: &[u32], case: &dyn std::fmt::Debug) {
        self.count(found == expected, found, expected, case);
    }

    fn count(&mut self, same: bool, found: &[u32], expected: &[u32], case: &dyn std::fmt::Debug) {
        self.cases += 1;
        if !same {
            self.different += 1;
            self.first.get_or_insert_with(|| format!("{found:08x?} instead of {expected:08x?} for {case:?}"));
        }
    }
}

/// The check of a device that gives no results.
pub(super) fn no_results(name: &'static str, reason: &dyn std::fmt::Display) -> Check {
    Check {
        name,
        against: TWIN,
        cases: 1,
        different: 1,
        first: Some(format!("the device returned no results: {reason}")),
    }
}

/// One line for everything that differs; empty if the device may render in exact mode.
pub fn failures(checks: &[Check]) -> Vec<String> {
    let line = |c: &Check| {
        let first = c.first.as_deref().unwrap_or_default();
        format!("{} differs from {} in {} of {} cases (first: {first})", c.name, c.against, c.different, c.cases)
    };
    checks.iter().filter(|c| c.different > 0).map(line).collect()
}
