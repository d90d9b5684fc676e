//! A file of named arrays of numbers, with a head in JSON. It is checked as a whole and appears as a whole.
//!
//! | bytes | what |
//! | --- | --- |
//! | 8 | `BWARRAY1` |
//! | 8 | u64, length of the head |
//! | | the head: an object, in which `arrays` says of each its name, its bytes, and those of its packed blocks |
//! | | the blocks: of every four bytes first all the first ones, then all the second, and so on, packed ([`pack`]) |
//! | 8 | u64, XXH3 of all before it |
//!
//! Numbers of one kind have much the same upper bytes, so that those lie together and pack well.

use super::atomic;
use anyhow::{Context, Result, anyhow, bail, ensure};
use bricks::pack::{pack, unpack};
use bricks::planted::{self, Defect};
use bytemuck::{AnyBitPattern, NoUninit};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::io::Write;
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

/// What such a file begins with.
const MAGIC: [u8; 8] = *b"BWARRAY1";
/// Bytes of a block before it is packed.
const BLOCK: usize = 4 << 20;
/// Bytes of what is no array: magic, length and checksum.
const FIXED: usize = 24;

/// An array, as the head tells of it.
#[derive(Clone, Debug, Deserialize, Serialize)]
struct Row {
    name: String,
    bytes: u64,
    packed: Vec<u64>,
}

/// Arrays that are going to be written.
#[derive(Debug, Default)]
pub struct Writing {
    rows: Vec<Row>,
    blocks: Vec<Vec<u8>>,
}

impl Writing {
    /// Adds an array.
    pub fn push<T: NoUninit>(&mut self, name: &str, values: &[T]) {
        let bytes: &[u8] = bytemuck::cast_slice(values);
        let blocks: Vec<Vec<u8>> = bytes.par_chunks(BLOCK).map(|block| pack(&planes(block))).collect();
        let packed = blocks.iter().map(|block| block.len() as u64).collect();
        self.rows.push(Row { name: name.into(), bytes: bytes.len() as u64, packed });
        self.blocks.extend(blocks);
    }

    /// Writes the file; `head` is what else its head says.
    ///
    /// # Errors
    /// The disk is full, or the folder cannot be written to.
    pub fn write(self, path: &Path, mut head: Map<String, Value>) -> Result<()> {
        head.insert("arrays".into(), serde_json::to_value(&self.rows)?);
        let head = serde_json::to_vec(&head)?;
        let length = (head.len() as u64).to_le_bytes();
        let pieces = [&MAGIC[..], &length, &head].into_iter().chain(self.blocks.iter().map(Vec::as_slice));
        atomic::write_with(path, |out| {
            let mut checksum = Xxh3::new();
            let context = || format!("{}: cannot write this file; check the space left", path.display());
            for piece in pieces {
                checksum.update(piece);
                out.write_all(piece).with_context(context)?;
            }
            out.write_all(&checksum.digest().to_le_bytes()).with_context(context)
        })
    }
}

/// Arrays that were read.
#[derive(Debug)]
pub struct Read {
    path: PathBuf,
    /// What the head says.
    pub head: Map<String, Value>,
    rows: Vec<Row>,
    bytes: Vec<u8>,
    /// Where blocks begin.
    first: usize,
}

impl Read {
    /// Reads a file and checks it.
    ///
    /// # Errors
    /// It cannot be read, it is no such file, or it is damaged.
    pub fn open(path: &Path) -> Result<Self> {
        let name = path.display();
        let bytes = std::fs::read(path).with_context(|| format!("{name}: cannot read this file"))?;
        let damaged = || anyhow!("{name}: this file is cut off or damaged");
        ensure!(bytes.len() >= FIXED && bytes.starts_with(&MAGIC), "{name}: this is no file of arrays");
        let (before, checksum) = bytes.split_last_chunk::<8>().ok_or_else(damaged)?;
        if xxh3_64(before) != u64::from_le_bytes(*checksum) {
            return Err(damaged());
        }
        let (length, rest) = before[MAGIC.len()..].split_first_chunk::<8>().ok_or_else(damaged)?;
        let length = usize::try_from(u64::from_le_bytes(*length)).map_err(|_| damaged())?;
        let head = match planted::is(Defect::PartHead) {
            true => &rest[..length],
            false => rest.get(..length).ok_or_else(damaged)?,
        };
        let mut head: Map<String, Value> = serde_json::from_slice(head).map_err(|_| damaged())?;
        let rows = head.remove("arrays").ok_or_else(damaged)?;
        let rows: Vec<Row> = serde_json::from_value(rows).map_err(|_| damaged())?;
        let first = bytes.len() - 8 - (rest.len() - length);
        Ok(Self { path: path.into(), head, rows, bytes, first })
    }

    /// The array of this name, which has `count` values, or none: of a name that there is not there are none.
    ///
    /// # Errors
    /// It has another number of values.
    pub fn array<T: AnyBitPattern + NoUninit>(&self, name: &str, count: usize) -> Result<Vec<T>> {
        let mut at = self.first;
        for row in &self.rows {
            let packed: u64 = row.packed.iter().sum();
            if row.name != name {
                at = at.saturating_add(packed as usize);
                continue;
            }
            if row.bytes == 0 {
                return Ok(Vec::new());
            }
            let bytes = count * size_of::<T>();
            if row.bytes != bytes as u64 || row.packed.len() != bytes.div_ceil(BLOCK) {
                bail!("{}: {name} has {} bytes, not {bytes}", self.path.display(), row.bytes);
            }
            let mut values: Vec<T> = vec![T::zeroed(); count];
            let out: &mut [u8] = bytemuck::cast_slice_mut(&mut values);
            let starts = row.packed.iter().scan(at, |at, &packed| {
                let start = *at;
                *at = at.saturating_add(packed as usize);
                Some(start..*at)
            });
            let starts: Vec<_> = starts.collect();
            let wrong = |why: &str| anyhow!("{}: {name} is damaged: {why}", self.path.display());
            out.par_chunks_mut(BLOCK).zip(starts).try_for_each(|(out, range)| {
                let block = self.bytes.get(range).ok_or_else(|| wrong("it is cut off"))?;
                let mut planar = vec![0; out.len()];
                unpack(block, &mut planar).map_err(|error| wrong(&error.to_string()))?;
                out.copy_from_slice(&words(&planar));
                Ok::<(), anyhow::Error>(())
            })?;
            return Ok(values);
        }
        Ok(Vec::new())
    }
}

/// Of every four bytes all the first ones, then all the second, the third, the fourth, and what is left.
fn planes(bytes: &[u8]) -> Vec<u8> {
    let (whole, rest) = bytes.split_at(bytes.len() / 4 * 4);
    let planes = (0..4).flat_map(|plane| whole.iter().skip(plane).step_by(4));
    planes.chain(rest).copied().collect()
}

/// What [`planes`] was made of.
fn words(planar: &[u8]) -> Vec<u8> {
    let count = planar.len() / 4;
    let (whole, rest) = planar.split_at(count * 4);
    (0..count).flat_map(|at| [0, 1, 2, 3].map(|plane| whole[plane * count + at])).chain(rest.iter().copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn file(path: &Path) {
        let mut writing = Writing::default();
        writing.push("points", &(0..700_000).map(|i| [f64::from(i), 0.5, -1.0]).collect::<Vec<_>>());
        writing.push("bytes", &[1u8, 2, 3, 4, 5, 6, 7]);
        writing.push("none", &[0u32; 0]);
        let head = json!({ "frame": 7 });
        writing.write(path, head.as_object().unwrap().clone()).unwrap();
    }

    #[test]
    fn arrays_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.part");
        file(&path);
        let read = Read::open(&path).unwrap();
        assert_eq!(read.head["frame"], 7);
        let points: Vec<[f64; 3]> = read.array("points", 700_000).unwrap();
        assert!(points.iter().enumerate().all(|(i, point)| *point == [i as f64, 0.5, -1.0]));
        assert_eq!(read.array::<u8>("bytes", 7).unwrap(), [1, 2, 3, 4, 5, 6, 7]);
        assert!(read.array::<u32>("none", 5).unwrap().is_empty() && read.array::<u32>("other", 5).unwrap().is_empty());
        assert!(read.array::<[f64; 3]>("points", 700_001).is_err());
        let bytes = std::fs::metadata(&path).unwrap().len();
        assert!(bytes < 700_000 * 24 / 2, "{bytes}: they are packed");
    }

    #[test]
    fn whatever_is_changed_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.part");
        file(&path);
        let whole = std::fs::read(&path).unwrap();
        for at in [0, 9, 40, whole.len() / 2, whole.len() - 1] {
            let mut bytes = whole.clone();
            bytes[at] ^= 4;
            std::fs::write(&path, bytes).unwrap();
            assert!(Read::open(&path).is_err(), "byte {at}");
        }
        for length in [0, 8, 23, 100, whole.len() - 1] {
            std::fs::write(&path, &whole[..length]).unwrap();
            let error = Read::open(&path).unwrap_err().to_string();
            assert!(error.contains("a.part"), "{error}");
        }
        std::fs::write(&path, whole).unwrap();
        assert!(Read::open(&path).is_ok());
    }
}
