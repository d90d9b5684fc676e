//! Tests that are skipped are counted.

use super::sources::files;
use crate::common::folder;
use std::path::Path;
use std::process::Command;

/// No test skips by a word of its own, except those that another test runs.
#[test]
fn tests_skip_by_one_function() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let word = ["println!(\"", "skipped"].concat();
    let says = |file: &String| std::fs::read_to_string(root.join(file)).is_ok_and(|text| text.contains(&word));
    let found: Vec<String> = files(root, ".rs").into_iter().filter(says).collect();
    assert_eq!(found, ["bricks/tests/it/writer.rs", "tests/skip.rs"]);
}

/// A test that reads scene files, run without them, leaves a line that names it.
#[test]
fn a_test_without_its_scenes_is_counted() {
    let folder = folder();
    let list = folder.path().join("skipped");
    let run = |scenes: &str| {
        let test = std::env::current_exe().expect("this program");
        let mut command = Command::new(test);
        command.args(["--exact", "house::skipped::wants_scenes", "--include-ignored", "--test-threads=2"]);
        command.env("BRICKWALK_SCENES", scenes).env("BRICKWALK_SKIPPED", &list);
        assert!(command.output().expect("the test starts").status.success());
        std::fs::read_to_string(&list).unwrap_or_default()
    };
    assert_eq!(run("scenes"), "", "a folder is named: nothing is skipped");
    let line = "house::skipped::wants_scenes: BRICKWALK_SCENES is not set\n";
    assert_eq!(run(""), line);
    assert_eq!(run(""), line.repeat(2), "lines are appended");
}

/// Run by the test above in a process of its own.
#[test]
#[ignore = "run by a_test_without_its_scenes_is_counted"]
fn wants_scenes() {
    let _ = crate::common::shared_scenes();
}
