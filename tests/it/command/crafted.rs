//! Scene files that were made to do harm: their checksums are right.

use crate::common::{brickwalk, city, folder};
use bricks::{GeometryLayout, Payload, SceneFile};
use std::path::{Path, PathBuf};

/// Of it the checksums alone are used.
#[allow(dead_code)]
#[path = "../../../bricks/tests/it/exercise.rs"]
mod exercise;

/// A city with `value` at the byte of the first brick's geometry that `at` says.
fn crafted(folder: &Path, name: &str, at: impl Fn(&GeometryLayout) -> u64, value: Option<f32>) -> PathBuf {
    let scene = city(folder, "10K", "1K");
    let (offset, layout) = {
        let file = SceneFile::open(&scene).expect("a scene");
        let span = file.resident().span(Payload::Geometry(0)).expect("a payload");
        (span.offset, GeometryLayout::of(&file.resident().bricks[0]))
    };
    let mut bytes = std::fs::read(&scene).expect("a scene");
    let at = (offset + at(&layout)) as usize;
    if let Some(value) = value {
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
    }
    exercise::seal(&mut bytes);
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("a scene");
    path
}

#[test]
fn what_is_not_finite_is_refused_by_every_schedule() {
    let folder = folder();
    let folder = folder.path();
    let vertex = crafted(folder, "vertex.bricks", |layout| layout.vertices + 12, Some(f32::INFINITY));
    // The origin of the second node's boxes.
    let node = crafted(folder, "node.bricks", |_| 80, Some(f32::NAN));
    let out = folder.join("out");
    for scene in [&vertex, &node] {
        for schedule in ["plain-bvh2", "plain", "demand", "chc"] {
            let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), out.as_os_str()];
            let options = format!("--schedule {schedule} --cache 100% --size 32x32 --frames 1 --adapter cpu");
            let output = brickwalk(words.into_iter().chain(options.split(' ').map(std::ffi::OsStr::new)));
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            assert_eq!(output.status.code(), Some(1), "{schedule}: {said}");
            assert!(said.contains("brick 0 geometry is not valid"), "{schedule}: {said}");
        }
        let verified = brickwalk(["verify".as_ref(), scene.as_os_str()]);
        assert_eq!(verified.status.code(), Some(1));
    }
    // Control: without a change.
    let good = crafted(folder, "good.bricks", |_| 0, None);
    assert!(brickwalk(["verify".as_ref(), good.as_os_str()]).status.success());
}
