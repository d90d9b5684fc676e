//! `brickwalk bench dvf`: the experiments of Günay and Akyüz 2025 in ratios and errors: how many rays to the environment are left to be traced with a
//! field of visibility, and how far pictures by it are from those of the same rays without.
//!
//! Each finished measurement is a line of `rows.jsonl`, from which alone tables and pages are made.

pub mod args;
mod output;

use super::cells::Header;
use super::measure::walk_args;
use super::roma::rows::{Row, Rows};
use crate::app::device::Device;
use crate::app::dvf as field;
use crate::app::dvf_args::RegionKind;
use crate::app::interrupt;
use crate::app::output::atomic;
use crate::app::session::{Session, open_scene};
use crate::app::walk;
use crate::kernel::{DeviceInfo, Extent};
use crate::metrics::{Image, PIXELS_PER_DEGREE, flip_ldr, pixel_errors};
use crate::render::{Dvf, Region, Renderer};
use crate::scene::Camera;
use crate::scene::path::{CameraPath, path_from_bounds};
use anyhow::{Context, Result, bail};
use args::{DvfBenchArgs, Stage};
use brickwalk_convert::build::{BuildSettings, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::Primitive;
use brickwalk_scenes::one_mesh;
use glam::DVec3;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Raised when a value changes its meaning.
const FORMAT: u32 = 1;

/// The box's name.
const BOX: &str = "cornell";

/// A scene with its path.
struct Place {
    name: String,
    scene: PathBuf,
    camera: Camera,
}

/// Pictures of a scene.
struct View<'a> {
    place: &'a Place,
    args: &'a DvfBenchArgs,
    renderer: Renderer,
    /// Without a field: the picture, its rays, its milliseconds.
    exact: (Image, f64, f64),
}

/// Runs the command.
///
/// # Errors
/// The folder holds other measurements or cannot be written; a scene cannot be read; the device's.
pub fn run(args: &DvfBenchArgs) -> Result<()> {
    atomic::create_folder(&args.output)?;
    let places = places(args)?;
    let mut rows = Rows::open(&args.output, header(args, &places)?)?;
    let deadline = args.minutes.map(|minutes| Instant::now() + Duration::from_secs_f64(60.0 * minutes));
    let stages: Vec<Stage> =
        Stage::ALL.into_iter().filter(|stage| args.stages.is_empty() || args.stages.contains(stage)).collect();
    let jobs: Vec<(&Place, Stage, String)> = places
        .iter()
        .flat_map(|place| stages.iter().map(move |&stage| (place, stage)))
        .flat_map(|(place, stage)| args.measurements(stage).into_iter().map(move |options| (place, stage, options)))
        .collect();
    let progress = Progress::new();
    progress.phase("measurements", jobs.len() as u64);
    let mut view: Option<View> = None;
    let mut ended = "";
    for (place, stage, options) in &jobs {
        let key = key(&place.name, *stage, options);
        if !rows.has(&key) {
            if interrupt::flag().load(Ordering::Relaxed) {
                ended = "Interrupted: the same command goes on where this one stopped.\n";
                break;
            }
            if deadline.is_some_and(|deadline| Instant::now() >= deadline) {
                ended = "Out of time: the same command goes on where this one stopped.\n";
                break;
            }
            if *stage == Stage::Memory {
                rows.push(Row { key, values: memory(place, args, options)? })?;
            } else {
                let of_place = view.take().filter(|view| std::ptr::eq(view.place, *place));
                let open = match of_place {
                    Some(view) => view,
                    None => View::open(place, args, "100%")?,
                };
                let open = view.insert(open);
                rows.push(Row { key, values: open.measure(options)?.0 })?;
            }
        }
        progress.advance(1);
    }
    progress.finish();
    let names: Vec<&str> = places.iter().map(|place| place.name.as_str()).collect();
    let text = output::write(args, &names, &rows, jobs.len())?;
    crate::app::print(&text)?;
    if ended.starts_with("Interrupted") {
        bail!("interrupted; {} holds what is measured, and the same command goes on", args.output.display());
    }
    crate::app::print(ended)
}

/// The name of a measurement.
fn key(scene: &str, stage: Stage, options: &str) -> String {
    format!("{scene}, {}: {options}", stage.name())
}

fn header(args: &DvfBenchArgs, places: &[Place]) -> Result<Header> {
    let DeviceInfo { name, driver, driver_info, backend, .. } = Device::open(&args.adapter)?.info();
    Ok(Header {
        format: FORMAT,
        settings: json!({
            "scenes": places.iter().map(|place| place.name.as_str()).collect::<Vec<_>>(),
            "size": args.size.to_string(),
            "samples": args.samples,
            "points": args.points,
            "rays": args.rays,
            "environment": args.environment.as_ref().map(|file| file.display().to_string()),
        }),
        adapter: json!({ "name": name, "driver": driver, "driver_info": driver_info, "backend": backend }),
        commit: env!("BRICKWALK_COMMIT").into(),
    })
}

/// The scenes, and the box, which is built if it is not there.
fn places(args: &DvfBenchArgs) -> Result<Vec<Place>> {
    let mut places = Vec::new();
    for (i, scene) in args.scenes.iter().enumerate() {
        let file = open_scene(scene)?;
        let near = scene.with_extension("near.json");
        let path = match args.paths.get(i) {
            Some(path) => CameraPath::read(path)?,
            None if near.exists() => CameraPath::read(&near)?,
            None => path_from_bounds(file.resident().manifest.min, file.resident().manifest.max),
        };
        let name = scene.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        places.push(Place { name, scene: scene.clone(), camera: path.frame(0, 1) });
    }
    let scene = args.output.join(format!("{BOX}.bricks"));
    if open_scene(&scene).is_err() {
        build(one_mesh(BOX, cornell()), &BuildSettings::default(), &scene, &Progress::hidden())?;
    }
    let camera = Camera {
        position: DVec3::new(0.0, 1.0, 3.2),
        target: DVec3::new(0.0, 0.95, 0.0),
        up: DVec3::Y,
        fov_y: 40f64.to_radians(),
    };
    places.push(Place { name: BOX.into(), scene, camera });
    Ok(places)
}

/// A box of side 2 on the floor, open to +Z, with two blocks in it; fronts face what is free.
fn cornell() -> Primitive {
    let mut all = Primitive::default();
    let mut quad = |corner: DVec3, u: DVec3, v: DVec3| {
        let first = all.positions.len() as u32;
        all.positions.extend([corner, corner + u, corner + u + v, corner + v].map(|p| p.to_array()));
        all.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
    };
    let (x, y, z) = (DVec3::X * 2.0, DVec3::Y * 2.0, DVec3::Z * 2.0);
    let low = DVec3::new(-1.0, 0.0, -1.0);
    // Floor, ceiling, back, left and right.
    quad(low, z, x);
    quad(low + y, x, z);
    quad(low, x, y);
    quad(low, y, z);
    quad(low + x, z, y);
    for (middle, size, turn) in
        [(DVec3::new(-0.35, 0.0, -0.35), [0.6, 1.2, 0.6], 0.3f64), (DVec3::new(0.35, 0.0, 0.3), [0.6, 0.6, 0.6], -0.3)]
    {
        let (s, c) = turn.sin_cos();
        let (a, b, up) = (DVec3::new(c, 0.0, -s) * size[0], DVec3::new(s, 0.0, c) * size[2], DVec3::Y * size[1]);
        let corner = middle - 0.5 * (a + b);
        quad(corner + up, b, a);
        quad(corner, up, a);
        quad(corner + b, a, up);
        quad(corner, b, up);
        quad(corner + a, up, b);
    }
    all
}

type Values = BTreeMap<String, f64>;

impl<'a> View<'a> {
    fn open(place: &'a Place, args: &'a DvfBenchArgs, cache: &str) -> Result<Self> {
        let environment = args.environment.as_ref().map(|file| format!(" --environment {}", file.display()));
        let line = format!(
            "--size {} --tile 16 --spp {} --sun-intensity 0 --effects environment --cache {cache}{}",
            args.size,
            args.samples,
            environment.unwrap_or_default()
        );
        let options = walk_args(&line, &place.scene, &args.adapter)?;
        let extent = Extent { width: args.size.width, height: args.size.height, tile: 16 };
        let session = Session::open(open_scene(&place.scene)?, &place.scene, &options.stream, extent)?;
        let renderer = walk::renderer(session, &options)?;
        let nothing = Image { width: 0, height: 0, rgb: Vec::new() };
        let mut view = Self { place, args, renderer, exact: (nothing, 0.0, 0.0) };
        let (image, rays, _, ms) = view.picture()?;
        view.exact = (image, rays, ms);
        Ok(view)
    }

    /// A picture, the rays to the environment that were traced, those answered, and their milliseconds.
    fn picture(&mut self) -> Result<(Image, f64, f64, f64)> {
        let output =
            self.renderer.frame(0, &self.place.camera).with_context(|| self.place.scene.display().to_string())?;
        let record = output.records.iter().find(|record| record.pass == "environment");
        let record = record.context("no rays lead to the environment")?;
        let (width, height) = (self.renderer.size.0 as usize, self.renderer.size.1 as usize);
        let image = Image { width, height, rgb: output.pixels.radiance };
        Ok((image, record.rays as f64, record.rays_answered as f64, record.ms))
    }

    /// Makes the field that `options` ask for, and a picture by it; the values, and the picture.
    fn measure(&mut self, options: &str) -> Result<(Values, Image)> {
        let options = walk_args(options, &self.place.scene, &self.args.adapter)?;
        self.renderer.dvf = Dvf::default();
        let region = match options.dvf.dvf_region {
            RegionKind::Scene => Region::scene(self.renderer.scene.resident()),
            RegionKind::View => self.renderer.visible_region(&[self.place.camera])?,
        };
        let settings = options.dvf.settings();
        let (made, seconds) = field::make(&mut self.renderer, &settings, &region, options.dvf.tracing())?;
        let known = made.field.known_cells();
        let longest = made.field.shape.size.into_iter().max().unwrap_or(0);
        self.renderer.dvf = Dvf::new(Arc::new(made.field), options.dvf.how());
        let (image, traced, answered, ms) = self.picture()?;
        self.renderer.dvf = Dvf::default();
        let (exact, rays, exact_ms) = &self.exact;
        let errors = pixel_errors(&image, exact)?;
        let flip = flip_ldr(&image, exact, PIXELS_PER_DEGREE)?;
        let differ = image.rgb.iter().zip(&exact.rgb).filter(|(a, b)| a.map(f32::to_bits) != b.map(f32::to_bits));
        let values = [
            ("points", made.points as f64),
            ("longest", f64::from(longest)),
            ("known_cells", known as f64),
            ("rays_of_field", made.record.rays as f64),
            ("seconds", seconds),
            ("rays", *rays),
            ("traced", traced),
            ("answered", answered),
            ("fewer", rays / traced.max(1.0)),
            ("faster", exact_ms / ms.max(1e-9)),
            ("flip", flip.mean()),
            ("rmse", errors.rmse),
            ("bias", errors.bias),
            ("pixels_that_differ", differ.count() as f64 / exact.rgb.len().max(1) as f64),
            ("bricks_loaded", made.record.bricks_loaded as f64),
            ("bricks_needed", made.record.bricks_needed as f64),
            ("bricks_read", made.bricks_read as f64),
        ];
        let values = values.map(|(name, value)| (name.to_string(), value)).into();
        Ok((values, image))
    }
}

/// What is seen, with a small cache and with all resident: values of the first, and how many pixels of both differ.
fn memory(place: &Place, args: &DvfBenchArgs, options: &str) -> Result<Values> {
    let (mut values, out_of_core) = View::open(place, args, &args.cache.to_string())?.measure(options)?;
    let mut resident = View::open(place, args, "100%")?;
    resident.renderer.settings.tracing.measure_needed = true;
    let (of_resident, in_core) = resident.measure(options)?;
    // Which bricks rays need is known where all are resident.
    values.extend(of_resident.into_iter().filter(|(name, _)| name == "bricks_needed"));
    let differ = out_of_core.rgb.iter().zip(&in_core.rgb).filter(|(a, b)| a.map(f32::to_bits) != b.map(f32::to_bits));
    values.insert("differ_from_in_core".into(), differ.count() as f64);
    Ok(values)
}

/// A file of the results.
fn file(folder: &Path, name: &str) -> PathBuf {
    folder.join(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fronts_of_the_box_face_what_is_free() {
        let all = cornell();
        let corner = |i: usize| DVec3::from_array(all.positions[all.indices[i] as usize]);
        for t in 0..all.indices.len() / 3 {
            let [a, b, c] = [0, 1, 2].map(|k| corner(3 * t + k));
            let (middle, n) = ((a + b + c) / 3.0, (b - a).cross(c - a));
            // Of the box toward its middle, of a block away from its own.
            let away = match t {
                0..10 => middle - DVec3::new(0.0, 1.0, 0.0),
                10..20 => DVec3::new(-0.35, 0.6, -0.35) - middle,
                _ => DVec3::new(0.35, 0.3, 0.3) - middle,
            };
            assert!(n.dot(away) < 0.0, "triangle {t}");
        }
    }
}
