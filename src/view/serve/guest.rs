//! One session of a page: what it tells becomes wishes, pictures go out one at a time, each after the last was taken.

use super::Options;
use super::encode::encoded;
use super::told::{MOST_PIXELS, Told, number, set};
use crate::settings::Group;
use crate::settings::sizes::human_count;
use crate::view::navigate::Thrust;
use crate::view::studio::{Converter, Overlay, Shown, Stage};
use crate::view::viewer::{Mode, Viewer, within};
use anyhow::Result;
use axum::extract::ws::{Message, WebSocket};
use glam::DVec3;
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::Notify;

/// A camera that moves moves so often.
const EVERY: Duration = Duration::from_millis(16);
/// A page that has not said within so long how large it is has the usual size.
const HELLO: Duration = Duration::from_millis(500);
/// A page that has not taken a picture for so long has gone, and so has one that reads nothing of what it is told.
const PATIENCE: Duration = Duration::from_secs(60);
/// Most messages of a page in a second: far more than a hand can make.
const MOST_MESSAGES: u32 = 1000;

/// A session.
struct Guest {
    viewer: Viewer,
    size: (u32, u32),
    thrust: Thrust,
    pivot: Option<DVec3>,
    /// When the picture that the page has not taken yet was sent.
    sent: Option<Instant>,
    /// The picture that was sent last.
    last: Option<Arc<Shown>>,
    /// The state that was told last.
    state: Value,
    moved: Instant,
    /// Answers that are still to be sent.
    answers: Vec<Value>,
}

/// Serves a page until it goes, or the server ends.
pub async fn receive(mut socket: WebSocket, options: &Options, converter: Converter, ends: Arc<Notify>) {
    let news = Arc::new(Notify::new());
    let wake = news.clone();
    let viewer = Viewer::new(&options.settings, options.pace, converter, Arc::new(move || wake.notify_one()));
    let mut guest = match viewer {
        Ok(viewer) => Guest::new(viewer, options),
        Err(error) => {
            let told = json!({"failed": format!("{error:#}")});
            let _ = socket.send(Message::Text(told.to_string().into())).await;
            return;
        }
    };
    guest.viewer.open(&options.scene);
    // Whatever ends it, the page is told nothing more.
    let _ = serve(&mut socket, &mut guest, &news, &ends).await;
    // A studio ends with the picture that it is at.
    let _ = tokio::task::spawn_blocking(move || drop(guest)).await;
}

async fn serve(socket: &mut WebSocket, guest: &mut Guest, news: &Notify, ends: &Notify) -> Result<()> {
    let mut first = Some(HELLO);
    let (mut since, mut messages) = (Instant::now(), 0);
    loop {
        let every = first.take().unwrap_or(if guest.is_moving() { EVERY } else { PATIENCE });
        let mut told = None;
        tokio::select! {
            message = socket.recv() => match message {
                Some(Ok(message)) => told = Some(message),
                _ => return Ok(()),
            },
            () = news.notified() => {}
            () = tokio::time::sleep(every) => {}
            () = ends.notified() => return Ok(()),
        }
        // All that has come is taken before the camera moves on, so that a slow machine does not fall behind its pages.
        while let Some(message) = told {
            if since.elapsed() > Duration::from_secs(1) {
                (since, messages) = (Instant::now(), 0);
            }
            messages += 1;
            if messages > MOST_MESSAGES {
                return Ok(());
            }
            match message {
                Message::Text(text) => guest.tell(&text),
                Message::Close(_) => return Ok(()),
                _ => {}
            }
            told = tokio::select! {
                biased;
                message = socket.recv() => match message {
                    Some(Ok(message)) => Some(message),
                    _ => return Ok(()),
                },
                () = std::future::ready(()) => None,
            };
        }
        if guest.sent.is_some_and(|sent| sent.elapsed() > PATIENCE) {
            return Ok(());
        }
        guest.advance();
        for answer in guest.news() {
            send(socket, Message::Text(answer.to_string().into())).await?;
        }
        if let Some(picture) = guest.picture()? {
            send(socket, Message::Binary(picture.into())).await?;
        }
    }
}

/// Sends a message; one that the page does not read ends its session.
async fn send(socket: &mut WebSocket, message: Message) -> Result<()> {
    Ok(tokio::time::timeout(PATIENCE, socket.send(message)).await??)
}

impl Guest {
    fn new(viewer: Viewer, options: &Options) -> Self {
        let size = options.settings.size;
        Self {
            viewer,
            size: (size.width, size.height),
            thrust: Thrust::default(),
            pivot: None,
            sent: None,
            last: None,
            state: Value::Null,
            moved: Instant::now(),
            answers: Vec::new(),
        }
    }

    fn is_moving(&self) -> bool {
        !self.thrust.is_none() || self.viewer.is_moving_itself() || self.viewer.conversion().is_some()
    }

    /// Takes what a page tells. What is wrong with it is said, and changes nothing.
    fn tell(&mut self, text: &str) {
        let told = match serde_json::from_str(text) {
            Ok(told) => told,
            Err(error) => return self.viewer.say(&format!("the page said what is not understood: {error}"), true),
        };
        let turn = std::f64::consts::PI;
        let viewer = &mut self.viewer;
        match told {
            Told::Taken => self.sent = None,
            Told::Size { width, height } => self.size = within((width, height), MOST_PIXELS),
            Told::Thrust { forward, right, up, fast } => {
                let [forward, right, up] = [forward, right, up].map(|x| number(x, 1.0));
                self.thrust = Thrust { forward, right, up, is_fast: fast };
            }
            Told::Look { right, up } => {
                viewer.playing = None;
                if let Some(navigator) = &mut viewer.navigator {
                    navigator.look(number(right, turn), number(up, turn));
                }
            }
            Told::Orbit { at, right, up } => {
                viewer.playing = None;
                if let Some([x, y]) = at {
                    self.pivot = viewer.point_at(number(x, 1.0), number(y, 1.0));
                }
                if let (Some(pivot), Some(navigator)) = (self.pivot, &mut viewer.navigator) {
                    navigator.orbit(pivot, number(right, turn), number(up, turn));
                }
            }
            Told::Dolly { at: [x, y], steps } => {
                let point = viewer.point_at(number(x, 1.0), number(y, 1.0));
                if let (Some(point), Some(navigator)) = (point, &mut viewer.navigator) {
                    navigator.dolly(point, number(steps, 20.0));
                }
            }
            Told::Click { at: [x, y], double } => viewer.click(number(x, 1.0), number(y, 1.0), double),
            Told::Measure { on } => viewer.mode = if on { Mode::Measure } else { Mode::Tell },
            Told::Home => viewer.go_home(),
            Told::All => viewer.see_all(),
            Told::Clip => viewer.clip(),
            Told::Find { text } => viewer.find(&text),
            Told::Node { act, number } => {
                let node = match number {
                    Some(number) => viewer.nodes.as_ref().and_then(|(nodes, _)| nodes.get(number)),
                    None => viewer.found.as_ref().and_then(|found| found.node.as_ref()),
                };
                match node.cloned() {
                    Some(node) => viewer.act(act, &node),
                    None => viewer.say("there is no such node", true),
                }
            }
            Told::ShowAll => viewer.show_all(),
            Told::Freeze => viewer.freeze(),
            Told::Overlay { name } => match name.parse() {
                Ok(overlay) => viewer.overlay = overlay,
                Err(error) => viewer.say(&format!("overlay: {error}"), true),
            },
            Told::Set { key, value } => {
                if let Err(error) = set(&mut viewer.settings, &key, &value) {
                    viewer.say(&error.to_string(), true);
                }
            }
            Told::Keyframe => viewer.add_keyframe(),
            Told::Record => viewer.record(),
            Told::ForgetPath => viewer.keyframes.clear(),
            Told::Play => viewer.play(),
            Told::Path => match viewer.path() {
                Ok(path) => self.answers.push(json!({"path": path})),
                Err(error) => viewer.say(&format!("{error:#}"), true),
            },
            Told::Compare => viewer.compare(),
        }
    }

    /// Moves on, and tells the studio.
    fn advance(&mut self) {
        let now = Instant::now();
        let seconds = now.duration_since(self.moved).as_secs_f64();
        self.moved = now;
        self.viewer.hear();
        self.viewer.advance(self.thrust, seconds);
        self.viewer.wish(self.size);
    }

    /// What the page is told beside pictures: answers, and what is otherwise than before.
    fn news(&mut self) -> Vec<Value> {
        let mut all = std::mem::take(&mut self.answers);
        let state = self.state();
        if state != self.state {
            self.state = state.clone();
            all.push(json!({"state": state}));
        }
        all
    }

    fn state(&self) -> Value {
        let viewer = &self.viewer;
        let scene = viewer.scene.as_ref().map(|scene| {
            json!({
                "name": scene.path.file_name().unwrap_or_default().to_string_lossy(),
                "triangles": human_count(scene.triangles),
                "bricks": scene.bricks,
                "device": scene.device,
                "levels": scene.has_levels,
            })
        });
        let settings: serde_json::Map<String, Value> = super::told::open()
            .iter()
            .filter_map(|&key| Some((key.to_owned(), Value::from(viewer.settings.get(key)?.to_string()))))
            .collect();
        let nodes = viewer.nodes.as_ref().map(|(nodes, count)| {
            let names: Vec<&str> = nodes.iter().map(|node| node.name.as_str()).collect();
            json!({"names": names, "count": count})
        });
        let located = viewer.located.as_ref().map(|(node, [min, max])| {
            let size = (*max - *min).to_array();
            json!({"name": node.name, "size": size})
        });
        let conversion = viewer.conversion().map(|own| {
            let (phase, done, all) = own.so_far;
            json!({"phase": phase, "done": done, "all": all})
        });
        let comparison =
            viewer.comparison.as_ref().map(|own| json!({"flip": own.flip, "rmse": own.rmse, "ms": own.ms}));
        let messages: Vec<Value> =
            viewer.messages.iter().map(|message| json!({"text": message.text, "failed": message.is_failure})).collect();
        json!({
            "scene": scene,
            "settings": settings,
            "overlay": viewer.overlay.name(),
            "overlays": Overlay::NAMES,
            "found": viewer.found.as_ref().map(|found| found.lines()),
            "has_node": viewer.found.as_ref().is_some_and(|found| found.node.is_some()),
            "nodes": nodes,
            "located": located,
            "left_out": [&viewer.settings.hide, &viewer.settings.only],
            "measuring": viewer.mode == Mode::Measure,
            "measured": viewer.measure(),
            "keyframes": viewer.keyframes.len(),
            "playing": viewer.playing.is_some(),
            "recording": viewer.recording.is_some(),
            "conversion": conversion,
            "comparing": viewer.is_comparing,
            "comparison": comparison,
            "messages": messages,
        })
    }

    /// The next picture as it goes out, if the page has taken the one before: the length of its head, 4 bytes, little
    /// endian; the head, JSON; the picture.
    fn picture(&mut self) -> Result<Option<Vec<u8>>> {
        let Some(shown) = self.viewer.shown.clone().filter(|_| self.sent.is_none()) else { return Ok(None) };
        if self.last.as_ref().is_some_and(|last| Arc::ptr_eq(last, &shown)) {
            return Ok(None);
        }
        let (bytes, kind) = encoded(&shown)?;
        let stage = match shown.stage {
            Stage::Moving => "moving",
            Stage::Refining => "refining",
            Stage::Done => "done",
        };
        let camera = shown.camera;
        let head = json!({
            "kind": kind,
            "size": [shown.size.0, shown.size.1],
            "stage": stage,
            "samples": shown.samples,
            "states": shown.states,
            "ms": shown.ms,
            "loaded": shown.loaded_bytes(),
            "position": camera.position.to_array(),
            "legend": shown.legend,
        });
        let head = head.to_string();
        let mut message = (head.len() as u32).to_le_bytes().to_vec();
        message.extend_from_slice(head.as_bytes());
        message.extend_from_slice(&bytes);
        (self.sent, self.last) = (Some(Instant::now()), Some(shown));
        Ok(Some(message))
    }
}
