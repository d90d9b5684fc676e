//! Fields of visibility (`walk --secondary dvf`): closed forms, equality with exact rays where masks cover, files,
//! independence of cache, picture and lanes.

use crate::common::{self, city, converted, folder};
use brickwalk::frame::{FrameOutput, RenderError, Renderer};
use brickwalk::scene::Camera;
use brickwalk::scene::path::CameraPath;
use brickwalk::secondary::dvf::{Cells, DvfField, DvfSettings, DvfUse};
use brickwalk::secondary::dvf::{Dvf, DvfMade, DvfTracing, Region};
use brickwalk_convert::build::{BuildSettings, build};
use brickwalk_convert::progress::Progress;
use brickwalk_scenes::{Kind, Settings, generate};
use glam::DVec3;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A renderer of a scene in an environment that is 1 everywhere.
fn renderer(scene: &Path, options: &str) -> Renderer {
    common::evenly_lit(scene, "environment", options)
}

/// A cube of `n` x `n` squares a side from -1 to 1, its front outside or inside.
fn cube(folder: &Path, n: usize, is_inside_out: bool) -> PathBuf {
    let (mut text, mut count) = (String::new(), 1);
    for (axis, sign) in (0..3).flat_map(|axis| [(axis, -1.0), (axis, 1.0)]) {
        let at = |i: usize, j: usize| {
            let mut p = [sign; 3];
            p[(axis + 1) % 3] = 2.0 * i as f64 / n as f64 - 1.0;
            p[(axis + 2) % 3] = 2.0 * j as f64 / n as f64 - 1.0;
            format!("v {} {} {}\n", p[0], p[1], p[2])
        };
        (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j))).for_each(|(i, j)| text += &at(i, j));
        for (i, j) in (0..n).flat_map(|j| (0..n).map(move |i| (i, j))) {
            let p = count + i + j * (n + 1);
            let [a, b, c, d] = [p, p + 1, p + n + 2, p + n + 1];
            text += &match (sign > 0.0) != is_inside_out {
                true => format!("f {a} {b} {c} {d}\n"),
                false => format!("f {a} {d} {c} {b}\n"),
            };
        }
        count += (n + 1) * (n + 1);
    }
    converted(folder, &text, "--brick-triangles 64")
}

fn settings(points: u32, longest: u32) -> DvfSettings {
    DvfSettings { points, rays: 64, cells: Cells::Longest(longest), ..DvfSettings::default() }
}

fn made(renderer: &mut Renderer, settings: &DvfSettings, lanes: u32) -> DvfMade {
    let region = Region::scene(renderer.scene.resident());
    renderer.make_dvf(settings, &region, DvfTracing::over(lanes), &mut |_, _| true).expect("a field")
}

/// Rays to the environment: traced, and answered.
fn rays(output: &FrameOutput) -> [u64; 2] {
    let found = output.records.iter().find(|record| record.pass == "environment").expect("a record");
    [found.rays_traced, found.rays_answered]
}

/// A frame by exact rays and by a field: pixels that differ, rays of the first, traced and answered ones of the second.
fn compared(renderer: &mut Renderer, field: Option<(&DvfField, DvfUse)>, camera: &Camera) -> (usize, u64, [u64; 2]) {
    renderer.methods.remove::<Dvf>();
    let exact = renderer.frame(0, camera).expect("a frame");
    if let Some((field, how)) = field {
        renderer.methods.set(Dvf::new(Arc::new(field.clone()), how));
    }
    let answered = renderer.frame(0, camera).expect("a frame");
    let bits = |output: &FrameOutput| -> Vec<[u32; 3]> {
        output.pixels.radiance.iter().map(|c| c.map(f32::to_bits)).collect()
    };
    let differ = bits(&exact).iter().zip(&bits(&answered)).filter(|(a, b)| a != b).count();
    (differ, rays(&exact)[0], rays(&answered))
}

const LABEL: DvfUse = DvfUse { doubt: false, paper: false };
const MASKS: DvfUse = DvfUse { doubt: true, paper: false };

/// The field with hits for misses and misses for hits.
fn flipped(field: &DvfField) -> DvfField {
    let mut flipped = field.clone();
    let words = field.shape.words();
    flipped.masks.chunks_exact_mut(words).for_each(|masks| masks.rotate_left(words / 2));
    flipped.finish(false);
    flipped
}

#[test]
fn a_convex_body_sees_all_of_its_hemisphere() {
    let folder = folder();
    let scene = cube(folder.path(), 4, false);
    let mut renderer = renderer(&scene, "--size 64x64 --cache 100% --spp 16");
    let camera =
        Camera { position: DVec3::new(3.0, 2.5, 3.5), target: DVec3::ZERO, up: DVec3::Y, fov_y: 50f64.to_radians() };
    let made = made(&mut renderer, &settings(4000, 8), 64);
    // No ray from the front of a convex body meets anything.
    let words = made.field.shape.words();
    assert!(made.field.masks.chunks_exact(words).all(|masks| masks[words / 2..].iter().all(|&word| word == 0)));
    for how in [LABEL, MASKS] {
        let (differ, of, [traced, answered]) = compared(&mut renderer, Some((&made.field, how)), &camera);
        assert_eq!(differ, 0, "{how:?}");
        assert_eq!(traced + answered, of);
        assert!(answered >= 9 * traced, "{answered} answered, {traced} traced");
    }
    // E = pi, so it shows its base colour, on average: rays are drawn over the sphere, so cosines scatter by 0.29 of
    // their mean 0.25 of twice that; 16 rays of some 1000 pixels.
    let frame = renderer.frame(0, &camera).expect("a frame");
    let seen: Vec<f64> = (0..frame.pixels.id.len())
        .filter(|&i| frame.pixels.id[i] != u32::MAX)
        .map(|i| f64::from(frame.pixels.radiance[i][0]) / f64::from(frame.pixels.albedo[i][0]))
        .collect();
    let mean = seen.iter().sum::<f64>() / seen.len() as f64;
    assert!(seen.len() > 800 && (mean - 1.0).abs() < 0.03, "{mean} of {} pixels", seen.len());
    // Controls: a field without masks answers nothing, one that says the opposite answers all wrongly.
    let empty = DvfField::unknown(made.field.shape);
    assert_eq!(compared(&mut renderer, Some((&empty, MASKS)), &camera).2[1], 0);
    let (differ, ..) = compared(&mut renderer, Some((&flipped(&made.field), MASKS)), &camera);
    assert!(differ > 800, "{differ} pixels differ by a field that is wrong");
}

#[test]
fn a_closed_box_is_dark_without_a_ray() {
    let folder = folder();
    let scene = cube(folder.path(), 4, true);
    let mut renderer = renderer(&scene, "--size 64x64 --cache 100% --spp 4");
    let camera =
        Camera { position: DVec3::new(0.1, 0.2, -0.3), target: DVec3::X, up: DVec3::Y, fov_y: 90f64.to_radians() };
    let made = made(&mut renderer, &settings(8000, 6), 64);
    let (differ, of, [traced, answered]) = compared(&mut renderer, Some((&made.field, LABEL)), &camera);
    assert_eq!((differ, traced + answered), (0, of));
    assert!(answered >= 9 * traced, "{answered} answered, {traced} traced");
    let frame = renderer.frame(0, &camera).expect("a frame");
    assert!(frame.pixels.radiance.iter().flatten().all(|&c| c == 0.0), "light in a closed box");
    let (differ, ..) = compared(&mut renderer, Some((&flipped(&made.field), LABEL)), &camera);
    assert!(differ > 1000, "{differ} pixels differ by a field that is wrong");
}

#[test]
fn rays_that_are_not_answered_are_those_without_a_field() {
    let folder = folder();
    let scene = city(folder.path(), "30K", "512");
    let path = CameraPath::read(&scene.with_extension("near.json")).expect("a path");
    let camera = path.frame(0, 1);
    let mut renderer = renderer(&scene, "--size 96x64 --cache 100% --spp 4");
    let many = made(&mut renderer, &settings(60_000, 128), 64).field;
    let few = made(&mut renderer, &DvfSettings { rays: 8, round: true, ..settings(4_000, 128) }, 8).field;
    let pixels = 96 * 64;
    let mut wrong = Vec::new();
    for field in [&many, &few] {
        let (differ, of, [traced, answered]) = compared(&mut renderer, Some((field, LABEL)), &camera);
        assert_eq!(traced + answered, of);
        wrong.push((differ, answered));
    }
    // What masks do not cover is wrong, and counted; more points cover more.
    println!("{wrong:?}: pixels of {pixels} that differ, and rays answered");
    assert!(wrong[0].1 > 1000 && wrong[0].0 <= pixels / 20, "{wrong:?} of {pixels} pixels differ");
    // More points answer more rays, and hardly more of them wrongly: the shares differ by less than three deviations of
    // the smaller number.
    let [(of_many, many_answered), (of_few, few_answered)] = wrong[..] else { unreachable!("two fields") };
    assert!(many_answered > 4 * few_answered && few_answered > 50, "{wrong:?}: more points answer more");
    let expected = of_few as f64 / few_answered as f64 * many_answered as f64;
    let deviation = (of_few as f64).sqrt().max(1.0) / few_answered as f64 * many_answered as f64;
    assert!((of_many as f64) < expected + 3.0 * deviation, "{wrong:?}: more points answer worse");
    let (differ, ..) = compared(&mut renderer, Some((&flipped(&many), MASKS)), &camera);
    assert!(differ > pixels / 10, "{differ} pixels differ by a field that is wrong");
    // Hits of bounces ask, too.
    let mut renderer = common::evenly_lit(&scene, "environment,diffuse", "--size 32x32 --cache 100% --diffuse-rays 2");
    renderer.methods.set(Dvf::new(Arc::new(many), LABEL));
    let records = renderer.frame(0, &camera).expect("a frame").records;
    let of_bounces = records.iter().find(|record| record.pass == "diffuse-environment").expect("a record");
    assert!(of_bounces.rays_answered > 0);
}

#[test]
fn a_field_depends_on_scene_and_settings_alone() {
    let folder = folder();
    let scene = city(folder.path(), "30K", "512");
    let asked = DvfSettings { rays: 16, cells: Cells::Auto, ..settings(3000, 0) };
    let options = [
        ("--size 64x64 --cache 100%", 16),
        ("--size 64x64 --cache 15%", 16),
        ("--size 96x31 --cache 15% --evict lru --schedule chc", 1),
        ("--size 200x200 --cache 30% --schedule demand --workers 1", 5),
        ("--size 17x5 --cache 100% --schedule plain", 1024),
    ];
    let mut fields = Vec::new();
    for (options, lanes) in options {
        let mut renderer = renderer(&scene, options);
        let made = made(&mut renderer, &asked, lanes);
        assert_eq!(
            made.trials,
            fields.first().map_or(made.trials.clone(), |(_, trials): &(DvfField, Vec<_>)| trials.clone())
        );
        assert!(made.trials.len() >= 4 && made.field.known_cells() > 0);
        fields.push((made.field, made.trials));
    }
    assert!(fields.windows(2).all(|pair| pair[0].0 == pair[1].0));
    // Another seed, other points: the comparison can fail.
    let mut renderer = renderer(&scene, "--size 64x64 --cache 100%");
    assert_ne!(made(&mut renderer, &DvfSettings { seed: 1, ..asked }, 16).field.masks, fields[0].0.masks);
    // Points are as many as asked, or one a triangle; each brick was read twice.
    let all = made(&mut renderer, &DvfSettings { rays: 1, cells: Cells::Longest(3), ..asked }, 1);
    let triangles = renderer.scene.resident().manifest.triangles_instanced;
    assert!(all.points >= all.triangles && all.triangles >= triangles, "{} of {triangles}", all.triangles);
    let rounded = made(&mut renderer, &DvfSettings { rays: 1, round: true, cells: Cells::Longest(3), ..asked }, 1);
    assert!(rounded.points.abs_diff(3000) < 1500, "{}", rounded.points);
}

#[test]
fn fields_are_kept_beside_their_scene() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "512");
    let field = scene.with_extension("dvf");
    let even = folder.path().join("even.hdr");
    std::fs::write(&even, b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n\x80\x80\x80\x81\x80\x80\x80\x81")
        .expect("an image");
    let walk = |name: &str, options: &str| {
        let output = folder.path().join(name);
        let words = format!(
            "walk {} -o {} --frames 1 --size 48x32 --tile 16 --adapter cpu --aov --effects environment --environment \
             {} --secondary dvf --dvf-points 2000 --dvf-rays 8 {options}",
            scene.display(),
            output.display(),
            even.display()
        );
        let done = common::brickwalk(words.split_whitespace());
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let summary: Value =
            serde_json::from_slice(&std::fs::read(output.join("summary.json")).expect("a summary")).expect("JSON");
        let is_made = !summary["settings"]["dvf"]["made"].is_null();
        (common::frames(&output), is_made, String::from_utf8_lossy(&done.stderr).into_owned())
    };
    let (frames, is_made, said) = walk("first", "");
    assert!(is_made && said.is_empty(), "{said}");
    let bytes = std::fs::read(&field).expect("the field's file");
    let (again, is_made, said) = walk("second", "");
    assert!(!is_made && said.is_empty(), "{said}");
    assert_eq!(frames, again);
    // Other options, then these again: each time it is made, and the same.
    let (_, is_made, said) = walk("third", "--dvf-octahedral 8");
    assert!(is_made && said.contains("made with other options"), "{said}");
    let (again, is_made, _) = walk("fourth", "--dvf-lanes 3 --dvf-trust label");
    assert!(is_made);
    assert_eq!(frames, again);
    assert_eq!(std::fs::read(&field).expect("the field's file"), bytes);
    for (damaged, message) in [
        (bytes[..bytes.len() / 2].to_vec(), "is damaged"),
        (bytes.iter().enumerate().map(|(i, b)| if i == bytes.len() / 2 { b ^ 4 } else { *b }).collect(), "is damaged"),
        (b"something else".to_vec(), "is no field"),
    ] {
        std::fs::write(&field, damaged).expect("a damaged file");
        let (again, is_made, said) = walk("fifth", "");
        assert!(is_made && said.contains(message), "{said}");
        assert_eq!(frames, again);
        assert_eq!(std::fs::read(&field).expect("the field's file"), bytes);
    }
    // In a folder that cannot be written to (here a file has its name), the walk goes on.
    let (_, is_made, said) = walk("sixth", &format!("--dvf-file {}", even.join("at/all.dvf").display()));
    assert!(is_made && said.contains("is not kept"), "{said}");
}

#[test]
fn the_field_of_a_view_out_of_core_is_that_in_core() {
    let folder = folder();
    let scene = city(folder.path(), "100K", "512");
    let path = CameraPath::read(&scene.with_extension("near.json")).expect("a path");
    let camera = path.frame(0, 1);
    let mut fields = Vec::new();
    for cache in ["100%", "15%"] {
        let mut renderer = renderer(&scene, &format!("--size 128x96 --cache {cache}"));
        let region = renderer.visible_region(&[camera]).expect("a region");
        let bricks = region.bricks.as_ref().map_or(0, |bricks| bricks.len());
        assert!(bricks > 3 && bricks < renderer.scene.resident().bricks.len(), "{bricks} bricks are seen");
        let asked = DvfSettings { rays: 32, ..settings(5000, 24) };
        let made = renderer.make_dvf(&asked, &region, DvfTracing::over(32), &mut |_, _| true).expect("a field");
        renderer.methods.set(Dvf::new(Arc::new(made.field.clone()), LABEL));
        let frame = renderer.frame(0, &camera).expect("a frame");
        println!(
            "{cache}: {} bricks loaded, {} needed, {} read",
            made.record.bricks_loaded,
            made.record.bricks_needed.count(),
            made.bricks_read
        );
        fields.push((made.field, frame.pixels));
    }
    assert_eq!(fields[0], fields[1]);
}

/// In many small blocks: rays of all of them wait for bricks together.
#[test]
fn bricks_are_loaded_once_for_all_rays_that_wait() {
    let folder = folder();
    let scene = city(folder.path(), "100K", "512");
    let path = CameraPath::read(&scene.with_extension("near.json")).expect("a path");
    let camera = path.frame(0, 1);
    let asked = DvfSettings { rays: 24, cells: Cells::Auto, ..settings(3000, 0) };
    let tracing = |pool| DvfTracing { pool, ..DvfTracing::over(24) };
    let open = |options: &str| renderer(&scene, &format!("--size 64x48 {options}"));
    let make = |options: &str, pool: u64| {
        let mut renderer = open(options);
        let region = renderer.visible_region(&[camera]).expect("a region");
        let mut told = Vec::new();
        let mut watch = |rays, _| {
            told.push(rays);
            true
        };
        let made = renderer.make_dvf(&asked, &region, tracing(pool), &mut watch).expect("a field");
        // No ray is told of twice, and in the end all of them.
        assert!(told.is_sorted() && told.last().is_some_and(|&last| last >= made.record.rays()), "{told:?}");
        (made, told.len())
    };
    let (in_core, blocks) = make("--cache 100% --schedule plain --measure-needed", 1);
    let needed = in_core.record.bricks_needed.count();
    assert!(blocks > 100 && in_core.drains == 0, "{blocks} blocks, {} drains", in_core.drains);
    let mut loads = Vec::new();
    for pool in [512_000_000, 100_000, 1] {
        let (made, _) = make("--cache 15%", pool);
        let read = in_core.bricks_read;
        assert_eq!((&made.field, &made.trials, made.bricks_read), (&in_core.field, &in_core.trials, read), "{pool}");
        loads.push((made.record.bricks_loaded, made.drains));
    }
    println!("{blocks} blocks, {needed} bricks needed; loaded, drains: {loads:?}");
    let [(all, 1), (some, some_drains), (none, none_drains)] = loads[..] else { panic!("{loads:?}") };
    assert!(all <= 2 * needed && all < some, "{all} bricks loaded, {needed} needed");
    // Control: with room for a block alone they are loaded again and again.
    assert!(none > 4 * needed && none > some && none_drains > some_drains && some_drains > 1, "{loads:?}");
    // Stopped half way, and then made after all.
    let mut renderer = open("--cache 15%");
    let region = renderer.visible_region(&[camera]).expect("a region");
    let mut most = 0;
    let mut watch = |rays, _| {
        most = rays;
        rays < in_core.record.rays() / 2
    };
    let stopped = renderer.make_dvf(&asked, &region, tracing(1 << 29), &mut watch);
    assert!(matches!(stopped, Err(RenderError::Interrupted)));
    assert!(most < in_core.record.rays(), "{most} rays");
    let made = renderer.make_dvf(&asked, &region, tracing(1 << 29), &mut |_, _| true).expect("a field");
    assert_eq!(made.field, in_core.field);
}

#[test]
fn sponza_is_seen_by_its_field() {
    let Some(scenes) = common::shared_scenes() else { return };
    let folder = folder();
    let scene = folder.path().join("sponza.bricks");
    let input = scenes.join("sponza/Sponza.gltf");
    common::succeed(["convert".as_ref(), input.as_os_str(), "-o".as_ref(), scene.as_os_str()]);
    let mut renderer = renderer(&scene, "--size 64x36 --cache 100% --spp 8");
    let path = CameraPath::read(Path::new("paths/sponza_1.json")).expect("a path");
    let camera = path.frame(0, 1);
    let field = made(&mut renderer, &DvfSettings { rays: 32, ..settings(80_000, 24) }, 32).field;
    let (differ, of, [traced, answered]) = compared(&mut renderer, Some((&field, LABEL)), &camera);
    println!("{differ} of {} pixels differ; {traced} of {of} rays were traced", 64 * 36);
    assert_eq!(traced + answered, of);
    assert!(answered >= traced, "{answered} answered, {traced} traced");
    assert!(differ <= 64 * 36 / 10, "{differ} pixels differ");
    let (differ, ..) = compared(&mut renderer, Some((&flipped(&field), LABEL)), &camera);
    assert!(differ > 64 * 36 / 10, "{differ} pixels differ by a field that is wrong");
}

/// A box that moves past others under the open sky: rays to where it was and is are traced.
#[test]
fn what_moves_is_traced_and_nothing_flickers() {
    let folder = folder();
    let scene = folder.path().join("cornell.bricks");
    let settings_of_scene = Settings { kind: Kind::Cornell, triangles: 10_000, seed: 3, ..Settings::default() };
    let mut source = generate(&settings_of_scene, &Progress::hidden()).expect("a count in range").whole();
    source.placements.retain(|placement| placement.name.ends_with("box"));
    let build_settings =
        BuildSettings { brick_triangles: 400, movable: vec!["orb*".into()], ..BuildSettings::default() };
    build(source, &build_settings, &scene, &Progress::hidden()).expect("a scene");
    let mut all = [(); 3].map(|()| renderer(&scene, "--size 96x72 --cache 100% --spp 4"));
    let still = all[0].scene.clone();
    let field = Arc::new(made(&mut all[1], &DvfSettings { rays: 512, ..settings(50_000, 16) }, 64).field);
    let stills: Vec<_> = all.iter().map(|renderer| renderer.scene.clone()).collect();
    all[1].methods.set(Dvf::new(field.clone(), LABEL));
    let camera = Camera {
        position: DVec3::new(-0.2, 1.7, 2.9),
        target: DVec3::new(-0.2, 1.9, -1.0),
        up: DVec3::Y,
        fov_y: 70f64.to_radians(),
    };
    let differ = |a: &FrameOutput, b: &FrameOutput| {
        a.pixels.radiance.iter().zip(&b.pixels.radiance).filter(|(a, b)| a != b).count()
    };
    // What masks miss where nothing moves.
    let mut unmoved = 0;
    for step in 0..4 {
        let [exact, field] = [0, 1].map(|i| all[i].frame(step, &camera).expect("a frame"));
        unmoved += differ(&exact, &field);
    }
    let (mut wrong, mut missed, mut answered) = (0, 0, 0);
    for step in 0..4 {
        let mut matrix = still.resident().instances[1].world_from_object;
        // Before both others.
        matrix[3] -= 1.1 + 0.15 * f64::from(step);
        matrix[11] += 0.5 + 0.1 * f64::from(step);
        for (renderer, still) in all.iter_mut().zip(&stills) {
            renderer.place(still, &[(1, matrix)]).expect("a place");
        }
        // Control: one that is not told that anything has moved.
        all[2].methods.set(Dvf::new(field.clone(), LABEL));
        let [exact, told, untold] = all.each_mut().map(|renderer| renderer.frame(step, &camera).expect("a frame"));
        wrong += differ(&exact, &told);
        missed += differ(&exact, &untold);
        answered += rays(&told)[1];
        assert!(rays(&told)[0] < rays(&exact)[0] * 4 / 5, "{:?} of {:?}", rays(&told), rays(&exact));
    }
    println!(
        "pixels of {}: {wrong} differ, {unmoved} where nothing moves, {missed} of a field that is not told; \
         {answered} rays answered",
        4 * 96 * 72
    );
    assert!(wrong <= unmoved + 10 && missed > 3 * wrong.max(10), "{wrong} {unmoved} {missed}");
}
