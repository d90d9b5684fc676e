//! Lights without extent (KHR_lights_punctual).

use super::document::{Document, Lenient, Light, LightOfNode};
use super::file::item;
use crate::import::affine::{Affine, direction, point};
use crate::import::warnings::Warnings;
use bricks::{LIGHT_DISTANT, LIGHT_POINT, LIGHT_SPOT, PunctualLight};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

/// The light that a node places, by its matrix; `None`, with a warning: it has none that can be used. Lights shine
/// along -Z of their nodes; scales do not change their range and strength.
pub(super) fn place(
    document: &Document,
    Lenient(of_node): &Lenient<LightOfNode>,
    world_from_node: &Affine,
    warnings: &mut Warnings,
    place: &dyn Fn() -> String,
) -> Option<PunctualLight> {
    let lights = &document.extensions.lights.lights;
    let found = of_node.as_ref().map_err(String::clone).and_then(|of_node| {
        let light = item(lights, of_node.light, "light").map_err(|problem| problem.what)?;
        light.0.as_ref().map_err(String::clone)
    });
    let found = found.and_then(|light| convert(light, world_from_node, warnings, place));
    let left_out = |problem| warnings.add("light skipped", || format!("{} ({problem})", place()));
    found.map_err(left_out).ok()
}

fn convert(
    light: &Light,
    world_from_node: &Affine,
    warnings: &mut Warnings,
    place: &dyn Fn() -> String,
) -> Result<PunctualLight, String> {
    let kind = match light.kind.as_str() {
        "point" => LIGHT_POINT,
        "spot" => LIGHT_SPOT,
        "directional" => LIGHT_DISTANT,
        _ => return Err("unknown type".to_owned()),
    };
    let direction = direction(world_from_node, [0.0, 0.0, -1.0]);
    let direction = match (direction, kind) {
        (Some(direction), _) => direction,
        // Points shine to all sides.
        (None, LIGHT_POINT) => [0.0, 0.0, -1.0],
        (None, _) => return Err("its node is scaled to zero along the light".to_owned()),
    };
    let intensity = light.intensity.unwrap_or(1.0);
    let color = light.color.unwrap_or([1.0; 3]).map(|c| (c * intensity) as f32);
    let range = light.range.unwrap_or(0.0) as f32;
    if color.iter().chain([&range]).any(|value| !value.is_finite() || *value < 0.0) {
        return Err("colour, intensity or range is negative or not finite".to_owned());
    }
    let mut cone = [0.0; 2];
    if kind == LIGHT_SPOT {
        let outer = light.spot.outer_cone_angle.unwrap_or(FRAC_PI_4);
        let inner = light.spot.inner_cone_angle.unwrap_or(0.0);
        let sound = outer.clamp(0.0, FRAC_PI_2);
        cone = [inner.clamp(0.0, sound), sound].map(|angle| angle as f32);
        if inner < 0.0 || inner >= outer || outer != sound {
            warnings.add("cone angles out of order or above 90 degrees; clamped", place);
        }
        // A right angle rounded up would be more than one.
        cone = cone.map(|angle| angle.min(std::f32::consts::FRAC_PI_2));
    }
    let position = point(world_from_node, [0.0; 3]);
    Ok(PunctualLight { kind, range, position, direction, color, cone, _reserved: 0 })
}
