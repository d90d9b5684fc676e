//! `brickwalk walk`: frames along a camera path, with records, a summary and a report.

use super::dvf;
use super::left_out;
use super::motion::WalkMotion;
use super::options::args::{Secondary, WalkArgs};
use super::pictures::Pictures;
use super::summary;
use crate::counters::Record;
use crate::frame::{
    Accumulation, BATCH_SAMPLES, Captures, Engine, Light, Methods, Moved, RenderError, RenderSettings, Renderer,
    Schedule,
};
use crate::kernels::Extent;
use crate::output::atomic;
use crate::picture::denoise::Resolve;
use crate::scene::path::{CameraPath, path_from_bounds};
use crate::schedule::Tracing;
use crate::schedule::auto::Auto;
use crate::schedule::fronts::Fronts;
use crate::secondary::df::answer::Df;
use crate::secondary::roma::LEAST_CELLS;
use crate::secondary::roma::answer::Roma;
use crate::session::lighting::lighting;
use crate::session::open::{Session, open_scene, write_requests};
use anyhow::{Context, Result, bail};
use bricks::SceneFile;
use brickwalk_convert::progress::Progress;
use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Runs the command.
///
/// # Errors
/// Bad scene, path, cache or output folder; a damaged brick; the device's.
pub fn run(args: &WalkArgs) -> Result<()> {
    let scene = open_scene(&args.scene)?;
    let manifest = &scene.resident().manifest;
    let has_occupancy = scene.resident().bricks.is_empty() || !scene.resident().occupancy.is_empty();
    if !matches!(args.secondary, Secondary::Exact | Secondary::Dvf) && !has_occupancy {
        let (name, secondary) = (args.scene.display(), args.secondary.name());
        bail!(
            "{name}: --secondary {secondary} needs the occupancy of bricks; convert the scene again without --no-proxies"
        );
    }
    let mut path = match &args.path {
        Some(file) => CameraPath::read(file)?,
        None => path_from_bounds(manifest.min, manifest.max),
    };
    if let Some(fov) = args.fov {
        path = path.with_fov_y_degrees(fov)?;
    }
    let extent = Extent { width: args.size.width, height: args.size.height, tile: args.stream.tile };
    let lighting = lighting(args, &scene)?;
    for warning in &lighting.warnings {
        let _ = writeln!(std::io::stderr(), "brickwalk: warning: {}", super::one_line(warning));
    }
    let motion = args.motion.as_ref().map(|file| WalkMotion::open(file, &scene, &lighting.sources)).transpose()?;
    let session = Session::open(scene.clone(), &args.scene, &args.stream, extent)?;
    let mut reference =
        if args.measure_error { Some(reference(scene.clone(), args, lighting.light.clone(), extent)?) } else { None };
    let frames_folder = args.output.join("frames");
    atomic::create_folder(&frames_folder)?;
    for stale in ["summary.json", "report.html"] {
        // What is left of an earlier walk must not be taken for a part of this one.
        let _ = std::fs::remove_file(args.output.join(stale));
    }
    let mut renderer = lit_renderer(session, args, lighting.light.clone());
    renderer.captures = args.measure_error.then(Captures::default);
    let note = match args.secondary {
        Secondary::Dvf => dvf::prepare(&mut renderer, args, &path)?,
        _ => None,
    };
    let mut resolve = Resolve::new(args.pictures.denoise, args.pictures.taa);
    let mut pictures = Pictures::create(&frames_folder, args)?;
    let mut lines = atomic::JsonLines::create(&args.output.join("records.jsonl"))?;
    let progress = Progress::new();
    // A frame of many samples takes long: the samples are counted then.
    let counts_samples = args.spp > BATCH_SAMPLES;
    match counts_samples {
        true => progress.phase("samples", u64::from(args.frames) * u64::from(args.spp)),
        false => progress.phase("frames", args.frames.into()),
    }
    let stop = super::interrupt::flag();
    let mut records = Vec::new();
    let mut finished = 0;
    // What the first frame shows, to be rendered once more.
    let mut first = None;
    for frame in 0..args.frames {
        if stop.load(Ordering::Relaxed) {
            break;
        }
        let camera = path.frame(frame, args.frames);
        if let Some(motion) = &motion {
            let time = path.time(frame, args.frames);
            motion.place(&mut renderer, time)?;
            if let Some(reference) = &mut reference {
                motion.place(reference, time)?;
            }
        }
        if frame == 0 && args.measure_left_out {
            first = Some((renderer.scene.clone(), renderer.light.clone()));
        }
        let mut told = 0;
        let mut watch = |samples: u32, so_far: &Accumulation| {
            if counts_samples {
                progress.advance(u64::from(samples - told));
                told = samples;
            }
            if args.progressive && samples < args.spp && samples.is_power_of_two() {
                // A preview that cannot be written is no reason to end the walk.
                let _ = pictures.preview(&so_far.mean());
            }
            samples == args.spp || !stop.load(Ordering::Relaxed)
        };
        let mut output = match renderer.frame_watched(frame, &camera, &mut watch) {
            Err(RenderError::Interrupted) => break,
            output => output.with_context(|| args.scene.display().to_string())?,
        };
        if frame == 0 {
            warn_of_short_rays(&renderer);
            warn_of_dark_lamps(&renderer);
        }
        if let Some(reference) = &mut reference {
            reference.frame(frame, &camera).with_context(|| args.scene.display().to_string())?;
            note_errors(&mut output.records, &renderer, reference);
        }
        resolve.frame(&mut output);
        pictures.frame(frame, path.frame_time(args.frames), &output.pixels)?;
        for record in output.records {
            let line = lines.push(&record)?;
            if args.json {
                super::print(&line)?;
            }
            records.push(record);
        }
        finished += 1;
        progress.advance(u64::from(!counts_samples));
    }
    progress.finish();
    pictures.finish(args.json)?;
    let left_out = left_out::left_out(&mut renderer);
    let measured = match &first {
        Some((scene, light)) => left_out::measure(&left_out, scene, args, light, &path.frame(0, args.frames))?,
        None => Vec::new(),
    };
    let left_out = left_out::listed(&left_out, &measured);
    let visibility = note.map(|note| note.report(&renderer, args, &records));
    let mut summary =
        summary::of_walk(args, &mut renderer, (&pictures, &lighting, &resolve), &records, finished, left_out);
    summary["settings"]["dvf"] = visibility.into();
    finish(args, &renderer, &summary)?;
    if finished < args.frames {
        bail!("interrupted after {finished} of {} frames; {} holds what is done", args.frames, args.output.display());
    }
    let non_finite: u64 = records.iter().map(|r| r.non_finite).sum();
    if non_finite > 0 {
        bail!("{non_finite} pixels were not finite; this is a defect, see records.jsonl for the frames");
    }
    Ok(())
}

/// The renderer that the options of a walk ask for.
///
/// # Errors
/// Those of [`lighting`].
pub fn renderer(session: Session, args: &WalkArgs) -> Result<Renderer> {
    let light = lighting(args, &session.scene)?.light;
    Ok(lit_renderer(session, args, light))
}

/// The same with this light.
pub fn lit_renderer(session: Session, args: &WalkArgs, light: Light) -> Renderer {
    let Session { scene, mut executor, cache, schedule } = session;
    if args.effects.effects().has_bounces() {
        executor.allow_bounces();
    }
    let settings = settings(args, schedule);
    let fronts = (args.stream.fronts == "on").then(Fronts::default);
    let size = (args.size.width, args.size.height);
    let engine = Engine {
        scene,
        executor,
        cache,
        settings,
        light,
        size,
        tile: args.stream.tile,
        fronts,
        auto: Auto::default(),
        captures: None,
        moved: Moved::default(),
    };
    Renderer { engine, methods: methods(args) }
}

/// The methods that answer secondary rays by the options of a walk; a field of visibility is made or read later.
pub fn methods(args: &WalkArgs) -> Methods {
    let mut methods = Methods::default();
    match args.secondary {
        Secondary::Roma | Secondary::Auto => {
            methods.set(Roma::new(args.roma.settings(args.secondary == Secondary::Auto), args.roma.source()));
        }
        Secondary::Df => methods.set(Df::new(args.df.settings(), args.roma.source())),
        Secondary::Exact | Secondary::Dvf => {}
    }
    methods
}

/// Side of the finest base map of a method that has some, world units.
pub fn finest_cell(methods: &Methods) -> Option<f64> {
    let roma = methods.get::<Roma>().and_then(|roma| roma.base.finest_cell());
    roma.or_else(|| methods.get::<Df>().and_then(|df| df.base.finest_cell()))
}

/// Says that rays of ao are too short for the cells that they are to meet.
fn warn_of_short_rays(renderer: &Renderer) {
    let length = renderer.settings.effects.occlusion.map_or(f64::INFINITY, |occlusion| occlusion.length);
    if let Some(cell) = finest_cell(&renderer.methods).filter(|cell| length < LEAST_CELLS * cell) {
        let _ = writeln!(
            std::io::stderr(),
            "brickwalk: warning: --ao-length {length} is less than {LEAST_CELLS} cells of {cell}, the least that the scene's occupancy has here: \
             ao is coarse; make it longer, or use --secondary exact"
        );
    }
}

/// Says which lamps do not light what diffuse rays meet.
fn warn_of_dark_lamps(renderer: &Renderer) {
    let Some(roma) = renderer.methods.get::<Roma>() else { return };
    let [others, areas] = roma.rsm.left_out();
    if others > 0 {
        let _ = writeln!(
            std::io::stderr(),
            "brickwalk: warning: what {others} weaker points, spots and distant lights light does not light diffuse rays; raise --rsm-lamps"
        );
    }
    if areas > 0 {
        let _ = writeln!(
            std::io::stderr(),
            "brickwalk: warning: what {areas} areas and surfaces that shine light does not light diffuse rays by --secondary roma; use              --secondary exact for it"
        );
    }
}

/// A renderer of the same frames, exactly, with a cache and a device session of its own.
fn reference(scene: Arc<SceneFile>, args: &WalkArgs, light: Light, extent: Extent) -> Result<Renderer> {
    let mut args = args.clone();
    args.stream.query_threshold = 0;
    args.stream.requests_out = None;
    args.secondary = Secondary::Exact;
    args.interactive = None;
    args.measure_needed = false;
    args.aov = false;
    let session = Session::open(scene, &args.scene, &args.stream, extent)?;
    let mut reference = lit_renderer(session, &args, light);
    reference.captures = Some(Captures::default());
    Ok(reference)
}

/// Enters how far the effects of the frame just rendered are from the `reference`'s.
fn note_errors(records: &mut [Record], renderer: &Renderer, reference: &Renderer) {
    let (Some(captures), Some(exact)) = (&renderer.captures, &reference.captures) else { return };
    for record in records {
        let samples = renderer.settings.samples;
        let error = captures.error(exact, record.pass, renderer.size.0, renderer.tile, samples);
        record.error_mean = error.mean;
        record.error_worst_tile = error.worst_tile;
        record.error_pixels = error.pixels;
    }
}

/// How frames are rendered by the options of a walk.
pub fn settings(args: &WalkArgs, schedule: Schedule) -> RenderSettings {
    RenderSettings {
        schedule,
        effects: args.effects.effects(),
        samples: args.spp,
        // Both halves of the seed count.
        seed: (args.seed ^ (args.seed >> 32)) as u32,
        tracing: Tracing { measure_needed: args.measure_needed, optimisations: args.optimisations.optimisations() },
        aov: args.aov,
        guides: args.pictures.denoise || args.pictures.taa,
        taa: args.pictures.taa,
        tile_bytes: args.interactive,
    }
}

fn finish(args: &WalkArgs, renderer: &Renderer, summary: &serde_json::Value) -> Result<()> {
    let text = serde_json::to_string_pretty(summary)? + "\n";
    atomic::write(&args.output.join("summary.json"), text.as_bytes())?;
    write_requests(&args.stream, &renderer.cache)?;
    brickwalk_report::write(&args.output, &summary::fields())?;
    Ok(())
}
