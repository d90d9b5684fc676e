//! The disk cache: its limit, what killed processes leave, folders that cannot be written to, several writers.

use crate::remote::disk::DiskCache;
use crate::remote::entries::Entries;
use crate::remote::names;
use std::fs::File;
use std::path::Path;

fn entries(folder: &Path, bytes: u64) -> Entries {
    Entries::new(DiskCache { folder: folder.into(), bytes }, "scene one".into())
}

/// Bytes of all files but the list, by whole blocks.
fn used(folder: &Path) -> u64 {
    let folders = std::fs::read_dir(folder).unwrap().flatten().filter(|entry| entry.path().is_dir());
    let files = folders.flat_map(|folder| std::fs::read_dir(folder.path()).unwrap().flatten());
    files.map(|file| file.metadata().unwrap().len().next_multiple_of(4096)).sum()
}

#[test]
fn what_was_not_used_for_longest_goes() {
    let folder = tempfile::tempdir().unwrap();
    let cache = entries(folder.path(), 100 * 4096);
    for start in 0..80 {
        cache.put(start, &[start as u8; 3000]);
    }
    // Times of change may be coarse.
    std::thread::sleep(std::time::Duration::from_millis(20));
    assert_eq!(cache.get(3, 3003), Some(vec![3; 3000]));
    for start in 80..130 {
        cache.put(start, &[start as u8; 3000]);
        assert!(used(folder.path()) <= 100 * 4096);
    }
    assert!(cache.get(3, 3003).is_some() && cache.get(129, 3129).is_some());
    assert!(cache.get(4, 3004).is_none());
    // The control: a cache with room for all keeps all.
    let folder = tempfile::tempdir().unwrap();
    let large = entries(folder.path(), 1 << 20);
    (0..130).for_each(|start| large.put(start, &[start as u8; 3000]));
    assert!((0..130).all(|start| large.get(start, start + 3000).is_some()));
    // Another version of a scene has entries of its own.
    let other = Entries::new(DiskCache { folder: folder.path().into(), bytes: 1 << 20 }, "scene two".into());
    assert!(other.get(3, 3003).is_none());
}

#[test]
fn leavings_of_killed_processes_go_and_other_files_stay() {
    let folder = tempfile::tempdir().unwrap();
    let cache = entries(folder.path(), 40 * 4096);
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir(at("ab")).unwrap();
    let dead = at("ab").join(format!("{}.1-2-3.part", "ab".repeat(16)));
    let alive = at("ab").join(format!("{}.4-5-6.part", "ab".repeat(16)));
    std::fs::write(&dead, [0; 5000]).unwrap();
    let writer = File::create(&alive).unwrap();
    writer.lock().unwrap();
    std::fs::write(at("mine.txt"), "mine").unwrap();
    std::fs::write(at("ab").join("mine.txt"), "mine").unwrap();
    // Filled twice, so that entries are counted.
    (0..80).for_each(|start| cache.put(start, &[1; 3000]));
    assert!(!dead.exists() && alive.exists() && at("mine.txt").exists() && at("ab").join("mine.txt").exists());
}

#[test]
fn several_writers_keep_the_limit_together() {
    let folder = tempfile::tempdir().unwrap();
    std::thread::scope(|scope| {
        for writer in 0..4u64 {
            let path = folder.path();
            scope.spawn(move || {
                // As another process has it.
                let cache = entries(path, 60 * 4096);
                for start in 0..100 {
                    let start = start + 1000 * (writer % 2);
                    cache.put(start, &[start as u8; 3000]);
                    if let Some(found) = cache.get(start, start + 3000) {
                        assert!(found.iter().all(|&byte| byte == start as u8));
                    }
                }
            });
        }
    });
    let used = used(folder.path());
    assert!(used <= 60 * 4096 && used > 20 * 4096, "{used}");
}

#[test]
fn a_folder_that_cannot_be_written_to_is_told_once() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a file");
    std::fs::write(&file, "").unwrap();
    let cache = entries(&file.join("cache"), 1 << 20);
    for start in 0..3 {
        cache.put(start, &[0; 10]);
        assert!(cache.get(start, start + 10).is_none());
    }
    let told = names::take_warnings();
    let own: Vec<_> = told.iter().filter(|line| line.contains("a file")).collect();
    assert!(own.len() == 1 && own[0].contains("keeps nothing more"), "{told:?}");
}
