//! Scene files from arrays, and from models.

use crate::errors::wrong;
use crate::rows::{Named, Rows};
use crate::worker::{Progress, Task, run_alone};
use anyhow::{Result, bail};
use brickwalk::settings::sizes::size_bytes;
use brickwalk_convert::build::{
    BuildError, BuildSettings, BuildSummary, LatticeStep, TextureEncoding, build, build_source,
};
use brickwalk_convert::import::{ImportSettings, Input, Up, import};
use brickwalk_convert::progress;
use brickwalk_convert::source::{IDENTITY, Mesh, Placement, Primitive, SourceScene};
use brickwalk_scenes::{Kind, Settings};
use numpy::{PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

/// How often a conversion is asked how far it is.
const POLL: Duration = Duration::from_millis(20);

/// Does `work`, which is told to stop when nobody waits for it any more.
pub fn watched<T>(task: &Task, work: impl FnOnce(&progress::Progress) -> T) -> T {
    let (progress, ended) = (progress::Progress::hidden(), AtomicBool::new(false));
    thread::scope(|scope| {
        // However the work ends.
        struct End<'a>(&'a AtomicBool, thread::Thread);
        impl Drop for End<'_> {
            fn drop(&mut self) {
                self.0.store(true, Ordering::Relaxed);
                self.1.unpark();
            }
        }
        let watcher = scope.spawn(|| {
            while !ended.load(Ordering::Relaxed) {
                if task.is_stopped() {
                    progress.interrupt();
                }
                let (_, done, total) = progress.so_far();
                task.note(done, total);
                thread::park_timeout(POLL);
            }
        });
        let _end = End(&ended, watcher.thread().clone());
        work(&progress)
    })
}

fn threads() -> usize {
    thread::available_parallelism().map_or(1, usize::from)
}

/// What was built; an interrupted conversion is told in the words of the package.
pub fn built(result: Result<BuildSummary, BuildError>) -> Result<BuildSummary> {
    match result {
        Err(BuildError::Paused { scratch }) => {
            bail!("interrupted; the same conversion with resume=True continues ({} is kept)", scratch.display())
        }
        result => Ok(result?),
    }
}

/// Vertices per triangle.
fn corners<'py>(py: Python<'py>, faces: &Bound<'py, PyArray2<i64>>, vertices: usize) -> PyResult<Vec<u32>> {
    let faces = faces.try_readonly().map_err(|error| wrong(format!("faces cannot be read: {error}")))?;
    let faces = faces.as_array();
    if faces.ncols() != 3 {
        return Err(wrong(format!("faces have 3 vertices each, not {}", faces.ncols())));
    }
    let mut corners = Vec::with_capacity(faces.len());
    for (row, face) in faces.rows().into_iter().enumerate() {
        if row % (1 << 20) == 0 {
            py.check_signals()?;
        }
        for &vertex in face {
            let found = u32::try_from(vertex).ok().filter(|&vertex| (vertex as usize) < vertices);
            let why = || wrong(format!("face {row} names vertex {vertex}; there are {vertices}, from 0"));
            corners.push(found.ok_or_else(why)?);
        }
    }
    Ok(corners)
}

/// Writes the scene file `out` of one mesh: vertices of shape (n, 3), faces of shape (m, 3).
#[pyfunction]
pub fn build_mesh<'py>(
    py: Python<'py>,
    vertices: &Bound<'py, PyAny>,
    faces: &Bound<'py, PyArray2<i64>>,
    out: PathBuf,
    brick_triangles: u32,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<()> {
    let vertices = Rows::of(vertices)?;
    let (count, _) = vertices.shape();
    vertices.check(py, Rows::check_points, &Named { name: "vertex", shape: vec![count] })?;
    let indices = corners(py, faces, count)?;
    let positions = vertices.points(0..count)?;
    let name = || "arrays".to_owned();
    let mesh = Mesh { name: name(), primitives: vec![Primitive { positions, indices, ..Primitive::default() }] };
    let placement = Placement { name: name(), world_from_mesh: IDENTITY, ..Placement::default() };
    let source = bricks::Source { name: name(), ..bricks::Source::default() };
    let scene = SourceScene {
        meshes: vec![mesh],
        placements: vec![placement],
        materials: vec![bricks::Material::GREY],
        sources: vec![source],
        ..SourceScene::default()
    };
    // Its folder is of this scene alone. Positions are as near to those given as bricks allow.
    let settings = BuildSettings {
        brick_triangles,
        threads: Some(threads()),
        lattice: Some(LatticeStep::Finest),
        proxies: false,
        ..BuildSettings::default()
    };
    run_alone(py, &mut Progress::new(progress, 0), move |task| {
        watched(task, |progress| built(build(scene, &settings, &out, progress))).map(|_| ())
    })
}

/// Writes the scene file `out` of a generated scene.
///
/// # Errors
/// A kind that there is not, or a count that it cannot have; the file cannot be written.
#[pyfunction]
pub fn generate(
    py: Python<'_>,
    kind: &str,
    out: PathBuf,
    triangles: u64,
    seed: u64,
    progress: Option<Bound<'_, PyAny>>,
) -> PyResult<u64> {
    let kind: Kind = kind.parse().map_err(|error| wrong(format!("kind {kind:?}: {error}")))?;
    let possible = kind.triangles();
    if !possible.contains(&triangles) {
        let (least, most) = possible.into_inner();
        return Err(wrong(format!("triangles is {triangles}; a scene of this kind has from {least} to {most}")));
    }
    let settings = Settings { kind, triangles, seed, instanced: false, copies: 1 };
    run_alone(py, &mut Progress::new(progress, 0), move |task| {
        watched(task, |progress| -> Result<u64> {
            let scene = brickwalk_scenes::generate(&settings, progress)?;
            let settings = BuildSettings { threads: Some(threads()), ..BuildSettings::default() };
            let summary = built(build_source(&scene, &settings, &out, progress))?;
            Ok(summary.triangles_instanced)
        })
    })
}

/// Settings of a conversion, by their names in the package.
pub struct Conversion {
    pub inputs: Vec<Input>,
    pub importing: ImportSettings,
    pub building: BuildSettings,
}

impl Conversion {
    /// Of models into the scene file `out`.
    ///
    /// # Errors
    /// A setting that there is not, or that is out of its range.
    pub fn new(py: Python<'_>, inputs: Vec<PathBuf>, out: &Path, settings: &Bound<'_, PyDict>) -> PyResult<Self> {
        let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty()).map(PathBuf::from);
        let importing = ImportSettings { threads: Some(threads()), scratch: folder, movable: Vec::new() };
        let building = BuildSettings { threads: Some(threads()), ..BuildSettings::default() };
        let inputs = inputs.into_iter().map(Input::from).collect();
        let mut conversion = Self { inputs, importing, building };
        for (name, value) in settings {
            let name: String = name.extract()?;
            conversion.set(&name, &value).map_err(|error| {
                let text = format!("{name}: {}", error.value(py));
                match error.is_instance_of::<pyo3::exceptions::PyTypeError>(py) {
                    true => pyo3::exceptions::PyTypeError::new_err(text),
                    false => wrong(text),
                }
            })?;
        }
        conversion.importing.threads = conversion.building.threads;
        Ok(conversion)
    }

    /// Takes one setting.
    fn set(&mut self, name: &str, value: &Bound<'_, PyAny>) -> PyResult<()> {
        let building = &mut self.building;
        match name {
            "brick_triangles" => building.brick_triangles = value.extract()?,
            "memory" => {
                let text = value.str()?.to_string();
                building.memory_bytes = Some(size_bytes(&text).map_err(wrong)?);
            }
            "threads" => building.threads = Some(value.extract()?),
            "lattice" if value.extract::<&str>().is_ok_and(|text| text == "finest") => {
                building.lattice = Some(LatticeStep::Finest);
            }
            "lattice" => building.lattice = Some(LatticeStep::Log2(value.extract()?)),
            "fast" => building.fast = value.extract()?,
            "proxies" => building.proxies = value.extract()?,
            "lod" => building.lod = value.extract()?,
            "resume" => building.resume = value.extract()?,
            "scratch" => {
                let folder: PathBuf = value.extract()?;
                (building.scratch, self.importing.scratch) = (Some(folder.clone()), Some(folder));
            }
            "drop_non_finite" => building.drop_non_finite = value.extract()?,
            "movable" => {
                let names: Vec<String> = value.extract()?;
                (building.movable, self.importing.movable) = (names.clone(), names);
            }
            "instance_min_triangles" => building.instance_min_triangles = value.extract()?,
            "bake_budget" => building.bake_budget_triangles = value.extract()?,
            "textures" => {
                building.textures = match &*value.extract::<String>()? {
                    "bc7" => TextureEncoding::Bc7,
                    "raw" => TextureEncoding::Raw,
                    other => return Err(wrong(format!("{other:?}; give \"bc7\" or \"raw\""))),
                }
            }
            "up" => {
                let up = match &*value.extract::<String>()? {
                    "y" => Up::Y,
                    "z" => Up::Z,
                    other => return Err(wrong(format!("{other:?}; give \"y\" or \"z\""))),
                };
                self.inputs.iter_mut().for_each(|input| input.up = Some(up));
            }
            "metres" => {
                let metres: f64 = value.extract()?;
                if !(metres.is_finite() && metres > 0.0) {
                    return Err(wrong(format!("{metres}; give a number above 0")));
                }
                self.inputs.iter_mut().for_each(|input| input.metres = metres);
            }
            "within" => {
                let folder: PathBuf = value.extract()?;
                self.inputs.iter_mut().for_each(|input| input.within = Some(folder.clone()));
            }
            _ => return Err(pyo3::exceptions::PyTypeError::new_err("there is no such setting")),
        }
        Ok(())
    }
}

/// Converts models into the scene file `out`; `settings` by their names.
#[pyfunction]
pub fn convert<'py>(
    py: Python<'py>,
    inputs: Vec<PathBuf>,
    out: PathBuf,
    settings: &Bound<'py, PyDict>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let conversion = Conversion::new(py, inputs, &out, settings)?;
    let work = move |task: &Arc<Task>| {
        watched(task, |progress| {
            let Conversion { inputs, importing, building } = &conversion;
            let source = import(inputs, importing, progress)?;
            built(build_source(&source, building, &out, progress))
        })
    };
    let summary = run_alone(py, &mut Progress::new(progress, 0), work)?;
    told(py, summary)
}

/// The counts of a conversion.
pub fn told(py: Python<'_>, summary: BuildSummary) -> PyResult<Bound<'_, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("triangles", summary.triangles_instanced)?;
    dict.set_item("triangles_stored", summary.triangles_stored)?;
    dict.set_item("instances", summary.instances)?;
    dict.set_item("bricks", summary.bricks)?;
    dict.set_item("levels", summary.levels)?;
    dict.set_item("bytes", summary.bytes_file)?;
    dict.set_item("dropped_zero_area", summary.dropped_zero_area)?;
    dict.set_item("dropped_non_finite", summary.dropped_non_finite)?;
    dict.set_item("warnings", summary.warnings)?;
    Ok(dict)
}
