//! Parts of a walk, frames or bands of them, by a session that stays open between them.

use crate::errors::{exception, wrong};
use crate::render::Watching;
use crate::worker::{Desk, Progress, State, Task, Worker, run_alone};
use anyhow::{Result, anyhow};
use brickwalk::remote::{self, DiskCache};
use brickwalk::session::parts;
use brickwalk::{Session, Settings};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// What the thread of a walk's parts owns.
struct Held {
    scene: PathBuf,
    settings: Settings,
    key: String,
    session: Option<Session>,
}

impl State for Held {
    fn reset(&mut self) {
        self.session = None;
    }
}

impl Held {
    /// Renders a part, unless it is there already; what a person should know, too.
    fn part(&mut self, output: &Path, number: u32, task: &Arc<Task>) -> Result<(Option<parts::Made>, Vec<String>)> {
        if parts::is_whole(output, number, &self.key) {
            return Ok((None, Vec::new()));
        }
        let session = match self.session.take() {
            Some(session) => self.session.insert(session),
            None => self.session.insert(Session::open(&self.scene, &self.settings)?),
        };
        let part = session.part(number, &mut Watching(task))?.ok_or_else(|| anyhow!("interrupted"))?;
        std::fs::create_dir_all(parts::folder(output))?;
        part.write(output, &self.key)?;
        Ok((Some(part.made), [session.take_warnings(), remote::take_warnings()].concat()))
    }
}

/// The parts of a walk. Threads may share it: their parts are rendered in turn.
#[pyclass(frozen, module = "brickwalk._brickwalk")]
pub struct WalkParts {
    key: String,
    frames: u32,
    parts: u32,
    /// `None`: it is closed.
    worker: Mutex<Option<Worker<Held>>>,
}

impl WalkParts {
    fn desk(&self) -> PyResult<Desk<Held>> {
        let worker = self.worker.lock().unwrap_or_else(PoisonError::into_inner);
        match &*worker {
            Some(worker) if !worker.is_lost() => Ok(worker.desk()),
            Some(_) => Err(wrong("this walk was opened by the process that this one was forked from; open it here")),
            None => Err(wrong("the walk is closed")),
        }
    }
}

#[pymethods]
impl WalkParts {
    #[new]
    #[pyo3(signature = (scene, settings, disk_cache=None))]
    fn new(py: Python<'_>, scene: PathBuf, settings: &str, disk_cache: Option<&str>) -> PyResult<Self> {
        let disk: Option<DiskCache> = disk_cache
            .map(str::parse)
            .transpose()
            .map_err(|why| wrong(format!("disk_cache {:?}: {why}", disk_cache.unwrap_or_default())))?;
        let settings = Settings::from_toml(settings).map_err(|error| exception(&error.into()))?;
        parts::check(&settings).map_err(|error| wrong(error.to_string()))?;
        let scene = remote::name_with(&scene, disk);
        let (file, own) = (scene.clone(), settings.clone());
        let key = run_alone(py, &mut Progress::new(None, 0), move |_: &Arc<Task>| parts::key_of(&file, &own))?;
        let (frames, count) = (settings.frames, parts::count(&settings));
        let own = key.clone();
        // A session stays on the thread that opened it.
        let make = move || Held { scene, settings, key: own, session: None };
        let worker = Worker::start(make).map_err(|error| exception(&error))?;
        Ok(Self { key, frames, parts: count, worker: Mutex::new(Some(worker)) })
    }

    #[getter]
    fn key(&self) -> &str {
        &self.key
    }

    #[getter]
    fn frames(&self) -> u32 {
        self.frames
    }

    #[getter]
    fn parts(&self) -> u32 {
        self.parts
    }

    /// Renders the part `number` into the folder `output`, unless it is there and whole.
    fn render<'py>(
        &self,
        py: Python<'py>,
        output: PathBuf,
        number: u32,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        if number >= self.parts {
            return Err(wrong(format!("part {number}: the walk has {} parts, from 0", self.parts)));
        }
        let path = parts::file(&output, number);
        let work = move |held: &mut Held, task: &Arc<Task>| held.part(&output, number, task);
        let (made, warnings) = self.desk()?.run(py, &mut Progress::new(progress, 0), work)?;
        let dict = PyDict::new(py);
        dict.set_item("path", path)?;
        dict.set_item("part", number)?;
        dict.set_item("is_new", made.is_some())?;
        let made = made.unwrap_or_default();
        dict.set_item("worker", made.worker)?;
        dict.set_item("seconds", made.seconds)?;
        dict.set_item("bytes_loaded", made.bytes_loaded)?;
        dict.set_item("requests", made.requests)?;
        dict.set_item("bytes_fetched", made.bytes_fetched)?;
        dict.set_item("seconds_waiting", made.seconds_waiting)?;
        dict.set_item("warnings", warnings)?;
        Ok(dict)
    }

    /// Ends the session; waits for it.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let worker = self.worker.lock().unwrap_or_else(PoisonError::into_inner).take();
        worker.map_or(Ok(()), |worker| worker.finish(py))
    }
}
