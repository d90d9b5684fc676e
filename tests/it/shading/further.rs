//! Further textures of materials: of specular, clear coat, film, anisotropy and sheen. Each half of a picture is that
//! of a material without textures, whose factors are what the texels say. A coat's normal is held against one that the
//! whole surface has.

use crate::common;
use bricks::{Layers, MATERIAL_DOUBLE_SIDED, MATERIAL_MORE, Material};
use brickwalk::scene::Camera;
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::session::renderer::renderer;
use brickwalk::settings::Group;
use brickwalk_convert::build::{BuildSettings, TextureEncoding, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Mesh, Placement, Primitive, SourceScene, SourceTexture};
use glam::DVec3;

/// Pixels each way.
const SIDE: u32 = 16;

/// Of 8 by 8 texels, all of one colour or, right of the middle, of another.
fn halves(left: [u8; 4], right: [u8; 4]) -> SourceTexture {
    let rgba = (0..64).flat_map(|i| if i % 8 < 4 { left } else { right }).collect();
    let wrap = bricks::WRAP_CLAMP | bricks::WRAP_CLAMP << 16;
    SourceTexture { name: "map".into(), width: 8, height: 8, wrap, rgba }
}

/// The radiance of a picture straight down on a sheet in the plane y = 0 from -1 to 1, whose coordinates grow along x
/// and z, of the first of `materials`.
fn seen(materials: &[Material], textures: &[SourceTexture], [adapter, options]: [&str; 2]) -> Vec<[f32; 3]> {
    let primitive = Primitive {
        positions: vec![[-1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0]],
        normals: Some(vec![[0.0, 1.0, 0.0]; 4]),
        uvs: Some(vec![[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]),
        tangents: Some(vec![[1.0, 0.0, 0.0, -1.0]; 6]),
        indices: vec![0, 1, 2, 0, 2, 3],
        ..Primitive::default()
    };
    let placement = Placement { name: "p".into(), world_from_mesh: IDENTITY, ..Placement::default() };
    let source = SourceScene {
        meshes: vec![Mesh { name: "sheet".into(), primitives: vec![primitive] }],
        placements: vec![placement],
        materials: materials.to_vec(),
        textures: textures.to_vec(),
        sources: vec![bricks::Source { name: "t".into(), bytes: 0, hash: "2d06800538d394c2".into() }],
        ..SourceScene::default()
    };
    let folder = common::folder();
    let path = folder.path().join("scene.bricks");
    let settings = BuildSettings { textures: TextureEncoding::Raw, ..BuildSettings::default() };
    build(source, &settings, &path, &Progress::hidden()).expect("a scene");
    let mut settings = common::settings(&format!("--size {SIDE}x{SIDE} --frames 1 {options}"));
    settings.set("adapter", adapter).expect("an adapter");
    let opened = Opened::open(open_scene(&path).expect("the scene"), &path, &settings).expect("a session");
    let camera = Camera {
        position: DVec3::new(0.0, 4.0, 0.0),
        target: DVec3::ZERO,
        up: DVec3::NEG_Z,
        fov_y: 10f64.to_radians(),
    };
    renderer(opened, &path, &settings).expect("lamps").frame(0, &camera).expect("a frame").pixels.radiance
}

/// The columns of one half that no texel of the other is mixed into.
fn half(picture: &[[f32; 3]], is_right: bool) -> Vec<[f32; 3]> {
    let columns = if is_right { 12..16 } else { 0..4 };
    picture.iter().enumerate().filter(|(i, _)| columns.contains(&(i % SIDE as usize))).map(|(_, c)| *c).collect()
}

/// The greatest difference, relative to the greatest value.
fn apart(a: &[[f32; 3]], b: &[[f32; 3]]) -> f32 {
    let most = b.as_flattened().iter().fold(0.0f32, |most, x| most.max(*x));
    assert!(a.len() == b.len() && most > 0.0);
    a.as_flattened().iter().zip(b.as_flattened()).fold(0.0f32, |all, (a, b)| all.max((a - b).abs())) / most
}

const LIT: &str = "--effects primary --sun 0.36,0.8,0.48 --sky-intensity 0.5 --cache 100%";

/// A material with more textures, and without any what each half of its sheet is.
struct Case {
    name: &'static str,
    material: Material,
    further: Material,
    texels: [[u8; 4]; 2],
    as_factors: fn(&Material, [u8; 4]) -> Material,
}

fn share(byte: u8) -> f32 {
    f32::from(byte) / 255.0
}

fn linear(byte: u8) -> f32 {
    let x = share(byte);
    if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }
}

fn with_layers(material: &Material, change: impl FnOnce(&mut Layers)) -> Material {
    let (mut material, mut layers) = (*material, material.layers());
    change(&mut layers);
    material.set_layers(&layers);
    material
}

fn cases() -> Vec<Case> {
    let plastic = Material {
        base_color: [0.2, 0.3, 0.4, 1.0],
        flags: MATERIAL_DOUBLE_SIDED,
        roughness: 0.6,
        specular: [0.08; 3],
        specular_weight: 0.9,
        ..Material::DIFFUSE
    };
    let coated = Material { clearcoat: 0.9, clearcoat_roughness: 0.8, ..plastic };
    let metal = Material { metallic: 0.5, ..coated };
    let layered = |layers: Layers| {
        let mut material = metal;
        material.set_layers(&layers);
        material
    };
    let further = Material::further();
    vec![
        Case {
            name: "specular",
            material: plastic,
            further: Material { base_color_texture: 0, ..further },
            texels: [[255, 188, 64, 255], [100, 255, 200, 90]],
            as_factors: |m, [r, g, b, a]| Material {
                specular: [r, g, b].map(|c| 0.08 * linear(c) * share(a)),
                specular_weight: m.specular_weight * share(a),
                ..*m
            },
        },
        Case {
            name: "coat",
            material: coated,
            further: Material { metallic_roughness_texture: 0, ..further },
            texels: [[255, 100, 0, 0], [40, 255, 7, 9]],
            as_factors: |m, [r, g, _, _]| Material {
                clearcoat: m.clearcoat * share(r),
                clearcoat_roughness: m.clearcoat_roughness * share(g),
                ..*m
            },
        },
        Case {
            name: "film",
            material: layered(Layers {
                film: 0.8,
                film_index: 1.5,
                film_thickness: 600.0,
                film_least: 100.0,
                ..Layers::NONE
            }),
            further: Material { metallic_roughness_texture: 0, ..further },
            texels: [[255, 255, 255, 51], [255, 255, 100, 204]],
            as_factors: |m, [_, _, b, a]| {
                with_layers(m, |layers| {
                    layers.film *= share(b);
                    layers.film_thickness = 100.0 + share(a) * 500.0;
                })
            },
        },
        Case {
            name: "anisotropy",
            material: layered(Layers { anisotropy: 0.9, rotation: 0.1, ..Layers::NONE }),
            further: Material { occlusion_texture: 0, ..further },
            texels: [[200, 20, 255, 255], [20, 230, 128, 255]],
            as_factors: |m, [r, g, b, _]| {
                with_layers(m, |layers| {
                    let [x, y] = [r, g].map(|c| 2.0 * share(c) - 1.0);
                    layers.rotation += y.atan2(x) / std::f32::consts::TAU;
                    layers.anisotropy *= share(b);
                })
            },
        },
        Case {
            name: "sheen",
            material: layered(Layers { sheen: [0.9, 0.6, 1.0], sheen_roughness: 0.9, ..Layers::NONE }),
            further: Material { emissive_texture: 0, ..further },
            texels: [[255, 188, 64, 255], [100, 255, 200, 120]],
            as_factors: |m, [r, g, b, a]| {
                with_layers(m, |layers| {
                    let color = [r, g, b].map(linear);
                    layers.sheen = [0, 1, 2].map(|k| layers.sheen[k] * color[k]);
                    layers.sheen_roughness *= share(a);
                })
            },
        },
    ]
}

#[test]
fn factors_are_multiplied_by_their_textures() {
    let options = ["cpu", LIT];
    for Case { name, material, further, texels, as_factors } in cases() {
        let more = Material { flags: material.flags | MATERIAL_MORE, ..material };
        let picture = seen(&[more, further], &[halves(texels[0], texels[1])], options);
        let plain = seen(&[material], &[], options);
        for (is_right, texel) in [(false, texels[0]), (true, texels[1])] {
            let truth = seen(&[as_factors(&material, texel)], &[], options);
            let found = half(&picture, is_right);
            let error = apart(&found, &half(&truth, is_right));
            // Layers are kept in 12 bits.
            assert!(error < 1.5e-3, "{name} {texel:?}: {error}");
            let control = apart(&found, &half(&plain, is_right));
            assert!(control > 5e-3, "{name} {texel:?}: only {control} from that without a texture");
        }
    }
}

#[test]
fn coats_have_normals_of_their_own() {
    let texel = [171, 90, 230, 255];
    let bumps = [halves(texel, texel)];
    let black = Material { base_color: [0.0, 0.0, 0.0, 1.0], flags: MATERIAL_DOUBLE_SIDED, ..Material::DIFFUSE };
    let coat = Material { clearcoat: 1.0, clearcoat_roughness: 0.7, ..black };
    let by_sun = format!("{LIT} --sky-intensity 0");
    for adapter in common::adapters() {
        let options = [&adapter, &by_sun[..]];
        let bumpy = Material { normal_texture: 0, normal_scale: 0.5, ..coat };
        let more = |material: Material| Material { flags: material.flags | MATERIAL_MORE, ..material };
        let flat = seen(&[coat], &[], options);
        let of_all = seen(&[bumpy], &bumps, options);
        let own = Material { normal_texture: 0, normal_scale: 0.5, ..Material::further() };
        let of_coat = seen(&[more(coat), own], &bumps, options);
        assert!(apart(&of_coat, &of_all) < 1e-5, "{adapter}: {}", apart(&of_coat, &of_all));
        let smooth = seen(&[more(bumpy), Material::further()], &bumps, options);
        assert!(apart(&smooth, &flat) < 1e-5, "{adapter}: {}", apart(&smooth, &flat));
        assert!(apart(&of_all, &flat) > 0.05, "{adapter}: bumps do not show");
    }
}

#[test]
fn no_cache_changes_what_further_textures_show() {
    let noise = |seed: u32| {
        let rgba = (0..4 * 512 * 512u32).map(|i| (i.wrapping_mul(2_654_435_761).wrapping_add(seed) >> 24) as u8);
        SourceTexture { width: 512, height: 512, rgba: rgba.collect(), ..halves([0; 4], [0; 4]) }
    };
    for case in cases() {
        let Case { name, material, further, .. } = case;
        let more = Material { flags: material.flags | MATERIAL_MORE, base_color_texture: 1, ..material };
        let further = Material { normal_texture: 2, normal_scale: 0.3, ..further };
        let textures = [noise(1), noise(7), noise(99)];
        let picture = |cache: &str| {
            let options = format!("--effects path --bounces 2 --sky-intensity 0.5 --spp 2 --cache {cache}");
            seen(&[more, further], &textures, ["cpu", &options])
        };
        let whole = picture("100%");
        assert_eq!(picture("15%"), whole, "{name}");
    }
}
