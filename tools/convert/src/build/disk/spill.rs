//! Files of records on the scratch disk: blocks of records, each with its number and a checksum. Any thread appends;
//! what is read is checked.

use crate::build::error::BuildError;
use bytemuck::Pod;
use std::fs::{File, OpenOptions};
use std::io;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use xxhash_rust::xxh3::xxh3_64;

/// Most records of a block that [`Spill::append_all`] writes.
pub(crate) const BLOCK_RECORDS: usize = 1 << 13;

/// Number of records and checksum of a block.
type Head = [u64; 2];

/// A file of records that grows.
#[derive(Debug)]
pub(crate) struct Spill<T> {
    path: PathBuf,
    length: AtomicU64,
    records: PhantomData<fn(T)>,
}

impl<T: Pod> Spill<T> {
    /// The file `path`, of which the first `length` bytes count.
    pub fn at(path: PathBuf, length: u64) -> Self {
        Self { path, length: AtomicU64::new(length), records: PhantomData }
    }

    /// Bytes appended.
    pub fn length(&self) -> u64 {
        self.length.load(Ordering::Relaxed)
    }

    /// Appends records as one block.
    pub fn append(&self, records: &[T]) -> Result<(), BuildError> {
        if records.is_empty() {
            return Ok(());
        }
        let records: &[u8] = bytemuck::cast_slice(records);
        let head: Head = [(records.len() / size_of::<T>()) as u64, xxh3_64(records)];
        let head: &[u8] = bytemuck::cast_slice(&head);
        let bytes = (head.len() + records.len()) as u64;
        let offset = self.length.fetch_add(bytes, Ordering::Relaxed);
        // Opened each time: there may be more files than a process may keep open.
        let written = OpenOptions::new().write(true).create(true).truncate(false).open(&self.path).and_then(|file| {
            write_at(&file, head, offset)?;
            write_at(&file, records, offset + head.len() as u64)
        });
        written.map_err(|source| BuildError::Scratch { path: self.path.clone(), action: "write", source })
    }

    /// Appends records in blocks of moderate size.
    pub fn append_all(&self, records: &[T]) -> Result<(), BuildError> {
        records.chunks(BLOCK_RECORDS).try_for_each(|block| self.append(block))
    }

    /// Reads what was appended.
    pub fn blocks(&self) -> Result<Blocks<T>, BuildError> {
        Blocks::open(&self.path, self.length())
    }

    /// The error that the file is not what it should be.
    pub fn damaged(&self) -> BuildError {
        BuildError::ScratchDamaged { path: self.path.clone() }
    }

    /// Removes the file; if that fails it goes with its folder.
    pub fn remove(self) {
        let _ = std::fs::remove_file(&self.path);
    }
}

/// The blocks of a file, in the order in which they lie there.
#[derive(Debug)]
pub(crate) struct Blocks<T> {
    path: PathBuf,
    file: Option<File>,
    /// Offsets and numbers of records.
    index: Vec<(u64, u64)>,
    records: PhantomData<fn() -> T>,
}

impl<T: Pod> Blocks<T> {
    fn open(path: &Path, length: u64) -> Result<Self, BuildError> {
        let mut blocks = Self { path: path.to_owned(), file: None, index: Vec::new(), records: PhantomData };
        if length == 0 {
            return Ok(blocks);
        }
        let file = File::open(path).map_err(|source| blocks.error(source))?;
        let mut offset = 0;
        while offset < length {
            let mut head: Head = [0; 2];
            read_at(&file, bytemuck::cast_slice_mut(&mut head), offset).map_err(|source| blocks.error(source))?;
            let end = head[0].checked_mul(size_of::<T>() as u64).and_then(|bytes| bytes.checked_add(offset + 16));
            let Some(end) = end.filter(|&end| end <= length && head[0] > 0) else { return Err(blocks.damaged()) };
            blocks.index.push((offset, head[0]));
            offset = end;
        }
        blocks.file = Some(file);
        Ok(blocks)
    }

    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.index.len()
    }

    /// Number of records.
    pub fn records(&self) -> u64 {
        self.index.iter().map(|(_, count)| count).sum()
    }

    /// Appends the records of a block to `records`.
    pub fn read(&self, block: usize, records: &mut Vec<T>) -> Result<(), BuildError> {
        let (offset, count) = self.index[block];
        let Some(file) = &self.file else { return Err(self.damaged()) };
        let before = records.len();
        records.resize(before + count as usize, T::zeroed());
        let mut head: Head = [0; 2];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut records[before..]);
        let read = read_at(file, bytemuck::cast_slice_mut(&mut head), offset);
        read.and_then(|()| read_at(file, bytes, offset + 16)).map_err(|source| self.error(source))?;
        if head == [count, xxh3_64(bytes)] { Ok(()) } else { Err(self.damaged()) }
    }

    fn error(&self, source: io::Error) -> BuildError {
        BuildError::Scratch { path: self.path.clone(), action: "read", source }
    }

    fn damaged(&self) -> BuildError {
        BuildError::ScratchDamaged { path: self.path.clone() }
    }
}

/// Writes all bytes at an offset, whatever the file's position.
#[cfg(unix)]
fn write_at(file: &File, bytes: &[u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::write_all_at(file, bytes, offset)
}

/// Fills a buffer from an offset, whatever the file's position.
#[cfg(unix)]
fn read_at(file: &File, bytes: &mut [u8], offset: u64) -> io::Result<()> {
    std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset)
}

#[cfg(windows)]
fn write_at(file: &File, mut bytes: &[u8], mut offset: u64) -> io::Result<()> {
    while !bytes.is_empty() {
        let written = std::os::windows::fs::FileExt::seek_write(file, bytes, offset)?;
        if written == 0 {
            return Err(io::ErrorKind::WriteZero.into());
        }
        (bytes, offset) = (&bytes[written..], offset + written as u64);
    }
    Ok(())
}

#[cfg(windows)]
fn read_at(file: &File, mut bytes: &mut [u8], mut offset: u64) -> io::Result<()> {
    while !bytes.is_empty() {
        let read = std::os::windows::fs::FileExt::seek_read(file, bytes, offset)?;
        if read == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        (bytes, offset) = (&mut bytes[read..], offset + read as u64);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_come_back_and_damage_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let spill = Spill::<u64>::at(folder.path().join("a"), 0);
        spill.append(&[1, 2, 3]).unwrap();
        spill.append(&[]).unwrap();
        spill.append(&[4]).unwrap();
        let checkpoint = spill.length();
        spill.append(&[5]).unwrap();
        let read = |spill: &Spill<u64>| {
            let blocks = spill.blocks()?;
            let mut all = Vec::new();
            (0..blocks.len()).try_for_each(|block| blocks.read(block, &mut all))?;
            assert_eq!(all.len() as u64, blocks.records());
            Ok::<_, BuildError>(all)
        };
        assert_eq!(read(&spill).unwrap(), [1, 2, 3, 4, 5]);
        // What was appended after a checkpoint does not count, and is overwritten.
        let spill = Spill::<u64>::at(folder.path().join("a"), checkpoint);
        assert_eq!(read(&spill).unwrap(), [1, 2, 3, 4]);
        spill.append_all(&[7; 3]).unwrap();
        assert_eq!(read(&spill).unwrap(), [1, 2, 3, 4, 7, 7, 7]);

        let mut bytes = std::fs::read(folder.path().join("a")).unwrap();
        for at in [0, 9, 17, 41, bytes.len() - 1] {
            bytes[at] ^= 1;
            std::fs::write(folder.path().join("a"), &bytes).unwrap();
            assert!(
                matches!(read(&spill), Err(BuildError::ScratchDamaged { .. } | BuildError::Scratch { .. })),
                "{at}"
            );
            bytes[at] ^= 1;
        }
        std::fs::write(folder.path().join("a"), &bytes).unwrap();
        assert!(read(&spill).is_ok());
    }
}
