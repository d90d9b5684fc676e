//! What the engine does: overlays, and plots of what pictures took.

use crate::settings::sizes::human_bytes;
use crate::view::studio::Overlay;
use crate::view::viewer::Taken;
use crate::view::window::desk::Desk;
use egui::{Color32, Sense, Stroke, Ui, Vec2, pos2};

/// Height of a plot, points.
const HEIGHT: f32 = 36.0;

/// The panel.
pub fn show(desk: &mut Desk, ui: &mut Ui) {
    let viewer = &mut desk.viewer;
    ui.horizontal_wrapped(|ui| {
        for &overlay in Overlay::ALL {
            ui.selectable_value(&mut viewer.overlay, overlay, overlay.name());
        }
    });
    let text = if viewer.frozen.is_some() { "Let the camera go (C)" } else { "Leave the camera behind (C)" };
    let hint = "Fly on and look at the bricks that the camera shows: green are its own, red are others.";
    if ui.button(text).on_hover_text(hint).clicked() {
        viewer.freeze();
    }
    if let Some((_, bricks)) = viewer.frozen {
        ui.weak(format!("it shows {bricks} bricks"));
    }
    let history: Vec<Taken> = viewer.history.iter().copied().collect();
    if let Some(last) = history.last() {
        let line = |ui: &mut Ui, name: &str, now: String, of: fn(&Taken) -> f64| {
            ui.horizontal(|ui| {
                ui.label(name);
                ui.weak(now);
            });
            plot(ui, &history.iter().map(of).collect::<Vec<_>>());
        };
        line(ui, "milliseconds a picture", format!("{:.0}", last.ms), |taken| taken.ms);
        line(ui, "loaded", human_bytes(last.bytes), |taken| taken.bytes as f64);
        line(ui, "exact pixels", format!("{:.1} %", 100.0 * last.exact), |taken| taken.exact);
        line(ui, "cache hits", format!("{:.1} %", 100.0 * last.hits), |taken| taken.hits);
        line(ui, "round trips", last.round_trips.to_string(), |taken| taken.round_trips as f64);
    }
    let can = viewer.shown.is_some() && !viewer.is_comparing;
    let text = if viewer.is_comparing { "comparing" } else { "Compare with exact" };
    if ui.add_enabled(can, egui::Button::new(text)).clicked() {
        viewer.compare();
    }
}

/// A line from 0 to the greatest value.
fn plot(ui: &mut Ui, values: &[f64]) {
    let (rect, _) = ui.allocate_exact_size(Vec2::new(ui.available_width().min(250.0), HEIGHT), Sense::hover());
    let painter = ui.painter();
    painter.rect_filled(rect, 2.0, ui.visuals().extreme_bg_color);
    let greatest = values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let at = |(k, &value): (usize, &f64)| {
        let x = k as f32 / (values.len().max(2) - 1) as f32;
        pos2(rect.left() + x * rect.width(), rect.bottom() - 1.0 - (value / greatest) as f32 * (rect.height() - 3.0))
    };
    let points: Vec<_> = values.iter().enumerate().map(at).collect();
    painter.line(points, Stroke::new(1.0, Color32::LIGHT_BLUE));
}
