//! A scene as the package sees it: its facts, rays, pictures.

use crate::errors::{exception, failed, wrong};
use crate::held::{self, Done, Held, Options, Shared};
use crate::query;
use crate::render;
use crate::rows::{Check, Named, Rays, Rows};
use crate::worker::{Desk, Pending, Progress, Task, Worker, run_alone};
use anyhow::Result;
use bricks::SceneFile;
use brickwalk::counters::Counters;
use brickwalk::remote::{self, DiskCache, Traffic};
use brickwalk::session::{Hit, open_unmapped};
use brickwalk::settings::{Adapter, CacheSize};
use brickwalk::stream::PayloadSource;
use numpy::{PyArray1, PyArray2, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// Most rows of a job beside which another may wait; of more, both would take much memory.
const BESIDE: usize = 1 << 18;

/// A scene that is open. Threads may share it: their jobs are done in turn.
#[pyclass(frozen, module = "brickwalk._brickwalk")]
pub struct Core {
    options: Options,
    scene: Arc<SceneFile>,
    done: Shared,
    /// `None`: it is closed.
    worker: Mutex<Option<Worker<Held>>>,
}

/// Reads rows.
type Read<'py, R> = fn(&Rows<'py>, Range<usize>) -> PyResult<R>;

/// What becomes of rows.
struct Job<'py, 'a, R> {
    rows: Rows<'py>,
    named: Named,
    progress: Told<'py>,
    check: Check<'py>,
    read: Read<'py, R>,
    core: &'a Core,
}

impl<'py, R: Send + 'static> Job<'py, '_, R> {
    /// Has the scene's thread do `work` with rows, some at a time, and `take` what it returns of those from a row on.
    fn run<T: Send + 'static>(
        self,
        py: Python<'py>,
        work: impl Fn(&mut Held, &R, &Task) -> Result<T> + Copy + Send + 'static,
        mut take: impl FnMut(usize, T) -> PyResult<()>,
    ) -> PyResult<()> {
        let desk = self.core.desk()?;
        let (count, _) = self.rows.shape();
        let part = |start: usize, most: usize| start..count.min(start + most);
        // Nothing is done before all is known to be good.
        self.rows.check(py, self.check, &self.named)?;
        let mut progress = Progress::new(self.progress, count as u64);
        let most = desk.run(py, &mut progress, |held, _| held.begin())?;
        let mut finish = |(part, pending): (Range<usize>, Pending<T>)| {
            take(part.start, pending.wait(py, &mut progress)?)?;
            progress.reached(part.end as u64)
        };
        // While the scene's thread works on some, what is known of those before is written and the next are read.
        let mut last = None;
        for start in (0..count).step_by(most) {
            if most > BESIDE {
                last.take().map_or(Ok(()), &mut finish)?;
            }
            let part = part(start, most);
            let given = (self.read)(&self.rows, part.clone())?;
            let pending = desk.begin(py, move |held, task| work(held, &given, task))?;
            last.replace((part, pending)).map_or(Ok(()), &mut finish)?;
        }
        last.map_or(Ok(()), finish)
    }
}

impl Core {
    /// A way to hand its thread jobs. In a forked process the thread is started anew.
    pub fn desk(&self) -> PyResult<Desk<Held>> {
        let mut worker = self.worker.lock().unwrap_or_else(PoisonError::into_inner);
        match &*worker {
            None => Err(wrong("the scene is closed")),
            Some(running) if !running.is_lost() => Ok(running.desk()),
            Some(_) => {
                let anew = start(&self.options, &self.scene, &self.done)?;
                let desk = anew.desk();
                // What the other process had open is left as it is: there is no thread that could close it.
                std::mem::forget(worker.replace(anew));
                Ok(desk)
            }
        }
    }

    fn rays<'py>(
        &self,
        rows: &Bound<'py, PyAny>,
        shape: Vec<usize>,
        progress: Told<'py>,
    ) -> PyResult<Job<'py, '_, Rays>> {
        let (rows, named) = (Rows::of(rows)?, Named { name: "ray", shape });
        Ok(Job { rows, named, progress, check: Rows::check_rays, read: Rows::rays, core: self })
    }

    fn points<'py>(
        &self,
        rows: &Bound<'py, PyAny>,
        shape: Vec<usize>,
        progress: Told<'py>,
    ) -> PyResult<Job<'py, '_, Vec<[f64; 3]>>> {
        let (rows, named) = (Rows::of(rows)?, Named { name: "point", shape });
        Ok(Job { rows, named, progress, check: Rows::check_points, read: Rows::points, core: self })
    }
}

/// Who is told how far work is.
type Told<'py> = Option<Bound<'py, PyAny>>;

fn start(options: &Options, scene: &Arc<SceneFile>, done: &Shared) -> PyResult<Worker<Held>> {
    let (options, scene, done) = (options.clone(), scene.clone(), done.clone());
    Worker::start(move || Held::new(options, scene, done)).map_err(|error| exception(&error))
}

/// What was fetched of a scene by URL.
fn told<'py>(py: Python<'py>, traffic: &Traffic) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("requests", traffic.requests)?;
    dict.set_item("retries", traffic.retries)?;
    dict.set_item("bytes_fetched", traffic.bytes_fetched)?;
    dict.set_item("bytes_needed", traffic.bytes_needed)?;
    dict.set_item("round_trips", traffic.round_trips)?;
    dict.set_item("disk_cache_hits", traffic.disk_cache_hits)?;
    dict.set_item("disk_cache_bytes", traffic.disk_cache_bytes)?;
    dict.set_item("seconds_waiting", traffic.seconds_waiting)?;
    Ok(dict)
}

fn unwritable(error: impl std::fmt::Display) -> PyErr {
    wrong(format!("out: the array cannot be written to: {error}"))
}

/// Writes `values` into an array from a position on.
fn write<T: numpy::Element + Copy>(
    array: &Bound<'_, PyArray1<T>>,
    start: usize,
    values: impl Iterator<Item = T>,
) -> PyResult<()> {
    let mut array = array.try_readwrite().map_err(unwritable)?;
    let slots = array.as_slice_mut().map_err(unwritable)?.get_mut(start..).unwrap_or_default();
    slots.iter_mut().zip(values).for_each(|(slot, value)| *slot = value);
    Ok(())
}

/// Writes rows of `N` into an array from a row on.
fn write_rows<T: numpy::Element + Copy, const N: usize>(
    array: &Bound<'_, PyArray2<T>>,
    start: usize,
    rows: impl Iterator<Item = [T; N]>,
) -> PyResult<()> {
    let mut array = array.try_readwrite().map_err(unwritable)?;
    let slots = array.as_slice_mut().map_err(unwritable)?.get_mut(start * N..).unwrap_or_default();
    slots.chunks_exact_mut(N).zip(rows).for_each(|(slot, row)| slot.copy_from_slice(&row));
    Ok(())
}

#[pymethods]
impl Core {
    #[new]
    #[pyo3(signature = (path, cache, adapter, disk_cache=None))]
    fn new(py: Python<'_>, path: PathBuf, cache: &str, adapter: &str, disk_cache: Option<&str>) -> PyResult<Self> {
        let disk: Option<DiskCache> = disk_cache
            .map(str::parse)
            .transpose()
            .map_err(|why| wrong(format!("disk_cache {:?}: {why}", disk_cache.unwrap_or_default())))?;
        // What is secret of a URL goes no further.
        let path = remote::name_with(&path, disk);
        let cache: CacheSize = cache.parse().map_err(|why| wrong(format!("cache {cache:?}: {why}")))?;
        let Ok(adapter) = adapter.parse::<Adapter>();
        let file = path.clone();
        // What is read of a map would count as memory of the process.
        let open = move |_: &Arc<Task>| open_unmapped(&file);
        let scene = run_alone(py, &mut Progress::new(None, 0), open)?;
        let (options, done) = (Options { path, cache, adapter }, Shared::default());
        let worker = Mutex::new(Some(start(&options, &scene, &done)?));
        Ok(Self { options, scene, done, worker })
    }

    /// Closes the scene and its device, and waits for that.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let worker = self.worker.lock().unwrap_or_else(PoisonError::into_inner).take();
        worker.map_or(Ok(()), |worker| worker.finish(py))
    }

    #[getter]
    fn closed(&self) -> bool {
        self.worker.lock().unwrap_or_else(PoisonError::into_inner).is_none()
    }

    /// Facts of the scene.
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let resident = self.scene.resident();
        let manifest = &resident.manifest;
        let dict = PyDict::new(py);
        dict.set_item("path", self.options.path.as_os_str())?;
        dict.set_item("triangles", manifest.triangles_instanced)?;
        dict.set_item("triangles_stored", manifest.triangles_stored)?;
        dict.set_item("triangle_ids", manifest.triangle_ids)?;
        // The first is that of the world itself.
        dict.set_item("instances", resident.instances.len().saturating_sub(1))?;
        dict.set_item("bricks", resident.bricks.len())?;
        dict.set_item("levels", resident.levels.len())?;
        dict.set_item("materials", resident.materials.len())?;
        dict.set_item("textures", resident.textures.len())?;
        dict.set_item("bytes", self.scene.file_bytes())?;
        dict.set_item("bytes_resident", self.scene.resident_bytes())?;
        dict.set_item("bytes_bricks", self.scene.sizes().sum())?;
        let has_bounds = (0..3).all(|k| manifest.min[k] <= manifest.max[k]);
        let bounds =
            has_bounds.then(|| PyArray1::from_slice(py, &[manifest.min, manifest.max].concat()).reshape([2, 3]));
        dict.set_item("bounds", bounds.transpose()?)?;
        dict.set_item("sources", manifest.sources.iter().map(|source| source.name.as_str()).collect::<Vec<_>>())?;
        dict.set_item("warnings", &manifest.warnings)?;
        Ok(dict)
    }

    /// What was done since the scene was opened.
    fn stats<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let done = &*held::lock(&self.done);
        let Done { rendered, .. } = done;
        let Counters { bytes_bvh, bytes_geometry, bytes_attributes, bytes_textures, .. } = rendered;
        let dict = PyDict::new(py);
        dict.set_item("rays", done.rays)?;
        dict.set_item("occlusion_rays", done.occlusion_rays)?;
        dict.set_item("hits", done.hits)?;
        dict.set_item("pictures", done.pictures)?;
        dict.set_item("bricks_loaded", rendered.bricks_loaded)?;
        dict.set_item("bricks_evicted", rendered.bricks_evicted)?;
        dict.set_item("bytes_loaded", bytes_bvh + bytes_geometry + bytes_attributes + bytes_textures)?;
        dict.set_item("round_trips", rendered.round_trips)?;
        dict.set_item("seconds", done.seconds + rendered.ms * 1e-3)?;
        dict.set_item("queries", done.queries)?;
        dict.set_item("query_payloads_read", done.queried.payloads_read)?;
        dict.set_item("query_bytes_read", done.queried.bytes_read)?;
        dict.set_item("query_most_bytes", done.queried.most_bytes)?;
        dict.set_item("device", done.device.as_deref())?;
        if let Some(traffic) = remote::traffic(&self.options.path) {
            dict.set_item("remote", told(py, &traffic)?)?;
        }
        Ok(dict)
    }

    /// Fills arrays with the closest hits of rays.
    #[allow(clippy::too_many_arguments)]
    fn cast<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        shape: Vec<usize>,
        t: &Bound<'py, PyArray1<f64>>,
        triangle: &Bound<'py, PyArray1<u32>>,
        uv: &Bound<'py, PyArray2<f32>>,
        normal: &Bound<'py, PyArray2<f32>>,
        progress: Told<'py>,
    ) -> PyResult<()> {
        self.rays(rays, shape, progress)?.run(py, query::cast, |start, hits: Vec<Hit>| {
            if hits.iter().any(|hit| hit.t.is_nan()) {
                return Err(failed("a hit is not a number; this is a defect of brickwalk"));
            }
            write(t, start, hits.iter().map(|hit| hit.t))?;
            write(triangle, start, hits.iter().map(|hit| hit.triangle))?;
            write_rows(uv, start, hits.iter().map(|hit| [hit.u, hit.v]))?;
            write_rows(normal, start, hits.iter().map(|hit| hit.normal))
        })
    }

    /// Fills an array with whether rays hit anything.
    fn occluded<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        shape: Vec<usize>,
        hit: &Bound<'py, PyArray1<bool>>,
        progress: Told<'py>,
    ) -> PyResult<()> {
        let take = |start, hits: Vec<bool>| write(hit, start, hits.into_iter());
        self.rays(rays, shape, progress)?.run(py, query::any, take)
    }

    /// Fills an array with how many triangles rays meet.
    fn count<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        shape: Vec<usize>,
        count: &Bound<'py, PyArray1<u32>>,
        progress: Told<'py>,
    ) -> PyResult<()> {
        let take = |start, counts: Vec<u32>| write(count, start, counts.into_iter());
        self.rays(rays, shape, progress)?.run(py, query::count, take)
    }

    /// All that rays meet: where the hits of each begin, distances, triangles, weights, normals.
    fn intersections<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        shape: Vec<usize>,
        progress: Told<'py>,
    ) -> PyResult<Bound<'py, PyTuple>> {
        let mut listed = query::Listed::new();
        let take = |_, found| {
            listed.extend(&found);
            Ok(())
        };
        self.rays(rays, shape, progress)?.run(py, query::list, take)?;
        let hits = listed.t.len();
        PyTuple::new(
            py,
            [
                PyArray1::from_vec(py, listed.starts).into_any(),
                PyArray1::from_vec(py, listed.t).into_any(),
                PyArray1::from_vec(py, listed.triangle).into_any(),
                PyArray1::from_vec(py, listed.uv.into_flattened()).reshape([hits, 2])?.into_any(),
                PyArray1::from_vec(py, listed.normal.into_flattened()).reshape([hits, 3])?.into_any(),
            ],
        )
    }

    /// Fills arrays with the nearest points.
    #[allow(clippy::too_many_arguments)]
    fn closest<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        shape: Vec<usize>,
        point: &Bound<'py, PyArray2<f64>>,
        distance: &Bound<'py, PyArray1<f64>>,
        triangle: &Bound<'py, PyArray1<u32>>,
        uv: &Bound<'py, PyArray2<f32>>,
        normal: &Bound<'py, PyArray2<f32>>,
        progress: Told<'py>,
    ) -> PyResult<()> {
        self.points(points, shape, progress)?.run(
            py,
            |held, points, task| query::closest(held, points, task),
            |start, found| {
                write_rows(point, start, found.iter().map(|found| found.point))?;
                write(distance, start, found.iter().map(|found| found.distance))?;
                write(triangle, start, found.iter().map(|found| found.triangle))?;
                write_rows(uv, start, found.iter().map(|found| [found.u, found.v]))?;
                write_rows(normal, start, found.iter().map(|found| found.normal))
            },
        )
    }

    /// Fills an array with whether points are inside.
    fn occupancy<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        shape: Vec<usize>,
        inside: &Bound<'py, PyArray1<bool>>,
        open: bool,
        progress: Told<'py>,
    ) -> PyResult<()> {
        let work =
            move |held: &mut Held, points: &Vec<[f64; 3]>, task: &Task| query::occupancy(held, points, open, task);
        let take = |start, found: Vec<bool>| write(inside, start, found.into_iter());
        self.points(points, shape, progress)?.run(py, work, take)
    }

    /// Fills an array with distances.
    fn distance<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        shape: Vec<usize>,
        distance: &Bound<'py, PyArray1<f64>>,
        progress: Told<'py>,
    ) -> PyResult<()> {
        let take = |start, found: Vec<f64>| write(distance, start, found.into_iter());
        self.points(points, shape, progress)?.run(py, |held, points, task| query::distance(held, points, task), take)
    }

    /// Fills an array with distances, negative inside.
    fn signed_distance<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        shape: Vec<usize>,
        distance: &Bound<'py, PyArray1<f64>>,
        open: bool,
        progress: Told<'py>,
    ) -> PyResult<()> {
        let work = move |held: &mut Held, points: &Vec<[f64; 3]>, task: &Task| {
            query::signed_distance(held, points, open, task)
        };
        let take = |start, found: Vec<f64>| write(distance, start, found.into_iter());
        self.points(points, shape, progress)?.run(py, work, take)
    }

    /// Fills an array with whether the ways between pairs of points are free.
    fn visibility<'py>(
        &self,
        py: Python<'py>,
        pairs: &Bound<'py, PyAny>,
        shape: Vec<usize>,
        free: &Bound<'py, PyArray1<bool>>,
        progress: Told<'py>,
    ) -> PyResult<()> {
        let (rows, named) = (Rows::of(pairs)?, Named { name: "pair", shape });
        let job = Job { rows, named, progress, check: Rows::check_pairs, read: Rows::pairs, core: self };
        let take = |start, found: Vec<bool>| write(free, start, found.into_iter());
        job.run(py, |held, pairs, task| query::visibility(held, pairs, task), take)
    }

    /// A picture: a dict of arrays, and what a person should know of it.
    fn render<'py>(
        &self,
        py: Python<'py>,
        settings: &str,
        chosen: Vec<String>,
        camera: Option<render::CameraArguments>,
        progress: Told<'py>,
    ) -> PyResult<(Bound<'py, PyDict>, Vec<String>)> {
        render::render(py, &self.desk()?, &self.options, settings, &chosen, camera, progress)
    }
}
