//! Trials: that the frame finds what it should, that a number stands for one trial, that tallies go on, and a few
//! trials of every kind.
#![cfg(unix)]

mod frame;
mod trials;

#[path = "../../../../tests/skip.rs"]
mod skip;

use std::path::Path;
use std::process::{Command, Output};

/// Runs `brickwalk-trials` with these words.
pub fn run(words: &str, more: &[&Path]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_brickwalk-trials"));
    command.args(words.split_whitespace()).args(more);
    command.output().expect("the command starts")
}

/// What a command said on standard output.
pub fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// The numbers of a kind in the table that a command printed: trials, passed, stopped, found.
pub fn counts(text: &str, kind: &str) -> [u64; 4] {
    let row = text.lines().find(|line| line.starts_with(&format!("| {kind} |"))).unwrap_or_else(|| panic!("{text}"));
    let cells: Vec<u64> =
        row.split('|').skip(2).take(4).map(|cell| cell.trim().replace(',', "").parse().unwrap()).collect();
    cells.try_into().unwrap()
}
