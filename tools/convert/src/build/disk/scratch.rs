//! The scratch folder of a conversion that does not fit in memory.

use super::journal::Journal;
use super::shard::{self, Blocks, Shard, ShardWriter};
use crate::build::error::BuildError;
use crate::build::settings::BuildSettings;
use bricks::ending::Temporary;
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::xxh3_64;

/// Name of the journal in the folder.
const JOURNAL: &str = "journal";

/// A folder of files, removed when dropped unless it is to be continued from.
#[derive(Debug)]
pub(crate) struct Scratch {
    path: PathBuf,
    /// Which conversion its shards are of.
    conversion: u64,
    /// Whether other machines read it.
    is_shared: bool,
    is_kept: bool,
    _noted: Option<Temporary>,
}

/// The scratch folder for `output`.
pub(crate) fn path_for(output: &Path, settings: &BuildSettings) -> PathBuf {
    let target =
        fs::canonicalize(output).or_else(|_| std::path::absolute(output)).unwrap_or_else(|_| output.to_owned());
    let mut name = OsString::from(".");
    name.push(target.file_name().unwrap_or_default());
    match &settings.scratch {
        // Outputs of one name from several folders may share the disk.
        Some(folder) => {
            name.push(format!(".{:016x}.scratch", xxh3_64(target.as_os_str().as_encoded_bytes())));
            folder.join(name)
        }
        None => {
            name.push(".scratch");
            target.with_file_name(name)
        }
    }
}

/// Removes what an earlier conversion left in `path`, or with `resume` opens its journal.
///
/// # Errors
/// What is there is not of an earlier conversion.
pub(crate) fn earlier(path: &Path, resume: bool) -> Result<Option<Journal>, BuildError> {
    let error = |action, source| BuildError::Scratch { path: path.to_owned(), action, source };
    match fs::read_dir(path) {
        Err(failure) if failure.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(failure) => return Err(error("read", failure)),
        Ok(entries) => {
            let (is_journal, count) = (Journal::is_one(&path.join(JOURNAL)), entries.count());
            // One that was killed as it began left nothing, or a piece of the journal.
            let is_begun = count == 0 || (count == 1 && Journal::is_torn(&path.join(JOURNAL)));
            if !is_journal && !is_begun {
                return Err(BuildError::NotScratch { path: path.to_owned() });
            }
            if resume && is_journal {
                return Ok(Some(Journal::open(path.join(JOURNAL))?));
            }
        }
    }
    remove(path).map_err(|source| error("remove", source))?;
    Ok(None)
}

/// Removes a scratch folder. Its journal goes last: as long as anything is there, it tells what the folder is.
fn remove(path: &Path) -> io::Result<()> {
    for entry in fs::read_dir(path)? {
        let entry = entry?;
        if entry.file_name() != JOURNAL {
            fs::remove_file(entry.path())?;
        }
    }
    fs::remove_dir_all(path)
}

impl Scratch {
    /// Makes the folder of a conversion with an empty journal. If it is `is_shared`, other machines read it.
    pub fn create(path: PathBuf, conversion: u64, is_shared: bool) -> Result<(Self, Journal), BuildError> {
        fs::create_dir_all(&path).map_err(|source| BuildError::Scratch {
            path: path.clone(),
            action: "create",
            source,
        })?;
        let scratch = Self::of(path, conversion, is_shared);
        let journal = Journal::create(scratch.path.join(JOURNAL), is_shared)?;
        Ok((scratch, journal))
    }

    /// The folder of a conversion that is there.
    pub fn of(path: PathBuf, conversion: u64, is_shared: bool) -> Self {
        Self { _noted: Some(Temporary::note(&path)), path, conversion, is_shared, is_kept: false }
    }

    /// The folder of a conversion that another process leads, and the journal of its first `steps` steps. It is never
    /// removed.
    pub fn visit(path: PathBuf, steps: u64) -> Result<(Self, Journal), BuildError> {
        let journal = Journal::follow(path.join(JOURNAL), steps)?;
        Ok((Self { path, conversion: 0, is_shared: true, is_kept: true, _noted: None }, journal))
    }

    /// Says which conversion its shards are of.
    pub fn name(&mut self, conversion: u64) {
        self.conversion = conversion;
    }

    /// Which conversion its shards are of.
    pub fn conversion(&self) -> u64 {
        self.conversion
    }

    /// Starts a shard.
    pub fn write(&self, name: &str) -> Result<ShardWriter, BuildError> {
        ShardWriter::create(self.path.join(name), self.conversion)
    }

    /// Gives a shard its name, with what its task has to say.
    pub fn finish(&self, shard: ShardWriter, facts: &[u64]) -> Result<(), BuildError> {
        shard.finish(facts, self.is_shared)
    }

    /// Waits until the names of shards are on the disk, if other machines read them.
    pub fn settle(&self) -> Result<(), BuildError> {
        // Elsewhere folders cannot be opened.
        let is_due = self.is_shared && cfg!(unix);
        let synced = if is_due { fs::File::open(&self.path).and_then(|folder| folder.sync_all()) } else { Ok(()) };
        synced.map_err(|source| BuildError::Scratch { path: self.path.clone(), action: "sync", source })
    }

    /// Opens a shard.
    pub fn shard(&self, name: &str) -> Result<Shard, BuildError> {
        Shard::open(self.path.join(name), self.conversion)
    }

    /// The blocks of shards, one shard after the other.
    pub fn blocks<T: bytemuck::Pod>(&self, names: &[String]) -> Result<Blocks<T>, BuildError> {
        Ok(Blocks::of(names.iter().map(|name| self.shard(name)).collect::<Result<_, _>>()?))
    }

    /// Removes shards.
    pub fn remove(&self, names: &[String]) {
        names.iter().for_each(|name| shard::remove(&self.path.join(name)));
    }

    /// The error that a shard is not what it should be.
    pub fn damaged(&self, name: &str) -> BuildError {
        BuildError::ScratchDamaged { path: self.path.join(name) }
    }

    /// Whether the folder stays when this is dropped.
    pub fn keep(&mut self, is_kept: bool) {
        self.is_kept = is_kept;
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        if !self.is_kept {
            // The next conversion to the same file tries again.
            let _ = remove(&self.path);
        }
    }
}
