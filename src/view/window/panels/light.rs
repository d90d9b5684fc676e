//! Sun, sky and environment.

use crate::settings::{Direction, Environment};
use crate::view::window::desk::Desk;
use egui::{ComboBox, Slider, TextEdit, Ui};
use glam::DVec3;
use std::path::PathBuf;

/// Azimuth, from -Z toward +X, and elevation of a direction, degrees.
fn angles(direction: Direction) -> [f64; 2] {
    let unit = direction.unit();
    [unit.x.atan2(-unit.z).to_degrees(), unit.y.clamp(-1.0, 1.0).asin().to_degrees()]
}

fn direction([azimuth, elevation]: [f64; 2]) -> Direction {
    let (azimuth, elevation) = (azimuth.to_radians(), elevation.to_radians());
    let level = DVec3::new(azimuth.sin(), 0.0, -azimuth.cos()) * elevation.cos();
    Direction((level + DVec3::Y * elevation.sin()).to_array())
}

/// The panel.
pub fn show(desk: &mut Desk, ui: &mut Ui) {
    let settings = &mut desk.viewer.settings;
    let mut sun = angles(settings.sun);
    let turned = ui.add(Slider::new(&mut sun[0], -180.0..=180.0).suffix("°").text("sun, around")).changed();
    let raised = ui.add(Slider::new(&mut sun[1], -10.0..=90.0).suffix("°").text("sun, above")).changed();
    if turned || raised {
        settings.sun = direction(sun);
    }
    ui.add(Slider::new(&mut settings.sun_angle, 0.0..=20.0).suffix("°").text("sun, width"));
    let mut intensity = settings.sun_intensity();
    if ui.add(Slider::new(&mut intensity, 0.0..=20.0).text("sun, intensity")).changed() {
        settings.sun_intensity = Some(intensity);
    }
    ui.add(Slider::new(&mut settings.sky_intensity, 0.0..=4.0).text("sky, intensity"));
    let name = match &settings.environment {
        None => "none".into(),
        Some(environment) => environment.to_string(),
    };
    ComboBox::from_label("environment").selected_text(name).show_ui(ui, |ui| {
        for (value, name) in [(Some(Environment::Auto), "auto"), (Some(Environment::Sky), "sky"), (None, "none")] {
            ui.selectable_value(&mut settings.environment, value, name);
        }
    });
    ui.horizontal(|ui| {
        let field =
            TextEdit::singleline(&mut desk.state.environment).hint_text("image (.hdr, .exr)").desired_width(150.0);
        ui.add(field);
        if ui.button("Use").clicked() && !desk.state.environment.trim().is_empty() {
            settings.environment = Some(Environment::File(PathBuf::from(desk.state.environment.trim())));
        }
    });
    ui.add(Slider::new(&mut settings.environment_intensity, 0.0..=4.0).text("environment, factor"));
    ui.add(Slider::new(&mut settings.environment_rotation, -180.0..=180.0).suffix("°").text("environment, turn"));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_and_directions_are_each_other() {
        for own in [[0.4, 0.8, 0.45], [-1.0, 0.1, 0.2], [0.0, 2.0, -0.3]] {
            let unit = Direction(own).unit();
            assert!((direction(angles(Direction(own))).unit() - unit).length() < 1e-12);
        }
        assert!((direction([90.0, 0.0]).unit() - DVec3::X).length() < 1e-12);
    }
}
