//! Files that appear complete or not at all, and the one file that grows by whole lines.

use super::leftovers;
use anyhow::{Context, Result};
use bricks::ending::Temporary;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Creates a folder and its parents; one that exists is kept with what it holds.
///
/// # Errors
/// It cannot be created, or something that is no folder has its name.
pub fn create_folder(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{}: cannot create this folder; choose another with -o", folder.display()))
}

/// A folder that nobody else of this program writes to meanwhile.
#[derive(Debug)]
pub struct Owned {
    file: File,
    path: PathBuf,
}

impl Owned {
    /// Takes a folder, which exists.
    ///
    /// # Errors
    /// Another process has it; it cannot be written to.
    pub fn take(folder: &Path) -> Result<Self> {
        let path = folder.join(".brickwalk-lock");
        let file = File::options().create(true).truncate(false).write(true).open(&path);
        let file = file.with_context(|| cannot_write(&path))?;
        match file.try_lock() {
            Err(std::fs::TryLockError::WouldBlock) => anyhow::bail!(
                "{}: another brickwalk writes to this folder; wait for it, or choose another with -o",
                folder.display()
            ),
            // Some file systems have no locks: then nobody is kept out.
            Ok(()) | Err(std::fs::TryLockError::Error(_)) => Ok(Self { file, path }),
        }
    }
}

impl Drop for Owned {
    fn drop(&mut self) {
        // Removed while it is held: whoever opens it next makes a new one.
        let _ = std::fs::remove_file(&self.path);
        let _ = self.file.unlock();
    }
}

/// The folder that a file is in.
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A file that is written under a temporary name in its final folder and renamed when it is finished: until then a
/// reader sees the old file, then all of the new one. Dropped before that, it leaves no trace.
///
/// The contents are not synced to the disk: after a power cut an image may have to be rendered again.
#[derive(Debug)]
pub struct Replacement {
    out: BufWriter<NamedTempFile>,
    path: PathBuf,
    noted: Temporary,
}

impl Replacement {
    /// Starts a file that will be `path`.
    ///
    /// # Errors
    /// The folder does not exist or cannot be written to, or the final name is that of a folder.
    pub fn create(path: &Path) -> Result<Self> {
        let mut builder = tempfile::Builder::new();
        let prefix = leftovers::prefix();
        builder.prefix(&prefix).suffix(leftovers::SUFFIX);
        #[cfg(unix)]
        {
            // Temporaries are private by default; the finished file has the permissions of any other new file.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        anyhow::ensure!(!path.is_dir(), "{}: this is a folder; choose the name of a file", path.display());
        leftovers::remove_from(folder_of(path));
        let temporary = builder.tempfile_in(folder_of(path)).with_context(|| cannot_write(path))?;
        // Where there are locks, other machines see by it that the file is in use.
        let _ = temporary.as_file().try_lock();
        let noted = Temporary::note(temporary.path());
        Ok(Self { out: BufWriter::with_capacity(1 << 20, temporary), path: path.into(), noted })
    }

    /// Appends `bytes`.
    ///
    /// # Errors
    /// The disk is full.
    pub fn push(&mut self, bytes: &[u8]) -> Result<()> {
        self.out.write_all(bytes).with_context(|| cannot_write(&self.path))
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// The disk is full, or the name has been taken by a folder.
    pub fn finish(self) -> Result<()> {
        let path = &self.path;
        let context = || cannot_write(path);
        let temporary = self.out.into_inner().map_err(std::io::IntoInnerError::into_error).with_context(context)?;
        temporary.persist(&self.path).map_err(|e| e.error).with_context(context)?;
        drop(self.noted);
        Ok(())
    }
}

fn cannot_write(path: &Path) -> String {
    format!("{}: cannot write this file; check its folder and the space left", path.display())
}

/// Writes a whole file as a [`Replacement`]. On an error the old file stays.
///
/// # Errors
/// As those of [`Replacement`], or `write` fails.
pub fn write_with(path: &Path, write: impl FnOnce(&mut BufWriter<NamedTempFile>) -> Result<()>) -> Result<()> {
    let mut file = Replacement::create(path)?;
    write(&mut file.out)?;
    file.finish()
}

/// [`write_with`] for contents in memory.
///
/// # Errors
/// As [`write_with`].
pub fn write(path: &Path, contents: &[u8]) -> Result<()> {
    write_with(path, |out| {
        out.write_all(contents).with_context(|| format!("{}: cannot write this file", path.display()))
    })
}

/// A file of JSON objects, one a line, that grows while a job runs: after every [`Self::push`] it is valid.
#[derive(Debug)]
pub struct JsonLines {
    file: File,
    name: String,
}

impl JsonLines {
    /// Starts an empty file; an old one of this name is emptied.
    ///
    /// # Errors
    /// It cannot be created.
    pub fn create(path: &Path) -> Result<Self> {
        let name = path.display().to_string();
        let file = File::create(path).with_context(|| format!("{name}: cannot write this file; check its folder"))?;
        Ok(Self { file, name })
    }

    /// Goes on with a file whose first `length` bytes are whole lines; what follows them is cut off.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn append(path: &Path, length: u64) -> Result<Self> {
        let name = path.display().to_string();
        let open = || {
            let file = File::options().append(true).open(path)?;
            file.set_len(length)?;
            Ok::<_, std::io::Error>(file)
        };
        let file = open().with_context(|| format!("{name}: cannot append to this file; check its permissions"))?;
        Ok(Self { file, name })
    }

    /// Appends one object as one line with one write, so that the line is whole when the process ends between two.
    /// Returns the line, newline included.
    ///
    /// # Errors
    /// The value does not serialise to JSON, or the disk is full.
    pub fn push(&mut self, row: &impl serde::Serialize) -> Result<String> {
        let mut line = serde_json::to_string(row).with_context(|| format!("{}: a record is not JSON", self.name))?;
        line.push('\n');
        self.file
            .write_all(line.as_bytes())
            .with_context(|| format!("{}: cannot append to this file; check the space left", self.name))?;
        Ok(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn replaces_whole_or_keeps_the_old() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        write(&path, b"old").unwrap();
        let failed = write_with(&path, |out| {
            out.write_all(b"half of the n")?;
            out.flush()?;
            // While it is written, the final name still holds the old contents.
            assert_eq!(std::fs::read(&path).unwrap(), b"old");
            anyhow::bail!("interrupted")
        });
        assert!(failed.is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["a.txt"], "no temporary is left");
        write(&path, b"new").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["a.txt"]);
    }

    #[test]
    fn errors_name_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("no/such/a.txt");
        assert!(format!("{:#}", write(&missing, b"x").unwrap_err()).contains("a.txt"));
        let taken = folder.path().join("folder");
        create_folder(&taken).unwrap();
        create_folder(&taken).unwrap();
        assert!(write(&taken, b"x").is_err());
        assert_eq!(names(folder.path()), ["folder"]);
        write(&folder.path().join("file"), b"x").unwrap();
        assert!(format!("{:#}", create_folder(&folder.path().join("file/sub")).unwrap_err()).contains("file/sub"));
    }

    #[cfg(unix)]
    #[test]
    fn finished_files_are_readable_as_any_new_file() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
        write(&ours, b"x").unwrap();
        std::fs::write(&plain, b"x").unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }

    #[test]
    fn lines_are_whole_after_every_push() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("records.jsonl");
        let mut lines = JsonLines::create(&path).unwrap();
        for i in 0..3 {
            let line = lines.push(&serde_json::json!({"frame": i, "pass": "primary\n"})).unwrap();
            assert!(line.ends_with("\"}\n"));
            let text = std::fs::read_to_string(&path).unwrap();
            assert!(text.ends_with('\n'));
            assert_eq!(text.lines().count(), i + 1);
            for line in text.lines() {
                serde_json::from_str::<serde_json::Value>(line).unwrap();
            }
        }
        JsonLines::create(&path).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"");
    }
}
