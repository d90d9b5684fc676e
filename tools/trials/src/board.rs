//! A page of memory that a worker shares with who watches it: when the worker dies, it tells which trial it was at.

use anyhow::{Context, Result};
use memmap2::MmapMut;
use std::fs::File;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes of the page.
const BYTES: usize = 4096;

/// What the numbers are.
#[derive(Clone, Copy, Debug)]
pub enum Slot {
    /// The trial in work; after the last one, the one that would follow.
    Seed,
    /// 1 while a trial is in work.
    Busy,
    /// Trials that passed.
    Passed,
    /// Trials that were stopped.
    Stopped,
    /// Trials that found something.
    Found,
    /// Most bytes that a trial took.
    Peak,
}

/// The page.
#[derive(Debug)]
pub struct Board(MmapMut);

impl Board {
    /// The page in `file`, which is made.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(file: &Path) -> Result<Self> {
        let name = || file.display().to_string();
        File::create(file).and_then(|file| file.set_len(BYTES as u64)).with_context(name)?;
        Self::open(file)
    }

    /// The page in `file`, which exists.
    ///
    /// # Errors
    /// The file cannot be read and written, or is too short.
    pub fn open(file: &Path) -> Result<Self> {
        let name = || file.display().to_string();
        let opened = File::options().read(true).write(true).open(file).with_context(name)?;
        // SAFETY: nobody shortens the file while it is mapped: it lies in a folder of the process that watches.
        let map = unsafe { MmapMut::map_mut(&opened) }.with_context(name)?;
        anyhow::ensure!(map.len() >= BYTES, "{}: too short", file.display());
        Ok(Self(map))
    }

    fn slot(&self, slot: Slot) -> &AtomicU64 {
        let at = self.0.as_ptr().cast::<u64>().wrapping_add(slot as usize).cast_mut();
        // SAFETY: a page begins at a multiple of 8 and holds more than six words; both processes use them as atomics.
        unsafe { AtomicU64::from_ptr(at) }
    }

    /// A number.
    pub fn get(&self, slot: Slot) -> u64 {
        self.slot(slot).load(Ordering::Acquire)
    }

    /// Sets a number.
    pub fn set(&self, slot: Slot, value: u64) {
        self.slot(slot).store(value, Ordering::Release);
    }

    /// Adds one.
    pub fn count(&self, slot: Slot) {
        self.slot(slot).fetch_add(1, Ordering::AcqRel);
    }
}
