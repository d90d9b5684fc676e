//! Which scene is open, and what was clicked on.

use super::nodes;
use crate::settings::sizes::{human_bytes, human_count};
use crate::view::viewer::Mode;
use crate::view::window::desk::Desk;
use egui::{Button, Label, TextEdit, Ui};
use std::path::Path;

/// The scene, and how to open another one.
pub fn show(desk: &mut Desk, ui: &mut Ui) {
    if let Some(scene) = &desk.viewer.scene {
        let name = scene.path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        ui.strong(name).on_hover_text(scene.path.display().to_string());
        ui.label(format!("{} triangles, {} bricks", human_count(scene.triangles), human_count(scene.bricks as u64)));
        let [all, cache] = scene.bytes.map(human_bytes);
        ui.label(format!("{all}, of which the cache holds {cache}"));
        ui.label(scene.device.clone());
        if !scene.has_levels {
            ui.weak("no levels of detail").on_hover_text("What has not arrived is not shown. Convert with --lod on.");
        }
    }
    ui.horizontal(|ui| {
        let field = TextEdit::singleline(&mut desk.state.open).hint_text("file to open").desired_width(150.0);
        let entered = ui.add(field).lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
        let pressed = ui.add_enabled(!desk.state.open.trim().is_empty(), Button::new("Open")).clicked();
        if (entered || pressed) && !desk.state.open.trim().is_empty() {
            let path = desk.state.open.trim().to_owned();
            desk.viewer.open(Path::new(&path));
        }
    });
    if !desk.recent.scenes.is_empty() {
        ui.menu_button("Recent", |ui| {
            for path in desk.recent.scenes.clone() {
                let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                if ui.button(name).on_hover_text(path.display().to_string()).clicked() {
                    desk.viewer.open(&path);
                    ui.close();
                }
            }
        });
    }
}

/// What was clicked on, and what was measured.
pub fn found(desk: &mut Desk, ui: &mut Ui) {
    let viewer = &mut desk.viewer;
    match &viewer.found {
        Some(found) => found.lines().into_iter().for_each(|line| {
            ui.add(Label::new(line).wrap());
        }),
        None => drop(ui.weak("click on something")),
    }
    if let Some(node) = viewer.found.as_ref().and_then(|found| found.node.clone()) {
        nodes::acts(viewer, &node, ui);
    }
    let mut measures = viewer.mode == Mode::Measure;
    if ui.checkbox(&mut measures, "Measure (M)").changed() {
        viewer.mode = if measures { Mode::Measure } else { Mode::Tell };
    }
    if let Some(distance) = viewer.measure() {
        ui.label(format!("measured: {distance:.6}"));
        let between = viewer.measured[1] - viewer.measured[0];
        ui.label(format!("along x, y, z: {:.4} {:.4} {:.4}", between.x, between.y, between.z));
    }
}
