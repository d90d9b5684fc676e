//! Writes a scene file so that it appears whole or not at all.

use crate::ending::Temporary;
use crate::error::{Error, Flaw, Part};
use crate::file::SceneFile;
use crate::layout::{DirectoryEntry, Header, MAGIC, MAX_PAYLOAD_BYTES, PAGE_BYTES, SECTION_ALIGN, Section, VERSION};
use crate::payload::Payload;
use crate::planted::{self, Defect};
use crate::records::Span;
use crate::resident::Resident;
use crate::source::{ByteSource, ReadSource};
use crate::validate;
use std::borrow::Cow;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use tempfile::{NamedTempFile, TempPath};
use xxhash_rust::xxh3::xxh3_64;

/// Bytes collected before they are written.
const BUFFER_BYTES: usize = 1 << 20;

/// Writes a scene file under a temporary name in the folder of its own: payloads first, then the resident part. Only
/// [`Self::finish`] gives it its name, in one step and after everything is on the disk. If the writer is dropped
/// before, the temporary file is removed; whatever had the name keeps it.
///
/// A writer that began with [`Self::reserve`] can instead leave its temporary file, to be continued by another process.
#[derive(Debug)]
pub struct Writer {
    path: PathBuf,
    /// `path` with a symbolic link followed, so that finishing replaces the file and not the link.
    target: PathBuf,
    file: BufWriter<NamedTempFile>,
    position: u64,
    spans: Vec<Span>,
    _noted: Temporary,
}

impl Writer {
    /// Starts a file that will be called `path`. Its folder must exist.
    pub fn create(path: impl AsRef<Path>) -> Result<Writer, Error> {
        let (path, target, name) = names(path.as_ref())?;
        let mut builder = tempfile::Builder::new();
        let prefix = format!("{name}.");
        builder.prefix(&prefix).suffix(".partial");
        // The permissions of an ordinary new file, not the private ones of a temporary: the umask applies.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let temporary = builder.tempfile_in(folder_of(&target)).map_err(|source| create_error(&path, source))?;
        Partial::new(path, target, temporary).start()
    }

    /// Reserves the temporary file `.NAME.partial` for a file that will be called `path`, for this process alone. Its
    /// folder must exist. A file that an earlier process left there is kept until [`Partial::start`].
    pub fn reserve(path: impl AsRef<Path>) -> Result<Partial, Error> {
        let (path, target, name) = names(path.as_ref())?;
        if planted::is(Defect::OldOutput) {
            File::create(&target).map_err(|source| create_error(&path, source))?;
        }
        let partial = folder_of(&target).join(format!("{name}.partial"));
        loop {
            let options = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&partial);
            let file = options.map_err(|source| create_error(&path, source))?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let action = "write it while another process does; wait for that or give another name".to_owned();
                    return Err(Error::Io { path, action, part: None, source: io::ErrorKind::ResourceBusy.into() });
                }
                Err(TryLockError::Error(source)) => return Err(create_error(&path, source)),
            }
            // The process that held the lock may have renamed or removed the file meanwhile.
            if is_same(&file, &partial) {
                let temporary = TempPath::try_from_path(&partial).map_err(|source| create_error(&path, source))?;
                return Ok(Partial::new(path, target, NamedTempFile::from_parts(file, temporary)));
            }
        }
    }

    /// Hands everything written to the operating system, so that it outlives this process, and returns how many bytes
    /// that is: what [`Partial::resume`] takes.
    pub fn checkpoint(&mut self) -> Result<u64, Error> {
        if !planted::is(Defect::EarlyRecord) {
            self.file.flush().map_err(|source| self.write_error(source))?;
        }
        Ok(self.position)
    }

    /// Waits until everything written is on the disk, so that other machines read it too ([`Written::partial`]).
    ///
    /// # Errors
    /// It cannot be written.
    pub fn sync(&mut self) -> Result<(), Error> {
        self.checkpoint()?;
        self.file.get_ref().as_file().sync_data().map_err(|source| self.write_error(source))
    }

    /// Opens what has been written so far, to read payloads back. More may be written meanwhile.
    ///
    /// # Errors
    /// What is collected cannot be written, or the file cannot be opened again.
    pub fn written(&mut self) -> Result<Written, Error> {
        self.checkpoint()?;
        let file = self.file.get_ref().reopen();
        let file = file.map_err(|source| self.error("read what was written of the file", source))?;
        Ok(Written { path: self.path.clone(), source: ReadSource::new(file) })
    }

    /// Leaves the temporary file.
    pub fn keep(self) {
        // What is not flushed is not part of any checkpoint.
        Partial::new(self.path, self.target, self.file.into_parts().0).keep();
    }

    /// The path that the file will have.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a payload at the next multiple of [`PAGE_BYTES`] and returns where it lies. `bytes` must be a multiple of
    /// 16 long, not empty, and at most [`MAX_PAYLOAD_BYTES`]. Every payload that is written must be one of the resident
    /// part given to [`Self::finish`], those of displacement fields after all others.
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
        let directory_bytes = resident.directory_bytes();
        let mut end = directory_offset + directory_bytes;
        let mut directory = Vec::with_capacity(Section::ALL.len());
        let mut sections = Vec::with_capacity(Section::ALL.len());
        for section in resident.sections() {
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
            directory_bytes,
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
                found: format!(
                    "no brick, level, texture, tile, map or field with the payload written at byte {}",
                    self.spans[index].offset
                ),
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

/// Payloads of a file that is still being written.
pub struct Written {
    path: PathBuf,
    source: ReadSource,
}

impl Written {
    /// Opens what another process has written so far, from [`Writer::reserve`], of the file that will be called `path`.
    ///
    /// # Errors
    /// It cannot be opened.
    pub fn partial(path: impl AsRef<Path>) -> Result<Self, Error> {
        let (path, target, name) = names(path.as_ref())?;
        let file = File::open(folder_of(&target).join(format!("{name}.partial")));
        let file = file.map_err(|source| {
            let action = "read what is written of the file so far; let every worker see its folder".to_owned();
            Error::Io { path: path.clone(), action, part: None, source }
        })?;
        Ok(Self { path, source: ReadSource::new(file) })
    }

    /// The bytes of a payload as they were given to [`Writer::write`]; any thread may ask.
    ///
    /// # Errors
    /// The payload cannot be read, or is not what was written.
    pub fn read(&self, span: Span) -> Result<Vec<u8>, Error> {
        let mut bytes = vec![0; span.bytes as usize];
        let read = self.source.read_at(span.offset, &mut bytes).and_then(|()| {
            let is_same = xxh3_64(&bytes) == span.checksum;
            if is_same { Ok(()) } else { Err(io::Error::new(io::ErrorKind::InvalidData, "it was damaged meanwhile")) }
        });
        let action = || format!("read what was written at byte {}; convert again", span.offset);
        read.map_err(|source| Error::Io { path: self.path.clone(), action: action(), part: None, source })?;
        Ok(bytes)
    }
}

/// A reserved temporary file. Dropping it removes the file.
#[derive(Debug)]
pub struct Partial {
    path: PathBuf,
    target: PathBuf,
    temporary: NamedTempFile,
    noted: Temporary,
}

impl Partial {
    fn new(path: PathBuf, target: PathBuf, temporary: NamedTempFile) -> Self {
        let noted = Temporary::note(temporary.path());
        Self { path, target, temporary, noted }
    }

    /// Leaves the file as it is.
    pub fn keep(self) {
        // It has a name already; that it stays is all that is asked for.
        let _ = self.temporary.into_temp_path().keep();
    }

    /// Whether nothing was written, as when the file is new.
    pub fn is_empty(&self) -> bool {
        self.temporary.as_file().metadata().is_ok_and(|file| file.len() == 0)
    }

    /// Starts from nothing.
    pub fn start(self) -> Result<Writer, Error> {
        let emptied = self.temporary.as_file().set_len(0);
        let mut writer = self.writer(0, Vec::new());
        emptied.map_err(|source| writer.write_error(source))?;
        writer.append(&[0; PAGE_BYTES as usize])?;
        Ok(writer)
    }

    /// Starts with all payloads of `scene` but those of its displacement fields, which lie behind the others. They come
    /// to lie where they lay, so the records of `scene` go on to be right; fields may follow. Checksums are compared in
    /// the copies; `progress` is called with the length of each.
    ///
    /// # Errors
    /// A payload of `scene` cannot be read or is damaged, or the file cannot be written.
    pub fn start_from(self, scene: &SceneFile, progress: &mut dyn FnMut(u64)) -> Result<Writer, Error> {
        let payloads = scene.resident().payloads();
        let mut kept: Vec<_> = payloads.filter(|(payload, _)| !matches!(payload, Payload::Displacement(_))).collect();
        kept.sort_unstable_by_key(|(_, span)| span.offset);
        let mut writer = self.start()?;
        let mut bytes = Vec::new();
        for (payload, span) in kept {
            bytes.resize(span.bytes as usize, 0);
            scene.copy_stored(payload, &mut bytes)?;
            // The payloads of an open file follow each other as those of a writer do.
            let written = writer.write(&bytes)?;
            debug_assert_eq!(written, span);
            progress(span.bytes);
        }
        Ok(writer)
    }

    /// Continues after `position` bytes with the payloads `spans`, in the order in which they were written. Their bytes
    /// are checked; `progress` is called with the length of each.
    ///
    /// # Errors
    /// The file is not what it was at that checkpoint; it is left as it is.
    pub fn resume(self, position: u64, spans: Vec<Span>, progress: &mut dyn FnMut(u64)) -> Result<Writer, Error> {
        let checked = self.check(position, &spans, progress);
        let checked = checked.and_then(|()| {
            let mut file = self.temporary.as_file();
            file.set_len(position).and_then(|()| file.seek(SeekFrom::Start(position))).map(|_| ())
        });
        if let Err(source) = checked {
            let action = "continue the file; convert again from the start".to_owned();
            let error = Error::Io { path: self.path.clone(), action, part: None, source };
            self.keep();
            return Err(error);
        }
        Ok(self.writer(position, spans))
    }

    fn check(&self, position: u64, spans: &[Span], progress: &mut dyn FnMut(u64)) -> io::Result<()> {
        let mut file = self.temporary.as_file();
        let mut bytes = Vec::new();
        for span in spans {
            let inside = span.offset.checked_add(span.bytes).is_some_and(|end| end <= position);
            if !inside || span.bytes > MAX_PAYLOAD_BYTES {
                return Err(io::Error::new(io::ErrorKind::InvalidData, "a payload lies outside of what was written"));
            }
            bytes.resize(span.bytes as usize, 0);
            file.seek(SeekFrom::Start(span.offset)).and_then(|_| file.read_exact(&mut bytes))?;
            if xxh3_64(&bytes) != span.checksum {
                let what = format!("what was written at byte {} is damaged", span.offset);
                return Err(io::Error::new(io::ErrorKind::InvalidData, what));
            }
            progress(span.bytes);
        }
        Ok(())
    }

    fn writer(self, position: u64, spans: Vec<Span>) -> Writer {
        let Self { path, target, temporary, noted } = self;
        let file = BufWriter::with_capacity(BUFFER_BYTES, temporary);
        Writer { path, target, file, position, spans, _noted: noted }
    }
}

/// `path`, it with a symbolic link followed, and the start of the names of temporary files for it.
fn names(path: &Path) -> Result<(PathBuf, PathBuf, String), Error> {
    let path = path.to_owned();
    let error = |action: &str, kind: io::ErrorKind| {
        Err(Error::Io { path: path.clone(), action: action.to_owned(), part: None, source: kind.into() })
    };
    if path.is_dir() {
        return error("write a file of this name; give another", io::ErrorKind::IsADirectory);
    }
    let target = fs::canonicalize(&path).unwrap_or_else(|_| path.clone());
    match target.file_name().map(|name| format!(".{}", name.to_string_lossy())) {
        Some(name) => Ok((path, target, name)),
        None => error("write a file without a name; give one", io::ErrorKind::InvalidInput),
    }
}

fn create_error(path: &Path, source: io::Error) -> Error {
    let action = "create a temporary file beside it; check the folder and its permissions".to_owned();
    Error::Io { path: path.to_owned(), action, part: None, source }
}

/// Whether the name still leads to the open file.
#[cfg(unix)]
fn is_same(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let identity = |metadata: fs::Metadata| (metadata.dev(), metadata.ino());
    file.metadata().map(identity).ok() == fs::metadata(path).map(identity).ok()
}

/// An open file keeps its name here.
#[cfg(not(unix))]
fn is_same(_file: &File, _path: &Path) -> bool {
    true
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
        Section::OpacityMaps => bytemuck::cast_slice(&resident.opacity_maps),
        Section::Tiles => bytemuck::cast_slice(&resident.tiles),
        Section::Lights => bytemuck::cast_slice(&resident.lights),
        Section::Occupancy => bytemuck::cast_slice(&resident.occupancy),
        Section::Displacement => bytemuck::cast_slice(&resident.displacement),
        Section::Levels => bytemuck::cast_slice(&resident.levels),
        Section::LevelLeaves => bytemuck::cast_slice(&resident.level_leaves),
        Section::LevelTop2 => bytemuck::cast_slice(&resident.level_top2),
        Section::LevelTop8 => bytemuck::cast_slice(&resident.level_top8),
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
    File::open(folder)?.sync_all()
}

/// Folders cannot be synced here; the rename is in the file system's journal.
#[cfg(not(unix))]
fn sync_folder(_folder: &Path) -> io::Result<()> {
    Ok(())
}
