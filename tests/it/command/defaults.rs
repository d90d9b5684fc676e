//! What a first user meets: defaults that work on small scenes, folders used twice, values that are no values.

use crate::common::{brickwalk, city, converted, folder, frames, succeed, walk};
use std::ffi::OsStr;
use std::fs::File;
use std::path::Path;

const SMALL: &str = "--frames 1 --size 32x18 --adapter cpu";

fn output(words: &[&OsStr]) -> (bool, String) {
    let output = brickwalk(words);
    let text = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8_lossy(&text).into_owned())
}

/// One triangle, one brick: less than two bricks of the usual size, and a quarter of it is nothing.
#[test]
fn scenes_of_one_brick_walk_and_trace_by_default() {
    let folder = folder();
    let scene = converted(folder.path(), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "");
    let out = folder.path().join("out");
    walk(&scene, &out, SMALL);
    assert_eq!(frames(&out).len(), 1);
    let rays = folder.path().join("rays.npy");
    // (1, 8) f64: from above the triangle down on it.
    let header = "{'descr': '<f8', 'fortran_order': False, 'shape': (1, 8), }";
    let padded = format!("{header:<117}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((padded.len() as u16).to_le_bytes());
    bytes.extend(padded.as_bytes());
    for value in [0.25f64, 0.25, 3.0, 0.0, 0.0, -1.0, 0.0, f64::INFINITY] {
        bytes.extend(value.to_le_bytes());
    }
    std::fs::write(&rays, bytes).expect("rays");
    let hits = folder.path().join("hits.npy");
    let words =
        ["trace".as_ref(), scene.as_os_str(), "--rays".as_ref(), rays.as_os_str(), "-o".as_ref(), hits.as_os_str()];
    succeed(words);
    let hits = std::fs::read(hits).expect("hits");
    let t = f64::from_le_bytes(hits[hits.len() - 20..][..8].try_into().expect("8 bytes"));
    assert_eq!(t, 3.0);
}

/// A share that is too small becomes the least that works, and is named; a size that is too small is refused.
#[test]
fn shares_that_are_too_small_are_raised() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "4K");
    let out = folder.path().join("out");
    let run = |cache: &str| {
        let options = format!("{SMALL} --cache {cache}");
        let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), out.as_os_str()];
        output(&words.into_iter().chain(options.split(' ').map(OsStr::new)).collect::<Vec<_>>())
    };
    let (is_done, text) = run("1%");
    assert!(is_done && text.contains("--cache 1% is") && text.contains("two largest bricks"), "{text}");
    let raised = frames(&out);
    let (is_done, text) = run("100%");
    assert!(is_done && !text.contains("warning"), "{text}");
    assert_eq!(raised, frames(&out), "the cache changes no picture");
    let (is_done, text) = run("1K");
    assert!(!is_done && text.contains("too small") && text.contains("--cache"), "{text}");
}

/// Frames of an earlier, longer walk go; what is not ours stays.
#[test]
fn a_second_walk_leaves_no_frames_of_the_first() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "4K");
    let out = folder.path().join("out");
    walk(&scene, &out, "--frames 4 --size 32x18 --adapter cpu --aov");
    let other = out.join("frames/notes.txt");
    std::fs::write(&other, "mine").expect("a file");
    walk(&scene, &out, "--frames 2 --size 32x18 --adapter cpu");
    let mut names: Vec<String> = frames(&out).into_iter().map(|(name, _)| name).collect();
    names.sort_unstable();
    assert_eq!(names, ["0000.png", "0001.png", "notes.txt"]);
    let left = |name: &str| Path::new(&out).join(name).exists();
    assert!(!left(".brickwalk-lock") && left("records.jsonl"));
}

/// Two walks do not write into one folder at a time.
#[test]
fn a_folder_has_one_owner() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "4K");
    let out = folder.path().join("out");
    std::fs::create_dir_all(&out).expect("a folder");
    let lock = File::create(out.join(".brickwalk-lock")).expect("a lock");
    lock.lock().expect("it is free");
    let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), out.as_os_str()];
    let words: Vec<&OsStr> = words.into_iter().chain(SMALL.split(' ').map(OsStr::new)).collect();
    let (is_done, text) = output(&words);
    assert!(!is_done && text.contains("another brickwalk"), "{text}");
    lock.unlock().expect("it was held");
    assert!(output(&words).0);
}

/// The range is what is said of a value below it, and not that there is no such option.
#[test]
fn negative_values_are_told_their_range() {
    let (is_done, text) = output(&["walk", "a.bricks", "-o", "out", "--spp", "-1"].map(OsStr::new));
    assert!(!is_done && text.contains("1 to 1") && !text.contains("unexpected"), "{text}");
}

/// What has no effect is named.
#[test]
fn options_without_effect_are_named() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "4K");
    let out = folder.path().join("out");
    let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), out.as_os_str()];
    let options = format!("{SMALL} --roma-k 8");
    let (is_done, text) = output(&words.into_iter().chain(options.split(' ').map(OsStr::new)).collect::<Vec<_>>());
    assert!(is_done && text.contains("warning: --roma-k has no effect without"), "{text}");
}
