//! How commands end where there is too little: memory, space, time; and what killed ones leave.
#![cfg(unix)]

use crate::common::{brickwalk, city, folder, names, skip, succeed, wait_for, walk};
use brickwalk::session::picture_bytes::PictureBytes;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Runs a command under a limit of the shell's; its status and what it says on standard error.
fn limited(limit: &str, line: &str) -> (Option<i32>, String) {
    let script = format!("ulimit {limit}; exec {} {line}", env!("CARGO_BIN_EXE_brickwalk"));
    let output = Command::new("sh").args(["-c", &script]).output().expect("a shell");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// A picture that memory does not hold is refused before anything is made, with the size that it does hold.
#[test]
fn a_picture_too_large_for_the_memory_is_refused_at_once() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "4K");
    let out = folder.path().join("out");
    let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), out.as_os_str()];
    let options = "--frames 1 --size 16384x16384 --adapter cpu --aov --effects shadow,diffuse,glossy";
    let PictureBytes { joined, .. } = PictureBytes::of(&crate::common::settings(options), false);
    if brickwalk::cpu::available_memory().is_none_or(|bytes| bytes >= joined << 28) {
        return skip("the memory of this machine holds the picture");
    }
    let start = Instant::now();
    let output = brickwalk(words.into_iter().chain(options.split(' ').map(AsRef::as_ref)));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!((output.status.code(), text.lines().count()), (Some(1), 1), "{text}");
    assert!(text.contains("bytes a pixel") && text.contains("are available; give at most --size "), "{text}");
    assert!(start.elapsed() < Duration::from_secs(20) && !out.exists());
}

/// A picture that memory does not hold at once is rendered in bands, which is said; it is the same picture.
#[cfg(target_os = "linux")]
#[test]
fn a_picture_too_large_for_the_memory_is_rendered_in_bands() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "4K");
    let picture = |limit: &str, name: &str| {
        let out = folder.path().join(name);
        let line = "--frames 1 --size 2600x2400 --adapter cpu --effects primary --quality exact";
        let (status, text) = limited(limit, &format!("walk {} -o {} {line}", scene.display(), out.display()));
        assert_eq!(status, Some(0), "{text}");
        (text, std::fs::read(out.join("frames/0000.png")).expect("a frame"))
    };
    // Kibibytes; the picture takes twice as much.
    let (text, banded) = picture("-v 1200000", "banded");
    assert!(text.contains("--size 2600x2400: rendered in ") && text.contains("bytes a pixel, and "), "{text}");
    let (text, whole) = picture("-v unlimited", "whole");
    assert!(!text.contains("bands"), "control: {text}");
    assert!(banded == whole);
}

/// What a picture is said to take is what it takes.
#[test]
fn pictures_take_as_much_memory_as_is_said() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "4K");
    let out = folder.path().join("out");
    let bands = ["--effects shadow --exposure auto --bands 100", "--denoise --bands 100"];
    let whole = ["--effects shadow", "--effects shadow --aov", "--effects diffuse --diffuse-rays 1", "--denoise"];
    for options in bands.into_iter().chain(whole) {
        let peak = |edge: u64| {
            let size = format!("--frames 2 --size {edge}x{edge} --adapter cpu --cache 100%");
            walk(&scene, &out, &format!("{size} {options}"));
            let summary = std::fs::read(out.join("summary.json")).expect("a summary");
            let summary: serde_json::Value = serde_json::from_slice(&summary).expect("JSON");
            summary["memory"]["peak_bytes"].as_u64().expect("on Linux")
        };
        let (small, large) = (512, 1280);
        let found = (peak(large) - peak(small)) as f64 / (large * large - small * small) as f64;
        let PictureBytes { device, filter, host, band, joined } =
            PictureBytes::of(&crate::common::settings(options), false);
        // Bands of one row of tiles.
        let of_band = 64.0 * (device + band) as f64 / (large + small) as f64;
        let said = if options.contains("--bands") { joined as f64 + of_band } else { (device + filter + host) as f64 };
        println!("{options}: {found:.0} bytes a pixel, said {said}");
        // Never much less than is needed; rounding of allocators and rays in flight are the rest.
        assert!((0.75..1.1).contains(&(found / said)), "{options}: {found:.0} of {said}");
    }
}

/// Want of memory is one line, and nothing half-written is left.
#[test]
fn want_of_memory_is_one_line() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    succeed([
        "scene".as_ref(),
        "city".as_ref(),
        "--triangles".as_ref(),
        "1M".as_ref(),
        "-o".as_ref(),
        at("m.glb").as_os_str(),
    ]);
    let before = names(folder.path());
    let convert = format!("convert {} -o {} --memory 64G --threads 2", at("m.glb").display(), at("m.bricks").display());
    let (status, text) = limited("-v 300000", &convert);
    assert_eq!((status, text.lines().count()), (Some(1), 1), "{text}");
    assert!(text.starts_with("brickwalk: ") && text.contains("memory"), "{text}");
    assert_eq!(names(folder.path()), before, "nothing is left");
    let (status, text) = limited("-v unlimited", &convert);
    assert_eq!(status, Some(0), "control: {text}");
}

/// So is a file that grows beyond its limit.
#[test]
fn a_file_beyond_its_limit_is_one_line() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    // Blocks of 512 bytes.
    let (status, text) = limited("-f 500", &format!("scene city --triangles 60K -o {}", at("m.bricks").display()));
    assert_eq!((status, text.lines().count()), (Some(1), 1), "{text}");
    assert!(text.contains("m.bricks") && text.contains("space"), "{text}");
    assert_eq!(names(folder.path()), Vec::<String>::new());
    let scene = city(folder.path(), "10K", "4K");
    let (out, video) = (at("out"), at("v.y4m"));
    let line = format!("walk {} -o {} --adapter cpu --size 320x180 --frames 9", scene.display(), out.display());
    let (status, text) = limited("-f 2000", &format!("{line} --video {}", video.display()));
    assert!(status == Some(1) && text.contains("v.y4m"), "{text}");
    assert!(names(folder.path()).iter().all(|name| !name.contains(".tmp")), "{:?}", names(folder.path()));
}

/// What a killed walk leaves goes with the next.
#[test]
fn the_next_walk_removes_what_a_killed_one_left() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "4K");
    let (out, video) = (folder.path().join("out"), folder.path().join("v.y4m"));
    let options = format!("--size 64x36 --adapter cpu --video {}", video.display());
    let mut child = Command::new(env!("CARGO_BIN_EXE_brickwalk"))
        .args(["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), out.as_os_str()])
        .args(format!("--frames 100000 {options}").split(' '))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the command starts");
    wait_for(&out.join("frames/0001.png"));
    child.kill().expect("it runs");
    child.wait().expect("an end");
    let temporary = |name: &String| name.ends_with(".tmp");
    assert!(names(folder.path()).iter().any(temporary), "control: a temporary file is left");
    walk(&scene, &out, &format!("--frames 1 {options}"));
    assert!(!names(folder.path()).iter().any(temporary), "{:?}", names(folder.path()));
    assert!(video.exists());
}

/// A walk that takes long says how long, and what would shorten it.
#[test]
fn a_long_walk_says_how_long_it_takes() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "4K");
    let out = folder.path().join("out");
    let mut child = Command::new(env!("CARGO_BIN_EXE_brickwalk"))
        .args(["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), out.as_os_str()])
        .args("--frames 2 --spp 1000000 --size 64x36 --adapter cpu --effects shadow".split(' '))
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command starts");
    let lines = BufReader::new(child.stderr.take().expect("a pipe")).lines();
    let line = lines.map(|line| line.expect("text")).find(|line| line.contains("this takes about"));
    child.kill().expect("it runs");
    child.wait().expect("an end");
    let line = line.expect("a line before the walk ends");
    for part in ["a frame", "fewer --frames, fewer --spp, fewer --effects", "smaller --size"] {
        assert!(line.contains(part), "{line}");
    }
}

/// The demo's cache is smaller than what it shows.
#[test]
fn the_demo_is_out_of_core() {
    let folder = folder();
    let out = folder.path().join("demo");
    let options = "--triangles 300K --frames 4 --size 64x36 --adapter cpu";
    let words = ["demo".as_ref(), "-o".as_ref(), out.as_os_str()];
    let text = succeed(words.into_iter().chain(options.split(' ').map(AsRef::as_ref)));
    let before = text.split(" evicted to make room").next().expect("a piece");
    let evicted = before.rsplit(' ').next().map(|count| count.replace(',', "").parse::<u64>());
    assert!(evicted.is_some_and(|count| count.is_ok_and(|count| count > 0)), "{text}");
    assert!(text.contains("report.html") && text.contains("frames"), "{text}");
}
