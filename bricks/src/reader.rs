//! Reads the parts of a scene file, each checked against its checksum and the rules of the format.

use crate::attributes;
use crate::ending;
use crate::error::{Error, Flaw, Part};
use crate::layout::{DIRECTORY_BYTES, DirectoryEntry, Header, MAGIC, PAGE_BYTES, SECTION_ALIGN, Section, VERSION};
use crate::layout::{MAX_PAYLOAD_BYTES, unread_kind};
use crate::manifest::Manifest;
use crate::payload::Payload;
use crate::records::{Brick, Span};
use crate::source::Source;
use bytemuck::Pod;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::xxh3_64;

/// Opens a file for reading.
pub(crate) fn open_file(path: &Path) -> Result<(PathBuf, File), Error> {
    let file = File::open(path).map_err(|source| open_error(path, source))?;
    let metadata = file.metadata().map_err(|source| open_error(path, source))?;
    if metadata.is_dir() {
        return Err(open_error(path, io::ErrorKind::IsADirectory.into()));
    }
    Ok((path.to_owned(), file))
}

/// Another handle of `file`.
pub(crate) fn duplicate(path: &Path, file: &File) -> Result<File, Error> {
    file.try_clone().map_err(|source| open_error(path, source))
}

/// Length of `file` now.
pub(crate) fn length_of(path: &Path, file: &dyn Source) -> Result<u64, Error> {
    file.length().map_err(|source| open_error(path, source))
}

fn open_error(path: &Path, source: io::Error) -> Error {
    Error::Io {
        path: path.to_owned(),
        action: "open the file; check its name and permissions".to_owned(),
        part: None,
        source,
    }
}

/// The entries of all sections in order.
pub(crate) type Directory = [DirectoryEntry; Section::ALL.len()];

/// Buffers for decoding, which only ever grow, so that a load neither allocates nor clears memory but for the first.
#[derive(Default)]
pub(crate) struct Decoding {
    stored: Vec<u8>,
    columns: Vec<u8>,
}

/// Reads parts of a file, each checked against its checksum.
pub(crate) struct Reader<'a> {
    pub(crate) path: &'a Path,
    pub(crate) source: &'a dyn Source,
}

impl Reader<'_> {
    /// An error about a flaw in this file.
    #[cold]
    pub(crate) fn invalid(&self, flaw: Flaw) -> Error {
        Error::Invalid { path: self.path.to_owned(), flaw }
    }

    /// Fills `out` with the bytes at `offset`, which belong to `part`.
    pub(crate) fn bytes(&self, part: Part, offset: u64, out: &mut [u8]) -> Result<(), Error> {
        self.source.read_at(offset, out).map_err(|source| Error::Io {
            path: self.path.to_owned(),
            action: match source.kind() {
                io::ErrorKind::UnexpectedEof => format!("read {part}, the file has become shorter; convert again"),
                _ => format!("read {part}; copy the file to another disk, or convert again"),
            },
            part: Some(part),
            source,
        })
    }

    fn corrupt(&self, part: Part, found: u64, expected: u64) -> Result<(), Error> {
        if found == expected {
            return Ok(());
        }
        Err(Error::Corrupt { path: self.path.to_owned(), part, found, expected })
    }

    /// Reads the header of a file of `length` bytes. Nothing in it is used before its checksum is found right, except
    /// the magic and the version, which have their place in every version.
    pub(crate) fn header(&self, length: u64) -> Result<Header, Error> {
        let mut page = [0; PAGE_BYTES as usize];
        let start = length.min(PAGE_BYTES) as usize;
        self.bytes(Part::Header, 0, &mut page[..start])?;
        let magic = &page[..start.min(MAGIC.len())];
        if magic != &MAGIC[..magic.len()] || magic.is_empty() {
            return Err(Error::NotSceneFile { path: self.path.to_owned(), found: magic.to_vec() });
        }
        let (header, checksum) = Header::read(&page);
        if start >= 12 && header.version != VERSION {
            return Err(Error::Version { path: self.path.to_owned(), found: header.version });
        }
        if length < PAGE_BYTES {
            return Err(Error::Length { path: self.path.to_owned(), found: length, expected: PAGE_BYTES });
        }
        self.corrupt(Part::Header, checksum, header.checksum)?;
        let rule = |ok: bool, found: u64, expected: String| {
            if ok { Ok(()) } else { Err(self.invalid(Flaw { part: Part::Header, found: found.to_string(), expected })) }
        };
        if let Some(at) = page[size_of::<Header>()..].iter().position(|&byte| byte != 0) {
            let found = page[size_of::<Header>() + at];
            rule(false, found.into(), format!("zero at byte {}", size_of::<Header>() + at))?;
        }
        rule(header.page_bytes as u64 == PAGE_BYTES, header.page_bytes.into(), format!("pages of {PAGE_BYTES} bytes"))?;
        if header.file_bytes != length {
            return Err(Error::Length { path: self.path.to_owned(), found: length, expected: header.file_bytes });
        }
        let directory = header.directory_offset;
        rule(
            header.directory_bytes == DIRECTORY_BYTES,
            header.directory_bytes,
            format!("a directory of {DIRECTORY_BYTES} bytes"),
        )?;
        rule(
            directory >= PAGE_BYTES
                && directory.is_multiple_of(PAGE_BYTES)
                && directory.checked_add(DIRECTORY_BYTES).is_some_and(|end| end <= length),
            directory,
            format!("a directory on a multiple of {PAGE_BYTES} that ends within the file's {length} bytes"),
        )?;
        Ok(header)
    }

    /// Reads the directory that `header`, found right, points to. Its entries are the sections in their order and tile
    /// the rest of the file.
    pub(crate) fn directory(&self, header: &Header) -> Result<Directory, Error> {
        let mut directory: Directory = bytemuck::Zeroable::zeroed();
        self.bytes(Part::Directory, header.directory_offset, bytemuck::bytes_of_mut(&mut directory))?;
        self.corrupt(Part::Directory, xxh3_64(bytemuck::bytes_of(&directory)), header.directory_checksum)?;
        let rule = |ok: bool, found: String, expected: String| {
            if ok { Ok(()) } else { Err(self.invalid(Flaw { part: Part::Directory, found, expected })) }
        };
        // Below the file's length, so that rounding up cannot overflow unless the file is impossibly long.
        let mut end = header.directory_offset + header.directory_bytes;
        for (entry, section) in directory.iter().zip(Section::ALL) {
            if entry.kind != section.kind() {
                let kind = entry.kind;
                let known = Section::ALL.iter().find(|section| section.kind() == kind);
                let name = known.map_or(unread_kind(kind), |section| section.name());
                let expected = format!("kind {} ({section})", section.kind());
                rule(false, format!("an entry of kind {kind} ({name})"), expected)?;
            }
            rule(
                entry.record_bytes == section.record_bytes(),
                format!("records of {} bytes in section {section}", entry.record_bytes),
                format!("{}", section.record_bytes()),
            )?;
            rule(
                entry.count <= u32::MAX.into() && entry.count * u64::from(entry.record_bytes) == entry.bytes,
                format!("{} records in {} bytes of section {section}", entry.count, entry.bytes),
                format!("less than 2^32 records of {} bytes", entry.record_bytes),
            )?;
            let offset = end.checked_next_multiple_of(SECTION_ALIGN);
            rule(
                Some(entry.offset) == offset,
                format!("section {section} at byte {}", entry.offset),
                format!("at the next multiple of {SECTION_ALIGN} after byte {end}"),
            )?;
            let bytes = entry.bytes;
            end = entry.offset.checked_add(bytes).filter(|&end| end <= header.file_bytes).unwrap_or(0);
            rule(
                end != 0,
                format!("section {section} of {bytes} bytes at byte {}", entry.offset),
                format!("a section that ends within the file's {} bytes", header.file_bytes),
            )?;
        }
        rule(
            end == header.file_bytes,
            format!("the last section ending at byte {end}"),
            format!("the end of the file at byte {}", header.file_bytes),
        )?;
        Ok(directory)
    }

    /// Reads the records of a section. `directory` was found right, so the length is less than the file's.
    pub(crate) fn section<T: Pod>(&self, directory: &Directory, section: Section) -> Result<Vec<T>, Error> {
        let entry = &directory[section.index()];
        debug_assert!(size_of::<T>() == entry.record_bytes as usize);
        let part = Part::Section(section);
        let mut records = Vec::new();
        if !ending::reserve(&mut records, entry.count as usize) {
            return Err(Error::Io {
                path: self.path.to_owned(),
                action: format!("hold {part} in memory, {} bytes; free some memory", entry.bytes),
                part: Some(part),
                source: io::ErrorKind::OutOfMemory.into(),
            });
        }
        records.resize(entry.count as usize, T::zeroed());
        self.bytes(part, entry.offset, bytemuck::cast_slice_mut(&mut records))?;
        self.corrupt(part, xxh3_64(bytemuck::cast_slice(&records)), entry.checksum)?;
        Ok(records)
    }

    /// Reads the manifest.
    pub(crate) fn manifest(&self, directory: &Directory) -> Result<Manifest, Error> {
        let json = self.section::<u8>(directory, Section::Manifest)?;
        serde_json::from_slice(&json).map_err(|error| {
            self.invalid(Flaw {
                part: Part::Section(Section::Manifest),
                found: format!("text that does not parse ({error})"),
                expected: "a manifest as JSON".to_owned(),
            })
        })
    }

    /// Copies a payload to `out`, `span.bytes` long, and compares the checksum of the copy.
    pub(crate) fn payload(&self, payload: Payload, span: Span, out: &mut [u8]) -> Result<(), Error> {
        debug_assert!(span.bytes <= MAX_PAYLOAD_BYTES && span.bytes == out.len() as u64);
        let part = Part::Payload(payload);
        self.bytes(part, span.offset, out)?;
        self.corrupt(part, xxh3_64(out), span.checksum)
    }

    /// Decodes the attributes of `brick` to `out`, [`crate::AttributeLayout::bytes`] long, from a copy whose checksum
    /// was compared.
    pub(crate) fn attributes(
        &self,
        payload: Payload,
        span: Span,
        brick: &Brick,
        buffers: &mut Decoding,
        out: &mut [u8],
    ) -> Result<(), Error> {
        let Decoding { stored, columns } = buffers;
        let length = span.bytes as usize;
        if stored.len() < length {
            stored.resize(length, 0);
        }
        let stored = &mut stored[..length];
        self.payload(payload, span, stored)?;
        let decoded = attributes::decode(brick, stored, columns, out);
        decoded.map_err(|error| self.invalid(Flaw::packed(Part::Payload(payload), error)))
    }
}
