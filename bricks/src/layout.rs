//! Byte map of the file as a whole: header, directory, sections. See `FORMAT.md`.
//!
//! The parts of a file follow each other without gaps but for zero padding up to the next multiple of an alignment:
//! header page, payloads (each on a multiple of [`PAGE_BYTES`]), directory (on a multiple of [`PAGE_BYTES`]), sections
//! in the order of their kinds (each on a multiple of [`SECTION_ALIGN`]). The file ends with the last section.

use crate::displacement::DisplacementField;
use crate::levels::Level;
use crate::occupancy::Occupancy;
use crate::records::{
    Brick, Instance, Leaf, Material, Object, OpacityMap, PunctualLight, Span, Texture, TopNode2, TopNode8,
};
use bytemuck::{Pod, Zeroable};
use std::fmt;
use xxhash_rust::xxh3::xxh3_64;

/// First bytes of every scene file. The control characters are spoiled by transfers in text mode.
pub const MAGIC: [u8; 8] = *b"BRICKS\x1a\n";

/// The version of the format that this crate writes and reads. No other version is read.
pub const VERSION: u32 = 4;

/// Alignment of payloads and of the directory, and length of the header page.
pub const PAGE_BYTES: u64 = 4096;

/// Alignment of the sections of the resident part.
pub const SECTION_ALIGN: u64 = 64;

/// Longest payload: byte offsets within one fit the signed and unsigned 32-bit integers of a kernel.
pub const MAX_PAYLOAD_BYTES: u64 = 1 << 31;

/// First fields of the header page. The rest of the page is zero.
///
/// [`Self::magic`] and [`Self::version`] keep their place in every version.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Header {
    /// [`MAGIC`].
    pub magic: [u8; 8],
    /// [`VERSION`].
    pub version: u32,
    /// [`PAGE_BYTES`].
    pub page_bytes: u32,
    /// Length of the file.
    pub file_bytes: u64,
    /// Offset of the directory, a multiple of [`PAGE_BYTES`].
    pub directory_offset: u64,
    /// Length of the directory.
    pub directory_bytes: u64,
    /// xxh3-64 of the directory.
    pub directory_checksum: u64,
    /// xxh3-64 of the header page with this field zero.
    pub checksum: u64,
}

impl Header {
    /// The header page: the fields with their checksum, then zeros.
    pub fn page(&self) -> [u8; PAGE_BYTES as usize] {
        let mut page = [0; PAGE_BYTES as usize];
        page[..size_of::<Header>()].copy_from_slice(bytemuck::bytes_of(&Header { checksum: 0, ..*self }));
        let checksum = xxh3_64(&page);
        page[size_of::<Header>() - 8..size_of::<Header>()].copy_from_slice(&checksum.to_le_bytes());
        page
    }

    /// The fields of a header page and the checksum that the page should state.
    pub fn read(page: &[u8; PAGE_BYTES as usize]) -> (Header, u64) {
        let header = bytemuck::pod_read_unaligned::<Header>(&page[..size_of::<Header>()]);
        let mut zeroed = *page;
        zeroed[size_of::<Header>() - 8..size_of::<Header>()].fill(0);
        (header, xxh3_64(&zeroed))
    }
}

/// An entry of the directory: where a section lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct DirectoryEntry {
    /// A [`Section`] as a number.
    pub kind: u32,
    /// Bytes of one record; 1 for the manifest.
    pub record_bytes: u32,
    /// Number of records; bytes for the manifest.
    pub count: u64,
    /// Offset in the file, a multiple of [`SECTION_ALIGN`].
    pub offset: u64,
    /// Length: `count * record_bytes`.
    pub bytes: u64,
    /// xxh3-64 of the bytes.
    pub checksum: u64,
}

/// Kind kept for directional visibility fields. Not in files of this version.
pub const KIND_VISIBILITY_FIELDS: u32 = 17;

/// What a directory kind is called that this version does not have.
pub(crate) fn unread_kind(kind: u32) -> &'static str {
    match kind {
        KIND_VISIBILITY_FIELDS => "kept for visibility fields",
        _ => "unknown",
    }
}

/// A section of the resident part. Every file has each once, in this order, but for optional ones without records.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(u32)]
pub enum Section {
    /// The [`crate::Manifest`] as JSON.
    Manifest = 1,
    /// [`Object`]s.
    Objects = 2,
    /// [`Instance`]s.
    Instances = 3,
    /// [`Leaf`]s.
    Leaves = 4,
    /// [`TopNode2`]s.
    Top2 = 5,
    /// [`TopNode8`]s.
    Top8 = 6,
    /// [`Brick`]s.
    Bricks = 7,
    /// [`Material`]s.
    Materials = 8,
    /// [`Texture`]s.
    Textures = 9,
    /// [`Span`]s of the tiles of all textures.
    Tiles = 10,
    /// [`OpacityMap`]s.
    OpacityMaps = 11,
    /// [`PunctualLight`]s.
    Lights = 12,
    /// [`Occupancy`] of the bricks, in their order, or nothing.
    Occupancy = 16,
    /// [`DisplacementField`]s; optional.
    Displacement = 18,
    /// [`Level`]s of detail; optional, as are the three sections that belong to them.
    Levels = 19,
    /// [`Leaf`]s of the top level over levels and bricks.
    LevelLeaves = 20,
    /// Its [`TopNode2`]s.
    LevelTop2 = 21,
    /// Its [`TopNode8`]s.
    LevelTop8 = 22,
}

impl Section {
    /// All sections in the order of the file.
    pub const ALL: [Section; 18] = [
        Section::Manifest,
        Section::Objects,
        Section::Instances,
        Section::Leaves,
        Section::Top2,
        Section::Top8,
        Section::Bricks,
        Section::Materials,
        Section::Textures,
        Section::Tiles,
        Section::OpacityMaps,
        Section::Lights,
        Section::Occupancy,
        Section::Displacement,
        Section::Levels,
        Section::LevelLeaves,
        Section::LevelTop2,
        Section::LevelTop8,
    ];

    /// Sections that every file has.
    const REQUIRED: usize = {
        let (mut required, mut index) = (0, 0);
        while index < Self::ALL.len() {
            required += !Self::ALL[index].is_optional() as usize;
            index += 1;
        }
        required
    };

    /// The section's number in the directory.
    pub fn kind(self) -> u32 {
        self as u32
    }

    /// Whether a file without records of the section has no entry of it in the directory.
    pub const fn is_optional(self) -> bool {
        matches!(
            self,
            Section::Displacement | Section::Levels | Section::LevelLeaves | Section::LevelTop2 | Section::LevelTop8
        )
    }

    /// The section's place in [`Self::ALL`], and in the directory of a file that has all before it.
    pub fn index(self) -> usize {
        match self {
            Section::Occupancy => 12,
            Section::Displacement => 13,
            Section::Levels => 14,
            Section::LevelLeaves => 15,
            Section::LevelTop2 => 16,
            Section::LevelTop8 => 17,
            numbered_from_one => numbered_from_one as usize - 1,
        }
    }

    /// Bytes of one record; 1 for the manifest.
    pub fn record_bytes(self) -> u32 {
        let bytes = match self {
            Section::Manifest => 1,
            Section::Objects => size_of::<Object>(),
            Section::Instances => size_of::<Instance>(),
            Section::Leaves => size_of::<Leaf>(),
            Section::Top2 => size_of::<TopNode2>(),
            Section::Top8 => size_of::<TopNode8>(),
            Section::Bricks => size_of::<Brick>(),
            Section::Materials => size_of::<Material>(),
            Section::Textures => size_of::<Texture>(),
            Section::OpacityMaps => size_of::<OpacityMap>(),
            Section::Tiles => size_of::<Span>(),
            Section::Lights => size_of::<PunctualLight>(),
            Section::Occupancy => size_of::<Occupancy>(),
            Section::Displacement => size_of::<DisplacementField>(),
            Section::Levels => size_of::<Level>(),
            Section::LevelLeaves => size_of::<Leaf>(),
            Section::LevelTop2 => size_of::<TopNode2>(),
            Section::LevelTop8 => size_of::<TopNode8>(),
        };
        bytes as u32
    }

    /// The section's name, as messages print it.
    pub fn name(self) -> &'static str {
        match self {
            Section::Manifest => "manifest",
            Section::Objects => "objects",
            Section::Instances => "instances",
            Section::Leaves => "leaves",
            Section::Top2 => "top2",
            Section::Top8 => "top8",
            Section::Bricks => "bricks",
            Section::Materials => "materials",
            Section::Textures => "textures",
            Section::OpacityMaps => "opacity maps",
            Section::Tiles => "tiles",
            Section::Lights => "lights",
            Section::Occupancy => "occupancy",
            Section::Displacement => "displacement",
            Section::Levels => "levels",
            Section::LevelLeaves => "level leaves",
            Section::LevelTop2 => "level top2",
            Section::LevelTop8 => "level top8",
        }
    }
}

impl fmt::Display for Section {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Length of an entry of the directory.
pub const ENTRY_BYTES: u64 = size_of::<DirectoryEntry>() as u64;

/// Length of the directory of a file without optional sections. Each of these makes it longer by [`ENTRY_BYTES`].
pub const MIN_DIRECTORY_BYTES: u64 = Section::REQUIRED as u64 * ENTRY_BYTES;

/// Length of the directory of a file with all sections.
pub const MAX_DIRECTORY_BYTES: u64 = Section::ALL.len() as u64 * ENTRY_BYTES;
