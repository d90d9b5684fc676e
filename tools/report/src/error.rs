//! What can go wrong while a report is made.

use std::path::PathBuf;

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A file of the walk is missing or cannot be read.
    #[error("{}: cannot read this file ({source}); give the folder that a walk has written", path.display())]
    Read {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
    /// A line of `records.jsonl` is not a record.
    #[error("{}: line {line}: {reason}; remove the line or walk again", path.display())]
    Record {
        /// The file of records.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// `summary.json` is not a summary.
    #[error("{}: line {line}: {reason}; walk again", path.display())]
    Summary {
        /// The summary's file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What is wrong with it.
        reason: String,
    },
    /// A plot could not be drawn.
    #[error("the plot \"{plot}\" cannot be drawn: {reason}")]
    Draw {
        /// The plot's title.
        plot: String,
        /// The drawing library's reason.
        reason: String,
    },
    /// The page cannot be written.
    #[error("{}: cannot write this file ({source}); check its folder and the space left", path.display())]
    Write {
        /// The page's final name.
        path: PathBuf,
        /// The system's reason.
        source: std::io::Error,
    },
}
