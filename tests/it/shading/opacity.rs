//! What lets rays pass by chance, and by alpha that a closed form gives.

use crate::common;
use brickwalk::output::npy;
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::session::trace::{for_rays, trace};
use brickwalk_convert::build::{BuildSettings, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Mesh, Placement, Primitive, SourceScene, SourceTexture};
use std::path::{Path, PathBuf};

/// Flags, factor, cutoff and texture of a material.
type Alpha = (u32, f32, f32, u32);

const FADE: u32 = 0;
const PLAIN: u32 = bricks::NONE;

/// Sheets of 1 x 1 in the planes z = 0, 1, …, a material each; the texture fades from one side to the other.
fn sheets(folder: &Path, materials: &[Alpha]) -> PathBuf {
    let sheet = |i: u32| {
        let z = f64::from(i);
        Primitive {
            material: i,
            positions: vec![[0.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [0.0, 1.0, z]],
            uvs: Some(vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]),
            indices: vec![0, 1, 2, 0, 2, 3],
            ..Primitive::default()
        }
    };
    let material = |&(flags, alpha, alpha_cutoff, base_color_texture): &Alpha| bricks::Material {
        base_color: [1.0, 1.0, 1.0, alpha],
        alpha_cutoff,
        flags,
        base_color_texture,
        ..bricks::Material::DIFFUSE
    };
    let source = SourceScene {
        meshes: vec![Mesh { name: "sheets".into(), primitives: (0..materials.len() as u32).map(sheet).collect() }],
        placements: vec![Placement {
            name: "n".into(),
            mesh: 0,
            source: 0,
            world_from_mesh: IDENTITY,
            ..Placement::default()
        }],
        materials: materials.iter().map(material).collect(),
        textures: vec![SourceTexture {
            name: "fade".into(),
            width: 128,
            height: 1,
            wrap: bricks::WRAP_CLAMP | bricks::WRAP_CLAMP << 16,
            // Alpha x and 255 - x at the same distance from the middle.
            rgba: (0..128).flat_map(|x| [255, 255, 255, 2 * x + x / 64]).collect(),
        }],
        sources: vec![bricks::Source { name: "sheets".into(), bytes: 0, hash: "2d06800538d394c2".into() }],
        ..SourceScene::default()
    };
    let path = folder.join("scene.bricks");
    build(source, &BuildSettings { brick_triangles: 2, ..BuildSettings::default() }, &path, &Progress::hidden())
        .expect("a scene");
    path
}

/// Rays along z from below all sheets at points over them, `side` x `side`.
fn rays(side: u32) -> Vec<npy::Ray> {
    let at = |i: u32| (f64::from(i) + 0.37) / f64::from(side);
    let ray = |i: u32| npy::Ray {
        origin: [at(i % side), at(i / side), -1.0],
        direction: [0.0, 0.0, 1.0],
        t_min: 0.0,
        t_max: f64::INFINITY,
    };
    (0..side * side).map(ray).collect()
}

fn traced(scene: &Path, options: &str, rays: &[npy::Ray], any: bool) -> Vec<npy::Hit> {
    let settings = for_rays(&common::settings(options));
    let file = open_scene(scene).expect("the scene");
    let mut opened = Opened::open(file, scene, &settings).expect("a session");
    trace(&mut opened.traced(), rays, any, &mut |_| ()).expect("hits").0
}

const SIDE: u32 = 160;

/// Shares of the hits by sheet, two triangles each, and of the misses, last.
fn shares(hits: &[npy::Hit], sheets: usize) -> Vec<f64> {
    let mut counts = vec![0u32; sheets + 1];
    for hit in hits {
        counts[if hit.triangle == bricks::NONE { sheets } else { hit.triangle as usize / 2 }] += 1;
    }
    counts.iter().map(|&count| f64::from(count) / hits.len() as f64).collect()
}

#[test]
fn blending_is_a_share_of_the_rays() {
    let folder = common::folder();
    let blend = bricks::MATERIAL_BLEND;
    // Alpha 0.3 (no texture), the fade with a factor of 0.8 (0.4 on average), alpha 0, alpha 1.
    let scene = sheets(
        folder.path(),
        &[(blend, 0.3, 0.0, PLAIN), (blend, 0.8, 0.0, FADE), (blend, 0.0, 0.0, PLAIN), (blend, 1.0, 0.0, PLAIN)],
    );
    let rays = rays(SIDE);
    let hits = traced(&scene, "--cache 100%", &rays, false);
    let found = shares(&hits, 4);
    let expected = [0.3, 0.7 * 0.4, 0.0, 0.7 * 0.6, 0.0];
    for (share, expected) in found.iter().zip(expected) {
        // Four standard deviations, and none where nothing is left to chance.
        let sigma = (expected * (1.0 - expected) / f64::from(SIDE * SIDE)).sqrt();
        assert!((share - expected).abs() <= 4.0 * sigma, "{found:?} is not {expected}");
    }
    assert_eq!(hits, traced(&scene, "--cache 60%", &rays, false), "whatever the cache");
    let any = traced(&scene, "--cache 60%", &rays, true);
    assert!(any.iter().all(|hit| hit.triangle != bricks::NONE), "the last sheet stops all");
    // The order of rays does not matter, what is drawn is theirs.
    let backwards: Vec<npy::Ray> = rays.iter().rev().copied().collect();
    let mut again = traced(&scene, "--cache 100%", &backwards, false);
    again.reverse();
    assert_eq!(hits, again);
}

/// `--opaque`: alpha counts for nothing, on either executor.
#[test]
fn opaque_rays_stop_at_every_triangle() {
    let folder = common::folder();
    let (blend, mask) = (bricks::MATERIAL_BLEND, bricks::MATERIAL_MASK);
    let scene = sheets(
        folder.path(),
        &[(blend, 0.0, 0.0, PLAIN), (mask, 1.0, 0.5, FADE), (blend, 0.3, 0.0, FADE), (blend, 1.0, 0.0, PLAIN)],
    );
    let rays = rays(40);
    for adapter in common::adapters() {
        let traced = |options: &str, any: bool| {
            let mut settings = for_rays(&common::settings(&format!("--cache 100% {options}")));
            brickwalk::settings::Group::set(&mut settings, "adapter", &adapter).expect("an adapter");
            let mut opened =
                Opened::open(open_scene(&scene).expect("the scene"), &scene, &settings).expect("a session");
            trace(&mut opened.traced(), &rays, any, &mut |_| ()).expect("hits").0
        };
        for schedule in ["chc", "demand", "plain", "plain-bvh2"] {
            let hits = traced(&format!("--opaque --schedule {schedule}"), false);
            assert!(hits.iter().all(|hit| hit.triangle < 2 && hit.t == 1.0), "{adapter}, {schedule}");
        }
        let up_to = traced("--opaque", true);
        assert!(up_to.iter().all(|hit| hit.triangle != bricks::NONE), "{adapter}");
        let through = traced("", false);
        assert!(through.iter().all(|hit| hit.triangle >= 2), "{adapter}: control: all pass the first");
    }
}

#[test]
fn a_mask_cuts_where_alpha_crosses_the_cutoff() {
    let folder = common::folder();
    let mask = bricks::MATERIAL_MASK;
    let scene = sheets(
        folder.path(),
        &[(mask, 1.0, 0.5, FADE), (mask, 0.5, 0.25, FADE), (mask, 0.3, 0.5, PLAIN), (mask, 0.5, 0.5, PLAIN)],
    );
    let file = open_scene(&scene).expect("the scene");
    let opaque: Vec<bool> = file.resident().bricks.iter().map(|brick| brick.opacity_count == 0).collect();
    assert_eq!(opaque.iter().filter(|x| **x).count(), 1, "alpha that equals the cutoff stops every ray: {opaque:?}");
    let rays = rays(SIDE);
    for (ray, hit) in rays.iter().zip(traced(&scene, "--cache 100%", &rays, false)) {
        // Half lies in the middle.
        let sheet = if ray.origin[0] >= 0.5 { 0 } else { 3 };
        assert_eq!(hit.triangle / 2, sheet, "{ray:?}");
    }
}
