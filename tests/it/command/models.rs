//! Models where a scene is named, names of what is written, inputs that are bad, damage that is told.

use crate::common::{brickwalk, city, converted, folder, frames, succeed};
use std::ffi::OsStr;
use std::path::Path;
use std::process::{Command, Output};

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
const SMALL: [&str; 6] = ["--frames", "1", "--size", "32x18", "--adapter", "cpu"];

/// Runs a command with converted models in `cache`.
fn cached(cache: &Path, words: &[&OsStr]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_brickwalk"));
    command.env("BRICKWALK_CACHE_DIR", cache).args(words).output().expect("the command starts")
}

fn said(output: &Output) -> (Option<i32>, String) {
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

fn count(folder: &Path, ending: &str) -> usize {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.filter(|entry| entry.file_name().to_string_lossy().ends_with(ending)).count()
}

fn words<'a>(scene: &'a Path, out: &'a Path) -> Vec<&'a OsStr> {
    let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), out.as_os_str()];
    words.into_iter().chain(SMALL.map(OsStr::new)).collect()
}

/// A model is converted once; then it is taken from where it lies, until one of its files changes.
#[test]
fn a_model_is_converted_once() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    let (model, cache, out) = (at("shape.obj"), at("cache/models"), at("out"));
    std::fs::write(&model, format!("mtllib shape.mtl\nusemtl red\n{TRIANGLE}")).expect("a model");
    std::fs::write(at("shape.mtl"), "newmtl red\nKd 1 0 0\n").expect("materials");
    let walk = || {
        let (status, text) = said(&cached(&cache, &words(&model, &out)));
        assert_eq!(status, Some(0), "{text}");
        text
    };
    let text = walk();
    assert!(text.contains("once") && text.contains(&cache.display().to_string()), "{text}");
    let first = frames(&out);
    let text = walk();
    assert!(text.contains("converted before") && !text.contains("once"), "{text}");
    assert_eq!(frames(&out), first);
    let scene = converted(folder.path(), &std::fs::read_to_string(&model).expect("the model"), "");
    succeed(words(&scene, &out));
    assert_eq!(frames(&out), first, "as by convert");
    // A file that the model refers to.
    std::fs::write(at("shape.mtl"), "newmtl red\nKd 0 1 0\n# another\n").expect("materials");
    assert!(walk().contains("once"));
    assert_ne!(frames(&out), first);
    assert_eq!((count(&cache, ".bricks"), count(&cache, ".json"), count(&cache, ".partial")), (1, 1, 0));
    let (status, text) = said(&cached(&cache, &["info".as_ref(), model.as_os_str()]));
    assert!(status == Some(0) && text.contains("converted before"), "{text}");
}

/// Those who come at the same time wait for the first.
#[test]
fn two_processes_convert_a_model_once() {
    let folder = folder();
    let (model, cache) = (folder.path().join("city.glb"), folder.path().join("cache"));
    succeed([
        "scene".as_ref(),
        "city".as_ref(),
        "--triangles".as_ref(),
        "60K".as_ref(),
        "-o".as_ref(),
        model.as_os_str(),
    ]);
    let children: Vec<_> = (0..3)
        .map(|_| {
            let mut command = Command::new(env!("CARGO_BIN_EXE_brickwalk"));
            let command = command.env("BRICKWALK_CACHE_DIR", &cache).arg("info").arg(&model);
            let piped = || std::process::Stdio::piped();
            command.stdout(piped()).stderr(piped()).spawn().expect("the command starts")
        })
        .collect();
    let outputs: Vec<Output> = children.into_iter().map(|child| child.wait_with_output().expect("an end")).collect();
    let texts: Vec<String> = outputs.iter().map(|output| said(output).1).collect();
    assert!(outputs.iter().all(|output| output.status.success() && output.stdout == outputs[0].stdout), "{texts:?}");
    assert_eq!(texts.iter().filter(|text| text.contains("once")).count(), 1, "{texts:?}");
    assert_eq!(count(&cache, ".bricks"), 1);
}

/// A model that is bad or missing is named, and nothing is left of it.
#[test]
fn a_bad_model_leaves_nothing() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("bad.gltf"), "{\"asset\": ").expect("a model");
    for name in ["bad.gltf", "missing.glb"] {
        let (status, text) = said(&cached(&at("cache"), &words(&at(name), &at("out"))));
        assert!(status == Some(1) && text.contains(name), "{text}");
    }
    assert!(!at("out").exists());
    assert_eq!(count(&at("cache"), ".bricks") + count(&at("cache"), ".json") + count(&at("cache"), ".partial"), 0);
}

/// A name that promises another format is refused with the right one; a folder that is not there is no input's fault.
#[test]
fn outputs_are_named_as_what_they_are() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("a.obj"), TRIANGLE).expect("a model");
    for (command, input, wrong, right) in [
        ("convert", at("a.obj"), "x.brick", "name it"),
        ("convert", at("a.obj"), "x", "x.bricks"),
        ("scene", "city".into(), "x.obj", "x.bricks"),
        ("scene", "city".into(), "x.brick", "x.bricks"),
    ] {
        let wrong = at(wrong);
        let output = brickwalk([command.as_ref(), input.as_os_str(), "-o".as_ref(), wrong.as_os_str()]);
        let (status, text) = said(&output);
        assert!(status == Some(2) && text.contains(right) && text.contains("x.bricks"), "{text}");
    }
    let (missing, input) = (at("none/x.bricks"), at("a.obj"));
    let convert = |more: &[&OsStr], to: &Path| {
        let words = ["convert".as_ref(), input.as_os_str(), "-o".as_ref(), to.as_os_str()];
        said(&brickwalk(words.iter().chain(more)))
    };
    let (status, text) = convert(&[], &missing);
    assert!(status == Some(1) && text.contains("none") && text.contains("-o") && !text.contains("a.obj"), "{text}");
    let (status, text) = convert(&["--scratch".as_ref(), at("none").as_os_str()], &at("x.bricks"));
    assert!(status == Some(1) && text.contains("--scratch") && !text.contains("a.obj"), "{text}");
    assert_eq!(std::fs::read_dir(folder.path()).expect("a folder").count(), 1, "nothing is written");
}

/// What is damaged is said once, with what mends it.
#[test]
fn damage_is_told_once_and_names_repair() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "4K");
    let mut bytes = std::fs::read(&scene).expect("the scene");
    let geometry = bricks::SceneFile::open(&scene).expect("the scene").resident().bricks[0].geometry;
    bytes[geometry.offset as usize + 100] ^= 16;
    std::fs::write(&scene, bytes).expect("the scene");
    let name = scene.file_name().and_then(OsStr::to_str).expect("a name");
    let (status, text) = said(&brickwalk(["verify".as_ref(), scene.as_os_str()]));
    assert!(status == Some(1) && text.contains("brickwalk repair"), "{text}");
    let (status, text) = said(&brickwalk(words(&scene, &folder.path().join("out"))));
    assert!(status == Some(1) && text.contains("brickwalk repair"), "{text}");
    assert_eq!(text.matches(name).count(), 1, "{text}");
}

/// `--skip-bad` leaves out what is bad, whatever is wrong with it, and says which and why.
#[test]
fn bad_inputs_can_be_skipped() {
    let folder = folder();
    let at = |name: &str| folder.path().join("in").join(name);
    std::fs::create_dir(folder.path().join("in")).expect("a folder");
    std::fs::write(at("a.obj"), TRIANGLE).expect("a model");
    std::fs::write(at("b.gltf"), "{\"asset\": ").expect("a model");
    // Known only once its vertices are read.
    std::fs::write(at("c.obj"), TRIANGLE.replace("1 0 0", "nan 0 0")).expect("a model");
    std::fs::write(at("d.obj"), TRIANGLE).expect("a model");
    let out = folder.path().join("x.bricks");
    let (input, bad) = (folder.path().join("in"), at("b.gltf"));
    let convert = |input: &Path, more: &[&str]| {
        let words = ["convert".as_ref(), input.as_os_str(), "-o".as_ref(), out.as_os_str()];
        brickwalk(words.into_iter().chain(more.iter().map(OsStr::new)))
    };
    assert_eq!(convert(&input, &[]).status.code(), Some(1), "control");
    let output = convert(&input, &["--skip-bad"]);
    let (status, text) = said(&output);
    assert_eq!(status, Some(0), "{text}");
    let skipped: Vec<&str> = text.lines().filter(|line| line.contains("skipped")).collect();
    assert!(skipped.len() == 2 && skipped[0].contains("b.gltf") && skipped[1].contains("c.obj"), "{text}");
    assert!(skipped[1].contains("not finite"), "{text}");
    let summary = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(summary.contains("2 of 4 inputs skipped") && summary.contains("2 triangles"), "{summary}");
    let (status, text) = said(&convert(&bad, &["--skip-bad"]));
    assert!(status == Some(1) && text.contains("all inputs are bad"), "{text}");
}
