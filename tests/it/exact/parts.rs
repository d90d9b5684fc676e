//! Frames, and bands of them, that are rendered apart, in any order and by several processes, join to the walk of one
//! process, byte by byte; what is damaged or of another walk is rendered again.

use super::motion::{MOTION, convert, source};
use crate::common::{self, adapters, city, folder, frames, json, records};
use brickwalk::session::parts;
use brickwalk::{Session, Settings};
use serde_json::Value;
use std::path::Path;

const VIEW: &str = "--frames 5 --size 72x40 --spp 2";

fn words(scene: &Path, output: &Path, options: &str) -> Vec<String> {
    let text = format!("walk {} -o {} {options}", scene.display(), output.display());
    text.split_whitespace().map(str::to_owned).collect()
}

fn walk(scene: &Path, output: &Path, options: &str) {
    common::succeed(words(scene, output, options));
}

/// Parts of all frames but one, by three processes, the last frames first.
fn rendered_apart(scene: &Path, output: &Path, options: &str) {
    for part in ["4", "1-2", "0-1"] {
        walk(scene, output, &format!("{options} --part {part}"));
    }
    assert_eq!(common::names(&parts::folder(output)), ["0000.part", "0001.part", "0002.part", "0004.part"]);
}

#[test]
fn parts_join_to_the_walk_of_one_process() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "1000");
    let moving = convert(folder.path(), "moving.bricks", source(None, false));
    let motion = folder.path().join("motion.json");
    std::fs::write(&motion, MOTION).expect("a file");
    let view = format!("{VIEW} --path {}", scene.with_extension("near.json").display());
    // A camera that nearly rests: what it saw before counts.
    let resting = folder.path().join("resting.json");
    let path = r#"{"fov_y_degrees": 50, "keyframes": [
        {"time": 0, "position": [0, 0, 5.2], "target": [0, 0, 0]},
        {"time": 3, "position": [0.1, 0, 5.2], "target": [0, 0, 0]}]}"#;
    std::fs::write(&resting, path).expect("a file");
    let moves = format!("{VIEW} --path {} --motion {}", resting.display(), motion.display());
    let variants = [
        (&scene, format!("{view} --quality preview --cache 20%")),
        (&scene, format!("{view} --quality draft --denoise --taa")),
        (&scene, format!("{view} --quality draft --aov --secondary roma --exposure 1")),
        (&moving, format!("{moves} --quality draft --denoise --taa")),
    ];
    for name in adapters() {
        let adapter = name.split_whitespace().next().expect("a name");
        // Software Vulkan filters by kernels of its own, once.
        for (scene, options) in &variants[..if adapter == "cpu" { variants.len() } else { 1 }] {
            let options = format!("{options} --adapter {adapter}");
            let [whole, joined] = ["whole", "joined"].map(|name| folder.path().join(name));
            walk(scene, &whole, &options);
            rendered_apart(scene, &joined, &options);
            walk(scene, &joined, &format!("{options} --join"));
            let (truth, found) = (frames(&whole), frames(&joined));
            assert_eq!(truth.len(), if options.contains("--aov") { 10 } else { 5 });
            assert!(found == truth, "{options}: joined frames differ");
            assert!(!parts::folder(&joined).exists(), "parts stay");
            let rays = |output: &Path| common::sum(&records(output), "primary", "rays_traced");
            assert_eq!(rays(&joined), rays(&whole));
            let summary = json(&joined.join("summary.json"));
            assert_eq!((&summary["parts"]["joined"], &summary["frames"]), (&4.into(), &5.into()));
            let workers = summary["parts"]["workers"].as_array().expect("workers");
            assert_eq!(workers.iter().map(|worker| worker["parts"].as_u64()).sum::<Option<u64>>(), Some(4));
            assert_eq!(workers.len(), 3);
            let page = std::fs::read_to_string(joined.join("report.html")).expect("a report");
            assert!(page.contains(workers[0]["worker"].as_str().expect("a name")));
        }
    }
}

/// The control: what earlier frames have in a frame shows, and so does where a thing was that moves.
#[test]
fn a_frame_that_is_joined_without_those_before_it_is_another() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "1000");
    let options = format!("{VIEW} --quality draft --denoise --adapter cpu");
    let settings = Settings::from_options(&options).expect("settings");
    let open = || Session::open(&scene, &settings).expect("a session");
    let mut one = open();
    let whole: Vec<_> = (0..3).map(|number| one.frame_watched(number, &mut ()).expect("a frame").unwrap()).collect();
    let (mut other, output) = (open(), folder.path().join("out"));
    let key = other.key().expect("a key");
    assert_eq!(key, one.key().expect("a key"));
    std::fs::create_dir_all(parts::folder(&output)).expect("a folder");
    for number in [2, 0, 1] {
        let part = other.part(number, &mut ()).expect("a part").expect("nobody stopped it");
        assert_eq!(part.write(&output, &key).expect("a file"), parts::file(&output, number));
    }
    let mut joined = open();
    let next = |session: &mut Session, number| {
        let read = |session: &mut Session, number| session.read_part(&output, number, &key).map(Some);
        session.frame_of_parts(number, read).expect("a frame").expect("nobody stopped it")
    };
    for frame in &whole {
        let own = next(&mut joined, frame.number);
        assert!(own.pixels == frame.pixels && own.exposure_ev == frame.exposure_ev, "frame {}", frame.number);
    }
    let alone = next(&mut open(), 2);
    assert!(alone.pixels.radiance != whole[2].pixels.radiance && alone.exposure_ev != whole[2].exposure_ev);
}

/// Of the records of a walk what no cache, schedule or band changes: effects in their order, and their rays. Which of
/// several occluders a shadow ray meets first is open, and so is which bricks were hit.
fn counted(output: &Path) -> Vec<String> {
    let of = |record: &Value| format!("{} {} {}", record["frame"], record["pass"], record["rays_traced"]);
    records(output).iter().map(of).collect()
}

#[test]
fn bands_of_one_picture_are_rendered_apart() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "1000");
    let moving = convert(folder.path(), "moving.bricks", source(None, false));
    let motion = folder.path().join("motion.json");
    std::fs::write(&motion, MOTION).expect("a file");
    let near = scene.with_extension("near.json");
    // Five rows of tiles, in bands of two and one.
    let view = "--frames 2 --size 40x72 --tile 16 --bands 3 --adapter cpu --quality draft";
    let variants = [
        (&scene, format!("{view} --path {} --denoise --aov --spp 2", near.display())),
        (&scene, format!("{view} --path {} --effects diffuse --diffuse-rays 2 --bounces 4", near.display())),
        (&moving, format!("{view} --motion {} --denoise --taa", motion.display())),
    ];
    for (scene, options) in &variants {
        let [whole, joined] = ["whole", "joined"].map(|name| folder.path().join(name));
        walk(scene, &whole, options);
        // Of the second frame the band in the middle is missing, and rendered where the others are joined.
        for part in ["5", "0-1", "2-3"] {
            walk(scene, &joined, &format!("{options} --part {part}"));
        }
        walk(scene, &joined, &format!("{options} --join"));
        assert!(frames(&joined) == frames(&whole), "{options}: joined bands differ");
        assert_eq!(counted(&joined), counted(&whole), "{options}");
        assert_eq!(json(&joined.join("summary.json"))["parts"]["joined"], 5);
        assert!(!parts::folder(&joined).exists(), "parts stay");
        // The control: bands of other frames make another picture.
        walk(scene, &joined, &format!("{options} --part 0-5"));
        let [one, other] = [0, 3].map(|number| std::fs::read(parts::file(&joined, number)).expect("a part"));
        assert_ne!(one, other);
    }
    let words = |more: &str| words(&scene, &folder.path().join("out"), &format!("{view} {more}"));
    for (more, named) in [("--part 6", "6 bands, from 0"), ("--part 0 --lod 1 --lod-correct 4", "--lod-correct")] {
        let done = common::brickwalk(words(more));
        assert_eq!(done.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&done.stderr).contains(named));
    }
}

#[test]
fn what_is_damaged_or_of_another_walk_is_rendered_again() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "1000");
    let options = format!("{VIEW} --quality draft --adapter cpu");
    let [whole, joined] = ["whole", "joined"].map(|name| folder.path().join(name));
    walk(&scene, &whole, &options);
    let words = |more: &str| words(&scene, &joined, &format!("{options} {more}"));
    common::succeed(words("--part 0-2"));
    // What is whole is not rendered again.
    let written =
        |number| std::fs::metadata(parts::file(&joined, number)).and_then(|it| it.modified()).expect("a time");
    let before = [0, 1].map(written);
    let damaged = parts::file(&joined, 2);
    let mut bytes = std::fs::read(&damaged).expect("a part");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&damaged, &bytes).expect("a part");
    common::succeed(words("--part 0-1"));
    assert_eq!([0, 1].map(written), before);
    // A part of other random numbers in the place of frame 1, a damaged one in that of 2, none of 3.
    let other = folder.path().join("other");
    walk(&scene, &other, &format!("{options} --seed 7 --part 1"));
    std::fs::copy(parts::file(&other, 1), parts::file(&joined, 1)).expect("a copy");
    walk(&scene, &joined, &format!("{options} --part 4"));
    let done = common::brickwalk(words("--join"));
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{said}");
    assert!(said.contains("0001.part: this is a part of another walk") && said.contains("part 1 is"), "{said}");
    assert!(said.contains("0002.part: this file is cut off or damaged"), "{said}");
    assert!(frames(&joined) == frames(&whole));
    assert_eq!(json(&joined.join("summary.json"))["parts"]["joined"], 2);
    // Frames that there are not, and settings with which frames need others.
    for (more, named) in [("--part 5", "5 frames, from 0"), ("--part 0-1 --frame-budget 8M", "--frame-budget")] {
        let done = common::brickwalk(words(more));
        assert_eq!(done.status.code(), Some(2));
        assert!(String::from_utf8_lossy(&done.stderr).contains(named));
    }
}
