//! The process that makes trials, one after the other. It may die of one: who started it looks at the [`Board`].

use crate::board::{Board, Slot};
use crate::kind::{Fault, Kind, Outcome, Trial};
use crate::kinds;
use crate::memory;
use anyhow::{Context, Result};
use clap::Args;
use serde::{Deserialize, Serialize};
use std::io::Write;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Memory beyond the limit of a kind at which a process gets no more. What takes more than the limit is found before.
const SPARE_BYTES: u64 = 1 << 30;

/// Address space of a process: far more than it may use, against what asks for all there is.
const ADDRESS_BYTES: u64 = 16 << 30;

/// Most characters of a text.
const MOST_CHARS: usize = 2000;

/// What a worker is told.
#[derive(Clone, Debug, Args)]
pub struct Work {
    /// The kind.
    #[arg(long)]
    pub kind: String,
    /// The first trial.
    #[arg(long)]
    pub from: u64,
    /// Most trials.
    #[arg(long)]
    pub count: u64,
    /// No trial begins after so many seconds.
    #[arg(long)]
    pub seconds: f64,
    /// The file of the board.
    #[arg(long)]
    pub board: PathBuf,
    /// An empty folder.
    #[arg(long)]
    pub folder: PathBuf,
    /// The program `brickwalk`.
    #[arg(long)]
    pub program: PathBuf,
    /// Where to leave what trials make.
    #[arg(long)]
    pub keep: Option<PathBuf>,
}

/// A finding as a worker tells it, a line of JSON.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Told {
    /// The trial.
    pub seed: u64,
    /// As of [`Fault`].
    pub what: String,
    /// As of [`Fault`].
    pub text: String,
}

/// Where the last panic was, and what it said.
static PANIC: Mutex<Option<Fault>> = Mutex::new(None);

/// Makes the trials that `work` says.
///
/// # Errors
/// There is no such kind; a file of its own cannot be written.
pub fn run(work: &Work) -> Result<()> {
    let kind = kinds::find(&work.kind).with_context(|| format!("{}: there is no such kind", work.kind))?;
    let board = Board::open(&work.board)?;
    bound(kind);
    std::panic::set_hook(Box::new(|info| {
        let at = info.location().map_or_else(String::new, |at| format!("{}:{}", short(at.file()), at.line()));
        let text = format!("{info}");
        let fault = Fault::new(&format!("panic at {at}"), text.chars().take(MOST_CHARS).collect::<String>());
        *PANIC.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(fault);
    }));
    // Trials run in the one thread of the pool that importers use, so that no trial waits for another thread.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(|| all(kind, work, &board))
}

fn all(kind: &dyn Kind, work: &Work, board: &Board) -> Result<()> {
    let start = Instant::now();
    let (own, shared) = (work.folder.join("own"), work.folder.join("shared"));
    std::fs::create_dir_all(&shared)?;
    let mut out = std::io::stdout();
    for seed in work.from..work.from.saturating_add(work.count) {
        if start.elapsed() > Duration::from_secs_f64(work.seconds) {
            break;
        }
        std::fs::create_dir_all(&own)?;
        board.set(Slot::Seed, seed);
        board.set(Slot::Busy, 1);
        let trial = Trial { seed, folder: &own, shared: &shared, program: &work.program, keep: work.keep.as_deref() };
        let ended = one(kind, &trial, board);
        empty(&own)?;
        match ended {
            Ok(Outcome::Passed) => board.count(Slot::Passed),
            Ok(Outcome::Stopped) => board.count(Slot::Stopped),
            Err(Fault { what, text }) => {
                board.count(Slot::Found);
                let line = serde_json::to_string(&Told { seed, what, text })? + "\n";
                out.write_all(line.as_bytes())?;
                out.flush()?;
            }
        }
        board.set(Slot::Busy, 0);
        board.set(Slot::Seed, seed + 1);
    }
    Ok(())
}

/// A trial, its panics caught and its memory measured.
fn one(kind: &dyn Kind, trial: &Trial, board: &Board) -> Result<Outcome, Fault> {
    let before = memory::begin();
    // What is half done is dropped with the call.
    let ended = catch_unwind(AssertUnwindSafe(|| kind.trial(trial)));
    let taken = memory::peak().saturating_sub(before) as u64;
    board.set(Slot::Peak, board.get(Slot::Peak).max(taken));
    let panic = PANIC.lock().unwrap_or_else(std::sync::PoisonError::into_inner).take();
    match ended {
        Err(_) => Err(panic.unwrap_or_else(|| Fault::new("panic", "a panic of which nothing is known"))),
        Ok(Ok(_)) if taken > kind.limits().bytes => {
            let text = format!("{taken} bytes were in use at once, of at most {}", kind.limits().bytes);
            Err(Fault::new("memory", text))
        }
        Ok(ended) => ended,
    }
}

/// Sets the limits of this process.
fn bound(kind: &dyn Kind) {
    memory::limit(kind.limits().bytes.saturating_add(SPARE_BYTES) as usize);
    // SAFETY: plain calls with valid arguments.
    unsafe {
        // No core files of thousands of crashes; and who dies takes its children along.
        let none = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
        libc::setrlimit(libc::RLIMIT_CORE, &raw const none);
        if !kind.name().starts_with("kills/") {
            let most = libc::rlimit { rlim_cur: ADDRESS_BYTES, rlim_max: ADDRESS_BYTES };
            libc::setrlimit(libc::RLIMIT_AS, &raw const most);
        }
    }
}

/// Removes what is in a folder.
fn empty(folder: &Path) -> Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        match entry.file_type()?.is_dir() {
            true => std::fs::remove_dir_all(entry.path())?,
            false => std::fs::remove_file(entry.path())?,
        }
    }
    Ok(())
}

/// A source file as people know it: below the workspace, or below the registry.
fn short(file: &str) -> &str {
    file.rsplit_once("/registry/src/").and_then(|(_, rest)| rest.split_once('/')).map_or(file, |(_, rest)| rest)
}
