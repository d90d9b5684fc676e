//! The workers over a real scene file: whole, and with one damaged payload.

use std::sync::Arc;

use bricks::{Payload, SceneFile};

use crate::stream::{Destination, HostCache, Item, Kind, PayloadSource, StreamError, Workers};

/// The golden file of the format's own tests.
const SCENE: &[u8] = include_bytes!("../../../bricks/tests/golden/version-4.bricks");

#[derive(Default)]
struct Sink(Vec<u8>);

impl Destination for Sink {
    fn fill(&mut self, bytes: &[u8]) {
        self.0.extend_from_slice(bytes);
    }
}

fn open(bytes: &[u8]) -> (tempfile::TempDir, Arc<SceneFile>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    std::fs::write(&path, bytes).unwrap();
    (folder, Arc::new(SceneFile::open(&path).unwrap()))
}

fn items(scene: &SceneFile) -> Vec<Item> {
    scene.sizes().items().map(|(item, _)| item).collect()
}

#[test]
fn payloads_arrive_as_the_file_gives_them() {
    let (_folder, scene) = open(SCENE);
    let items = items(&scene);
    assert_eq!(items.iter().filter(|item| item.kind == Kind::Tile).count(), 2);
    let workers = Workers::new(scene.clone(), HostCache::new(1 << 20), 2).unwrap();
    for _ in 0..2 {
        let loaded = workers.load(items.iter().map(|&item| (item, Sink::default())).collect()).unwrap();
        for (item, sink) in loaded {
            let payload = Payload::from(item);
            let mut expected = vec![0; scene.loaded_bytes(payload) as usize];
            SceneFile::copy(&scene, payload, &mut expected).unwrap();
            assert_eq!(sink.0, expected, "{item}");
            let span = scene.span(payload);
            let stored = &SCENE[span.offset as usize..(span.offset + span.bytes) as usize];
            // Geometry and tiles as they lie in the file, attributes decoded.
            assert_eq!(sink.0 == stored, item.kind != Kind::Attributes, "{item}");
            assert_eq!(scene.sizes().of(item), Some(scene.loaded_bytes(payload)));
        }
    }
    assert_eq!(workers.stats().read, items.len() as u64);
    assert_eq!(workers.stats().cached, items.len() as u64);
}

#[test]
fn a_damaged_brick_is_named_and_the_others_load() {
    let (_folder, whole) = open(SCENE);
    for bad in items(&whole).into_iter().filter(|&item| whole.bytes(item) > 0) {
        let mut bytes = SCENE.to_vec();
        bytes[whole.span(bad.into()).offset as usize] ^= 1;
        let (_folder, scene) = open(&bytes);
        let items = items(&scene);
        let workers = Workers::new(scene, HostCache::new(1 << 20), 2).unwrap();
        for one in workers.load_each(items.iter().map(|&item| (item, Sink::default())).collect()) {
            match one.result {
                Ok(()) => assert_ne!(one.item, bad),
                Err(error @ StreamError::Payload { .. }) => {
                    assert_eq!(one.item, bad);
                    assert!(error.to_string().contains(&bad.to_string()), "{error}");
                    assert!(one.destination.0.is_empty());
                }
                Err(error) => panic!("{error}"),
            }
        }
        assert!(!workers.host_cache().contains(bad));
    }
}
