//! `convert`: scenes of common formats into one `.bricks` file.

use super::options::scene_args::{BuildArgs, ConvertArgs, MeshArgs, WorkArgs};
use super::{bake_displacement, interrupt};
use crate::cli::output::{Usage, note, warn};
use crate::output::atomic;
use crate::remote;
use crate::settings::Adapter;
use crate::settings::sizes::{counted, human_bytes, human_count};
use anyhow::{Context, Result, bail, ensure};
use bricks::one_line;
use brickwalk_convert::build::{BuildError, BuildSettings, BuildSummary, build_source};
use brickwalk_convert::import::{EXTENSIONS, ImportError, ImportSettings, Input, TILESET, import};
use brickwalk_convert::progress::Progress;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::time::Instant;
use tracing::info;

/// Deepest nesting of folders that is searched.
const MAX_DEPTH: u32 = 64;

/// Runs `convert`.
///
/// # Errors
/// An input cannot be read or is bad, or the output cannot be written; an old output then stays as it was.
pub fn run(args: &ConvertArgs) -> Result<()> {
    let start = Instant::now();
    let inputs = expand(&args.inputs.inputs)?;
    refuse_overwriting(&inputs, &args.output)?;
    check_output(&args.output, &["bricks"], args.build.work.scratch.as_deref())?;
    let progress = interrupt::job();
    let threads = args.build.work.threads.map(|n| n as usize);
    let beside = || args.output.parent().filter(|folder| !folder.as_os_str().is_empty()).map(Path::to_path_buf);
    let scratch = args.build.work.scratch.clone().or_else(beside);
    let movable = args.movable.clone();
    let importing = ImportSettings { threads, scratch, movable: movable.clone() };
    let building =
        BuildSettings { textures: args.textures, movable, ..mesh_settings(&args.mesh, build_settings(&args.build)) };
    let all = inputs.len();
    let mut job = Job { inputs, importing, building, output: &args.output, progress, skipped: Vec::new() };
    let summary = if args.skip_bad { job.without_bad() } else { job.run() }?;
    job.progress.finish();
    summarise(&args.output, &summary, start, &mut note)?;
    with_fields(&args.build, &args.output)?;
    match job.skipped.len() {
        0 => Ok(()),
        n => note(&format!("{}: {n} of {all} inputs skipped, which are bad\n", args.output.display())),
    }
}

/// A conversion.
struct Job<'a> {
    inputs: Vec<Input>,
    importing: ImportSettings,
    building: BuildSettings,
    output: &'a Path,
    progress: Progress,
    /// What was left out, and why.
    skipped: Vec<String>,
}

impl Job<'_> {
    fn run(&self) -> Result<BuildSummary> {
        let source = import(&self.inputs, &self.importing, &self.progress)?;
        usage(build_source(&source, &self.building, self.output, &self.progress))
    }

    /// The same without inputs that are bad, each of which is told with the reason.
    fn without_bad(&mut self) -> Result<BuildSummary> {
        // What shows as a file is opened is found of all at once; each of the others costs a conversion.
        for input in std::mem::take(&mut self.inputs) {
            match import(std::slice::from_ref(&input), &self.importing, &self.progress) {
                Err(ImportError::Interrupted(stop)) => return Err(stop.into()),
                Err(error) => self.skip(&error.into()),
                Ok(_) => self.inputs.push(input),
            }
        }
        loop {
            if self.inputs.is_empty() {
                let first = self.skipped.first().map_or("there is none", String::as_str);
                bail!("all inputs are bad; the first: {first}");
            }
            let error = match self.run() {
                Err(error) if !error.is::<Usage>() => error,
                built => return built,
            };
            let (before, says) = (self.inputs.len(), error.to_string());
            self.inputs.retain(|input| !says.starts_with(&format!("{}: ", input.path.display())));
            if self.inputs.len() == before {
                return Err(error);
            }
            self.skip(&error);
        }
    }

    fn skip(&mut self, error: &anyhow::Error) {
        let why = one_line(&super::chain(error));
        warn([format!("skipped {why}")]);
        self.skipped.push(why);
    }
}

/// The settings of the builder for everything that writes a scene file.
pub fn build_settings(args: &BuildArgs) -> BuildSettings {
    let settings = work_settings(&args.work);
    let brick_triangles = args.brick_triangles.unwrap_or(settings.brick_triangles);
    BuildSettings { brick_triangles, proxies: !args.no_proxies, lod: args.lod, resume: args.resume, ..settings }
}

/// The settings of the builder for everything that converts.
pub fn work_settings(args: &WorkArgs) -> BuildSettings {
    BuildSettings {
        threads: args.threads.map(|n| n as usize),
        lattice: args.lattice,
        memory_bytes: args.memory,
        fast: args.fast,
        scratch: args.scratch.clone(),
        ..BuildSettings::default()
    }
}

/// `settings` with those of the triangles and meshes of inputs.
pub fn mesh_settings(args: &MeshArgs, settings: BuildSettings) -> BuildSettings {
    BuildSettings {
        drop_non_finite: args.drop_non_finite,
        instance_min_triangles: args.instance_min_triangles,
        bake_budget_triangles: args.bake_budget,
        ..settings
    }
}

/// Makes a setting that only the builder can judge wrong usage.
///
/// # Errors
/// As of the builder.
pub fn usage(built: Result<BuildSummary, BuildError>) -> Result<BuildSummary> {
    built.map_err(|error| match error {
        BuildError::Setting { .. } => Usage(error.to_string()).into(),
        error => error.into(),
    })
}

/// Gives a scene file that was just written displacement fields, if they are asked for.
///
/// # Errors
/// As of [`bake_displacement::add`].
pub fn with_fields(args: &BuildArgs, scene: &Path) -> Result<()> {
    if !args.displacement {
        return Ok(());
    }
    let memory = args.work.memory.unwrap_or(bake_displacement::MEMORY);
    bake_displacement::add(scene, scene, &bake_displacement::MAKING, memory, &Adapter::Auto)
}

/// Says by `say` what a written scene holds, on standard error what its conversion warned of.
///
/// # Errors
/// The file cannot be opened, or standard output is closed.
pub fn summarise(
    path: &Path,
    summary: &BuildSummary,
    start: Instant,
    say: &mut dyn FnMut(&str) -> Result<()>,
) -> Result<()> {
    let scene = bricks::SceneFile::open(path)?;
    let resident = scene.resident();
    warn(&resident.manifest.warnings);
    let (stored, instanced) = (resident.manifest.triangles_stored, resident.manifest.triangles_instanced);
    say(&format!(
        "{}: {}{}, {}, {}, {:.1} s\n",
        path.display(),
        counted(stored, "triangle"),
        if instanced == stored { String::new() } else { format!(" ({} with instances)", human_count(instanced)) },
        counted(resident.bricks.len() as u64, "brick"),
        human_bytes(scene.file_bytes()),
        start.elapsed().as_secs_f64()
    ))?;
    if summary.levels > 0 {
        say(&format!(
            "{}: {} of detail, {}, {}, at most {:.3e} from the bricks\n",
            path.display(),
            counted(summary.levels, "level"),
            counted(summary.level_triangles, "triangle"),
            human_bytes(summary.bytes_levels),
            summary.level_bound
        ))?;
    }
    let phases = summary.phases.iter().map(|(phase, time)| format!("{phase} {:.1} s", time.as_secs_f64()));
    info!("{}: {}", path.display(), phases.collect::<Vec<_>>().join(", "));
    Ok(())
}

/// The files that the inputs name: a folder stands for its `tileset.json`, else for the scene files in it and below,
/// sorted bytewise by path.
///
/// # Errors
/// A folder cannot be read, or holds no scene file; an input is a URL.
pub fn expand(inputs: &[Input]) -> Result<Vec<Input>> {
    let mut files = Vec::new();
    for input in inputs {
        remote::refuse(&input.path, "a conversion")?;
        if !input.path.is_dir() {
            files.push(input.clone());
            continue;
        }
        let mut found = Vec::new();
        search(&input.path, 0, &mut found)?;
        ensure!(
            !found.is_empty(),
            "{}: there is no {} file in this folder; name the scene files themselves",
            input.path.display(),
            EXTENSIONS.map(|extension| format!(".{extension}")).join(", ")
        );
        found.sort_by(|a, b| a.as_os_str().as_encoded_bytes().cmp(b.as_os_str().as_encoded_bytes()));
        files.extend(found.into_iter().map(|path| Input { path, ..input.clone() }));
    }
    Ok(files)
}

fn search(folder: &Path, depth: u32, found: &mut Vec<PathBuf>) -> Result<()> {
    ensure!(depth < MAX_DEPTH, "{}: folders are nested too deeply; name the scene files themselves", folder.display());
    // The models below are its tiles.
    let tileset = folder.join(TILESET);
    if tileset.is_file() {
        found.push(tileset);
        return Ok(());
    }
    let context = || format!("{}: cannot read this folder; check its permissions", folder.display());
    for entry in std::fs::read_dir(folder).with_context(context)? {
        let entry = entry.with_context(context)?;
        let path = entry.path();
        // Links to folders are not followed, so that no circle of them is searched for ever.
        if entry.file_type().with_context(context)?.is_dir() {
            search(&path, depth + 1, found)?;
            continue;
        }
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        if extension.is_some_and(|e| EXTENSIONS.contains(&e.as_str())) {
            found.push(path);
        }
    }
    Ok(())
}

/// Refuses an output that is a folder.
///
/// # Errors
/// It is one.
pub fn refuse_folder(output: &Path) -> Result<()> {
    ensure!(!output.is_dir(), "{}: this is a folder; give -o the name of a file, as in scene.bricks", output.display());
    Ok(())
}

/// Refuses an output whose name promises something else than what is written, which is of one of these `endings`, and
/// folders that cannot be written to: before the work, and so that no input is blamed.
///
/// # Errors
/// The name to give; the folder at fault.
pub fn check_output(output: &Path, endings: &[&str], scratch: Option<&Path>) -> Result<()> {
    refuse_folder(output)?;
    let name = output.display();
    let is_known = |ending: &OsStr| endings.iter().any(|known| ending.eq_ignore_ascii_case(known));
    if !output.extension().is_some_and(is_known) {
        let kinds = endings.iter().map(|ending| format!(".{ending}")).collect::<Vec<_>>().join(", ");
        let right = output.with_extension(endings[0]);
        return Err(Usage(format!("{name}: what is written is {kinds}; name it {}", right.display())).into());
    }
    for (option, folder) in [("-o", Some(atomic::folder_of(output))), ("--scratch", scratch)] {
        let Some(folder) = folder else { continue };
        // Unnamed: nothing of it is left, whatever happens.
        tempfile::tempfile_in(folder).with_context(|| {
            format!("{name}: cannot write to the folder {}; make it, or name another with {option}", folder.display())
        })?;
    }
    Ok(())
}

/// Refuses an output that is an input or a folder.
fn refuse_overwriting(inputs: &[Input], output: &Path) -> Result<()> {
    refuse_folder(output)?;
    let Ok(target) = output.canonicalize() else { return Ok(()) };
    for input in inputs {
        if input.path.canonicalize().is_ok_and(|input| input == target) {
            bail!("{}: the output would overwrite this input; give -o another name", input.path.display());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_stand_for_their_scene_files_in_bytewise_order() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(at("sub/deep")).unwrap();
        std::fs::create_dir(at("empty")).unwrap();
        for name in ["b.gltf", "B.GLB", "a.glb", "notes.txt", "c.STL", "sub/c.glb", "sub/deep/a.gltf", "noextension"] {
            std::fs::write(at(name), b"").unwrap();
        }
        let mut inputs = [at("a.glb"), folder.path().into(), at("missing.gltf")].map(Input::from);
        inputs[1].metres = 0.5;
        let files = expand(&inputs).unwrap();
        let metres: Vec<_> = files.iter().map(|file| file.metres).collect();
        assert_eq!(metres, [1.0, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 1.0]);
        let files: Vec<_> = files.into_iter().map(|file| file.path).collect();
        let expected =
            ["a.glb", "B.GLB", "a.glb", "b.gltf", "c.STL", "sub/c.glb", "sub/deep/a.gltf", "missing.gltf"].map(at);
        assert_eq!(files, expected);
        let error = expand(&[at("empty").into()]).unwrap_err().to_string();
        assert!(error.contains("empty: there is no"), "{error}");
    }

    #[test]
    fn inputs_and_folders_are_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::write(at("a.glb"), b"").unwrap();
        std::fs::create_dir(at("sub")).unwrap();
        assert!(refuse_overwriting(&[at("a.glb").into()], &at("b.bricks")).is_ok());
        assert!(
            refuse_overwriting(&[at("a.glb").into()], &at("sub/../a.glb"))
                .unwrap_err()
                .to_string()
                .contains("overwrite")
        );
        assert!(refuse_overwriting(&[at("a.glb").into()], &at("sub")).unwrap_err().to_string().contains("folder"));
    }
}
