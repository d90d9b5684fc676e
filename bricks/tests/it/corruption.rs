//! Damage of every kind is found and named, and never anything worse.

use crate::common::{self, Image, Scene, written, written_with_all, written_with_fields, written_with_levels};
use bricks::layout::PAGE_BYTES;
use bricks::{Access, Error, Part, Payload, SceneFile, Section, verify_file};
use std::fs::{self, File};
use std::io::{Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::Path;

fn write_at(mut file: &File, bytes: &[u8], at: usize) {
    file.seek(SeekFrom::Start(at as u64)).unwrap();
    file.write_all(bytes).unwrap();
}

/// The part that every byte of a file belongs to, from the resident part that was written.
fn owners(image: &Image, scene: &Scene) -> Vec<Part> {
    let header = image.header();
    let mut owners = vec![Part::Header; image.bytes.len()];
    let mut fill = |start: u64, end: u64, part| owners[start as usize..end as usize].fill(part);
    for (payload, span) in scene.resident.payloads() {
        let end = span.offset + span.bytes;
        fill(span.offset, end, Part::Payload(payload));
        fill(end, end.next_multiple_of(PAGE_BYTES), Part::PaddingAfterPayload(payload));
    }
    let (start, end) = (header.directory_offset, header.directory_offset + header.directory_bytes);
    let entries: Vec<_> = image.sections().into_iter().map(|section| image.entry(section)).collect();
    fill(start, end, Part::Directory);
    fill(end, entries[0].offset, Part::PaddingAfterDirectory);
    for (index, section) in image.sections().into_iter().enumerate() {
        let end = entries[index].offset + entries[index].bytes;
        fill(entries[index].offset, end, Part::Section(section));
        if let Some(next) = entries.get(index + 1) {
            fill(end, next.offset, Part::PaddingAfterSection(section));
        }
    }
    owners
}

/// Verifying finds one problem, in `part`; opening and copying fail exactly if they depend on it.
fn found(path: &Path, part: Part, at: usize) {
    let report = verify_file(path, &mut |_, _| {}).unwrap();
    let parts: Vec<_> = report.problems.iter().map(Error::part).collect();
    assert_eq!(parts, [Some(part)], "byte {at}: {:?}", report.problems);
    let message = report.problems[0].to_string();
    assert!(message.starts_with(&path.display().to_string()), "{message}");
    // The magic, the version, the rest.
    let words: &[&str] = match at {
        0..8 => &["found", "expected"],
        8..12 => &["version", "again"],
        _ => &["found", "expected", "again"],
    };
    assert!(words.iter().all(|word| message.contains(word)), "{message}");

    let opened = SceneFile::open_with(path, Access::Read);
    match part {
        Part::Header | Part::Directory | Part::Section(_) => {
            assert_eq!(opened.unwrap_err().to_string(), message, "byte {at}");
        }
        Part::Payload(payload) => {
            let file = opened.unwrap();
            let mut out = vec![0; file.loaded_bytes(payload) as usize];
            assert_eq!(file.copy(payload, &mut out).unwrap_err().to_string(), message, "byte {at}");
            let mut stored = vec![0; file.span(payload).bytes as usize];
            assert_eq!(file.copy_stored(payload, &mut stored).unwrap_err().to_string(), message, "byte {at}");
        }
        _ => drop(opened.unwrap()),
    }
}

/// Flips a bit of every byte in `range`, each bit in its turn; the parts that they belong to. Every second one in a
/// copy of the file, at the same time.
fn flip(path: &Path, scene: &Scene, range: Range<usize>) -> Vec<Part> {
    let image = Image::read(path);
    let owners = owners(&image, scene);
    let copy = path.with_extension("copy");
    fs::copy(path, &copy).unwrap();
    let range = range.start..range.end.min(owners.len());
    let half = |path: &Path, first: usize| {
        assert_eq!(common::problems(path), "");
        let file = File::options().write(true).open(path).unwrap();
        for at in (first..range.end).step_by(2) {
            let byte = image.bytes[at];
            write_at(&file, &[byte ^ 1 << (at % 8)], at);
            found(path, owners[at], at);
            write_at(&file, &[byte], at);
        }
        assert_eq!(common::problems(path), "");
    };
    std::thread::scope(|scope| {
        let other = scope.spawn(|| half(&copy, range.start + 1));
        half(path, range.start);
        other.join().unwrap();
    });
    owners[range].to_vec()
}

#[test]
fn every_byte() {
    let (_folder, path, scene) = written();
    let owners = flip(&path, &scene, 0..usize::MAX);
    let padding = owners.iter().filter(|part| matches!(part, Part::PaddingAfterPayload(_))).count();
    assert!(
        padding > 1000 && owners.iter().any(|part| matches!(part, Part::PaddingAfterSection(_))),
        "padding is not covered"
    );
}

/// What a file with displacement fields has besides: their payloads, a longer directory, a section more.
#[test]
fn every_byte_from_the_first_displacement_field_on() {
    let (_folder, path, scene) = written_with_fields();
    let owners = flip(&path, &scene, scene.resident.displacement[0].span.offset as usize..usize::MAX);
    for part in [
        Part::Payload(Payload::Displacement(0)),
        Part::Payload(Payload::Displacement(2)),
        Part::PaddingAfterPayload(Payload::Displacement(2)),
        Part::Directory,
        Part::PaddingAfterSection(Section::Occupancy),
    ] {
        assert!(owners.contains(&part), "{part} is not covered");
    }
    assert_eq!(owners.last(), Some(&Part::Section(Section::Displacement)));
}

/// What a file with levels of detail has besides: their payloads, which are written between those of the bricks.
#[test]
fn every_byte_of_levels() {
    let (_folder, path, scene) = written_with_levels();
    let directory = Image::read(&path).header().directory_offset as usize;
    let owners = flip(&path, &scene, directory..usize::MAX);
    for part in [
        Part::Directory,
        Part::Section(Section::Levels),
        Part::PaddingAfterSection(Section::Levels),
        Part::Section(Section::LevelLeaves),
        Part::Section(Section::LevelTop2),
    ] {
        assert!(owners.contains(&part), "{part} is not covered");
    }
    assert_eq!(owners.last(), Some(&Part::Section(Section::LevelTop8)));
    for payload in [Payload::Geometry(3), Payload::Attributes(3), Payload::Geometry(5), Payload::Attributes(5)] {
        let span = scene.resident.span(payload).unwrap();
        let end = (span.offset + span.bytes).next_multiple_of(PAGE_BYTES) as usize;
        let owners = flip(&path, &scene, span.offset as usize..end);
        assert!(owners.contains(&Part::Payload(payload)) && owners.contains(&Part::PaddingAfterPayload(payload)));
    }
}

#[test]
fn every_value_of_every_byte_of_header_fields_and_directory() {
    for (_folder, path, _) in [written(), written_with_fields(), written_with_all()] {
        every_value(&path);
    }
}

fn every_value(path: &Path) {
    let image = Image::read(path);
    let directory = image.header().directory_offset as usize;
    let end = directory + image.header().directory_bytes as usize;
    let file = File::options().write(true).open(path).unwrap();
    for at in (0..64).chain(directory..end) {
        for flip in 1..=255 {
            write_at(&file, &[image.bytes[at] ^ flip], at);
            let part = SceneFile::open_with(path, Access::Read).unwrap_err().part();
            assert_eq!(part, Some(if at < directory { Part::Header } else { Part::Directory }), "byte {at}");
        }
        write_at(&file, &image.bytes[at..=at], at);
    }
    assert_eq!(common::problems(path), "");
}

#[test]
fn all_damaged_parts_are_listed() {
    let (_folder, path, scene) = written();
    let mut image = Image::read(&path);
    let bricks = &scene.resident.bricks;
    for at in [bricks[0].geometry.offset + 7, bricks[2].attributes.offset, bricks[1].geometry.offset - 1] {
        image.bytes[at as usize] ^= 0x10;
    }
    fs::write(&path, &image.bytes).unwrap();
    let text = common::problems(&path);
    let lines: Vec<_> = text.lines().collect();
    assert_eq!(lines.len(), 3, "{text}");
    assert!(lines[0].contains("brick 0 geometry is damaged"), "{text}");
    assert!(lines[1].contains("brick 2 attributes is damaged"), "{text}");
    assert!(lines[2].contains("the padding after brick 0 geometry is damaged"), "{text}");

    // With a section lost as well, payloads are still compared with their checksums.
    image.section(Section::Leaves)[0] ^= 1;
    image.section(Section::Manifest)[0] ^= 1;
    fs::write(&path, &image.bytes).unwrap();
    let text = common::problems(&path);
    for part in ["section manifest", "section leaves", "brick 0 geometry", "brick 2 attributes"] {
        assert!(text.contains(&format!("{part} is damaged")), "{text}");
    }
}

#[test]
fn a_damaged_brick_does_not_hinder_others() {
    let (_folder, path, scene) = written();
    let mut image = Image::read(&path);
    image.bytes[scene.resident.bricks[0].geometry.offset as usize + 100] ^= 4;
    fs::write(&path, &image.bytes).unwrap();
    for access in [Access::Map, Access::Read] {
        let file = SceneFile::open_with(&path, access).unwrap();
        for (payload, expected) in &scene.payloads {
            let mut out = vec![0; expected.len()];
            let result = file.copy(*payload, &mut out);
            if *payload == Payload::Geometry(0) {
                assert!(matches!(result, Err(Error::Corrupt { part: Part::Payload(Payload::Geometry(0)), .. })));
            } else {
                result.unwrap();
                assert_eq!(out, *expected);
            }
        }
    }
}

#[test]
fn truncated_or_extended() {
    for (_folder, path, _) in [written(), written_with_all()] {
        cut_anywhere(&path);
    }
}

fn cut_anywhere(path: &Path) {
    let image = Image::read(path);
    let length = image.bytes.len();
    let near = [1, 7, 8, 11, 12, 55, 56, 57, 4095, 4096, 4097, length - 1];
    let lengths = near.into_iter().chain((0..length).step_by(509)).chain([length + 1, length + 4096]);
    for cut in lengths {
        let mut bytes = image.bytes.clone();
        bytes.resize(cut, 0);
        fs::write(path, &bytes).unwrap();
        for access in [Access::Map, Access::Read] {
            match SceneFile::open_with(path, access).unwrap_err() {
                Error::Length { found, expected, .. } => {
                    assert_eq!(found, cut as u64);
                    assert_eq!(expected, if cut < 4096 { 4096 } else { length as u64 });
                }
                Error::NotSceneFile { .. } => assert!(cut == 0, "{cut} bytes"),
                error => panic!("{cut} bytes: {error}"),
            }
        }
        assert_eq!(verify_file(path, &mut |_, _| {}).unwrap().problems.len(), 1);
    }
    fs::write(path, &image.bytes).unwrap();
    assert_eq!(common::problems(path), "");
}

#[test]
fn truncated_while_open() {
    let (_folder, path, _) = written();
    for access in [Access::Map, Access::Read] {
        let bytes = fs::read(&path).unwrap();
        let file = SceneFile::open_with(&path, access).unwrap();
        File::options().write(true).open(&path).unwrap().set_len(4096).unwrap();
        let mut out = vec![0; file.span(Payload::Geometry(0)).bytes as usize];
        let error = file.copy(Payload::Geometry(0), &mut out).unwrap_err();
        assert!(matches!(error, Error::Io { part: Some(Part::Payload(Payload::Geometry(0))), .. }), "{error}");
        let report = file.verify(&mut |_, _| {}).unwrap();
        assert!(matches!(report.problems[..], [Error::Length { found: 4096, .. }]), "{:?}", report.problems);
        fs::write(&path, bytes).unwrap();
    }
}

#[test]
fn other_versions() {
    let (_folder, path, _) = written();
    let image = Image::read(&path);
    for (version, word) in [(0, "4; convert"), (3, "4; convert"), (5, "newer"), (u32::MAX, "newer")] {
        // Neither the checksum nor the rest of a file of another version means anything here.
        for sealed in [true, false] {
            let mut image = Image { bytes: image.bytes.clone() };
            if sealed {
                image.edit_header(|header| header.version = version);
            } else {
                image.bytes[8..12].copy_from_slice(&u32::to_le_bytes(version));
                image.bytes.truncate(40);
            }
            fs::write(&path, &image.bytes).unwrap();
            let error = SceneFile::open(&path).unwrap_err();
            let message = error.to_string();
            assert!(matches!(error, Error::Version { found, .. } if found == version), "{message}");
            assert!(message.contains(word) && message.contains("convert again"), "{message}");
            assert!(message.contains(&format!("version {version}")) && message.contains("version 4"), "{message}");
        }
    }
}

#[test]
fn other_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("picture.bricks");
    for bytes in [&b"glTF\x02\0\0\0"[..], b"", b"x", b"BRICKS\n\n----------", &[0; 9000]] {
        fs::write(&path, bytes).unwrap();
        for access in [Access::Map, Access::Read] {
            let error = SceneFile::open_with(&path, access).unwrap_err();
            assert!(matches!(error, Error::NotSceneFile { .. }), "{error}");
            assert!(error.to_string().contains("picture.bricks: not a .bricks scene file"), "{error}");
        }
    }
    for path in [folder.path().join("absent.bricks"), folder.path().to_owned()] {
        let error = SceneFile::open(&path).unwrap_err();
        assert!(matches!(error, Error::Io { .. }), "{error}");
        assert!(error.to_string().contains("cannot open the file"), "{error}");
        assert!(verify_file(&path, &mut |_, _| {}).is_err());
    }
}

#[test]
fn progress_is_of_all_bytes() {
    let (_folder, path, _) = written();
    let length = fs::metadata(&path).unwrap().len();
    let mut calls = Vec::new();
    let file = SceneFile::open(&path).unwrap();
    assert!(file.verify(&mut |done, total| calls.push((done, total))).unwrap().is_ok());
    assert_eq!(calls.first(), Some(&(0, length)));
    assert!(calls.is_sorted() && calls.iter().all(|&(_, total)| total == length));
    // The sum of what was checked, not the final call alone, is the whole file: every byte was read once.
    assert_eq!(calls[calls.len() - 2..], [(length, length); 2]);
    assert!(calls[calls.len() - 3].0 < length || calls[calls.len() - 3] == calls[calls.len() - 2]);
}
