//! The command line.

use crate::campaign::{self, Plan};
use crate::kind::Kind;
use crate::page;
use crate::slice::How;
use crate::tally::{Finding, Line, Tally};
use crate::{kinds, tally, worker};
use anyhow::{Context, Result, bail, ensure};
use brickwalk::output::atomic;
use clap::{Parser, Subcommand};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Tries brickwalk with hostile inputs and kills. Every trial is a kind and a number.
///
/// Exit status: 0 nothing was found, 1 something was, 2 trials could not run.
#[derive(Debug, Parser)]
#[command(name = "brickwalk-trials", version, max_term_width = 110)]
struct Words {
    /// What else to do
    #[command(subcommand)]
    other: Option<Other>,
    /// Minutes in all
    #[arg(long, default_value_t = 1.0)]
    minutes: f64,
    /// Most trials of a kind [default: as many as there is time for]
    #[arg(long)]
    count: Option<u64>,
    /// The first seed. Nothing is then written down [default: behind the last one of the tallies]
    #[arg(long)]
    seed: Option<u64>,
    /// A kind, or the beginning of the names of several, such as inputs/ or kills/walk. May be repeated
    #[arg(long, value_name = "KIND")]
    only: Vec<String>,
    /// Folder for the tallies (trials.jsonl), from which later trials go on, and the page (trials.html)
    #[arg(long, value_name = "DIR", default_value = "target/trials")]
    out: PathBuf,
    /// Workers side by side [default: one a core]
    #[arg(long, value_name = "N")]
    jobs: Option<usize>,
    /// Leave what trials make in this folder; for one trial, as there is one file of a name
    #[arg(long, value_name = "DIR")]
    keep: Option<PathBuf>,
    /// The program brickwalk [default: beside this one]
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
    /// List the kinds
    #[arg(long)]
    list: bool,
}

#[derive(Debug, Subcommand)]
enum Other {
    /// Make trials in this process; what the command starts
    #[command(hide = true)]
    Work(worker::Work),
    /// Print the tallies of files, added up, as a table
    Table {
        /// Files of tallies
        #[arg(required = true)]
        files: Vec<PathBuf>,
    },
    /// Print the tallies of files in as few lines as can be
    Join {
        /// Files of tallies
        #[arg(required = true)]
        files: Vec<PathBuf>,
    },
    /// Plant defects, one after the other, and count the trials until each is found
    #[cfg(feature = "planted")]
    Planted {
        /// Most trials of a kind for a defect
        #[arg(long, default_value_t = 1_000_000)]
        tries: u64,
        /// A defect alone
        #[arg(long)]
        only: Option<String>,
        /// The first seed
        #[arg(long, default_value_t = 0)]
        seed: u64,
    },
}

/// Prints, if anybody listens.
pub fn say(text: &str) {
    let mut out = std::io::stdout();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

/// Runs the command line of this process.
pub fn main() -> ExitCode {
    match run(&Words::parse()) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("brickwalk-trials: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn run(words: &Words) -> Result<ExitCode> {
    match &words.other {
        Some(Other::Work(work)) => return worker::run(work).map(|()| ExitCode::SUCCESS),
        Some(Other::Table { files }) => {
            say(&page::table(&all(files)?));
            return Ok(ExitCode::SUCCESS);
        }
        Some(Other::Join { files }) => {
            for line in tally::joined(&all(files)?) {
                say(&(serde_json::to_string(&line)? + "\n"));
            }
            return Ok(ExitCode::SUCCESS);
        }
        #[cfg(feature = "planted")]
        Some(Other::Planted { tries, only, seed }) => {
            let how = How { program: program(words)?, keep: None, plant: None };
            return crate::planted::run(&how, *tries, only.as_deref(), *seed);
        }
        None => {}
    }
    if words.list {
        for kind in kinds::ALL {
            let why = kind.lacks().map_or_else(String::new, |why| format!(" (not here: {why})"));
            say(&format!("{:24} {}{why}\n", kind.name(), kind.about()));
        }
        return Ok(ExitCode::SUCCESS);
    }
    ensure!(words.minutes > 0.0 && words.minutes.is_finite(), "--minutes: give a positive number");
    let kinds = chosen(&words.only)?;
    if let Some(keep) = &words.keep {
        ensure!(words.count == Some(1) && kinds.len() == 1, "--keep: give --only KIND --seed N --count 1");
        atomic::create_folder(keep)?;
    }
    let kinds = able(kinds, words.only.is_empty())?;
    let jobs = words.jobs.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let how = How { program: program(words)?, keep: words.keep.clone(), plant: None };
    let plan = Plan { kinds, seconds: words.minutes * 60.0, count: words.count, seed: words.seed, jobs, how };
    let mut kept = None;
    if words.seed.is_none() {
        atomic::create_folder(&words.out)?;
        kept = Some(Tally::open(&words.out.join("trials.jsonl"))?);
    }
    let done = campaign::run(&plan, kept.as_mut(), &tell)?;
    say(&page::table(&done.lines));
    if let Some(kept) = &kept {
        let file = words.out.join("trials.html");
        atomic::write(&file, page::page(kept.lines()).as_bytes())?;
        say(&format!("{}\n", file.display()));
    }
    let found = done.lines.iter().any(|line| matches!(line, Line::Finding(_)));
    Ok(ExitCode::from(u8::from(found)))
}

/// The lines of all files.
fn all(files: &[PathBuf]) -> Result<Vec<Line>> {
    let mut lines = Vec::new();
    for file in files {
        ensure!(file.exists(), "{}: there is no such file", file.display());
        lines.extend(tally::read(file)?.0);
    }
    Ok(lines)
}

fn tell(finding: &Finding) {
    let text = finding.text.replace('\n', "\n    ");
    say(&format!("{}: {}\n    {text}\n    {}\n", finding.kind, finding.what, finding.command));
}

/// The kinds whose names begin as one of `only`; all without any.
fn chosen(only: &[String]) -> Result<Vec<&'static dyn Kind>> {
    let begins = |name: &str, only: &str| name.starts_with(only) && kinds::find(only).is_none();
    let is_chosen = |name: &str| only.is_empty() || only.iter().any(|only| begins(name, only));
    let exact = |name: &str| only.iter().any(|only| only == name);
    // The whole name of a kind means that one alone, even where others begin with it.
    let mut all: Vec<_> = only.iter().filter_map(|name| kinds::find(name)).collect();
    let others = kinds::ALL.iter().filter(|kind| !exact(kind.name()) && is_chosen(kind.name()));
    all.extend(others.copied());
    ensure!(!all.is_empty(), "--only {}: there is no such kind; see --list", only.join(" --only "));
    Ok(all)
}

/// Those of `kinds` that can run here; where `are_all` are meant, the others are named.
fn able(kinds: Vec<&'static dyn Kind>, are_all: bool) -> Result<Vec<&'static dyn Kind>> {
    let mut able = Vec::new();
    for kind in kinds {
        match kind.lacks() {
            Some(why) if are_all => eprintln!("brickwalk-trials: {} is left out: {why}", kind.name()),
            Some(why) => bail!("{}: {why}", kind.name()),
            None => able.push(kind),
        }
    }
    Ok(able)
}

/// The program `brickwalk`.
fn program(words: &Words) -> Result<PathBuf> {
    let own = std::env::current_exe().context("this program cannot be found")?;
    let beside = own.parent().unwrap_or(Path::new(".")).join("brickwalk");
    let program = words.program.clone().unwrap_or(beside);
    Ok(std::path::absolute(program)?)
}
