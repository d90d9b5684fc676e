//! The format does not change by accident: today's writer makes the very bytes of the committed file, and today's
//! reader reads them. `BRICKS_REGENERATE_GOLDEN=1` writes the file anew; do so only with a new format version.

use crate::common::{Scene, written, written_with_fields, written_with_levels};
use bricks::{Access, SceneFile, verify_file};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

#[test]
fn golden_file_of_version_4() {
    is_golden("version-4.bricks", written());
}

#[test]
fn golden_file_with_displacement_fields() {
    is_golden("version-4-displacement.bricks", written_with_fields());
}

#[test]
fn golden_file_with_levels() {
    is_golden("version-4-levels.bricks", written_with_levels());
}

/// Files that earlier programs wrote.
#[test]
fn files_of_earlier_versions_are_refused_by_their_version() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    for version in 1..bricks::layout::VERSION {
        let path = folder.join(format!("version-{version}.bricks"));
        assert!(std::fs::metadata(&path).unwrap().len() > 10_000, "{}: a whole scene", path.display());
        let says = |error: bricks::Error| {
            let expected = format!("{}: the file has format version {version}", path.display());
            let text = error.to_string();
            assert!(text.starts_with(&expected) && text.ends_with("convert again"), "{text}");
        };
        for access in [Access::Map, Access::Read] {
            says(SceneFile::open_with(&path, access).err().unwrap());
        }
        says(verify_file(&path, &mut |_, _| ()).unwrap().problems.remove(0));
    }
}

fn is_golden(name: &str, (_folder, path, scene): (TempDir, PathBuf, Scene)) {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
    if std::env::var_os("BRICKS_REGENERATE_GOLDEN").is_some() {
        std::fs::copy(&path, &golden).unwrap();
    }
    let bytes = std::fs::read(&golden).unwrap();
    assert!(bytes.len() < 144 << 10);
    assert!(bytes == std::fs::read(&path).unwrap(), "the writer's bytes are not those of {}", golden.display());

    let file = SceneFile::open(&golden).unwrap();
    assert_eq!(*file.resident(), scene.resident);
    assert_eq!(file.file_bytes(), bytes.len() as u64);
    assert_eq!(file.resident().payloads().count(), scene.payloads.len());
    for (payload, expected) in &scene.payloads {
        let mut out = vec![0xaa; file.loaded_bytes(*payload) as usize];
        file.copy(*payload, &mut out).unwrap();
        assert_eq!(out, *expected, "{payload}");
    }
    let report = verify_file(&golden, &mut |_, _| {}).unwrap();
    assert!(report.is_ok(), "{:?}", report.problems);
    assert_eq!(report.payloads, scene.payloads.len() as u64);
}
