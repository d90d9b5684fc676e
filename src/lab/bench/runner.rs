//! How a bench goes through what it measures: it goes on where an earlier start stopped, and ends early when its time
//! is over or someone interrupts it.

use super::store::{Entry, Store};
use crate::lab::console::Console;
use anyhow::{Result, bail};
use brickwalk_convert::progress::Progress;
use std::path::Path;
use std::time::{Duration, Instant};

/// How far a run came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Ended {
    Finished,
    OutOfTime,
    Interrupted,
}

/// A run of a bench.
pub struct Runner<'a> {
    console: Console<'a>,
    deadline: Option<Instant>,
    ended: Ended,
}

impl<'a> Runner<'a> {
    /// Begins a run of so many minutes.
    pub fn new(minutes: Option<f64>, console: Console<'a>) -> Self {
        let deadline = minutes.map(|minutes| Instant::now() + Duration::from_secs_f64(60.0 * minutes));
        Self { console, deadline, ended: Ended::Finished }
    }

    /// Measures those of `jobs` of which `store` lacks one of the `keys`. What `measure` gives back may be less than
    /// that: the rest cannot be measured, or was interrupted.
    ///
    /// # Errors
    /// Those of `measure`; the file cannot be written.
    pub fn measure<'j, J, T: Entry>(
        &mut self,
        store: &mut Store<T>,
        jobs: &'j [J],
        keys: impl Fn(&J) -> Vec<String>,
        mut measure: impl FnMut(&'j J) -> Result<Vec<T>>,
    ) -> Result<()> {
        let progress = Progress::new();
        progress.phase("measurements", jobs.iter().map(|job| keys(job).len() as u64).sum());
        for job in jobs {
            let keys = keys(job);
            let is_done = |store: &Store<T>| keys.iter().all(|key| store.has(key));
            if !is_done(store) {
                if self.is_over() {
                    break;
                }
                for entry in measure(job)? {
                    store.push(entry)?;
                }
                if self.console.is_stopped() && !is_done(store) {
                    self.ended = Ended::Interrupted;
                    break;
                }
            }
            progress.advance(keys.len() as u64);
        }
        progress.finish();
        Ok(())
    }

    /// Whether to begin no other measurement.
    fn is_over(&mut self) -> bool {
        if self.console.is_stopped() {
            self.ended = Ended::Interrupted;
        } else if self.deadline.is_some_and(|deadline| Instant::now() >= deadline) {
            self.ended = Ended::OutOfTime;
        }
        self.ended != Ended::Finished
    }

    /// Shows `text`, and how the run ended.
    ///
    /// # Errors
    /// It was interrupted.
    pub fn end(self, folder: &Path, text: &str) -> Result<()> {
        self.console.show(text)?;
        match self.ended {
            Ended::Finished => Ok(()),
            Ended::OutOfTime => self.console.show("Out of time: the same command goes on where this one stopped.\n"),
            Ended::Interrupted => {
                bail!("interrupted; {} holds what is measured, and the same command goes on", folder.display())
            }
        }
    }
}
