//! Materials, details of attributes and lights that break a rule of the format are refused.

use crate::common::{self, scene, written};
use bricks::*;

/// The spoiled resident part is refused with a message that names the record and says `found`.
#[track_caller]
fn refused(section: Section, index: u32, found: &str, spoil: impl FnOnce(&mut Resident)) {
    let (_folder, _path, scene) = written();
    let mut resident = scene.resident;
    validate::resident(&resident).unwrap();
    spoil(&mut resident);
    let flaw = validate::resident(&resident).expect_err(found);
    assert_eq!(flaw.part, Part::Record(section, index), "{flaw}");
    assert!(flaw.found.contains(found), "{flaw} does not say {found}");
}

#[test]
fn absorption_is_packed_to_a_five_hundredth_of_the_greatest() {
    for (given, within) in [
        ([0.0; 3], 0.0),
        ([1.0, 0.5, 0.25], 0.0),
        ([0.3, 0.7, 0.001], 0.7 / 511.0),
        ([65_408.0, 1e9, f64::INFINITY], 128.0),
        ([1e-7, 2e-7, 3e-7], 6e-8),
        ([511.4, 0.0, 1.0], 0.5),
        ([511.6, 0.0, 1.0], 1.0),
    ] {
        let found = unpack_absorption(pack_absorption(given));
        for (found, given) in found.into_iter().zip(given) {
            let held = given.min(65_408.0);
            assert!((f64::from(found) - held).abs() <= within + 1e-12, "{found} for {given}");
        }
    }
    assert_eq!(pack_absorption([f64::NAN, -1.0, 0.0]), 0);
}

/// A field from 0 to 1.
type Share = fn(&mut Material) -> &mut f32;

#[test]
fn materials() {
    let material = |found: &str, spoil: fn(&mut Material)| {
        refused(Section::Materials, 0, found, |r| spoil(&mut r.materials[0]));
    };
    material("texture 2", |m| m.normal_texture = 2);
    material("texture 2", |m| m.metallic_roughness_texture = 2);
    material("texture 2", |m| m.occlusion_texture = 2);
    material("texture 4294967294", |m| m.emissive_texture = NONE - 1);
    material("alpha_cutoff: -1", |m| m.alpha_cutoff = -1.0);
    let shares: [(&str, Share); 10] = [
        ("metallic", |m| &mut m.metallic),
        ("roughness", |m| &mut m.roughness),
        ("occlusion_strength", |m| &mut m.occlusion_strength),
        ("clearcoat", |m| &mut m.clearcoat),
        ("clearcoat_roughness", |m| &mut m.clearcoat_roughness),
        ("transmission", |m| &mut m.transmission),
        ("specular_weight", |m| &mut m.specular_weight),
        ("specular", |m| &mut m.specular[0]),
        ("specular", |m| &mut m.specular[1]),
        ("specular", |m| &mut m.specular[2]),
    ];
    for (name, share) in shares {
        for value in [-0.125, 1.0 + f32::EPSILON, f32::NAN, f32::INFINITY] {
            refused(Section::Materials, 1, name, |r| *share(&mut r.materials[1]) = value);
        }
        let mut resident = written().2.resident;
        for value in [0.0, 1.0] {
            *share(&mut resident.materials[1]) = value;
            validate::resident(&resident).unwrap();
        }
    }
    // What refracts has an index of refraction and BLEND; nothing else absorbs.
    material("absorption 0x1", |m| m.absorption = 1);
    for flags in [MATERIAL_REFRACTS, MATERIAL_REFRACTS | MATERIAL_MASK] {
        refused(Section::Materials, 1, "flags", |r| r.materials[1].flags = flags);
    }
    refused(Section::Materials, 1, "specular", |r| {
        (r.materials[1].flags, r.materials[1].specular) = (MATERIAL_BLEND | MATERIAL_REFRACTS, [1.0; 3]);
    });
    let mut resident = written().2.resident;
    (resident.materials[1].flags, resident.materials[1].absorption) = (MATERIAL_BLEND | MATERIAL_REFRACTS, 1);
    validate::resident(&resident).unwrap();
    material("normal_scale: NaN", |m| m.normal_scale = f32::NAN);
    material("normal_scale: -inf", |m| m.normal_scale = f32::NEG_INFINITY);
    material("sets of texture coordinates 0x20", |m| m.uv_sets = 32);
    for row in 0..2 * MATERIAL_TEXTURES {
        for column in 0..4 {
            refused(Section::Materials, 1, "NaN", |r| r.materials[1].uv_from_set[row][column] = f32::NAN);
        }
    }
    material("coordinates by", |m| m.uv_from_set[2 * EMISSIVE][3] = -1.0);
    material("words of layers", |m| m.uv_from_set[2 * EMISSIVE + 1][3] = 1.0);
    material("words of layers", |m| m.flags |= bricks::MATERIAL_LAYERS);
    material("words of layers", |m| {
        m.flags |= bricks::MATERIAL_LAYERS;
        m.uv_from_set[1][3] = 0.5;
    });
    // Further textures follow the material that has them, and are nothing else.
    material("flags 0x100", |m| *m = Material::further());
    let mut resident = written().2.resident;
    let last = resident.materials.len() - 1;
    resident.materials[last - 1].flags |= bricks::MATERIAL_MORE;
    resident.materials[last] = Material { normal_scale: 0.5, normal_texture: 0, ..Material::further() };
    validate::resident(&resident).unwrap();
    resident.materials[last].roughness = 0.5;
    assert!(validate::resident(&resident).is_err());
    let last = last as u32;
    refused(Section::Materials, last, "flags", |r| {
        r.materials.last_mut().into_iter().for_each(|m| m.flags |= bricks::MATERIAL_MORE);
    });
}

#[test]
fn lights() {
    let light = |found: &str, spoil: fn(&mut PunctualLight)| {
        refused(Section::Lights, 1, found, |r| spoil(&mut r.lights[1]));
    };
    light("kind 3", |l| l.kind = 3);
    light("reserved word 7", |l| l._reserved = 7);
    light("NaN", |l| l.position[1] = f64::NAN);
    light("direction [1.0, 0.0, inf]", |l| l.direction[2] = f64::INFINITY);
    light("direction [0.0, 0.0, 0.0]", |l| l.direction = [0.0; 3]);
    light("direction [1.0, 0.001", |l| l.direction[1] = 0.001);
    light("color", |l| l.color[2] = f32::INFINITY);
    light("color", |l| l.color[0] = -1.0);
    light("range: -1", |l| l.range = -1.0);
    light("range: inf", |l| l.range = f32::INFINITY);
    for cone in [[0.5, 0.25], [-0.5, 0.5], [0.0, 1.6], [f32::NAN, 0.5], [0.0, f32::NAN]] {
        refused(Section::Lights, 0, "cone", |r| r.lights[0].cone = cone);
    }
}

#[test]
fn details() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    let payload = Payload::Attributes(2);
    let layout = AttributeLayout::of(&scene().resident.bricks[2]);
    assert!(layout.details < layout.bytes);
    let copied = |vertex: u64, detail: Option<AttributeDetail>| {
        let mut scene = scene();
        let bytes = scene.payloads.get_mut(&payload).unwrap();
        if let Some(detail) = detail {
            let at = (layout.details + 16 * vertex) as usize;
            bytes[at..at + 16].copy_from_slice(bytemuck::bytes_of(&detail));
        }
        scene.write(&path);
        let file = SceneFile::open(&path).unwrap();
        let mut out = vec![0; file.loaded_bytes(payload) as usize];
        let result = file.copy(payload, &mut out);
        assert_eq!(common::problems(&path), result.as_ref().map_or_else(|e| format!("{e}\n"), |()| String::new()));
        assert!(result.is_err() || out == scene.payloads[&payload], "what is copied is what was written");
        result
    };
    copied(0, None).unwrap();
    let detail = |tangent, handedness, uv| Some(AttributeDetail { tangent, handedness, uv });
    for (tangent, handedness) in [(5, 1.0), (5, -1.0), (NO_NORMAL, 0.0)] {
        copied(29, detail(tangent, handedness, [1e30, -0.0])).unwrap();
    }
    let wrong = [(5, 0.0), (5, 0.5), (5, f32::NAN), (NO_NORMAL, 1.0), (NO_NORMAL, -0.0)];
    for (tangent, handedness) in wrong {
        let error = copied(29, detail(tangent, handedness, [0.0; 2])).unwrap_err().to_string();
        assert!(error.contains("of vertex 29"), "{error}");
    }
    for uv in [[f32::NAN, 0.0], [0.0, f32::INFINITY]] {
        let error = copied(4, detail(5, 1.0, uv)).unwrap_err().to_string();
        assert!(error.contains("of vertex 4"), "{error}");
    }
}
