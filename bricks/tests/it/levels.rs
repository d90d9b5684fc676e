//! Levels of detail in files: written, read, put to use, refused when they break a rule, kept when fields are added.

use crate::common::{self, Image, Scene, scene, scene_with_fields, with_levels, written, written_with_all};
use crate::common::{written_with_fields, written_with_levels};
use bricks::*;
use std::collections::BTreeSet;
use std::fs;

#[track_caller]
fn refused(part: Part, found: &str, spoil: impl FnOnce(&mut Resident)) {
    common::refused(written_with_levels().2.resident, part, found, spoil);
}

#[track_caller]
fn level_refused(index: u32, found: &str, spoil: impl FnOnce(&mut Level)) {
    let part = Part::Record(Section::Levels, index);
    refused(part, found, |resident| spoil(&mut resident.levels[index as usize]));
}

fn record(section: Section, index: u32) -> Part {
    Part::Record(section, index)
}

#[test]
fn levels_are_read() {
    for (folder, path, scene) in [written_with_levels(), written_with_all()] {
        assert_eq!(common::problems(&path), "");
        for access in [Access::Map, Access::Read] {
            let mut file = SceneFile::open_with(&path, access).unwrap();
            assert_eq!(*file.resident(), scene.resident);
            assert_eq!((file.resident().levels.len(), file.resident().bricks.len()), (3, 3));
            assert_eq!(file.resident().payloads().count(), scene.payloads.len());
            // In use they are read all the same.
            for in_use in [false, true] {
                assert_eq!(file.resident().has_levels_in_use(), in_use);
                for (payload, expected) in &scene.payloads {
                    let mut out = vec![0; file.loaded_bytes(*payload) as usize];
                    file.copy(*payload, &mut out).unwrap();
                    assert_eq!(out, *expected, "{payload}");
                }
                assert!(file.verify(&mut |_, _| {}).unwrap().is_ok());
                file.use_levels();
            }
            let error = file.copy(Payload::Geometry(6), &mut []).unwrap_err().to_string();
            assert!(error.contains("one of 3 bricks and 3 levels"), "{error}");
            let error = file.copy(Payload::Proxies(3), &mut []).unwrap_err().to_string();
            assert!(error.contains("one of 3 bricks with proxies"), "{error}");
        }
        drop(folder);
    }
}

/// Everything but the header, the directory, the new sections and the places of payloads is what it is without levels.
#[test]
fn without_levels_nothing_is_written() {
    let files = [(written(), written_with_levels()), (written_with_fields(), written_with_all())];
    for ((_folder, plain, small), (_other, path, _)) in files {
        let [before, after] = [&plain, &path].map(|path| Image::read(path));
        let mut sections = before.sections();
        assert!(sections.iter().all(|section| section.kind() < 19));
        sections.extend([Section::Levels, Section::LevelLeaves, Section::LevelTop2, Section::LevelTop8]);
        assert_eq!(after.sections(), sections);
        let directory = after.header().directory_bytes;
        assert_eq!(directory, before.header().directory_bytes + 160);
        let file = SceneFile::open(&path).unwrap();
        assert_eq!(file.resident_bytes(), after.sections_bytes() + directory);
        // Without their records the scene is the one without them, but for where payloads lie.
        let mut resident = file.resident().clone();
        (resident.levels, resident.level_leaves) = Default::default();
        (resident.level_top2, resident.level_top8) = Default::default();
        let mut scene = Scene { resident, payloads: small.payloads };
        scene.write(&path);
        assert!(fs::read(&path).unwrap() == fs::read(&plain).unwrap());
    }
}

#[test]
fn levels_in_use_are_bricks() {
    let (_folder, path, scene) = written_with_all();
    let mut file = SceneFile::open(&path).unwrap();
    let before = file.resident().clone();
    let spans: BTreeSet<_> = before.payloads().map(|(payload, span)| (payload, span.offset, span.bytes)).collect();
    assert_eq!((before.exact_bricks(), before.has_levels_in_use()), (3, false));
    file.use_levels();
    let after = file.resident();
    assert_eq!((after.exact_bricks(), after.has_levels_in_use()), (3, true));
    assert_eq!(after.bricks[..3], before.bricks);
    assert!(after.bricks[3..].iter().eq(before.levels.iter().map(|level| &level.brick)));
    assert_eq!(after.levels, before.levels);
    assert_eq!((&after.leaves, &after.top2), (&before.level_leaves, &before.level_top2));
    assert_eq!(after.top8, before.level_top8);
    assert!(after.level_leaves.is_empty() && after.level_top2.is_empty() && after.level_top8.is_empty());
    let in_use: BTreeSet<_> = after.payloads().map(|(payload, span)| (payload, span.offset, span.bytes)).collect();
    assert_eq!(in_use, spans);
    for (index, level) in (3..).zip(&scene.resident.levels) {
        for resident in [&before, after] {
            assert_eq!(resident.brick(index), Some(&level.brick));
            for payload in [Payload::Geometry(index), Payload::Attributes(index)] {
                assert_eq!(resident.level_of(payload), Some(index - 3));
            }
            assert_eq!(resident.name_of(Payload::Geometry(index)), format!("level {} geometry", index - 3));
            assert_eq!(resident.span(Payload::Proxies(index)), None);
        }
    }
    assert_eq!(before.name_of(Payload::Attributes(5)), "level 2 attributes");
    assert_eq!((before.brick(6), after.brick(6)), (None, None));
    for payload in [Payload::Geometry(2), Payload::Geometry(6), Payload::Proxies(3), Payload::Tile(4)] {
        assert_eq!((before.level_of(payload), after.level_of(payload)), (None, None));
        assert_eq!(after.name_of(payload), payload.to_string());
    }
    // Leaves: world 0; instance 2 of level 1; level 2; instance 1 of brick 2; world 1; instance 2 of brick 2; level 0;
    // instance 1 of level 1.
    assert_eq!(after.level_parents(), [6, 2, NONE, 7, 6, 1, 2, 2]);
    let again = after.clone();
    file.use_levels();
    assert_eq!(*file.resident(), again, "twice is as once");

    let mut plain = written().2.resident;
    let before = plain.clone();
    plain.use_levels();
    assert_eq!(plain, before, "nothing happens without levels");
    assert!(!plain.has_levels_in_use());
}

/// Objects need not be in the order of their bricks.
#[test]
fn the_last_object_may_have_the_first_bricks() {
    let mut resident = written_with_levels().2.resident;
    resident.objects.push(Object {
        first_brick: 0,
        brick_count: 0,
        triangle_ids: 0,
        triangle_count: 0,
        ..resident.objects[1]
    });
    validate::resident(&resident).unwrap();
    assert_eq!((resident.exact_bricks(), resident.has_levels_in_use()), (3, false));
    resident.use_levels();
    assert_eq!((resident.exact_bricks(), resident.has_levels_in_use()), (3, true));
}

#[test]
fn sections_come_together() {
    use Section::{LevelLeaves, LevelTop2, LevelTop8};
    refused(Part::Section(LevelLeaves), "0 records with 3 levels", |r| r.level_leaves.clear());
    refused(Part::Section(LevelTop2), "0 records with 3 levels", |r| r.level_top2.clear());
    refused(Part::Section(LevelTop8), "0 records with 3 levels", |r| r.level_top8.clear());
    refused(Part::Section(LevelLeaves), "8 records with 0 levels", |r| r.levels.clear());
    refused(Part::Section(LevelTop8), "2 records with 0 levels", |r| {
        r.levels.clear();
        r.level_leaves.clear();
        r.level_top2.clear();
    });
    // Levels in use are no scene to be written.
    refused(Part::Section(Section::Objects), "3 bricks in all objects", Resident::use_levels);
}

#[test]
fn levels_are_bricks() {
    level_refused(1, "object 2", |level| level.brick.object = 2);
    level_refused(1, "object 4294967295", |level| level.brick.object = NONE);
    level_refused(0, "a span of proxies", |level| level.brick.proxies.bytes = 16);
    level_refused(2, "0x1 in the reserved word", |level| level._reserved = 1);
    level_refused(1, "flags 0x18", |level| level.brick.flags |= 16);
    level_refused(1, "reserved words", |level| level.brick._reserved1[0] = 1);
    level_refused(1, "height 25", |level| level.brick.height = MAX_BRICK_HEIGHT + 1);
    level_refused(1, "bounds", |level| level.brick.max[1] = NEAR_STEPS + 1);
    level_refused(1, "means", |level| level.brick.mean_albedo[2] = f32::NAN);
    level_refused(1, "root with triangles up to", |level| level.brick.root.triangle_base += 1);
    for (payload, spoil) in [
        (Payload::Geometry(4), (|level| level.brick.geometry.bytes -= 16) as fn(&mut Level)),
        (Payload::Geometry(4), |level| level.brick.vertex_count += 4),
        (Payload::Attributes(4), |level| level.brick.attributes.bytes += 8),
        (Payload::Attributes(4), |level| level.brick.attributes = Span::default()),
    ] {
        refused(Part::Payload(payload), "bytes", |r| spoil(&mut r.levels[1]));
    }
}

#[test]
fn children_exist_and_come_before() {
    level_refused(0, "no first child", |level| level.children[0].brick = NONE);
    level_refused(0, "child 2 behind none", |level| level.children.swap(1, 2));
    level_refused(0, "child 3 behind none", |level| level.children[3] = level.children[0]);
    level_refused(0, "brick 3 as child 1", |level| level.children[1].brick = 3);
    level_refused(2, "brick 5 as child 0", |level| level.children[0].brick = 5);
    level_refused(2, "brick 4294967294 as child 0", |level| level.children[0].brick = NONE - 1);
    level_refused(0, "brick 2 of object 1 as child 1", |level| level.children[1].brick = 2);
    level_refused(1, "brick 0 of object 0 as child 0", |level| level.children[0].brick = 0);
    level_refused(2, "brick 4 of object 1 as child 1", |level| level.children[1].instance = NONE);
    level_refused(2, "brick 3 of object 0 as child 1", |level| level.children[1].brick = 3);
    level_refused(2, "a child of instance 3", |level| level.children[1].instance = 3);
    level_refused(2, "a child of instance 4294967294", |level| level.children[1].instance = NONE - 1);
    level_refused(2, "a child of instance 0", |level| level.children[0].instance = 0);
    level_refused(1, "a child of instance 1 in object 1", |level| level.children[0].instance = 1);
    // The controls: fewer children, and bricks in the place of levels.
    let mut resident = written_with_levels().2.resident;
    resident.levels[0].children[1].brick = NONE;
    resident.levels[2].children[2].brick = NONE;
    validate::resident(&resident).unwrap();
    resident.levels[1].children[0].brick = NONE;
    assert!(validate::resident(&resident).is_err());
}

#[test]
fn the_world_that_stands_for_instances_is_placed_once() {
    let another = |r: &mut Resident| {
        let world = Instance { flags: 0, ..r.instances[0] };
        r.instances.push(world);
        r.manifest.triangles_instanced += 32;
        r.leaves.extend([0, 1].map(|brick| Leaf { instance: 3, brick }));
    };
    // The tops are not reached: trees over more leaves are made for the control alone.
    refused(Part::Section(Section::Leaves), "4 leaves", |r| {
        another(r);
        r.leaves.truncate(4);
    });
    let grow = |r: &mut Resident| {
        another(r);
        let box_of = |node: &TopNode2| (node.min, node.max);
        let (min, max) = box_of(&r.top2[0]);
        let base = r.top2.len() as u32;
        // Two more leaves beside the old root.
        let mut nodes = vec![TopNode2 { min, max, left: 1, right: base + 1 }];
        let shift = |node: TopNode2| match node.right {
            TOP_LEAF => node,
            _ => TopNode2 { left: node.left + 1, right: node.right + 1, ..node },
        };
        nodes.extend(r.top2.iter().copied().map(shift));
        nodes.push(TopNode2 { min, max, left: base + 2, right: base + 3 });
        nodes.extend([4, 5].map(|leaf| TopNode2 { min, max, left: leaf, right: TOP_LEAF }));
        r.top2 = nodes;
        for slot in 3..5 {
            r.top8[1].meta[slot] = 0x20 + slot as u8;
            let TopNode8 { lo, hi, .. } = &mut r.top8[1];
            lo.iter_mut().chain(hi).for_each(|side| side[slot] = 0);
        }
    };
    refused(record(Section::Levels, 2), "a child of instance 1", grow);
    refused(record(Section::Levels, 2), "a child of instance 3 of the world", |r| {
        grow(r);
        r.levels[2].children[1] = Leaf { instance: 3, brick: 3 };
    });
    // The control: levels without children of instances; then only leaves are missing.
    refused(Part::Section(Section::LevelLeaves), "8 leaves", |r| {
        grow(r);
        r.levels[2].children[1].brick = NONE;
        r.levels[2].children[2].brick = NONE;
    });
}

#[test]
fn nothing_has_two_parents() {
    level_refused(0, "brick 0, for which level 0 stands", |level| level.children[1].brick = 0);
    level_refused(2, "brick 0, for which level 0 stands", |level| level.children[0].brick = 0);
    level_refused(2, "brick 4 of instance 1, for which level 2 stands", |level| level.children[2].instance = 1);
    // The level over the brick of the object stands for it in every instance.
    level_refused(2, "brick 2 of instance 2, for which level 1 stands", |level| level.children[2].brick = 2);
    // The control: one that nothing of its own object stands for.
    let mut resident = written_with_levels().2.resident;
    resident.levels[2].children[3] = Leaf { instance: NONE, brick: 1 };
    resident.levels[0].children[1].brick = NONE;
    validate::resident(&resident).unwrap();
}

#[test]
fn lengths_are_those_of_children_at_least() {
    level_refused(0, "error NaN", |level| level.error = f64::NAN);
    level_refused(0, "error inf", |level| level.error = f64::INFINITY);
    level_refused(0, "error -1", |level| level.error = -1.0);
    level_refused(0, "bound NaN", |level| level.bound = f64::NAN);
    level_refused(0, "bound -0.5", |level| level.bound = -0.5);
    level_refused(2, "error 0.75", |level| level.error = 0.75);
    level_refused(2, "bound 1.75", |level| level.bound = 1.75);
    level_refused(0, "colours of 1.5", |level| level.color = 1.5);
    level_refused(0, "colours of -1", |level| level.color = -1.0);
    level_refused(0, "colours of NaN", |level| level.color = f32::NAN);
    // Equal is enough, and what is over bricks alone may be exact. Lengths of other objects do not matter.
    let mut resident = written_with_levels().2.resident;
    (resident.levels[0].error, resident.levels[0].bound) = (0.0, 0.0);
    (resident.levels[2].error, resident.levels[2].bound) = (0.0, 0.0);
    validate::resident(&resident).unwrap();
}

#[test]
fn leaves_and_trees() {
    use Section::{LevelLeaves, LevelTop2, LevelTop8};
    refused(Part::Section(LevelLeaves), "7 leaves", |r| r.level_leaves.truncate(7));
    refused(record(LevelLeaves, 7), "brick 2 of instance 1 again", |r| r.level_leaves[7].brick = 2);
    refused(record(LevelLeaves, 6), "brick 5 of instance 0 again", |r| r.level_leaves[6].brick = 5);
    refused(record(LevelLeaves, 7), "brick 4 of instance 2 again", |r| r.level_leaves[7].instance = 2);
    refused(record(LevelLeaves, 7), "brick 3 of instance 1", |r| r.level_leaves[7].brick = 3);
    refused(record(LevelLeaves, 7), "brick 6 of instance 1", |r| r.level_leaves[7].brick = 6);
    refused(record(LevelLeaves, 7), "brick 4294967295 of instance 1", |r| r.level_leaves[7].brick = NONE);
    refused(record(LevelLeaves, 7), "brick 4 of instance 3", |r| r.level_leaves[7].instance = 3);
    // Leaves of bricks alone are none of levels.
    refused(record(Section::Leaves, 3), "brick 4 of instance 1", |r| r.leaves[3].brick = 4);
    refused(record(LevelTop2, 1), "child 1", |r| r.level_top2[1].left = 1);
    refused(record(LevelTop2, 7), "leaf 8", |r| r.level_top2[7].left = 8);
    refused(record(LevelTop2, 8), "leaf 0, which another node has", |r| r.level_top2[8].left = 0);
    refused(record(LevelTop2, 15), "without a parent", |r| r.level_top2.push(r.level_top2[14]));
    refused(record(LevelTop8, 1), "reserved", |r| r.level_top8[1]._reserved = 1);
    refused(record(LevelTop8, 1), "leaf 0, which another node has", |r| r.level_top8[1].leaf_base = 0);
    refused(Part::Section(LevelTop8), "no node with leaf 7", |r| r.level_top8[1].meta[6] = 0);
}

/// A level of the world has triangles of any instance, one of another object those of the object.
#[test]
fn ids_of_triangles() {
    let ids = |level: u32, id: u32| {
        let (_folder, path, scene) = written_with_levels();
        let at = GeometryLayout::of(&scene.resident.levels[level as usize].brick).ids as usize;
        let mut image = Image::read(&path);
        image.edit_payload(Payload::Geometry(3 + level), |bytes| bytes[at..at + 4].copy_from_slice(&id.to_le_bytes()));
        fs::write(&path, &image.bytes).unwrap();
        common::problems(&path)
    };
    // All 52 ids of the scene, of which the world has all, and an object 10.
    assert_eq!((ids(0, 51), ids(2, 51), ids(1, 9)), Default::default());
    let named = |problems: String, brick: u32, level: u32, found: &str| {
        let words = [&format!("brick {brick} geometry is not valid"), found, &format!("(level {level} geometry)")];
        assert!(words.iter().all(|word| problems.contains(*word)) && problems.lines().count() == 1, "{problems}");
    };
    named(ids(0, 52), 3, 0, "triangle id 52, expected less than 52");
    named(ids(1, 10), 4, 1, "triangle id 10, expected less than 10");
    named(ids(1, 51), 4, 1, "triangle id 51, expected less than 10");

    // With less in the world, its levels may still name what instances have, and its bricks may not.
    let mut scene = with_levels(scene());
    scene.resident.objects[0].triangle_ids = 42;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    scene.write(&path);
    assert_eq!(common::problems(&path), "");
    scene.resident.objects[0].triangle_ids = 41;
    scene.write(&path);
    let problems = common::problems(&path);
    assert!(problems.contains("brick 1 geometry is not valid") && problems.lines().count() == 1, "{problems}");
}

#[test]
fn damaged_levels_are_named() {
    let (_folder, path, scene) = written_with_levels();
    let mut image = Image::read(&path);
    for payload in [Payload::Geometry(3), Payload::Attributes(5)] {
        image.bytes[scene.resident.span(payload).unwrap().offset as usize + 9] ^= 2;
    }
    fs::write(&path, &image.bytes).unwrap();
    let text = common::problems(&path);
    assert!(text.contains("brick 3 geometry is damaged") && text.contains("(level 0 geometry)"), "{text}");
    assert!(text.contains("brick 5 attributes is damaged") && text.contains("(level 2 attributes)"), "{text}");
    assert_eq!(text.lines().count(), 2, "{text}");
    // So is the padding after them.
    let mut padded = Image { bytes: image.bytes.clone() };
    let span = scene.resident.span(Payload::Geometry(4)).unwrap();
    padded.bytes[(span.offset + span.bytes) as usize] = 1;
    fs::write(&path, &padded.bytes).unwrap();
    let padding = common::problems(&path);
    let last = padding.lines().last().unwrap();
    assert!(last.contains("the padding after brick 4 geometry") && last.contains("(level 1 geometry)"), "{padding}");
    fs::write(&path, &image.bytes).unwrap();
    let mut file = SceneFile::open(&path).unwrap();
    for in_use in [false, true] {
        assert_eq!(file.resident().has_levels_in_use(), in_use);
        let mut out = vec![0; file.loaded_bytes(Payload::Geometry(3)) as usize];
        let error = file.copy(Payload::Geometry(3), &mut out).unwrap_err();
        assert!(matches!(error.cause(), Error::Corrupt { .. }));
        assert_eq!(error.part(), Some(Part::Payload(Payload::Geometry(3))));
        assert!(text.contains(&error.to_string()), "{error}");
        file.use_levels();
    }
    // With another section lost, payloads of levels are still compared with their checksums.
    for section in [Section::Objects, Section::LevelLeaves, Section::Instances] {
        let mut image = Image { bytes: image.bytes.clone() };
        image.section(section)[0] ^= 1;
        fs::write(&path, &image.bytes).unwrap();
        let text = common::problems(&path);
        for part in [&format!("section {section}"), "brick 3 geometry", "brick 5 attributes"] {
            assert!(text.contains(&format!("{part} is damaged")), "{text}");
        }
    }
}

#[test]
fn directories() {
    let (_folder, path, _) = written_with_levels();
    let whole = fs::read(&path).unwrap();
    let spoiled = |found: &str, spoil: &dyn Fn(&mut Image)| {
        let mut image = Image { bytes: whole.clone() };
        spoil(&mut image);
        fs::write(&path, &image.bytes).unwrap();
        let error = SceneFile::open(&path).expect_err(found);
        assert_eq!(error.part(), Some(Part::Directory), "{error}");
        assert!(error.to_string().contains(found), "{error} does not say {found}");
        assert!(common::problems(&path).starts_with(&error.to_string()));
    };
    spoiled("an entry of kind 18 (displacement), expected the end of the directory", &|image| {
        image.edit_entry(Section::LevelTop8, |entry| entry.kind = 18);
    });
    spoiled("an entry of kind 17 (kept for visibility fields), expected the end", &|image| {
        image.edit_entry(Section::Levels, |entry| entry.kind = 17);
    });
    spoiled("records of 8 bytes in section level top2", &|image| {
        image.edit_entry(Section::LevelLeaves, |entry| entry.kind = 21);
    });
    spoiled("records of 296 bytes in section levels", &|image| {
        image.edit_entry(Section::Levels, |entry| entry.record_bytes = 296);
    });
    spoiled("an entry of section level top8 without records", &|image| {
        image.edit_entry(Section::LevelTop8, |entry| (entry.count, entry.bytes) = (0, 0));
    });
}

#[test]
fn payloads_of_levels_lie_before_those_of_fields() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    let mut scene = with_levels(scene_with_fields());
    let last = scene.payloads.remove(&Payload::Geometry(5)).unwrap();
    let mut writer = Writer::create(&path).unwrap();
    scene.write_payloads(&mut writer);
    scene.resident.levels[2].brick.geometry = writer.write(&last).unwrap();
    let error = writer.finish(&scene.resident).unwrap_err();
    assert_eq!(error.part(), Some(Part::Payload(Payload::Geometry(5))));
    assert!(error.to_string().contains("it behind displacement field"), "{error}");

    // The control: behind all others but fields, and before all others.
    let fields = scene.payloads.split_off(&Payload::Displacement(0));
    for first in [false, true] {
        let mut writer = Writer::create(&path).unwrap();
        let write = |scene: &mut Scene, writer: &mut Writer| {
            scene.resident.levels[2].brick.geometry = writer.write(&last).unwrap();
        };
        if first {
            write(&mut scene, &mut writer);
        }
        scene.write_payloads(&mut writer);
        if !first {
            write(&mut scene, &mut writer);
        }
        for (field, bytes) in scene.resident.displacement.iter_mut().zip(fields.values()) {
            field.span = writer.write(&pack::pack(bytes)).unwrap();
        }
        writer.finish(&scene.resident).unwrap();
        assert_eq!(common::problems(&path), "");
    }
}

/// Fields come and go; levels stay, byte for byte.
#[test]
fn fields_are_added_to_levels() {
    let (folder, path, scene) = written_with_levels();
    let without = fs::read(&path).unwrap();
    let fields = scene_with_fields();
    let again = |with_fields: bool| {
        let old = SceneFile::open(&path).unwrap();
        let mut writer = Writer::reserve(&path).unwrap().start_from(&old, &mut |_| {}).unwrap();
        let mut resident = old.resident().clone();
        resident.displacement.clear();
        for (index, field) in (0..).zip(fields.resident.displacement.iter().filter(|_| with_fields)) {
            let span = writer.write(&pack::pack(&fields.payloads[&Payload::Displacement(index)])).unwrap();
            resident.displacement.push(DisplacementField { span, ..*field });
        }
        writer.finish(&resident).unwrap();
    };
    again(true);
    let (_other, all, _) = written_with_all();
    assert!(fs::read(&path).unwrap() == fs::read(&all).unwrap(), "as if written at once");
    assert_eq!(SceneFile::open(&path).unwrap().resident().levels, scene.resident.levels);
    again(false);
    assert!(fs::read(&path).unwrap() == without);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
}

/// Moved instances move their levels.
#[test]
fn trees_over_levels_are_fitted() {
    let mut resident = written_with_levels().2.resident;
    let there = resident.instances[1].world_from_object;
    let mut away = there;
    away[3] += 4096.0;
    let before = resident.clone();
    resident.place(&[(1, away)]).unwrap();
    assert_ne!(resident.level_top2, before.level_top2);
    validate::resident(&resident).unwrap();
    for (nodes, leaves) in [(&resident.top2, &resident.leaves), (&resident.level_top2, &resident.level_leaves)] {
        for node in nodes.iter().filter(|node| node.right == TOP_LEAF) {
            let leaf = &leaves[node.left as usize];
            // Boxes of what did not move stay as they were made.
            assert!(leaf.instance != 1 || [node.min, node.max] == resident.leaf_box(leaf));
        }
    }
    let beside = resident.clone();
    // In use they move the same.
    let mut in_use = before;
    in_use.use_levels();
    in_use.place(&[(1, away)]).unwrap();
    assert_eq!((in_use.top2, in_use.top8), (beside.level_top2, beside.level_top8));
}
