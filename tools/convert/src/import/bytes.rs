//! Runs of bytes that are read on demand: pieces of files, and what had to be decoded, in an unnamed temporary file.
//!
//! Nothing is mapped and no file is read whole, so memory does not grow with the input.

use crate::progress::Progress;
use bricks::ending;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::SystemTime;
use xxhash_rust::xxh3::Xxh3;

/// Bytes that are read at once where a whole file is run through.
pub(super) const BLOCK: usize = 1 << 20;

/// A run of bytes in a file.
#[derive(Clone, Debug)]
pub(super) struct Bytes {
    store: Store,
    offset: u64,
    length: u64,
}

#[derive(Clone, Debug)]
enum Store {
    /// Opened for each run of reads: a scene may have more files than a process may have open.
    Path(Arc<Path>),
    /// The temporary file.
    Spool(Arc<File>),
}

impl Bytes {
    /// Number of bytes.
    pub fn len(&self) -> u64 {
        self.length
    }

    /// The bytes from `start` to `end` of these, if within.
    pub fn slice(&self, start: u64, end: u64) -> Option<Self> {
        (start <= end && end <= self.length).then(|| Self {
            store: self.store.clone(),
            offset: self.offset + start,
            length: end - start,
        })
    }

    /// Ready to be read.
    pub fn open(&self) -> io::Result<Reader> {
        let file = match &self.store {
            Store::Path(path) => Arc::new(File::open(path)?),
            Store::Spool(file) => file.clone(),
        };
        Ok(Reader { file, offset: self.offset, length: self.length })
    }

    /// All of them, for what must be in memory at once.
    pub fn read(&self) -> Result<Vec<u8>, String> {
        let length = usize::try_from(self.length).map_err(|_| "is larger than memory".to_owned())?;
        let reader = self.open().map_err(|e| e.to_string())?;
        let mut bytes = Vec::new();
        if !ending::reserve(&mut bytes, length) {
            return Err("is larger than memory".into());
        }
        bytes.resize(length, 0);
        reader.read_at(0, &mut bytes).map_err(|e| e.to_string())?;
        Ok(bytes)
    }

    /// Adds all of them to `hash`; fails when the import of `spool` is to stop.
    pub fn hash(&self, spool: &Spool, hash: &mut Xxh3) -> io::Result<()> {
        let mut stream = self.stream(spool)?;
        loop {
            let block = stream.fill_buf()?;
            let n = block.len();
            if n == 0 {
                return Ok(());
            }
            hash.update(block);
            stream.consume(n);
        }
    }

    /// Runs through them from the first to the last; fails when the import of `spool` is to stop.
    pub fn stream(&self, spool: &Spool) -> io::Result<BufReader<Stream>> {
        let stream = Stream { reader: self.open()?, at: 0, hash: Xxh3::new(), progress: spool.progress.clone() };
        Ok(BufReader::with_capacity(BLOCK, stream))
    }
}

/// Reads a run of bytes, from any number of threads.
#[derive(Clone, Debug)]
pub(super) struct Reader {
    file: Arc<File>,
    offset: u64,
    length: u64,
}

impl Reader {
    /// Fills `out` with the bytes from `at` on; fails when there are not as many.
    pub fn read_at(&self, at: u64, out: &mut [u8]) -> io::Result<()> {
        if at.checked_add(out.len() as u64).is_none_or(|end| end > self.length) {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        read_exact_at(&self.file, self.offset + at, out)
    }
}

/// Reads a run of bytes in order, and hashes what it reads.
pub(super) struct Stream {
    reader: Reader,
    at: u64,
    hash: Xxh3,
    progress: Progress,
}

impl Stream {
    /// The hash of all the bytes; those that were not read yet are.
    pub fn finish(stream: BufReader<Self>) -> io::Result<Xxh3> {
        let mut stream = stream.into_inner();
        io::copy(&mut stream, &mut io::sink())?;
        Ok(stream.hash)
    }
}

impl Read for Stream {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        // Not `ErrorKind::Interrupted`, after which readers try again.
        self.progress.check().map_err(io::Error::other)?;
        let n = (out.len() as u64).min(self.reader.length - self.at) as usize;
        self.reader.read_at(self.at, &mut out[..n])?;
        self.hash.update(&out[..n]);
        self.at += n as u64;
        Ok(n)
    }
}

#[cfg(unix)]
fn read_exact_at(file: &File, offset: u64, out: &mut [u8]) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, out, offset)
}

#[cfg(unix)]
fn write_all_at(file: &File, offset: u64, bytes: &[u8]) -> io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, bytes, offset)
}

#[cfg(windows)]
fn read_exact_at(file: &File, mut offset: u64, mut out: &mut [u8]) -> io::Result<()> {
    while !out.is_empty() {
        match std::os::windows::fs::FileExt::seek_read(file, out, offset) {
            Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(n) => (offset, out) = (offset + n as u64, &mut out[n..]),
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(())
}

#[cfg(windows)]
fn write_all_at(file: &File, mut offset: u64, mut bytes: &[u8]) -> io::Result<()> {
    while !bytes.is_empty() {
        match std::os::windows::fs::FileExt::seek_write(file, bytes, offset) {
            Ok(n) => (offset, bytes) = (offset + n as u64, &bytes[n..]),
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(())
}

/// An unnamed temporary file that holds what was decoded; made when it is first written to, gone when nothing refers to
/// it.
#[derive(Debug, Default)]
pub(super) struct Spool {
    /// Where it is made; `None`: the system's folder for temporary files.
    folder: Option<PathBuf>,
    progress: Progress,
    file: OnceLock<Result<Arc<File>, String>>,
    length: AtomicU64,
    looked_for: Mutex<Vec<FileState>>,
}

/// A file that an import looked for, as it was then.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileState {
    /// Where.
    pub path: PathBuf,
    /// Bytes, and when they were changed last; `None`: it was not there.
    pub found: Option<(u64, SystemTime)>,
}

impl FileState {
    /// The file at `path` as it is now.
    pub fn now(path: &Path) -> Self {
        let found = std::fs::metadata(path).ok();
        let found = found.and_then(|found| Some((found.len(), found.modified().ok()?)));
        Self { path: path.into(), found }
    }
}

impl Spool {
    /// A spool in `folder` for an import that ends early if `progress` says so.
    pub fn new(folder: Option<PathBuf>, progress: Progress) -> Self {
        Self { folder, progress, ..Self::default() }
    }

    /// All of the regular file at `path`; devices and pipes, which may never end, are refused.
    pub fn file(&self, path: &Path) -> Result<Bytes, String> {
        self.looked_for.lock().unwrap_or_else(PoisonError::into_inner).push(FileState::now(path));
        let metadata = std::fs::metadata(path).map_err(|e| e.to_string())?;
        if !metadata.is_file() {
            return Err("not a regular file".into());
        }
        Ok(Bytes { store: Store::Path(path.into()), offset: 0, length: metadata.len() })
    }

    /// The files that were looked for so far.
    pub fn looked_for(&self) -> Vec<FileState> {
        self.looked_for.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The progress of the import.
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// Appends `bytes`; the error names the folder.
    pub fn add(&self, bytes: &[u8]) -> Result<Bytes, String> {
        let folder = || self.folder.clone().unwrap_or_else(std::env::temp_dir);
        let describe =
            |e: io::Error| format!("cannot write a temporary file in {}: {e}", super::error::show(&folder()));
        let file = self.file.get_or_init(|| tempfile::tempfile_in(folder()).map(Arc::new).map_err(describe));
        let file = file.as_ref().map_err(String::clone)?;
        let length = bytes.len() as u64;
        let offset = self.length.fetch_add(length, Ordering::Relaxed);
        write_all_at(file, offset, bytes).map_err(describe)?;
        Ok(Bytes { store: Store::Spool(file.clone()), offset, length })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_stay_within_their_bytes() {
        let spool = Spool::default();
        spool.add(b"before").unwrap();
        let bytes = spool.add(b"0123456789").unwrap();
        spool.add(b"after").unwrap();
        let part = bytes.slice(2, 8).unwrap().slice(1, 4).unwrap();
        assert_eq!(part.read().unwrap(), b"345");
        assert!(bytes.slice(0, 11).is_none() && part.slice(0, 4).is_none() && part.slice(3, 2).is_none());
        let reader = part.open().unwrap();
        let mut out = [0; 2];
        assert!(reader.read_at(2, &mut out).is_err() && reader.read_at(u64::MAX, &mut out).is_err());
        reader.read_at(1, &mut out).unwrap();
        assert_eq!(&out, b"45");
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let spool = Spool::new(Some("/nonexistent/folder".into()), Progress::hidden());
        assert!(spool.add(b"a").unwrap_err().contains("/nonexistent/folder"));
    }
}
