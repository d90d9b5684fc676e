//! Turns the records of a walk, or the results of a replay, into one offline HTML page.
//!
//! The input is the folder that `brickwalk walk` writes: `records.jsonl` (one object per frame and pass),
//! `summary.json` and `frames/*.png`, and `checkpoints.jsonl` where errors were measured. The output is `report.html`
//! beside them: one file without references to anything outside the folder. Plots are SVG, a dozen frames are embedded,
//! and the others are linked by relative paths. A script in the page shows values under the pointer, sorts tables and
//! saves them as CSV; without it the page says the same. `records.csv` and `checkpoints.csv` are written, too.
//!
//! The page depends on field names only. A field that is missing, zero throughout or unknown does not stop it; the page
//! says what it left out. Statistics are computed here from the records, not copied from the summary.

mod axis;
mod chart;
mod checkpoints;
mod csv;
mod error;
mod field;
mod format;
mod frames;
mod ink;
mod page;
mod plots;
mod replay;
mod scatter;
mod sheet;
mod tables;
mod walk;

pub use chart::Unit;
pub use error::ReportError;
pub use field::Field;
pub use scatter::{Point, Scatter};
pub use sheet::{Graph, GraphShape, Line, Section, Sheet, Shown, Table, Value, write_sheet};

use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes `dir/report.html` from `dir/records.jsonl`, `dir/summary.json` and `dir/frames/*.png`, and the records as
/// `dir/records.csv`; where there is `dir/checkpoints.jsonl`, `dir/checkpoints.csv` as well. `fields` says what fields
/// of records mean.
///
/// The page appears complete or not at all: it is written under a temporary name in `dir`, then renamed, and an older
/// report is replaced. A walk without a finished frame gives a page that says so.
///
/// # Errors
/// [`ReportError`]: a file is missing or cannot be read, a line of the records or the summary is malformed (the message
/// names file and line), or the page cannot be written.
pub fn write(dir: &Path, fields: &[Field]) -> Result<(), ReportError> {
    let walk = walk::Walk::read(dir)?;
    let gallery = frames::Gallery::read(dir, &walk)?;
    let checkpoints = checkpoints::Checkpoints::read(dir)?;
    let html = page::render(&walk, &gallery, &checkpoints, fields)?;
    publish(dir.join("records.csv"), csv::records(&walk).as_bytes())?;
    if !checkpoints.is_empty() {
        publish(dir.join("checkpoints.csv"), checkpoints.to_csv().as_bytes())?;
    }
    publish(dir.join("report.html"), html.as_bytes())
}

/// Writes the page of a replay, `path`, from what `brickwalk replay --json` prints: plots of loads, bytes and hits
/// against the size of the cache, a curve a policy, and a table. `name` is that of the trace.
///
/// The page appears complete or not at all, and an older file is replaced.
///
/// # Errors
/// [`ReportError`]: a plot cannot be drawn, or the page cannot be written.
pub fn write_replay(path: &Path, name: &str, replay: &serde_json::Value) -> Result<(), ReportError> {
    publish(path.to_owned(), replay::render(name, replay)?.as_bytes())
}

/// Writes the page under a temporary name in its folder, then renames it.
fn publish(path: PathBuf, html: &[u8]) -> Result<(), ReportError> {
    let dir = path.parent().filter(|dir| !dir.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let failed = |source| ReportError::Write { path: path.clone(), source };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".report-").suffix(".tmp");
    #[cfg(unix)]
    {
        // Temporaries are private by default; the finished page has the permissions of any other new file.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.tempfile_in(dir).map_err(failed)?;
    file.write_all(html).map_err(failed)?;
    file.persist(&path).map_err(|error| failed(error.error))?;
    Ok(())
}
