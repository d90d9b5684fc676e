//! What the thread of a scene owns: the scene, and once they are needed queries and a session for pictures.

use crate::worker::State;
use anyhow::Result;
use bricks::SceneFile;
use brickwalk::counters::Counters;
use brickwalk::query::{Queries, QueryStats};
use brickwalk::settings::{Adapter, CacheSize};
use brickwalk::{Session, Settings};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// How a scene is opened.
#[derive(Clone, Debug)]
pub struct Options {
    /// The scene file.
    pub path: PathBuf,
    /// Memory for bricks: host memory of queries, and of pictures as much again on their device.
    pub cache: CacheSize,
    /// The device of pictures.
    pub adapter: Adapter,
}

impl Options {
    /// Settings of a session.
    pub fn settings(&self) -> Settings {
        Settings { cache: self.cache, adapter: self.adapter.clone(), ..Settings::default() }
    }
}

/// What was done since a scene was opened.
#[derive(Debug, Default)]
pub struct Done {
    /// Rays whose closest hit was looked for.
    pub rays: u64,
    /// Rays of which was asked only whether they hit something.
    pub occlusion_rays: u64,
    /// Rays of both kinds that hit something.
    pub hits: u64,
    /// Pictures.
    pub pictures: u64,
    /// What rendering these pictures counted.
    pub rendered: Counters,
    /// Queries.
    pub queries: u64,
    /// Seconds that they took.
    pub seconds: f64,
    /// What they read.
    pub queried: QueryStats,
    /// The device of pictures, once it is open.
    pub device: Option<String>,
}

/// What was done, for the scene's thread and those that ask.
pub type Shared = Arc<Mutex<Done>>;

/// What was done; a panic elsewhere leaves numbers alone.
pub fn lock(done: &Shared) -> MutexGuard<'_, Done> {
    done.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What the thread of a scene owns.
pub struct Held {
    /// How it was opened.
    pub options: Options,
    /// The scene.
    pub scene: Arc<SceneFile>,
    /// For pictures.
    pub session: Option<Session>,
    queries: Option<Queries>,
    /// What was done.
    pub done: Shared,
}

impl Held {
    /// A scene of which nothing has been asked.
    pub fn new(options: Options, scene: Arc<SceneFile>, done: Shared) -> Self {
        Self { options, scene, session: None, queries: None, done }
    }

    /// What is asked about geometry, with a cache in host memory.
    fn queries(&mut self) -> Result<&Queries> {
        let queries = match self.queries.take() {
            Some(queries) => queries,
            None => Queries::new(self.scene.clone(), self.options.cache, 0)?,
        };
        Ok(self.queries.insert(queries))
    }

    /// Begins a query, and says how many rows are best given to [`Self::ask`] at a time.
    ///
    /// # Errors
    /// No thread.
    pub fn begin(&mut self) -> Result<usize> {
        let batch = self.queries()?.batch();
        lock(&self.done).queries += 1;
        Ok(batch)
    }

    /// Asks about geometry.
    ///
    /// # Errors
    /// No thread; that of `ask`.
    pub fn ask<T>(&mut self, ask: impl FnOnce(&Queries) -> Result<T>) -> Result<T> {
        let clock = Instant::now();
        let queries = self.queries()?;
        let answer = ask(queries);
        let stats = queries.stats();
        let mut done = lock(&self.done);
        done.seconds += clock.elapsed().as_secs_f64();
        done.queried = stats;
        answer
    }
}

impl State for Held {
    fn reset(&mut self) {
        (self.session, self.queries) = (None, None);
    }
}
