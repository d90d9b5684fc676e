//! What a trial is.

use std::path::Path;

/// How a trial ended that found nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It came through: an input was read, a command ended by itself.
    Passed,
    /// It was stopped as it should be: an input was refused, a command was killed and ran again.
    Stopped,
}

/// Something that a trial found: a defect.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// What defects are told apart by, such as `panic at bricks/src/file.rs:10`.
    pub what: String,
    /// All that is known.
    pub text: String,
}

impl Fault {
    /// Of a trial that breaks the promise `what`.
    pub fn new(what: &str, text: impl Into<String>) -> Self {
        Self { what: what.into(), text: text.into() }
    }
}

/// What a trial may take. Beyond it is a finding.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Seconds before it counts as hung.
    pub seconds: f64,
    /// Bytes of memory that it may have taken at any one time.
    pub bytes: u64,
}

/// A trial that is to be made.
#[derive(Clone, Copy, Debug)]
pub struct Trial<'a> {
    /// Its number. All that happens follows from it and the kind.
    pub seed: u64,
    /// An empty folder, which is emptied after it.
    pub folder: &'a Path,
    /// A folder that stays over the trials of a process, for what they share.
    pub shared: &'a Path,
    /// The program `brickwalk`.
    pub program: &'a Path,
    /// Where to leave what a trial made, for people.
    pub keep: Option<&'a Path>,
}

/// A kind of trials.
pub trait Kind: Send + Sync {
    /// Its name: `inputs/` or `kills/` and a word.
    fn name(&self) -> &'static str;

    /// What it tries, in a sentence without a full stop.
    fn about(&self) -> &'static str;

    /// What a trial may take.
    fn limits(&self) -> Limits;

    /// Why it cannot run here; `None`: it can.
    fn lacks(&self) -> Option<String> {
        None
    }

    /// Makes a trial, which depends on its number alone. A panic counts as a finding.
    ///
    /// # Errors
    /// What it found.
    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault>;
}
