//! Turns the records of a walk into one offline HTML page.
//!
//! The input is the folder that `brickwalk walk` writes: `records.jsonl` (one object per frame and pass),
//! `summary.json` and `frames/*.png`. The output is `report.html` beside them: one file without scripts or references to anything
//! outside the folder. Plots are SVG, a dozen frames are embedded, and the others are linked by relative paths.
//!
//! The page depends on field names only. A field that is missing, zero throughout or unknown does not stop it; the page
//! says what it left out. Statistics are computed here from the records, not copied from the summary.

mod chart;
mod error;
mod format;
mod frames;
mod page;
mod plots;
mod tables;
mod walk;

pub use error::ReportError;

use std::io::Write;
use std::path::Path;

/// Writes `dir/report.html` from `dir/records.jsonl`, `dir/summary.json` and `dir/frames/*.png`.
///
/// The page appears complete or not at all: it is written under a temporary name in `dir`, then renamed, and an older
/// report is replaced. A walk without a finished frame gives a page that says so.
///
/// # Errors
/// [`ReportError`]: a file is missing or cannot be read, a line of the records or the summary is malformed (the message
/// names file and line), or the page cannot be written.
pub fn write(dir: &Path) -> Result<(), ReportError> {
    let walk = walk::Walk::read(dir)?;
    let gallery = frames::Gallery::read(dir, &walk)?;
    let html = page::render(&walk, &gallery)?;
    publish(dir, html.as_bytes())
}

/// Writes the page under a temporary name in its folder, then renames it.
fn publish(dir: &Path, html: &[u8]) -> Result<(), ReportError> {
    let path = dir.join("report.html");
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
