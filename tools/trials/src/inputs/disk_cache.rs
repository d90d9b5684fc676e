//! The disk cache of scenes by URL: a folder that other processes, or a machine that lost power, left in any state.

use crate::kind::{Fault, Kind, Limits, Outcome, Trial};
use crate::mutate::{Harm, bytes};
use crate::random::Random;
use brickwalk::remote::DiskCache;
use entries::Entries;
use std::io::Read;
use std::path::{Path, PathBuf};

// As the file calls what lies beside it.
mod disk {
    pub use brickwalk::remote::DiskCache;
}
mod names {
    /// What a person is told is not looked at here.
    pub fn tell(_: String) {}
}

#[allow(dead_code, missing_docs)]
#[path = "../../../../src/remote/entries.rs"]
mod entries;

/// Bytes of a block of a file system, which entries take whole.
const BLOCK: u64 = 4096;

/// Folders of entries.
pub struct DiskCaches;

impl Kind for DiskCaches {
    fn name(&self) -> &'static str {
        "inputs/disk-cache"
    }

    fn about(&self) -> &'static str {
        "Folders of a disk cache with harmed, cut, foreign and unfinished files: the right bytes or none"
    }

    fn limits(&self) -> Limits {
        Limits { seconds: 20.0, bytes: 64 << 20 }
    }

    fn trial(&self, trial: &Trial) -> Result<Outcome, Fault> {
        let mut random = Random::new(self.name(), trial.seed);
        let harm = Harm::of(trial.seed);
        let spans: Vec<Vec<u8>> = (0..random.within(1, 8))
            .map(|_| (0..random.within(1, 3 * BLOCK as usize)).map(|_| random.word() as u8).collect())
            .collect();
        let all: u64 = spans.iter().map(|span| (span.len() as u64 + 24).next_multiple_of(BLOCK)).sum();
        let limit = if random.chance(50) { 2 * all } else { all / 2 + BLOCK };
        let folder = trial.folder.join("cache");
        let cache = || Entries::new(DiskCache { folder: folder.clone(), bytes: limit }, "scene".into());
        let first = cache();
        keep(&first, &spans);
        if let Some(keep) = trial.keep {
            std::fs::write(keep.join("spans"), spans.concat()).map_err(failed)?;
        }
        let mut is_foreign = false;
        if harm.does(&mut random, 100) {
            for _ in 0..random.within(1, 3) {
                is_foreign |= change(&mut random, &folder)?;
            }
        }
        let second = if random.chance(50) { cache() } else { first };
        let missing = found(&second, &spans)?;
        if harm.is_off() && limit == 2 * all && missing > 0 {
            return Err(Fault::new("a sound entry is not there", format!("{missing} of {} are not", spans.len())));
        }
        // What is missing is fetched and kept again.
        keep(&second, &spans);
        found(&second, &spans)?;
        // What others wrote, or wrote into the file of sums, may be counted later.
        let used = sizes(&folder)?;
        if !is_foreign && used > limit {
            return Err(Fault::new("a disk cache is larger than its limit", format!("{used} of {limit} bytes")));
        }
        Ok(if missing == 0 { Outcome::Passed } else { Outcome::Stopped })
    }
}

fn failed(error: std::io::Error) -> Fault {
    Fault::new("set up", error.to_string())
}

/// Keeps spans, each behind the one before.
fn keep(cache: &Entries, spans: &[Vec<u8>]) {
    let mut start = 0;
    for span in spans {
        cache.put(start, span);
        start += span.len() as u64;
    }
}

/// How many of the spans are not there; those that are have to be right.
fn found(cache: &Entries, spans: &[Vec<u8>]) -> Result<usize, Fault> {
    let (mut start, mut missing) = (0, 0);
    for span in spans {
        let end = start + span.len() as u64;
        match cache.get(start, end) {
            Some(bytes) if bytes != *span => {
                return Err(Fault::new("wrong bytes of a disk cache", format!("{start} to {end}")));
            }
            Some(_) => {}
            None => missing += 1,
        }
        start = end;
    }
    Ok(missing)
}

/// Files below a folder, sorted.
fn files(folder: &Path) -> Result<Vec<PathBuf>, Fault> {
    let mut all = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(folder) = open.pop() {
        // Nothing was small enough to be kept.
        if !folder.exists() {
            continue;
        }
        for entry in std::fs::read_dir(folder).map_err(failed)?.flatten() {
            if entry.path().is_dir() {
                open.push(entry.path());
            } else {
                all.push(entry.path());
            }
        }
    }
    all.sort();
    Ok(all)
}

/// Bytes of entries, in blocks.
fn sizes(folder: &Path) -> Result<u64, Fault> {
    let entries = files(folder)?.into_iter().filter(|path| path.file_name() != Some("usage".as_ref()));
    let length = |path: PathBuf| path.metadata().map_or(0, |metadata| metadata.len());
    Ok(entries.map(|path| length(path).next_multiple_of(BLOCK)).sum())
}

/// Changes something in the folder; whether it is more than entries that are harmed or shorter.
fn change(random: &mut Random, folder: &Path) -> Result<bool, Fault> {
    let all = files(folder)?;
    let Some(path) = random.pick_from(&all) else { return Ok(false) };
    let mut content = Vec::new();
    let file = std::fs::File::open(path).map_err(failed)?;
    file.take(16 * BLOCK).read_to_end(&mut content).map_err(failed)?;
    let length = content.len();
    let is_usage = path.ends_with("usage");
    let other = |ending: &str| path.with_file_name(format!("0123456789abcdef0123456789abcdef{ending}"));
    // What cannot be done, as a file is a folder by now, is left.
    let _ = match random.below(8) {
        0 => std::fs::remove_file(path),
        1 => {
            content.truncate(random.below(length + 1));
            std::fs::write(path, content)
        }
        2 => {
            // Far more than an entry: only as much is read as it should have.
            std::fs::OpenOptions::new()
                .write(true)
                .open(path)
                .and_then(|file| file.set_len(1 << 32))
                .map_err(failed)?;
            return Ok(true);
        }
        3 => std::fs::write(other(".1-2-3.part"), content),
        4 => std::fs::write(other(""), content),
        5 => std::fs::remove_file(path).and_then(|()| std::fs::create_dir(path)),
        6 => std::fs::write(folder.join("notes"), content),
        _ => {
            bytes::change(random, &mut content);
            content.truncate(length);
            std::fs::write(path, content)
        }
    };
    Ok(is_usage || !files(folder)?.iter().all(|path| all.contains(path)))
}
