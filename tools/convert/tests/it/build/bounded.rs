//! Conversions that do not fit in memory: the same file as in memory, whatever the memory; within that memory;
//! continued after an interruption.

use super::scenes::*;
use brickwalk_convert::build::{BuildError, BuildSettings, build_source};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{
    IDENTITY, MeshOutline, Outline, PartOutline, Placement, Primitive, Source, SourceError, SourceTexture,
};
use std::borrow::Cow;
use std::path::Path;

/// Triangles of a part.
const PART: u32 = 2000;

/// A scene that is computed part by part: mesh 0 is a soup with a few large triangles and some without area, mesh 1 a
/// flat grid, mesh 2 small and placed often.
pub struct Computed {
    outline: Outline,
}

impl Computed {
    pub fn new(soup: u32, grid: u32) -> Self {
        let mesh = |name: &str, triangles: u32| MeshOutline {
            name: name.to_owned(),
            parts: (0..triangles)
                .step_by(PART as usize)
                .map(|first| PartOutline { primitive: 0, triangles: PART.min(triangles - first) })
                .collect(),
            shines_to_front: false,
        };
        let empty = scene(Vec::new(), Vec::new());
        let mut outline = Outline { materials: empty.materials, sources: empty.sources, ..Outline::default() };
        outline.meshes = vec![mesh("soup", soup), mesh("grid", grid), mesh("often", 1500)];
        let turned = matrix(rotation(0.7, [1.0, 2.0, 1.5]), [3.0, 1.0, -2.0]);
        outline.placements = vec![placement("a", 0, IDENTITY), placement("b", 1, turned)];
        outline.placements.extend((0..20).map(|i| {
            let at = matrix(rotation(f64::from(i), [1.0, 2.0, 1.0]), [f64::from(i) * 3.0, 0.0, 1.0]);
            Placement { name: format!("often {i}"), ..placement("", 2, at) }
        }));
        Self { outline }
    }
}

impl Source for Computed {
    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn part(&self, mesh: usize, part: usize) -> Result<Cow<'_, Primitive>, SourceError> {
        let count = self.outline.meshes[mesh].parts[part].triangles;
        let mut random = Random((mesh as u64) << 32 | part as u64);
        let mut primitive = Primitive { material: (part % 2) as u32, ..Primitive::default() };
        for i in 0..count {
            let number = part as u32 * PART + i;
            let corners = if mesh == 1 {
                let (x, y) = (f64::from(number / 2 % 300), f64::from(number / 600));
                let far = [x + 1.0, y + 1.0, 0.0];
                if number.is_multiple_of(2) {
                    [[x, y, 0.0], [x + 1.0, y, 0.0], far]
                } else {
                    [[x, y, 0.0], far, [x, y + 1.0, 0.0]]
                }
            } else {
                let size = if number.is_multiple_of(997) { 40.0 } else { 0.2 };
                let center = random.point(50.0);
                let mut corners = [center; 3];
                let offsets = [random.point(size), random.point(size)];
                for (corner, offset) in corners[1..].iter_mut().zip(offsets) {
                    (0..3).for_each(|k| corner[k] += offset[k]);
                }
                if number % 1013 == 5 {
                    corners[2] = corners[1];
                }
                corners
            };
            primitive.indices.extend([0, 1, 2].map(|k| primitive.positions.len() as u32 + k));
            primitive.positions.extend(corners);
        }
        Ok(Cow::Owned(primitive))
    }

    fn texture(&self, index: usize) -> Result<Cow<'_, SourceTexture>, SourceError> {
        Err(SourceError(format!("texture {index}: none")))
    }
}

pub fn bounded(threads: usize, memory: u64) -> BuildSettings {
    BuildSettings { threads: Some(threads), memory_bytes: Some(memory << 20), ..settings(500) }
}

pub fn bytes(source: &dyn Source, settings: &BuildSettings) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    let summary = build_source(source, settings, &path, &Progress::hidden()).unwrap();
    let is_bounded = summary.phases.iter().any(|(phase, _)| *phase == "distribute");
    assert_eq!(is_bounded, settings.memory_bytes.unwrap() < 500 << 20);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no scratch file is left behind");
    std::fs::read(path).unwrap()
}

#[test]
fn the_file_does_not_depend_on_memory() {
    let source = Computed::new(150_000, 90_000);
    let all = bytes(&source, &bounded(2, 1000));
    for (threads, memory) in [(1, 38), (2, 42), (3, 48), (1, 60)] {
        assert!(bytes(&source, &bounded(threads, memory)) == all, "{threads} threads, {memory} MiB");
    }
    assert!(bytes(&Computed::new(150_000, 89_999), &bounded(2, 42)) != all);
}

#[test]
fn too_little_memory_is_refused_with_the_least() {
    let source = Computed::new(150_000, 90_000);
    let build = |memory: u64| {
        let folder = tempfile::tempdir().unwrap();
        let result = build_source(&source, &bounded(1, memory), &folder.path().join("a.bricks"), &Progress::hidden());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), usize::from(result.is_ok()));
        result
    };
    let Err(BuildError::Setting { setting: "--memory", expected, .. }) = build(5) else { panic!("another error") };
    let least: u64 = expected.split('M').next().unwrap().parse().unwrap();
    assert!(build(least).is_ok());
    assert!(matches!(build(least - 1), Err(BuildError::Setting { .. })));
}

/// What is beside an output.
fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Interrupts when a part was asked for some number of times.
struct Interrupting<'a> {
    source: &'a Computed,
    left: std::sync::atomic::AtomicI64,
    progress: Progress,
}

impl Source for Interrupting<'_> {
    fn outline(&self) -> &Outline {
        self.source.outline()
    }

    fn part(&self, mesh: usize, part: usize) -> Result<Cow<'_, Primitive>, SourceError> {
        if self.left.fetch_sub(1, std::sync::atomic::Ordering::Relaxed) == 0 {
            self.progress.interrupt();
        }
        self.source.part(mesh, part)
    }

    fn texture(&self, index: usize) -> Result<Cow<'_, SourceTexture>, SourceError> {
        self.source.texture(index)
    }
}

#[test]
fn an_interrupted_conversion_is_continued() {
    let source = Computed::new(100_000, 60_000);
    let settings = bounded(2, 40);
    let all = bytes(&source, &settings);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bricks");
    std::fs::write(&path, "old").unwrap();
    let interrupted = |parts: i64, resume: bool| {
        let progress = Progress::hidden();
        let source = Interrupting { source: &source, left: parts.into(), progress: progress.clone() };
        let settings = BuildSettings { resume, ..settings.clone() };
        let result = build_source(&source, &settings, &path, &progress);
        assert!(matches!(result, Err(BuildError::Paused { .. })), "{result:?}");
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), [".a.bricks.partial", ".a.bricks.scratch", "a.bricks"]);
    };
    // In the collection, and in the distribution.
    interrupted(3, false);
    interrupted(60, true);
    let other = BuildSettings { resume: true, brick_triangles: 501, ..settings.clone() };
    let result = build_source(&source, &other, &path, &Progress::hidden());
    assert!(matches!(result, Err(BuildError::OtherConversion { .. })), "{result:?}");
    assert_eq!(names(folder.path()).len(), 3, "what can be continued stays");
    let resumed = BuildSettings { resume: true, ..settings.clone() };
    build_source(&source, &resumed, &path, &Progress::hidden()).unwrap();
    assert!(std::fs::read(&path).unwrap() == all);
    assert_eq!(names(folder.path()), ["a.bricks"]);

    // With memory for everything there is nothing to continue, and what was left is removed.
    interrupted_anew(&source, &settings, &path);
    let free = BuildSettings { memory_bytes: Some(1 << 30), ..settings.clone() };
    let result = build_source(&source, &BuildSettings { resume: true, ..free.clone() }, &path, &Progress::hidden());
    assert!(matches!(result, Err(BuildError::OtherConversion { .. })), "{result:?}");
    assert_eq!(names(folder.path()).len(), 3);
    build_source(&source, &free, &path, &Progress::hidden()).unwrap();
    assert_eq!(names(folder.path()), ["a.bricks"]);

    // Without --resume everything is done anew, and with it too if there is nothing to continue.
    interrupted_anew(&source, &settings, &path);
    build_source(&source, &settings, &path, &Progress::hidden()).unwrap();
    build_source(&source, &resumed, &path, &Progress::hidden()).unwrap();
    assert!(std::fs::read(&path).unwrap() == all);
}

fn interrupted_anew(source: &Computed, settings: &BuildSettings, path: &Path) {
    let progress = Progress::hidden();
    let source = Interrupting { source, left: 100.into(), progress: progress.clone() };
    assert!(build_source(&source, settings, path, &progress).is_err());
}

/// A kill while the journal is made leaves a piece of it, and nothing else.
#[test]
fn a_conversion_killed_as_it_began_is_begun_anew() {
    let source = Computed::new(100_000, 60_000);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bricks");
    let scratch = folder.path().join(".a.bricks.scratch");
    for (piece, resume) in [("", true), ("brickwalk", true), ("brickwalk", false)] {
        std::fs::create_dir(&scratch).unwrap();
        std::fs::write(scratch.join("journal"), piece).unwrap();
        let settings = BuildSettings { resume, ..bounded(2, 40) };
        build_source(&source, &settings, &path, &Progress::hidden()).unwrap();
        assert_eq!(names(folder.path()), ["a.bricks"]);
    }
    // Beside other files it is none.
    std::fs::create_dir(&scratch).unwrap();
    std::fs::write(scratch.join("journal"), "").unwrap();
    std::fs::write(scratch.join("mine"), "mine").unwrap();
    let result = build_source(&source, &bounded(2, 40), &path, &Progress::hidden());
    assert!(matches!(result, Err(BuildError::NotScratch { .. })), "{result:?}");
    assert_eq!(std::fs::read(scratch.join("mine")).unwrap(), b"mine");
}

#[test]
fn folders_of_others_are_left_alone() {
    let source = Computed::new(100_000, 60_000);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bricks");
    let scratch = folder.path().join(".a.bricks.scratch");
    std::fs::create_dir(&scratch).unwrap();
    std::fs::write(scratch.join("mine"), "mine").unwrap();
    let result = build_source(&source, &bounded(2, 40), &path, &Progress::hidden());
    assert!(matches!(result, Err(BuildError::NotScratch { .. })), "{result:?}");
    assert_eq!(names(folder.path()), [".a.bricks.scratch"]);
    let elsewhere = tempfile::tempdir().unwrap();
    let settings = BuildSettings { scratch: Some(elsewhere.path().to_owned()), ..bounded(2, 40) };
    build_source(&source, &settings, &path, &Progress::hidden()).unwrap();
    assert!(names(elsewhere.path()).is_empty());
    assert_eq!(std::fs::read(scratch.join("mine")).unwrap(), b"mine");
}
