//! Tests that cannot run here say so, and are counted. Every crate whose tests need scene files or a device includes
//! this file.

use std::io::Write;
use std::path::PathBuf;

/// Says why the test that calls this is skipped, and appends a line to the file that `BRICKWALK_SKIPPED` names.
/// `tools/test.sh` counts its lines; `.ci/run` wants none.
pub fn skip(why: &str) {
    println!("skipped: {why}");
    let Some(list) = std::env::var_os("BRICKWALK_SKIPPED").filter(|list| !list.is_empty()) else { return };
    let thread = std::thread::current();
    let line = format!("{}: {why}\n", thread.name().unwrap_or("a test"));
    let file = std::fs::OpenOptions::new().append(true).create(true).open(&list);
    // One write for a line: tests of several processes append.
    let written = file.and_then(|mut file| file.write_all(line.as_bytes()));
    written.unwrap_or_else(|error| panic!("BRICKWALK_SKIPPED={}: {error}", list.display()));
}

/// The folder of scene files, `BRICKWALK_SCENES`; without it the test is skipped.
#[allow(dead_code, reason = "some crates have tests of devices alone")]
pub fn shared_scenes() -> Option<PathBuf> {
    let folder = std::env::var_os("BRICKWALK_SCENES").filter(|folder| !folder.is_empty()).map(PathBuf::from);
    if folder.is_none() {
        skip("BRICKWALK_SCENES is not set");
    }
    folder
}
