//! What a person asks of a picture: what is there, and how far it is from the exact one.

use crate::metrics::{Image, PIXELS_PER_DEGREE, flip_ldr, pixel_errors};
use crate::picture::error_heat;
use crate::scene::Camera;
use crate::session::{Frame, Hit, Named, Origin, Ray, Session, developed, provenance};
use anyhow::Result;
use bricks::{Material, NONE};
use glam::DVec3;

/// What is at a place.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The point, world units.
    pub point: DVec3,
    /// Distance from the camera, world units.
    pub distance: f64,
    /// Unit normal of the triangle, world space.
    pub normal: DVec3,
    /// The node that the triangle is of.
    pub node: Option<Named>,
    /// Where the triangle comes from; `None`: nobody wrote that down.
    pub origin: Option<Origin>,
    /// Its global id.
    pub triangle: u32,
    /// Triangles of its primitive.
    pub of: u32,
    /// The number of its material, and what it is made of; `None`: it could not be read.
    pub material: Option<(u32, Material)>,
}

impl Found {
    /// In lines.
    pub fn lines(&self) -> Vec<String> {
        let [x, y, z] = self.point.to_array();
        let mut lines = Vec::new();
        if let Some(Origin { file, node, mesh, primitive, triangle, .. }) = &self.origin {
            let named = |name: &str| if name.is_empty() { "(no name)".to_owned() } else { name.to_owned() };
            lines.push(format!("node {}", named(node)));
            let of = self.of;
            lines.push(format!("mesh {}, primitive {primitive}, triangle {triangle} of {of}", named(mesh)));
            lines.push(format!("file {file}"));
        }
        lines.push(format!("triangle id {}", self.triangle));
        if let Some((number, material)) = &self.material {
            let [r, g, b, a] = material.base_color;
            let Material { metallic, roughness, emission, .. } = *material;
            let textured = if material.base_color_texture == NONE { "" } else { " and a texture" };
            lines.push(format!("material {number}: colour {r:.2} {g:.2} {b:.2}, alpha {a:.2}{textured}"));
            let shines = if emission.iter().any(|&e| e > 0.0) { ", it shines" } else { "" };
            lines.push(format!("metallic {metallic:.2}, roughness {roughness:.2}{shines}"));
        }
        lines.push(format!("at {x:.4} {y:.4} {z:.4}"));
        lines.push(format!("distance {:.4}", self.distance));
        lines
    }
}

/// What `session` has at a place of what `camera` sees, a share of the width and height of a picture of such a size.
///
/// # Errors
/// A brick that cannot be read; the device's.
pub fn found(session: &mut Session, camera: &Camera, (x, y): (f64, f64), aspect: f64) -> Result<Option<Found>> {
    // A picture of one pixel a unit of height.
    let basis = camera.ray_basis(1, 1);
    let direction = basis.b + basis.dx * (0.5 + (x - 0.5) * aspect) + basis.dy * y;
    let ray =
        Ray { origin: camera.position.to_array(), direction: direction.to_array(), t_min: 0.0, t_max: f64::INFINITY };
    let hits = session.trace(&[ray], false)?;
    let Some(&Hit { t, triangle, normal, .. }) = hits.first().filter(|hit| hit.t.is_finite()) else { return Ok(None) };
    // Whatever traces the ray reads the attributes of what it hits.
    let surface = session.renderer().executor.read_gbuffer()?.first().copied();
    let scene = session.renderer().scene.clone();
    let resident = scene.resident();
    let material =
        surface.and_then(|surface| Some((surface.material, *resident.materials.get(surface.material as usize)?)));
    let origin = Origin::of(&resident.manifest, triangle);
    let node = Named::of(&resident.manifest, triangle);
    let of = provenance(&resident.manifest, triangle).map_or(0, |range| range.count);
    let normal = DVec3::from_array(normal.map(f64::from));
    let point = camera.position + direction * t;
    let distance = (point - camera.position).length();
    Ok(Some(Found { point, distance, normal, node, origin, triangle, of, material }))
}

/// How far a picture is from the exact one, both as a display shows them.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Mean FLIP.
    pub flip: f64,
    /// Root of the mean squared error of linear radiance.
    pub rmse: f64,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// FLIP of each pixel, as a picture: black is none.
    pub map: Vec<[u8; 3]>,
    /// Milliseconds that the exact picture took.
    pub ms: f64,
}

/// Compares `shown` with `exact`, both exposed as `exact` is.
///
/// # Errors
/// Pictures of different sizes.
pub fn compared(shown: &Frame, exact: &Frame, ms: f64) -> Result<Comparison> {
    let (width, height) = (exact.size.0 as usize, exact.size.1 as usize);
    let [a, b] = [shown, exact].map(|frame| {
        let bytes = developed(&frame.pixels.radiance, exact.exposure_ev, exact.tone_map);
        Image::from_srgb(width, height, &bytes)
    });
    let map = flip_ldr(&a, &b, PIXELS_PER_DEGREE)?;
    let [a, b] = [shown, exact].map(|frame| Image { width, height, rgb: frame.pixels.radiance.clone() });
    let errors = pixel_errors(&a, &b)?;
    let colours = map.errors.iter().map(|&error| error_heat(error));
    Ok(Comparison { flip: map.mean(), rmse: errors.rmse, size: exact.size, map: colours.collect(), ms })
}
