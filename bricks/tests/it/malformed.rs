//! A header, directory or resident part that breaks a rule of the format is refused even where checksums are right.

use crate::common::{self, Image, written};
use bricks::layout::KIND_VISIBILITY_FIELDS;
use bricks::*;
use std::fs;

/// The small scene with its spans.
fn resident() -> Resident {
    let (_folder, _path, scene) = written();
    scene.resident
}

/// The spoiled resident part is refused with a message that names `part` and says `found`.
#[track_caller]
fn refused(part: Part, found: &str, spoil: impl FnOnce(&mut Resident)) {
    let mut resident = resident();
    validate::resident(&resident).unwrap();
    spoil(&mut resident);
    let flaw = validate::resident(&resident).expect_err(found);
    assert_eq!(flaw.part, part, "{flaw}");
    assert!(flaw.found.contains(found), "{flaw} does not say {found}");
}

fn record(section: Section, index: u32) -> Part {
    Part::Record(section, index)
}

#[test]
fn objects() {
    use Section::Objects;
    refused(Part::Section(Objects), "no object", |r| r.objects.clear());
    refused(record(Objects, 0), "reserved", |r| r.objects[0]._reserved[1] = 1);
    refused(record(Objects, 1), "step 2^257", |r| r.objects[1].step_log2 = 257);
    refused(record(Objects, 1), "step 2^-2147483648", |r| r.objects[1].step_log2 = i32::MIN);
    refused(record(Objects, 1), "2^-65 device units", |r| r.objects[1].step_log2 = -66);
    refused(record(Objects, 1), "2^33 device units", |r| r.objects[1].step_log2 = 32);
    refused(record(Objects, 1), "bricks 2 to 4", |r| r.objects[1].brick_count = 2);
    refused(record(Objects, 1), "bricks 4294967295 to 8589934590", |r| {
        (r.objects[1].first_brick, r.objects[1].brick_count) = (u32::MAX, u32::MAX);
    });
    refused(record(Objects, 0), "brick 2, which is not of it", |r| r.objects[0].first_brick = 1);
    refused(Part::Section(Objects), "2 bricks in all objects", |r| {
        r.objects[1].brick_count = 0;
        r.objects[1].triangle_count = 0;
    });
    refused(record(Objects, 0), "brick 0, which is not of it", |r| r.bricks[0].object = 1);
    refused(record(Objects, 1), "brick 2, which is not of it", |r| r.bricks[2].object = 9);
    refused(record(Objects, 1), "11 triangles, 10 ids", |r| r.objects[1].triangle_count = 11);
    refused(record(Objects, 0), "33 triangles, 52 ids, 32 in bricks", |r| r.objects[0].triangle_count = 33);
    refused(record(Objects, 1), "1 bricks without triangles", |r| r.objects[1].triangle_count = 0);
}

#[test]
fn instances() {
    use Section::Instances;
    refused(record(Instances, 0), "None", |r| r.instances.clear());
    refused(record(Instances, 0), "object: 1", |r| r.instances[0].object = 1);
    refused(record(Instances, 0), "base: 1", |r| r.instances[0].base = 1);
    refused(record(Instances, 0), "flags: 0", |r| r.instances[0].flags = 0);
    refused(record(Instances, 0), "1.5", |r| r.instances[0].world_from_object[3] = 1.5);
    refused(record(Instances, 1), "reserved", |r| r.instances[1]._reserved = 1);
    refused(record(Instances, 1), "flags 0x1", |r| r.instances[1].flags = INSTANCE_IDENTITY);
    refused(record(Instances, 2), "flags 0x6", |r| r.instances[2].flags = 6);
    refused(record(Instances, 2), "object 2", |r| r.instances[2].object = 2);
    refused(record(Instances, 2), "triangle ids 43 to 53", |r| r.instances[2].base = 43);
    refused(record(Instances, 2), "triangle ids 4294967295 to 4294967305", |r| r.instances[2].base = u32::MAX);
    for value in [f64::NAN, f64::INFINITY, 1e200] {
        refused(record(Instances, 1), "matrix", |r| r.instances[1].world_from_object = [value; 12]);
    }
    refused(record(Instances, 1), "matrix", |r| r.instances[1].world_from_object[7] = f64::NEG_INFINITY);
    refused(record(Instances, 1), "matrix", |r| r.instances[1].world_from_object[10] = 0.0);
    for scale in [1e-90, 1e60] {
        // It has an inverse in f64.
        let scaled = Instance::IDENTITY.map(|x| x * scale);
        refused(record(Instances, 1), "matrix", |r| r.instances[1].world_from_object = scaled);
    }
    refused(record(Instances, 1), "matrix", |r| r.instances[1].world_from_object[3] = 1e300);
    refused(record(Instances, 2), "determinant -1", |r| r.instances[2].flags = 0);
    refused(record(Instances, 1), "determinant 8", |r| r.instances[1].flags = INSTANCE_MIRRORED);
}

#[test]
fn leaves() {
    use Section::Leaves;
    refused(Part::Section(Leaves), "3 leaves", |r| r.leaves.truncate(3));
    refused(record(Leaves, 3), "brick 2 of instance 3", |r| r.leaves[3].instance = 3);
    refused(record(Leaves, 3), "brick 1 of instance 1", |r| r.leaves[3].brick = 1);
    refused(record(Leaves, 3), "brick 4294967295 of instance 1", |r| r.leaves[3].brick = u32::MAX);
    refused(record(Leaves, 3), "brick 2 of instance 2 again", |r| r.leaves[3].instance = 2);
}

#[test]
fn materials_and_textures() {
    use Section::{Bricks, Materials, OpacityMaps, Textures};
    refused(record(Materials, 1), "flags 0x10", |r| r.materials[1].flags = 16);
    refused(record(Materials, 1), "flags 0x20", |r| r.materials[1].flags = 32);
    refused(record(Materials, 1), "flags 0x3", |r| r.materials[1].flags = MATERIAL_MASK | MATERIAL_BLEND);
    refused(record(Materials, 0), "texture 2", |r| r.materials[0].base_color_texture = 2);
    refused(record(Materials, 0), "NaN", |r| r.materials[0].base_color[3] = f32::NAN);
    refused(record(Materials, 0), "inf", |r| r.materials[0].emission[2] = f32::INFINITY);
    refused(record(Materials, 0), "roughness: -1", |r| r.materials[0].roughness = -1.0);
    refused(record(Materials, 0), "opacity map 1", |r| r.materials[0].opacity_map = 1);
    refused(record(OpacityMaps, 0), "0 by 3 texels", |r| r.opacity_maps[0].width = 0);
    refused(record(OpacityMaps, 0), "wrap 0x3", |r| r.opacity_maps[0].wrap = 3);
    refused(record(OpacityMaps, 0), "reserved word 1", |r| r.opacity_maps[0]._reserved = 1);
    refused(Part::Payload(Payload::Opacity(0)), "16 bytes", |r| r.opacity_maps[0].height = 4);
    refused(record(Bricks, 2), "0 triangles with opacity", |r| r.bricks[2].opacity_count = 0);
    refused(record(Bricks, 2), "11 triangles with opacity", |r| r.bricks[2].opacity_count = 11);
    refused(record(Bricks, 0), "1 triangles with opacity", |r| r.bricks[0].opacity_count = 1);
    refused(record(Textures, 0), "0 by 2 texels", |r| r.textures[0].width = 0);
    refused(record(Textures, 0), "4 by 16385 texels", |r| r.textures[0].height = 16385);
    for levels in [0, 2, 4, u32::MAX] {
        refused(record(Textures, 0), &format!("{levels} levels"), |r| r.textures[0].levels = levels);
    }
    refused(record(Textures, 0), "wrap 0x3", |r| r.textures[0].wrap = 3);
    refused(record(Textures, 0), "wrap 0x30000", |r| r.textures[0].wrap = 3 << 16);
    refused(record(Textures, 0), "flags 0x2", |r| r.textures[0].flags = 2);
    refused(Part::Payload(Payload::Texture(1)), "544 bytes", |r| r.textures[1].width = 200);
    refused(Part::Payload(Payload::Texture(0)), "64 bytes", |r| r.textures[0].tail.bytes = 64);
}

#[test]
fn tiles() {
    use Section::{Manifest, Textures, Tiles};
    refused(record(Textures, 0), "1 tiles from 0 on", |r| r.textures[0].tile_count = 1);
    refused(record(Textures, 1), "3 tiles from 0 on", |r| r.textures[1].tile_count = 3);
    refused(record(Textures, 1), "2 tiles from 1 on", |r| r.textures[1].first_tile = 1);
    refused(record(Textures, 1), "2 tiles from 4294967295 on", |r| r.textures[1].first_tile = u32::MAX);
    refused(record(Textures, 1), "2 tiles from 0 on", |r| (r.textures[1].width, r.textures[1].height) = (255, 255));
    refused(Part::Section(Tiles), "1 tiles", |r| r.tiles.truncate(1));
    refused(Part::Section(Tiles), "3 tiles", |r| r.tiles.push(r.tiles[0]));
    refused(Part::Payload(Payload::Tile(1)), "16400 bytes", |r| r.tiles[1].bytes += 16);
    refused(Part::Payload(Payload::Texture(1)), "544 bytes", |r| r.textures[1].encoding = TEXTURE_RGBA8);
    refused(record(Textures, 0), "sRGB in BC5", |r| r.textures[0].encoding = TEXTURE_BC5);
    refused(record(Textures, 1), "encoding 3", |r| r.textures[1].encoding = 3);
    refused(Part::Section(Manifest), "1 names of textures", |r| r.manifest.texture_names.truncate(1));
}

/// Messages name the texture as its source does, the level and the place of the tile.
#[test]
fn tiles_are_named() {
    let (_folder, path, _) = written();
    let mut image = Image::read(&path);
    let file = SceneFile::open(&path).unwrap();
    image.bytes[file.span(Payload::Tile(1)).offset as usize + 9] ^= 2;
    image.bytes[file.span(Payload::Texture(0)).offset as usize] ^= 2;
    fs::write(&path, &image.bytes).unwrap();
    let file = SceneFile::open(&path).unwrap();
    for (payload, names) in [
        (Payload::Tile(1), ["tile 1 is damaged", "column 1, row 0 of level 0 of texture 1 \"long.png\""]),
        (Payload::Texture(0), ["texture 0 is damaged", "the coarse levels of texture 0 \"small.png\""]),
    ] {
        let mut out = vec![0; file.loaded_bytes(payload) as usize];
        let error = file.copy(payload, &mut out).unwrap_err();
        assert!(matches!(error.cause(), Error::Corrupt { .. }) && error.part() == Some(Part::Payload(payload)));
        assert!(names.iter().all(|name| error.to_string().contains(name)), "{error}");
        assert!(common::problems(&path).contains(&error.to_string()), "verifying says the same");
    }
    // Blocks without a mode are seen by verifying alone.
    let (_folder, path, _) = written();
    let mut image = Image::read(&path);
    image.edit_payload(Payload::Tile(0), |bytes| bytes[32] = 0);
    fs::write(&path, &image.bytes).unwrap();
    let file = SceneFile::open(&path).unwrap();
    file.copy(Payload::Tile(0), &mut [0; 16384]).unwrap();
    let problems = common::problems(&path);
    assert!(problems.contains("tile 0 is not valid: found block 2 without a mode"), "{problems}");
}

#[test]
fn bricks_by_themselves() {
    use Section::Bricks;
    refused(record(Bricks, 1), "flags 0x13", |r| r.bricks[1].flags = 19);
    refused(record(Bricks, 0), "reserved", |r| r.bricks[0]._reserved0 = 1);
    refused(record(Bricks, 0), "reserved", |r| r.bricks[0]._reserved1[2] = 1);
    refused(record(Bricks, 0), "0, 27,", |r| r.bricks[0].node_count = 0);
    refused(record(Bricks, 0), "vertices", |r| r.bricks[0].vertex_count = 0);
    refused(record(Bricks, 0), "vertices", |r| r.bricks[0].attribute_vertex_count = 0);
    refused(record(Bricks, 0), "height 0", |r| r.bricks[0].height = 0);
    refused(record(Bricks, 0), "height 25", |r| r.bricks[0].height = MAX_BRICK_HEIGHT + 1);
    refused(record(Bricks, 0), "65537 vertices", |r| r.bricks[0].vertex_count = 65537);
    refused(record(Bricks, 0), "65537 vertices", |r| r.bricks[0].attribute_vertex_count = 65537);
    refused(record(Bricks, 0), "82 attribute vertices", |r| r.bricks[0].attribute_vertex_count = 82);
    refused(record(Bricks, 0), "origin", |r| r.bricks[0].origin[2] = 1);
    refused(record(Bricks, 0), "origin", |r| r.bricks[0].origin[2] = i64::MIN);
    refused(record(Bricks, 0), "bounds", |r| r.bricks[0].min[0] = r.bricks[0].max[0] + 1);
    refused(record(Bricks, 0), "bounds", |r| r.bricks[0].max[1] = NEAR_STEPS + 1);
    refused(record(Bricks, 0), "bounds", |r| r.bricks[0].min[1] = i64::MIN);
    refused(record(Bricks, 1), "bounds", |r| r.bricks[1].max[2] = WIDE_STEPS + 1);
    refused(record(Bricks, 0), "means", |r| r.bricks[0].mean_albedo[2] = f32::NAN);
    refused(record(Bricks, 0), "means", |r| r.bricks[0].mean_emission[0] = -1.0);
    refused(record(Bricks, 0), "origin [NaN", |r| r.bricks[0].root.origin[0] = f32::NAN);
    refused(record(Bricks, 0), "exponents [0,", |r| r.bricks[0].root.exponent[0] = 0);
    refused(record(Bricks, 0), "exponents [255,", |r| r.bricks[0].root.exponent[0] = 255);
    refused(record(Bricks, 0), "bounds of child 0", |r| {
        (r.bricks[0].root.lo[2][0], r.bricks[0].root.hi[2][0]) = (9, 8);
    });
    refused(record(Bricks, 0), "root with children", |r| r.bricks[0].root.inner_mask ^= 128);
    refused(record(Bricks, 0), "root with 1 inner children from 2", |r| r.bricks[0].root.child_base = 2);
    refused(record(Bricks, 0), "root with 1 inner children from 0", |r| r.bricks[0].root.child_base = 0);
    refused(record(Bricks, 0), "root with triangles up to 28", |r| r.bricks[0].root.triangle_base += 1);
    for (part, spoil) in [
        (Payload::Geometry(0), (|b| b.geometry.bytes -= 16) as fn(&mut Brick)),
        (Payload::Geometry(0), |b| b.vertex_count += 4),
        (Payload::Geometry(0), |b| b.flags = BRICK_WIDE),
        (Payload::Geometry(0), |b| b.node_count = u32::MAX),
        (Payload::Geometry(0), |b| b.geometry = Span::default()),
        (Payload::Attributes(0), |b| b.attributes.bytes += 8),
        (Payload::Attributes(0), |b| b.attributes.bytes = (1 << 31) + 16),
        (Payload::Attributes(0), |b| b.attributes = Span::default()),
    ] {
        refused(Part::Payload(part), "bytes", |r| spoil(&mut r.bricks[0]));
    }
}

#[test]
fn occupancy() {
    use Section::Occupancy;
    refused(Part::Section(Occupancy), "2 records", |r| r.occupancy.truncate(2));
    refused(Part::Section(Occupancy), "4 records", |r| r.occupancy.push(r.occupancy[0]));
    refused(Part::Section(Section::Manifest), "has_proxies false", |r| r.manifest.has_proxies = false);
    refused(Part::Section(Section::Manifest), "has_proxies true", |r| r.occupancy.clear());
    refused(record(Section::Bricks, 1), "a span of proxies", |r| {
        r.occupancy.clear();
        (r.manifest.has_proxies, r.bricks[0].proxies) = (false, Span::default());
    });
    for bytes in [0, 8, 17, (1 << 16) + 16, u64::MAX] {
        refused(Part::Payload(Payload::Proxies(1)), "bytes", |r| r.bricks[1].proxies.bytes = bytes);
    }
    refused(record(Occupancy, 0), "reserved", |r| r.occupancy[0]._reserved = 1);
    refused(record(Occupancy, 1), "cell_log2", |r| r.occupancy[1].cell_log2 -= 1);
    refused(record(Occupancy, 1), "cell_log2", |r| r.occupancy[1].cell_log2 = i32::MAX);
    refused(record(Occupancy, 2), "origin", |r| r.occupancy[2].origin[2] += 1);
    refused(record(Occupancy, 2), "origin", |r| r.occupancy[2].origin[0] = i64::MIN);
    refused(record(Occupancy, 0), "no occupied cell", |r| r.occupancy[0].bits = [0; 512]);
    refused(record(Occupancy, 2), "bounds", |r| {
        let far = 1 << 60;
        let brick = &mut r.bricks[2];
        brick.origin[0] += far;
        (brick.min[0], brick.max[0]) = (brick.min[0] + far, brick.max[0] + far);
    });
}

#[test]
fn binary_tree() {
    use Section::Top2;
    refused(Part::Section(Top2), "0 nodes over 4 leaves", |r| r.top2.clear());
    refused(record(Top2, 0), "bounds", |r| r.top2[0].min[0] = r.top2[0].max[0] + 1);
    refused(record(Top2, 0), "bounds", |r| r.top2[0].max[0] = LATTICE_LIMIT + 1);
    refused(record(Top2, 0), "bounds", |r| r.top2[0].min[0] = i64::MIN);
    refused(record(Top2, 0), "child 1 with bounds", |r| r.top2[0].min = r.top2[0].min.map(|x| x + 1));
    refused(record(Top2, 1), "child 0", |r| r.top2[1].left = 0);
    refused(record(Top2, 1), "child 1", |r| r.top2[1].left = 1);
    refused(record(Top2, 1), "child 7", |r| r.top2[1].right = 7);
    refused(record(Top2, 1), "child 4294967294", |r| r.top2[1].right = u32::MAX - 1);
    refused(record(Top2, 1), "another node has", |r| r.top2[1].right = 3);
    refused(record(Top2, 2), "another node has", |r| {
        r.top2[2].left = 4;
        r.top2[2].min = r.top2[0].min;
        r.top2[2].max = r.top2[0].max;
    });
    refused(record(Top2, 3), "leaf 4", |r| r.top2[3].left = 4);
    refused(record(Top2, 4), "leaf 0, which another node has", |r| r.top2[4].left = 0);
    refused(record(Top2, 3), "without a parent", |r| (r.top2[1].left, r.top2[1].right) = (0, TOP_LEAF));
    refused(Part::Section(Top2), "no node with leaf 3", |r| {
        r.top2[2] = TopNode2 { left: 2, right: TOP_LEAF, ..r.top2[2] };
        r.top2.truncate(5);
    });
    refused(record(Top2, 7), "without a parent", |r| r.top2.push(r.top2[6]));
}

/// A scene with one more instance than `levels`, whose binary tree is a chain of that many levels.
fn chain(levels: u32) -> Resident {
    let mut resident = resident();
    let world = resident.instances[0];
    let copy = Instance { base: 0, ..resident.instances[1] };
    resident.instances = std::iter::once(world).chain((1..levels - 1).map(|_| copy)).collect();
    resident.leaves = vec![Leaf { instance: 0, brick: 0 }, Leaf { instance: 0, brick: 1 }];
    resident.leaves.extend((1..levels - 1).map(|instance| Leaf { instance, brick: 2 }));
    let node = |left, right| TopNode2 { min: [0; 3], max: [0; 3], left, right };
    let leaves = resident.leaves.len() as u32;
    resident.top2 = (0..leaves - 1).flat_map(|i| [node(2 * i + 1, 2 * i + 2), node(i, TOP_LEAF)]).collect();
    resident.top2.push(node(leaves - 1, TOP_LEAF));
    let inner = (leaves - 1) / 7;
    resident.top8 = (0..=inner)
        .map(|i| {
            let mut top: TopNode8 = bytemuck::Zeroable::zeroed();
            (top.child_base, top.leaf_base) = (i + 1, i * 7);
            for slot in 0..7.min(leaves - i * 7) {
                top.meta[slot as usize] = 0x20 | slot as u8;
            }
            if i < inner {
                (top.meta[7], top.inner_mask) = (0x3f, 128);
            }
            top
        })
        .collect();
    resident.manifest.triangles_instanced = 32 + 10 * u64::from(levels - 2);
    resident
}

#[test]
fn heights_of_the_top_level() {
    validate::resident(&chain(MAX_TOP2_HEIGHT)).unwrap();
    let flaw = validate::resident(&chain(MAX_TOP2_HEIGHT + 1)).unwrap_err();
    assert_eq!(flaw.part, record(Section::Top2, 2 * (MAX_TOP2_HEIGHT - 1)));
    assert!(flaw.found.contains("children on level 97"), "{flaw}");

    let mut chain = chain(90);
    let spread = |wide: &mut Resident, levels: u32| {
        wide.top8 = (0..levels)
            .map(|i| {
                let mut top: TopNode8 = bytemuck::Zeroable::zeroed();
                (top.child_base, top.leaf_base) = (i + 1, i);
                top.meta[0] = 0x20;
                if i + 1 < levels {
                    (top.meta[1], top.inner_mask) = (0x39, 2);
                }
                top
            })
            .collect();
    };
    spread(&mut chain, MAX_TOP_HEIGHT + 1);
    let flaw = validate::resident(&chain).unwrap_err();
    assert_eq!(flaw.part, record(Section::Top8, MAX_TOP_HEIGHT - 1));
    assert!(flaw.found.contains("children on level 25"), "{flaw}");
    spread(&mut chain, MAX_TOP_HEIGHT);
    let flaw = validate::resident(&chain).unwrap_err();
    assert!(flaw.found.contains("no node with leaf 24"), "{flaw}");
}

#[test]
fn wide_tree() {
    use Section::Top8;
    refused(Part::Section(Top8), "0 nodes over 4 leaves", |r| r.top8.clear());
    refused(record(Top8, 1), "reserved", |r| r.top8[1]._reserved = 1);
    refused(record(Top8, 1), "origin", |r| r.top8[1].origin[0] = LATTICE_LIMIT + 1);
    refused(record(Top8, 1), "exponents [54", |r| r.top8[1].exponent[0] = MAX_TOP_EXPONENT + 1);
    refused(record(Top8, 1), "bounds of child 1", |r| (r.top8[1].lo[1][1], r.top8[1].hi[1][1]) = (1, 0));
    refused(record(Top8, 0), "children", |r| r.top8[0].inner_mask = 0);
    refused(record(Top8, 0), "children", |r| r.top8[0].meta[3] = 0x3a);
    refused(record(Top8, 0), "1 inner children from 2", |r| r.top8[0].child_base = 2);
    refused(record(Top8, 0), "1 inner children from 0", |r| r.top8[0].child_base = 0);
    refused(record(Top8, 1), "leaves up to 5", |r| r.top8[1].leaf_base = 2);
    refused(record(Top8, 1), "leaves up to", |r| r.top8[1].leaf_base = u32::MAX);
    refused(record(Top8, 1), "2 leaves in child 0", |r| r.top8[1].meta[0] = 0x60);
    refused(record(Top8, 1), "leaf 0, which another node has", |r| r.top8[1].leaf_base = 0);
    refused(record(Top8, 1), "without a parent", |r| (r.top8[0].meta[1], r.top8[0].inner_mask) = (0, 0));
    refused(Part::Section(Top8), "no node with leaf 2", |r| r.top8[1].meta[1] = 0);
}

#[test]
fn manifest() {
    let part = Part::Section(Section::Manifest);
    refused(part, "4294967295 triangle ids", |r| r.manifest.triangle_ids = MAX_TRIANGLE_IDS + 1);
    refused(part, "43 triangles stored", |r| r.manifest.triangles_stored += 1);
    refused(part, "53 triangles with", |r| r.manifest.triangles_instanced += 1);
    refused(part, "has_instances", |r| r.manifest.has_instances = false);
    refused(part, "has_wide_bricks", |r| r.manifest.has_wide_bricks = false);
    refused(part, "bounds", |r| r.manifest.max[1] = f64::NAN);
    refused(part, "bounds", |r| r.manifest.max[1] = -2.0);
    refused(part, "ratio of scales 0.5", |r| r.manifest.instance_scale_ratio = 0.5);
    refused(part, "ratio of scales NaN", |r| r.manifest.instance_scale_ratio = f64::NAN);
    refused(part, "provenance 1", |r| r.manifest.provenance[1].first_id = 28);
    refused(part, "provenance 1", |r| r.manifest.provenance[1].source = 1);
    refused(part, "provenance of 42 ids", |r| r.manifest.provenance.truncate(3));
    let mut empty = common::empty().resident;
    validate::resident(&empty).unwrap();
    (empty.manifest.min, empty.manifest.max) = ([0.0; 3], [0.0; 3]);
    assert!(validate::resident(&empty).unwrap_err().found.contains("bounds"));
}

#[test]
fn spans_that_do_not_tile_the_file() {
    let resident = resident();
    let end = resident.payloads().map(|(_, span)| span.offset + span.bytes).max().unwrap().next_multiple_of(4096);
    validate::spans(&resident, end).unwrap();
    let refused = |spoil: &dyn Fn(&mut Resident), payload_end| {
        let mut resident = resident.clone();
        spoil(&mut resident);
        validate::spans(&resident, payload_end).unwrap_err();
    };
    refused(&|_| {}, end + 4096);
    refused(&|_| {}, end - 4096);
    refused(&|r| r.bricks[0].geometry.offset = 0, end);
    refused(&|r| r.bricks[0].geometry.offset += 16, end);
    refused(&|r| r.bricks[1].geometry.offset = r.bricks[0].geometry.offset, end);
    refused(&|r| r.bricks[2].attributes.bytes = 5000, end);
    refused(&|r| r.textures[0].tail.bytes = u64::MAX - 15, end);
    refused(&|r| r.textures[0].tail.offset = u64::MAX - 15, u64::MAX);
    refused(&|r| r.textures.clear(), end);
    refused(&|r| r.tiles[1].offset = r.tiles[0].offset, end);
    refused(&|r| r.tiles.clear(), end);
}

/// A file whose checksums are right is refused on opening; verifying lists the same.
#[track_caller]
fn file_refused(found: &str, spoil: impl FnOnce(&mut Image)) {
    let (_folder, path, _) = written();
    let mut image = Image::read(&path);
    spoil(&mut image);
    fs::write(&path, &image.bytes).unwrap();
    let error = SceneFile::open(&path).expect_err(found);
    assert!(matches!(error, Error::Invalid { .. } | Error::Length { .. }), "{error}");
    assert!(error.to_string().contains(found), "{error} does not say {found}");
    let problems = common::problems(&path);
    assert!(problems.starts_with(&error.to_string()), "{problems}");
}

#[test]
fn headers() {
    file_refused("pages of 4096 bytes", |image| image.edit_header(|h| h.page_bytes = 8192));
    file_refused("too long", |image| image.edit_header(|h| h.file_bytes -= 1));
    file_refused("too short", |image| image.edit_header(|h| h.file_bytes = u64::MAX));
    for bytes in [0, 480, 519, 521, 540, 760, u64::MAX] {
        file_refused("a directory of 520 to 720 bytes", |image| image.edit_header(|h| h.directory_bytes = bytes));
    }
    for offset in [0, 4097, 1 << 40, u64::MAX - 4095] {
        file_refused("the header is not valid", |image| image.edit_header(|h| h.directory_offset = offset));
    }
    file_refused("zero at byte 100", |image| {
        image.bytes[100] = 1;
        let page: &mut [u8; 4096] = (&mut image.bytes[..4096]).try_into().unwrap();
        page[48..56].fill(0);
        let (_, checksum) = layout::Header::read(page);
        page[48..56].copy_from_slice(&checksum.to_le_bytes());
    });
}

#[test]
fn directories() {
    use Section::*;
    file_refused("kind 99 (unknown)", |image| image.edit_entry(Leaves, |e| e.kind = 99));
    file_refused("kept for visibility fields", |image| {
        image.edit_entry(Leaves, |e| e.kind = KIND_VISIBILITY_FIELDS);
    });
    file_refused("kind 3 (instances)", |image| image.edit_entry(Objects, |e| e.kind = 3));
    file_refused("records of 300 bytes", |image| image.edit_entry(Bricks, |e| e.record_bytes = 300));
    file_refused("4 records in 40 bytes", |image| image.edit_entry(Leaves, |e| e.bytes += 8));
    file_refused("18446744073709551615 records", |image| image.edit_entry(Leaves, |e| e.count = u64::MAX));
    file_refused("at the next multiple of 64", |image| image.edit_entry(Leaves, |e| e.offset += 64));
    file_refused("at the next multiple of 64", |image| image.edit_entry(Leaves, |e| e.offset = u64::MAX));
    file_refused("ends within the file", |image| {
        image.edit_entry(Leaves, |e| (e.count, e.bytes) = (u32::MAX.into(), u64::from(u32::MAX) * 8));
    });
    file_refused("the last section ending at byte", |image| {
        image.edit_entry(Occupancy, |e| (e.count, e.bytes) = (0, 0));
    });
    file_refused("text that does not parse", |image| {
        image.section(Manifest)[0] = b'[';
        image.seal();
    });
    file_refused("record 3 of section leaves", |image| image.edit::<Leaf>(Leaves, 3, |leaf| leaf.brick = 7));
    file_refused("brick 1 geometry", |image| image.edit::<Brick>(Bricks, 1, |b| b.geometry.offset += 4096));
}
