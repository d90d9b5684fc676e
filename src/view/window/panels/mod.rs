//! The panels of the window, one file each.

mod conversion;
mod light;
mod look;
mod nodes;
mod over;
mod paths;
mod plots;
mod scene;

pub use over::{comparison, help, messages};

use super::desk::Desk;
use crate::settings::sizes::human_bytes;
use crate::view::studio::Stage;
use crate::view::viewer::Viewer;
use egui::{CollapsingHeader, ScrollArea, TextureHandle, Ui};

/// What panels remember between frames.
#[derive(Default)]
pub struct State {
    /// A path that is being typed.
    open: String,
    /// The name of a node that is looked for.
    node: String,
    /// The name of an environment's image.
    environment: String,
    /// The command that renders a path which was saved.
    command: String,
    /// A path file that is to be loaded.
    path: String,
    /// The map of a comparison, with its number, as it was last drawn.
    map: Option<TextureHandle>,
}

/// The panel at the side.
pub fn side(desk: &mut Desk, ui: &mut Ui) {
    type Draw = fn(&mut Desk, &mut Ui);
    let all: [(&str, bool, Draw); 8] = [
        ("Scene", true, scene::show),
        ("View", true, look::view),
        ("Picture", true, look::picture),
        ("Light", false, light::show),
        ("What it does", true, plots::show),
        ("What is it?", true, scene::found),
        ("Nodes", false, nodes::show),
        ("Path", false, paths::show),
    ];
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        for (title, is_open, draw) in all {
            CollapsingHeader::new(title).default_open(is_open).show(ui, |ui| draw(desk, ui));
        }
    });
}

/// The line at the bottom.
pub fn status(viewer: &Viewer, ui: &mut Ui) {
    ui.horizontal(|ui| {
        if let Some(converting) = viewer.conversion() {
            conversion::show(&converting, ui);
        }
        let Some(shown) = &viewer.shown else {
            ui.label(if viewer.scene.is_some() { "the first picture is made" } else { "F1: help" });
            return;
        };
        let pixels: u64 = shown.states.iter().sum();
        let exact = 100.0 * shown.states[0] as f64 / pixels.max(1) as f64;
        let stage = match shown.stage {
            Stage::Moving => "moving",
            Stage::Refining => "refining",
            Stage::Done => "done",
        };
        let (width, height) = shown.size;
        ui.label(stage);
        ui.separator();
        // A picture that lacks a pixel does not say that it has all of them.
        let exact = if shown.is_exact() { "all exact".to_owned() } else { format!("{:.2} % exact", exact.min(99.99)) };
        ui.label(exact);
        ui.separator();
        ui.label(format!("{width} x {height}, {} spp", shown.samples));
        ui.separator();
        ui.label(format!("{:.0} ms", shown.ms));
        ui.separator();
        ui.label(format!("{} loaded", human_bytes(shown.loaded_bytes())));
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| ui.label("F1: help"));
    });
}
