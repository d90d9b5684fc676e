//! Where the bytes of a scene file come from: a memory map, reads at positions, memory, or what a caller brings.

use crate::planted::{self, Defect};
use std::borrow::Cow;
use std::fs::File;
use std::io;
use std::ops::Range;
use std::sync::Arc;

/// Bytes at positions of a file that does not change.
pub trait ByteSource: Send + Sync {
    /// Length of the file now.
    ///
    /// # Errors
    /// It cannot be told.
    fn length(&self) -> io::Result<u64>;

    /// Fills `out` with the bytes at `offset`.
    ///
    /// # Errors
    /// [`io::ErrorKind::UnexpectedEof`] if the file ends before; it cannot be read.
    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()>;

    /// Says that each of these spans will be read next, once. A source that is far away fetches them together; what it
    /// could not fetch is an error of [`Self::read_at`].
    fn announce(&self, _spans: &[Range<u64>]) {}

    /// Most bytes to announce at a time, unless one span is longer. `None`: announcing has no effect.
    fn announced_bytes(&self) -> Option<u64> {
        None
    }

    /// Says that the bytes of a span are not those that its checksum is of, and were not so many `times` before.
    /// Whether reading it once more may bring others.
    fn distrust(&self, _span: Range<u64>, _times: u32) -> bool {
        false
    }

    /// Whether it is a file of this machine, which can be copied and converted again.
    fn is_file(&self) -> bool {
        true
    }
}

/// Reads at positions, without a shared cursor.
pub(crate) struct ReadSource {
    file: File,
}

impl ReadSource {
    /// Reads from `file`.
    pub(crate) fn new(file: File) -> Self {
        Self { file }
    }
}

impl ByteSource for ReadSource {
    fn length(&self) -> io::Result<u64> {
        self.file.metadata().map(|metadata| metadata.len())
    }

    #[cfg(unix)]
    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        std::os::unix::fs::FileExt::read_exact_at(&self.file, out, offset)
    }

    #[cfg(windows)]
    fn read_at(&self, mut offset: u64, mut out: &mut [u8]) -> io::Result<()> {
        while !out.is_empty() {
            match std::os::windows::fs::FileExt::seek_read(&self.file, out, offset) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(read) => {
                    out = &mut out[read..];
                    offset += read as u64;
                }
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

/// Copies out of a memory map.
///
/// The map is only ever a raw pointer: another process may write to the file, and no reference to bytes that change may
/// exist. What was copied is checked afterwards, in the copy. A page of a map that the file no longer reaches kills the
/// process with SIGBUS when touched, so the file's length is asked for before each copy. What remains is a file that
/// shrinks *during* a copy; scene files are replaced by renaming, never shortened in place.
pub(crate) struct MapSource {
    file: File,
    map: memmap2::MmapRaw,
}

impl MapSource {
    /// Maps `file` as long as it is now.
    pub(crate) fn new(file: File) -> io::Result<Self> {
        let map = memmap2::MmapOptions::new().map_raw_read_only(&file)?;
        Ok(Self { file, map })
    }
}

impl ByteSource for MapSource {
    fn length(&self) -> io::Result<u64> {
        self.file.metadata().map(|metadata| metadata.len())
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let end = offset.checked_add(out.len() as u64).ok_or(io::ErrorKind::UnexpectedEof)?;
        if end > self.map.len() as u64 || (end > self.length()? && !planted::is(Defect::MapLength)) {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        // SAFETY: `offset .. offset + out.len()` lies within the map (checked above), which stays mapped and readable
        // while `self` lives and, the file having been long enough just now, is backed by the file. `out` is
        // exclusively borrowed memory of its own, so the two do not overlap. Bytes have no invalid values, and no
        // reference to the mapped bytes is formed.
        unsafe {
            std::ptr::copy_nonoverlapping(self.map.as_ptr().add(offset as usize), out.as_mut_ptr(), out.len());
        }
        Ok(())
    }
}

/// A file in memory.
impl ByteSource for Arc<Cow<'static, [u8]>> {
    fn length(&self) -> io::Result<u64> {
        Ok(self.len() as u64)
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let rest = usize::try_from(offset).ok().and_then(|start| self.get(start..));
        let bytes = rest.and_then(|rest| rest.get(..out.len())).ok_or(io::ErrorKind::UnexpectedEof)?;
        out.copy_from_slice(bytes);
        Ok(())
    }
}
