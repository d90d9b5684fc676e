//! `repair`: rebuilds the damaged bricks, levels of detail and textures of a `.bricks` file.
//!
//! Conversion is deterministic, so the same inputs and options make the same bytes. They are converted to a temporary
//! file, and of it only what is damaged is taken, and only if it has the checksum that the scene states. It is written
//! in place: nothing but bytes that are damaged already is ever overwritten, so a crash in between leaves the file no
//! worse, and no second copy of a large file is needed.

use super::convert::{expand, mesh_settings, usage, work_settings};
use super::options::scene_args::RepairArgs;
use super::{interrupt, verify};
use crate::cli::output::{Usage, note};
use crate::remote;
use crate::secondary::displacement::make::make_again;
use crate::session::trace::for_rays;
use crate::session::{Opened, Settings as Walk, open_scene};
use crate::settings::Adapter;
use crate::settings::sizes::{counted, human_bytes};
use anyhow::{Context, Result, anyhow, bail, ensure};
use bricks::ending::Temporary;
use bricks::layout::PAGE_BYTES;
use bricks::{DISPLACEMENT_BY_CPU, Error, Manifest, Part, Partial, Payload, SceneFile, VerifyReport, Writer};
use brickwalk_convert::build::{BuildError, BuildSettings, LatticeStep, TextureEncoding, build_source};
use brickwalk_convert::import::{ImportSettings, import};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{InMemory, Source};
use brickwalk_scenes::{Kind, Settings, Stiff, generate, stiff};
use std::collections::BTreeSet;
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Seek, SeekFrom, Write};
use std::path::Path;
use tempfile::TempDir;
use xxhash_rust::xxh3::xxh3_64;

/// Runs `repair`.
///
/// # Errors
/// More than bricks and textures is damaged, the inputs or options are not those of the conversion (nothing is changed
/// then), or the file cannot be written.
pub fn run(args: &RepairArgs) -> Result<()> {
    remote::refuse(&args.scene, "repair")?;
    let name = args.scene.display();
    let scene = SceneFile::open(&args.scene)?;
    let progress = interrupt::job();
    let damaged = damaged_payloads(&verify::watched(&progress, |progress| scene.verify(progress))?)?;
    // The conversion makes no fields.
    let (fields, damaged): (BTreeSet<Payload>, BTreeSet<Payload>) =
        damaged.into_iter().partition(|payload| matches!(payload, Payload::Displacement(_)));
    if damaged.is_empty() && fields.is_empty() {
        return note(&format!("{name}: OK, nothing to repair\n"));
    }
    // Before the long work, so that a file that cannot be written is found at once.
    let mut file = OpenOptions::new()
        .write(true)
        .open(&args.scene)
        .with_context(|| format!("{name}: cannot write this file; check its permissions"))?;

    let target = args.scene.canonicalize().unwrap_or_else(|_| args.scene.clone());
    // Until the end, so that no other process repairs it.
    let _reserved = reserve(&args.scene, &target)?;
    let mut bytes = 0;
    if !damaged.is_empty() {
        let scratch = scratch_folder(args.work.scratch.as_deref(), &target)?;
        let _noted = Temporary::note(scratch.path());
        let rebuilt = rebuild(args, &scene, scratch.path(), &progress)?;
        for &payload in &damaged {
            check(&scene, &rebuilt, payload)?;
        }
        for &payload in &damaged {
            bytes += replace(&scene, &rebuilt, payload, &mut file)?;
        }
    }
    bytes += remake_fields(args, &fields, &mut file)?;
    file.sync_all().with_context(|| format!("{name}: cannot sync this file to the disk; repair it again"))?;
    let parts: Vec<String> = damaged.iter().chain(&fields).map(|payload| scene.resident().name_of(*payload)).collect();
    note(&format!("{name}: repaired {} ({})\n", parts.join(", "), human_bytes(bytes)))
}

/// Makes damaged displacement fields anew, by the executor that traced them, from a scene whose other payloads are
/// whole; the bytes written.
fn remake_fields(args: &RepairArgs, fields: &BTreeSet<Payload>, file: &mut File) -> Result<u64> {
    let scene = open_scene(&args.scene)?;
    let mut bytes = 0;
    for (&payload, record) in fields.iter().filter_map(|payload| match payload {
        Payload::Displacement(number) => Some((payload, scene.resident().displacement[*number as usize])),
        _ => None,
    }) {
        let adapter = if record.executor == DISPLACEMENT_BY_CPU { Adapter::Cpu } else { Adapter::Auto };
        let settings = for_rays(&Walk { adapter, ..Walk::exact() });
        let packed = make_again(&mut Opened::open(scene.clone(), &args.scene, &settings)?.bench(), &record)?;
        ensure!(
            (packed.len() as u64, xxh3_64(&packed)) == (record.span.bytes, record.span.checksum),
            "{}: the rebuilt {payload} differs from the original, which another device or version has made; nothing \
             of it was changed; make all anew with brickwalk bake-displacement",
            args.scene.display()
        );
        write_payload(&scene, payload, packed, file)?;
        bytes += record.span.bytes;
    }
    Ok(bytes)
}

/// Reserves the repair of the scene for this process, by a file beside it that goes with the last process.
fn reserve(scene: &Path, target: &Path) -> Result<Partial> {
    let mut name = target.file_name().unwrap_or_default().to_owned();
    name.push(".repair");
    Writer::reserve(target.with_file_name(name)).map_err(|error| match error {
        Error::Io { source, .. } if source.kind() == ErrorKind::ResourceBusy => {
            anyhow!("{}: another process is repairing this file; wait for it", scene.display())
        }
        error => error.into(),
    })
}

/// The folder for what is rebuilt: beside the scene, or in `asked`. Its name is always the same for a scene, so that
/// what a process left that was killed is removed by the next.
fn scratch_folder(asked: Option<&Path>, target: &Path) -> Result<TempDir> {
    let folder = asked.or_else(|| target.parent()).unwrap_or(Path::new("."));
    let context = || format!("{}: cannot create a scratch folder; choose another with --scratch", folder.display());
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    let name = format!(".{name}.{:016x}.repair", xxh3_64(target.as_os_str().as_encoded_bytes()));
    match std::fs::remove_dir_all(folder.join(&name)) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(error).with_context(context),
        _ => {}
    }
    tempfile::Builder::new().prefix(&name).rand_bytes(0).tempdir_in(folder).with_context(context)
}

/// The payloads with problems that writing them again solves: of bricks, textures, displacement fields.
fn damaged_payloads(report: &VerifyReport) -> Result<BTreeSet<Payload>> {
    let payload = |problem: &Error| match (problem.cause(), problem.part()) {
        (
            Error::Corrupt { .. } | Error::Padding { .. } | Error::Io { .. },
            Some(Part::Payload(payload) | Part::PaddingAfterPayload(payload)),
        ) => Ok(payload),
        _ => Err(anyhow!("{problem}; only bricks and textures can be repaired")),
    };
    report.problems.iter().map(payload).collect()
}

/// Repeats the conversion into a file in `scratch`.
fn rebuild(args: &RepairArgs, scene: &SceneFile, scratch: &Path, progress: &Progress) -> Result<SceneFile> {
    let manifest = &scene.resident().manifest;
    let source = source(args, scene, scratch, progress)?;
    same_sources(scene, &source.outline().sources)?;
    let of_case = || stiff_scene(manifest).and_then(|(kind, ..)| kind.lattice_log2()).map(LatticeStep::Log2);
    let settings = BuildSettings {
        brick_triangles: manifest.brick_triangles,
        lattice: args.work.lattice.or_else(of_case),
        proxies: manifest.has_proxies,
        lod: !scene.resident().levels.is_empty(),
        movable: manifest.movable.clone(),
        textures: match scene.resident().textures.first() {
            Some(texture) if texture.encoding == bricks::TEXTURE_RGBA8 => TextureEncoding::Raw,
            _ => TextureEncoding::Bc7,
        },
        // Beside the output, which is in a folder of its own.
        scratch: None,
        ..mesh_settings(&args.mesh, work_settings(&args.work))
    };
    let output = scratch.join("rebuilt.bricks");
    let built = build_source(&*source, &settings, &output, progress);
    progress.finish();
    if let Err(BuildError::Interrupted(_) | BuildError::Paused { .. }) = built {
        bail!("{}: interrupted; nothing was changed", scene.path().display());
    }
    usage(built)?;
    Ok(SceneFile::open(output)?)
}

/// What the scene was made from: the inputs that were given, else what its manifest says of a generated scene.
fn source(args: &RepairArgs, scene: &SceneFile, scratch: &Path, progress: &Progress) -> Result<Box<dyn Source>> {
    if !args.inputs.inputs.is_empty() {
        let threads = args.work.threads.map(|n| n as usize);
        let movable = scene.resident().manifest.movable.clone();
        let settings = ImportSettings { threads, scratch: Some(scratch.to_owned()), movable };
        return Ok(Box::new(import(&expand(&args.inputs.inputs)?, &settings, progress)?));
    }
    if let Some((kind, n, seed)) = stiff_scene(&scene.resident().manifest) {
        return Ok(Box::new(InMemory::from(stiff(kind, n, seed))));
    }
    let settings = generated(&scene.resident().manifest).ok_or_else(|| {
        let name = scene.path().display();
        Usage(format!("{name}: not a generated scene; give the inputs of its conversion with --from"))
    })?;
    Ok(Box::new(generate(&settings, progress)?))
}

/// What a stiff scene was made from.
fn stiff_scene(manifest: &Manifest) -> Option<(Stiff, u32, u64)> {
    let [source] = &manifest.sources[..] else { return None };
    Stiff::of_source(&source.name).filter(|_| source.bytes == 0)
}

/// The settings of a generated scene. Its name does not tell whether trees and vehicles are instances, but the file
/// does.
fn generated(manifest: &Manifest) -> Option<Settings> {
    let [source] = &manifest.sources[..] else { return None };
    let settings = Settings::of_source(&source.name).filter(|_| source.bytes == 0)?;
    // Copies are instances themselves.
    let instanced = settings.kind == Kind::City && settings.copies == 1 && manifest.has_instances;
    Some(Settings { instanced, ..settings })
}

/// Refuses inputs that are not those of the conversion. Their names do not matter.
fn same_sources(scene: &SceneFile, given: &[bricks::Source]) -> Result<()> {
    let name = scene.path().display();
    let made_from = &scene.resident().manifest.sources;
    ensure!(
        given.len() == made_from.len(),
        "{name}: converted from {}, but --from gives {}; give all of them, in order",
        counted(made_from.len() as u64, "file"),
        given.len()
    );
    for (given, made_from) in given.iter().zip(made_from) {
        // What a generated scene is made from is in its name alone.
        let same_name = made_from.bytes > 0 || given.name == made_from.name;
        ensure!(
            same_name && (given.bytes, &given.hash) == (made_from.bytes, &made_from.hash),
            "{name}: input {} has changed: found {} bytes with checksum {}, expected {} of {} bytes with checksum {}; \
             give the original file",
            given.name,
            given.bytes,
            given.hash,
            made_from.name,
            made_from.bytes,
            made_from.hash
        );
    }
    Ok(())
}

/// Refuses a rebuilt payload that is not what was once written.
fn check(scene: &SceneFile, rebuilt: &SceneFile, payload: Payload) -> Result<()> {
    let facts = |scene: &SceneFile| scene.resident().span(payload).map(|span| (span.bytes, span.checksum));
    if facts(scene) == facts(rebuilt) {
        return Ok(());
    }
    let (file, name) = (scene.path().display(), scene.resident().name_of(payload));
    ensure!(
        scene.resident().level_of(payload).is_none() || !rebuilt.resident().levels.is_empty(),
        "{file}: {name} cannot be rebuilt, as the conversion made no levels of detail; nothing was changed; convert again"
    );
    let (was, is) = (&scene.resident().manifest.generator, &rebuilt.resident().manifest.generator);
    let remedy = match was == is {
        true => "give the options of the conversion, and check buffers and images beside the inputs".into(),
        false => format!("the file was written by {was}, this is {is}; use that version, or convert again"),
    };
    bail!("{file}: the rebuilt {name} differs from the original; nothing was changed; {remedy}")
}

/// Writes a rebuilt payload and the zeros after it; returns its length.
fn replace(scene: &SceneFile, rebuilt: &SceneFile, payload: Payload, file: &mut File) -> Result<u64> {
    let mut bytes = vec![0; scene.span(payload).bytes as usize];
    rebuilt.copy_stored(payload, &mut bytes)?;
    write_payload(scene, payload, bytes, file)
}

/// Writes a payload and the zeros after it; returns its length.
fn write_payload(scene: &SceneFile, payload: Payload, mut bytes: Vec<u8>, file: &mut File) -> Result<u64> {
    let span = scene.span(payload);
    bytes.resize(span.bytes.next_multiple_of(PAGE_BYTES) as usize, 0);
    let written = file.seek(SeekFrom::Start(span.offset)).and_then(|_| file.write_all(&bytes));
    written.with_context(|| format!("{}: cannot write {payload}; repair it again", scene.path().display()))?;
    Ok(span.bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::{Flaw, Section};

    fn report(problems: Vec<Error>) -> VerifyReport {
        VerifyReport { file_bytes: 9, payloads: 3, problems }
    }

    #[test]
    fn only_damaged_payloads_can_be_repaired() {
        let corrupt = |part| Error::Corrupt { path: "s.bricks".into(), part, found: 1, expected: 2 };
        let (one, two) = (Payload::Attributes(4), Payload::Texture(1));
        let parts = [Part::Payload(two), Part::PaddingAfterPayload(one), Part::Payload(one)];
        let damaged = damaged_payloads(&report(parts.map(corrupt).into())).unwrap();
        assert_eq!(damaged.into_iter().collect::<Vec<_>>(), [one, two]);
        for part in [Part::Header, Part::Section(Section::Bricks), Part::PaddingAfterDirectory] {
            let error = damaged_payloads(&report(vec![corrupt(Part::Payload(one)), corrupt(part)])).unwrap_err();
            assert!(error.to_string().contains("convert again"), "{error}");
        }
        // The bytes are those that were written: writing them again would change nothing.
        let flaw = Flaw { part: Part::Payload(one), found: "x".into(), expected: "y".into() };
        assert!(damaged_payloads(&report(vec![Error::Invalid { path: "s.bricks".into(), flaw }])).is_err());
    }

    #[test]
    fn generated_scenes_are_known_by_their_source() {
        let manifest = |name: &str, bytes, has_instances| Manifest {
            sources: vec![bricks::Source { name: name.into(), bytes, hash: String::new() }],
            has_instances,
            ..Manifest::default()
        };
        let settings = generated(&manifest("city seed=7 triangles=12000", 0, true)).unwrap();
        assert_eq!(settings, Settings { kind: Kind::City, triangles: 12_000, seed: 7, instanced: true, copies: 1 });
        assert!(!generated(&manifest("terrain seed=7 triangles=12000", 0, true)).unwrap().instanced);
        assert_eq!(generated(&manifest("city seed=7 triangles=12000", 5, true)), None);
        assert_eq!(generated(&manifest("city.gltf", 0, true)), None);
    }
}
