//! Temporary files that killed processes left: their names say whose they are, and the next process that writes to
//! their folder removes them.

use bricks::planted::{self, Defect};
use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};
use sysinfo::{Pid, ProcessesToUpdate, System};

/// Names of temporary files begin with this, the process's number and when it started, and end with [`SUFFIX`].
const PREFIX: &str = ".brickwalk-";
/// How they end.
pub const SUFFIX: &str = ".tmp";

/// Seconds that the start of a process may seem to move, as clocks are set.
const CLOCK_SECONDS: u64 = 2;

/// When a process started, seconds since 1970; `None`: there is no such process.
fn start_of(process: u32) -> Option<u64> {
    let pid = Pid::from_u32(process);
    let mut system = System::new();
    system.refresh_processes(ProcessesToUpdate::Some(&[pid]), true);
    system.process(pid).map(sysinfo::Process::start_time)
}

/// How the names of this process's temporary files begin.
pub fn prefix() -> String {
    static START: OnceLock<u64> = OnceLock::new();
    let process = std::process::id();
    format!("{PREFIX}{process}-{}-", START.get_or_init(|| start_of(process).unwrap_or(0)))
}

/// The process of a temporary file and when that started, by its name.
fn owner(name: &str) -> Option<(u32, u64)> {
    let mut parts = name.strip_prefix(PREFIX)?.strip_suffix(SUFFIX)?.split('-');
    Some((parts.next()?.parse().ok()?, parts.next()?.parse().ok()?))
}

/// Removes from `folder` the temporary files of processes that are no more, once in the life of this process. What
/// cannot be read or removed stays.
pub fn remove_from(folder: &Path) {
    static DONE: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    if !DONE.lock().unwrap_or_else(PoisonError::into_inner).insert(folder.into()) {
        return;
    }
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let Some((process, start)) = name.to_str().and_then(owner) else { continue };
        let is_alive = start_of(process).is_some_and(|found| found.abs_diff(start) <= CLOCK_SECONDS);
        // A process of another machine holds its lock.
        if !is_alive && !is_locked(&entry.path()) && !planted::is(Defect::Leftovers) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

fn is_locked(path: &Path) -> bool {
    let file = File::options().write(true).open(path);
    file.is_ok_and(|file| matches!(file.try_lock(), Err(TryLockError::WouldBlock)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_dead_processes_left_goes_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let mut child = std::process::Command::new("sleep").arg("60").spawn().unwrap();
        let start = start_of(child.id()).unwrap();
        let [alive, reused] = [start, start - 100].map(|start| format!("{PREFIX}{}-{start}-a{SUFFIX}", child.id()));
        let gone = format!("{PREFIX}4000000000-{start}-a{SUFFIX}");
        let locked = format!("{PREFIX}4000000001-{start}-a{SUFFIX}");
        let ours = format!("{}a{SUFFIX}", prefix());
        let others = [".brickwalk-lock", ".brickwalk-x-1-a.tmp", "a.tmp", ".brickwalk-4000000000-1-a.png"];
        for name in [&alive, &reused, &gone, &locked, &ours].into_iter().map(String::as_str).chain(others) {
            std::fs::write(at(name), b"x").unwrap();
        }
        let held = File::open(at(&locked)).unwrap();
        held.lock().unwrap();
        remove_from(folder.path());
        child.kill().unwrap();
        child.wait().unwrap();
        assert!(!at(&reused).exists() && !at(&gone).exists());
        for name in [&alive, &locked, &ours].into_iter().map(String::as_str).chain(others) {
            assert!(at(name).exists(), "{name}");
        }
    }
}
