//! Shards: files on the scratch disk, each made by one task. A shard holds blocks of records with labels, then an index
//! of them and what else its task has to say. It appears whole or not at all, and what is read of it is checked.
//!
//! | what | bytes |
//! | --- | --- |
//! | blocks, in any order | records as they lie in memory |
//! | index | per block four words: label, offset, bytes, checksum |
//! | facts | words |
//! | end | six words: magic, conversion, blocks, words of facts, checksum of index and facts, checksum of these five |

use crate::build::error::BuildError;
use bricks::Span;
use bytemuck::Pod;
use std::fs::{self, File};
use std::io;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use tempfile::NamedTempFile;
use xxhash_rust::xxh3::xxh3_64;

/// Most records of a block that [`ShardWriter::append_all`] writes.
pub(crate) const BLOCK_RECORDS: usize = 1 << 13;

/// First word of the end of a shard.
const MAGIC: u64 = u64::from_le_bytes(*b"bw-shard");

/// Words of an entry of the index.
const ENTRY_WORDS: usize = 4;

/// Words of the end.
const END_WORDS: usize = 6;

/// Ending of the name of a shard that is being written.
const UNFINISHED: &str = ".tmp";

/// A block of a shard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Block {
    label: u64,
    span: Span,
}

/// Blocks so far.
#[derive(Debug, Default)]
struct Contents {
    length: u64,
    blocks: Vec<Block>,
}

/// A shard that is being written. Any thread appends. Dropped, it leaves nothing.
#[derive(Debug)]
pub(crate) struct ShardWriter {
    path: PathBuf,
    conversion: u64,
    file: NamedTempFile,
    contents: Mutex<Contents>,
}

impl ShardWriter {
    /// Starts the shard `path` of a conversion.
    pub fn create(path: PathBuf, conversion: u64) -> Result<Self, BuildError> {
        let folder = path.parent().unwrap_or(Path::new("."));
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(".");
        let mut builder = tempfile::Builder::new();
        builder.prefix(&name).suffix(UNFINISHED);
        // The permissions of an ordinary new file: workers may run under other accounts.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let file = builder.tempfile_in(folder);
        let file = file.map_err(|source| BuildError::Scratch { path: path.clone(), action: "create", source })?;
        Ok(Self { path, conversion, file, contents: Mutex::default() })
    }

    /// Appends records as one block; none make no block.
    pub fn append<T: Pod>(&self, label: u64, records: &[T]) -> Result<Span, BuildError> {
        let bytes: &[u8] = bytemuck::cast_slice(records);
        if bytes.is_empty() {
            return Ok(Span::default());
        }
        let checksum = xxh3_64(bytes);
        let span = {
            let mut contents = self.contents.lock().unwrap_or_else(PoisonError::into_inner);
            let span = Span { offset: contents.length, bytes: bytes.len() as u64, checksum };
            contents.length += span.bytes;
            contents.blocks.push(Block { label, span });
            span
        };
        write_at(self.file.as_file(), bytes, span.offset).map_err(|source| self.error(source))?;
        Ok(span)
    }

    /// Appends records in blocks of moderate size.
    pub fn append_all<T: Pod>(&self, label: u64, records: &[T]) -> Result<(), BuildError> {
        records.chunks(BLOCK_RECORDS).try_for_each(|block| self.append(label, block).map(drop))
    }

    /// Gives the shard its name, with what its task has to say. If it is `shared` with other machines, it lies on the
    /// disk before it has its name.
    pub fn finish(self, facts: &[u64], shared: bool) -> Result<(), BuildError> {
        let Contents { length, blocks } = &*self.contents.lock().unwrap_or_else(PoisonError::into_inner);
        let mut words = Vec::with_capacity(blocks.len() * ENTRY_WORDS + facts.len() + END_WORDS);
        for Block { label, span } in blocks {
            words.extend([*label, span.offset, span.bytes, span.checksum]);
        }
        words.extend(facts);
        let end =
            [MAGIC, self.conversion, blocks.len() as u64, facts.len() as u64, xxh3_64(bytemuck::cast_slice(&words))];
        words.extend(end);
        words.push(xxh3_64(bytemuck::cast_slice(&end)));
        let file = self.file.as_file();
        let written = write_at(file, bytemuck::cast_slice(&words), *length)
            .and_then(|()| if shared { file.sync_all() } else { Ok(()) });
        written.map_err(|source| self.error(source))?;
        let named = self.file.persist(&self.path).map(drop).map_err(|failure| failure.error);
        named.map_err(|source| BuildError::Scratch { path: self.path.clone(), action: "name", source })
    }

    fn error(&self, source: io::Error) -> BuildError {
        BuildError::Scratch { path: self.path.clone(), action: "write", source }
    }
}

/// A finished shard: its index and facts.
#[derive(Debug)]
pub(crate) struct Shard {
    path: PathBuf,
    blocks: Vec<Block>,
    facts: Vec<u64>,
}

impl Shard {
    /// Reads the index of the shard `path` of a conversion.
    ///
    /// # Errors
    /// It is missing, damaged or of another conversion ([`BuildError::ScratchDamaged`]); the system refuses it.
    pub fn open(path: PathBuf, conversion: u64) -> Result<Self, BuildError> {
        match Self::read_index(&path, conversion) {
            Ok(Some((blocks, facts))) => Ok(Self { path, blocks, facts }),
            Ok(None) => Err(BuildError::ScratchDamaged { path }),
            Err(source) if is_damage(&source) => Err(BuildError::ScratchDamaged { path }),
            Err(source) => Err(BuildError::Scratch { path, action: "read", source }),
        }
    }

    /// The blocks and facts; `None` if they are not those of a shard of the conversion.
    fn read_index(path: &Path, conversion: u64) -> io::Result<Option<(Vec<Block>, Vec<u64>)>> {
        let file = File::open(path)?;
        let length = file.metadata()?.len();
        let mut end = [0u64; END_WORDS];
        let Some(end_offset) = length.checked_sub(size_of_val(&end) as u64) else { return Ok(None) };
        read_at(&file, bytemuck::cast_slice_mut(&mut end), end_offset)?;
        let [magic, owner, blocks, facts, checksum, own] = end;
        if magic != MAGIC || owner != conversion || xxh3_64(bytemuck::cast_slice(&end[..5])) != own {
            return Ok(None);
        }
        let count = blocks.checked_mul(ENTRY_WORDS as u64).and_then(|words| words.checked_add(facts));
        let start = count.and_then(|words| end_offset.checked_sub(words.checked_mul(8)?));
        let (Some(count), Some(start)) = (count, start) else { return Ok(None) };
        let mut words = vec![0u64; count as usize];
        read_at(&file, bytemuck::cast_slice_mut(&mut words), start)?;
        if xxh3_64(bytemuck::cast_slice(&words)) != checksum {
            return Ok(None);
        }
        let facts = words.split_off(blocks as usize * ENTRY_WORDS);
        let block = |entry: &[u64]| Block {
            label: entry[0],
            span: Span { offset: entry[1], bytes: entry[2], checksum: entry[3] },
        };
        Ok(Some((words.chunks_exact(ENTRY_WORDS).map(block).collect(), facts)))
    }

    /// What the task has to say.
    pub fn facts(&self) -> &[u64] {
        &self.facts
    }

    /// Opens it to read its blocks.
    pub fn reader(&self) -> Result<ShardReader<'_>, BuildError> {
        let file = File::open(&self.path).map_err(|source| self.error(source))?;
        Ok(ShardReader { shard: self, file })
    }

    /// Whether all its blocks are what was written.
    ///
    /// # Errors
    /// They are not; the system refuses it.
    pub fn verify(&self) -> Result<(), BuildError> {
        let reader = self.reader()?;
        let mut bytes = Vec::new();
        self.blocks.iter().try_for_each(|block| {
            bytes.clear();
            reader.read::<u8>(block.span, &mut bytes)
        })
    }

    /// The places of the blocks with a label, in the order in which they were appended.
    pub fn spans(&self, label: u64) -> impl Iterator<Item = Span> {
        self.blocks.iter().filter(move |block| block.label == label).map(|block| block.span)
    }

    /// The error that the file is not what it should be.
    pub fn damaged(&self) -> BuildError {
        BuildError::ScratchDamaged { path: self.path.clone() }
    }

    fn error(&self, source: io::Error) -> BuildError {
        match is_damage(&source) {
            true => self.damaged(),
            false => BuildError::Scratch { path: self.path.clone(), action: "read", source },
        }
    }
}

/// Reads the blocks of a shard; any thread may.
#[derive(Debug)]
pub(crate) struct ShardReader<'a> {
    shard: &'a Shard,
    file: File,
}

impl ShardReader<'_> {
    /// Appends the records of a block to `records`.
    pub fn read<T: Pod>(&self, span: Span, records: &mut Vec<T>) -> Result<(), BuildError> {
        let before = records.len();
        records.resize(before + span.bytes as usize / size_of::<T>(), T::zeroed());
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut records[before..]);
        if bytes.len() as u64 != span.bytes {
            return Err(self.shard.damaged());
        }
        read_at(&self.file, bytes, span.offset).map_err(|source| self.shard.error(source))?;
        if xxh3_64(bytes) == span.checksum { Ok(()) } else { Err(self.shard.damaged()) }
    }
}

/// Records of one kind that several shards hold, block by block.
#[derive(Debug)]
pub(crate) struct Blocks<T> {
    shards: Vec<Shard>,
    /// Shards of the blocks and places in them.
    index: Vec<(u32, Span)>,
    records: PhantomData<fn() -> T>,
}

impl<T: Pod> Blocks<T> {
    /// All blocks of the shards, in order.
    pub fn of(shards: Vec<Shard>) -> Self {
        let spans = |(shard, blocks): (u32, &Shard)| blocks.spans(0).map(|span| (shard, span)).collect::<Vec<_>>();
        let index = (0u32..).zip(&shards).flat_map(spans).collect();
        Self { shards, index, records: PhantomData }
    }

    /// Number of blocks.
    pub fn len(&self) -> usize {
        self.index.len()
    }

    /// Number of records.
    pub fn records(&self) -> u64 {
        self.index.iter().map(|(_, span)| span.bytes / size_of::<T>() as u64).sum()
    }

    /// Appends the records of a block to `records`.
    pub fn read(&self, block: usize, records: &mut Vec<T>) -> Result<(), BuildError> {
        let (shard, span) = self.index[block];
        // Opened each time: there may be more shards than files that a process may keep open.
        self.shards[shard as usize].reader()?.read(span, records)
    }

    /// The error that a block, or the first shard, is not what it should be.
    pub fn damaged(&self, block: usize) -> BuildError {
        let shard = self.index.get(block).map_or(0, |(shard, _)| *shard as usize);
        let path = self.shards.get(shard).map_or_else(PathBuf::new, |shard| shard.path.clone());
        BuildError::ScratchDamaged { path }
    }
}

/// Whether an error says that bytes are missing, not that the system refuses them.
fn is_damage(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::UnexpectedEof)
}

/// Removes a shard; if that fails it goes with its folder.
pub(crate) fn remove(path: &Path) {
    let _ = fs::remove_file(path);
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

    const CONVERSION: u64 = 77;

    fn read(path: &Path) -> Result<Vec<u64>, BuildError> {
        let blocks = Blocks::<u64>::of(vec![Shard::open(path.to_owned(), CONVERSION)?]);
        let mut all = Vec::new();
        (0..blocks.len()).try_for_each(|block| blocks.read(block, &mut all))?;
        assert_eq!(all.len() as u64, blocks.records());
        Ok(all)
    }

    #[test]
    fn blocks_come_back_and_damage_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let shard = ShardWriter::create(path.clone(), CONVERSION).unwrap();
        shard.append(0, &[1u64, 2, 3]).unwrap();
        shard.append::<u64>(0, &[]).unwrap();
        shard.append(1, &[9u64]).unwrap();
        shard.append_all(0, &[4u64]).unwrap();
        assert!(matches!(read(&path), Err(BuildError::ScratchDamaged { .. })), "it has no name yet");
        shard.finish(&[5, 6], true).unwrap();
        assert_eq!(read(&path).unwrap(), [1, 2, 3, 4]);
        let shard = Shard::open(path.clone(), CONVERSION).unwrap();
        shard.verify().unwrap();
        assert_eq!(shard.facts(), [5, 6]);
        assert_eq!(shard.spans(1).count(), 1);
        assert!(matches!(Shard::open(path.clone(), CONVERSION + 1), Err(BuildError::ScratchDamaged { .. })));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing unfinished is left");

        let whole = fs::read(&path).unwrap();
        let damaged = |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            let shard = Shard::open(path.clone(), CONVERSION).and_then(|shard| shard.verify());
            matches!(shard, Err(BuildError::ScratchDamaged { .. }))
        };
        for at in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 1;
            assert!(damaged(&bytes), "byte {at}");
            assert!(damaged(&whole[..at]), "{at} bytes");
        }
        assert!(!damaged(&whole));
    }

    #[test]
    fn what_is_not_finished_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let shard = ShardWriter::create(folder.path().join("a"), CONVERSION).unwrap();
        shard.append(0, &[1u8; 100]).unwrap();
        drop(shard);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
