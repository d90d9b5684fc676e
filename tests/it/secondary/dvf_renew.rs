//! Cells of fields of visibility that are made anew for what moves: the bits of a field made from scratch, pictures,
//! rays, the budget.

use crate::common::{self, folder};
use bricks::SceneFile;
use brickwalk::frame::{FrameOutput, Renderer};
use brickwalk::scene::Camera;
use brickwalk::secondary::dvf::Renewal;
use brickwalk::secondary::dvf::mask::UNKNOWN;
use brickwalk::secondary::dvf::{Cells, DvfField, DvfSettings, DvfUse};
use brickwalk::secondary::dvf::{Dvf, DvfTracing, Region};
use brickwalk_convert::build::{BuildSettings, build};
use brickwalk_convert::progress::Progress;
use brickwalk_scenes::{Kind, Settings, generate};
use glam::DVec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Three boxes under the sky, one of which moves, and what they stand on.
fn boxes(folder: &Path) -> PathBuf {
    let scene = folder.join("boxes.bricks");
    let settings = Settings { kind: Kind::Cornell, triangles: 10_000, seed: 3, ..Settings::default() };
    let mut source = generate(&settings, &Progress::hidden()).expect("a count in range").whole();
    source.placements.retain(|placement| placement.name.ends_with("box") || placement.name.contains("floor"));
    let settings = BuildSettings { brick_triangles: 100, movable: vec!["orb*".into()], ..BuildSettings::default() };
    build(source, &settings, &scene, &Progress::hidden()).expect("a scene");
    scene
}

/// A renderer of it in an environment that is 1 everywhere.
fn renderer(scene: &Path, options: &str) -> Renderer {
    common::evenly_lit(scene, "environment", options)
}

fn camera() -> Camera {
    Camera {
        position: DVec3::new(-0.2, 1.7, 2.9),
        target: DVec3::new(-0.2, 1.3, -1.0),
        up: DVec3::Y,
        fov_y: 70f64.to_radians(),
    }
}

/// What is placed at a step: instance 1, before the others.
fn matrix(still: &SceneFile, step: u32) -> [f64; 12] {
    let mut matrix = still.resident().instances[1].world_from_object;
    matrix[3] -= 1.1 + 0.15 * f64::from(step);
    matrix[11] += 0.5 + 0.1 * f64::from(step);
    matrix
}

/// A field of the scene as it was opened, that is to be renewed by so many rays a frame.
fn renewal(renderer: &mut Renderer, settings: &DvfSettings, rays: u64) -> Renewal {
    let region = Region::scene(renderer.scene.resident());
    let tracing = DvfTracing::over(settings.rays);
    let made = renderer.make_dvf(settings, &region, tracing, &mut |_, _| true).expect("a field");
    assert_eq!(made.kept.finished(settings.dilate), made.field);
    Renewal { kept: Arc::new(made.kept), settings: *settings, region, tracing, rays, frames: 1 }
}

fn dvf(renewal: &Renewal) -> Dvf {
    let field = renewal.kept.finished(renewal.settings.dilate);
    Dvf::new(Arc::new(field), DvfUse::default()).renewed_by(renewal.clone())
}

/// Masks and label of a cell.
fn bits(field: &DvfField, cell: u32) -> (&[u32], u32) {
    let words = field.shape.words();
    (&field.masks[cell as usize * words..][..words], field.labels[cell as usize])
}

fn record<'a>(output: &'a FrameOutput, pass: &str) -> Option<&'a brickwalk::counters::Record> {
    output.records.iter().find(|record| record.pass == pass)
}

#[test]
fn renewed_cells_are_those_of_a_field_made_from_scratch() {
    let folder = folder();
    let scene = boxes(folder.path());
    let asked =
        DvfSettings { points: 8_000, rays: 32, cells: Cells::Longest(14), octahedral: 16, ..DvfSettings::default() };
    for settings in [
        asked,
        DvfSettings { hammersley: false, both: true, round: true, ..asked },
        DvfSettings { dilate: false, octahedral: 32, cells: Cells::Auto, ..asked },
    ] {
        let mut fields = Vec::new();
        for options in ["--cache 100%", "--cache 15% --schedule chc", "--cache 40% --schedule demand"] {
            let mut renderer = renderer(&scene, &format!("--size 64x48 {options}"));
            let still = renderer.scene.clone();
            let mut renewal = renewal(&mut renderer, &settings, 1 << 40);
            // All that is seen, whatever it saves.
            renewal.frames = u32::MAX;
            if options.contains("15%") {
                (renewal.tracing.lanes, renewal.tracing.pool) = (3, 1);
            }
            renderer.methods.set(dvf(&renewal));
            renderer.place(&still, &[(1, matrix(&still, 1))]).expect("a place");
            let output = renderer.frame(0, &camera()).expect("a frame");
            let own = record(&output, "dvf").expect("a record");
            let renewed: Vec<u32> = renderer.methods.get::<Dvf>().expect("a field").renewed_cells().collect();
            assert_eq!((own.cells_renewed, own.cells_left), (renewed.len() as u64, 0));
            let field = renderer.methods.get::<Dvf>().expect("a field").moved_field().expect("a field").clone();
            fields.push((field, renewed, own.rays()));
            if fields.len() > 1 {
                assert!(fields[0] == fields[fields.len() - 1], "{options}: another field");
                continue;
            }
            let (field, renewed, rays) = &fields[0];
            let before = renewal.kept.finished(settings.dilate);
            let marked = renderer.scene.clone();
            let at = |scene: &SceneFile| scene.resident().instances[1].world_from_object;
            assert_ne!(at(&still), at(&marked));
            renderer.methods.remove::<Dvf>();
            let scratch = renderer.remake_dvf(&renewal, &still).expect("a field");
            let differ = |field: &DvfField| -> usize {
                renewed.iter().filter(|&&cell| bits(field, cell) != bits(&scratch, cell)).count()
            };
            // Controls: the field as it was, and cells that are not renewed where the mover is.
            let (still_differs, ours) = (differ(&before), differ(field));
            let others = (0..field.labels.len() as u32).filter(|cell| !renewed.contains(cell));
            let unknown = others.filter(|&cell| bits(field, cell) != bits(&scratch, cell)).count();
            let news =
                renewed.iter().filter(|&&cell| bits(&before, cell).1 == UNKNOWN && bits(field, cell).1 != UNKNOWN);
            println!(
                "{} cells renewed by {rays} rays: {ours} differ from scratch, {still_differs} of the field as it was, \
                 {unknown} others; {} were unknown",
                renewed.len(),
                news.clone().count()
            );
            assert_eq!(ours, 0);
            // Cells that a trial chooses are wide.
            let least = if settings.cells == Cells::Auto { 10 } else { 20 };
            assert!(renewed.len() > least && still_differs >= least && unknown > 0);
            assert!(news.count() > 0 || settings != asked, "the mover came to no cell");
        }
    }
}

#[test]
fn fewer_rays_are_left_and_no_more_are_spent_than_there_are() {
    let folder = folder();
    let scene = boxes(folder.path());
    let settings =
        DvfSettings { points: 8_000, rays: 64, cells: Cells::Longest(14), octahedral: 16, ..DvfSettings::default() };
    // By a field that is told; one that may be renewed by no ray; by some.
    let mut all = [(); 3].map(|()| renderer(&scene, "--size 96x72 --cache 100% --spp 640"));
    let budget = 60_000;
    let renewal = renewal(&mut all[0], &settings, budget);
    all[0].methods.set(Dvf::new(Arc::new(renewal.kept.finished(true)), DvfUse::default()));
    all[1].methods.set(dvf(&Renewal { rays: 0, ..renewal.clone() }));
    all[2].methods.set(dvf(&renewal));
    let stills: Vec<_> = all.iter().map(|renderer| renderer.scene.clone()).collect();
    let (mut left, mut spent) = ([0; 2], 0);
    for step in 0..2 {
        for (renderer, still) in all.iter_mut().zip(&stills) {
            renderer.place(still, &[(1, matrix(still, step))]).expect("a place");
        }
        let [told, nothing, renewed] = all.each_mut().map(|r| r.frame(step, &camera()).expect("a frame"));
        assert!(told.pixels == nothing.pixels && record(&nothing, "dvf").is_none());
        let rays = |output: &FrameOutput| record(output, "environment").map_or(0, |record| record.rays_traced);
        assert_eq!(rays(&told), rays(&nothing));
        let own = record(&renewed, "dvf").expect("a record");
        assert!(own.rays() <= budget && own.cells_renewed > 0 && own.cells_left > 0, "{own:?}");
        (left[0], left[1], spent) = (left[0] + rays(&told), left[1] + rays(&renewed), spent + own.rays());
    }
    println!("{left:?} rays are left, {spent} spent");
    // What is renewed pays within its frame.
    assert!(left[1] + spent < left[0], "{left:?} {spent}");
    // At rest, frame by frame more is renewed; where what it takes does not matter, until nothing is left.
    let mut resting = renderer(&scene, "--size 96x72 --cache 100% --spp 160");
    // For what does not depend on how many rays a frame has.
    let mut with_few_rays = renderer(&scene, "--size 48x36 --cache 100% --spp 1");
    let still = resting.scene.clone();
    let rest = |resting: &mut Renderer, step: u32, horizon: u32| {
        resting.methods.set(dvf(&Renewal { frames: horizon, ..renewal.clone() }));
        resting.place(&still, &[(1, matrix(&still, step))]).expect("a place");
        let mut left = Vec::new();
        for frame in 0..30 {
            let output = resting.frame(frame, &camera()).expect("a frame");
            let own = record(&output, "dvf").expect("a record");
            assert!(own.rays() <= budget && left.last().is_none_or(|before| own.cells_left <= *before), "{own:?}");
            left.push(own.cells_left);
            if own.cells_left == 0 {
                break;
            }
        }
        println!("cells left at rest, frame by frame: {left:?}");
        (left[0], left[left.len() - 1])
    };
    let (first, last) = rest(&mut resting, 2, 1);
    assert!(last > 0 && 2 * last < first, "{last} of {first}");
    assert_eq!(rest(&mut with_few_rays, 3, u32::MAX).1, 0);
    // Of few rays all are spent but for less than a cell takes.
    let resting = &mut with_few_rays;
    resting.methods.set(dvf(&Renewal { rays: 3000, frames: u32::MAX, ..renewal.clone() }));
    resting.place(&still, &[(1, matrix(&still, 2))]).expect("a place");
    for frame in 0..3 {
        let output = resting.frame(frame, &camera()).expect("a frame");
        let own = record(&output, "dvf").expect("a record");
        assert!((1000..=3000).contains(&own.rays()) && own.cells_renewed > 0 && own.cells_left > 0, "{own:?}");
    }
    // Back where it was it is the field that was made.
    let own = still.resident().instances[1].world_from_object;
    resting.place(&still, &[(1, own)]).expect("a place");
    assert!(resting.methods.get::<Dvf>().expect("a field").moved_field().is_none());
    assert!(record(&resting.frame(0, &camera()).expect("a frame"), "dvf").is_none());
}

/// With masks of many rays little is missed, whoever made them.
#[test]
fn pictures_are_those_of_exact_rays() {
    let folder = folder();
    let scene = boxes(folder.path());
    let settings =
        DvfSettings { points: 30_000, rays: 128, cells: Cells::Longest(10), octahedral: 16, ..DvfSettings::default() };
    let mut all = [(); 3].map(|()| renderer(&scene, "--size 96x72 --cache 100% --spp 4"));
    let mut renewal = renewal(&mut all[1], &settings, 1 << 40);
    renewal.frames = u32::MAX;
    all[1].methods.set(dvf(&Renewal { rays: 0, ..renewal.clone() }));
    all[2].methods.set(dvf(&renewal));
    for renderer in &mut all {
        let still = renderer.scene.clone();
        renderer.place(&still, &[(1, matrix(&still, 2))]).expect("a place");
    }
    let [exact, told, renewed] = all.each_mut().map(|r| r.frame(0, &camera()).expect("a frame"));
    // Control: the field of the scene as it was, which is not told.
    all[1].methods.set(Dvf::new(Arc::new(renewal.kept.finished(true)), DvfUse::default()));
    let untold = all[1].frame(0, &camera()).expect("a frame");
    let differ = |a: &FrameOutput| a.pixels.radiance.iter().zip(&exact.pixels.radiance).filter(|(a, b)| a != b).count();
    let answered = [&told, &renewed].map(|output| record(output, "environment").map_or(0, |own| own.rays_answered));
    let wrong = [&told, &renewed, &untold].map(differ);
    println!("of {} pixels {wrong:?} differ: told, renewed, not told; {answered:?} rays answered", 96 * 72);
    // As many more as rays are answered more, and a pixel of a thousand.
    let more = answered[1] as f64 / answered[0] as f64;
    assert!(more > 1.05 && wrong[1] as f64 <= more * wrong[0] as f64 + 7.0 && wrong[2] > 3 * wrong[1], "{wrong:?}");
}
