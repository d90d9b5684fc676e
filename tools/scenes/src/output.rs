//! Files that appear complete or not at all: written under a temporary name in the same folder and renamed.

use std::io;
use std::path::Path;
use tempfile::NamedTempFile;

/// The folder of `file`.
pub fn folder(file: &Path) -> &Path {
    match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A temporary file that [`publish`] can give the name `file`.
pub fn temporary(file: &Path) -> io::Result<NamedTempFile> {
    tempfile::Builder::new().prefix(".scene").suffix(".tmp").tempfile_in(folder(file))
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
