//! What the integration tests share: the command as a user runs it, scenes made once, folders that vanish.
#![allow(dead_code)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Runs `brickwalk` with the given words.
pub fn brickwalk<S: AsRef<std::ffi::OsStr>>(words: impl IntoIterator<Item = S>) -> Output {
    Command::new(env!("CARGO_BIN_EXE_brickwalk")).args(words).output().expect("the command starts")
}

/// Runs `brickwalk` and insists on success.
pub fn succeed<S: AsRef<std::ffi::OsStr>>(words: impl IntoIterator<Item = S>) -> String {
    let output = brickwalk(words);
    assert!(
        output.status.success(),
        "exit {:?}\n{}{}",
        output.status.code(),
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// A folder that is removed when the test ends.
pub fn folder() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// The shared scenes, or `None` with a word of why.
pub fn shared_scenes() -> Option<PathBuf> {
    match std::env::var_os("BRICKWALK_SCENES") {
        Some(path) => Some(PathBuf::from(path)),
        None => {
            println!("skipped: BRICKWALK_SCENES is not set");
            None
        }
    }
}

/// A generated city in `folder`.
pub fn city(folder: &Path, triangles: &str, brick_triangles: &str) -> PathBuf {
    let scene = folder.join(format!("city-{triangles}-{brick_triangles}.bricks"));
    let words = ["scene", "city", "--triangles", triangles, "--brick-triangles", brick_triangles, "-o"];
    succeed(words.iter().map(std::ffi::OsStr::new).chain([scene.as_os_str()]));
    scene
}

/// Options of a walk beside scene and output.
pub fn walk(scene: &Path, output: &Path, options: &str) -> String {
    let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), output.as_os_str()];
    succeed(words.into_iter().chain(options.split_whitespace().map(std::ffi::OsStr::new)))
}

/// Every frame of a walk, PNG and EXR, by name.
pub fn frames(output: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<_> = std::fs::read_dir(output.join("frames"))
        .expect("a folder of frames")
        .map(|entry| entry.expect("an entry").path())
        .map(|path| {
            (path.file_name().expect("a name").to_string_lossy().into_owned(), std::fs::read(&path).expect("a frame"))
        })
        .collect();
    files.sort();
    files
}
