//! The thread of a studio: one thing after the other, the latest wish first.

use super::boxes::Boxes;
use super::inbox::{Inbox, Turn};
use super::inspect::{compared, found};
use super::overlay::Pixels;
use super::pace::{Refinement, Scale};
use super::steps::{Sights, steps};
use super::{Ask, Converter, News, Overlay, Pace, Purpose, Scene, Shown, Stage, Wake, Wish};
use crate::frame::{FrameWatch, PixelState};
use crate::output::png;
use crate::schedule::cache::Cache;
use crate::secondary::EffectMethods;
use crate::session::{Frame, Named, Session, Settings, Watch, developed, extent, find};
use crate::stream::PayloadSource;
use anyhow::{Context, Result, anyhow};
use brickwalk_convert::progress::Progress;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

/// A scene that failed is opened again after so long.
const AGAIN: Duration = Duration::from_secs(2);

/// Nodes that are told of those found.
const MOST_NODES: usize = 50;

/// Tells news.
#[derive(Clone)]
pub struct Teller {
    /// Where to.
    pub sender: Sender<News>,
    /// Called after each.
    pub wake: Wake,
}

impl Teller {
    fn tell(&self, news: News) {
        // Whoever does not listen any more does not want to know.
        let _ = self.sender.send(news);
        (self.wake)();
    }
}

/// Stops a picture when something newer is wished.
struct Gives<'a> {
    inbox: &'a Inbox,
    is_patient: bool,
}

impl FrameWatch for Gives<'_> {
    fn passes(&mut self, _: u32, _: u32) -> bool {
        self.is_patient || !self.inbox.is_newer()
    }
}

impl Watch for Gives<'_> {
    fn field(&mut self, _: u64, _: u64) -> bool {
        self.is_patient || !self.inbox.is_newer()
    }
}

/// What a camera that was left behind shows.
#[derive(Default)]
struct Left {
    /// Its bricks.
    bricks: HashSet<u32>,
    /// The front of the tile in the middle of its picture; `None`: no camera was left.
    front: Option<Boxes>,
}

/// What is next if nothing new comes.
enum Plan {
    /// Nothing.
    Idle,
    /// The picture of a camera that has just moved.
    Move,
    /// The pictures of a camera that rests.
    Refine(Refinement),
    /// Open the scene again, then.
    Open(Instant),
}

/// Why there is no picture.
enum Trouble {
    /// Settings that cannot be had. What is open stays open.
    Refused(anyhow::Error),
    /// The scene, the disk or the device.
    Broken(anyhow::Error),
}

impl From<anyhow::Error> for Trouble {
    fn from(error: anyhow::Error) -> Self {
        Self::Broken(error)
    }
}

impl Trouble {
    fn into_error(self) -> anyhow::Error {
        match self {
            Self::Refused(error) | Self::Broken(error) => error,
        }
    }
}

/// The thread.
pub struct Worker {
    /// Settings that scenes are opened with before anything is wished.
    settings: Settings,
    pace: Pace,
    inbox: Arc<Inbox>,
    converter: Converter,
    tell: Teller,
    /// What was asked to be opened, and the scene file.
    path: Option<(PathBuf, PathBuf)>,
    session: Option<Session>,
    wish: Option<Wish>,
    plan: Plan,
    scale: Scale,
    /// Whether something stands in for what is missing.
    has_levels: bool,
    /// The last picture that was told, what was wished, and how it came about.
    last: Option<(Frame, Wish, (Stage, f64))>,
    /// What [`Overlay::Frozen`] and [`Overlay::Fronts`] show of a camera that was left behind.
    left: Left,
    /// The failure that was told last.
    failure: String,
}

impl Worker {
    /// Of a studio.
    pub fn new(settings: Settings, pace: Pace, inbox: Arc<Inbox>, converter: Converter, tell: Teller) -> Self {
        Self {
            settings,
            pace,
            inbox,
            converter,
            tell,
            path: None,
            session: None,
            wish: None,
            plan: Plan::Idle,
            scale: Scale::new(),
            has_levels: false,
            last: None,
            left: Left::default(),
            failure: String::new(),
        }
    }

    /// Works until it is told to quit.
    pub fn run(mut self) {
        loop {
            let most = match &self.plan {
                Plan::Idle => None,
                Plan::Move | Plan::Refine(_) => Some(self.pause()),
                Plan::Open(when) => Some(when.saturating_duration_since(Instant::now())),
            };
            match self.inbox.next(most) {
                Turn::Quit => return,
                Turn::Ask(ask) => self.answer(ask),
                Turn::Converted(path, Ok(file)) => self.open(path, file),
                Turn::Converted(_, Err(text)) => self.fail(&anyhow!(text)),
                Turn::Wish(wish) => {
                    let is_same = self.wish.as_ref().is_some_and(|own| *own == *wish);
                    let is_view = |own: &Wish| own.camera == wish.camera && own.settings == wish.settings;
                    let is_view = self.wish.as_ref().is_some_and(is_view);
                    self.wish = Some(*wish);
                    if is_view && !is_same && self.repaint().is_some() {
                        continue;
                    }
                    if !is_same && self.path.is_some() {
                        let is_open = self.session.is_some();
                        self.plan = if is_open { Plan::Move } else { Plan::Open(Instant::now()) };
                        self.show();
                    }
                }
                Turn::Nothing => self.show(),
            }
        }
    }

    /// How long to wait for a wish before a camera is taken to rest: not at all once it is refined.
    fn pause(&self) -> Duration {
        match &self.plan {
            Plan::Refine(steps) if steps.next().0 == 1 && !steps.next().1 && self.is_of_moving() => self.pace.pause,
            _ => Duration::ZERO,
        }
    }

    fn is_of_moving(&self) -> bool {
        let size = self.wish.as_ref().map(|wish| (wish.settings.size.width, wish.settings.size.height));
        self.last.as_ref().is_none_or(|(frame, ..)| Some(frame.size) != size)
    }

    /// Makes and tells the next picture of the plan.
    fn show(&mut self) {
        let done = match &self.plan {
            Plan::Idle => return,
            Plan::Open(_) => {
                if let Some((path, file)) = self.path.clone() {
                    self.open(path, file);
                }
                return;
            }
            Plan::Move => self.moving(),
            Plan::Refine(steps) => self.refine(*steps),
        };
        match done {
            Ok(plan) => {
                self.failure.clear();
                self.plan = plan;
            }
            Err(Trouble::Refused(error)) => {
                self.fail(&error);
                self.plan = Plan::Idle;
            }
            Err(Trouble::Broken(error)) => {
                self.fail(&error);
                self.session = None;
                self.plan = Plan::Open(Instant::now() + AGAIN);
            }
        }
    }

    /// The session, with these settings.
    fn with(&mut self, settings: &Settings) -> Result<&mut Session, Trouble> {
        let (_, file) = self.path.clone().context("no scene is open")?;
        let is_other = self.session.as_ref().is_some_and(|session| session.needs_opening(settings));
        if is_other {
            // What it holds is let go before there is another.
            self.session = None;
        }
        let session = match self.session.take() {
            Some(session) => session,
            None => Session::open(&file, settings).map_err(Trouble::from)?,
        };
        let session = self.session.insert(session);
        session.set(settings).map_err(Trouble::Refused)?;
        for warning in session.take_warnings() {
            self.tell.tell(News::Told(warning));
        }
        Ok(session)
    }

    fn moving(&mut self) -> Result<Plan, Trouble> {
        let Some(wish) = self.wish.clone() else { return Ok(Plan::Idle) };
        let settings = self.pace.of_moving(&wish.settings, self.scale.factor(), self.has_levels);
        let start = Instant::now();
        let halves = self.pace.halves(&wish.settings);
        self.with(&settings)?.set_half_rate(halves);
        let set = start.elapsed();
        if let Some(ms) = self.picture(&wish, Stage::Moving, true)? {
            let all = ms + set.as_secs_f64() * 1e3;
            self.scale.note(all, self.pace.moving.as_secs_f64() * 1e3);
        }
        Ok(Plan::Refine(Refinement::new(wish.settings.samples())))
    }

    fn refine(&mut self, mut steps: Refinement) -> Result<Plan, Trouble> {
        let Some(wish) = self.wish.clone() else { return Ok(Plan::Idle) };
        let (samples, waits) = steps.next();
        let settings = self.pace.of_resting(&wish.settings, samples, waits);
        self.with(&settings)?.set_half_rate(false);
        let stage = if samples == wish.settings.samples() { Stage::Done } else { Stage::Refining };
        if self.picture(&wish, stage, false)?.is_none() {
            return Ok(Plan::Refine(steps));
        }
        let Some((frame, ..)) = &self.last else { return Ok(Plan::Idle) };
        let pixels = frame.pixels.radiance.len() as u64;
        let states = states(frame);
        Ok(if steps.note(states[0], pixels) { Plan::Idle } else { Plan::Refine(steps) })
    }

    /// Tells the last picture again, under another overlay; `None`: it is not that of the wish, or the executor holds
    /// another by now.
    fn repaint(&mut self) -> Option<()> {
        let wish = self.wish.clone()?;
        let (frame, of, taken) = self.last.as_ref()?;
        let session = self.session.as_mut()?;
        if (of.camera, &of.settings) != (wish.camera, &wish.settings) || session.renderer().size != frame.size {
            return None;
        }
        // Who answers is noted as a picture is made.
        if wish.overlay == Overlay::Methods && session.answers().is_none() {
            return None;
        }
        let shown = shown(session, frame, &wish, &self.left, *taken).ok()?;
        self.last.as_mut()?.1 = wish;
        self.tell.tell(News::Shown(Arc::new(shown)));
        Some(())
    }

    /// Makes a picture and tells it; its milliseconds, or `None`: something newer came.
    fn picture(&mut self, wish: &Wish, stage: Stage, is_patient: bool) -> Result<Option<f64>> {
        let session = self.session.as_mut().context("no scene is open")?;
        let start = Instant::now();
        let mut gives = Gives { inbox: &self.inbox, is_patient };
        session.note_answers(wish.overlay == Overlay::Methods);
        let Some(frame) = session.picture(&wish.camera, &mut gives)? else { return Ok(None) };
        let ms = start.elapsed().as_secs_f64() * 1e3;
        let shown = shown(session, &frame, wish, &self.left, (stage, ms))?;
        self.last = Some((frame, wish.clone(), (stage, ms)));
        self.tell.tell(News::Shown(Arc::new(shown)));
        Ok(Some(ms))
    }

    fn answer(&mut self, ask: Ask) {
        let answered = match ask {
            Ask::Open(path) => self.convert(path),
            Ask::Size(size) => {
                self.settings.size = size;
                Ok(())
            }
            Ask::What { x, y, purpose } => self.what(x, y, purpose),
            Ask::Compare => self.compare(),
            Ask::Save(file) => self.save(&file),
            Ask::Find(text) => self.find(&text),
            Ask::Locate(node) => self.locate(node),
            Ask::LoseDevice => self.lose_device(),
            Ask::Freeze(true) => self.freeze(),
            Ask::Freeze(false) => {
                self.left = Left::default();
                Ok(())
            }
        };
        if let Err(error) = answered {
            self.fail(&error);
        }
    }

    fn fail(&mut self, error: &anyhow::Error) {
        let text = format!("{error:#}");
        // What fails again every few seconds is told once.
        if text != self.failure {
            self.tell.tell(News::Failed(text.clone()));
            self.failure = text;
        }
    }

    /// Makes a scene file of `path` in the background; what is shown is shown meanwhile.
    fn convert(&mut self, path: PathBuf) -> Result<()> {
        let (inbox, converter, progress) = (self.inbox.clone(), self.converter.clone(), Progress::hidden());
        self.failure.clear();
        inbox.begin_conversion(path.clone(), progress.clone());
        let work = move || {
            let made = converter(&path, &progress).map_err(|error| format!("{error:#}"));
            inbox.end_conversion(path, made);
        };
        std::thread::Builder::new().name("convert".into()).spawn(work)?;
        Ok(())
    }

    /// Opens a scene file.
    fn open(&mut self, path: PathBuf, file: PathBuf) {
        // A wish is one of the scene before until the window has heard of this one.
        let is_again = self.path.as_ref().is_some_and(|(_, own)| *own == file);
        let settings = match &self.wish {
            Some(wish) if is_again => wish.settings.clone(),
            _ => self.settings.clone(),
        };
        self.session = None;
        match Session::open(&file, &self.pace.opening(&settings)) {
            Ok(mut session) => {
                self.path = Some((path.clone(), file.clone()));
                let mut warnings = session.take_warnings();
                // The panel of the scene says so, of a budget that nobody has asked for.
                warnings.retain(|line| settings.frame_budget().is_some() || !line.starts_with("--frame-budget"));
                let scene = describe(&mut session, path, file);
                self.has_levels = scene.has_levels;
                self.session = Some(session);
                if is_again && self.wish.is_some() {
                    self.plan = Plan::Move;
                    self.tell.tell(News::Told("the scene is open again".into()));
                    self.failure.clear();
                    return;
                }
                (self.wish, self.last, self.plan) = (None, None, Plan::Idle);
                self.left = Left::default();
                self.scale = Scale::new();
                self.tell.tell(News::Opened(Box::new(scene)));
                for warning in warnings {
                    self.tell.tell(News::Told(warning));
                }
            }
            Err(error) => {
                self.fail(&error);
                // The one before is still there to be shown.
                self.plan = if self.path.is_some() { Plan::Open(Instant::now() + AGAIN) } else { Plan::Idle };
            }
        }
    }

    fn what(&mut self, x: f64, y: f64, purpose: Purpose) -> Result<()> {
        let Some(wish) = self.wish.clone() else { return Ok(()) };
        let session = self.session.as_mut().context("no scene is open")?;
        let size = wish.settings.size;
        let aspect = f64::from(size.width) / f64::from(size.height);
        let found = found(session, &wish.camera, (x, y), aspect)?;
        self.tell.tell(News::Found(found.map(Box::new), purpose));
        Ok(())
    }

    fn compare(&mut self) -> Result<()> {
        let (shown, wish, _) = self.last.clone().context("there is no picture to compare")?;
        let resting = self.pace.of_resting(&wish.settings, wish.settings.samples(), true);
        let secondary = EffectMethods::EXACT;
        let exact = Settings { secondary, lod: 0.0, lod_correct: None, denoise: false, ..resting };
        // Of the size that is shown.
        let size = crate::settings::ImageSize { width: shown.size.0, height: shown.size.1 };
        let exact = Settings { size, ..exact };
        let start = Instant::now();
        let is_other = self.session.as_ref().is_none_or(|session| session.needs_opening(&exact));
        let frame = if is_other {
            let (_, file) = self.path.clone().context("no scene is open")?;
            Session::open(file, &exact)?.picture(&wish.camera, &mut ())?
        } else {
            self.with(&exact).map_err(Trouble::into_error)?.picture(&wish.camera, &mut ())?
        };
        let frame = frame.context("interrupted")?;
        let ms = start.elapsed().as_secs_f64() * 1e3;
        self.tell.tell(News::Compared(Box::new(compared(&shown, &frame, ms)?)));
        Ok(())
    }

    fn find(&mut self, text: &str) -> Result<()> {
        let session = self.session.as_mut().context("no scene is open")?;
        let scene = session.renderer().scene.clone();
        let (nodes, count) = find(&scene.resident().manifest, text, MOST_NODES);
        self.tell.tell(News::Nodes(nodes, count));
        Ok(())
    }

    /// Finds the bounds of a node in a thread of its own, as all of a scene may be read for it.
    fn locate(&mut self, node: Named) -> Result<()> {
        let session = self.session.as_mut().context("no scene is open")?;
        let (scene, tell) = (session.renderer().scene.clone(), self.tell.clone());
        let work = move || {
            tell.tell(match extent(&scene, &node.ids) {
                Ok(bounds) => News::Located(node, bounds),
                Err(error) => News::Failed(format!("{}: {error}", node.name)),
            });
        };
        std::thread::Builder::new().name("locate".into()).spawn(work)?;
        Ok(())
    }

    fn lose_device(&mut self) -> Result<()> {
        let session = self.session.as_mut().context("no scene is open")?;
        session.renderer().executor.lose_device();
        // What is shown is made anew.
        self.plan = Plan::Move;
        Ok(())
    }

    fn freeze(&mut self) -> Result<()> {
        let (frame, wish, _) = self.last.as_ref().context("there is no picture yet")?;
        let camera = wish.camera;
        let session = self.session.as_mut().context("no scene is open")?;
        let bricks: HashSet<u32> = session.bricks_seen()?.into_iter().flatten().map(|(brick, _)| brick).collect();
        let tile = session.renderer().tile;
        let sights = Sights { camera: &camera, size: frame.size, tile, depth: &frame.pixels.depth };
        let front = Boxes { tile: None, ..Boxes::of_middle(session.renderer().scene.resident(), &sights) };
        self.tell.tell(News::Frozen(camera, bricks.len()));
        self.left = Left { bricks, front: Some(front) };
        Ok(())
    }

    fn save(&mut self, file: &Path) -> Result<()> {
        let (frame, wish, taken) = self.last.as_ref().context("there is no picture to save")?;
        let session = self.session.as_mut().context("no scene is open")?;
        let shown = shown(session, frame, wish, &self.left, *taken)?;
        png::write(file, shown.size.0, shown.size.1, &shown.pixels)?;
        self.tell.tell(News::Saved(file.into()));
        Ok(())
    }
}

/// Pixels that are exact, bounded and unresolved.
fn states(frame: &Frame) -> [u64; 3] {
    if frame.pixels.state.is_empty() {
        return [frame.pixels.radiance.len() as u64, 0, 0];
    }
    [PixelState::Exact, PixelState::Bounded, PixelState::Unresolved]
        .map(|state| frame.pixels.state.iter().filter(|own| **own == state).count() as u64)
}

/// `frame` as it is shown, with the overlay that is wished.
fn shown(session: &mut Session, frame: &Frame, wish: &Wish, left: &Left, (stage, ms): (Stage, f64)) -> Result<Shown> {
    static NUMBER: AtomicU64 = AtomicU64::new(1);
    let bricks = if wish.overlay.shows_bricks() { session.bricks_seen()? } else { Vec::new() };
    let (scene, tile) = (session.renderer().scene.clone(), session.renderer().tile);
    let sights = Sights { camera: &wish.camera, size: frame.size, tile, depth: &frame.pixels.depth };
    let cached = &session.renderer().cache.states;
    let is_counted = |brick: u32| wish.overlay == Overlay::Steps && cached.geometry(brick as usize).is_some();
    let walks = matches!(wish.overlay, Overlay::Queries | Overlay::Steps);
    let steps = walks.then(|| steps(&scene, &is_counted, &sights)).transpose()?;
    let own =
        (wish.overlay == Overlay::Fronts && left.front.is_none()).then(|| Boxes::of_middle(scene.resident(), &sights));
    let mut pixels = developed(&frame.pixels.radiance, frame.exposure_ev, frame.tone_map);
    let of = Pixels {
        size: frame.size,
        tile,
        states: &frame.pixels.state,
        depth: &frame.pixels.depth,
        normals: &frame.pixels.normal,
        bricks: &bricks,
        frozen: &left.bricks,
        camera: &wish.camera,
        steps: steps.as_ref(),
        front: left.front.as_ref().or(own.as_ref()),
        answers: session.answers().unwrap_or_default(),
    };
    wish.overlay.paint(&of, &mut pixels);
    let legend = wish.overlay.legend(&of);
    let states = states(frame);
    Ok(Shown {
        number: NUMBER.fetch_add(1, Ordering::Relaxed),
        camera: wish.camera,
        size: frame.size,
        pixels,
        depth: frame.pixels.depth.clone(),
        stage: if stage == Stage::Done && states[1] + states[2] > 0 { Stage::Refining } else { stage },
        samples: session.settings().samples(),
        states,
        ms,
        records: frame.records.clone(),
        exposure_ev: frame.exposure_ev,
        legend,
    })
}

fn describe(session: &mut Session, path: PathBuf, file: PathBuf) -> Scene {
    let way = session.path().clone();
    let renderer = session.renderer();
    let scene = renderer.scene.clone();
    let manifest = &scene.resident().manifest;
    let cache: &Cache = &renderer.cache;
    Scene {
        path,
        file,
        bounds: [manifest.min, manifest.max],
        triangles: manifest.triangles_instanced,
        bricks: scene.resident().bricks.len(),
        bytes: [scene.sizes().sum(), cache.residency.budget_bytes()],
        has_levels: !scene.resident().levels.is_empty(),
        device: renderer.executor.device().name,
        way,
    }
}
