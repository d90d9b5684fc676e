//! `scene`: generated scenes, and camera paths through them.

use super::convert::{build_settings, check_output, summarise, usage, with_fields};
use super::interrupt;
use super::options::scene_args::{BuildArgs, SceneArgs};
use super::options::scene_kind::SceneKind;
use crate::cli::output::{Usage, note};
use crate::settings::sizes::counted;
use anyhow::{Context, Result};
use brickwalk_convert::build::{BuildSettings, BuildSummary, LatticeStep, build_source};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{InMemory, Source};
use brickwalk_scenes::{
    Error, GltfForm, Kind, Settings, Stiff, far_path, generate, is_ply, stiff, write_far_path, write_gltf,
    write_motion, write_paths, write_ply,
};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Runs `scene`.
///
/// # Errors
/// Options that the kind does not have, a count of triangles that it cannot have, or a file cannot be written.
pub fn run(args: &SceneArgs) -> Result<()> {
    let start = Instant::now();
    let progress = interrupt::job();
    check_output(&args.output, &["bricks", "glb", "gltf", "ply"], args.build.work.scratch.as_deref())?;
    if is_for_others(&args.output) {
        refuse_building(&args.build)?;
    }
    let (paths, summary) = in_pool(args.build.work.threads, || match args.kind {
        SceneKind::Generated(kind) => generated(args, kind, &progress),
        SceneKind::Stiff => made_stiff(args, &progress),
    })??;
    progress.finish();
    match summary {
        Written::Bricks(summary) => {
            summarise(&args.output, &summary, start, &mut note)?;
            with_fields(&args.build, &args.output)?;
        }
        Written::ForOthers { triangles } => note(&format!(
            "{}: {} with instances, {:.1} s\n",
            args.output.display(),
            counted(triangles, "triangle"),
            start.elapsed().as_secs_f64()
        ))?,
    }
    for path in paths {
        let is_motion = path.to_string_lossy().ends_with(".motion.json");
        note(&format!("{}: {}\n", path.display(), if is_motion { "motion" } else { "camera path" }))?;
    }
    Ok(())
}

/// Writes a scene of a kind and its paths.
fn generated(args: &SceneArgs, kind: Kind, progress: &Progress) -> Result<(Vec<PathBuf>, Written)> {
    if args.case.is_some() {
        return Err(Usage(format!("--case: {kind} has no cases; only stiff has")).into());
    }
    let settings = Settings {
        kind,
        triangles: args.triangles.unwrap_or(1_000_000),
        seed: args.seed,
        instanced: args.instanced,
        copies: args.copies,
    };
    let scene = generate(&settings, progress).map_err(|error| match error {
        // The count is an option's value, known only here.
        Error::Triangles { .. } => Usage(format!("--triangles: {error}")).into(),
        error => anyhow::Error::new(error),
    })?;
    let movable = kind.movable().iter().map(|&name| name.to_owned()).collect();
    let settings = BuildSettings { movable, ..build_settings(&args.build) };
    let summary = write(&scene, &args.output, &settings, progress)?;
    let mut paths = write_paths(&scene, &args.output)?;
    paths.extend(write_motion(&scene, &args.output)?);
    Ok((paths, summary))
}

/// Writes a stiff scene and its path.
fn made_stiff(args: &SceneArgs, progress: &Progress) -> Result<(Vec<PathBuf>, Written)> {
    let Some(case) = args.case else {
        let names = Stiff::ALL.map(Stiff::name).join(", ");
        return Err(Usage(format!("stiff: choose a scene with --case: {names}")).into());
    };
    if args.instanced || args.copies > 1 {
        return Err(Usage("--instanced, --copies: stiff scenes are a single mesh; leave them out".into()).into());
    }
    let triangles = args.triangles.unwrap_or(case.default_triangles());
    if triangles > Stiff::MOST_TRIANGLES {
        let most = Stiff::MOST_TRIANGLES;
        return Err(Usage(format!("--triangles: a stiff scene has at most {most} triangles, not {triangles}")).into());
    }
    if case == Stiff::Empty && is_for_others(&args.output) {
        return Err(Usage("--case empty: glTF and PLY hold no empty scenes; write S.bricks".into()).into());
    }
    let scene = stiff(case, case.size_of(triangles), args.seed);
    let path = far_path(&scene);
    let usual = build_settings(&args.build);
    let settings = BuildSettings {
        lattice: usual.lattice.or(case.lattice_log2().map(LatticeStep::Log2)),
        brick_triangles: args.build.brick_triangles.or(case.brick_triangles()).unwrap_or(usual.brick_triangles),
        ..usual
    };
    let summary = write(&InMemory::from(scene), &args.output, &settings, progress)?;
    let path = path.map(|path| write_far_path(&path, &args.output)).transpose()?;
    Ok((path.into_iter().collect(), summary))
}

/// Writes a scene in the form that the name of the file stands for.
fn write(scene: &dyn Source, output: &Path, settings: &BuildSettings, progress: &Progress) -> Result<Written> {
    match GltfForm::of(output) {
        Some(form) => write_gltf(scene, output, form, progress)?,
        None if is_ply(output) => write_ply(scene, output, progress)?,
        None => return Ok(Written::Bricks(Box::new(usage(build_source(scene, settings, output, progress))?))),
    }
    let outline = scene.outline();
    let triangles = outline.placements.iter().map(|p| outline.meshes[p.mesh as usize].triangle_count()).sum();
    Ok(Written::ForOthers { triangles })
}

/// Whether a file is one that other programs read.
fn is_for_others(output: &Path) -> bool {
    GltfForm::of(output).is_some() || is_ply(output)
}

/// What became of a scene.
enum Written {
    Bricks(Box<BuildSummary>),
    ForOthers { triangles: u64 },
}

/// Refuses options that have no meaning where nothing is cut into bricks.
fn refuse_building(args: &BuildArgs) -> Result<()> {
    let given = [
        ("--brick-triangles", args.brick_triangles.is_some()),
        ("--lattice", args.work.lattice.is_some()),
        ("--memory", args.work.memory.is_some()),
        ("--scratch", args.work.scratch.is_some()),
        ("--resume", args.resume),
        ("--fast", args.work.fast),
        ("--no-proxies", args.no_proxies),
        ("--lod", args.lod),
        ("--displacement", args.displacement),
    ];
    match given.into_iter().find(|(_, is_given)| *is_given) {
        Some((option, _)) => {
            Err(Usage(format!("{option}: only for .bricks files; leave it out for glTF and PLY")).into())
        }
        None => Ok(()),
    }
}

/// Runs `work` on `threads` threads; `None`: one a core.
fn in_pool<T: Send>(threads: Option<u32>, work: impl FnOnce() -> T + Send) -> Result<T> {
    let Some(threads) = threads else { return Ok(work()) };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads as usize)
        .build()
        .with_context(|| format!("cannot start {threads} threads; use fewer with --threads"))?;
    Ok(pool.install(work))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::options::args::{Cli, Command};
    use clap::Parser;

    fn scene(line: &str) -> Result<()> {
        match Cli::parse_from(["brickwalk", "scene", "city"].into_iter().chain(line.split_whitespace())).command {
            Command::Scene(args) => run(&args),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn equal_settings_make_equal_files_whatever_the_threads() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let options = |name: &str, more: &str| format!("-o {} --triangles 12K {more}", at(name).display());
        scene(&options("a.bricks", "--threads 1")).unwrap();
        scene(&options("b.bricks", "--threads 2")).unwrap();
        scene(&options("c.bricks", "--seed 1")).unwrap();
        let read = |name: &str| std::fs::read(at(name)).unwrap();
        assert!(read("a.bricks") == read("b.bricks"));
        assert!(read("a.bricks") != read("c.bricks"), "another seed is another city");
        for name in ["a.near.json", "a.far.json"] {
            let path = crate::scene::CameraPath::read(&at(name)).unwrap();
            assert!(path.keyframes().len() > 1);
        }
        assert_eq!(read("a.near.json"), read("b.near.json"));
    }

    #[test]
    fn the_extension_decides_the_format() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let options = |name: &str, more: &str| format!("-o {} --triangles 12K {more}", at(name).display());
        scene(&options("a.glb", "--threads 1")).unwrap();
        scene(&options("b.GLB", "--threads 2")).unwrap();
        scene(&options("c.gltf", "")).unwrap();
        scene(&options("d.PLY", "")).unwrap();
        let read = |name: &str| std::fs::read(at(name)).unwrap();
        assert!(read("a.glb").starts_with(b"glTF") && read("a.glb") == read("b.GLB"));
        assert!(read("c.gltf").starts_with(b"{") && read("a.glb").ends_with(&read("c.bin")));
        assert!(read("d.PLY").starts_with(b"ply\nformat binary_little_endian 1.0\n"));
        for name in ["a.near.json", "b.far.json", "c.near.json", "d.near.json"] {
            assert!(at(name).exists(), "{name}");
        }
        let before = std::fs::read_dir(folder.path()).unwrap().count();
        let options_of_building = [
            "--brick-triangles 1K",
            "--fast",
            "--resume",
            "--memory 1G",
            "--lattice -9",
            "--scratch .",
            "--no-proxies",
            "--lod on",
        ];
        for option in options_of_building {
            for name in ["e.glb", "e.ply"] {
                let error = scene(&options(name, option)).unwrap_err();
                assert!(error.is::<Usage>() && error.to_string().contains(".bricks"), "{option}: {error:?}");
            }
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), before);
    }

    #[test]
    fn stiff_scenes_refuse_what_they_do_not_have() {
        let folder = tempfile::tempdir().unwrap();
        let refused = |line: &str| {
            let words = format!("brickwalk scene {line} -o {}", folder.path().join("s.glb").display());
            let Command::Scene(args) = Cli::parse_from(words.split_whitespace()).command else { panic!() };
            let error = run(&args).unwrap_err();
            assert!(error.is::<Usage>(), "{line}: {error:?}");
            error.to_string()
        };
        for (line, says) in [
            ("stiff", "far-origin, scale-mix"),
            ("stiff --case shell --copies 2", "--copies"),
            ("stiff --case shell --instanced", "--instanced"),
            ("stiff --case shell --triangles 11M", "at most 10000000"),
            ("stiff --case empty", "S.bricks"),
            ("city --case shell", "stiff"),
        ] {
            assert!(refused(line).contains(says), "{line}: {}", refused(line));
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        let unknown = |words: [&str; 6]| Cli::try_parse_from(words).unwrap_err().to_string();
        assert!(unknown(["brickwalk", "scene", "stif", "-o", "s.glb", "--fast"]).contains("cornell, stiff"));
        assert!(unknown(["brickwalk", "scene", "stiff", "-o", "s.glb", "--case=luck"]).contains("slivers"));
    }

    #[test]
    fn impossible_counts_are_wrong_usage_and_write_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let name = folder.path().join("a.bricks");
        let error = scene(&format!("-o {} --triangles 3", name.display())).unwrap_err();
        assert!(error.is::<Usage>(), "{error:?}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        let error = scene(&format!("-o {} --triangles 12K", folder.path().display())).unwrap_err();
        assert!(error.to_string().contains("folder"), "{error}");
    }
}
