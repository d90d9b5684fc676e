//! What pages tell a reader to type works: commands of README.md and of the examples run one after the other in a fresh
//! folder; those of all pages are understood.

use crate::common::{folder, skip};
use brickwalk::cli::options::args::Cli;
use clap::Parser;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Most seconds of processor time of a command that is not marked with `(minutes)`: a minute on two cores that are
/// three quarters busy. What else runs does not count.
const MOST_SECONDS: f64 = 90.0;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The shell commands of a page: lines of indented blocks; a line that ends in a backslash goes on in the next.
fn commands(page: &str) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    let mut goes_on = false;
    let mut is_fenced = false;
    for line in page.lines() {
        is_fenced ^= line.trim_start().starts_with("```");
        let Some(line) = line.strip_prefix("    ").filter(|_| !is_fenced) else { continue };
        let text = line.trim().trim_end_matches('\\').trim_end();
        match found.last_mut().filter(|_| goes_on) {
            Some(last) => *last += &format!(" {text}"),
            None => found.push(text.to_owned()),
        }
        goes_on = line.ends_with('\\');
    }
    found
}

/// Runs a command by the shell, with this build's `brickwalk` and `python` before all others; what it converts by the
/// way stays in the folder.
fn shell(command: &str, folder: &Path, python: &Path) -> Output {
    let program = Path::new(env!("CARGO_BIN_EXE_brickwalk")).parent().expect("a folder").to_owned();
    let others = std::env::var_os("PATH").unwrap_or_default();
    let path = [program, python.to_owned()].into_iter().chain(std::env::split_paths(&others));
    let path = std::env::join_paths(path).expect("folders");
    // The last line on standard error: times of what the shell ran.
    let timed = format!("{command}\ncode=$?; times >&2; exit $code");
    let mut shell = Command::new("sh");
    shell.args(["-c", &timed]).current_dir(folder).env("PATH", path).env("BRICKWALK_CACHE_DIR", folder.join("cache"));
    shell.output().expect("a shell")
}

/// Seconds of processor time by the last line of `times`: `1m2.5s 0m0.25s`.
fn seconds(said: &str) -> f64 {
    let part = |text: &str| -> Option<f64> {
        let (minutes, seconds) = text.trim_end_matches('s').split_once('m')?;
        Some(60.0 * minutes.parse::<f64>().ok()? + seconds.parse::<f64>().ok()?)
    };
    let last = said.lines().last().unwrap_or_default();
    last.split_whitespace().map(|text| part(text).unwrap_or_else(|| panic!("no time: {said}"))).sum()
}

/// A folder with a `python3` that has NumPy; without one the test is skipped.
fn python() -> Option<PathBuf> {
    let places = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&places).find(|folder| {
        let asked = Command::new(folder.join("python3")).args(["-c", "import numpy"]).output();
        asked.is_ok_and(|output| output.status.success())
    });
    if found.is_none() {
        skip("no python3 with NumPy");
    }
    found
}

/// Runs the commands of a page in a folder that holds what a fresh clone holds. What builds or installs this program is
/// left out, and so is what takes minutes.
fn run(page: &str) {
    let Some(python) = python() else { return };
    let folder = folder();
    for entry in std::fs::read_dir(root()).expect("a checkout").map(|entry| entry.expect("an entry")) {
        let name = entry.file_name();
        if name != "target" && !name.to_string_lossy().starts_with('.') {
            std::os::unix::fs::symlink(entry.path(), folder.path().join(name)).expect("a link");
        }
    }
    let text = std::fs::read_to_string(root().join(page)).expect("a page");
    let mut count = 0;
    for command in commands(&text) {
        let first = command.split_whitespace().next().unwrap_or_default();
        if ["cargo", "docker", "git"].contains(&first) || first.starts_with("tools/") || command.contains("(minutes)") {
            continue;
        }
        // They stay until somebody closes them; tests of their own do.
        if command.starts_with("brickwalk view") || command.starts_with("brickwalk serve") {
            continue;
        }
        let output = shell(&command, folder.path(), &python);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let time = seconds(&said);
        println!("{time:6.1} s  {command}");
        assert!(output.status.success(), "{page}: {command}\n{said}");
        assert!(!said.contains("warning"), "{page}: {command}\n{said}");
        assert!(time < MOST_SECONDS, "{page}: {time} s for {command}");
        count += 1;
    }
    assert!(count > 2, "{page}: {count} commands");
}

#[test]
fn times_of_the_shell_are_read() {
    let output = shell("sh -c 'exit 3'    # three", &root(), Path::new("/bin"));
    assert_eq!(output.status.code(), Some(3));
    assert!(seconds(&String::from_utf8_lossy(&output.stderr)) < 1.0);
    assert_eq!(seconds("a line\n0m0.01s 0m0.02s\n1m2.5s 0m0.25s\n"), 62.75);
}

#[test]
fn commands_of_the_readme_run() {
    run("README.md");
}

#[test]
fn commands_of_the_examples_run() {
    for page in ["convert", "walk", "trace", "replay"] {
        run(&format!("examples/{page}.md"));
    }
}

/// The pages that tell a reader what to type, but those of dated results.
fn pages() -> Vec<PathBuf> {
    let in_folder = |folder: &str| {
        let entries = std::fs::read_dir(root().join(folder)).expect("a folder");
        let files = entries.map(|entry| entry.expect("an entry").path());
        files.filter(|file| file.extension().is_some_and(|ending| ending == "md") && !file.ends_with("CHANGELOG.md"))
    };
    let mut all: Vec<PathBuf> = ["", "docs", "docs/methods", "examples"].into_iter().flat_map(in_folder).collect();
    all.sort();
    all
}

/// Why a command is not understood, if it is not.
fn misunderstood(command: &str) -> Option<String> {
    // The shell splits it, so that quotes and comments mean what they do there; it writes no file and runs nothing
    // else.
    let own = command.split(['>', '|', ';', '&']).next().expect("a part");
    let split = Command::new("sh").args(["-fc", &format!("printf '%s\\n' {own}")]).output().expect("a shell");
    let words = String::from_utf8(split.stdout).expect("UTF-8");
    let refused = Cli::try_parse_from(words.lines()).err()?;
    Some(format!("{command}\n{refused}"))
}

#[test]
fn commands_of_all_pages_are_understood() {
    let mut wrong = Vec::new();
    let mut count = 0;
    for page in pages() {
        let text = std::fs::read_to_string(&page).expect("a page");
        let own: Vec<String> =
            commands(&text).into_iter().filter(|command| command.starts_with("brickwalk ")).collect();
        count += own.len();
        let refused = own.iter().filter_map(|command| misunderstood(command));
        wrong.extend(refused.map(|why| format!("{}: {why}", page.display())));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(count > 30, "{count} commands are found");
    assert!(misunderstood("brickwalk info --no-such-option x.bricks").is_some());
}
