//! Where the camera is, and what pictures are made of.

use crate::frame::Effects;
use crate::picture::exposure::Exposure;
use crate::picture::tone_map::ToneMap;
use crate::settings::{Bounces, Direction, EffectList};
use crate::view::window::desk::Desk;
use egui::{ComboBox, DragValue, Slider, Ui};
use glam::DVec3;

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
    clip(desk, ui);
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

/// The plane that the scene is cut at.
fn clip(desk: &mut Desk, ui: &mut Ui) {
    let viewer = &mut desk.viewer;
    let mut is_cut = viewer.settings.clip.is_some();
    let hint = "X: at what was clicked on, across the view. What is beyond the plane is there for no ray.";
    if ui.checkbox(&mut is_cut, "cut open").on_hover_text(hint).changed() {
        viewer.clip();
    }
    let bounds = viewer.scene.as_ref().map_or([[0.0; 3], [1.0; 3]], |scene| scene.bounds);
    let Some(plane) = &mut viewer.settings.clip else { return };
    ui.horizontal(|ui| {
        for (axis, name) in DVec3::AXES.into_iter().zip(["x", "y", "z"]) {
            let is_own = plane.normal.unit().dot(axis).abs() > 0.99;
            if ui.selectable_label(is_own, name).clicked() {
                plane.normal = Direction(axis.to_array());
            }
        }
        if ui.button("turn over").clicked() {
            plane.normal = Direction((-plane.normal.unit()).to_array());
        }
    });
    // Along the normal, over the bounds.
    let normal = plane.normal.unit();
    let corners = (0..8).map(|i| DVec3::from_array(std::array::from_fn(|k| bounds[i >> k & 1][k])).dot(normal));
    let (least, most) = corners.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
    let mut along = plane.point.dot(normal);
    if least < most && ui.add(Slider::new(&mut along, least..=most).text("along its normal")).changed() {
        plane.point += normal * (along - plane.point.dot(normal));
    }
}

/// Effects and quality.
pub fn picture(desk: &mut Desk, ui: &mut Ui) {
    let settings = &mut desk.viewer.settings;
    let mut bounces = settings.bounces.of(settings.effects);
    let EffectList { shadow, ao, diffuse, glossy, environment, path } = &mut settings.effects;
    ui.horizontal_wrapped(|ui| {
        ui.checkbox(shadow, "shadows");
        ui.checkbox(ao, "occlusion");
        ui.checkbox(diffuse, "diffuse bounce");
        ui.checkbox(glossy, "reflections");
        ui.checkbox(environment, "environment's shadows");
    });
    *path &= *shadow && *diffuse && *glossy && *environment;
    let is_reflected = *diffuse || *glossy;
    let slider = Slider::new(&mut bounces, 1..=Effects::MOST_BOUNCES).logarithmic(true).text("bounces");
    if ui.add_enabled(is_reflected, slider).changed() {
        settings.bounces = Bounces::Count(bounces);
    }
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
