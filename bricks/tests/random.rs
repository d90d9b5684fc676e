//! Whatever the bytes of a file, reading it ends in an error or in data that obeys the format; never in a panic.

mod common;

use bricks::*;
use common::{Image, written};
use proptest::prelude::*;
use std::path::Path;
use std::sync::OnceLock;

/// Opens, copies and verifies; how far it came.
fn read_all(path: &Path) -> (bool, usize) {
    let mut copied = 0;
    let mut opened = false;
    for access in [Access::Map, Access::Read] {
        let Ok(file) = SceneFile::open_with(path, access) else { continue };
        opened = true;
        validate::resident(file.resident()).unwrap();
        for (payload, span) in file.resident().payloads() {
            let mut out = vec![0; span.bytes as usize];
            if file.copy(payload, &mut out).is_ok() {
                copied += 1;
                traverse(file.resident(), payload, &out);
            }
        }
    }
    let report = verify_file(path, &mut |_, _| {}).unwrap();
    for problem in &report.problems {
        assert!(problem.part().is_some() && !problem.to_string().is_empty());
    }
    assert!(opened || !report.is_ok());
    (opened, copied)
}

/// Follows every index of a geometry payload without any check, as a kernel does.
fn traverse(resident: &Resident, payload: Payload, bytes: &[u8]) {
    let Payload::Geometry(index) = payload else { return };
    let brick = &resident.bricks[index as usize];
    let layout = GeometryLayout::of(brick);
    let word = |at: u64| u32::from_le_bytes(bytes[at as usize..at as usize + 4].try_into().unwrap());
    let mut stack = vec![(0u32, 1u32)];
    let mut visits = 0;
    while let Some((index, level)) = stack.pop() {
        visits += 1;
        assert!(visits <= brick.node_count && level <= brick.height && brick.height <= MAX_BRICK_HEIGHT);
        let node: Node = bytemuck::pod_read_unaligned(&bytes[index as usize * 80..][..80]);
        for slot in 0..8 {
            if node.inner_mask >> slot & 1 != 0 {
                let below = node.inner_mask & ((1u32 << slot) - 1) as u8;
                stack.push((node.child_base + below.count_ones(), level + 1));
            } else if node.meta[slot] != 0 {
                let first = node.triangle_base + u32::from(node.meta[slot] & 31);
                for triangle in first..first + u32::from(node.meta[slot] >> 5).count_ones() {
                    assert!(
                        word(layout.ids + u64::from(triangle) * 4)
                            < resident.objects[brick.object as usize].triangle_ids
                    );
                    for corner in 0..3 {
                        let at = u64::from(triangle * 3 + corner);
                        let vertex = if brick.flags & BRICK_INDEX32 != 0 {
                            word(layout.indices + at * 4)
                        } else {
                            word((layout.indices + at * 2) & !3) >> (at % 2 * 16) & 0xffff
                        };
                        assert!(vertex < brick.vertex_count);
                    }
                }
            }
        }
    }
    assert_eq!(visits, brick.node_count);
}

/// The bytes of the small scene.
fn whole() -> &'static [u8] {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    BYTES.get_or_init(|| std::fs::read(written().1).unwrap_or_default())
}

fn read_bytes(bytes: &[u8]) -> (bool, usize) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("random.bricks");
    std::fs::write(&path, bytes).unwrap();
    read_all(&path)
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
    fn damage(edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20)) {
        let mut bytes = whole().to_vec();
        for (at, value) in edits {
            *at.get_mut(&mut bytes) = value;
        }
        read_bytes(&bytes);
    }

    #[test]
    fn header_with_right_checksum(at in 2usize..12, value in word()) {
        let mut image = Image { bytes: whole().to_vec() };
        image.bytes[at * 4..at * 4 + 4].copy_from_slice(&value.to_le_bytes());
        image.edit_header(|_| {});
        read_bytes(&image.bytes);
    }

    #[test]
    fn directory_with_right_checksum(section in 0usize..9, at in 0usize..10, value in word()) {
        let mut image = Image { bytes: whole().to_vec() };
        image.edit_entry(Section::ALL[section], |entry| {
            let bytes = bytemuck::bytes_of_mut(entry);
            bytes[at * 4..at * 4 + 4].copy_from_slice(&value.to_le_bytes());
        });
        read_bytes(&image.bytes);
    }

    #[test]
    fn records_with_right_checksums(
        section in 1usize..9,
        edits in prop::collection::vec((any::<prop::sample::Index>(), word(), any::<bool>()), 1..3),
    ) {
        let mut image = Image { bytes: whole().to_vec() };
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
        payload in 0usize..7,
        edits in prop::collection::vec((any::<prop::sample::Index>(), word(), any::<bool>()), 1..3),
    ) {
        let payloads = [
            Payload::Geometry(0), Payload::Geometry(1), Payload::Geometry(2), Payload::Attributes(0),
            Payload::Attributes(1), Payload::Attributes(2), Payload::Texture(0),
        ];
        let mut image = Image { bytes: whole().to_vec() };
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

#[test]
fn the_whole_scene_is_read() {
    assert_eq!(read_bytes(whole()), (true, 14));
}
