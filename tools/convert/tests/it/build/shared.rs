//! Conversions that several processes share: the same file as of one, in whatever order and however often tasks are
//! done, whichever fail, and whatever becomes of what they leave.

use super::bounded::{Computed, bounded, bytes};
use super::details::Detailed;
use super::scenes::*;
use brickwalk_convert::build::{
    BuildError, BuildSettings, BuildSummary, Crew, CrewError, TaskStep, build_shared, build_source, do_task,
};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{Outline, Primitive, Source, SourceError, SourceTexture};
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{LazyLock, Mutex};

/// Threads that do tasks side by side.
const WORKERS: usize = 3;

/// A crew of threads, each of which opens the conversion anew for every task. It does them in an order of its own, some
/// of them twice.
struct Threads<'a> {
    source: &'a dyn Source,
    settings: BuildSettings,
    output: PathBuf,
    random: Mutex<Random>,
    /// Called before the results of a step are taken.
    before: &'a Before<'a>,
}

type Before<'a> = dyn Fn(&TaskStep, &[u64]) -> Result<(), CrewError> + Sync + 'a;

fn nothing(_: &TaskStep, _: &[u64]) -> Result<(), CrewError> {
    Ok(())
}

impl<'a> Threads<'a> {
    fn new(source: &'a dyn Source, settings: &BuildSettings, output: &Path, seed: u64) -> Self {
        let (settings, output) = (settings.clone(), output.to_owned());
        Self { source, settings, output, random: Mutex::new(Random(seed)), before: &nothing }
    }
}

impl Crew for Threads<'_> {
    fn perform(
        &self,
        step: &TaskStep,
        tasks: &[u64],
        done: &mut dyn FnMut(u64) -> Result<(), BuildError>,
    ) -> Result<(), CrewError> {
        let mut queue: Vec<u64> = tasks.to_vec();
        {
            let mut random = self.random.lock().unwrap();
            queue.extend(tasks.iter().filter(|_| random.next() < 0.3));
            (1..queue.len()).for_each(|last| queue.swap(last, (random.next() * (last + 1) as f64) as usize));
        }
        let next = AtomicUsize::new(0);
        let work = || {
            while let Some(&task) = queue.get(next.fetch_add(1, Ordering::Relaxed)) {
                let at = (step.name, step.position);
                let work = || do_task(self.source, &self.settings, &self.output, at, task, &Progress::hidden());
                // Like a scheduler that gives a failed task to another worker.
                let result = (0..20).fold(work(), |result, _| result.or_else(|_| work()));
                result.map_err(|error| CrewError::Failed(error.to_string()))?;
            }
            Ok::<_, CrewError>(())
        };
        std::thread::scope(|scope| {
            let workers: Vec<_> = (0..WORKERS).map(|_| scope.spawn(work)).collect();
            workers.into_iter().try_for_each(|worker| worker.join().unwrap())
        })?;
        (self.before)(step, tasks)?;
        tasks.iter().try_for_each(|&task| done(task)).map_err(CrewError::Build)
    }
}

fn shared(crew: &Threads, resume: bool) -> Result<BuildSummary, BuildError> {
    let settings = BuildSettings { resume, ..crew.settings.clone() };
    build_shared(crew.source, &settings, &crew.output, crew, &Progress::hidden())
}

/// The file that a crew makes.
fn shared_bytes(source: &dyn Source, settings: &BuildSettings, seed: u64) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let crew = Threads::new(source, settings, &folder.path().join("scene.bricks"), seed);
    shared(&crew, false).unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no scratch file is left behind");
    std::fs::read(&crew.output).unwrap()
}

/// A scene that several tests share, and its file as one process makes it, by whether it has levels.
static MADE_ALONE: LazyLock<(Computed, [Vec<u8>; 2])> = LazyLock::new(|| {
    let source = Computed::new(300_000, 150_000);
    let made = [false, true].map(|lod| bytes(&source, &BuildSettings { lod, ..bounded(2, 1000) }));
    (source, made)
});

#[test]
fn a_crew_makes_the_same_file() {
    let (source, made) = &*MADE_ALONE;
    for (lod, all) in [false, true].into_iter().zip(made) {
        for (threads, memory, seed) in [(1, 54, 1), (2, 60, 2), (1, 1000, 3)] {
            let settings = BuildSettings { lod, ..bounded(threads, memory) };
            assert!(shared_bytes(source, &settings, seed) == *all, "lod {lod}, {threads} threads, {memory} MiB");
        }
    }
    let other = bytes(&Computed::new(300_000, 149_999), &bounded(2, 1000));
    assert!(shared_bytes(source, &bounded(2, 60), 4) != other);
}

#[test]
fn a_crew_makes_the_same_file_with_details() {
    let source = Detailed::new(Computed::new(300_000, 40_000), false);
    let all = bytes(&source, &bounded(2, 1000));
    assert!(shared_bytes(&source, &bounded(2, 80), 11) == all);
}

#[test]
fn small_and_empty_scenes_are_shared_too() {
    for (soup, grid) in [(1, 1), (1000, 0), (0, 0)] {
        let source = Computed::new(soup, grid);
        let all = bytes(&source, &bounded(2, 1000));
        assert!(shared_bytes(&source, &bounded(2, 1000), 5) == all, "{soup} and {grid} triangles");
    }
}

/// A source whose reading fails at random.
struct Failing<'a> {
    source: &'a Computed,
    random: Mutex<Random>,
    failures: AtomicUsize,
}

impl Source for Failing<'_> {
    fn outline(&self) -> &Outline {
        self.source.outline()
    }

    fn part(&self, mesh: usize, part: usize) -> Result<Cow<'_, Primitive>, SourceError> {
        if self.random.lock().unwrap().next() < 0.02 {
            self.failures.fetch_add(1, Ordering::Relaxed);
            return Err(SourceError("the worker dies".to_owned()));
        }
        self.source.part(mesh, part)
    }

    fn texture(&self, index: usize) -> Result<Cow<'_, SourceTexture>, SourceError> {
        self.source.texture(index)
    }
}

#[test]
fn tasks_that_fail_are_done_by_others() {
    let (source, [all, _]) = &*MADE_ALONE;
    let failing = Failing { source, random: Mutex::new(Random(6)), failures: AtomicUsize::new(0) };
    assert!(shared_bytes(&failing, &bounded(1, 60), 6) == *all);
    assert!(failing.failures.load(Ordering::Relaxed) > 0, "nothing failed");
}

/// The shards of a conversion to `output` whose names begin like this.
fn shards(output: &Path, start: &str) -> Vec<PathBuf> {
    let scratch = output.with_file_name(".scene.bricks.scratch");
    let paths = std::fs::read_dir(scratch).unwrap().map(|entry| entry.unwrap().path());
    let mut own: Vec<PathBuf> =
        paths.filter(|path| path.file_name().unwrap().to_string_lossy().starts_with(start)).collect();
    own.sort();
    own
}

/// Changes a byte of a file, counted from its start or, if negative, from its end.
fn flip(path: &Path, at: i64) {
    let mut bytes = std::fs::read(path).unwrap();
    let at = if at < 0 { bytes.len() as i64 + at } else { at };
    bytes[at as usize] ^= 16;
    std::fs::write(path, bytes).unwrap();
}

#[test]
fn what_is_damaged_is_made_again() {
    let (source, [all, all_lod]) = &*MADE_ALONE;
    let run = |step: &'static str, kind: &str, at: Option<i64>| {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("scene.bricks");
        let settings = BuildSettings { lod: step == "levels", ..bounded(1, 54) };
        let is_done = AtomicUsize::new(0);
        let before = |now: &TaskStep, _: &[u64]| {
            let kinds = if now.name == step { shards(&output, kind) } else { Vec::new() };
            // Once, the last, and not a shard without blocks.
            let some = kinds.iter().rfind(|path| std::fs::metadata(path).unwrap().len() > 1000);
            if let Some(path) = some.filter(|_| is_done.fetch_add(1, Ordering::Relaxed) == 0) {
                match at {
                    Some(at) => flip(path, at),
                    None => std::fs::remove_file(path).unwrap(),
                }
            }
            Ok(())
        };
        let crew = Threads { before: &before, ..Threads::new(source, &settings, &output, 7) };
        let result = shared(&crew, false);
        assert!(is_done.load(Ordering::Relaxed) > 0, "nothing was damaged: {step}, {kind}");
        result.map(|_| std::fs::read(&output).unwrap())
    };
    for (step, kind, at) in [
        ("objects", "order", Some(-1)),
        ("gather", "items", Some(-1)),
        ("cut", "order", None),
        ("distribute", "triangles-0-1-0", Some(0)),
        ("distribute", "triangles-0-1-0", Some(-50)),
        ("distribute", "triangles-0-1-1", None),
        ("encode", "encoded-1", Some(40)),
        ("encode", "encoded-0", None),
        ("levels", "levels-0-0", Some(40)),
    ] {
        let made = run(step, kind, at).unwrap_or_else(|error| panic!("{step}, {kind}, {at:?}: {error}"));
        assert!(made == *if step == "levels" { all_lod } else { all }, "{step}, {kind}, {at:?}");
    }
    // What it was made from is gone: then it is an error and not another scene.
    let result = run("cut", "order", Some(0));
    assert!(matches!(result, Err(BuildError::Crew { .. } | BuildError::ScratchDamaged { .. })), "{result:?}");
}

#[test]
fn a_conversion_whose_leader_ends_is_continued() {
    let (source, [all, all_lod]) = &*MADE_ALONE;
    for step in ["objects", "gather", "cut", "distribute", "encode", "levels"] {
        let folder = tempfile::tempdir().unwrap();
        let output = folder.path().join("scene.bricks");
        let settings = BuildSettings { lod: step == "levels", ..bounded(1, 54) };
        let before = |now: &TaskStep, _: &[u64]| match now.name == step {
            true => Err(CrewError::Failed("the cluster is gone".to_owned())),
            false => Ok(()),
        };
        let crew = Threads { before: &before, ..Threads::new(source, &settings, &output, 8) };
        let error = shared(&crew, false).unwrap_err();
        assert!(matches!(error, BuildError::Crew { .. }), "{error}");
        assert!(!output.exists());
        let made: Vec<(PathBuf, std::time::SystemTime)> = shards(&output, "")
            .into_iter()
            .map(|path| (path.clone(), std::fs::metadata(&path).unwrap().modified().unwrap()))
            .collect();
        // Alone it cannot be continued: its pieces are others.
        let alone =
            build_source(source, &BuildSettings { resume: true, ..settings.clone() }, &output, &Progress::hidden());
        assert!(matches!(alone, Err(BuildError::OtherConversion { .. })), "{alone:?}");
        let steps = AtomicUsize::new(0);
        let check = |now: &TaskStep, _: &[u64]| {
            // Some kinds of steps come several times; later ones remove what went into earlier ones.
            if now.name == step && steps.fetch_add(1, Ordering::Relaxed) == 0 {
                let same = |(path, time): &(PathBuf, std::time::SystemTime)| {
                    std::fs::metadata(path).is_ok_and(|file| file.modified().unwrap() == *time)
                };
                let kept = made.iter().filter(|file| same(file)).count();
                // All but the journal and what is not a task's.
                assert!(kept + 2 >= made.len() && made.len() > 1, "{step}: {kept} of {}", made.len());
            }
            Ok(())
        };
        let crew = Threads { before: &check, ..Threads::new(source, &settings, &output, 9) };
        shared(&crew, true).unwrap();
        let all = if step == "levels" { all_lod } else { all };
        assert!(std::fs::read(&output).unwrap() == *all, "{step}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}

#[test]
fn a_worker_with_another_conversion_is_refused() {
    let source = Computed::new(100_000, 60_000);
    let settings = bounded(1, 60);
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("scene.bricks");
    let task = |settings: &BuildSettings, name: &str, position: u64, task: u64| {
        do_task(&source, settings, &output, (name, position), task, &Progress::hidden())
    };
    let before = |now: &TaskStep, _: &[u64]| {
        if now.name == "distribute" {
            let other = BuildSettings { brick_triangles: 501, ..settings.clone() };
            let result = task(&other, now.name, now.position, 0);
            assert!(matches!(result, Err(BuildError::OtherTask { .. })), "{result:?}");
            let result = task(&settings, "encode", now.position, 0);
            assert!(matches!(result, Err(BuildError::OtherTask { .. })), "{result:?}");
            let result = task(&settings, now.name, now.position, 1000);
            assert!(matches!(result, Err(BuildError::OtherTask { .. })), "{result:?}");
            let result = task(&settings, now.name, now.position + 1, 0);
            assert!(matches!(result, Err(BuildError::Behind { .. })), "{result:?}");
            task(&settings, now.name, now.position, 0).unwrap();
        }
        Ok(())
    };
    let crew = Threads { before: &before, ..Threads::new(&source, &settings, &output, 10) };
    shared(&crew, false).unwrap();
    let result = task(&settings, "distribute", 4, 0);
    assert!(matches!(result, Err(BuildError::Scratch { .. })), "{result:?}");
}
