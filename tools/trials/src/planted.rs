//! Plants defects, one after the other, and counts the trials until each is found.

use crate::command::say;
use crate::kinds;
use crate::slice::{self, How};
use anyhow::{Context, Result, ensure};
use bricks::planted::Defect;
use std::process::ExitCode;

/// Seconds for a defect.
const SECONDS: f64 = 120.0;

/// Plants every defect, or the one called `only`, tries the kind that has to find it from `seed` on, at most `tries`
/// times, and prints a table. Each is also tried without the defect, as many times: that has to find nothing.
///
/// # Errors
/// There is no such defect; workers cannot be started.
pub fn run(how: &How, tries: u64, only: Option<&str>, seed: u64) -> Result<ExitCode> {
    let chosen: Vec<Defect> =
        Defect::ALL.into_iter().filter(|defect| only.is_none_or(|only| only == defect.name())).collect();
    ensure!(!chosen.is_empty(), "there is no such defect");
    say("| defect | kind | found at try | as | without it |\n| --- | --- | ---: | --- | --- |\n");
    let mut are_all_found = true;
    for defect in chosen {
        let kind = kinds::find(defect.kind()).with_context(|| format!("{}: there is no such kind", defect.kind()))?;
        let planted = How { plant: Some(defect.name().into()), ..how.clone() };
        let found = slice::first(kind, &planted, seed, tries, SECONDS)?;
        let (at, what) = match &found {
            Some(told) => ((told.seed - seed + 1).to_string(), told.what.clone()),
            None => ("not".into(), String::new()),
        };
        let count = found.as_ref().map_or(0, |told| told.seed - seed + 1);
        let sound = slice::run(kind, how, seed, count, SECONDS)?;
        let without = if sound.found == 0 { "nothing" } else { "something" };
        say(&format!("| {} | {} | {at} | {what} | {without} |\n", defect.name(), kind.name()));
        are_all_found &= found.is_some() && sound.found == 0;
    }
    Ok(ExitCode::from(u8::from(!are_all_found)))
}
