//! Reads the parts of a scene file, each checked against its checksum and the rules of the format.

use crate::attributes;
use crate::displacement::DisplacementField;
use crate::ending;
use crate::error::{Error, Flaw, Part, one_line};
use crate::layout::{DirectoryEntry, Header, MAGIC, PAGE_BYTES, SECTION_ALIGN, Section, VERSION};
use crate::layout::{ENTRY_BYTES, MAX_DIRECTORY_BYTES, MAX_PAYLOAD_BYTES, MIN_DIRECTORY_BYTES, unread_kind};
use crate::manifest::Manifest;
use crate::pack;
use crate::payload::Payload;
use crate::planted::{self, Defect};
use crate::records::{Brick, Span};
use crate::source::ByteSource;
use bytemuck::{Pod, Zeroable};
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
pub(crate) fn length_of(path: &Path, file: &dyn ByteSource) -> Result<u64, Error> {
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

/// The entries of the sections that a file has, in order.
pub(crate) struct Directory(Vec<(Section, DirectoryEntry)>);

impl Directory {
    /// The sections with their entries.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &(Section, DirectoryEntry)> {
        self.0.iter()
    }

    /// Bytes of all sections.
    pub(crate) fn section_bytes(&self) -> u64 {
        self.iter().map(|(_, entry)| entry.bytes).sum()
    }

    /// The entry of a section; none of an optional one that the file does not have.
    fn entry(&self, section: Section) -> Option<&DirectoryEntry> {
        self.iter().find(|(own, _)| *own == section).map(|(_, entry)| entry)
    }
}

/// Buffers for decoding, which only ever grow, so that a load neither allocates nor clears memory but for the first.
#[derive(Default)]
pub(crate) struct Decoding {
    stored: Vec<u8>,
    columns: Vec<u8>,
}

/// Reads parts of a file, each checked against its checksum.
pub(crate) struct Reader<'a> {
    pub(crate) path: &'a Path,
    pub(crate) source: &'a dyn ByteSource,
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
                // What is not a file says by itself what to do.
                _ if !self.source.is_file() => format!("read {part}"),
                io::ErrorKind::UnexpectedEof => format!("read {part}, the file has become shorter; convert again"),
                _ => format!("read {part}; copy the file to another disk, or convert again"),
            },
            part: Some(part),
            source,
        })
    }

    /// As [`Self::bytes`], and compares the checksum of what came with `expected`.
    fn checked(&self, part: Part, offset: u64, out: &mut [u8], expected: u64) -> Result<(), Error> {
        let mut times = 0;
        loop {
            self.bytes(part, offset, out)?;
            let found = xxh3_64(out);
            if found == expected || !self.source.distrust(offset..offset + out.len() as u64, times) {
                return self.corrupt(part, found, expected);
            }
            times += 1;
        }
    }

    fn corrupt(&self, part: Part, found: u64, expected: u64) -> Result<(), Error> {
        if found == expected || planted::is(Defect::Checksum) {
            return Ok(());
        }
        Err(Error::Corrupt { path: self.path.to_owned(), part, found, expected })
    }

    /// Announces what follows the payloads.
    pub(crate) fn announce_resident(&self, header: &Header) {
        let resident = header.directory_offset..header.file_bytes;
        self.source.announce(std::slice::from_ref(&resident));
    }

    /// Reads the header of a file of `length` bytes. Nothing in it is used before its checksum is found right, except
    /// the magic and the version, which have their place in every version.
    pub(crate) fn header(&self, length: u64) -> Result<Header, Error> {
        let mut page = [0; PAGE_BYTES as usize];
        let start = length.min(PAGE_BYTES) as usize;
        let mut times = 0;
        loop {
            self.bytes(Part::Header, 0, &mut page[..start])?;
            let (header, checksum) = Header::read(&page);
            if header.checksum == checksum || !self.source.distrust(0..start as u64, times) {
                break;
            }
            times += 1;
        }
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
        let (directory, bytes) = (header.directory_offset, header.directory_bytes);
        rule(
            (MIN_DIRECTORY_BYTES..=MAX_DIRECTORY_BYTES).contains(&bytes) && bytes.is_multiple_of(ENTRY_BYTES),
            bytes,
            format!(
                "a directory of {MIN_DIRECTORY_BYTES} to {MAX_DIRECTORY_BYTES} bytes in entries of {ENTRY_BYTES} bytes"
            ),
        )?;
        rule(
            directory >= PAGE_BYTES
                && directory.is_multiple_of(PAGE_BYTES)
                && directory.checked_add(bytes).is_some_and(|end| end <= length),
            directory,
            format!("a directory on a multiple of {PAGE_BYTES} that ends within the file's {length} bytes"),
        )?;
        Ok(header)
    }

    /// Reads the directory that `header`, found right, points to. Its entries are the sections in their order, optional
    /// ones only with records, and tile the rest of the file.
    pub(crate) fn directory(&self, header: &Header) -> Result<Directory, Error> {
        let mut entries = vec![DirectoryEntry::zeroed(); (header.directory_bytes / ENTRY_BYTES) as usize];
        let (bytes, expected) = (bytemuck::cast_slice_mut(&mut entries), header.directory_checksum);
        self.checked(Part::Directory, header.directory_offset, bytes, expected)?;
        let rule = |ok: bool, found: String, expected: String| {
            if ok { Ok(()) } else { Err(self.invalid(Flaw { part: Part::Directory, found, expected })) }
        };
        let mut directory = Vec::with_capacity(entries.len());
        let mut entries = entries.into_iter().peekable();
        // Below the file's length, so that rounding up cannot overflow unless the file is impossibly long.
        let mut end = header.directory_offset + header.directory_bytes;
        for section in Section::ALL {
            let Some(entry) = entries.next_if(|entry| entry.kind == section.kind()) else {
                let expected = || format!("kind {} ({section})", section.kind());
                rule(section.is_optional(), entry_name(entries.peek()), expected())?;
                continue;
            };
            rule(
                entry.count > 0 || !section.is_optional(),
                format!("an entry of section {section} without records"),
                "records, or no entry".to_owned(),
            )?;
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
            directory.push((section, entry));
        }
        rule(entries.peek().is_none(), entry_name(entries.peek()), "the end of the directory".to_owned())?;
        rule(
            end == header.file_bytes,
            format!("the last section ending at byte {end}"),
            format!("the end of the file at byte {}", header.file_bytes),
        )?;
        Ok(Directory(directory))
    }

    /// Reads the records of a section; none of an optional one that the file does not have. `directory` was found
    /// right, so the length is less than the file's.
    pub(crate) fn section<T: Pod>(&self, directory: &Directory, section: Section) -> Result<Vec<T>, Error> {
        let Some(entry) = directory.entry(section) else { return Ok(Vec::new()) };
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
        self.checked(part, entry.offset, bytemuck::cast_slice_mut(&mut records), entry.checksum)?;
        Ok(records)
    }

    /// Reads the manifest.
    pub(crate) fn manifest(&self, directory: &Directory) -> Result<Manifest, Error> {
        let json = self.section::<u8>(directory, Section::Manifest)?;
        serde_json::from_slice(&json).map_err(|error| {
            self.invalid(Flaw {
                part: Part::Section(Section::Manifest),
                found: format!("text that does not parse ({})", one_line(&error.to_string())),
                expected: "a manifest as JSON".to_owned(),
            })
        })
    }

    /// Copies a payload to `out`, `span.bytes` long, and compares the checksum of the copy.
    pub(crate) fn payload(&self, payload: Payload, span: Span, out: &mut [u8]) -> Result<(), Error> {
        debug_assert!(span.bytes <= MAX_PAYLOAD_BYTES && span.bytes == out.len() as u64);
        self.checked(Part::Payload(payload), span.offset, out, span.checksum)
    }

    /// Copies a payload to `stored`, which grows to its length, as [`Self::payload`].
    fn stored<'a>(&self, payload: Payload, span: Span, stored: &'a mut Vec<u8>) -> Result<&'a [u8], Error> {
        let length = span.bytes as usize;
        if stored.len() < length {
            stored.resize(length, 0);
        }
        self.payload(payload, span, &mut stored[..length])?;
        Ok(&stored[..length])
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
        let stored = self.stored(payload, span, stored)?;
        let decoded = attributes::decode(brick, stored, columns, out);
        decoded.map_err(|error| self.invalid(Flaw::packed(Part::Payload(payload), error)))
    }

    /// Unpacks the samples of `field` to `out`, [`DisplacementField::loaded_bytes`] long, from a copy whose checksum
    /// was compared.
    pub(crate) fn displacement(
        &self,
        payload: Payload,
        field: &DisplacementField,
        buffers: &mut Decoding,
        out: &mut [u8],
    ) -> Result<(), Error> {
        let stored = self.stored(payload, field.span, &mut buffers.stored)?;
        pack::unpack(stored, out).map_err(|error| self.invalid(Flaw::packed(Part::Payload(payload), error)))
    }
}

/// What a message calls an entry of the directory.
fn entry_name(entry: Option<&DirectoryEntry>) -> String {
    let Some(DirectoryEntry { kind, .. }) = entry else { return "the end of the directory".to_owned() };
    let known = Section::ALL.iter().find(|section| section.kind() == *kind);
    format!("an entry of kind {kind} ({})", known.map_or(unread_kind(*kind), |section| section.name()))
}
