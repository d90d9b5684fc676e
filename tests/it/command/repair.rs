//! Damaged scene files that are rebuilt from what they were converted from.

use crate::common::{add_fields, add_level, brickwalk, city, folder, names, succeed};
use bricks::{Payload, SceneFile};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Bumpy ground of 20 x 20 squares with a texture, converted in bricks of 64 triangles.
fn ground(folder: &Path) -> PathBuf {
    let mut obj = String::from("mtllib g.mtl\nusemtl g\n");
    for at in 0..21 * 21 {
        let (x, z) = (at % 21, at / 21);
        let height = (x * 7 + z * 13) % 5;
        let _ = writeln!(obj, "v {x} 0.{height} {z}\nvt 0.{x} 0.{z}");
    }
    for at in (0..20 * 21).filter(|at| at % 21 < 20) {
        let [a, b, c, d] = [at + 1, at + 2, at + 22, at + 23];
        let _ = writeln!(obj, "f {a}/{a} {c}/{c} {b}/{b}\nf {b}/{b} {c}/{c} {d}/{d}");
    }
    std::fs::write(folder.join("g.obj"), obj).expect("an input");
    std::fs::write(folder.join("g.mtl"), "newmtl g\nmap_Kd g.png\n").expect("materials");
    texture(folder, 3);
    let scene = folder.join("g.bricks");
    let (input, output) = (folder.join("g.obj"), scene.clone());
    let words = ["convert".as_ref(), input.as_os_str(), "-o".as_ref(), output.as_os_str()];
    succeed(words.into_iter().chain(["--brick-triangles", "64"].map(std::ffi::OsStr::new)));
    scene
}

fn texture(folder: &Path, seed: u8) {
    let texel = |x, y| image::Rgb([(x * 5) as u8, (y * 9) as u8, seed]);
    image::RgbImage::from_fn(160, 8, texel).save(folder.join("g.png")).expect("an image");
}

/// Flips a bit in the middle of each payload, and one in the padding after the first.
fn damage(path: &Path, payloads: &[Payload]) -> Vec<u8> {
    let scene = SceneFile::open(path).expect("the scene");
    let mut bytes = std::fs::read(path).expect("the file");
    for &payload in payloads {
        let span = scene.span(payload);
        bytes[(span.offset + span.bytes / 2) as usize] ^= 4;
    }
    let first = scene.span(payloads[0]);
    bytes[(first.offset + first.bytes) as usize] ^= 1;
    std::fs::write(path, &bytes).expect("the damaged file");
    bytes
}

/// Runs `repair` on `scene`; its status and its output or its one line.
fn repair(scene: &Path, options: &str) -> (Option<i32>, String) {
    let folder = scene.parent().expect("a folder").to_str().expect("test paths are UTF-8");
    let options = options.replace("DIR", folder);
    let words = ["repair".as_ref(), scene.as_os_str()];
    let output = brickwalk(words.into_iter().chain(options.split_whitespace().map(std::ffi::OsStr::new)));
    let said = if output.status.success() { &output.stdout } else { &output.stderr };
    (output.status.code(), String::from_utf8_lossy(said).into_owned())
}

const DAMAGED: [Payload; 5] =
    [Payload::Geometry(2), Payload::Attributes(5), Payload::Proxies(3), Payload::Texture(0), Payload::Tile(1)];

#[test]
fn damaged_bricks_and_textures_are_rebuilt_to_the_same_bytes() {
    let folder = folder();
    let scene = ground(folder.path());
    let (whole, before) = (std::fs::read(&scene).expect("the scene"), names(folder.path()));
    assert_ne!(damage(&scene, &DAMAGED), whole);
    let (status, said) = repair(&scene, "--from DIR/g.obj");
    assert_eq!(status, Some(0), "{said}");
    assert!(
        said.contains("repaired brick 2 geometry, brick 5 attributes, brick 3 proxies, texture 0, tile 1 ("),
        "{said}"
    );
    assert!(std::fs::read(&scene).expect("the scene") == whole);
    assert_eq!(names(folder.path()), before, "nothing is left behind");

    let written = || std::fs::metadata(&scene).expect("the file").modified().expect("a time");
    let time = written();
    let (status, said) = repair(&scene, "--from DIR/g.obj");
    assert!(status == Some(0) && said.contains("nothing to repair"), "{status:?} {said}");
    assert_eq!(written(), time);
}

#[test]
fn what_does_not_fit_is_refused_and_changes_nothing() {
    let folder = folder();
    let scene = ground(folder.path());
    let damaged = damage(&scene, &DAMAGED);
    let before = names(folder.path());
    let refused = |options: &str, status: i32, says: &[&str]| {
        let (found, said) = repair(&scene, options);
        assert_eq!(found, Some(status), "{options}: {said}");
        assert!(says.iter().all(|word| said.contains(word)), "{options}: {said}");
        assert!(status == 2 || said.lines().count() == 1, "{said}");
        assert!(std::fs::read(&scene).expect("the scene") == damaged, "{options}");
    };
    refused("", 2, &["--from"]);
    refused("--from DIR/g.obj DIR/g.obj", 1, &["from 1 file,", "gives 2"]);
    refused("--from DIR/g.obj --lattice -4", 1, &["differs from the original", "options"]);
    texture(folder.path(), 4);
    refused("--from DIR/g.obj", 1, &["rebuilt texture 0 differs", "images"]);
    texture(folder.path(), 3);
    assert_eq!(names(folder.path()), before, "nothing is left behind");
    let input = folder.path().join("g.obj");
    let obj = std::fs::read_to_string(&input).expect("the input");
    std::fs::write(&input, obj.replacen("v 3 0.1 0", "v 3 0.2 0", 1)).expect("another input");
    assert_ne!(std::fs::read_to_string(&input).expect("the input"), obj);
    refused("--from DIR/g.obj", 1, &["input g.obj has changed"]);
    // The control: with the right input all of this can be repaired.
    std::fs::write(&input, obj).expect("the input");
    assert_eq!(repair(&scene, "--from DIR/g.obj").0, Some(0));

    // Damage in the resident part, which says what the payloads are.
    let mut bytes = std::fs::read(&scene).expect("the scene");
    let last = bytes.len() - 9;
    bytes[last] ^= 1;
    std::fs::write(&scene, &bytes).expect("the file");
    let (status, said) = repair(&scene, "--from DIR/g.obj");
    assert!(status == Some(1) && said.contains("convert again"), "{status:?} {said}");
    assert!(std::fs::read(&scene).expect("the scene") == bytes);
}

#[test]
fn a_scene_with_displacement_fields_is_repaired_but_for_these() {
    let folder = folder();
    let scene = ground(folder.path());
    add_fields(&scene);
    let whole = std::fs::read(&scene).expect("the scene");
    assert_ne!(damage(&scene, &DAMAGED), whole);
    let (status, said) = repair(&scene, "--from DIR/g.obj");
    assert_eq!(status, Some(0), "{said}");
    assert!(std::fs::read(&scene).expect("the scene") == whole);

    // These fields are of no scene: what is made anew differs, and nothing of it is written.
    let damaged = damage(&scene, &[Payload::Displacement(1)]);
    let remedy = "make all anew with brickwalk bake-displacement\n";
    let (status, said) = repair(&scene, "");
    assert!(status == Some(1) && said.contains("displacement field 1 differs from the original"), "{said}");
    assert!(said.ends_with(remedy) && said.lines().count() == 1, "{said}");
    assert!(std::fs::read(&scene).expect("the scene") == damaged);

    // What else is damaged is repaired all the same.
    damage(&scene, &[Payload::Geometry(2)]);
    let (status, said) = repair(&scene, "--from DIR/g.obj");
    assert!(status == Some(1) && said.ends_with(remedy), "{status:?} {said}");
    assert!(std::fs::read(&scene).expect("the scene") == damaged);
}

#[test]
fn levels_are_made_anew() {
    let folder = folder();
    let scene = folder.path().join("city.bricks");
    let words = ["scene", "city", "--triangles", "20K", "--brick-triangles", "500", "--lod", "on", "-o"];
    crate::common::succeed(words.iter().map(std::ffi::OsStr::new).chain([scene.as_os_str()]));
    let bricks = SceneFile::open(&scene).expect("the scene").resident().bricks.len() as u32;
    let whole = std::fs::read(&scene).expect("the scene");
    damage(&scene, &[Payload::Geometry(bricks + 1), Payload::Attributes(bricks)]);
    let (status, said) = repair(&scene, "");
    assert!(status == Some(0) && said.contains("level 1 geometry"), "{status:?} {said}");
    assert!(std::fs::read(&scene).expect("the scene") == whole);
}

/// The level is of no conversion: what is made anew is another, and nothing of it is written.
#[test]
fn a_level_that_the_conversion_does_not_make_is_not_repaired() {
    let folder = folder();
    let scene = ground(folder.path());
    let bricks = SceneFile::open(&scene).expect("the scene").resident().bricks.len() as u32;
    add_level(&scene);
    let whole = std::fs::read(&scene).expect("the scene");
    let damaged = damage(&scene, &[Payload::Geometry(bricks)]);
    let (status, said) = repair(&scene, "--from DIR/g.obj");
    assert!(status == Some(1) && said.contains("level 0 geometry"), "{status:?} {said}");
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(std::fs::read(&scene).expect("the scene") == damaged);
    let verified = brickwalk(["verify".as_ref(), scene.as_os_str()]);
    let line = String::from_utf8_lossy(&verified.stderr).into_owned();
    assert!(line.contains("(level 0 geometry)") && !line.contains(" bricks: "), "{line}");

    // What else is damaged is repaired, and the level stays.
    std::fs::write(&scene, &whole).expect("the file");
    damage(&scene, &DAMAGED);
    let (status, said) = repair(&scene, "--from DIR/g.obj");
    assert_eq!(status, Some(0), "{said}");
    assert!(std::fs::read(&scene).expect("the scene") == whole);
}

/// What a repair leaves that was killed, and one at the same time.
#[test]
fn repairs_are_alone_and_clean_up_after_those_that_were_killed() {
    let folder = folder();
    let scene = ground(folder.path());
    let (whole, before) = (std::fs::read(&scene).expect("the scene"), names(folder.path()));
    let damaged = damage(&scene, &DAMAGED);
    let running = bricks::Writer::reserve(folder.path().join("g.bricks.repair")).expect("a lock");
    let (status, said) = repair(&scene, "--from DIR/g.obj");
    assert!(status == Some(1) && said.contains("another process is repairing this file"), "{status:?} {said}");
    assert!(std::fs::read(&scene).expect("the scene") == damaged);
    // As a process that is killed: its files stay, its lock goes.
    running.keep();
    let target = scene.canonicalize().expect("a path");
    let hash = xxhash_rust::xxh3::xxh3_64(target.as_os_str().as_encoded_bytes());
    let scratch = target.with_file_name(format!(".g.bricks.{hash:016x}.repair"));
    std::fs::create_dir(&scratch).expect("a folder");
    std::fs::write(scratch.join("rebuilt.bricks"), b"half").expect("a file");
    assert_eq!(names(folder.path()).len(), before.len() + 2);
    let (status, said) = repair(&scene, "--from DIR/g.obj");
    assert_eq!(status, Some(0), "{said}");
    assert!(std::fs::read(&scene).expect("the scene") == whole);
    assert_eq!(names(folder.path()), before, "nothing is left behind");
}

#[test]
fn generated_scenes_need_no_input() {
    let folder = folder();
    let scene = city(folder.path(), "30K", "1K");
    let whole = std::fs::read(&scene).expect("the scene");
    damage(&scene, &[Payload::Geometry(0), Payload::Attributes(0), Payload::Geometry(9)]);
    let (status, said) = repair(&scene, "");
    assert!(status == Some(0) && said.contains("brick 0 geometry, brick 9 geometry, brick 0 attributes"), "{said}");
    assert!(std::fs::read(&scene).expect("the scene") == whole);
}
