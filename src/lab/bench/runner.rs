//! How a bench goes through what it measures: it goes on where an earlier start stopped, and ends early when its time
//! is over or someone interrupts it.

use super::store::{Entry, Store};
use crate::lab::console::{Console, Stopped};
use anyhow::{Result, bail};
use brickwalk_convert::progress::Progress;
use std::path::Path;

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
    ended: Ended,
    /// Measurements of this run.
    measured: usize,
}

impl<'a> Runner<'a> {
    /// Begins a run.
    pub fn new(console: Console<'a>) -> Self {
        Self { console, ended: Ended::Finished, measured: 0 }
    }

    /// Measures those of `jobs` of which `store` lacks one of the `keys`. What `measure` gives back may be less than
    /// that: the rest cannot be measured. [`Stopped`] ends the run.
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
            if !keys.iter().all(|key| store.has(key)) {
                if self.is_over() {
                    break;
                }
                match measure(job) {
                    Err(error) if error.is::<Stopped>() => {
                        self.is_over();
                        break;
                    }
                    entries => {
                        for entry in entries? {
                            store.push(entry)?;
                            self.measured += 1;
                        }
                    }
                }
            }
            progress.advance(keys.len() as u64);
        }
        progress.finish();
        Ok(())
    }

    /// Whether to begin no other measurement.
    fn is_over(&mut self) -> bool {
        if self.console.is_interrupted() {
            self.ended = Ended::Interrupted;
        } else if self.console.is_stopped() {
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
            Ended::OutOfTime if self.measured == 0 => {
                self.console.show("Out of time before a measurement was done; allow more minutes.\n")
            }
            Ended::OutOfTime => self.console.show("Out of time: the same command goes on where this one stopped.\n"),
            Ended::Interrupted => {
                bail!("interrupted; {} holds what is measured, and the same command goes on", folder.display())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::bench::store::{Header, Row, Rows, Values};
    use serde_json::json;
    use std::cell::RefCell;
    use std::sync::atomic::AtomicBool;

    #[test]
    fn a_measurement_that_time_runs_out_on_is_left_for_the_next_start() {
        let folder = tempfile::tempdir().unwrap();
        let (stop, shown) = (AtomicBool::new(false), RefCell::new(String::new()));
        let show = |text: &str| {
            shown.borrow_mut().push_str(text);
            Ok(())
        };
        let console = Console { show: &show, stop: &stop, job: &Progress::hidden, until: None };
        // The second of three takes longer than there is; whoever says so is not told of a fault.
        let run = |console: Console| {
            let header = Header { format: 1, settings: json!({}), adapter: json!({}), commit: String::new() };
            let mut rows = Rows::open(folder.path().join("rows.jsonl"), header, false).unwrap();
            let mut runner = Runner::new(console);
            let measure = |job: &u32| {
                while *job == 2 && console.until.is_some() {
                    console.go_on()?;
                }
                Ok(vec![Row { key: job.to_string(), values: Values::new() }])
            };
            runner.measure(&mut rows, &[1, 2, 3], |job| vec![job.to_string()], measure).unwrap();
            runner.end(folder.path(), "").unwrap();
            rows.all().len()
        };
        assert_eq!(run(console.within(Some(0.0))), 0);
        assert!(shown.take().contains("allow more minutes"));
        assert_eq!(run(console.within(Some(0.002))), 1);
        assert!(shown.take().contains("goes on where this one stopped"));
        assert_eq!(run(console), 3);
        assert_eq!(shown.take(), "");
    }
}
