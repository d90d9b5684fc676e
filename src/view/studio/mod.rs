//! What renders for a window or a browser: a thread with a session. It is told what a person wishes to see, of which
//! the latest counts, and gives pictures, sooner rather than finer. When nothing is wished any more it refines the
//! last picture until every pixel is exact.
//!
//! Nobody waits for it: wishes and questions go into an inbox, news come out of a channel.

mod boxes;
mod inbox;
#[cfg(test)]
mod inbox_tests;
mod inspect;
mod overlay;
mod pace;
mod steps;
mod worker;

pub use inspect::{Comparison, Found};
pub use overlay::{Overlay, STATES};
pub use pace::Pace;

use crate::counters::Record;
use crate::frame::PixelState;
use crate::scene::Camera;
use crate::scene::path::CameraPath;
use crate::session::{Named, Settings};
use crate::settings::ImageSize;
use anyhow::Result;
use brickwalk_convert::progress::Progress;
use glam::DVec3;
use inbox::Inbox;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, channel};
use std::thread::JoinHandle;

/// What a person wishes to see.
#[derive(Clone, Debug, PartialEq)]
pub struct Wish {
    /// From where.
    pub camera: Camera,
    /// How: size, effects, light, quality.
    pub settings: Settings,
    /// What is painted over the picture.
    pub overlay: Overlay,
}

/// What a person asks, answered in order.
#[derive(Clone, Debug)]
pub enum Ask {
    /// Open a scene file or a model, which is converted first.
    Open(PathBuf),
    /// Scenes that are opened from now on are first seen in pictures of this size.
    Size(ImageSize),
    /// What is seen at this place, a share of the picture's width and height?
    What {
        /// From the left.
        x: f64,
        /// From the top.
        y: f64,
        /// What the answer is for.
        purpose: Purpose,
    },
    /// How far is the picture from the exact one?
    Compare,
    /// Write the picture as it is shown to this file, a PNG.
    Save(PathBuf),
    /// Which nodes have this in their names?
    Find(String),
    /// Where is this node, and how large? Bricks are read for it while pictures go on.
    Locate(Named),
    /// Lose the device that renders, as drivers do: what is shown must come back.
    LoseDevice,
    /// Keep in mind which bricks the picture shows, for [`Overlay::Frozen`]; or forget them.
    Freeze(bool),
}

/// What a place is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// To be told what is there.
    Tell,
    /// To go there.
    Go,
    /// To measure from or to it.
    Measure,
}

/// How a picture came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// The camera moves: fewer pixels, one sample, levels of detail.
    Moving,
    /// The camera rests, and the picture becomes finer.
    Refining,
    /// It is what `walk` writes.
    Done,
}

/// A picture.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Counts pictures: another one has another number.
    pub number: u64,
    /// From where.
    pub camera: Camera,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// sRGB, row by row from the top.
    pub pixels: Vec<[u8; 3]>,
    /// Distance of what each pixel shows, world units, infinite where it shows nothing.
    pub depth: Vec<f32>,
    /// How it came about.
    pub stage: Stage,
    /// Samples a pixel.
    pub samples: u32,
    /// Pixels that are exact, bounded and unresolved.
    pub states: [u64; 3],
    /// Milliseconds that it took.
    pub ms: f64,
    /// What its passes did.
    pub records: Vec<Record>,
    /// Stops (EV) that it is exposed by.
    pub exposure_ev: f64,
    /// What the colours of the overlay say.
    pub legend: String,
}

impl Shown {
    /// Distance of what is seen at a place, a share of width and height; `None`: nothing is.
    pub fn distance(&self, x: f64, y: f64) -> Option<f64> {
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let [x, y] = [(x, width), (y, height)].map(|(share, size)| ((share * size as f64) as usize).min(size - 1));
        self.depth.get(y * width + x).map(|&depth| f64::from(depth)).filter(|depth| depth.is_finite())
    }

    /// Bytes that were loaded for it.
    pub fn loaded_bytes(&self) -> u64 {
        self.records.iter().map(Record::loaded_bytes).sum()
    }

    /// Whether all pixels are exact.
    pub fn is_exact(&self) -> bool {
        self.states[PixelState::Bounded as usize] + self.states[PixelState::Unresolved as usize] == 0
    }
}

/// What a scene is, for panels.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The file that was asked for.
    pub path: PathBuf,
    /// The scene file.
    pub file: PathBuf,
    /// Corners of its bounds, world units.
    pub bounds: [[f64; 3]; 2],
    /// Triangles, placed.
    pub triangles: u64,
    /// Bricks.
    pub bricks: usize,
    /// Bytes of all bricks and tiles of textures, and of the cache.
    pub bytes: [u64; 2],
    /// Whether it has levels of detail.
    pub has_levels: bool,
    /// What renders.
    pub device: String,
    /// The path that the settings name, or one made from the scene's bounds.
    pub way: CameraPath,
}

/// What comes out.
#[derive(Clone, Debug)]
pub enum News {
    /// A scene is open.
    Opened(Box<Scene>),
    /// A picture.
    Shown(Arc<Shown>),
    /// What is at a place; `None`: nothing.
    Found(Option<Box<Found>>, Purpose),
    /// The first nodes with what was asked for in their names, and how many there are.
    Nodes(Vec<Named>, usize),
    /// The bounds of a node, world units; `None`: none of it is stored.
    Located(Named, Option<[DVec3; 2]>),
    /// How far the picture is from the exact one.
    Compared(Box<Comparison>),
    /// A picture was written.
    Saved(PathBuf),
    /// The picture of this camera shows so many bricks, which are kept in mind.
    Frozen(Camera, usize),
    /// What a person should know.
    Told(String),
    /// What went wrong. What can be shown is shown on.
    Failed(String),
}

/// Makes a scene file of what was asked for: of a model a converted one. It may take long, and tells how far it is.
pub type Converter = Arc<dyn Fn(&Path, &Progress) -> Result<PathBuf> + Send + Sync>;

/// Wakes whoever waits for news.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// A thread that renders.
pub struct Studio {
    inbox: Arc<Inbox>,
    news: Receiver<News>,
    thread: Option<JoinHandle<()>>,
}

impl Studio {
    /// Starts one. `wake` is called after each of the news.
    ///
    /// # Errors
    /// There is no thread.
    pub fn start(settings: &Settings, pace: Pace, converter: Converter, wake: Wake) -> std::io::Result<Self> {
        let inbox = Arc::new(Inbox::default());
        let (sender, news) = channel();
        let tell = worker::Teller { sender, wake };
        let (settings, own) = (settings.clone(), inbox.clone());
        // Sessions stay in the thread that they are made in.
        let work = move || worker::Worker::new(settings, pace, own, converter, tell).run();
        let thread = std::thread::Builder::new().name("studio".into()).spawn(work)?;
        Ok(Self { inbox, news, thread: Some(thread) })
    }

    /// This is wished from now on.
    pub fn wish(&self, wish: Wish) {
        self.inbox.wish(wish);
    }

    /// Asks something.
    pub fn ask(&self, ask: Ask) {
        self.inbox.ask(ask);
    }

    /// The next of the news, if there is one.
    pub fn news(&self) -> Option<News> {
        self.news.try_recv().ok()
    }

    /// What is being converted, and how far that is.
    pub fn conversion(&self) -> Option<Converting> {
        self.inbox.conversion().map(|(path, progress)| Converting { path, so_far: progress.so_far() })
    }
}

/// A model that is being converted.
#[derive(Clone, Debug)]
pub struct Converting {
    /// Which.
    pub path: PathBuf,
    /// The phase, its steps that are done, and all; 0: not known.
    pub so_far: (String, u64, u64),
}

impl Drop for Studio {
    fn drop(&mut self) {
        self.inbox.quit();
        if let Some(thread) = self.thread.take() {
            // It has told whatever there was to tell.
            let _ = thread.join();
        }
    }
}
