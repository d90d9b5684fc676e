//! What the window is made of: panels, the picture between them, and what keys and the mouse do there.

use super::panels;
use super::recent::Recent;
use crate::view::navigate::Thrust;
use crate::view::studio::{Overlay, Stage};
use crate::view::viewer::{Mode, NodeAct, Viewer};
use egui::{Align2, Color32, Event, FontId, Key, PointerButton, Pos2, Rect, Response, Sense, Stroke, Ui, Vec2};
use glam::DVec3;
use std::path::PathBuf;

/// Radians that the camera turns when the mouse is dragged over the height of the picture.
const TURN: f64 = 2.2;
/// Points of the wheel that are a step.
const WHEEL: f32 = 50.0;

/// What the window has to do beside drawing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Asked {
    /// End.
    pub quit: bool,
    /// Change between a window and the full screen.
    pub full_screen: bool,
}

/// A window's content.
pub struct Desk {
    /// What a person sees and does.
    pub viewer: Viewer,
    /// Scenes that were opened before, and views that were kept.
    pub recent: Recent,
    /// Whether the help is shown.
    pub is_help: bool,
    /// Whether the panel at the side is shown.
    pub has_panel: bool,
    /// Where screenshots and paths go.
    pub folder: PathBuf,
    /// What panels remember.
    pub state: panels::State,
    /// Where the picture is, in points.
    pub picture: Rect,
    /// The point that the camera turns about while a button is held.
    pivot: Option<DVec3>,
}

/// What a key does in the window, for the help.
pub const KEYS: [(&str, &str); 19] = [
    ("W A S D", "fly forward, left, back, right"),
    ("Q E", "fly down, up"),
    ("Shift", "faster"),
    ("drag", "look around"),
    ("right drag", "turn about the point under the mouse"),
    ("wheel", "nearer to, farther from the point under the mouse"),
    ("click", "what is it? In measuring mode: measure from here to there"),
    ("double click", "go there"),
    ("M", "measuring mode"),
    ("X", "cut the scene open at what was clicked on, or make it whole"),
    ("H I U", "hide what was clicked on; show it alone; show everything again"),
    ("O", "next overlay"),
    ("C", "leave the camera behind, to see its bricks from elsewhere"),
    ("Home, F", "first view; the whole scene"),
    ("K, R, Space", "set a keyframe; record a flight, or stop; play the path"),
    ("P", "screenshot"),
    ("Tab, F11", "hide the panel; full screen"),
    ("Escape", "leave a mode, close what is open"),
    ("F1, Ctrl-Q", "this help; quit"),
];

impl Desk {
    /// With nothing shown yet.
    pub fn new(viewer: Viewer, recent: Recent, folder: PathBuf) -> Self {
        Self {
            viewer,
            recent,
            is_help: false,
            has_panel: true,
            folder,
            state: panels::State::default(),
            picture: Rect::ZERO,
            pivot: None,
        }
    }

    /// Lays out and draws a frame of the window, of `seconds` after the one before, and takes what was typed and
    /// clicked since then.
    pub fn show(&mut self, ui: &mut Ui, seconds: f64) -> Asked {
        self.viewer.hear();
        if let Some(scene) = self.viewer.scene.as_ref().filter(|scene| self.recent.is_new(&scene.path)) {
            self.recent.opened(&scene.path.clone());
        }
        let dropped = ui.input(|input| input.raw.dropped_files.first().map(|file| file.path().to_path_buf()));
        if let Some(path) = dropped {
            self.viewer.open(&path);
        }
        let asked = self.keys(ui);
        if self.has_panel {
            egui::Panel::left("panel").resizable(true).default_size(270.0).show(ui, |ui| panels::side(self, ui));
        }
        egui::Panel::bottom("status").show(ui, |ui| panels::status(&self.viewer, ui));
        self.picture = ui.available_rect_before_wrap();
        let response = ui.interact(self.picture, ui.scope_id().with("picture"), Sense::click_and_drag());
        self.mouse(ui, &response);
        let thrust = self.thrust(ui);
        self.viewer.advance(thrust, seconds);
        self.marks(ui);
        panels::messages(&self.viewer, ui, self.picture);
        panels::comparison(&mut self.viewer, &mut self.state, ui);
        if self.is_help {
            panels::help(&mut self.is_help, ui);
        }
        if !thrust.is_none() || self.viewer.is_moving_itself() {
            ui.ctx().request_repaint();
        } else if self.viewer.conversion().is_some() || !self.viewer.messages.is_empty() {
            ui.ctx().request_repaint_after_secs(0.1);
        }
        let scale = ui.ctx().pixels_per_point();
        let of = |points: f32| (points * scale).round().max(1.0) as u32;
        self.viewer.wish((of(self.picture.width()), of(self.picture.height())));
        asked
    }

    /// What keys ask for that are no thrust.
    fn keys(&mut self, ui: &Ui) -> Asked {
        let mut asked = Asked::default();
        let types = ui.ctx().egui_wants_keyboard_input();
        // With the modifiers of the moment: by the end of a frame they may have been let go.
        let was_pressed = |wanted: Key, with_command: bool| {
            ui.input(|input| {
                input.events.iter().any(|event| match event {
                    Event::Key { key, pressed: true, repeat: false, modifiers, .. } => {
                        *key == wanted && modifiers.command == with_command
                    }
                    _ => false,
                })
            })
        };
        let pressed = |key: Key| was_pressed(key, false);
        asked.quit = was_pressed(Key::Q, true);
        asked.full_screen = pressed(Key::F11);
        if pressed(Key::F1) {
            self.is_help = !self.is_help;
        }
        if pressed(Key::Escape) {
            self.escape();
        }
        if types {
            return asked;
        }
        let viewer = &mut self.viewer;
        if pressed(Key::P) {
            viewer.save_picture(&self.folder);
        }
        if pressed(Key::M) {
            viewer.mode = if viewer.mode == Mode::Measure { Mode::Tell } else { Mode::Measure };
        }
        if pressed(Key::O) {
            let next = Overlay::ALL.iter().position(|&overlay| overlay == viewer.overlay).map_or(0, |at| at + 1);
            viewer.overlay = Overlay::ALL[next % Overlay::ALL.len()];
        }
        if pressed(Key::X) {
            viewer.clip();
        }
        let node = viewer.found.as_ref().and_then(|found| found.node.clone());
        if let Some(node) = &node {
            for (key, act) in [(Key::H, NodeAct::Hide), (Key::I, NodeAct::Only)] {
                if pressed(key) {
                    viewer.act(act, node);
                }
            }
        }
        if pressed(Key::U) {
            viewer.show_all();
        }
        if pressed(Key::C) {
            viewer.freeze();
        }
        if pressed(Key::Home) {
            viewer.go_home();
        }
        if pressed(Key::F) {
            viewer.see_all();
        }
        if pressed(Key::K) {
            viewer.add_keyframe();
        }
        if pressed(Key::R) {
            viewer.record();
        }
        if pressed(Key::Space) {
            viewer.play();
        }
        if pressed(Key::Tab) {
            self.has_panel = !self.has_panel;
        }
        asked
    }

    /// Leaves a mode, or closes what is open; one thing at a time.
    fn escape(&mut self) {
        let viewer = &mut self.viewer;
        if self.is_help {
            self.is_help = false;
        } else if viewer.comparison.take().is_some() || viewer.playing.take().is_some() {
            // Closed, or stopped.
        } else if viewer.mode != Mode::Tell {
            viewer.mode = Mode::Tell;
        } else {
            viewer.measured.clear();
            (viewer.found, viewer.located, viewer.overlay) = (None, None, Overlay::None);
        }
    }

    /// Which way the keys that are held fly.
    fn thrust(&self, ui: &Ui) -> Thrust {
        if ui.ctx().egui_wants_keyboard_input() {
            return Thrust::default();
        }
        ui.input(|input| {
            if input.modifiers.command {
                return Thrust::default();
            }
            let of = |more, less| f64::from(input.key_down(more)) - f64::from(input.key_down(less));
            Thrust {
                forward: of(Key::W, Key::S),
                right: of(Key::D, Key::A),
                up: of(Key::E, Key::Q),
                is_fast: input.modifiers.shift,
            }
        })
    }

    /// A place in the window as a share of the picture.
    fn place(&self, at: Pos2) -> (f64, f64) {
        let share = (at - self.picture.min) / self.picture.size().max(Vec2::splat(1.0));
        (f64::from(share.x), f64::from(share.y))
    }

    fn mouse(&mut self, ui: &Ui, response: &Response) {
        if response.clicked() || response.drag_started() {
            // Keys fly again.
            ui.ctx().memory_mut(|memory| memory.stop_text_input());
        }
        if let Some(at) = response.interact_pointer_pos().or_else(|| response.hover_pos()) {
            let (x, y) = self.place(at);
            if response.double_clicked() {
                self.viewer.click(x, y, true);
            } else if response.clicked() {
                self.viewer.click(x, y, false);
            }
            if response.drag_started_by(PointerButton::Secondary) {
                self.pivot = self.viewer.point_at(x, y);
            }
            let steps = if response.hovered() { ui.input(|input| input.smooth_scroll_delta.y) / WHEEL } else { 0.0 };
            let point = if steps == 0.0 { None } else { self.viewer.point_at(x, y) };
            if let (Some(point), Some(navigator)) = (point, &mut self.viewer.navigator) {
                navigator.dolly(point, f64::from(steps));
            }
        }
        let drag = response.drag_delta();
        let Some(navigator) = self.viewer.navigator.as_mut().filter(|_| drag != Vec2::ZERO) else { return };
        let turn = TURN / f64::from(self.picture.height().max(1.0));
        let (right, down) = (f64::from(drag.x) * turn, f64::from(drag.y) * turn);
        if response.dragged_by(PointerButton::Primary) {
            navigator.look(right, -down);
        } else if let (true, Some(pivot)) = (response.dragged_by(PointerButton::Secondary), self.pivot) {
            navigator.orbit(pivot, -right, -down);
        }
        self.viewer.playing = None;
    }

    /// What was found, measured and recorded, over the picture.
    fn marks(&self, ui: &Ui) {
        let viewer = &self.viewer;
        let painter = ui.painter().with_clip_rect(self.picture);
        let at = |point: DVec3| {
            let [x, y] = viewer.place_of(point)?;
            Some(self.picture.min + Vec2::new(x as f32, y as f32) * self.picture.size())
        };
        let dot = |place: Option<Pos2>, color: Color32| {
            if let Some(place) = place {
                painter.circle(place, 4.0, color, Stroke::new(1.0, Color32::BLACK));
            }
        };
        if let Some(found) = &viewer.found {
            dot(at(found.point), Color32::YELLOW);
        }
        let ends: Vec<_> = viewer.measured.iter().map(|&point| at(point)).collect();
        if let ([Some(a), Some(b)], Some(distance)) = (&ends[..], viewer.measure()) {
            painter.line_segment([*a, *b], Stroke::new(2.0, Color32::LIGHT_BLUE));
            let middle = *a + (*b - *a) * 0.5;
            label(&painter, middle, &format!("{distance:.4}"));
        }
        ends.into_iter().for_each(|end| dot(end, Color32::LIGHT_BLUE));
        if let Some((from, corners)) = viewer.frustum() {
            let edge = Stroke::new(1.5, Color32::from_rgb(255, 220, 90));
            let corners = corners.map(at);
            for k in 0..4 {
                for ends in [[at(from), corners[k]], [corners[k], corners[(k + 1) % 4]]] {
                    if let [Some(a), Some(b)] = ends {
                        painter.line_segment([a, b], edge);
                    }
                }
            }
        }
        if let Some(corners) = viewer.located_corners() {
            let edge = Stroke::new(1.0, Color32::from_rgb(120, 220, 255));
            let corners = corners.map(at);
            for (a, b) in (0..8usize).flat_map(|a| [1, 2, 4].map(|bit| (a, a | bit))).filter(|(a, b)| a != b) {
                if let [Some(a), Some(b)] = [corners[a], corners[b]] {
                    painter.line_segment([a, b], edge);
                }
            }
        }
        if viewer.keyframes.len() > 1 && viewer.playing.is_none() {
            viewer.keyframes.iter().for_each(|key| dot(at(key.position.into()), Color32::LIGHT_GREEN));
        }
        if let Some(shown) = viewer.shown.as_ref().filter(|shown| !shown.legend.is_empty()) {
            label(&painter, self.picture.center_bottom() - Vec2::new(0.0, 16.0), &shown.legend);
        }
        if viewer.mode == Mode::Measure {
            label(&painter, self.picture.center_top() + Vec2::new(0.0, 16.0), "measuring: click on two points");
        }
        let is_refined = viewer.shown.as_ref().is_none_or(|shown| shown.stage != Stage::Moving);
        if viewer.scene.is_none() && is_refined {
            let text = match viewer.conversion() {
                Some(_) => "the model is converted into bricks, once",
                None => "drop a .bricks file or a model here",
            };
            label(&painter, self.picture.center(), text);
        }
    }
}

/// A line of text on a dark ground.
fn label(painter: &egui::Painter, at: Pos2, text: &str) {
    let galley = painter.layout_no_wrap(text.into(), FontId::proportional(14.0), Color32::WHITE);
    let rect = Align2::CENTER_CENTER.anchor_size(at, galley.size());
    painter.rect_filled(rect.expand(4.0), 3.0, Color32::from_black_alpha(180));
    painter.galley(rect.min, galley, Color32::WHITE);
}
