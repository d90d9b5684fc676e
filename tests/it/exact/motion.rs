//! Instances that move in walks: every frame has the bits of a still walk of a scene that was converted with the
//! instance where it is, whatever the schedule and cache, on both executors; a scene whose trees are not fitted to its
//! instances does not.

use crate::common;
use bricks::layout::{DirectoryEntry, Header, PAGE_BYTES, Section};
use bricks::{Instance, SceneFile};
use brickwalk::frame::{Moved, Pixels, Renderer};
use brickwalk::picture::denoise::Resolve;
use brickwalk::scene::motion::Motion;
use brickwalk::scene::{Camera, CameraPath};
use brickwalk::session::lighting::lighting;
use brickwalk::session::motion::SceneMotion;
use brickwalk::session::opened::{Opened, open_scene};
use brickwalk::session::renderer::lit_renderer;
use brickwalk_convert::build::{BuildSettings, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::SourceScene;
use brickwalk_scenes::{Kind, Settings, generate};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use xxhash_rust::xxh3::xxh3_64;

/// Frames of every walk, and their times.
const TIMES: [f64; 3] = [0.0, 1.5, 3.0];

/// The box turns above the others, then comes out of the room, which the scene's bounds follow.
pub(super) const MOTION: &str = r#"{"instances": [{"node": "orbiting box", "keyframes": [
    {"time": 0, "translation": [-0.4, -0.3, 0.2], "rotation": [0.2, 0.5, 0.1, 0.9]},
    {"time": 2, "translation": [-1.2, -1.0, 1.1], "rotation": [0.5, 0.5, -0.1, 0.3], "scale": 1.25},
    {"time": 3, "translation": [-1.4, -1.2, 1.9]}]}]}"#;

const ALL: &str = "--effects shadow,ao,diffuse,glossy --ao-rays 1 --diffuse-rays 1 --sun 0.3,0.4,1 --aov";

/// A Cornell box, its mover where `matrix` says, shining or not.
pub(super) fn source(matrix: Option<[f64; 12]>, shines: bool) -> SourceScene {
    let settings = Settings { kind: Kind::Cornell, triangles: 10_000, seed: 3, ..Settings::default() };
    let mut source = generate(&settings, &Progress::hidden()).expect("a count in range").whole();
    let mover = source.placements.iter_mut().find(|one| one.name == "orbiting box").expect("a mover");
    mover.world_from_mesh = matrix.unwrap_or(mover.world_from_mesh);
    if shines {
        // The last material is the boxes'.
        source.materials[2].emission = [2.0, 1.0, 3.0];
    }
    common::polished(source)
}

pub(super) fn convert(folder: &Path, name: &str, source: SourceScene) -> PathBuf {
    let path = folder.join(name);
    let settings = BuildSettings { brick_triangles: 400, movable: vec!["orb*".into()], ..BuildSettings::default() };
    build(source, &settings, &path, &Progress::hidden()).expect("a scene");
    path
}

/// The scene as it lies, with its motion, and scenes converted with the mover where it is in each frame.
struct Scenes {
    still: PathBuf,
    moved: Vec<PathBuf>,
    motion: PathBuf,
}

fn scenes(folder: &Path, shines: bool) -> Scenes {
    let still = convert(folder, "still.bricks", source(None, shines));
    let motion = folder.join("motion.json");
    std::fs::write(&motion, MOTION).expect("a file");
    let movers = Motion::read(&motion).and_then(|motion| {
        let scene = SceneFile::open(&still).expect("the scene");
        motion.bind(scene.resident())
    });
    let movers = movers.expect("a motion of the scene");
    let moved = TIMES.iter().enumerate().map(|(k, &time)| {
        let [(1, matrix)] = movers.at(time)[..] else { panic!("one instance") };
        convert(folder, &format!("moved{k}.bricks"), source(Some(matrix), shines))
    });
    Scenes { moved: moved.collect(), still, motion }
}

fn camera(frame: usize) -> Camera {
    let path = r#"{"fov_y_degrees": 70, "keyframes": [{"time": 0, "position": [-0.4, 1.6, 3.0], "target": [0, 2, -1]},
        {"time": 3, "position": [0.5, 1.9, 2.8], "target": [-0.2, 1.8, -1]}]}"#;
    CameraPath::parse(path, Path::new("p.json")).expect("a path").at(TIMES[frame])
}

/// A renderer of a scene, and its motion, if it has one.
fn renderer(scene: &Path, motion: Option<&Path>, options: &str) -> (Renderer, Option<SceneMotion>) {
    let settings = common::settings(&format!("--size 96x64 --frames 3 {options}"));
    let file = open_scene(scene).expect("the scene");
    let lighting = lighting(&settings, &file, scene).expect("lamps");
    let motion = motion.map(|motion| SceneMotion::open(motion, &file, &lighting.sources).expect("a motion"));
    let opened = Opened::open(file, scene, &settings).expect("a session");
    (lit_renderer(opened, &settings, lighting.light), motion)
}

/// The frames of a walk with motion.
fn walked(scenes: &Scenes, options: &str) -> Vec<Pixels> {
    let (mut renderer, motion) = renderer(&scenes.still, Some(&scenes.motion), options);
    let motion = motion.expect("it was asked for");
    let frame = |(k, &time): (usize, &f64)| {
        assert!(motion.place(&mut renderer, time).expect("a place"), "it moves in every frame");
        assert!(!motion.place(&mut renderer, time).expect("a place"), "and is there");
        renderer.frame(k as u32, &camera(k)).expect("a frame").pixels
    };
    TIMES.iter().enumerate().map(frame).collect()
}

/// The same frames, each of a scene of its own that does not move.
fn still(scenes: &Scenes, options: &str) -> Vec<Pixels> {
    let frame = |(k, scene): (usize, &PathBuf)| {
        renderer(scene, None, options).0.frame(k as u32, &camera(k)).expect("a frame").pixels
    };
    scenes.moved.iter().enumerate().map(frame).collect()
}

/// How many pixels of `pixels` show the mover.
fn shown(scene: &Path, pixels: &Pixels) -> usize {
    let file = SceneFile::open(scene).expect("the scene");
    let base = file.resident().instances[1].base;
    pixels.id.iter().filter(|&&id| id != u32::MAX && id >= base).count()
}

#[test]
fn every_schedule_renders_what_a_scene_converted_there_shows() {
    let folder = common::folder();
    let scenes = scenes(folder.path(), false);
    let truth = still(&scenes, &format!("{ALL} --adapter cpu --schedule plain --cache 100%"));
    for (k, pixels) in truth.iter().enumerate() {
        let count = shown(&scenes.moved[k], pixels);
        assert!(count > 40, "frame {k} shows the mover in {count} pixels");
    }
    for options in [
        "--schedule plain --cache 100%",
        "--schedule plain-bvh2 --cache 100%",
        "--schedule chc --cache 100%",
        "--schedule chc --cache 25% --tile 16",
        "--schedule chc --cache 100% --fronts on --tile 16",
        "--schedule chc --cache 25% --fronts on --tile 16 --host-cache 0",
        "--schedule demand --cache 25% --evict lru",
        "--schedule auto --cache 100%",
    ] {
        let found = walked(&scenes, &format!("{ALL} --adapter cpu {options}"));
        assert!(found == truth, "{options}: frames differ from those of scenes converted there");
    }
    // The control: where the mover is at another time.
    assert!(truth[0].id != truth[1].id && truth[1].id != truth[2].id);
}

#[test]
fn graphics_devices_render_it_too() {
    let Some(found) = common::software() else { return };
    // A part of the name without spaces.
    let name = found.split_whitespace().next().expect("a word").to_owned();
    let folder = common::folder();
    let scenes = scenes(folder.path(), false);
    let options = format!("--effects shadow,ao --ao-rays 1 --aov --adapter {name}");
    let truth = still(&scenes, &format!("{options} --schedule plain --cache 100%"));
    for more in ["--schedule plain --cache 100%", "--schedule chc --cache 25% --fronts on --tile 16"] {
        assert!(walked(&scenes, &format!("{options} {more}")) == truth, "{more}");
    }
}

#[test]
fn lamps_and_maps_move_along() {
    let folder = common::folder();
    let scenes = scenes(folder.path(), true);
    let base = format!("{ALL} --adapter cpu --schedule chc --cache 50%");
    for options in [
        "",
        "--secondary ao=roma,diffuse=roma,shadow=roma --roma-size 64",
        "--secondary ao=df,shadow=df --df-size 64",
        "--secondary ao=sift,shadow=sift --auto-error off --roma-size 64",
    ] {
        let options = format!("{base} {options}");
        let (found, truth) = (walked(&scenes, &options), still(&scenes, &options));
        for (k, (found, truth)) in found.iter().zip(&truth).enumerate() {
            let differing = found.radiance.iter().zip(&truth.radiance).filter(|(a, b)| a != b).count();
            assert!(found == truth, "{options}: frame {k}: {differing} pixels differ");
        }
    }
}

/// The bytes of a scene file with its first instance moved and all else, trees and bounds, as it was.
fn without_refit(scene: &Path, matrix: [f64; 12]) -> Vec<u8> {
    let mut bytes = std::fs::read(scene).expect("the scene");
    let mut page = *bytes.first_chunk::<{ PAGE_BYTES as usize }>().expect("a page");
    let (header, _) = Header::read(&page);
    let directory = header.directory_offset as usize;
    let at = directory + Section::Instances.index() * size_of::<DirectoryEntry>();
    let mut entry: DirectoryEntry = bytemuck::pod_read_unaligned(&bytes[at..at + size_of::<DirectoryEntry>()]);
    let start = entry.offset as usize;
    let first = start + size_of::<Instance>();
    let mut instance: Instance = bytemuck::pod_read_unaligned(&bytes[first..first + size_of::<Instance>()]);
    instance.world_from_object = matrix;
    bytes[first..first + size_of::<Instance>()].copy_from_slice(bytemuck::bytes_of(&instance));
    entry.checksum = xxh3_64(&bytes[start..start + entry.bytes as usize]);
    bytes[at..at + size_of::<DirectoryEntry>()].copy_from_slice(bytemuck::bytes_of(&entry));
    let sum = xxh3_64(&bytes[directory..directory + header.directory_bytes as usize]);
    page = Header { directory_checksum: sum, ..header }.page();
    bytes[..page.len()].copy_from_slice(&page);
    bytes
}

#[test]
fn an_instance_whose_trees_are_not_fitted_is_not_found() {
    let folder = common::folder();
    let scenes = scenes(folder.path(), false);
    let file = Arc::new(SceneFile::open(&scenes.still).expect("the scene"));
    let matrix =
        Motion::read(&scenes.motion).expect("a motion").bind(file.resident()).expect("a mover").at(TIMES[2])[0].1;
    for options in ["--schedule plain --cache 100%", "--schedule chc --cache 100%", "--schedule demand --cache 100%"] {
        let options = format!("--effects primary --aov --adapter cpu {options}");
        let truth = still(&scenes, &options).swap_remove(2);
        let bytes = without_refit(&scenes.still, matrix);
        let stale = Arc::new(SceneFile::from_bytes("stale", bytes).expect("a sound file"));
        let (mut renderer, _) = renderer(&scenes.still, None, &options);
        renderer.executor.set_scene(&stale);
        let found = renderer.frame(2, &camera(2)).expect("a frame").pixels;
        assert!(found.id != truth.id, "{options}: found without its boxes");
        // And the same with them.
        let mut fitted = file.duplicate();
        fitted.place(&[(1, matrix)]).expect("a place");
        let fitted = Arc::new(fitted);
        renderer.executor.set_scene(&fitted);
        renderer.scene = fitted;
        assert!(renderer.frame(2, &camera(2)).expect("a frame").pixels == truth, "{options}");
    }
}

#[test]
fn histories_go_with_what_moves() {
    let folder = common::folder();
    let scenes = scenes(folder.path(), false);
    // A camera that rests; without what has moved, surfaces are looked for where they are.
    let disoccluded = |knows: bool| {
        let options = "--effects shadow,ao --ao-rays 1 --denoise --adapter cpu --schedule plain --cache 100%";
        let (mut renderer, motion) = renderer(&scenes.still, Some(&scenes.motion), options);
        let motion = motion.expect("it was asked for");
        let mut resolve = Resolve::new(true, true);
        // In the first frame nothing has a history.
        let mut first = 0;
        for k in 0..8u32 {
            motion.place(&mut renderer, 0.1 * f64::from(k)).expect("a place");
            let mut output = renderer.frame(k, &camera(0)).expect("a frame");
            if let Some(guides) = output.guides.as_mut().filter(|_| !knows) {
                guides.moved = Moved::default();
            }
            resolve.frame(&mut output);
            if k == 0 {
                first = resolve.report().expect("it is on").disoccluded;
            }
            assert_eq!(output.pixels.not_finite(), 0);
        }
        let all = resolve.report().expect("it is on").disoccluded;
        all - first
    };
    let (knowing, not) = (disoccluded(true), disoccluded(false));
    println!("pixels without a history: {knowing}, not knowing of the motion {not}");
    assert!(knowing < not, "{knowing} {not}");
}

#[test]
fn the_command_walks_with_motion_and_names_what_cannot_move() {
    let folder = common::folder();
    let at = |name: &str| folder.path().join(name);
    let text = |path: &Path| path.display().to_string();
    let scene = at("box.bricks");
    let said = common::succeed(["scene", "cornell", "--triangles", "10K", "-o", &text(&scene)]);
    assert!(said.contains("box.motion.json: motion"), "{said}");
    let instances = common::succeed(["info", &text(&scene), "--instances"]);
    assert!(instances.contains("instance 1: node orbiting box"), "{instances}");
    let listed: Value =
        serde_json::from_str(&common::succeed(["info", &text(&scene), "--instances", "--json"])).expect("JSON");
    assert_eq!((&listed[0]["instance"], &listed[0]["node"]), (&1.into(), &"orbiting box".into()));
    let options = format!(
        "--frames 3 --size 64x48 --adapter cpu --cache 100% --aov --path {} --motion {}",
        text(&at("box.near.json")),
        text(&at("box.motion.json"))
    );
    common::walk(&scene, &at("out"), &options);
    let summary: Value =
        serde_json::from_str(&std::fs::read_to_string(at("out").join("summary.json")).expect("a summary"))
            .expect("JSON");
    assert_eq!(summary["scene"]["motion"], "box.motion.json");
    // Without motion the first frame is the same, for the box rests at first, and the last is another.
    common::walk(&scene, &at("rest"), &options.replace("--motion", "--requests-out"));
    let (moved, rest) = (common::frames(&at("out")), common::frames(&at("rest")));
    assert!(moved[..2] == rest[..2] && moved[5] != rest[5], "frames 0 and 2");
    for (mover, says) in [
        (r#""node": "room""#, "--movable \"room\""),
        (r#""node": "chair""#, "those that can be moved are orbiting box"),
        (r#""instance": 2"#, "info --instances"),
        (r#""instance": 0"#, "the world"),
    ] {
        std::fs::write(at("bad.json"), format!(r#"{{"instances": [{{{mover}, "keyframes": [{{"time": 0}}]}}]}}"#))
            .expect("a file");
        let words = ["walk", &text(&scene), "-o", &text(&at("bad")), "--motion", &text(&at("bad.json"))];
        let output = common::brickwalk(words);
        let line = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{line}");
        assert!(line.contains("bad.json: ") && line.contains(says) && line.lines().count() == 1, "{line}");
    }
    // What repeats the conversion keeps the box apart, too.
    common::succeed(["verify", &text(&scene)]);
    let file = SceneFile::open(&scene).expect("the scene");
    let span = file.resident().bricks.last().expect("a brick").geometry;
    drop(file);
    let whole = std::fs::read(&scene).expect("the scene");
    let mut bytes = whole.clone();
    bytes[span.offset as usize + 100] ^= 1;
    std::fs::write(&scene, &bytes).expect("a damaged file");
    common::succeed(["repair", &text(&scene)]);
    assert!(std::fs::read(&scene).expect("the scene") == whole, "repaired as it was");
}
