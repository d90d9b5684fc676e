//! The bytes of scene files.

use bricks::layout::{DirectoryEntry, ENTRY_BYTES, Header, PAGE_BYTES};
use bricks::*;
use bytemuck::Pod;
use std::path::Path;
use xxhash_rust::xxh3::xxh3_64;

/// The bytes of a scene file, for spoiling.
pub struct Image {
    pub bytes: Vec<u8>,
}

impl Image {
    pub fn read(path: &Path) -> Image {
        Image { bytes: std::fs::read(path).unwrap() }
    }

    pub fn header(&self) -> Header {
        bytemuck::pod_read_unaligned(&self.bytes[..size_of::<Header>()])
    }

    /// The sections that the file has.
    pub fn sections(&self) -> Vec<Section> {
        let Header { directory_offset, directory_bytes, .. } = self.header();
        let entries = (directory_offset..directory_offset + directory_bytes).step_by(ENTRY_BYTES as usize);
        let kind = |at: u64| bytemuck::pod_read_unaligned::<u32>(&self.bytes[at as usize..][..4]);
        let named = |kind| Section::ALL.into_iter().find(|section| section.kind() == kind).unwrap();
        entries.map(|at| named(kind(at))).collect()
    }

    fn entry_at(&self, section: Section) -> usize {
        let index = self.sections().iter().position(|own| *own == section);
        let index = index.unwrap_or_else(|| panic!("the file has no section {section}"));
        self.header().directory_offset as usize + index * size_of::<DirectoryEntry>()
    }

    pub fn entry(&self, section: Section) -> DirectoryEntry {
        bytemuck::pod_read_unaligned(&self.bytes[self.entry_at(section)..][..size_of::<DirectoryEntry>()])
    }

    pub fn section(&mut self, section: Section) -> &mut [u8] {
        let entry = self.entry(section);
        &mut self.bytes[entry.offset as usize..][..entry.bytes as usize]
    }

    /// Changes a record; checksums are right afterwards.
    pub fn edit<T: Pod>(&mut self, section: Section, index: u32, edit: impl FnOnce(&mut T)) {
        let bytes = &mut self.section(section)[index as usize * size_of::<T>()..][..size_of::<T>()];
        let mut record: T = bytemuck::pod_read_unaligned(bytes);
        edit(&mut record);
        bytes.copy_from_slice(bytemuck::bytes_of(&record));
        self.seal();
    }

    /// Changes the entry of a section; checksums of the directory and header are right afterwards.
    pub fn edit_entry(&mut self, section: Section, edit: impl FnOnce(&mut DirectoryEntry)) {
        let at = self.entry_at(section);
        let mut entry = self.entry(section);
        edit(&mut entry);
        self.bytes[at..][..size_of::<DirectoryEntry>()].copy_from_slice(bytemuck::bytes_of(&entry));
        self.seal_directory();
    }

    /// Bytes of all sections.
    pub fn sections_bytes(&self) -> u64 {
        self.sections().into_iter().map(|section| self.entry(section).bytes).sum()
    }

    /// Gives the directory another length; its checksum and that of the header are right afterwards.
    pub fn resize_directory(&mut self, bytes: u64) {
        self.edit_header(|header| header.directory_bytes = bytes);
        self.seal_directory();
    }

    /// Changes the header; its checksum is right afterwards.
    pub fn edit_header(&mut self, edit: impl FnOnce(&mut Header)) {
        let mut header = self.header();
        edit(&mut header);
        self.bytes[..PAGE_BYTES as usize].copy_from_slice(&header.page());
    }

    /// Changes the bytes of a payload; checksums are right afterwards.
    pub fn edit_payload(&mut self, payload: Payload, edit: impl FnOnce(&mut [u8])) {
        let (section, index) = match payload {
            Payload::Geometry(level @ 3..) | Payload::Attributes(level @ 3..) => (Section::Levels, level - 3),
            Payload::Geometry(index) | Payload::Attributes(index) | Payload::Proxies(index) => (Section::Bricks, index),
            Payload::Texture(index) => (Section::Textures, index),
            Payload::Opacity(index) => (Section::OpacityMaps, index),
            Payload::Tile(index) => (Section::Tiles, index),
            Payload::Displacement(index) => (Section::Displacement, index),
        };
        let bytes = &mut self.bytes.clone();
        let update = |span: &mut Span| {
            let payload = &mut bytes[span.offset as usize..][..span.bytes as usize];
            edit(payload);
            span.checksum = xxh3_64(payload);
        };
        match section {
            Section::Bricks | Section::Levels => {
                let mut record = match section {
                    Section::Levels => self.record::<Level>(section, index).brick,
                    _ => self.record::<Brick>(section, index),
                };
                match payload {
                    Payload::Geometry(_) => update(&mut record.geometry),
                    Payload::Proxies(_) => update(&mut record.proxies),
                    _ => update(&mut record.attributes),
                }
                let root = bytemuck::pod_read_unaligned(&bytes[record.geometry.offset as usize..][..size_of::<Node>()]);
                record.root = root;
                self.bytes.copy_from_slice(bytes);
                match section {
                    Section::Levels => self.edit(section, index, |level: &mut Level| level.brick = record),
                    _ => self.edit(section, index, |brick| *brick = record),
                }
            }
            Section::Tiles => {
                let mut record = self.record::<Span>(section, index);
                update(&mut record);
                self.bytes.copy_from_slice(bytes);
                self.edit(section, index, |span| *span = record);
            }
            Section::Displacement => {
                let mut record = self.record::<DisplacementField>(section, index);
                update(&mut record.span);
                self.bytes.copy_from_slice(bytes);
                self.edit(section, index, |field| *field = record);
            }
            Section::OpacityMaps => {
                let mut record = self.record::<OpacityMap>(section, index);
                update(&mut record.texels);
                self.bytes.copy_from_slice(bytes);
                self.edit(section, index, |map| *map = record);
            }
            _ => {
                let mut record = self.record::<Texture>(section, index);
                update(&mut record.tail);
                self.bytes.copy_from_slice(bytes);
                self.edit(section, index, |texture| *texture = record);
            }
        }
    }

    pub fn record<T: Pod>(&mut self, section: Section, index: u32) -> T {
        bytemuck::pod_read_unaligned(&self.section(section)[index as usize * size_of::<T>()..][..size_of::<T>()])
    }

    /// Makes the checksums of the sections, the directory and the header right.
    pub fn seal(&mut self) {
        for section in self.sections() {
            let checksum = xxh3_64(self.section(section));
            let at = self.entry_at(section) + std::mem::offset_of!(DirectoryEntry, checksum);
            self.bytes[at..at + 8].copy_from_slice(&checksum.to_le_bytes());
        }
        self.seal_directory();
    }

    fn seal_directory(&mut self) {
        let header = self.header();
        let directory = &self.bytes[header.directory_offset as usize..][..header.directory_bytes as usize];
        let checksum = xxh3_64(directory);
        self.edit_header(|header| header.directory_checksum = checksum);
    }
}
