//! Walks of processes of their own, and what they wrote.
#![allow(dead_code)]

use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// Runs `brickwalk` with `words`, which are separated by spaces, after `paths`; panics unless it succeeds.
pub fn brickwalk(command: &str, paths: &[&Path], words: &str) {
    let status = Command::new(env!("CARGO_BIN_EXE_brickwalk"))
        .args(command.split(' '))
        .args(paths)
        .args(words.split_whitespace())
        .status();
    assert!(status.expect("the command starts").success(), "{command} {paths:?} {words}");
}

/// Generates a city of so many triangles.
pub fn city(triangles: &str, scene: &Path) {
    brickwalk("scene city -o", &[scene], &format!("--triangles {triangles}"));
}

/// Walks `scene` along `path` into `output`.
pub fn walk(scene: &Path, path: &Path, output: &Path, words: &str) {
    brickwalk("walk --quality exact", &[scene, Path::new("--path"), path, Path::new("-o"), output], words);
}

/// The summary of a walk.
pub fn summary(folder: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(folder.join("summary.json")).expect("a summary")).expect("JSON")
}

/// The records of a pass, in order of frames.
pub fn records(folder: &Path, pass: &str) -> Vec<Value> {
    let text = std::fs::read_to_string(folder.join("records.jsonl")).expect("records");
    text.lines().map(|l| serde_json::from_str::<Value>(l).expect("a record")).filter(|r| r["pass"] == pass).collect()
}

/// A number of a record; 0 where it has none.
pub fn number(record: &Value, field: &str) -> f64 {
    record[field].as_f64().unwrap_or(0.0)
}

/// Device time of the traversal and of all queries of a pass, ms.
pub fn device_ms(record: &Value) -> f64 {
    ["ms_phase1", "ms_phase2", "ms_phase3"].into_iter().map(|field| number(record, field)).sum()
}

/// Bytes that traversal reads, loaded in a pass.
pub fn bytes_moved(record: &Value) -> f64 {
    number(record, "bytes_bvh") + number(record, "bytes_geometry")
}

/// The median, of an even number of values the upper one.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
