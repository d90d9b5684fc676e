//! `scene`: generated scenes, and camera paths through them.

use super::Usage;
use super::args::SceneArgs;
use super::convert::{build_settings, refuse_folder, summarise, usage};
use super::interrupt;
use anyhow::{Context, Result};
use brickwalk_convert::build::build_source;
use brickwalk_scenes::{Error, Settings, generate, write_paths};
use std::time::Instant;

/// Runs `scene`.
///
/// # Errors
/// A count of triangles that the kind cannot have, or a file cannot be written.
pub fn run(args: &SceneArgs) -> Result<()> {
    let start = Instant::now();
    let settings = Settings { kind: args.kind, triangles: args.triangles, seed: args.seed, instanced: args.instanced };
    let progress = interrupt::job();
    refuse_folder(&args.output)?;
    let (paths, summary) = in_pool(args.build.work.threads, || -> Result<_> {
        let scene = generate(&settings, &progress).map_err(|error| match error {
            // The count is an option's value, known only here.
            Error::Triangles { .. } => Usage(format!("--triangles: {error}")).into(),
            error => anyhow::Error::new(error),
        })?;
        let summary = usage(build_source(&scene, &build_settings(&args.build), &args.output, &progress))?;
        Ok((write_paths(&scene, &args.output)?, summary))
    })??;
    progress.finish();
    summarise(&args.output, &summary, start)?;
    for path in paths {
        super::print(&format!("{}: a camera path\n", path.display()))?;
    }
    Ok(())
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
