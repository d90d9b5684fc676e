//! The journal of a conversion: what has been done, step by step, so that one that was interrupted can be continued.
//!
//! The steps of a conversion follow from its source and settings alone. A conversion that is continued goes through
//! them again and takes the results of those that the journal has from there. A result names all that the step left on
//! the disk by lengths, and what lies there is checked when it is read, so nothing has to be synced before it is
//! recorded.

use crate::build::error::BuildError;
use bricks::Span;
use std::collections::VecDeque;
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::xxh3_64;

/// Start of a journal.
const MAGIC: [u8; 16] = *b"brickwalk scrat\x02";

/// A kind of step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u64)]
pub(crate) enum Step {
    /// Which conversion this is.
    Begin = 1,
    /// The textures are written.
    Textures,
    /// Some small objects are cut.
    Objects,
    /// The items of a large object are collected.
    Gather,
    /// Items too many for the memory are split in two, where [`Step::Count`] says.
    Split,
    /// Items that fit are cut.
    Cut,
    /// All parts have been read.
    Repairs,
    /// A window of slots is distributed over the chunks.
    Distribute,
    /// A chunk is encoded.
    Encode,
    /// The opacity maps are written.
    Opacity,
    /// Some levels of detail are written.
    Levels,
    /// Items too many for the memory are counted, to know where they are split.
    Count,
}

impl Step {
    /// Its name, as tasks of it are called.
    pub fn name(self) -> &'static str {
        match self {
            Self::Begin => "begin",
            Self::Textures => "textures",
            Self::Objects => "objects",
            Self::Gather => "gather",
            Self::Split => "split",
            Self::Cut => "cut",
            Self::Repairs => "repairs",
            Self::Distribute => "distribute",
            Self::Encode => "encode",
            Self::Opacity => "opacity",
            Self::Levels => "levels",
            Self::Count => "count",
        }
    }
}

/// A journal that grows by a record with each step.
#[derive(Debug)]
pub(crate) struct Journal {
    path: PathBuf,
    file: File,
    /// Steps that were done before, still to be gone through.
    done: VecDeque<(u64, Vec<u64>)>,
    /// Steps that were gone through.
    position: u64,
    is_continued: bool,
    access: Access,
}

/// Who reads a journal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Access {
    /// Nobody else.
    Own,
    /// Other machines too, so that records lie on the disk before anything relies on them.
    Shared,
    /// A process that does not lead the conversion: it adds nothing.
    Follow,
}

impl Journal {
    /// Whether `path` starts as a journal does.
    pub fn is_one(path: &Path) -> bool {
        let mut magic = [0; MAGIC.len()];
        File::open(path).and_then(|mut file| file.read_exact(&mut magic)).is_ok() && magic == MAGIC
    }

    /// Whether `path` is a journal that was being made: less than its start is there.
    pub fn is_torn(path: &Path) -> bool {
        let mut start = Vec::new();
        let read = File::open(path).and_then(|file| file.take(MAGIC.len() as u64).read_to_end(&mut start));
        read.is_ok() && start.len() < MAGIC.len() && MAGIC.starts_with(&start)
    }

    /// Starts an empty journal. If it is `is_shared`, other machines follow it.
    pub fn create(path: PathBuf, is_shared: bool) -> Result<Self, BuildError> {
        let file = File::create_new(&path).and_then(|mut file| file.write_all(&MAGIC).map(|()| file));
        let file = file.map_err(|source| BuildError::Scratch { path: path.clone(), action: "create", source })?;
        let access = if is_shared { Access::Shared } else { Access::Own };
        Ok(Self { path, file, done: VecDeque::new(), position: 0, is_continued: false, access })
    }

    /// Opens a journal to continue it. The last record may be torn: it does not count.
    pub fn open(path: PathBuf) -> Result<Self, BuildError> {
        let error = |source| BuildError::Scratch { path: path.clone(), action: "read", source };
        let mut file = OpenOptions::new().read(true).write(true).open(&path).map_err(error)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(error)?;
        let (done, end) = records(&bytes);
        file.set_len(end as u64).and_then(|()| file.seek(SeekFrom::End(0))).map_err(error)?;
        Ok(Self { path, file, done, position: 0, is_continued: true, access: Access::Own })
    }

    /// Opens the first `steps` steps of a journal that another process may be adding to.
    ///
    /// # Errors
    /// It has not as many.
    pub fn follow(path: PathBuf, steps: u64) -> Result<Self, BuildError> {
        let error = |source| BuildError::Scratch { path: path.clone(), action: "read", source };
        let mut file = File::open(&path).map_err(error)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(error)?;
        let (mut done, _) = records(&bytes);
        if !bytes.starts_with(&MAGIC) || (done.len() as u64) < steps {
            return Err(BuildError::Behind { path });
        }
        done.truncate(steps as usize);
        Ok(Self { path, file, done, position: 0, is_continued: true, access: Access::Follow })
    }

    /// Lets other machines follow it from now on.
    pub fn share(&mut self) {
        self.access = Access::Shared;
    }

    /// Number of steps that were gone through.
    pub fn position(&self) -> u64 {
        self.position
    }

    /// Whether some steps were done by an earlier run.
    pub fn is_continued(&self) -> bool {
        self.is_continued
    }

    /// Number of steps of an earlier run that are left.
    pub fn left(&self) -> usize {
        self.done.len()
    }

    /// Up to which byte an earlier run wrote the scene file, and the payloads before that: what the results of the
    /// steps that write begin with. `None` if there was no such step.
    pub fn written(&self) -> Result<Option<(u64, Vec<Span>)>, BuildError> {
        let (mut position, mut spans) = (None, Vec::new());
        let writing = [Step::Textures, Step::Opacity, Step::Encode, Step::Levels];
        let writes = |step: u64| writing.iter().any(|kind| *kind as u64 == step);
        for (_, words) in self.done.iter().filter(|(step, _)| writes(*step)) {
            let mut words = WordReader(words);
            position = words.take();
            spans.extend(words.take_records::<Span>().ok_or_else(|| self.damaged())?);
        }
        Ok(position.map(|position| (position, spans)))
    }

    /// The result of the next step: of an earlier run, or of `work`.
    ///
    /// # Errors
    /// That of `work`; it cannot be recorded; another process leads the conversion and has not come to this step.
    pub fn step(
        &mut self,
        step: Step,
        work: impl FnOnce() -> Result<Vec<u64>, BuildError>,
    ) -> Result<Vec<u64>, BuildError> {
        if self.done.is_empty() && self.access == Access::Follow {
            return Err(BuildError::Behind { path: self.path.clone() });
        }
        self.shared_step(step, |_| work())
    }

    /// The same for a step whose tasks other processes may do, from its position: `work` then ends with an error.
    pub fn shared_step(
        &mut self,
        step: Step,
        work: impl FnOnce(u64) -> Result<Vec<u64>, BuildError>,
    ) -> Result<Vec<u64>, BuildError> {
        match self.done.pop_front() {
            Some((found, words)) if found == step as u64 => {
                self.position += 1;
                return Ok(words);
            }
            Some(_) => return Err(self.damaged()),
            None => {}
        }
        let words = work(self.position)?;
        let mut record = vec![step as u64, words.len() as u64, 0];
        record.extend(&words);
        record[2] = checksum(&record);
        // In one write, so that a torn record is shorter and not another.
        let written = self.file.write_all(bytemuck::cast_slice(&record));
        let written = written.and_then(|()| if self.access == Access::Shared { self.file.sync_data() } else { Ok(()) });
        written.map_err(|source| BuildError::Scratch { path: self.path.clone(), action: "write", source })?;
        self.position += 1;
        Ok(words)
    }

    /// The error that the journal is not what it should be.
    pub fn damaged(&self) -> BuildError {
        BuildError::ScratchDamaged { path: self.path.clone() }
    }
}

/// Checksum of a record: of all its words but the third.
fn checksum(record: &[u64]) -> u64 {
    xxh3_64(bytemuck::cast_slice(&record[..2])) ^ xxh3_64(bytemuck::cast_slice(&record[3..])).rotate_left(1)
}

/// The whole records of a journal, and where they end.
fn records(bytes: &[u8]) -> (VecDeque<(u64, Vec<u64>)>, usize) {
    let (mut records, mut end) = (VecDeque::new(), MAGIC.len());
    while let Some((step, words, next)) = record_at(bytes, end) {
        records.push_back((step, words));
        end = next;
    }
    (records, end)
}

/// The record at `start` and where the next one starts.
fn record_at(bytes: &[u8], start: usize) -> Option<(u64, Vec<u64>, usize)> {
    let words = |start: usize, count: usize| -> Option<Vec<u64>> {
        let bytes = bytes.get(start..start.checked_add(count.checked_mul(8)?)?)?;
        Some(bytes.chunks_exact(8).map(bytemuck::pod_read_unaligned).collect())
    };
    let count = words(start, 3)?[1] as usize;
    let record = words(start, count.checked_add(3)?)?;
    (checksum(&record) == record[2]).then(|| (record[0], record[3..].to_vec(), start + 8 * record.len()))
}

/// Writes values as words.
#[derive(Debug, Default)]
pub(crate) struct Words(pub Vec<u64>);

impl Words {
    /// A number.
    pub fn put(&mut self, value: u64) -> &mut Self {
        self.0.push(value);
        self
    }

    /// Numbers, with how many.
    pub fn put_all(&mut self, values: impl ExactSizeIterator<Item = u64>) -> &mut Self {
        self.put(values.len() as u64).0.extend(values);
        self
    }

    /// Three floats, exactly.
    pub fn put_point(&mut self, point: [f64; 3]) -> &mut Self {
        self.0.extend(point.map(f64::to_bits));
        self
    }

    /// Records, with how many bytes.
    pub fn put_records<T: bytemuck::NoUninit>(&mut self, records: &[T]) -> &mut Self {
        let bytes: &[u8] = bytemuck::cast_slice(records);
        self.put(bytes.len() as u64);
        self.0.extend(bytes.chunks(8).map(|chunk| {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            u64::from_ne_bytes(word)
        }));
        self
    }
}

/// Reads values from words; `None` where there are too few.
#[derive(Debug)]
pub(crate) struct WordReader<'a>(pub &'a [u64]);

impl WordReader<'_> {
    /// A number.
    pub fn take(&mut self) -> Option<u64> {
        let (first, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(*first)
    }

    /// Numbers.
    pub fn take_all(&mut self) -> Option<Vec<u64>> {
        let count = usize::try_from(self.take()?).ok()?;
        let (values, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(values.to_vec())
    }

    /// Three floats.
    pub fn take_point(&mut self) -> Option<[f64; 3]> {
        let (point, rest) = self.0.split_first_chunk::<3>()?;
        self.0 = rest;
        Some(point.map(f64::from_bits))
    }

    /// Records.
    pub fn take_records<T: bytemuck::AnyBitPattern + bytemuck::NoUninit>(&mut self) -> Option<Vec<T>> {
        let length = usize::try_from(self.take()?).ok()?;
        let (words, rest) = self.0.split_at_checked(length.div_ceil(8))?;
        self.0 = rest;
        let bytes: &[u8] = bytemuck::cast_slice(words);
        Some(bytes[..length].chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect())
    }
}

/// Lines of text as words.
pub(crate) fn words_of_texts(texts: &[String]) -> Vec<u64> {
    let mut words = Words::default();
    words.put(texts.len() as u64);
    for text in texts {
        words.put_records(text.as_bytes());
    }
    words.0
}

/// Lines of text from words.
pub(crate) fn texts_of_words(words: &[u64]) -> Option<Vec<String>> {
    let mut words = WordReader(words);
    let count = words.take()?;
    (0..count).map(|_| String::from_utf8(words.take_records()?).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_torn_record_does_not_count() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let mut journal = Journal::create(path.clone(), false).unwrap();
        journal.step(Step::Begin, || Ok(vec![7])).unwrap();
        journal.step(Step::Gather, || Ok(vec![1, 2, 3])).unwrap();
        let whole = std::fs::read(&path).unwrap();
        assert!(Journal::is_one(&path) && !Journal::is_torn(&path));
        for length in 0..MAGIC.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(!Journal::is_one(&path) && Journal::is_torn(&path));
        }
        std::fs::write(&path, b"another").unwrap();
        assert!(!Journal::is_torn(&path));
        for length in MAGIC.len()..=whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            let mut journal = Journal::open(path.clone()).unwrap();
            let begin = journal.step(Step::Begin, || Ok(vec![8])).unwrap();
            let gather = journal.step(Step::Gather, || Ok(vec![9])).unwrap();
            assert_eq!(begin, [if length < MAGIC.len() + 32 { 8 } else { 7 }]);
            assert_eq!(gather == [1, 2, 3], length == whole.len(), "{length}");
            let mut again = Journal::open(path.clone()).unwrap();
            assert_eq!(again.step(Step::Begin, || unreachable!()).unwrap(), begin);
            assert_eq!(again.step(Step::Gather, || unreachable!()).unwrap(), gather);
        }
        let mut journal = Journal::open(path).unwrap();
        assert!(journal.step(Step::Textures, || Ok(vec![])).is_err(), "another step than the recorded one");
    }

    #[test]
    fn who_follows_adds_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let mut journal = Journal::create(path.clone(), true).unwrap();
        journal.step(Step::Begin, || Ok(vec![7])).unwrap();
        journal.step(Step::Gather, || Ok(vec![1, 2, 3])).unwrap();
        let whole = std::fs::read(&path).unwrap();
        let mut torn = whole.clone();
        torn.extend([1; 9]);
        std::fs::write(&path, &torn).unwrap();
        let mut follower = Journal::follow(path.clone(), 1).unwrap();
        assert_eq!(follower.step(Step::Begin, || unreachable!()).unwrap(), [7]);
        assert_eq!(follower.position(), 1);
        assert!(matches!(follower.step(Step::Gather, || unreachable!()), Err(BuildError::Behind { .. })));
        let done = follower.shared_step(Step::Gather, |position| {
            assert_eq!(position, 1);
            Err(BuildError::TaskDone)
        });
        assert!(matches!(done, Err(BuildError::TaskDone)));
        assert!(Journal::follow(path.clone(), 2).is_ok());
        assert!(matches!(Journal::follow(path.clone(), 3), Err(BuildError::Behind { .. })));
        assert_eq!(std::fs::read(&path).unwrap(), torn);
    }

    #[test]
    fn values_come_back() {
        let mut words = Words::default();
        let point = [f64::INFINITY, -0.0, 1e-300];
        words
            .put(5)
            .put_all([1u64, 2].into_iter())
            .put_point(point)
            .put_records(b"abcdefghijk")
            .put_records(&[1.5f32; 3]);
        let mut reader = WordReader(&words.0);
        assert_eq!(reader.take(), Some(5));
        assert_eq!(reader.take_all().unwrap(), [1, 2]);
        assert_eq!(reader.take_point().unwrap().map(f64::to_bits), point.map(f64::to_bits));
        assert_eq!(reader.take_records::<u8>().unwrap(), b"abcdefghijk");
        assert_eq!(reader.take_records::<f32>().unwrap(), [1.5; 3]);
        assert!(reader.take().is_none() && reader.take_all().is_none());
    }
}
