//! What a process needs to know when it ends before its time, as for want of memory: which temporary files and folders
//! it has, and whether whoever asked for memory can do without.

use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// The temporary files and folders of this process.
static ALL: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A temporary file or folder, noted until this is dropped.
#[derive(Debug)]
pub struct Temporary(PathBuf);

impl Temporary {
    /// Notes `path`.
    pub fn note(path: &Path) -> Self {
        ALL.lock().unwrap_or_else(PoisonError::into_inner).push(path.into());
        Self(path.into())
    }

    /// Removes all that are noted, of a process that ends now. What cannot be removed stays.
    pub fn remove_all() {
        // Whoever holds the list may be the thread that asks.
        let Ok(mut all) = ALL.try_lock() else { return };
        for path in all.drain(..) {
            let _ = std::fs::remove_file(&path).or_else(|_| std::fs::remove_dir_all(&path));
        }
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        let mut all = ALL.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(at) = all.iter().rposition(|path| *path == self.0) {
            all.swap_remove(at);
        }
    }
}

thread_local! {
    static CAN_FAIL: Cell<bool> = const { Cell::new(false) };
}

/// Gives `values` room for exactly so many more; whether there is that much memory.
pub fn reserve<T>(values: &mut Vec<T>, count: usize) -> bool {
    CAN_FAIL.set(true);
    let is_there = values.try_reserve_exact(count).is_ok();
    CAN_FAIL.set(false);
    is_there
}

/// Whether this thread asks for memory that it can do without.
pub fn can_fail() -> bool {
    CAN_FAIL.get()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_noted_is_removed_and_what_was_dropped_stays() {
        let folder = tempfile::tempdir().unwrap();
        let [file, tree, kept] = ["file", "tree", "kept"].map(|name| folder.path().join(name));
        std::fs::create_dir(&tree).unwrap();
        for path in [&file, &tree.join("inner"), &kept] {
            std::fs::write(path, b"x").unwrap();
        }
        let noted = [&file, &tree].map(|path| Temporary::note(path));
        drop(Temporary::note(&kept));
        Temporary::remove_all();
        assert!(!file.exists() && !tree.exists() && kept.exists());
        drop(noted);
    }

    #[test]
    fn memory_that_is_not_there_is_no_end() {
        let mut bytes: Vec<u8> = Vec::new();
        assert!(reserve(&mut bytes, 10) && bytes.capacity() == 10);
        assert!(!reserve(&mut bytes, isize::MAX as usize - 10));
        assert!(!can_fail());
    }
}
