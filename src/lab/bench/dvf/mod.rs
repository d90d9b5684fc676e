//! `brickwalk bench dvf`: the experiments of Günay and Akyüz 2025 in ratios and errors: how many rays to the
//! environment are left to be traced with a field of visibility, and how far pictures by it are from those of the same
//! rays without.
//!
//! Each finished measurement is a line of `rows.jsonl`, from which alone tables and pages are made.

pub mod args;
mod flicker;
mod output;
mod plots;

use super::args::wanted;
use super::runner::Runner;
use super::scenes;
use super::store::{Header, Row, Rows, Values, median};
use crate::frame::Renderer;
use crate::lab::console::Console;
use crate::metrics::{Image, PIXELS_PER_DEGREE, flip_ldr, pixel_errors};
use crate::output::atomic;
use crate::scene::Camera;
use crate::scene::framing::path_from_bounds;
use crate::scene::path::CameraPath;
use crate::secondary::dvf::{Dvf, DvfMade, EFFECT as DVF_EFFECT, Options, Region, RegionKind, prepare};
use crate::session::Settings;
use crate::session::opened::open_scene;
use crate::settings::{CacheSize, Effect, EffectList, Environment};
use anyhow::{Context, Result};
use args::{DvfBenchArgs, Measurement, Stage};
use brickwalk_convert::progress::Progress;
use brickwalk_scenes::{Kind, Settings as Generated};
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;

/// Raised when a value changes its meaning.
const FORMAT: u32 = 3;

/// The box's name.
const BOX: &str = "cornell";

/// Its triangles, and those of a brick, so that shares of the cache hold several.
const BOX_SIZE: [u32; 2] = [10_000, 100];

/// A scene with its path.
struct Place {
    name: String,
    scene: PathBuf,
    camera: Camera,
    /// How something in it moves.
    motion: Option<PathBuf>,
}

/// A picture, and what its rays to the environment were.
struct Picture {
    image: Image,
    /// Ids of the triangles that are seen.
    ids: Vec<u32>,
    traced: f64,
    answered: f64,
    /// Rays by which cells of the field were made anew, and these cells.
    renewal: [f64; 2],
    ms: f64,
}

/// Pictures of a scene.
struct View<'a> {
    place: &'a Place,
    args: &'a DvfBenchArgs,
    console: Console<'a>,
    renderer: Renderer,
    /// Without a field.
    exact: Picture,
    /// Of the scene in motion, once it was asked for: by exact rays, and by those of the paper's mode.
    truth: [Option<flicker::Truth>; 2],
}

/// Runs the command.
///
/// # Errors
/// The folder holds other measurements or cannot be written; a scene cannot be read; the device's.
pub fn run(args: &DvfBenchArgs, console: Console) -> Result<()> {
    let console = console.within(args.minutes);
    atomic::create_folder(&args.output)?;
    let places = places(args, console)?;
    let names: Vec<&str> = places.iter().map(|place| place.name.as_str()).collect();
    let own = json!({
        "scenes": names,
        "size": args.size.to_string(),
        "samples": args.samples,
        "points": args.points,
        "rays": args.rays,
        "repeat": args.repeat,
        "environment": args.environment.as_ref().map(|file| file.display().to_string()),
    });
    let mut rows = Rows::open(args.output.join("rows.jsonl"), Header::new(FORMAT, &args.adapter, own)?, false)?;
    let mut runner = Runner::new(console);
    let stages = wanted(Stage::ALL, &args.stages);
    let jobs: Vec<(&Place, Stage, Measurement)> = places
        .iter()
        .flat_map(|place| stages.iter().map(move |&stage| (place, stage)))
        .filter(|(place, stage)| *stage != Stage::Flicker || place.motion.is_some())
        .flat_map(|(place, stage)| args.measurements(stage).into_iter().map(move |own| (place, stage, own)))
        .collect();
    let name = |(place, stage, own): &(&Place, Stage, Measurement)| key(&place.name, *stage, &own.to_string());
    let mut view: Option<View> = None;
    runner.measure(
        &mut rows,
        &jobs,
        |job| vec![name(job)],
        |job| {
            let (place, stage, own) = job;
            let values = if *stage == Stage::Memory {
                memory(place, args, &own.options, console)?
            } else {
                let of_place = view.take().filter(|view| std::ptr::eq(view.place, *place));
                let open = match of_place {
                    Some(view) => view,
                    None => View::open(place, args, CacheSize::Percent(100.0), console)?,
                };
                let open = view.insert(open);
                match stage {
                    Stage::Flicker => flicker::measure(open, own)?,
                    _ => open.measure(*stage, &own.options)?.0,
                }
            };
            Ok(vec![Row { key: name(job), values }])
        },
    )?;
    let text = output::write(args, &names, &rows, jobs.len())?;
    runner.end(&args.output, &text)
}

/// The name of a measurement.
fn key(scene: &str, stage: Stage, options: &str) -> String {
    format!("{scene}, {}: {options}", stage.name())
}

/// The scenes, and the box, which is built if it is not there.
fn places(args: &DvfBenchArgs, console: Console) -> Result<Vec<Place>> {
    let mut places = Vec::new();
    for (i, scene) in args.scenes.0.iter().enumerate() {
        let file = open_scene(scene)?;
        let near = scene.with_extension("near.json");
        let path = match args.paths.get(i) {
            Some(path) => CameraPath::read(path)?,
            None if near.exists() => CameraPath::read(&near)?,
            None => path_from_bounds(file.resident().manifest.min, file.resident().manifest.max),
        };
        let name = scene.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        places.push(Place::of(name, scene.clone(), path.frame(0, 1)));
    }
    let scene = args.output.join(format!("{BOX}.bricks"));
    let near = scene.with_extension("near.json");
    // Paths are written after the scene.
    if !scene.with_extension("motion.json").exists() || open_scene(&scene).is_err() {
        let [triangles, brick_triangles] = BOX_SIZE;
        let cornell = Generated { kind: Kind::Cornell, triangles: triangles.into(), ..Generated::default() };
        scenes::make(&cornell, brick_triangles, &scene, console)?;
    }
    places.push(Place::of(BOX.into(), scene, CameraPath::read(&near)?.frame(0, 1)));
    Ok(places)
}

impl Place {
    fn of(name: String, scene: PathBuf, camera: Camera) -> Self {
        let motion = Some(scene.with_extension("motion.json")).filter(|motion| motion.exists());
        Self { name, scene, camera, motion }
    }
}

impl<'a> View<'a> {
    fn open(place: &'a Place, args: &'a DvfBenchArgs, cache: CacheSize, console: Console<'a>) -> Result<Self> {
        let settings = Settings {
            size: args.size,
            tile: 16,
            spp: args.samples,
            sun_intensity: Some(0.0),
            effects: EffectList::of(&[Effect::Environment]),
            environment: args.environment.clone().map(Environment::File),
            aov: true,
            cache,
            adapter: args.adapter.clone(),
            ..Settings::exact()
        };
        let renderer = scenes::open(&place.scene, &settings)?;
        let image = Image { width: 0, height: 0, rgb: Vec::new() };
        let nothing = Picture { image, ids: Vec::new(), traced: 0.0, answered: 0.0, renewal: [0.0; 2], ms: 0.0 };
        let mut view = Self { place, args, console, renderer, exact: nothing, truth: [None, None] };
        view.exact = view.picture(0)?;
        Ok(view)
    }

    /// A picture; `frame` says by which rays.
    fn picture(&mut self, frame: u32) -> Result<Picture> {
        self.console.go_on()?;
        let output =
            self.renderer.frame(frame, &self.place.camera).with_context(|| self.place.scene.display().to_string())?;
        let record = output.records.iter().find(|record| record.pass == "environment");
        let record = record.context("no rays lead to the environment")?;
        let renewal = output.records.iter().find(|record| record.pass == DVF_EFFECT);
        let renewal = renewal.map_or([0.0; 2], |record| [record.rays() as f64, record.cells_renewed as f64]);
        let (width, height) = (self.renderer.size.0 as usize, self.renderer.size.1 as usize);
        let (traced, answered, ms) = (record.rays_traced as f64, record.rays_answered as f64, record.ms);
        let image = Image { width, height, rgb: output.pixels.radiance };
        Ok(Picture { image, ids: output.pixels.id, traced, answered, renewal, ms })
    }

    /// Where the field is that `options` ask for.
    fn region(&mut self, options: &Options) -> Result<Region> {
        Ok(match options.region {
            RegionKind::Scene => Region::scene(self.renderer.scene.resident()),
            RegionKind::View => self.renderer.visible_region(&[self.place.camera])?,
        })
    }

    /// Makes the field that `options` ask for.
    fn make(&mut self, options: &Options) -> Result<(DvfMade, f64)> {
        let region = self.region(options)?;
        let console = self.console;
        let progress = Progress::new();
        let mut told = None;
        let mut watch = |rays: u64, about: u64| {
            if told.is_none() {
                progress.phase("rays of the field", about);
            }
            progress.advance(rays - told.unwrap_or(0));
            told = Some(rays);
            !console.is_stopped()
        };
        let made = prepare::make(&mut self.renderer, &options.settings(), &region, options.tracing(), &mut watch);
        progress.finish();
        // Else it is a part of a field.
        console.go_on()?;
        made
    }

    /// Makes the field that `options` ask for, and a picture by it; the values, and the picture.
    fn measure(&mut self, stage: Stage, options: &Options) -> Result<(Values, Image)> {
        self.renderer.methods.remove::<Dvf>();
        let (made, seconds) = self.make(options)?;
        let known = made.field.known_cells();
        let longest = made.field.shape.size.into_iter().max().unwrap_or(0);
        let field = Arc::new(made.field);
        self.renderer.methods.set(Dvf::new(field.clone(), options.how()));
        let picture = self.picture(0)?;
        let mut times = [vec![self.exact.ms], vec![picture.ms]];
        for _ in 1..self.args.repeat {
            self.renderer.methods.remove::<Dvf>();
            times[0].push(self.picture(0)?.ms);
            self.renderer.methods.set(Dvf::new(field.clone(), options.how()));
            times[1].push(self.picture(0)?.ms);
        }
        self.renderer.methods.remove::<Dvf>();
        let [exact_ms, ms] = times.map(|times| median(times).unwrap_or_default());
        let exact = &self.exact;
        let errors = pixel_errors(&picture.image, &exact.image)?;
        let flip = flip_ldr(&picture.image, &exact.image, PIXELS_PER_DEGREE)?;
        let [areas, rays, labels] = made.seconds;
        let values = [
            ("points", made.points as f64),
            ("longest", f64::from(longest)),
            ("known_cells", known as f64),
            ("rays_of_field", made.record.rays() as f64),
            ("seconds", seconds),
            ("seconds_areas", areas),
            ("seconds_rays", rays),
            ("seconds_labels", labels),
            ("exact_ms", exact_ms),
            ("ms", ms),
            ("rays", exact.traced),
            ("traced", picture.traced),
            ("answered", picture.answered),
            ("fewer", exact.traced / picture.traced.max(1.0)),
            ("faster", exact_ms / ms.max(1e-9)),
            ("flip", flip.mean()),
            ("rmse", errors.rmse),
            ("bias", errors.bias),
            (
                "pixels_that_differ",
                differing(&picture.image, &exact.image) as f64 / exact.image.rgb.len().max(1) as f64,
            ),
            ("bricks_loaded", made.record.bricks_loaded as f64),
            ("bricks_needed", made.record.bricks_needed.count() as f64),
            ("bricks_read", made.bricks_read as f64),
        ];
        let mut values: Values = values.map(|(name, value)| (name.to_string(), value)).into();
        if stage == Stage::Modes {
            // The paper's mode has rays of its own: what other rays make alone.
            let other = self.picture(1)?.image;
            values.insert("noise_flip".into(), flip_ldr(&other, &self.exact.image, PIXELS_PER_DEGREE)?.mean());
            values.insert("noise_rmse".into(), pixel_errors(&other, &self.exact.image)?.rmse);
        }
        Ok((values, picture.image))
    }
}

/// Pixels whose bits are not the same.
fn differing(a: &Image, b: &Image) -> usize {
    a.rgb.iter().zip(&b.rgb).filter(|(a, b)| a.map(f32::to_bits) != b.map(f32::to_bits)).count()
}

/// What is seen, with a small cache and with all resident: values of the first, and how many pixels of both differ.
fn memory(place: &Place, args: &DvfBenchArgs, options: &Options, console: Console) -> Result<Values> {
    let (mut values, out_of_core) = View::open(place, args, args.cache, console)?.measure(Stage::Memory, options)?;
    let mut resident = View::open(place, args, CacheSize::Percent(100.0), console)?;
    resident.renderer.settings.tracing.measure_needed = true;
    let (of_resident, in_core) = resident.measure(Stage::Memory, options)?;
    // Which bricks rays need is known where all are resident.
    values.extend(of_resident.into_iter().filter(|(name, _)| name == "bricks_needed"));
    values.insert("differ_from_in_core".into(), differing(&out_of_core, &in_core) as f64);
    Ok(values)
}
