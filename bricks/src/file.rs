//! An open scene file.

use crate::error::{Error, Flaw, Part};
use crate::layout::Section;
use crate::occupancy::OccupancyMap;
use crate::payload::Payload;
use crate::place::PlaceError;
use crate::reader::{Decoding, Reader, duplicate, length_of, open_file};
use crate::records::{AttributeLayout, Brick, Span};
use crate::resident::Resident;
use crate::source::{ByteSource, MapSource, ReadSource};
use crate::validate;
use crate::verify::{VerifyReport, verify_source};
use std::borrow::Cow;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// How payloads are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Copied out of a memory map.
    Map,
    /// Read at positions.
    Read,
}

/// An open scene file: its resident part in memory, checked; its payloads read on demand, checked as they are copied.
///
/// It may be shared between threads. A file that is replaced by renaming while open stays the one that was opened.
pub struct SceneFile {
    path: PathBuf,
    /// What the file is read by on opening and by [`Self::verify`]: never a map.
    file: Arc<dyn ByteSource>,
    /// What payloads are copied from.
    source: Arc<dyn ByteSource>,
    file_bytes: u64,
    resident_bytes: u64,
    checksum: u64,
    resident: Resident,
    validated: Arc<Validated>,
}

impl SceneFile {
    /// Opens a scene file by memory map or, where the system cannot map it, by positional reads.
    ///
    /// Reads and checks the header, the directory and the resident part, and nothing else.
    pub fn open(path: impl AsRef<Path>) -> Result<SceneFile, Error> {
        let (path, file) = open_file(path.as_ref())?;
        let source: Arc<dyn ByteSource> = match MapSource::new(duplicate(&path, &file)?) {
            Ok(map) => Arc::new(map),
            Err(_) => Arc::new(ReadSource::new(duplicate(&path, &file)?)),
        };
        Self::load(path, Arc::new(ReadSource::new(file)), source)
    }

    /// Opens a scene file with the given access; as [`Self::open`], but a map that fails is an error.
    pub fn open_with(path: impl AsRef<Path>, access: Access) -> Result<SceneFile, Error> {
        let (path, file) = open_file(path.as_ref())?;
        let duplicate = duplicate(&path, &file)?;
        let source: Arc<dyn ByteSource> = match access {
            Access::Map => Arc::new(MapSource::new(duplicate).map_err(|source| Error::Io {
                path: path.clone(),
                action: "map the file into memory; open it with positional reads".to_owned(),
                part: None,
                source,
            })?),
            Access::Read => Arc::new(ReadSource::new(duplicate)),
        };
        Self::load(path, Arc::new(ReadSource::new(file)), source)
    }

    /// Opens a scene file that is part of the program, or otherwise in memory; `name` stands for its path in messages.
    /// As [`Self::open`].
    pub fn from_bytes(name: impl Into<PathBuf>, bytes: impl Into<Cow<'static, [u8]>>) -> Result<SceneFile, Error> {
        let bytes: Arc<dyn ByteSource> = Arc::new(Arc::new(bytes.into()));
        Self::load(name.into(), bytes.clone(), bytes)
    }

    /// Opens a scene file that lies elsewhere; `name` stands for its path in messages. As [`Self::open`].
    pub fn from_source(name: impl Into<PathBuf>, source: Arc<dyn ByteSource>) -> Result<SceneFile, Error> {
        Self::load(name.into(), source.clone(), source)
    }

    /// Reads the resident part. It comes by positional reads, so that a failing disk is an error here, not a signal.
    fn load(path: PathBuf, file: Arc<dyn ByteSource>, source: Arc<dyn ByteSource>) -> Result<SceneFile, Error> {
        let reader = Reader { path: &path, source: &*file };
        let header = reader.header(length_of(&path, &*file)?)?;
        reader.announce_resident(&header);
        let directory = reader.directory(&header)?;
        let resident = Resident {
            manifest: reader.manifest(&directory)?,
            objects: reader.section(&directory, Section::Objects)?,
            instances: reader.section(&directory, Section::Instances)?,
            leaves: reader.section(&directory, Section::Leaves)?,
            top2: reader.section(&directory, Section::Top2)?,
            top8: reader.section(&directory, Section::Top8)?,
            bricks: reader.section(&directory, Section::Bricks)?,
            materials: reader.section(&directory, Section::Materials)?,
            textures: reader.section(&directory, Section::Textures)?,
            opacity_maps: reader.section(&directory, Section::OpacityMaps)?,
            tiles: reader.section(&directory, Section::Tiles)?,
            lights: reader.section(&directory, Section::Lights)?,
            occupancy: reader.section(&directory, Section::Occupancy)?,
            displacement: reader.section(&directory, Section::Displacement)?,
            levels: reader.section(&directory, Section::Levels)?,
            level_leaves: reader.section(&directory, Section::LevelLeaves)?,
            level_top2: reader.section(&directory, Section::LevelTop2)?,
            level_top8: reader.section(&directory, Section::LevelTop8)?,
        };
        validate::resident(&resident).map_err(|flaw| reader.invalid(flaw))?;
        validate::spans(&resident, header.directory_offset).map_err(|flaw| reader.invalid(flaw))?;
        let resident_bytes = header.directory_bytes + directory.section_bytes();
        let validated = Arc::new(Validated::none(&resident));
        let (file_bytes, checksum) = (header.file_bytes, header.checksum);
        Ok(SceneFile { path, file, source, file_bytes, resident_bytes, checksum, resident, validated })
    }

    /// The same scene once more, to be placed otherwise: it reads the same file, and has a resident part of its own.
    pub fn duplicate(&self) -> SceneFile {
        let Self { path, file, source, file_bytes, resident_bytes, checksum, resident, validated } = self;
        SceneFile {
            path: path.clone(),
            file: file.clone(),
            source: source.clone(),
            file_bytes: *file_bytes,
            resident_bytes: *resident_bytes,
            checksum: *checksum,
            resident: resident.clone(),
            validated: validated.clone(),
        }
    }

    /// Moves instances, in memory alone: [`Resident::place`].
    ///
    /// # Errors
    /// As of [`Resident::place`].
    pub fn place(&mut self, places: &[(u32, [f64; 12])]) -> Result<(), PlaceError> {
        self.resident.place(places)
    }

    /// Has levels be bricks like others, in memory alone: [`Resident::use_levels`].
    pub fn use_levels(&mut self) {
        self.resident.use_levels();
    }

    /// A brick or level that exists.
    fn brick(&self, index: u32) -> &Brick {
        self.resident.existing_brick(index)
    }

    /// The resident part; it satisfies [`validate::resident`], but for levels in use.
    pub fn resident(&self) -> &Resident {
        &self.resident
    }

    /// The path, or the name, it was opened with.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Length of the file in bytes.
    pub fn file_bytes(&self) -> u64 {
        self.file_bytes
    }

    /// Bytes of the directory and the sections: what opening reads besides the header.
    pub fn resident_bytes(&self) -> u64 {
        self.resident_bytes
    }

    /// The header's checksum: through the directory's, it depends on every byte of the file that means anything.
    pub fn checksum(&self) -> u64 {
        self.checksum
    }

    /// Where a payload lies in the file; all zero for proxies that the scene does not have.
    ///
    /// # Panics
    ///
    /// If the scene has no such brick, texture, tile, map or field, as indexing the resident part would.
    pub fn span(&self, payload: Payload) -> Span {
        match payload {
            Payload::Geometry(brick) => self.brick(brick).geometry,
            Payload::Attributes(brick) => self.brick(brick).attributes,
            Payload::Proxies(brick) => self.brick(brick).proxies,
            Payload::Opacity(map) => self.resident.opacity_maps[map as usize].texels,
            Payload::Texture(texture) => self.resident.textures[texture as usize].tail,
            Payload::Tile(tile) => self.resident.tiles[tile as usize],
            Payload::Displacement(field) => self.resident.displacement[field as usize].span,
        }
    }

    /// Length of a payload as [`Self::copy`] loads it, in bytes; see [`Resident::loaded_bytes`].
    ///
    /// # Panics
    ///
    /// As [`Self::span`].
    pub fn loaded_bytes(&self, payload: Payload) -> u64 {
        match payload {
            Payload::Attributes(brick) => AttributeLayout::of(self.brick(brick)).bytes,
            Payload::Displacement(field) => self.resident.displacement[field as usize].loaded_bytes(),
            _ => self.span(payload).bytes,
        }
    }

    /// Copies a payload to `out`, decoded if it is encoded in the file, and checks the copy: its checksum, then every
    /// index in it (see [`validate::payload`]), so that whoever traverses or shades with it may index freely. Indices
    /// are checked the first time; after that the checksum says that they are the same.
    ///
    /// `out` must be [`Self::loaded_bytes`] long; it needs no alignment. After an error its contents are of no use.
    pub fn copy(&self, payload: Payload, out: &mut [u8]) -> Result<(), Error> {
        self.copy_checked(payload, out).map_err(|error| error.within(self.resident.place_of(payload)))
    }

    fn copy_checked(&self, payload: Payload, out: &mut [u8]) -> Result<(), Error> {
        let length = self.resident.loaded_bytes(payload).ok_or_else(|| self.no_such(payload))?;
        let (span, reader) = self.request(payload, length, out)?;
        match payload {
            Payload::Attributes(brick) => {
                DECODING.with_borrow_mut(|buffers| reader.attributes(payload, span, self.brick(brick), buffers, out))?
            }
            Payload::Displacement(field) => DECODING.with_borrow_mut(|buffers| {
                reader.displacement(payload, &self.resident.displacement[field as usize], buffers, out)
            })?,
            _ => reader.payload(payload, span, out)?,
        }
        let validated = self.validated.of(payload);
        // Whoever sees the flag copies and checks bytes of its own: nothing else has to be visible with it.
        if !validated.load(Ordering::Relaxed) {
            validate::payload(&self.resident, payload, out).map_err(|flaw| reader.invalid(flaw))?;
            validated.store(true, Ordering::Relaxed);
        }
        Ok(())
    }

    /// Says that these payloads will be copied next, each once; see [`ByteSource::announce`].
    pub fn announce(&self, payloads: impl IntoIterator<Item = Payload>) {
        if self.source.announced_bytes().is_some() {
            let spans = payloads.into_iter().filter_map(|payload| self.resident.span(payload));
            let ranges: Vec<_> = spans.filter(|span| span.bytes > 0).map(|span| span.range()).collect();
            self.source.announce(&ranges);
        }
    }

    /// Most bytes of payloads to announce at a time; `None`: announcing has no effect.
    pub fn announced_bytes(&self) -> Option<u64> {
        self.source.announced_bytes()
    }

    /// `payloads` in parts, each of which was announced; all of them where announcing has no effect.
    pub fn in_parts<'a>(&'a self, payloads: &'a [Payload]) -> impl Iterator<Item = &'a [Payload]> {
        let most = self.announced_bytes().unwrap_or(u64::MAX);
        let mut rest = payloads;
        std::iter::from_fn(move || {
            let mut bytes = 0u64;
            let fits = |payload: &&Payload| {
                bytes = bytes.saturating_add(self.resident.span(**payload).map_or(0, |span| span.bytes));
                bytes <= most
            };
            let count = rest.iter().take_while(fits).count().max(1).min(rest.len());
            let (part, after) = rest.split_at(count);
            rest = after;
            self.announce(part.iter().copied());
            (!part.is_empty()).then_some(part)
        })
    }

    /// The occupancy of a brick in all levels, checked as [`Self::copy`] does.
    ///
    /// # Errors
    /// As of [`Self::copy`]; there is no such brick, or the scene has no proxies.
    pub fn occupancy(&self, brick: u32) -> Result<OccupancyMap, Error> {
        let payload = Payload::Proxies(brick);
        let span = self.resident.span(payload).ok_or_else(|| self.no_such(payload))?;
        let mut packed = vec![0; span.bytes as usize];
        self.copy(payload, &mut packed)?;
        OccupancyMap::unpack(&packed).map_err(|error| {
            let flaw = Flaw::packed(Part::Payload(payload), error);
            Reader { path: &self.path, source: &*self.source }.invalid(flaw)
        })
    }

    /// The samples of a displacement field as they are loaded, checked as [`Self::copy`] does.
    ///
    /// # Errors
    /// As of [`Self::copy`]; there is no such field.
    pub fn displacement(&self, field: u32) -> Result<Vec<u8>, Error> {
        let payload = Payload::Displacement(field);
        let record = self.resident.displacement.get(field as usize).ok_or_else(|| self.no_such(payload))?;
        let mut loaded = vec![0; record.loaded_bytes() as usize];
        self.copy(payload, &mut loaded).map(|()| loaded)
    }

    /// Copies a payload to `out` as it is stored and checks its checksum alone.
    ///
    /// `out` must be [`Span::bytes`] long. After an error its contents are of no use.
    pub fn copy_stored(&self, payload: Payload, out: &mut [u8]) -> Result<(), Error> {
        let span = self.resident.span(payload).ok_or_else(|| self.no_such(payload))?;
        let (span, reader) = self.request(payload, span.bytes, out)?;
        reader.payload(payload, span, out).map_err(|error| error.within(self.resident.place_of(payload)))
    }

    /// Where `payload` lies, and a reader of it, if `out` is of the `length` asked for.
    fn request(&self, payload: Payload, length: u64, out: &[u8]) -> Result<(Span, Reader<'_>), Error> {
        if out.len() as u64 != length {
            return Err(Error::Request {
                path: self.path.clone(),
                payload,
                found: format!("{} bytes", out.len()),
                expected: format!("{length} bytes"),
            });
        }
        Ok((self.span(payload), Reader { path: &self.path, source: &*self.source }))
    }

    /// Reads every byte of the file anew, as [`verify_file`](crate::verify_file) does, from the file that was opened.
    pub fn verify(&self, progress: &mut dyn FnMut(u64, u64)) -> Result<VerifyReport, Error> {
        let length = length_of(&self.path, &*self.file)?;
        Ok(verify_source(&self.path, &*self.file, length, progress))
    }

    #[cold]
    fn no_such(&self, payload: Payload) -> Error {
        let expected = match payload {
            Payload::Geometry(_) | Payload::Attributes(_) => {
                let (bricks, levels) = (self.resident.exact_bricks(), self.resident.levels.len());
                let levels = if levels > 0 { format!(" and {levels} levels") } else { String::new() };
                format!("one of {bricks} bricks{levels}")
            }
            Payload::Proxies(_) => format!("one of {} bricks with proxies", self.resident.occupancy.len()),
            Payload::Texture(_) => format!("one of {} textures", self.resident.textures.len()),
            Payload::Opacity(_) => format!("one of {} opacity maps", self.resident.opacity_maps.len()),
            Payload::Tile(_) => format!("one of {} tiles", self.resident.tiles.len()),
            Payload::Displacement(_) => format!("one of {} displacement fields", self.resident.displacement.len()),
        };
        Error::Request { path: self.path.clone(), payload, found: payload.to_string(), expected }
    }
}

thread_local! {
    /// What [`SceneFile::copy`] decodes with; it grows to the longest attributes or displacement field that the thread
    /// meets, and stays.
    static DECODING: RefCell<Decoding> = RefCell::default();
}

/// The payloads whose indices have been found to be in range.
struct Validated {
    geometry: Box<[AtomicBool]>,
    attributes: Box<[AtomicBool]>,
    proxies: Box<[AtomicBool]>,
    textures: Box<[AtomicBool]>,
    opacity: Box<[AtomicBool]>,
    tiles: Box<[AtomicBool]>,
    displacement: Box<[AtomicBool]>,
}

impl Validated {
    fn none(resident: &Resident) -> Self {
        let none = |count: usize| (0..count).map(|_| AtomicBool::new(false)).collect();
        let (bricks, textures) = (resident.bricks.len() + resident.levels_beside().len(), resident.textures.len());
        Self {
            geometry: none(bricks),
            attributes: none(bricks),
            proxies: none(resident.occupancy.len()),
            textures: none(textures),
            opacity: none(resident.opacity_maps.len()),
            tiles: none(resident.tiles.len()),
            displacement: none(resident.displacement.len()),
        }
    }

    /// The flag of a payload that exists.
    fn of(&self, payload: Payload) -> &AtomicBool {
        match payload {
            Payload::Geometry(brick) => &self.geometry[brick as usize],
            Payload::Attributes(brick) => &self.attributes[brick as usize],
            Payload::Proxies(brick) => &self.proxies[brick as usize],
            Payload::Texture(texture) => &self.textures[texture as usize],
            Payload::Opacity(map) => &self.opacity[map as usize],
            Payload::Tile(tile) => &self.tiles[tile as usize],
            Payload::Displacement(field) => &self.displacement[field as usize],
        }
    }
}

impl std::fmt::Debug for SceneFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SceneFile").field("path", &self.path).field("file_bytes", &self.file_bytes).finish()
    }
}
