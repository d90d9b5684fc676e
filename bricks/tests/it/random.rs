//! Whatever the bytes of a file, reading it ends in an error or in data that obeys the format; never in a panic.

use crate::common::{Image, written, written_with_all};
use crate::exercise::{exercise, seal, traverse};
use bricks::*;
use proptest::prelude::*;
use std::path::Path;
use std::sync::OnceLock;

/// Opens a file in each way, copies and verifies; how far it came.
fn read_all(path: &Path) -> (bool, usize) {
    let mut copied = 0;
    let mut opened = false;
    for access in [Access::Map, Access::Read] {
        let Ok(file) = SceneFile::open_with(path, access) else { continue };
        opened = true;
        for (payload, _) in file.resident().payloads() {
            let mut out = vec![0; file.loaded_bytes(payload) as usize];
            if file.copy(payload, &mut out).is_ok() {
                copied += 1;
                traverse(file.resident(), payload, &out);
            }
        }
    }
    let report = verify_file(path, &mut |_, _| {}).unwrap();
    assert!(opened || !report.is_ok());
    (opened, copied)
}

/// The bytes of the small scene.
fn whole() -> &'static [u8] {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    BYTES.get_or_init(|| std::fs::read(written().1).unwrap_or_default())
}

/// Those of the small scene with displacement fields and levels of detail: all sections.
fn whole_with_all() -> &'static [u8] {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    BYTES.get_or_init(|| std::fs::read(written_with_all().1).unwrap_or_default())
}

/// Reads the bytes from memory and from a file: with the same result.
fn read_bytes(bytes: &[u8]) -> (bool, usize) {
    let (opened, copied) = exercise(bytes);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("random.bricks");
    std::fs::write(&path, bytes).unwrap();
    assert_eq!(read_all(&path), (opened, 2 * copied));
    (opened, copied)
}

/// A value such as a mistake or malice would leave.
fn word() -> impl Strategy<Value = u32> {
    prop_oneof![0u32..70, Just(u32::MAX), Just(u32::MAX - 1), Just(1 << 31), any::<u32>()]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn noise(bytes in prop::collection::vec(any::<u8>(), 0..9000), magic in any::<bool>()) {
        let mut bytes = bytes;
        if magic && bytes.len() >= 12 {
            bytes[..12].copy_from_slice(&whole()[..12]);
        }
        prop_assert_eq!(read_bytes(&bytes), (false, 0));
    }

    #[test]
    fn damage(
        all in any::<bool>(),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20),
    ) {
        let mut bytes = if all { whole_with_all() } else { whole() }.to_vec();
        for (at, value) in edits {
            *at.get_mut(&mut bytes) = value;
        }
        read_bytes(&bytes);
    }

    #[test]
    fn header_with_right_checksum(all in any::<bool>(), at in 2usize..12, value in word()) {
        let mut image = Image { bytes: if all { whole_with_all() } else { whole() }.to_vec() };
        image.bytes[at * 4..at * 4 + 4].copy_from_slice(&value.to_le_bytes());
        image.edit_header(|_| {});
        read_bytes(&image.bytes);
    }

    #[test]
    fn directory_with_right_checksum(section in 0..Section::ALL.len(), at in 0usize..10, value in word()) {
        let mut image = Image { bytes: whole_with_all().to_vec() };
        image.edit_entry(Section::ALL[section], |entry| {
            let bytes = bytemuck::bytes_of_mut(entry);
            bytes[at * 4..at * 4 + 4].copy_from_slice(&value.to_le_bytes());
        });
        read_bytes(&image.bytes);
    }

    #[test]
    fn records_with_right_checksums(
        section in 1..Section::ALL.len(),
        edits in prop::collection::vec((any::<prop::sample::Index>(), word(), any::<bool>()), 1..3),
    ) {
        let mut image = Image { bytes: whole_with_all().to_vec() };
        let bytes = image.section(Section::ALL[section]);
        for (at, value, byte) in edits {
            if byte {
                *at.get_mut(bytes) = value as u8;
            } else {
                let at = at.index(bytes.len() / 4) * 4;
                bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
            }
        }
        image.seal();
        read_bytes(&image.bytes);
    }

    #[test]
    fn payloads_with_right_checksums(
        payload in 0usize..15,
        edits in prop::collection::vec((any::<prop::sample::Index>(), word(), any::<bool>()), 1..3),
    ) {
        let payloads = [
            Payload::Geometry(0), Payload::Geometry(1), Payload::Geometry(2), Payload::Attributes(0),
            Payload::Attributes(1), Payload::Attributes(2), Payload::Texture(0),
            Payload::Texture(1), Payload::Tile(1), Payload::Opacity(0), Payload::Displacement(1),
            Payload::Displacement(2), Payload::Geometry(3), Payload::Geometry(5), Payload::Attributes(4),
        ];
        let mut image = Image { bytes: whole_with_all().to_vec() };
        image.edit_payload(payloads[payload], |bytes| {
            for (at, value, byte) in edits {
                if byte {
                    *at.get_mut(bytes) = value as u8;
                } else {
                    let at = at.index(bytes.len() / 4) * 4;
                    bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
                }
            }
        });
        read_bytes(&image.bytes);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    /// Words anywhere, bytes cut out, repeated and inserted, and all checksums made right: what the fuzz target tries.
    #[test]
    fn any_change_with_right_checksums(
        all in any::<bool>(),
        words in prop::collection::vec((any::<prop::sample::Index>(), word()), 0..4),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
        moved in prop::option::weighted(
            0.3, (any::<prop::sample::Index>(), any::<prop::sample::Index>(), 0usize..4096)
        ),
    ) {
        let mut bytes = if all { whole_with_all() } else { whole() }.to_vec();
        for (at, value) in words {
            let at = at.index(bytes.len() / 4) * 4;
            bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        }
        for (at, value) in edits {
            *at.get_mut(&mut bytes) = value;
        }
        if let Some((from, to, length)) = moved {
            let from = from.index(bytes.len());
            let taken: Vec<u8> = bytes.drain(from..(from + length).min(bytes.len())).collect();
            let to = to.index(bytes.len() + 1);
            bytes.splice(to..to, taken);
        }
        exercise(&bytes);
        seal(&mut bytes);
        exercise(&bytes);
    }

    /// Words in the resident part, which is smaller than the payloads and decides more.
    #[test]
    fn any_record_with_right_checksums(
        all in any::<bool>(),
        words in prop::collection::vec((any::<prop::sample::Index>(), word()), 1..4),
    ) {
        let mut bytes = if all { whole_with_all() } else { whole() }.to_vec();
        let resident = Image { bytes: bytes.clone() }.header().directory_offset as usize / 4;
        for (at, value) in words {
            let at = (resident + at.index(bytes.len() / 4 - resident)) * 4;
            bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        }
        seal(&mut bytes);
        exercise(&bytes);
    }
}

/// Words in the records of displacement fields, which are few, and in their payloads.
#[test]
fn any_word_of_displacement_fields() {
    any_word(Section::Displacement, 100, |resident| resident.displacement.iter().map(|field| field.span).collect());
}

/// Words in the records of levels of detail and in the leaves over them.
#[test]
fn any_word_of_levels() {
    any_word(Section::Levels, 100, |_| Vec::new());
    // Every leaf is needed: what is right is what was there.
    any_word(Section::LevelLeaves, 10, |_| Vec::new());
}

/// Words in the records of a section and in some payloads; more than `least` files are right but for a payload.
fn any_word(section: Section, least: usize, payloads: impl Fn(&Resident) -> Vec<Span>) {
    let values = [0, 1, 2, 8, 64, 65, 255, 256, 1 << 31, u32::MAX - 1, u32::MAX];
    let whole = whole_with_all();
    let image = Image { bytes: whole.to_vec() };
    let section = image.entry(section);
    let file = SceneFile::from_bytes("whole", whole).unwrap();
    let spans = payloads(file.resident()).into_iter().map(|span| (span.offset, span.bytes));
    let mut opened = 0;
    for (offset, length) in spans.chain([(section.offset, section.bytes)]) {
        for at in (offset..offset + length).step_by(4) {
            for value in values {
                let mut bytes = whole.to_vec();
                bytes[at as usize..at as usize + 4].copy_from_slice(&value.to_le_bytes());
                seal(&mut bytes);
                opened += usize::from(exercise(&bytes).0);
            }
        }
    }
    assert!(opened > least, "{opened} files are right but for the payload");
}

#[test]
fn the_whole_scene_is_read() {
    assert_eq!(read_bytes(whole()), (true, 14));
    assert_eq!(read_bytes(whole_with_all()), (true, 23));
    for whole in [whole(), whole_with_all()] {
        sealing_is_right(whole);
    }
}

fn sealing_is_right(whole: &[u8]) {
    // Sealing a file that is right changes nothing; one with a wrong checksum is read again.
    let mut sealed = whole.to_vec();
    seal(&mut sealed);
    assert!(sealed == whole);
    sealed[100] ^= 1;
    sealed[8192] ^= 1;
    assert_eq!(exercise(&sealed), (false, 0));
    sealed[100] ^= 1;
    seal(&mut sealed);
    assert!(exercise(&sealed).0);
}
