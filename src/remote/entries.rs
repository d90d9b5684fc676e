//! The disk cache: one file a span, named by a hash of the scene, its version and the span.
//!
//! Processes share the folder. A file `usage` holds the bytes of all entries; whoever changes it has it locked. Room is
//! reserved there before an entry is written, so that all together stay within the limit. An entry is written under
//! another name, which its writer has locked, and renamed: a name that nobody has locked is left of a process that was
//! killed. The time of change of an entry is that of its last use. What is read is checked by a checksum, as a machine
//! that lost power may leave anything.

use super::disk::DiskCache;
use super::names;
use crate::settings::sizes::human_bytes;
use bricks::planted::{self, Defect};
use std::fs::{File, TryLockError};
use std::io::{self, ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, SystemTime};
use xxhash_rust::xxh3::{xxh3_64, xxh3_128};

/// Begins every entry; then the length and the checksum of what follows, 8 bytes each.
const MAGIC: [u8; 8] = *b"BWSPAN1\n";
const HEAD_BYTES: usize = 24;
/// Entries take whole blocks of a file system.
const BLOCK_BYTES: u64 = 4096;
/// How long another process is waited for.
const PATIENCE: Duration = Duration::from_secs(2);
/// Digits of the name of an entry, and of the folder that it is in.
const DIGITS: usize = 32;
const FOLDER_DIGITS: usize = 2;
/// Ends names of entries that are being written.
const UNFINISHED: &str = "part";

/// The entries of one version of a scene.
pub(super) struct Entries {
    cache: DiskCache,
    /// What scene, and which version.
    scene: String,
    /// Writing failed: nothing more is kept.
    is_off: AtomicBool,
    written: AtomicU64,
}

/// Bytes that an entry of so many bytes takes.
fn room(bytes: usize) -> u64 {
    ((HEAD_BYTES + bytes) as u64).next_multiple_of(BLOCK_BYTES)
}

impl Entries {
    /// Of the scene and version that `scene` tells.
    pub fn new(cache: DiskCache, scene: String) -> Self {
        Self { cache, scene, is_off: AtomicBool::new(false), written: AtomicU64::new(0) }
    }

    fn file(&self, start: u64, end: u64) -> PathBuf {
        let name = format!("{:032x}", xxh3_128(format!("{} {start} {end}", self.scene).as_bytes()));
        self.cache.folder.join(name.get(..FOLDER_DIGITS).unwrap_or_default()).join(name)
    }

    /// A span, if it is there and whole.
    pub fn get(&self, start: u64, end: u64) -> Option<Vec<u8>> {
        let path = self.file(start, end);
        let mut file = File::open(&path).ok()?;
        let mut head = [0; HEAD_BYTES];
        let mut bytes = Vec::new();
        // No more than it should have, and a byte that shows that there is more.
        let most = if planted::is(Defect::EntryLength) { u64::MAX } else { (end - start).saturating_add(1) };
        let read = file.read_exact(&mut head).and_then(|()| (&file).take(most).read_to_end(&mut bytes));
        let expected = header(&bytes);
        if read.is_err() || head != expected || bytes.len() as u64 != end - start {
            self.drop_entry(start, end);
            return None;
        }
        // Only the order of eviction depends on it.
        let _ = file.set_modified(SystemTime::now());
        Some(bytes)
    }

    /// Removes an entry that is of no use.
    pub fn drop_entry(&self, start: u64, end: u64) {
        // Its room is found to be free the next time that entries are counted.
        let _ = std::fs::remove_file(self.file(start, end));
    }

    /// Keeps a span. A cache that cannot be written to is told once, and is no reason to fail.
    pub fn put(&self, start: u64, bytes: &[u8]) {
        let path = self.file(start, start + bytes.len() as u64);
        if self.is_off.load(Ordering::Relaxed) || room(bytes.len()) > self.cache.bytes || path.exists() {
            return;
        }
        if let Err(error) = self.write(&path, bytes)
            && !self.is_off.swap(true, Ordering::Relaxed)
        {
            let folder = self.cache.folder.display();
            names::tell(format!("{folder}: the disk cache cannot be written to and keeps nothing more: {error}"));
        }
    }

    fn write(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        let folder = path.parent().unwrap_or(Path::new("."));
        std::fs::create_dir_all(folder)?;
        if !self.reserve(room(bytes.len()))? {
            return Ok(());
        }
        // Its own for every writer.
        let number = self.written.fetch_add(1, Ordering::Relaxed);
        let own = format!("{}-{:x}-{number:x}.{UNFINISHED}", std::process::id(), std::ptr::from_ref(self) as usize);
        let unfinished = path.with_extension(own);
        let mut file = File::create_new(&unfinished)?;
        // Without it another process takes this for a leaving: then the renaming fails.
        let _ = file.try_lock();
        let written = file.write_all(&header(bytes)).and_then(|()| file.write_all(bytes));
        match written.and_then(|()| std::fs::rename(&unfinished, path)) {
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
            Err(error) => {
                let _ = std::fs::remove_file(&unfinished);
                Err(error)
            }
            Ok(()) => Ok(()),
        }
    }

    /// Makes room, and notes that it is taken. Whether there is room: not if other processes are slow.
    fn reserve(&self, bytes: u64) -> io::Result<bool> {
        let name = self.cache.folder.join("usage");
        let mut file = File::options().read(true).write(true).create(true).truncate(false).open(name)?;
        let start = std::time::Instant::now();
        loop {
            match file.try_lock() {
                Ok(()) => break,
                Err(TryLockError::WouldBlock) if start.elapsed() < PATIENCE => {
                    std::thread::sleep(Duration::from_millis(1));
                }
                Err(TryLockError::WouldBlock) => return Ok(false),
                // Some file systems have no locks: then the limit is kept as well as can be.
                Err(TryLockError::Error(_)) => break,
            }
        }
        let mut noted = [0; 8];
        let used = file.read_exact(&mut noted).map(|()| u64::from_le_bytes(noted));
        let used = match used {
            Ok(used) if used.saturating_add(bytes) <= self.cache.bytes => used,
            // More than one entry's room, so that entries are not counted for every one.
            _ => self.trim((self.cache.bytes - self.cache.bytes / 10).min(self.cache.bytes - bytes))?,
        };
        file.rewind()?;
        file.write_all(&used.saturating_add(bytes).to_le_bytes())?;
        Ok(used.saturating_add(bytes) <= self.cache.bytes)
    }

    /// Removes what was not used for longest until no more than `most` bytes are left, and what killed processes left;
    /// returns the bytes left.
    fn trim(&self, most: u64) -> io::Result<u64> {
        let (mut used, mut entries) = (0, Vec::new());
        for folder in std::fs::read_dir(&self.cache.folder)?.flatten() {
            if !is_hexadecimal(&folder.file_name().to_string_lossy(), FOLDER_DIGITS) {
                continue;
            }
            for entry in std::fs::read_dir(folder.path()).into_iter().flatten().flatten() {
                let (name, path) = (entry.file_name(), entry.path());
                let name = name.to_string_lossy();
                let (digits, ending) = name.split_once('.').unwrap_or((&name, ""));
                let (true, Ok(metadata)) = (is_hexadecimal(digits, DIGITS), entry.metadata()) else { continue };
                if ending.is_empty() {
                    let bytes = metadata.len().next_multiple_of(BLOCK_BYTES);
                    used += bytes;
                    entries.push((metadata.modified().unwrap_or(SystemTime::UNIX_EPOCH), bytes, path));
                } else if ending.ends_with(UNFINISHED) {
                    match File::open(&path).map(|file| file.try_lock()) {
                        Ok(Ok(())) => drop(std::fs::remove_file(&path)),
                        _ => used += metadata.len().next_multiple_of(BLOCK_BYTES),
                    }
                }
            }
        }
        entries.sort_unstable();
        for (_, bytes, path) in entries {
            if used <= most {
                break;
            }
            if std::fs::remove_file(path).is_ok() {
                used -= bytes;
            }
        }
        tracing::info!("disk cache: {} of {}", human_bytes(used), human_bytes(self.cache.bytes));
        Ok(used)
    }
}

/// What an entry of these bytes begins with.
fn header(bytes: &[u8]) -> [u8; HEAD_BYTES] {
    let mut header = [0; HEAD_BYTES];
    let numbers = [u64::from_le_bytes(MAGIC), bytes.len() as u64, xxh3_64(bytes)];
    for (slot, byte) in header.iter_mut().zip(numbers.into_iter().flat_map(u64::to_le_bytes)) {
        *slot = byte;
    }
    header
}

fn is_hexadecimal(name: &str, digits: usize) -> bool {
    name.len() == digits && name.bytes().all(|byte| byte.is_ascii_hexdigit())
}
