//! What the thread of a scene owns: the scene, and once they are needed a device for rays and a session for pictures.

use crate::worker::{State, Task};
use anyhow::Result;
use bricks::SceneFile;
use brickwalk::counters::Counters;
use brickwalk::cpu::available_memory;
use brickwalk::query::{Queries, QueryStats};
use brickwalk::session::trace::{for_rays, trace};
use brickwalk::session::{Hit, Opened, Ray};
use brickwalk::settings::{Adapter, CacheSize};
use brickwalk::stream::PayloadSource;
use brickwalk::{Session, Settings};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Bytes of the cache of queries where nobody tells how much memory is available.
const LEAST_ROOM: u64 = 1 << 30;

/// How a scene is opened.
#[derive(Clone, Debug)]
pub struct Options {
    /// The scene file.
    pub path: PathBuf,
    /// Device memory for bricks: of rays, and of pictures as much again.
    pub cache: CacheSize,
    /// The device.
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
    /// What tracing these rays counted.
    pub traced: Counters,
    /// What rendering these pictures counted.
    pub rendered: Counters,
    /// Queries of geometry.
    pub queries: u64,
    /// What these took.
    pub queried: QueryStats,
    /// The device of rays, once it is open.
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
    opened: Option<Opened>,
    /// For pictures.
    pub session: Option<Session>,
    queries: Option<Queries>,
    /// What was done.
    pub done: Shared,
}

impl Held {
    /// A scene without a device.
    pub fn new(options: Options, scene: Arc<SceneFile>, done: Shared) -> Self {
        Self { options, scene, opened: None, session: None, queries: None, done }
    }

    fn opened(&mut self) -> Result<&mut Opened> {
        let opened = match self.opened.take() {
            Some(opened) => opened,
            None => {
                let settings = for_rays(&self.options.settings());
                let opened = Opened::open(self.scene.clone(), &self.options.path, &settings)?;
                lock(&self.done).device = Some(opened.executor.device().name);
                opened
            }
        };
        Ok(self.opened.insert(opened))
    }

    /// The closest hits of rays, or with `any` whether there is one, in their order.
    ///
    /// # Errors
    /// No device; a damaged brick.
    pub fn trace(&mut self, rays: &[Ray], any: bool, task: &Task) -> Result<Vec<Hit>> {
        let opened = self.opened()?;
        let (hits, counters) = trace(&mut opened.traced(), rays, any, &mut |rays| task.advance(rays))?;
        let mut done = lock(&self.done);
        *if any { &mut done.occlusion_rays } else { &mut done.rays } += rays.len() as u64;
        done.hits += hits.iter().filter(|hit| hit.triangle != u32::MAX).count() as u64;
        done.traced.add(&counters);
        Ok(hits)
    }

    /// Asks about geometry, with a cache in host memory.
    ///
    /// # Errors
    /// No thread; that of `ask`.
    pub fn ask<T>(&mut self, ask: impl FnOnce(&Queries) -> Result<T>) -> Result<T> {
        let queries = match self.queries.take() {
            Some(queries) => queries,
            None => {
                let room = available_memory().map_or(LEAST_ROOM, |bytes| bytes / 2);
                Queries::new(self.scene.clone(), self.options.cache.bytes(self.scene.sizes().sum(), room), 0)?
            }
        };
        let queries = self.queries.insert(queries);
        let answer = ask(queries);
        let mut done = lock(&self.done);
        done.queries += 1;
        done.queried = queries.stats();
        answer
    }
}

impl State for Held {
    fn reset(&mut self) {
        (self.opened, self.session, self.queries) = (None, None, None);
    }
}
