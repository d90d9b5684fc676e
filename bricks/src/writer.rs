//! Writes a scene file so that it appears whole or not at all.

use crate::error::{Error, Flaw, Part};
use crate::layout::DirectoryEntry;
use crate::layout::{DIRECTORY_BYTES, Header, MAGIC, MAX_PAYLOAD_BYTES, PAGE_BYTES, SECTION_ALIGN, Section, VERSION};
use crate::records::Span;
use crate::resident::Resident;
use crate::validate;
use std::borrow::Cow;
use std::fs;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;
use xxhash_rust::xxh3::xxh3_64;

/// Bytes collected before they are written.
const BUFFER_BYTES: usize = 1 << 20;

/// Writes a scene file under a temporary name in the folder of its own: payloads first, then the resident part. Only
/// [`Self::finish`] gives it its name, in one step and after everything is on the disk. If the writer is dropped before,
/// the temporary file is removed; whatever had the name keeps it.
#[derive(Debug)]
pub struct Writer {
    path: PathBuf,
    /// `path` with a symbolic link followed, so that finishing replaces the file and not the link.
    target: PathBuf,
    file: BufWriter<NamedTempFile>,
    position: u64,
    spans: Vec<Span>,
}

impl Writer {
    /// Starts a file that will be called `path`. Its folder must exist.
    pub fn create(path: impl AsRef<Path>) -> Result<Writer, Error> {
        let path = path.as_ref().to_owned();
        let error =
            |action: &str, source| Error::Io { path: path.clone(), action: action.to_owned(), part: None, source };
        if path.is_dir() {
            return Err(error("write a file of this name; give another", io::ErrorKind::IsADirectory.into()));
        }
        let target = fs::canonicalize(&path).unwrap_or_else(|_| path.clone());
        let Some(name) = target.file_name() else {
            return Err(error("write a file without a name; give one", io::ErrorKind::InvalidInput.into()));
        };
        let mut prefix = std::ffi::OsString::from(".");
        prefix.push(name);
        prefix.push(".");
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(".partial");
        // The permissions of an ordinary new file, not the private ones of a temporary: the umask applies.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let temporary = builder.tempfile_in(folder_of(&target)).map_err(|source| {
            error("create a temporary file beside it; check the folder and its permissions", source)
        })?;
        let mut writer = Writer {
            file: BufWriter::with_capacity(BUFFER_BYTES, temporary),
            path,
            target,
            position: 0,
            spans: Vec::new(),
        };
        writer.append(&[0; PAGE_BYTES as usize])?;
        Ok(writer)
    }

    /// The path that the file will have.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a payload at the next multiple of [`PAGE_BYTES`] and returns where it lies. `bytes` must be a multiple of
    /// 16 long, not empty, and at most [`MAX_PAYLOAD_BYTES`]. Every payload that is written must be that of a brick or a
    /// texture of the resident part given to [`Self::finish`].
    pub fn write(&mut self, bytes: &[u8]) -> Result<Span, Error> {
        let length = bytes.len() as u64;
        if length == 0 || !length.is_multiple_of(16) || length > MAX_PAYLOAD_BYTES {
            let source = io::Error::new(io::ErrorKind::InvalidInput, format!("it is {length} bytes long"));
            let action = format!("write a payload that is not a multiple of 16 from 16 to {MAX_PAYLOAD_BYTES} bytes");
            return Err(self.error(action, source));
        }
        self.align(PAGE_BYTES)?;
        let span = Span { offset: self.position, bytes: length, checksum: xxh3_64(bytes) };
        self.append(bytes)?;
        self.spans.push(span);
        Ok(span)
    }

    /// Writes the resident part, directory and header, waits until all is on the disk, and gives the file its name.
    ///
    /// A `resident` that [`validate::resident`] refuses, or that does not refer to exactly the payloads written, is an
    /// error: no file appears that could not be opened.
    pub fn finish(mut self, resident: &Resident) -> Result<(), Error> {
        let invalid = |flaw| Error::Invalid { path: self.path.clone(), flaw };
        validate::resident(resident).map_err(invalid)?;
        self.check_spans(resident).map_err(invalid)?;

        self.align(PAGE_BYTES)?;
        let directory_offset = self.position;
        validate::spans(resident, directory_offset).map_err(|flaw| Error::Invalid { path: self.path.clone(), flaw })?;
        let mut end = directory_offset + DIRECTORY_BYTES;
        let mut directory = Vec::with_capacity(Section::ALL.len());
        let mut sections = Vec::with_capacity(Section::ALL.len());
        for section in Section::ALL {
            let bytes =
                section_bytes(resident, section).map_err(|source| self.error("write the manifest", source.into()))?;
            let offset = end.next_multiple_of(SECTION_ALIGN);
            end = offset + bytes.len() as u64;
            directory.push(DirectoryEntry {
                kind: section.kind(),
                record_bytes: section.record_bytes(),
                count: bytes.len() as u64 / u64::from(section.record_bytes()),
                offset,
                bytes: bytes.len() as u64,
                checksum: xxh3_64(&bytes),
            });
            sections.push(bytes);
        }
        let directory: &[u8] = bytemuck::cast_slice(&directory);
        self.append(directory)?;
        for bytes in &sections {
            self.align(SECTION_ALIGN)?;
            self.append(bytes)?;
        }
        let header = Header {
            magic: MAGIC,
            version: VERSION,
            page_bytes: PAGE_BYTES as u32,
            file_bytes: self.position,
            directory_offset,
            directory_bytes: DIRECTORY_BYTES,
            directory_checksum: xxh3_64(directory),
            checksum: 0,
        };
        let written = self.file.seek(SeekFrom::Start(0)).and_then(|_| self.file.write_all(&header.page()));
        written.and_then(|()| self.file.flush()).map_err(|source| self.write_error(source))?;

        let Writer { path, target, file, .. } = self;
        let error =
            |action: &str, source| Error::Io { path: path.clone(), action: action.to_owned(), part: None, source };
        let temporary = file.into_inner().map_err(|failure| {
            error("write the file; free some space on the disk and convert again", failure.into_error())
        })?;
        temporary.as_file().sync_all().map_err(|source| error("sync the file to the disk; convert again", source))?;
        temporary
            .persist(&target)
            .map_err(|failure| error("rename the finished file to its name; convert again", failure.error))?;
        sync_folder(folder_of(&target)).map_err(|source| error("sync the folder of the file; convert again", source))
    }

    /// Every span of the resident part is one that was written, and each written one is in use.
    fn check_spans(&self, resident: &Resident) -> Result<(), Flaw> {
        let mut used = vec![false; self.spans.len()];
        for (payload, span) in resident.payloads() {
            match self.spans.binary_search_by_key(&span.offset, |span| span.offset) {
                Ok(index) if self.spans[index] == span => used[index] = true,
                _ => {
                    return Err(Flaw {
                        part: Part::Payload(payload),
                        found: format!("{span:?}"),
                        expected: "a span that the writer returned".to_owned(),
                    });
                }
            }
        }
        match used.iter().position(|used| !used) {
            None => Ok(()),
            Some(index) => Err(Flaw {
                part: Part::Section(Section::Bricks),
                found: format!("no brick or texture with the payload written at byte {}", self.spans[index].offset),
                expected: "every written payload in use".to_owned(),
            }),
        }
    }

    fn append(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.file.write_all(bytes).map_err(|source| self.write_error(source))?;
        self.position += bytes.len() as u64;
        Ok(())
    }

    /// Writes zeros up to the next multiple of `alignment`, at most [`PAGE_BYTES`].
    fn align(&mut self, alignment: u64) -> Result<(), Error> {
        let padding = self.position.next_multiple_of(alignment) - self.position;
        self.append(&[0; PAGE_BYTES as usize][..padding as usize])
    }

    fn error(&self, action: impl Into<String>, source: io::Error) -> Error {
        Error::Io { path: self.path.clone(), action: action.into(), part: None, source }
    }

    fn write_error(&self, source: io::Error) -> Error {
        self.error("write the file; free some space on the disk and convert again", source)
    }
}

/// The bytes of a section.
fn section_bytes(resident: &Resident, section: Section) -> serde_json::Result<Cow<'_, [u8]>> {
    Ok(Cow::Borrowed(match section {
        Section::Manifest => return serde_json::to_vec(&resident.manifest).map(Cow::Owned),
        Section::Objects => bytemuck::cast_slice(&resident.objects),
        Section::Instances => bytemuck::cast_slice(&resident.instances),
        Section::Leaves => bytemuck::cast_slice(&resident.leaves),
        Section::Top2 => bytemuck::cast_slice(&resident.top2),
        Section::Top8 => bytemuck::cast_slice(&resident.top8),
        Section::Bricks => bytemuck::cast_slice(&resident.bricks),
        Section::Materials => bytemuck::cast_slice(&resident.materials),
        Section::Textures => bytemuck::cast_slice(&resident.textures),
    }))
}

/// The folder that a file of this path lies in.
fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Makes a rename in `folder` last through a power cut.
#[cfg(unix)]
fn sync_folder(folder: &Path) -> io::Result<()> {
    fs::File::open(folder)?.sync_all()
}

/// Folders cannot be synced here; the rename is in the file system's journal.
#[cfg(not(unix))]
fn sync_folder(_folder: &Path) -> io::Result<()> {
    Ok(())
}
