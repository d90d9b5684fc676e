//! Displacement fields in files: written, read, refused when they break a rule, left out, put in the place of others.

use crate::common::{self, Image, Scene, scene_with_fields, written, written_with_fields};
use bricks::layout::{KIND_VISIBILITY_FIELDS, PAGE_BYTES};
use bricks::*;
use std::fs;
use std::path::Path;

#[track_caller]
fn refused(part: Part, found: &str, spoil: impl FnOnce(&mut Resident)) {
    common::refused(written_with_fields().2.resident, part, found, spoil);
}

#[track_caller]
fn field_refused(index: u32, found: &str, spoil: impl FnOnce(&mut DisplacementField)) {
    let part = Part::Record(Section::Displacement, index);
    refused(part, found, |resident| spoil(&mut resident.displacement[index as usize]));
}

/// A file whose checksums are right is refused on opening; verifying says the same.
#[track_caller]
fn file_refused(part: Part, found: &str, path: &Path, image: &Image) {
    fs::write(path, &image.bytes).unwrap();
    let error = SceneFile::open(path).expect_err(found);
    assert_eq!(error.part(), Some(part), "{error}");
    assert!(error.to_string().contains(found), "{error} does not say {found}");
    assert!(common::problems(path).starts_with(&error.to_string()));
}

#[test]
fn fields_are_read() {
    let (_folder, path, scene) = written_with_fields();
    assert_eq!(common::problems(&path), "");
    for file in [SceneFile::open(&path), SceneFile::open_with(&path, Access::Read)] {
        let file = file.unwrap();
        assert_eq!(file.resident().displacement, scene.resident.displacement);
        assert_eq!(file.resident_bytes(), Image::read(&path).sections_bytes() + 560);
        for (index, field) in (0..).zip(&scene.resident.displacement) {
            let payload = Payload::Displacement(index);
            let loaded = &scene.payloads[&payload];
            assert_eq!(file.displacement(index).unwrap(), *loaded);
            assert_eq!((file.span(payload), file.loaded_bytes(payload)), (field.span, loaded.len() as u64));
            let mut stored = vec![0; field.span.bytes as usize];
            file.copy_stored(payload, &mut stored).unwrap();
            assert_eq!(stored, pack::pack(loaded));
            assert!(matches!(file.copy(payload, &mut vec![0; loaded.len() - 16]), Err(Error::Request { .. })));
        }
        let error = file.displacement(3).unwrap_err();
        assert!(matches!(error, Error::Request { payload: Payload::Displacement(3), .. }), "{error}");
        assert!(
            error.to_string().contains("displacement field 3") && error.to_string().contains("one of 3"),
            "{error}"
        );
    }
}

/// Everything but the header, the directory's length and the section is what it is without fields.
#[test]
fn without_fields_nothing_is_written() {
    let (_folder, path, _) = written();
    let (_other, with_fields, _) = written_with_fields();
    let [plain, fields] = [&path, &with_fields].map(|path| Image::read(path));
    assert_eq!(plain.header().directory_bytes, 520);
    assert_eq!(fields.header().directory_bytes, 560);
    assert_eq!(plain.sections(), Section::ALL[..13]);
    assert_eq!(fields.sections(), Section::ALL[..14]);
    let end = plain.header().directory_offset as usize;
    assert!(plain.bytes[4096..end] == fields.bytes[4096..end]);
    for section in &Section::ALL[..13] {
        let [one, other] = [&plain, &fields].map(|image| image.entry(*section));
        assert_eq!((one.bytes, one.checksum), (other.bytes, other.checksum));
    }
    assert!(SceneFile::open(&path).unwrap().displacement(0).is_err());
}

#[test]
fn a_field_is_of_something_that_exists() {
    field_refused(2, "object 2", |field| field.object = 2);
    field_refused(2, "object 4294967295", |field| field.object = NONE);
    field_refused(0, "brick 2", |field| field.brick = 2);
    field_refused(0, "brick 3", |field| field.brick = 3);
    field_refused(2, "brick 0", |field| field.brick = 0);
    field_refused(2, "brick 4294967294", |field| field.brick = NONE - 1);
    let mut resident = written_with_fields().2.resident;
    resident.displacement[2].brick = 2;
    validate::resident(&resident).unwrap();
}

#[test]
fn fields_are_in_order_and_each_of_its_own() {
    let part = |index| Part::Record(Section::Displacement, index);
    refused(part(1), "object 0, brick 4294967295 after (0, 4294967295)", |r| r.displacement[0].brick = NONE);
    refused(part(1), "object 0, brick 1 after (0, 1)", |r| r.displacement[1].brick = 1);
    refused(part(1), "object 0, brick 0 after (0, 1)", |r| r.displacement[1].brick = 0);
    refused(part(1), "object 0, brick 1 after (0, 4294967295)", |r| r.displacement.swap(0, 1));
    refused(part(2), "object 0, brick 4294967295 after (1, 4294967295)", |r| r.displacement.swap(1, 2));
}

#[test]
fn records() {
    for rings in [0, MAX_DISPLACEMENT_RINGS + 1, u32::MAX] {
        field_refused(0, &format!("{rings} rings"), |field| field.rings = rings);
    }
    for directions in [0, 1, MAX_DISPLACEMENT_DIRECTIONS + 1, u32::MAX] {
        field_refused(0, &format!("{directions} directions"), |field| field.directions = directions);
    }
    for bits in [0, 2, 7, 16, u32::MAX] {
        field_refused(0, &format!("{bits} bits"), |field| field.bits = bits);
    }
    for executor in [2, u32::MAX] {
        field_refused(1, &format!("executor {executor}"), |field| field.executor = executor);
    }
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for axis in 0..3 {
            field_refused(0, "a sphere", |field| field.center[axis] = value);
        }
        field_refused(1, "a sphere of radius", |field| field.radius = value);
        field_refused(2, "a mean", |field| field.mean = value);
    }
    for radius in [0.0, -0.0, -1.0] {
        field_refused(1, "a sphere of radius", |field| field.radius = radius);
    }
    for mean in [-f64::MIN_POSITIVE, 1.0f64.next_up()] {
        field_refused(2, "a mean of", |field| field.mean = mean);
    }
    // The controls: the ends of the ranges.
    let mut resident = written_with_fields().2.resident;
    let field = &mut resident.displacement[1];
    (field.rings, field.directions) = (MAX_DISPLACEMENT_RINGS, MAX_DISPLACEMENT_DIRECTIONS);
    (field.mean, field.radius, field.executor) = (1.0, f64::MIN_POSITIVE, DISPLACEMENT_BY_GPU);
    // No byte of a block unpacks to more than 255, so that the length as loaded is bounded by the file.
    field.span.bytes = field.loaded_bytes().div_ceil(255).next_multiple_of(16);
    validate::resident(&resident).unwrap();
    resident.displacement[1].span.bytes -= 16;
    let flaw = validate::resident(&resident).unwrap_err();
    assert_eq!(flaw.part, Part::Payload(Payload::Displacement(1)));
    assert!(flaw.expected.contains("as no block unpacks to more"), "{flaw}");
    for bytes in [0, 8, 17, (1 << 31) + 16, u64::MAX] {
        let part = Part::Payload(Payload::Displacement(0));
        refused(part, "96 when loaded", |r| r.displacement[0].span.bytes = bytes);
    }
}

#[test]
fn fields_lie_behind_all_other_payloads() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    let mut scene = scene_with_fields();
    let fields = scene.payloads.split_off(&Payload::Displacement(0));
    let tile = scene.payloads.remove(&Payload::Tile(1)).unwrap();
    let mut writer = Writer::create(&path).unwrap();
    scene.write_payloads(&mut writer);
    let mut write = |bytes: &[u8]| writer.write(bytes).unwrap();
    scene.resident.displacement[1].span = write(&pack::pack(&fields[&Payload::Displacement(1)]));
    scene.resident.tiles[1] = write(&tile);
    scene.resident.displacement[0].span = write(&pack::pack(&fields[&Payload::Displacement(0)]));
    scene.resident.displacement[2].span = write(&pack::pack(&fields[&Payload::Displacement(2)]));
    let error = writer.finish(&scene.resident).unwrap_err();
    assert_eq!(error.part(), Some(Part::Payload(Payload::Tile(1))));
    assert!(error.to_string().contains("it behind displacement field 1"), "{error}");

    // The control: among themselves they may lie in any order.
    let mut scene = scene_with_fields();
    scene.payloads.split_off(&Payload::Displacement(0));
    let mut writer = Writer::create(&path).unwrap();
    scene.write_payloads(&mut writer);
    for field in [2, 0, 1] {
        let bytes = pack::pack(&fields[&Payload::Displacement(field)]);
        scene.resident.displacement[field as usize].span = writer.write(&bytes).unwrap();
    }
    writer.finish(&scene.resident).unwrap();
    assert_eq!(common::problems(&path), "");
}

/// A payload that cannot be unpacked, or with something behind its samples, in a file whose checksums are right.
#[test]
fn payloads() {
    let refused = |index: u32, packed: &[u8], found: &str| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.bricks");
        let mut scene = scene_with_fields();
        let fields = scene.payloads.split_off(&Payload::Displacement(0));
        let mut writer = Writer::create(&path).unwrap();
        scene.write_payloads(&mut writer);
        for (number, bytes) in (0..).zip(fields.values()) {
            let bytes = if number == index { packed } else { &pack::pack(bytes) };
            scene.resident.displacement[number as usize].span = writer.write(bytes).unwrap();
        }
        writer.finish(&scene.resident).unwrap();
        let file = SceneFile::open(&path).unwrap();
        let error = file.displacement(index).unwrap_err();
        assert!(matches!(error, Error::Invalid { .. }), "{error}");
        assert!(error.to_string().contains(&format!("displacement field {index} is not valid")), "{error}");
        assert!(error.to_string().contains(found), "{error} does not say {found}");
        assert_eq!(common::problems(&path), format!("{error}\n"));
        file.displacement((index + 1) % 3).unwrap();
    };
    let whole = scene_with_fields();
    let loaded = |index, spoil: &dyn Fn(&mut [u8])| {
        let mut bytes = whole.payloads[&Payload::Displacement(index)].clone();
        spoil(&mut bytes);
        pack::pack(&bytes)
    };
    // 90 samples of 96 bytes, and of 16.
    refused(0, &loaded(0, &|bytes| bytes[90] = 1), "0x01 at its byte 90");
    refused(0, &loaded(0, &|bytes| bytes[95] = 255), "0xff at its byte 95");
    refused(2, &loaded(2, &|bytes| bytes[11] |= 4), "set bits after the last of 90 samples");
    refused(2, &loaded(2, &|bytes| bytes[11] |= 128), "set bits after the last of 90 samples");
    refused(2, &loaded(2, &|bytes| bytes[12] = 1), "0x01 at its byte 12");
    for length in [95, 97, 16] {
        refused(0, &pack::pack(&vec![1; length]), "unpacked bytes");
    }
    let right = loaded(1, &|_| {});
    assert!(right.len() > 32, "there is something to cut off");
    refused(1, &right[..right.len() - 16], "a block of");
    refused(1, &[&right[..], &[0; 16]].concat(), "packed bytes");
    refused(1, &[255; 16], "a block of 4294967295 bytes");
}

#[test]
fn every_sample_is_legal() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    for value in [0, 1, 254, DISPLACEMENT_MISS] {
        let mut scene = scene_with_fields();
        for (index, field) in (0..).zip(&scene.resident.displacement) {
            let bytes = scene.payloads.get_mut(&Payload::Displacement(index)).unwrap();
            bytes[..field.sample_bytes() as usize].fill(value);
            if field.bits == DISPLACEMENT_HITS {
                bytes[11] &= 3;
            }
        }
        scene.write(&path);
        assert_eq!(common::problems(&path), "");
        assert_eq!(SceneFile::open(&path).unwrap().displacement(2).unwrap(), scene.payloads[&Payload::Displacement(2)]);
    }
}

#[test]
fn directories() {
    let (_folder, path, scene) = written_with_fields();
    let whole = fs::read(&path).unwrap();
    let spoiled = |found: &str, spoil: &dyn Fn(&mut Image)| {
        let mut image = Image { bytes: whole.clone() };
        spoil(&mut image);
        file_refused(Part::Directory, found, &path, &image);
    };
    let section = Section::Displacement;
    for (kind, name) in [
        (KIND_VISIBILITY_FIELDS, "kept for visibility fields"),
        (16, "occupancy"),
        (1, "manifest"),
        (0, "unknown"),
        (99, "unknown"),
    ] {
        let found = format!("an entry of kind {kind} ({name}), expected the end of the directory");
        spoiled(&found, &|image| image.edit_entry(section, |entry| entry.kind = kind));
    }
    spoiled("kind 18 (displacement), expected kind 16 (occupancy)", &|image| {
        image.edit_entry(Section::Occupancy, |entry| entry.kind = 18);
    });
    spoiled("records of 96 bytes in section displacement", &|image| {
        image.edit_entry(section, |entry| entry.record_bytes = 96);
    });
    spoiled("the last section ending at byte", &|image| {
        image.edit_entry(section, |entry| (entry.count, entry.bytes) = (2, 2 * 88));
    });
    // A section without records is left out: a file has one form.
    spoiled("an entry of section displacement without records, expected records, or no entry", &|image| {
        image.edit_entry(section, |entry| (entry.count, entry.bytes) = (0, 0));
        let end = image.entry(section).offset;
        image.bytes.truncate(end as usize);
        image.edit_header(|header| header.file_bytes = end);
    });
    // A directory whose last entry is cut off.
    spoiled("the end of the file", &|image| image.resize_directory(520));
    // A directory that is longer than its sections.
    let (_other, plain, _) = written();
    let mut image = Image::read(&plain);
    let offset = image.header().directory_offset as usize;
    let entry = image.bytes[offset + 12 * 40..offset + 13 * 40].to_vec();
    image.bytes[offset + 520..offset + 560].copy_from_slice(&entry);
    image.resize_directory(560);
    let found = "an entry of kind 16 (occupancy), expected the end of the directory";
    file_refused(Part::Directory, found, &path, &image);
    fs::write(&path, &whole).unwrap();
    assert_eq!(*SceneFile::open(&path).unwrap().resident(), scene.resident);
}

#[test]
fn damaged_fields_are_named() {
    let (_folder, path, scene) = written_with_fields();
    let mut image = Image::read(&path);
    for field in &scene.resident.displacement[1..] {
        image.bytes[field.span.offset as usize + 5] ^= 2;
    }
    let last = scene.resident.displacement[2].span;
    image.bytes[(last.offset + last.bytes) as usize] = 1;
    fs::write(&path, &image.bytes).unwrap();
    let text = common::problems(&path);
    for name in ["displacement field 1", "displacement field 2", "the padding after displacement field 2"] {
        let line = format!("{name} is damaged");
        assert!(text.contains(&line), "{text}");
    }
    assert_eq!(text.lines().count(), 3, "{text}");
    assert!(text.lines().all(|line| line.contains("again with `brickwalk bake-displacement`")), "{text}");
    let file = SceneFile::open(&path).unwrap();
    assert!(matches!(file.displacement(2), Err(Error::Corrupt { .. })));
    assert_eq!(file.displacement(0).unwrap(), scene.payloads[&Payload::Displacement(0)]);

    // With the section lost, the other payloads are still compared with their checksums.
    image.section(Section::Displacement)[0] ^= 1;
    image.bytes[scene.resident.bricks[0].geometry.offset as usize] ^= 1;
    fs::write(&path, &image.bytes).unwrap();
    let text = common::problems(&path);
    assert!(text.contains("section displacement is damaged") && text.contains("brick 0 geometry is damaged"), "{text}");
}

#[test]
fn a_file_that_ends_in_a_field() {
    let (_folder, path, scene) = written_with_fields();
    let whole = fs::read(&path).unwrap();
    let span = scene.resident.displacement[2].span;
    let file = SceneFile::open(&path).unwrap();
    fs::write(&path, &whole[..span.offset as usize + 8]).unwrap();
    let error = file.displacement(2).unwrap_err();
    assert_eq!(error.part(), Some(Part::Payload(Payload::Displacement(2))));
    assert!(error.to_string().contains("read displacement field 2, the file has become shorter"), "{error}");
    let report = file.verify(&mut |_, _| {}).unwrap();
    assert!(matches!(report.problems[..], [Error::Length { .. }]), "{:?}", report.problems);
    assert!(matches!(SceneFile::open(&path), Err(Error::Length { .. })));
}

/// Begins `path` anew from the scene in it, with these fields.
fn baked(path: &Path, fields: &[(DisplacementField, Vec<u8>)]) -> (Resident, u64) {
    let old = SceneFile::open(path).unwrap();
    let mut copied = 0;
    let mut writer = Writer::reserve(path).unwrap().start_from(&old, &mut |bytes| copied += bytes).unwrap();
    let mut resident = old.resident().clone();
    resident.displacement = fields
        .iter()
        .map(|(field, bytes)| DisplacementField { span: writer.write(&pack::pack(bytes)).unwrap(), ..*field })
        .collect();
    writer.finish(&resident).unwrap();
    (resident, copied)
}

/// The fields of a scene with their samples.
fn fields(scene: &Scene) -> Vec<(DisplacementField, Vec<u8>)> {
    let samples = (0..).map(|index| scene.payloads[&Payload::Displacement(index)].clone());
    scene.resident.displacement.iter().copied().zip(samples).collect()
}

#[test]
fn fields_are_put_in_the_place_of_others() {
    let (folder, path, plain) = written();
    let without = fs::read(&path).unwrap();
    let scene = scene_with_fields();
    let payload_bytes: u64 = plain.resident.payloads().map(|(_, span)| span.bytes).sum();

    let (resident, copied) = baked(&path, &fields(&scene));
    assert_eq!(copied, payload_bytes);
    let (_other, expected, _) = written_with_fields();
    assert!(fs::read(&path).unwrap() == fs::read(expected).unwrap(), "as if written at once");
    assert_eq!(*SceneFile::open(&path).unwrap().resident(), resident);

    // Others in their place: those that were there are gone.
    let mut other = fields(&scene).split_off(1);
    other[0].1[..200].fill(77);
    let (resident, copied) = baked(&path, &other);
    assert_eq!((resident.displacement.len(), copied), (2, payload_bytes));
    let file = SceneFile::open(&path).unwrap();
    assert_eq!(common::problems(&path), "");
    assert_eq!(file.displacement(0).unwrap(), other[0].1);
    assert_eq!(file.displacement(1).unwrap(), other[1].1);
    for (payload, expected) in &plain.payloads {
        let mut out = vec![0; expected.len()];
        file.copy(*payload, &mut out).unwrap();
        assert_eq!(out, *expected, "{payload}");
        assert_eq!(Some(file.span(*payload)), plain.resident.span(*payload));
    }

    // None: the file is what it was before there were any.
    baked(&path, &[]);
    assert!(fs::read(&path).unwrap() == without);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_scene_without_bricks_can_have_a_field() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("empty.bricks");
    common::empty().write(&path);
    let mut field = fields(&scene_with_fields()).remove(1);
    field.1[..200].fill(DISPLACEMENT_MISS);
    baked(&path, &[field]);
    assert_eq!(common::problems(&path), "");
    let span = SceneFile::open(&path).unwrap().span(Payload::Displacement(0));
    assert_eq!(span.offset, PAGE_BYTES);
}

#[test]
fn damaged_payloads_are_not_copied() {
    let (folder, path, scene) = written_with_fields();
    let whole = fs::read(&path).unwrap();
    let spoil = |payload: Payload| {
        let mut bytes = whole.clone();
        bytes[scene.resident.span(payload).unwrap().offset as usize] ^= 1;
        fs::write(&path, &bytes).unwrap();
        let old = SceneFile::open(&path).unwrap();
        let writer = Writer::reserve(&path).unwrap().start_from(&old, &mut |_| {}).map(drop);
        assert!(fs::read(&path).unwrap() == bytes, "the old file stays");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left behind");
        writer
    };
    for payload in [Payload::Geometry(0), Payload::Attributes(2), Payload::Proxies(1), Payload::Tile(1)] {
        let error = spoil(payload).unwrap_err();
        assert!(matches!(error.cause(), Error::Corrupt { .. }), "{error}");
        assert_eq!(error.part(), Some(Part::Payload(payload)));
    }
    // Fields are not copied, so damaged ones are no hindrance.
    spoil(Payload::Displacement(0)).unwrap();
}

/// The resident part that is given decides: fields whose payloads were not written are refused.
#[test]
fn old_fields_do_not_go_on() {
    let (_folder, path, _) = written_with_fields();
    let old = SceneFile::open(&path).unwrap();
    let writer = Writer::reserve(&path).unwrap().start_from(&old, &mut |_| {}).unwrap();
    let error = writer.finish(old.resident()).unwrap_err();
    assert!(error.to_string().contains("displacement field 0"), "{error}");
    assert!(error.to_string().contains("a span that the writer returned"), "{error}");
    assert_eq!(common::problems(&path), "");
}
