//! Trials with consecutive seeds, made by worker processes that are watched: one that hangs is ended, one that dies is
//! followed by another.

use crate::board::{Board, Slot};
use crate::kind::Kind;
use crate::worker::Told;
use anyhow::{Context, Result, ensure};
use std::io::{BufRead, BufReader, Read};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

/// How often a worker is looked at.
const GLANCE: Duration = Duration::from_millis(20);

/// Most characters of what a dying worker said.
const MOST_CHARS: usize = 1000;

/// How trials are made.
#[derive(Clone, Debug)]
pub struct How {
    /// The program `brickwalk`.
    pub program: PathBuf,
    /// Where to leave what trials make.
    pub keep: Option<PathBuf>,
    /// A defect to plant, where this program and that are built with the feature `planted`.
    pub plant: Option<String>,
}

/// What became of trials.
#[derive(Clone, Debug, Default)]
pub struct Slice {
    /// The seed after the last one tried.
    pub to: u64,
    /// Trials that came through.
    pub passed: u64,
    /// Trials that were stopped.
    pub stopped: u64,
    /// Trials that found something.
    pub found: u64,
    /// Seconds.
    pub seconds: f64,
    /// Most bytes that a trial took.
    pub peak_bytes: u64,
    /// What was found.
    pub findings: Vec<Told>,
}

/// Trials of one step of a search for the first finding: few, as a kind may be slow.
const STEP: u64 = 16;

/// The first finding of a kind from seed `from` on, in at most `count` trials and about `seconds`.
///
/// # Errors
/// As of [`run`].
pub fn first(kind: &dyn Kind, how: &How, from: u64, count: u64, seconds: f64) -> Result<Option<Told>> {
    let start = Instant::now();
    let (mut at, mut step) = (from, STEP);
    let end = from.saturating_add(count);
    while at < end && start.elapsed().as_secs_f64() < seconds {
        let slice = run(kind, how, at, step.min(end - at), seconds - start.elapsed().as_secs_f64())?;
        if let Some(told) = slice.findings.into_iter().min_by_key(|told| told.seed) {
            return Ok(Some(told));
        }
        (at, step) = (slice.to, step.saturating_mul(2));
    }
    Ok(None)
}

/// Makes trials of a kind from seed `from` on, at most `count`; none begins after `seconds`.
///
/// # Errors
/// Workers cannot be started, or end before their first trial.
pub fn run(kind: &dyn Kind, how: &How, from: u64, count: u64, seconds: f64) -> Result<Slice> {
    let start = Instant::now();
    let end = from.saturating_add(count);
    let mut slice = Slice { to: from, ..Slice::default() };
    let folder = scratch()?;
    let mut number = 0;
    loop {
        let left = seconds - start.elapsed().as_secs_f64();
        if slice.to >= end || (left <= 0.0 && number > 0) {
            break;
        }
        let own = folder.path().join(number.to_string());
        number += 1;
        std::fs::create_dir_all(&own)?;
        worker(kind, how, &own, (end, left.max(0.0)), &mut slice)?;
        // What a dead worker left, and its children wrote.
        std::fs::remove_dir_all(&own)?;
    }
    slice.seconds = start.elapsed().as_secs_f64();
    Ok(slice)
}

/// A folder in memory, where there is such a place.
fn scratch() -> Result<tempfile::TempDir> {
    let mut builder = tempfile::Builder::new();
    builder.prefix("brickwalk-trials-");
    let memory = std::path::Path::new("/dev/shm");
    let made = builder.tempdir_in(memory).or_else(|_| builder.tempdir());
    made.context("cannot make a temporary folder")
}

/// Runs one worker to its end, and adds what it did.
fn worker(
    kind: &dyn Kind,
    how: &How,
    own: &std::path::Path,
    (end, seconds): (u64, f64),
    slice: &mut Slice,
) -> Result<()> {
    let file = own.join("board");
    let board = Board::create(&file)?;
    let folder = own.join("work");
    std::fs::create_dir(&folder)?;
    let mut child = command(kind, how, slice.to, end, seconds, [&file, &folder])?;
    let out = child.stdout.take().context("no output of a worker")?;
    let told = std::thread::spawn(move || {
        let lines = BufReader::new(out).lines().map_while(Result::ok);
        lines.filter_map(|line| serde_json::from_str::<Told>(&line).ok()).collect::<Vec<_>>()
    });
    let err = child.stderr.take().context("no output of a worker")?;
    let said = std::thread::spawn(move || {
        let mut text = Vec::new();
        // What is beyond the limit is read as well, so that the worker does not wait.
        let mut err = BufReader::new(err);
        let _ = err.by_ref().take(1 << 20).read_to_end(&mut text);
        let _ = std::io::copy(&mut err, &mut std::io::sink());
        String::from_utf8_lossy(&text).into_owned()
    });
    let ended = watch(&mut child, &board, kind.limits().seconds)?;
    // The whole group: a worker's own children hold its pipes.
    // SAFETY: a plain call; the group is the child's own.
    unsafe { libc::kill(-(child.id() as i32), libc::SIGKILL) };
    slice.findings.extend(told.join().unwrap_or_default());
    let said = said.join().unwrap_or_default();
    slice.passed += board.get(Slot::Passed);
    slice.stopped += board.get(Slot::Stopped);
    slice.found += board.get(Slot::Found);
    slice.peak_bytes = slice.peak_bytes.max(board.get(Slot::Peak));
    let seed = board.get(Slot::Seed);
    let fault = match ended {
        Ended::Status(status) if status.success() => None,
        Ended::Status(status) => Some(death(status, &said)),
        Ended::Hung => Some("hang".to_owned()),
    };
    let Some(what) = fault else {
        slice.to = seed.max(slice.to);
        return Ok(());
    };
    ensure!(board.get(Slot::Busy) == 1, "a worker of {} ended before a trial: {what}: {said}", kind.name());
    let text = match what.as_str() {
        "hang" => format!("it took more than {} seconds", kind.limits().seconds),
        _ => said.chars().take(MOST_CHARS).collect(),
    };
    slice.found += 1;
    slice.findings.push(Told { seed, what, text });
    slice.to = seed + 1;
    Ok(())
}

/// Starts a worker in a process group of its own.
fn command(
    kind: &dyn Kind,
    how: &How,
    from: u64,
    end: u64,
    seconds: f64,
    [board, folder]: [&PathBuf; 2],
) -> Result<Child> {
    let mut command = Command::new(std::env::current_exe().context("this program cannot be found")?);
    command.arg("work").args(["--kind", kind.name()]).args(["--from", &from.to_string()]);
    command.args(["--count", &(end - from).to_string()]).args(["--seconds", &seconds.to_string()]);
    command.arg("--board").arg(board).arg("--folder").arg(folder).arg("--program").arg(&how.program);
    if let Some(keep) = &how.keep {
        command.arg("--keep").arg(keep);
    }
    if let Some(plant) = &how.plant {
        command.env("BRICKWALK_PLANTED", plant);
    }
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).process_group(0);
    #[cfg(target_os = "linux")]
    // SAFETY: the closure makes one system call, which may be made between fork and exec.
    unsafe {
        command.pre_exec(|| {
            libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL);
            Ok(())
        });
    }
    command.spawn().context("a worker cannot be started")
}

enum Ended {
    Status(ExitStatus),
    Hung,
}

/// Waits for a worker, and ends it if it is at one trial for more than `seconds`.
fn watch(child: &mut Child, board: &Board, seconds: f64) -> Result<Ended> {
    let mut last = (board.get(Slot::Seed), board.get(Slot::Busy));
    let mut since = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Ended::Status(status));
        }
        let now = (board.get(Slot::Seed), board.get(Slot::Busy));
        if now != last {
            (last, since) = (now, Instant::now());
        }
        if since.elapsed().as_secs_f64() > seconds {
            child.kill()?;
            child.wait()?;
            return Ok(Ended::Hung);
        }
        std::thread::sleep(GLANCE);
    }
}

/// What a worker died of.
fn death(status: ExitStatus, said: &str) -> String {
    let why = [("memory allocation of", "abort for want of memory"), ("overflowed its stack", "overflow of the stack")];
    match (why.iter().find(|(words, _)| said.contains(words)), status.signal(), status.code()) {
        (Some((_, what)), ..) => (*what).to_owned(),
        (None, Some(signal), _) => format!("signal {signal}"),
        (None, None, code) => format!("exit with status {}", code.unwrap_or(-1)),
    }
}
