//! All ways of reading give the same bytes, from many threads, and refuse requests that make no sense.

use crate::common::{self, written};
use bricks::{Access, Error, Payload, SceneFile};

#[test]
fn map_read_and_bytes_agree() {
    let (_folder, path, scene) = written();
    let bytes: &'static [u8] = std::fs::read(&path).unwrap().leak();
    for open in [
        SceneFile::open(&path),
        SceneFile::open_with(&path, Access::Map),
        SceneFile::open_with(&path, Access::Read),
        SceneFile::from_bytes(&path, bytes),
    ] {
        let file = open.unwrap();
        assert!(file.verify(&mut |_, _| {}).unwrap().is_ok());
        assert_eq!(*file.resident(), scene.resident);
        assert_eq!(file.path(), path);
        assert_eq!(file.file_bytes(), std::fs::metadata(&path).unwrap().len());
        let payloads: u64 = scene.resident.payloads().map(|(_, span)| span.bytes).sum();
        assert!(file.resident_bytes() > 0 && file.resident_bytes() < file.file_bytes() - payloads);
        for (payload, expected) in &scene.payloads {
            // At every alignment of the destination.
            for shift in 0..16 {
                let mut out = vec![0xaa; expected.len() + 16];
                file.copy(*payload, &mut out[shift..shift + expected.len()]).unwrap();
                assert_eq!(out[shift..shift + expected.len()], *expected);
                assert!(out[..shift].iter().chain(&out[shift + expected.len()..]).all(|&byte| byte == 0xaa));
            }
        }
    }
    // Negative control: bytes that end early.
    let error = SceneFile::from_bytes("short", &bytes[..bytes.len() - 1]).unwrap_err();
    assert!(matches!(error, Error::Length { .. }), "{error}");
}

#[test]
fn many_threads() {
    fn shared<T: Send + Sync>() {}
    shared::<SceneFile>();
    shared::<Error>();
    let (_folder, path, scene) = written();
    let file = SceneFile::open(&path).unwrap();
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for _ in 0..100 {
                    for (payload, expected) in &scene.payloads {
                        let mut out = vec![0; expected.len()];
                        file.copy(*payload, &mut out).unwrap();
                        assert_eq!(out, *expected);
                    }
                }
            });
        }
    });
}

#[test]
fn requests_that_make_no_sense() {
    let (_folder, path, _) = written();
    let file = SceneFile::open(&path).unwrap();
    let bytes = file.span(Payload::Geometry(1)).bytes as usize;
    for length in [0, 16, bytes - 1, bytes + 1] {
        let error = file.copy(Payload::Geometry(1), &mut vec![0; length]).unwrap_err();
        assert!(matches!(error, Error::Request { payload: Payload::Geometry(1), .. }), "{error}");
        assert!(error.to_string().contains(&format!("expected {bytes} bytes")), "{error}");
    }
    for payload in [Payload::Geometry(3), Payload::Attributes(u32::MAX), Payload::Texture(2), Payload::Tile(2)] {
        let error = file.copy(payload, &mut [0; 16]).unwrap_err();
        assert!(matches!(error, Error::Request { .. }), "{error}");
        assert!(error.to_string().contains(&payload.to_string()), "{error}");
        assert!(std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| file.span(payload))).is_err());
    }
}

#[test]
fn scene_without_triangles() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("empty.bricks");
    let mut scene = common::empty();
    scene.write(&path);
    let file = SceneFile::open(&path).unwrap();
    assert_eq!(*file.resident(), scene.resident);
    assert_eq!(common::problems(&path), "");
}
