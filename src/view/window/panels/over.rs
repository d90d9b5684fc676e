//! What lies over the picture: messages, the help, a comparison.

use super::State;
use crate::view::viewer::Viewer;
use crate::view::window::desk::KEYS;
use egui::{Align2, Area, Color32, ColorImage, Frame, Grid, Label, Rect, TextureOptions, Ui, Vec2, Window};

/// Width of what is told, points.
const WIDTH: f32 = 420.0;

/// What a person should read, at the top of the picture.
pub fn messages(viewer: &Viewer, ui: &Ui, picture: Rect) {
    if viewer.messages.is_empty() {
        return;
    }
    let at = picture.min + Vec2::splat(10.0);
    Area::new(egui::Id::unique("messages")).fixed_pos(at).interactable(false).show(ui.ctx(), |ui| {
        ui.set_max_width(WIDTH.min(picture.width() - 20.0));
        for message in &viewer.messages {
            let color = if message.is_failure { Color32::from_rgb(255, 140, 120) } else { Color32::WHITE };
            Frame::popup(ui.style()).show(ui, |ui| {
                ui.add(Label::new(egui::RichText::new(&message.text).color(color)).wrap());
            });
        }
    });
}

/// What keys and the mouse do.
pub fn help(is_open: &mut bool, ui: &Ui) {
    Window::new("Help").open(is_open).resizable(false).anchor(Align2::CENTER_CENTER, Vec2::ZERO).show(ui.ctx(), |ui| {
        Grid::new("keys").striped(true).show(ui, |ui| {
            for (key, what) in KEYS {
                ui.strong(key);
                ui.label(what);
                ui.end_row();
            }
        });
        ui.separator();
        ui.label("A pixel is exact: it shows the hit that brute force finds.");
        ui.label("Bounded: something is missing, and a level of detail stands in for it.");
        ui.label("Unresolved: something is missing, and nothing stands in for it yet.");
        ui.label("A camera that rests makes every pixel exact. The picture is then that of walk.");
    });
}

/// The map of a comparison, until it is closed.
pub fn comparison(viewer: &mut Viewer, state: &mut State, ui: &Ui) {
    let Some(comparison) = &viewer.comparison else {
        state.map = None;
        return;
    };
    let map = state.map.get_or_insert_with(|| {
        let (width, height) = comparison.size;
        let pixels = comparison.map.iter().map(|&[r, g, b]| Color32::from_rgb(r, g, b)).collect();
        let image = ColorImage::new([width as usize, height as usize], pixels);
        ui.ctx().load_texture("flip", image, TextureOptions::LINEAR)
    });
    let mut is_open = true;
    Window::new("Compared with the exact picture").open(&mut is_open).show(ui.ctx(), |ui| {
        ui.label(format!("FLIP {:.4}, RMSE {:.4}", comparison.flip, comparison.rmse));
        ui.label(format!("the exact picture took {:.0} ms", comparison.ms));
        let size = map.size_vec2();
        let width = size.x.min(480.0);
        ui.image((map.id(), Vec2::new(width, size.y * width / size.x.max(1.0))));
        ui.weak("black: the same; violet, red, yellow, white: more and more different");
    });
    if !is_open {
        viewer.comparison = None;
    }
}
