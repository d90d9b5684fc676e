//! Reads of a scene that fail once: a frame is right or an error, and every frame after it is right.

use crate::common::{city, folder, settings};
use anyhow::Result;
use bricks::{ByteSource, SceneFile};
use brickwalk::frame::Renderer;
use brickwalk::scene::framing::path_from_bounds;
use brickwalk::session::opened::Opened;
use brickwalk::session::renderer::renderer;
use brickwalk::{Settings, settings::Adapter};
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// A scene in memory of which one read is refused.
struct Refusing {
    bytes: Vec<u8>,
    reads: AtomicU64,
    /// The number of that read, from 0.
    refused: u64,
}

impl ByteSource for Refusing {
    fn length(&self) -> io::Result<u64> {
        Ok(self.bytes.len() as u64)
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        if self.reads.fetch_add(1, Ordering::Relaxed) == self.refused {
            return Err(io::ErrorKind::PermissionDenied.into());
        }
        let start = offset as usize;
        out.copy_from_slice(self.bytes.get(start..start + out.len()).ok_or(io::ErrorKind::UnexpectedEof)?);
        Ok(())
    }
}

fn open(source: Arc<Refusing>, options: &str) -> Result<Renderer> {
    let settings = Settings { adapter: Adapter::Cpu, ..settings(options) };
    let name = Path::new("refusing.bricks");
    let file = Arc::new(SceneFile::from_source(name, source)?);
    renderer(Opened::open(file, name, &settings)?, name, &settings)
}

/// The bits of a frame.
fn frame(renderer: &mut Renderer) -> Result<Vec<u32>> {
    let manifest = &renderer.scene.resident().manifest;
    let path = path_from_bounds(manifest.min, manifest.max);
    let radiance = renderer.frame(0, &path.frame(0, 1))?.pixels.radiance;
    Ok(radiance.into_iter().flatten().map(f32::to_bits).collect())
}

#[test]
fn frames_are_right_after_a_read_that_was_refused() {
    let folder = folder();
    let bytes = std::fs::read(city(folder.path(), "10K", "4K")).expect("the scene");
    let source = |refused| Arc::new(Refusing { bytes: bytes.clone(), reads: AtomicU64::new(0), refused });
    for schedule in ["plain", "plain-bvh2", "demand", "chc"] {
        let options = format!("--size 32x24 --effects shadow,diffuse --schedule {schedule} --cache 100%");
        let sound = source(u64::MAX);
        let mut renderer = open(sound.clone(), &options).expect("a session");
        let opened = sound.reads.load(Ordering::Relaxed);
        let truth = frame(&mut renderer).expect("a frame");
        let reads = sound.reads.load(Ordering::Relaxed);
        assert!(reads > opened + 4, "{schedule}: {reads} reads, {opened} of them to open it");
        for refused in opened..reads {
            let mut renderer = open(source(refused), &options).expect("a session");
            let first = frame(&mut renderer).expect_err("a frame without the read");
            let text = format!("{first:#}");
            assert!(text.contains("permission denied"), "{schedule}, read {refused}: {text}");
            for again in 0..2 {
                let frame = frame(&mut renderer);
                let frame = frame.unwrap_or_else(|error| panic!("{schedule}, read {refused}, {again}: {error:#}"));
                assert!(frame == truth, "{schedule}, read {refused}, {again}: other pixels");
            }
        }
    }
}
