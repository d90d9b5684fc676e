//! Devices that have passed the start-up test of what traces rays. Most of the time of that test goes into compiling
//! what a session may not need, so a device that has passed is not asked again for a week: the same driver compiles the
//! same kernels of the same program to the same code. The short test of arithmetic runs each time.
//!
//! A mark is an empty file in the folder `probes` of the user's cache. Its name is a hash of the program's file, of the
//! device with its driver, and of what kernels are compiled for.

use crate::gpu::device::Gpu;
use crate::gpu::wgsl::Pages;
use crate::settings::folder;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};
use xxhash_rust::xxh3::xxh3_64;

/// How long a mark counts.
const VALID: Duration = Duration::from_secs(7 * 24 * 3600);

/// The mark of a device, for kernels that are compiled so; `None`: there is no place for it, or no saying which program
/// this is.
pub fn mark(gpu: &Gpu, pages: Pages, count: bool) -> Option<PathBuf> {
    let program = std::env::current_exe().ok()?;
    let file = std::fs::metadata(&program).ok()?;
    let changed = file.modified().ok()?.duration_since(SystemTime::UNIX_EPOCH).ok()?;
    let of = format!("{program:?} {} {changed:?} {:?} {pages:?} {count}", file.len(), gpu.info);
    Some(folder::cache()?.join("probes").join(format!("{:016x}", xxh3_64(of.as_bytes()))))
}

/// Whether a mark is there and counts.
pub fn is_valid(mark: &Path) -> bool {
    let written = std::fs::metadata(mark).and_then(|file| file.modified());
    written.is_ok_and(|written| written.elapsed().is_ok_and(|age| age < VALID))
}

/// Leaves a mark, and removes those that no longer count. Where it cannot be left the device is asked again.
pub fn leave(mark: &Path) {
    let Some(folder) = mark.parent() else { return };
    let _ = std::fs::create_dir_all(folder);
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if !is_valid(&entry.path()) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
    let _ = std::fs::write(mark, []);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_count_for_a_week() {
        let folder = tempfile::tempdir().unwrap();
        let [mark, other] = ["a", "b"].map(|name| folder.path().join("probes").join(name));
        assert!(!is_valid(&mark));
        leave(&mark);
        assert!(is_valid(&mark) && !is_valid(&other));
        let age = |days: u64| {
            let file = std::fs::File::options().write(true).open(&mark).unwrap();
            file.set_modified(SystemTime::now() - Duration::from_secs(days * 24 * 3600)).unwrap();
        };
        age(6);
        assert!(is_valid(&mark));
        age(8);
        assert!(!is_valid(&mark));
        leave(&other);
        assert!(is_valid(&other) && !mark.exists(), "old marks are removed");
        // A time to come is no time at which it was left.
        std::fs::File::options()
            .write(true)
            .open(&other)
            .unwrap()
            .set_modified(SystemTime::now() + Duration::from_secs(3600))
            .unwrap();
        assert!(!is_valid(&other));
    }

    #[test]
    fn marks_tell_kernels_and_devices_apart() {
        let Ok(gpu) = Gpu::open(Some("llvmpipe")) else {
            crate::skip::skip("no software Vulkan");
            return;
        };
        let pages =
            Pages { cache: 1, texels: 0, opacity: false, gloss: false, layers: false, levels: false, hides: false };
        let mut other = gpu.clone();
        other.info.driver_info = "newer".into();
        let all = [
            mark(&gpu, pages, false),
            mark(&gpu, pages, true),
            mark(&gpu, Pages { cache: 2, ..pages }, false),
            mark(&other, pages, false),
        ];
        let all: std::collections::BTreeSet<PathBuf> = all.into_iter().map(|mark| mark.unwrap()).collect();
        assert_eq!(all.len(), 4);
        assert!(all.contains(&mark(&gpu, pages, false).unwrap()), "the same again");
    }
}
