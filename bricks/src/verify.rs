//! Reads a whole file and lists everything that is wrong with it.

use crate::error::{Error, Flaw, Part};
use crate::layout::{Header, MAX_PAYLOAD_BYTES, PAGE_BYTES, Section};
use crate::manifest::Manifest;
use crate::occupancy::OccupancyMap;
use crate::payload::Payload;
use crate::reader::{Decoding, Directory, Reader, length_of, open_file};
use crate::records::{AttributeLayout, Brick, Span, Texture};
use crate::resident::Resident;
use crate::source::{ByteSource, ReadSource};
use crate::validate;
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::Path;

/// Bytes of payloads that threads share out before progress is reported, unless a single payload is longer.
const BATCH_BYTES: u64 = 64 << 20;

/// What [`verify_file`] found.
#[derive(Debug)]
pub struct VerifyReport {
    /// Length of the file in bytes.
    pub file_bytes: u64,
    /// Payloads that were checked.
    pub payloads: u64,
    /// All that is wrong, in order of reading. [`Error::part`] names the part of the file.
    pub problems: Vec<Error>,
}

impl VerifyReport {
    /// Whether every byte is as it was written and the file obeys the format.
    pub fn is_ok(&self) -> bool {
        self.problems.is_empty()
    }
}

/// Reads every byte of a file and checks it: header, directory, sections, payloads and their contents
/// ([`validate::contents`]), and that all padding is zero. A flip of any byte is found and named.
///
/// What depends on a damaged part cannot be checked: behind a damaged header or directory nothing; if a section is
/// damaged, the other sections, and the checksums of the payloads that the others name.
///
/// Payloads are read by the threads of the current rayon pool, each with buffers as long as its longest payload; the
/// problems come in the order of the file all the same.
///
/// `progress` is called with the bytes done and in all, first with 0 and last with all of them.
///
/// # Errors
///
/// Only if the file cannot be opened. Parts that cannot be read are problems in the report.
pub fn verify_file(path: impl AsRef<Path>, progress: &mut dyn FnMut(u64, u64)) -> Result<VerifyReport, Error> {
    let (path, file) = open_file(path.as_ref())?;
    let source = ReadSource::new(file);
    Ok(verify_source(&path, &source, length_of(&path, &source)?, progress))
}

/// As [`verify_file`], for a file of `length` bytes.
pub(crate) fn verify_source(
    path: &Path,
    source: &dyn ByteSource,
    length: u64,
    progress: &mut dyn FnMut(u64, u64),
) -> VerifyReport {
    progress(0, length);
    let mut verifier = Verifier {
        reader: Reader { path, source },
        report: VerifyReport { file_bytes: length, payloads: 0, problems: Vec::new() },
        progress,
        done: 0,
    };
    if let Some((header, directory)) = verifier.frame(length) {
        verifier.body(&header, &directory);
    }
    (verifier.progress)(length, length);
    verifier.report
}

struct Verifier<'a> {
    reader: Reader<'a>,
    report: VerifyReport,
    progress: &'a mut dyn FnMut(u64, u64),
    done: u64,
}

impl Verifier<'_> {
    /// The value, or a problem in the report.
    fn keep<T>(&mut self, result: Result<T, Error>) -> Option<T> {
        result.map_err(|problem| self.report.problems.push(problem)).ok()
    }

    fn keep_flaw(&mut self, result: Result<(), Flaw>) -> bool {
        let result = result.map_err(|flaw| self.reader.invalid(flaw));
        self.keep(result).is_some()
    }

    fn advance(&mut self, bytes: u64) {
        self.done += bytes;
        (self.progress)(self.done.min(self.report.file_bytes), self.report.file_bytes);
    }

    /// Header and directory, without which nothing is found.
    fn frame(&mut self, length: u64) -> Option<(Header, Directory)> {
        let header = self.reader.header(length);
        let header = self.keep(header)?;
        self.advance(PAGE_BYTES);
        self.reader.announce_resident(&header);
        let directory = self.reader.directory(&header);
        let directory = self.keep(directory)?;
        self.advance(header.directory_bytes);
        Some((header, directory))
    }

    /// Sections, payloads and padding.
    fn body(&mut self, header: &Header, directory: &Directory) {
        let manifest: Option<Manifest> = {
            let manifest = self.reader.manifest(directory);
            self.keep(manifest)
        };
        let objects = self.section(directory, Section::Objects);
        let instances = self.section(directory, Section::Instances);
        let leaves = self.section(directory, Section::Leaves);
        let top2 = self.section(directory, Section::Top2);
        let top8 = self.section(directory, Section::Top8);
        let bricks: Option<Vec<Brick>> = self.section(directory, Section::Bricks);
        let materials = self.section(directory, Section::Materials);
        let textures: Option<Vec<Texture>> = self.section(directory, Section::Textures);
        let opacity_maps = self.section(directory, Section::OpacityMaps);
        let tiles: Option<Vec<Span>> = self.section(directory, Section::Tiles);
        let lights = self.section(directory, Section::Lights);
        let occupancy = self.section(directory, Section::Occupancy);
        let displacement = self.section(directory, Section::Displacement);
        let levels = self.section(directory, Section::Levels);
        let level_leaves = self.section(directory, Section::LevelLeaves);
        let level_top2 = self.section(directory, Section::LevelTop2);
        let level_top8 = self.section(directory, Section::LevelTop8);
        self.advance(directory.section_bytes());

        let whole = manifest.is_some()
            && objects.is_some()
            && instances.is_some()
            && leaves.is_some()
            && top2.is_some()
            && top8.is_some()
            && bricks.is_some()
            && materials.is_some()
            && textures.is_some()
            && opacity_maps.is_some()
            && tiles.is_some()
            && lights.is_some()
            && occupancy.is_some()
            && displacement.is_some()
            && levels.is_some()
            && level_leaves.is_some()
            && level_top2.is_some()
            && level_top8.is_some();
        let resident = Resident {
            manifest: manifest.unwrap_or_default(),
            objects: objects.unwrap_or_default(),
            instances: instances.unwrap_or_default(),
            leaves: leaves.unwrap_or_default(),
            top2: top2.unwrap_or_default(),
            top8: top8.unwrap_or_default(),
            bricks: bricks.unwrap_or_default(),
            materials: materials.unwrap_or_default(),
            textures: textures.unwrap_or_default(),
            opacity_maps: opacity_maps.unwrap_or_default(),
            tiles: tiles.unwrap_or_default(),
            lights: lights.unwrap_or_default(),
            occupancy: occupancy.unwrap_or_default(),
            displacement: displacement.unwrap_or_default(),
            levels: levels.unwrap_or_default(),
            level_leaves: level_leaves.unwrap_or_default(),
            level_top2: level_top2.unwrap_or_default(),
            level_top8: level_top8.unwrap_or_default(),
        };
        let valid = whole && self.keep_flaw(validate::resident(&resident));
        let tiled = whole && self.keep_flaw(validate::spans(&resident, header.directory_offset));
        let paddings = self.payloads(&resident, header.directory_offset, valid && tiled, tiled);
        self.report.problems.extend(paddings);
        self.section_padding(header, directory);
    }

    fn section<T: bytemuck::Pod>(&mut self, directory: &Directory, section: Section) -> Option<Vec<T>> {
        let records = self.reader.section(directory, section);
        self.keep(records)
    }

    /// Every payload in order of the file; what is in it only if the resident part is `valid`. With payloads that are
    /// `tiled`, the zeros between them as well: what is wrong with those is returned, in the order of the payloads.
    fn payloads(&mut self, resident: &Resident, payload_end: u64, valid: bool, tiled: bool) -> Vec<Error> {
        // What lies outside is reported by the checks of the resident part, or by those of the section that made them
        // impossible.
        let inside = |span: &Span| {
            span.offset.checked_add(span.bytes).is_some_and(|end| end <= payload_end) && span.bytes <= MAX_PAYLOAD_BYTES
        };
        let mut payloads: Vec<_> = resident.payloads().filter(|(_, span)| inside(span)).collect();
        payloads.sort_unstable_by_key(|(payload, span)| (span.offset, *payload));
        let mut paddings = HashMap::new();
        let mut rest = &payloads[..];
        while !rest.is_empty() {
            let mut bytes = 0;
            let fits = |(_, span): &&(Payload, Span)| {
                bytes += span.bytes;
                bytes <= BATCH_BYTES
            };
            let (batch, after) = rest.split_at(rest.iter().take_while(fits).count().max(1));
            rest = after;
            let reader = &self.reader;
            if reader.source.announced_bytes().is_some() {
                // With the padding behind it.
                let end = |span: &Span| if tiled { padded_end(span) } else { span.range().end };
                let own = batch.iter().map(|(_, span)| span.offset..end(span));
                // Geometry is compared with the occupancy of its brick.
                let maps = batch.iter().filter(|_| valid).filter_map(|(payload, _)| match payload {
                    Payload::Geometry(index) => resident.span(Payload::Proxies(*index)),
                    _ => None,
                });
                reader.source.announce(&own.chain(maps.map(|span| span.range())).collect::<Vec<_>>());
            }
            let check = |buffers: &mut (Vec<u8>, Decoding), &(payload, span): &(Payload, Span)| {
                let checked = check_payload(reader, resident, (payload, span), valid, buffers);
                let checked = checked.err().map(|error| error.within(resident.place_of(payload)));
                let level = || resident.level_of(payload).map(|_| resident.name_of(payload));
                let part = Part::PaddingAfterPayload(payload);
                let padding = || check_padding(reader, part, span.range().end, padded_end(&span)).err();
                let padding = if tiled { padding().map(|error| (payload, error.within(level()))) } else { None };
                (checked, padding)
            };
            // The collection keeps the order of the batch.
            let problems: Vec<(Option<Error>, _)> = batch.par_iter().map_init(Default::default, check).collect();
            for (problem, padding) in problems {
                self.report.problems.extend(problem);
                paddings.extend(padding);
            }
            self.report.payloads += batch.len() as u64;
            let end = |span: &Span| if tiled { padded_end(span) } else { span.range().end };
            self.advance(batch.iter().map(|(_, span)| end(span) - span.offset).sum());
        }
        debug_assert!(!tiled || payloads.iter().all(|(_, span)| padded_end(span) <= payload_end));
        resident.payloads().filter_map(|(payload, _)| paddings.remove(&payload)).collect()
    }

    /// Zeros between directory and sections, which tile the rest of the file.
    fn section_padding(&mut self, header: &Header, directory: &Directory) {
        let mut part = Part::PaddingAfterDirectory;
        let mut end = header.directory_offset + header.directory_bytes;
        for (section, entry) in directory.iter() {
            let checked = check_padding(&self.reader, part, end, entry.offset);
            self.keep(checked);
            self.advance(entry.offset - end);
            part = Part::PaddingAfterSection(*section);
            end = entry.offset + entry.bytes;
        }
    }
}

/// Where the zeros after a payload end.
fn padded_end(span: &Span) -> u64 {
    span.range().end.next_multiple_of(PAGE_BYTES)
}

/// Checks that less than a page of bytes is zero, which are `part`.
fn check_padding(reader: &Reader, part: Part, start: u64, end: u64) -> Result<(), Error> {
    let mut page = [0; PAGE_BYTES as usize];
    let page = &mut page[..(end - start) as usize];
    if page.is_empty() {
        return Ok(());
    }
    let mut times = 0;
    loop {
        reader.bytes(part, start, page)?;
        let Some(at) = page.iter().position(|&byte| byte != 0) else { return Ok(()) };
        if !reader.source.distrust(start..end, times) {
            let (path, offset) = (reader.path.to_owned(), start + at as u64);
            return Err(Error::Padding { path, part, offset, found: page[at] });
        }
        times += 1;
    }
}

/// Reads a payload and checks its bytes, and what is in them if the resident part is `valid`.
fn check_payload(
    reader: &Reader,
    resident: &Resident,
    (payload, span): (Payload, Span),
    valid: bool,
    (buffer, decoding): &mut (Vec<u8>, Decoding),
) -> Result<(), Error> {
    // Buffers are not initialised anew where they were long enough before: every byte is written.
    match payload {
        Payload::Attributes(brick) if valid => {
            let Some(brick) = resident.brick(brick) else { return Ok(()) };
            buffer.resize(AttributeLayout::of(brick).bytes as usize, 0);
            reader.attributes(payload, span, brick, decoding, buffer)?;
        }
        Payload::Displacement(field) if valid => {
            let field = &resident.displacement[field as usize];
            buffer.resize(field.loaded_bytes() as usize, 0);
            reader.displacement(payload, field, decoding, buffer)?;
        }
        _ => {
            buffer.resize(span.bytes as usize, 0);
            reader.payload(payload, span, buffer)?;
        }
    }
    if valid {
        let checked = validate::payload(resident, payload, buffer);
        let contents = |()| validate::contents(resident, payload, buffer, map_of(reader, resident, payload).as_ref());
        checked.and_then(contents).map_err(|flaw| reader.invalid(flaw))?;
    }
    Ok(())
}

/// The occupancy that the vertices of a geometry payload lie in. None if it cannot be read: that is found where it is
/// checked.
fn map_of(reader: &Reader, resident: &Resident, payload: Payload) -> Option<OccupancyMap> {
    let Payload::Geometry(index) = payload else { return None };
    let proxies = Payload::Proxies(index);
    let span = resident.span(proxies)?;
    let mut packed = vec![0; span.bytes as usize];
    reader.payload(proxies, span, &mut packed).ok()?;
    OccupancyMap::unpack(&packed).ok()
}
