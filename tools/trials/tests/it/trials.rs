//! A few trials of every kind.

use crate::skip::skip;
use crate::{counts, run, said};
use brickwalk_trials::kinds;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Trials of a kind of inputs.
const INPUTS: u64 = 130;

#[test]
fn inputs_are_read_or_refused() {
    let output = run(&format!("--only inputs/ --seed 0 --count {INPUTS} --minutes 30"), &[]);
    let text = said(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    for kind in kinds::ALL.iter().filter(|kind| kind.name().starts_with("inputs/")) {
        if let Some(why) = kind.lacks() {
            skip(&why);
            continue;
        }
        let [trials, passed, stopped, _] = counts(&text, kind.name());
        assert_eq!(trials, INPUTS, "{}", kind.name());
        // Sound inputs are read, and harm is done to most.
        assert!(passed >= 3 && stopped >= 20, "{}: {passed} read, {stopped} refused", kind.name());
    }
}

/// Trials of all kinds that begin so; at least so many of each pass, and are stopped.
fn all(begin: &str, count: u64, least: [u64; 2]) {
    let meant = || kinds::ALL.iter().filter(|kind| kind.name().starts_with(begin));
    if let Some(why) = meant().find_map(|kind| kind.lacks()) {
        return skip(&why);
    }
    let output = run(&format!("--only {begin} --seed 0 --count {count} --minutes 30"), &[]);
    let text = said(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    for kind in meant() {
        let [trials, passed, stopped, _] = counts(&text, kind.name());
        let name = kind.name();
        assert!(trials == count && passed >= least[0] && stopped >= least[1], "{name}: {passed} {stopped}");
    }
}

#[test]
fn faults_end_in_right_answers_or_one_line() {
    all("faults/", 40, [8, 5]);
}

#[test]
fn what_changes_nothing_makes_no_difference() {
    all("differences/", 12, [12, 0]);
}

#[test]
fn lesser_devices_give_the_same_or_say_why() {
    all("device/limits", 8, [2, 2]);
    all("device/lost", 8, [0, 8]);
}

#[test]
fn orders_of_threads_do_not_show() {
    all("threads/", 100, [100, 0]);
}

/// The files that trials of a kind make.
fn made(kind: &str, seed: u64) -> BTreeMap<PathBuf, Vec<u8>> {
    let folder = tempfile::tempdir().unwrap();
    run(&format!("--only {kind} --seed {seed} --count 1 --keep"), &[folder.path()]);
    let mut files = BTreeMap::new();
    let mut open = vec![PathBuf::new()];
    while let Some(below) = open.pop() {
        for entry in std::fs::read_dir(folder.path().join(&below)).unwrap().map(Result::unwrap) {
            let name = below.join(entry.file_name());
            match entry.file_type().unwrap().is_dir() {
                true => open.push(name),
                false => drop(files.insert(name, std::fs::read(entry.path()).unwrap())),
            }
        }
    }
    files
}

#[test]
fn a_number_stands_for_one_input() {
    for kind in ["inputs/glb", "inputs/obj", "inputs/bricks", "inputs/npy"] {
        let [one, same, other] = [5, 5, 6].map(|seed| made(kind, seed));
        assert!(!one.is_empty() && one == same, "{kind}");
        assert!(one != other, "{kind}: another number is another input");
    }
}

#[test]
fn killed_commands_run_again() {
    // That of this workspace, which its tests build.
    let program = Path::new(env!("CARGO_BIN_EXE_brickwalk-trials")).with_file_name("brickwalk");
    if !program.exists() {
        return skip("brickwalk is not built; run the tests of the workspace");
    }
    for kind in ["kills/scene", "kills/convert", "kills/query"] {
        let output = run(&format!("--only {kind} --seed 0 --count 12 --minutes 10"), &[]);
        let text = said(&output);
        assert_eq!(output.status.code(), Some(0), "{text}");
        let [trials, _, stopped, _] = counts(&text, kind);
        assert!(trials == 12 && stopped >= 3, "{text}");
    }
}
