//! The scratch folder of a conversion that does not fit in memory.

use super::journal::Journal;
use super::spill::Spill;
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
    is_kept: bool,
    _noted: Temporary,
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

/// Removes what an earlier conversion left in `path`, or with `resume` opens it.
///
/// # Errors
/// What is there is not of an earlier conversion.
pub(crate) fn earlier(path: &Path, resume: bool) -> Result<Option<(Scratch, Journal)>, BuildError> {
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
                let scratch = Scratch { path: path.to_owned(), is_kept: true, _noted: Temporary::note(path) };
                return Ok(Some((scratch, Journal::open(path.join(JOURNAL))?)));
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
    /// Makes the folder with an empty journal.
    pub fn create(path: PathBuf) -> Result<(Self, Journal), BuildError> {
        fs::create_dir_all(&path).map_err(|source| BuildError::Scratch {
            path: path.clone(),
            action: "create",
            source,
        })?;
        let scratch = Self { _noted: Temporary::note(&path), path, is_kept: false };
        let journal = Journal::create(scratch.path.join(JOURNAL))?;
        Ok((scratch, journal))
    }

    /// A file of the folder of which the first `length` bytes count.
    pub fn spill<T: bytemuck::Pod>(&self, name: &str, length: u64) -> Spill<T> {
        Spill::at(self.path.join(name), length)
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
