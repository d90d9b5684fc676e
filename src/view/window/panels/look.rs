//! Where the camera is, and what pictures are made of.

use crate::picture::exposure::Exposure;
use crate::picture::tone_map::ToneMap;
use crate::settings::EffectList;
use crate::view::window::desk::Desk;
use egui::{ComboBox, DragValue, Slider, Ui};

/// The camera, and views that were kept.
pub fn view(desk: &mut Desk, ui: &mut Ui) {
    ui.horizontal(|ui| {
        if ui.button("First").on_hover_text("Home").clicked() {
            desk.viewer.go_home();
        }
        if ui.button("All").on_hover_text("F: the whole scene").clicked() {
            desk.viewer.see_all();
        }
        let scene = desk.viewer.scene.as_ref().map(|scene| scene.path.clone());
        if let (Some(scene), Some(camera), true) = (scene, desk.viewer.camera(), ui.button("Keep").clicked()) {
            desk.recent.keep(&scene, &camera);
        }
    });
    if let Some(navigator) = &mut desk.viewer.navigator {
        let mut degrees = navigator.camera().fov_y.to_degrees();
        if ui.add(Slider::new(&mut degrees, 5.0..=120.0).suffix("°").text("field of view")).changed() {
            navigator.set_fov_y(degrees.to_radians());
        }
        let [x, y, z] = navigator.camera().position.to_array();
        ui.weak(format!("at {x:.2} {y:.2} {z:.2}"));
    }
    let Some(scene) = desk.viewer.scene.as_ref().map(|scene| scene.path.clone()) else { return };
    for (index, view) in desk.recent.views_of(&scene) {
        ui.horizontal(|ui| {
            if ui.button(&view.name).clicked()
                && let Some(navigator) = &mut desk.viewer.navigator
            {
                navigator.put(&view.camera());
            }
            if ui.small_button("x").on_hover_text("forget this view").clicked() {
                desk.recent.forget(index);
            }
        });
    }
}

/// Effects and quality.
pub fn picture(desk: &mut Desk, ui: &mut Ui) {
    let settings = &mut desk.viewer.settings;
    let EffectList { shadow, ao, diffuse, glossy, environment } = &mut settings.effects;
    ui.horizontal_wrapped(|ui| {
        ui.checkbox(shadow, "shadows");
        ui.checkbox(ao, "occlusion");
        ui.checkbox(diffuse, "diffuse bounce");
        ui.checkbox(glossy, "reflections");
        ui.checkbox(environment, "environment's shadows");
    });
    ui.add(Slider::new(&mut settings.spp, 1..=4096).logarithmic(true).text("samples a pixel"));
    ui.add(Slider::new(&mut settings.lod, 0.0..=8.0).text("detail at rest, pixels")).on_hover_text(
        "The error at which levels of detail stand for bricks; 0 is exact. While moving it is at least 1.",
    );
    ui.checkbox(&mut settings.denoise, "denoise");
    ui.horizontal(|ui| {
        let mut is_auto = matches!(settings.exposure, Exposure::Auto { .. });
        let stops = desk.viewer.shown.as_ref().map_or(0.0, |shown| shown.exposure_ev);
        if ui.checkbox(&mut is_auto, "exposure by itself").changed() {
            settings.exposure = if is_auto { Exposure::AUTO } else { Exposure::Fixed(stops) };
        }
        if let Exposure::Fixed(stops) = &mut settings.exposure {
            ui.add(DragValue::new(stops).range(-32.0..=32.0).speed(0.05).suffix(" EV"));
        }
    });
    ComboBox::from_label("tone map").selected_text(settings.tone_map.name()).show_ui(ui, |ui| {
        for &map in ToneMap::ALL {
            ui.selectable_value(&mut settings.tone_map, map, map.name());
        }
    });
}
