//! What a person sees and does, without a window: a studio, a camera that moves, the settings in force, what was found
//! and measured, a path that is recorded. The window draws it, and a browser shows it.

use super::navigate::{Navigator, Thrust};
use super::studio::{
    Ask, Comparison, Converter, Found, News, Overlay, Pace, Purpose, Scene, Shown, Studio, Wake, Wish,
};
use crate::counters::Record;
use crate::output::atomic;
use crate::scene::path::{CameraPath, Keyframe};
use crate::scene::{Camera, Projection};
use crate::session::{Named, Settings};
use crate::settings::{Direction, ImageSize, Plane};
use anyhow::{Context, Result};
use glam::DVec3;
use serde::Deserialize;
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Messages are shown for so long.
const MESSAGE: Duration = Duration::from_secs(8);
/// Most pixels of a picture in a window, as many as a screen of 4K has and more; of larger ones pictures are scaled up.
const MOST_PIXELS: f64 = 9e6;
/// Pictures that plots go back.
const HISTORY: usize = 240;
/// Seconds from one keyframe to the next while a flight is recorded.
const RECORD_S: f64 = 0.5;
/// Seconds from one keyframe to the next where a person sets them by hand.
const KEYFRAME_S: f64 = 2.0;
/// What is seen around a point that was gone to, as a share of the distance that it was seen from.
const AROUND: f64 = 0.12;

/// Something that a person should read.
#[derive(Clone, Debug)]
pub struct Message {
    /// What.
    pub text: String,
    /// Whether something went wrong.
    pub is_failure: bool,
    /// When it came.
    pub when: Instant,
}

/// What a picture took, for plots.
#[derive(Clone, Copy, Debug)]
pub struct Taken {
    /// Milliseconds.
    pub ms: f64,
    /// Bytes that were loaded.
    pub bytes: u64,
    /// Share of the pixels that are exact.
    pub exact: f64,
    /// Round trips to the device.
    pub round_trips: u64,
    /// Of the payloads of bricks that rays entered, the share that was in the cache.
    pub hits: f64,
}

/// What a click means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// What is it?
    #[default]
    Tell,
    /// Measure from here to there.
    Measure,
}

/// What is done with a node.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "snake_case")]
pub enum NodeAct {
    /// Go there.
    Go,
    /// Leave it out.
    Hide,
    /// Show it alone.
    Only,
}

/// What a person sees and does.
pub struct Viewer {
    studio: Studio,
    /// Settings in force; their size is the picture's.
    pub settings: Settings,
    /// What is painted over the picture.
    pub overlay: Overlay,
    /// The camera, once a scene is open.
    pub navigator: Option<Navigator>,
    /// The scene that is open.
    pub scene: Option<Scene>,
    /// The last picture.
    pub shown: Option<Arc<Shown>>,
    /// What was clicked on last.
    pub found: Option<Found>,
    /// What clicks mean.
    pub mode: Mode,
    /// Points that were measured: none, one, or two.
    pub measured: Vec<DVec3>,
    /// The last comparison, until it is closed.
    pub comparison: Option<Comparison>,
    /// Whether one is under way.
    pub is_comparing: bool,
    /// A camera that was left behind, and how many bricks it shows: [`Overlay::Frozen`].
    pub frozen: Option<(Camera, usize)>,
    /// The nodes that were found by name, and how many there are in all.
    pub nodes: Option<(Vec<Named>, usize)>,
    /// A node that was gone to, and its bounds, world units.
    pub located: Option<(Named, [DVec3; 2])>,
    /// Whether a node is looked for.
    pub is_locating: bool,
    /// The path that is being recorded.
    pub keyframes: Vec<Keyframe>,
    /// While a flight is recorded, seconds since it began.
    pub recording: Option<f64>,
    /// Seconds into the path while it is played.
    pub playing: Option<f64>,
    /// What to read, oldest first.
    pub messages: VecDeque<Message>,
    /// What the last pictures took.
    pub history: VecDeque<Taken>,
    /// The last wish.
    wished: Option<Wish>,
    /// What is opened once it is known how large pictures are.
    to_open: Option<PathBuf>,
    /// Whether that is known.
    is_sized: bool,
}

impl Viewer {
    /// Shows nothing yet.
    ///
    /// # Errors
    /// There is no thread.
    pub fn new(settings: &Settings, pace: Pace, converter: Converter, wake: Wake) -> Result<Self> {
        let studio = Studio::start(settings, pace, converter, wake).context("cannot start a thread")?;
        Ok(Self {
            studio,
            settings: settings.clone(),
            overlay: Overlay::None,
            navigator: None,
            scene: None,
            shown: None,
            found: None,
            mode: Mode::Tell,
            measured: Vec::new(),
            comparison: None,
            is_comparing: false,
            frozen: None,
            nodes: None,
            located: None,
            is_locating: false,
            keyframes: Vec::new(),
            recording: None,
            playing: None,
            messages: VecDeque::new(),
            history: VecDeque::new(),
            wished: None,
            to_open: None,
            is_sized: false,
        })
    }

    /// Opens a scene file, or a model, which is converted first. The first view of it fits the pictures, so it waits
    /// for the first [`Self::wish`].
    pub fn open(&mut self, path: &Path) {
        self.to_open = Some(path.into());
        self.ask_to_open();
    }

    fn ask_to_open(&mut self) {
        if let Some(path) = self.to_open.take_if(|_| self.is_sized) {
            self.studio.ask(Ask::Size(self.settings.size));
            self.studio.ask(Ask::Open(path));
        }
    }

    /// What is being converted, and how far that is.
    pub fn conversion(&self) -> Option<super::studio::Converting> {
        self.studio.conversion()
    }

    /// Takes the news. Whether there were any.
    pub fn hear(&mut self) -> bool {
        let mut heard = false;
        while let Some(news) = self.studio.news() {
            heard = true;
            match news {
                News::Opened(scene) => self.opened(*scene),
                News::Shown(shown) => self.saw(shown),
                News::Found(found, purpose) => self.found(found.map(|found| *found), purpose),
                News::Nodes(nodes, count) => self.nodes = Some((nodes, count)),
                News::Located(node, bounds) => self.located(node, bounds),
                News::Compared(comparison) => (self.comparison, self.is_comparing) = (Some(*comparison), false),
                News::Frozen(camera, bricks) => {
                    self.frozen = Some((camera, bricks));
                    self.overlay = Overlay::Frozen;
                }
                News::Saved(file) => self.say(&format!("{}: saved", file.display()), false),
                News::Told(text) => self.say(&text, false),
                News::Failed(text) => {
                    (self.is_comparing, self.is_locating) = (false, false);
                    self.say(&text, true);
                }
            }
        }
        let now = Instant::now();
        let before = self.messages.len();
        self.messages.retain(|message| now.duration_since(message.when) < MESSAGE);
        heard || self.messages.len() != before
    }

    /// Something to read.
    pub fn say(&mut self, text: &str, is_failure: bool) {
        self.messages.retain(|message| message.text != text);
        self.messages.push_back(Message { text: text.into(), is_failure, when: Instant::now() });
    }

    fn opened(&mut self, scene: Scene) {
        let camera = scene.way.frame(0, 1);
        let [min, max] = scene.bounds.map(DVec3::from_array);
        self.navigator = Some(Navigator::new(&camera, (max - min).length()));
        // What belonged to the scene before.
        (self.found, self.comparison, self.shown, self.wished) = (None, None, None, None);
        self.measured.clear();
        self.frozen = None;
        (self.nodes, self.located, self.is_locating) = (None, None, false);
        self.show_all();
        self.keyframes.clear();
        self.history.clear();
        (self.playing, self.recording) = (None, None);
        self.scene = Some(scene);
    }

    fn saw(&mut self, shown: Arc<Shown>) {
        if let (Some(navigator), Some(distance)) = (&mut self.navigator, shown.distance(0.5, 0.5)) {
            navigator.set_reach(distance);
        }
        let pixels: u64 = shown.states.iter().sum();
        self.history.push_back(Taken {
            ms: shown.ms,
            bytes: shown.loaded_bytes(),
            exact: shown.states[0] as f64 / pixels.max(1) as f64,
            round_trips: shown.records.iter().map(|record| record.round_trips).sum(),
            hits: hits(&shown),
        });
        while self.history.len() > HISTORY {
            self.history.pop_front();
        }
        self.shown = Some(shown);
    }

    fn found(&mut self, found: Option<Found>, purpose: Purpose) {
        match (purpose, found) {
            (Purpose::Tell, found) => self.found = found,
            (Purpose::Measure, Some(found)) => {
                if self.measured.len() >= 2 {
                    self.measured.clear();
                }
                self.measured.push(found.point);
            }
            (Purpose::Go, Some(found)) => {
                if let Some(navigator) = &mut self.navigator {
                    navigator.go_to(found.point, AROUND * found.distance);
                }
            }
            (Purpose::Measure | Purpose::Go, None) => {}
        }
    }

    fn located(&mut self, node: Named, bounds: Option<[DVec3; 2]>) {
        self.is_locating = false;
        let Some([min, max]) = bounds else {
            return self.say(&format!("{}: no triangle of it is stored", node.name), true);
        };
        if let Some(navigator) = &mut self.navigator {
            self.playing = None;
            navigator.go_to(0.5 * (min + max), 0.5 * (max - min).length());
        }
        self.located = Some((node, [min, max]));
    }

    /// Moves on by `seconds`. Whether the camera moved.
    pub fn advance(&mut self, thrust: Thrust, seconds: f64) -> bool {
        if !thrust.is_none() {
            self.playing = None;
        }
        if let Some(time) = self.playing {
            let (Ok(path), Some(navigator)) = (self.path(), &mut self.navigator) else {
                self.playing = None;
                return false;
            };
            navigator.put(&path.at(time));
            let last = self.keyframes.last().map_or(0.0, |last| last.time);
            self.playing = (time < last).then_some((time + seconds).min(last));
            return true;
        }
        let has_moved = self.navigator.as_mut().is_some_and(|navigator| navigator.advance(thrust, seconds));
        self.note_flight(seconds);
        has_moved
    }

    /// Records a flight from now on, in the place of the path that there is; or ends that.
    pub fn record(&mut self) {
        self.playing = None;
        match self.recording.take() {
            Some(time) => self.add_recorded(time),
            None => {
                self.keyframes.clear();
                self.recording = Some(0.0);
                self.add_recorded(0.0);
            }
        }
    }

    /// A flight that is recorded goes on for `seconds`.
    fn note_flight(&mut self, seconds: f64) {
        let Some(before) = self.recording else { return };
        let time = before + seconds;
        self.recording = Some(time);
        if self.keyframes.last().is_none_or(|last| time - last.time >= RECORD_S) {
            self.add_recorded(time);
        }
    }

    fn add_recorded(&mut self, time: f64) {
        let is_later = self.keyframes.last().is_none_or(|last| time > last.time);
        if let Some(camera) = self.camera().filter(|_| is_later) {
            let (position, target) = (camera.position.to_array(), camera.target.to_array());
            self.keyframes.push(Keyframe { time, position, target });
        }
    }

    /// Whether the camera moves by itself.
    pub fn is_moving_itself(&self) -> bool {
        self.playing.is_some()
            || self.recording.is_some()
            || self.navigator.as_ref().is_some_and(Navigator::is_in_flight)
    }

    /// The camera, once a scene is open.
    pub fn camera(&self) -> Option<Camera> {
        self.navigator.as_ref().map(Navigator::camera)
    }

    /// Tells the studio what is wished now, if that is something else than before; pictures have such a size.
    pub fn wish(&mut self, size: (u32, u32)) {
        let (width, height) = within(size, MOST_PIXELS);
        self.settings.size = ImageSize { width, height };
        self.is_sized = true;
        self.ask_to_open();
        let Some(camera) = self.camera() else { return };
        let wish = Wish { camera, settings: self.settings.clone(), overlay: self.overlay };
        if self.wished.as_ref() != Some(&wish) {
            if let Err(error) = wish.settings.check() {
                self.say(&error.to_string(), true);
                return;
            }
            self.wished = Some(wish.clone());
            self.studio.wish(wish);
        }
    }

    /// A place of the picture was clicked, a share of its width and height; `goes`: to go there.
    pub fn click(&mut self, x: f64, y: f64, goes: bool) {
        let purpose = match (goes, self.mode) {
            (true, _) => Purpose::Go,
            (false, Mode::Measure) => Purpose::Measure,
            (false, Mode::Tell) => Purpose::Tell,
        };
        self.studio.ask(Ask::What { x, y, purpose });
    }

    /// The point that is seen at a place of the last picture; without one, that in front of the camera.
    pub fn point_at(&self, x: f64, y: f64) -> Option<DVec3> {
        let camera = self.camera()?;
        let size = self.settings.size;
        let basis = camera.ray_basis(size.width, size.height);
        let direction = basis.direction(x * f64::from(size.width), y * f64::from(size.height)).normalize();
        let reach = self.navigator.as_ref().map_or(1.0, Navigator::reach);
        let distance = self.shown.as_ref().and_then(|shown| shown.distance(x, y)).unwrap_or(reach);
        Some(camera.position + direction * distance)
    }

    /// Where a point of the world is in the picture, a share of its width and height.
    pub fn place_of(&self, point: DVec3) -> Option<[f64; 2]> {
        let size = (self.settings.size.width, self.settings.size.height);
        let pixel = Projection::new(&self.camera()?, size).pixel_of_point(point)?;
        Some([pixel[0] / f64::from(size.0), pixel[1] / f64::from(size.1)])
    }

    /// The distance that was measured, world units.
    pub fn measure(&self) -> Option<f64> {
        let [a, b] = self.measured[..] else { return None };
        Some((b - a).length())
    }

    /// Looks for nodes by their names.
    pub fn find(&mut self, text: &str) {
        self.studio.ask(Ask::Find(text.into()));
    }

    /// Goes to a node, once it is known where that is, leaves it out, or shows it alone.
    pub fn act(&mut self, act: NodeAct, node: &Named) {
        let mut settings = self.settings.clone();
        let pattern = node.pattern.clone();
        match act {
            NodeAct::Go => {
                self.is_locating = true;
                return self.studio.ask(Ask::Locate(node.clone()));
            }
            NodeAct::Hide => {
                settings.hide.retain(|other| *other != pattern);
                settings.hide.push(pattern);
            }
            NodeAct::Only => (settings.only, settings.hide) = (vec![pattern], Vec::new()),
        }
        self.leave_out(settings);
    }

    /// Shows everything again.
    pub fn show_all(&mut self) {
        self.settings.hide.clear();
        self.settings.only.clear();
    }

    /// Takes settings that leave nodes out, without what does not go with that.
    fn leave_out(&mut self, settings: Settings) {
        let changed = Settings { lod: 0.0, lod_correct: None, ..settings };
        if changed.lod != self.settings.lod {
            self.say("levels of detail stand for what is hidden, too: they are off now", false);
        }
        match changed.check() {
            Ok(()) => self.settings = changed,
            Err(error) => self.say(&error.to_string(), true),
        }
    }

    /// The corners of the node that was gone to, world units.
    pub fn located_corners(&self) -> Option<[DVec3; 8]> {
        let (_, bounds) = self.located.as_ref()?;
        Some(std::array::from_fn(|i| DVec3::from_array(std::array::from_fn(|k| bounds[i >> k & 1][k]))))
    }

    /// Back to the first view.
    pub fn go_home(&mut self) {
        self.playing = None;
        if let (Some(scene), Some(navigator)) = (&self.scene, &mut self.navigator) {
            navigator.put(&scene.way.frame(0, 1));
        }
    }

    /// The whole scene, from where the camera looks.
    pub fn see_all(&mut self) {
        if let (Some(scene), Some(navigator)) = (&self.scene, &mut self.navigator) {
            let [min, max] = scene.bounds.map(DVec3::from_array);
            navigator.go_to(0.5 * (min + max), 0.25 * (max - min).length());
        }
    }

    /// Cuts the scene at the point that was clicked on, or in front of the camera, across the view; or makes it whole.
    pub fn clip(&mut self) {
        if self.settings.clip.take().is_some() {
            return;
        }
        let Some(camera) = self.camera() else { return };
        let (_, _, forward) = camera.frame();
        let reach = self.navigator.as_ref().map_or(1.0, Navigator::reach);
        let point = self.found.as_ref().map_or(camera.position + forward * (0.5 * reach), |found| found.point);
        // Along an axis, which is what plans and sections are; what is toward the camera goes.
        let axis = DVec3::AXES[(0..3).max_by(|&a, &b| forward[a].abs().total_cmp(&forward[b].abs())).unwrap_or(1)];
        let normal = Direction((axis * -forward.dot(axis).signum()).to_array());
        self.settings.clip = Some(Plane { point, normal });
    }

    /// Leaves the camera behind, to look at what it shows from elsewhere; or forgets it.
    pub fn freeze(&mut self) {
        let was_frozen = self.frozen.take().is_some();
        if was_frozen && self.overlay == Overlay::Frozen {
            self.overlay = Overlay::None;
        }
        self.studio.ask(Ask::Freeze(!was_frozen));
    }

    /// The corners of the picture of the camera that was left behind, at the distance of what is seen now, and where it
    /// is: the edges of its frustum are from there to these.
    pub fn frustum(&self) -> Option<(DVec3, [DVec3; 4])> {
        let (camera, _) = self.frozen?;
        let size = self.settings.size;
        let basis = camera.ray_basis(size.width, size.height);
        let (width, height) = (f64::from(size.width), f64::from(size.height));
        let far = (camera.target - camera.position).length();
        let corners = [[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]];
        Some((camera.position, corners.map(|[x, y]| camera.position + basis.direction(x, y) * far)))
    }

    /// Renders the exact picture and compares.
    pub fn compare(&mut self) {
        self.is_comparing = true;
        self.studio.ask(Ask::Compare);
    }

    /// Writes the picture that is shown into `folder`, under a name that nothing has.
    pub fn save_picture(&mut self, folder: &Path) {
        let name = self.scene.as_ref().and_then(|scene| Some(scene.path.file_stem()?.to_string_lossy().into_owned()));
        self.studio.ask(Ask::Save(free_name(folder, &name.unwrap_or_else(|| "brickwalk".into()), "png")));
    }

    /// Adds a keyframe where the camera is.
    pub fn add_keyframe(&mut self) {
        let time = self.keyframes.last().map_or(0.0, |last| last.time + KEYFRAME_S);
        self.add_recorded(time);
    }

    /// The path of the keyframes.
    ///
    /// # Errors
    /// There is none, or times do not ascend.
    pub fn path(&self) -> Result<CameraPath> {
        let camera = self.camera().context("no scene is open")?;
        let name = Path::new("the path");
        Ok(CameraPath::new(camera.fov_y.to_degrees(), camera.up.to_array(), self.keyframes.clone(), name)?)
    }

    /// Plays the path from its beginning, or stops.
    pub fn play(&mut self) {
        self.playing = match (self.playing, self.path()) {
            (None, Ok(path)) => Some(path.keyframes()[0].time),
            (Some(_), _) => None,
            (None, Err(error)) => {
                self.say(&format!("{error:#}"), true);
                None
            }
        };
    }

    /// Goes to a time of the path.
    pub fn scrub(&mut self, time: f64) {
        if let (Ok(path), Some(navigator)) = (self.path(), &mut self.navigator) {
            navigator.put(&path.at(time));
        }
        self.playing = None;
    }

    /// Writes the path as `walk --path` reads it into `folder`; the file, and the command that renders it.
    ///
    /// # Errors
    /// There is no path; the file cannot be written.
    pub fn save_path(&self, folder: &Path) -> Result<(PathBuf, String)> {
        let path = self.path()?;
        let scene = self.scene.as_ref().context("no scene is open")?;
        let stem = scene.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let file = free_name(folder, &format!("{stem}-path"), "json");
        atomic::write(&file, (serde_json::to_string_pretty(&path)? + "\n").as_bytes())?;
        let settings = Settings { path: Some(file.clone()), ..self.settings.clone() };
        let output = file.with_extension("");
        let options = crate::settings::Group::options(&settings);
        Ok((file, format!("brickwalk walk {} -o {} {options}", scene.path.display(), output.display())))
    }

    /// Takes the keyframes of a path file.
    ///
    /// # Errors
    /// It is none.
    pub fn load_path(&mut self, file: &Path) -> Result<()> {
        self.keyframes = CameraPath::read(file)?.keyframes().to_vec();
        Ok(())
    }
}

/// Of the payloads of bricks that rays of a picture entered, the share that was in the cache: a brick has two.
fn hits(shown: &Shown) -> f64 {
    let sum = |of: fn(&Record) -> u64| shown.records.iter().map(of).sum::<u64>() as f64;
    let (loaded, needed) = (sum(|record| record.bricks_loaded), 2.0 * sum(|record| record.bricks_needed.count()));
    (1.0 - loaded / needed.max(1.0)).max(0.0)
}

/// The size of pictures of a window that is so wide and so high: no more than `most` pixels, of the same shape.
pub fn within((width, height): (u32, u32), most: f64) -> (u32, u32) {
    let (width, height) = (f64::from(width.max(1)), f64::from(height.max(1)));
    let factor = (most / (width * height)).sqrt().min(1.0);
    // A side that is a pixel leaves the other one too long.
    let of = |side: f64| (side * factor).floor().clamp(1.0, most.sqrt() * 4.0) as u32;
    (of(width), of(height))
}

/// A file in `folder` that does not exist: `stem.ending`, or `stem-2.ending` and so on.
fn free_name(folder: &Path, stem: &str, ending: &str) -> PathBuf {
    let name = |number: u32| match number {
        1 => folder.join(format!("{stem}.{ending}")),
        number => folder.join(format!("{stem}-{number}.{ending}")),
    };
    (1..).map(name).find(|file| !file.exists()).unwrap_or_else(|| name(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_bounded() {
        let most = 4e6;
        let size = |width: u32, height: u32| within((width, height), most);
        assert_eq!((size(1280, 720), size(0, 0)), ((1280, 720), (1, 1)));
        let (width, height) = size(7680, 4320);
        assert!(f64::from(width) * f64::from(height) <= most);
        assert!((f64::from(width) / f64::from(height) - 16.0 / 9.0).abs() < 0.01);
        for (width, height) in [(u32::MAX, u32::MAX), (u32::MAX, 1), (1, u32::MAX)] {
            let (width, height) = size(width, height);
            assert!(f64::from(width) * f64::from(height) <= most);
        }
    }
}
