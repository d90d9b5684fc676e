//! What references of a file may lead to: files in its folder, or in one around it that is named, or below that.

use super::bytes::{Bytes, Spool};
use super::error::{ImportError, show};
use super::uri::{self, Target};
use std::io;
use std::path::{Path, PathBuf};

/// Where the references of a file may lead.
#[derive(Debug)]
pub(super) struct Reach {
    /// The folder that they may not leave.
    root: PathBuf,
    /// The folder of the file, below `root`.
    from: PathBuf,
    /// `root` without symbolic links; then none may lead out of it. `None`: nobody named it, and links are followed.
    bound: Option<PathBuf>,
}

impl Reach {
    /// That of the file at `path`: its own folder, or `within`.
    ///
    /// # Errors
    /// The file is not in or below `within`, or one of the folders cannot be read.
    pub fn of(path: &Path, within: Option<&Path>) -> Result<Self, ImportError> {
        let own = path.parent().unwrap_or(Path::new(""));
        let Some(root) = within else {
            return Ok(Self { root: own.into(), from: PathBuf::new(), bound: None });
        };
        let refused = |problem: String, remedy| {
            let place = format!("--within {}", show(root));
            ImportError::Content { file: show(path), place, problem, remedy }
        };
        let bound = without_links(root);
        let bound = bound.map_err(|e| refused(format!("cannot read the folder: {e}"), "name one that is there"))?;
        let unreadable = |e: io::Error| ImportError::Read { file: show(path), reason: e.to_string() };
        let from = without_links(own).map_err(unreadable)?;
        let Ok(from) = from.strip_prefix(&bound) else {
            return Err(refused("the file is not in it or below it".into(), "name a folder around the file"));
        };
        Ok(Self { root: root.into(), from: from.into(), bound: Some(bound) })
    }

    /// The file called `name` in the file's own folder, below the root.
    pub fn own(&self, name: impl AsRef<Path>) -> PathBuf {
        self.from.join(name)
    }

    /// What `uri` leads to, as [`uri::resolve`] has it.
    pub fn resolve(&self, uri: &str) -> Result<Target, &'static str> {
        uri::resolve(&self.from, uri)
    }

    /// Where the file `below` the root is.
    pub fn path(&self, below: &Path) -> PathBuf {
        self.root.join(below)
    }

    /// The name that records have for the file `below` the root: a path from the file's own folder where that holds it.
    pub fn name(&self, below: &Path) -> String {
        below.strip_prefix(&self.from).unwrap_or(below).to_string_lossy().into_owned()
    }

    /// The bytes of the file `below` the root.
    pub fn file(&self, below: &Path, spool: &Spool) -> Result<Bytes, String> {
        let path = self.path(below);
        let bytes = spool.file(&path)?;
        if let Some(bound) = &self.bound {
            let real = path.canonicalize().map_err(|e| e.to_string())?;
            if !real.starts_with(bound) {
                return Err(format!("a symbolic link leads out of {}", show(&self.root)));
            }
        }
        Ok(bytes)
    }
}

/// Where the folder is, all symbolic links followed.
fn without_links(folder: &Path) -> io::Result<PathBuf> {
    let here = folder.as_os_str().is_empty();
    let real = if here { Path::new(".") } else { folder }.canonicalize()?;
    if real.is_dir() { Ok(real) } else { Err(io::ErrorKind::NotADirectory.into()) }
}
