//! Files that appear complete or not at all: written under a temporary name in the same folder and renamed.

use std::fs::{File, OpenOptions, TryLockError};
use std::io;
use std::path::Path;
use tempfile::{NamedTempFile, TempPath};

/// The folder of `file`.
pub fn folder(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A temporary file that [`publish`] can give the name `file`: `.NAME.tmp`, for this process alone. What a process left
/// there that was killed is overwritten.
pub fn temporary(file: &Path) -> io::Result<NamedTempFile> {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let path = std::path::absolute(folder(file).join(format!(".{name}.tmp")))?;
    loop {
        let opened = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path)?;
        match opened.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(io::Error::new(io::ErrorKind::ResourceBusy, "another process is writing it"));
            }
            Err(TryLockError::Error(error)) => return Err(error),
        }
        // The process that held the lock may have renamed or removed the file meanwhile.
        if is_same(&opened, &path) {
            opened.set_len(0)?;
            return Ok(NamedTempFile::from_parts(opened, TempPath::try_from_path(path)?));
        }
    }
}

#[cfg(unix)]
fn is_same(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |metadata: std::fs::Metadata| (metadata.dev(), metadata.ino());
    match (file.metadata(), std::fs::metadata(path)) {
        (Ok(file), Ok(path)) => identity(file) == identity(path),
        _ => false,
    }
}

/// Where open files cannot be renamed or removed, the name stays with the file.
#[cfg(not(unix))]
fn is_same(_file: &File, _path: &Path) -> bool {
    true
}

/// Gives a file that has been written its name.
pub fn publish(temporary: NamedTempFile, file: &Path) -> io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        temporary.as_file().set_permissions(std::fs::Permissions::from_mode(0o644))?;
    }
    temporary.as_file().sync_all()?;
    temporary.persist(file).map_err(|e| e.error)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    #[test]
    fn what_was_left_is_overwritten_and_what_is_in_use_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.json");
        std::fs::write(folder.path().join(".a.json.tmp"), b"left by a process that was killed").unwrap();
        let mut first = temporary(&file).unwrap();
        assert_eq!(temporary(&file).unwrap_err().kind(), io::ErrorKind::ResourceBusy);
        first.write_all(b"whole").unwrap();
        publish(first, &file).unwrap();
        assert_eq!(std::fs::read(&file).unwrap(), b"whole");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        drop(temporary(&file).unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "dropped: nothing is left");
    }
}
