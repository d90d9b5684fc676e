//! `scene`: generated scenes, and camera paths through them.

use super::Usage;
use super::args::{BuildArgs, SceneArgs};
use super::convert::{build_settings, refuse_folder, summarise, usage};
use super::interrupt;
use super::sizes::human_count;
use anyhow::{Context, Result};
use brickwalk_convert::build::{BuildSummary, build_source};
use brickwalk_scenes::{Error, GltfForm, Settings, generate, write_gltf, write_paths};
use std::time::Instant;

/// Runs `scene`.
///
/// # Errors
/// A count of triangles that the kind cannot have, or a file cannot be written.
pub fn run(args: &SceneArgs) -> Result<()> {
    let start = Instant::now();
    let settings = Settings {
        kind: args.kind,
        triangles: args.triangles,
        seed: args.seed,
        instanced: args.instanced,
        copies: args.copies,
    };
    let progress = interrupt::job();
    refuse_folder(&args.output)?;
    let gltf = GltfForm::of(&args.output);
    if gltf.is_some() {
        refuse_building(&args.build)?;
    }
    let (paths, summary) = in_pool(args.build.work.threads, || -> Result<_> {
        let scene = generate(&settings, &progress).map_err(|error| match error {
            // The count is an option's value, known only here.
            Error::Triangles { .. } => Usage(format!("--triangles: {error}")).into(),
            error => anyhow::Error::new(error),
        })?;
        let summary = match gltf {
            Some(form) => {
                write_gltf(&scene, &args.output, form, &progress)?;
                Written::Gltf { triangles: scene.placed_triangles() }
            }
            None => {
                let settings = build_settings(&args.build);
                Written::Bricks(usage(build_source(&scene, &settings, &args.output, &progress))?)
            }
        };
        Ok((write_paths(&scene, &args.output)?, summary))
    })??;
    progress.finish();
    match summary {
        Written::Bricks(summary) => summarise(&args.output, &summary, start)?,
        Written::Gltf { triangles } => super::print(&format!(
            "{}: {} triangles with instances, {:.1} s\n",
            args.output.display(),
            human_count(triangles),
            start.elapsed().as_secs_f64()
        ))?,
    }
    for path in paths {
        super::print(&format!("{}: a camera path\n", path.display()))?;
    }
    Ok(())
}

/// What became of a scene.
enum Written {
    Bricks(BuildSummary),
    Gltf { triangles: u64 },
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
    ];
    match given.into_iter().find(|(_, is_given)| *is_given) {
        Some((option, _)) => {
            Err(Usage(format!("{option}: this is for .bricks files; glTF is written as it is generated")).into())
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
        .with_context(|| format!("cannot start {threads} threads; give --threads a smaller number"))?;
    Ok(pool.install(work))
}

#[cfg(test)]
mod tests {
    use super::super::args::{Cli, Command};
    use super::*;
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
        let read = |name: &str| std::fs::read(at(name)).unwrap();
        assert!(read("a.glb").starts_with(b"glTF") && read("a.glb") == read("b.GLB"));
        assert!(read("c.gltf").starts_with(b"{") && read("a.glb").ends_with(&read("c.bin")));
        for name in ["a.near.json", "b.far.json", "c.near.json"] {
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
        ];
        for option in options_of_building {
            let error = scene(&options("d.glb", option)).unwrap_err();
            assert!(error.is::<Usage>() && error.to_string().contains(".bricks"), "{option}: {error:?}");
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), before);
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
