//! A camera path: keyframes, played and saved.

use crate::view::window::desk::Desk;
use egui::{DragValue, Label, TextEdit, Ui};
use std::path::Path;

/// The panel.
pub fn show(desk: &mut Desk, ui: &mut Ui) {
    let viewer = &mut desk.viewer;
    ui.horizontal(|ui| {
        if ui.button("Keyframe here").on_hover_text("K").clicked() {
            viewer.add_keyframe();
        }
        let text = if viewer.recording.is_some() { "Stop recording" } else { "Record" };
        if ui.button(text).on_hover_text("R: a keyframe every half second, in the place of this path").clicked() {
            viewer.record();
        }
        let text = if viewer.playing.is_some() { "Stop" } else { "Play" };
        if ui.add_enabled(!viewer.keyframes.is_empty(), egui::Button::new(text)).on_hover_text("Space").clicked() {
            viewer.play();
        }
    });
    if let (Some(first), Some(last)) = (viewer.keyframes.first().copied(), viewer.keyframes.last().copied())
        && last.time > first.time
    {
        let mut time = viewer.playing.unwrap_or(first.time);
        if ui.add(egui::Slider::new(&mut time, first.time..=last.time).suffix(" s").text("time")).changed() {
            viewer.scrub(time);
        }
    }
    let mut removed = None;
    let (fov_y, up) = viewer.camera().map_or((1.0, glam::DVec3::Y), |camera| (camera.fov_y, camera.up));
    for k in 0..viewer.keyframes.len() {
        let least = k.checked_sub(1).map_or(0.0, |before| viewer.keyframes[before].time + 0.01);
        let most = viewer.keyframes.get(k + 1).map_or(f64::INFINITY, |after| after.time - 0.01);
        ui.horizontal(|ui| {
            let key = &mut viewer.keyframes[k];
            ui.label(format!("{}", k + 1));
            ui.add(DragValue::new(&mut key.time).range(least..=most.max(least)).speed(0.05).suffix(" s"));
            if ui.small_button("go").clicked()
                && let Some(navigator) = &mut viewer.navigator
            {
                let (position, target) = (key.position.into(), key.target.into());
                navigator.put(&crate::scene::Camera { position, target, up, fov_y });
            }
            if ui.small_button("x").clicked() {
                removed = Some(k);
            }
        });
    }
    if let Some(k) = removed {
        viewer.keyframes.remove(k);
    }
    ui.horizontal(|ui| {
        if ui.add_enabled(!viewer.keyframes.is_empty(), egui::Button::new("Save")).clicked() {
            match viewer.save_path(&desk.folder) {
                Ok((file, command)) => {
                    viewer.say(&format!("{}: saved", file.display()), false);
                    desk.state.command = command;
                }
                Err(error) => viewer.say(&format!("{error:#}"), true),
            }
        }
        let field = TextEdit::singleline(&mut desk.state.path).hint_text("path file (.json)").desired_width(110.0);
        ui.add(field);
        if ui.button("Load").clicked()
            && let Err(error) = viewer.load_path(Path::new(desk.state.path.trim()))
        {
            viewer.say(&format!("{error:#}"), true);
        }
    });
    if !desk.state.command.is_empty() {
        ui.weak("render this path:");
        ui.add(Label::new(egui::RichText::new(&desk.state.command).monospace()).wrap());
        if ui.button("Copy").clicked() {
            ui.ctx().copy_text(desk.state.command.clone());
        }
    }
}
