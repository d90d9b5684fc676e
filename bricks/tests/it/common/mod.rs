//! A small scene with everything that the format has, and a way to spoil files while their checksums stay right.

mod image;
mod scene;

pub use image::Image;
pub use scene::{empty, scene, scene_with_fields, with_levels};

use bricks::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A scene and the bytes of its payloads as they are loaded.
pub struct Scene {
    pub resident: Resident,
    pub payloads: BTreeMap<Payload, Vec<u8>>,
}

impl Scene {
    /// The bytes of a payload as they are stored.
    pub fn stored(&self, payload: Payload) -> Vec<u8> {
        let bytes = &self.payloads[&payload];
        match payload {
            Payload::Attributes(brick) => attributes::encode(self.resident.brick(brick).unwrap(), bytes),
            Payload::Displacement(_) => pack::pack(bytes),
            _ => bytes.clone(),
        }
    }

    /// Writes the payloads and sets their spans.
    pub fn write_payloads(&mut self, writer: &mut Writer) {
        let bricks = self.resident.bricks.len() as u32;
        for payload in self.payloads.keys() {
            let span = writer.write(&self.stored(*payload)).unwrap();
            match *payload {
                Payload::Geometry(level @ 3..) => self.resident.levels[(level - bricks) as usize].brick.geometry = span,
                Payload::Attributes(level @ 3..) => {
                    self.resident.levels[(level - bricks) as usize].brick.attributes = span;
                }
                Payload::Geometry(brick) => self.resident.bricks[brick as usize].geometry = span,
                Payload::Attributes(brick) => self.resident.bricks[brick as usize].attributes = span,
                Payload::Proxies(brick) => self.resident.bricks[brick as usize].proxies = span,
                Payload::Opacity(map) => self.resident.opacity_maps[map as usize].texels = span,
                Payload::Texture(texture) => self.resident.textures[texture as usize].tail = span,
                Payload::Tile(tile) => self.resident.tiles[tile as usize] = span,
                Payload::Displacement(field) => self.resident.displacement[field as usize].span = span,
            }
        }
    }

    /// Writes the whole file.
    pub fn write(&mut self, path: &Path) {
        let mut writer = Writer::create(path).unwrap();
        self.write_payloads(&mut writer);
        writer.finish(&self.resident).unwrap();
    }
}

/// A folder for the files of one test, and the small scene in it.
pub fn written() -> (tempfile::TempDir, PathBuf, Scene) {
    in_folder(scene())
}

/// As [`written`], with displacement fields.
pub fn written_with_fields() -> (tempfile::TempDir, PathBuf, Scene) {
    in_folder(scene_with_fields())
}

/// As [`written`], with levels of detail.
pub fn written_with_levels() -> (tempfile::TempDir, PathBuf, Scene) {
    in_folder(with_levels(scene()))
}

/// As [`written`], with all that a file can have.
pub fn written_with_all() -> (tempfile::TempDir, PathBuf, Scene) {
    in_folder(with_levels(scene_with_fields()))
}

fn in_folder(mut scene: Scene) -> (tempfile::TempDir, PathBuf, Scene) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    scene.write(&path);
    (folder, path, scene)
}

/// Records that `spoil` breaks are refused with a message that names `part` and says `found`.
#[track_caller]
pub fn refused(mut resident: Resident, part: Part, found: &str, spoil: impl FnOnce(&mut Resident)) {
    validate::resident(&resident).unwrap();
    spoil(&mut resident);
    let flaw = validate::resident(&resident).expect_err(found);
    assert_eq!(flaw.part, part, "{flaw}");
    assert!(flaw.found.contains(found), "{flaw} does not say {found}");
}

/// Verifies a file; the problems, one a line.
pub fn problems(path: &Path) -> String {
    let report = verify_file(path, &mut |_, _| {}).unwrap();
    report.problems.iter().map(|problem| format!("{problem}\n")).collect()
}
