//! Reading of files of keyframes, which camera paths and motions are.

use bricks::one_line;
use bricks::planted::{self, Defect};
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why keyframes were refused.
#[derive(Debug, Error)]
#[error("{}: {what}", file.display())]
pub struct KeyframesError {
    /// The file, or what made the keyframes.
    pub file: PathBuf,
    /// What is wrong, of which keyframe or mover, and what to do.
    pub what: String,
}

impl KeyframesError {
    pub(super) fn new(file: &Path, what: String) -> Self {
        // A name in the file may hold a line's end, and what is said of it quotes it.
        Self { file: file.into(), what: one_line(&what) }
    }
}

/// The text of a file that is to be a `kind`.
pub(super) fn read(file: &Path, kind: &str) -> Result<String, KeyframesError> {
    std::fs::read_to_string(file).map_err(|e| KeyframesError::new(file, format!("cannot read the {kind}: {e}")))
}

/// The JSON object that is to be a `kind`.
pub(super) fn parse<T: DeserializeOwned>(text: &str, file: &Path, kind: &str) -> Result<T, KeyframesError> {
    serde_json::from_str(text).map_err(|e| KeyframesError::new(file, format!("not a {kind}: {e}")))
}

/// Refuses the time of a keyframe that is not after that of the one before it.
pub(super) fn check_after(before: Option<f64>, time: f64) -> Result<(), String> {
    match before {
        Some(before) if time <= before && !planted::is(Defect::KeyframeTimes) => {
            Err(format!("its time {time} is not after {before}; sort the keyframes by time"))
        }
        _ => Ok(()),
    }
}
