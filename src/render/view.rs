//! What the device gets to know of a camera and the lights.

use super::effects::SURFACE_SHARE;
use super::{Effects, Light};
use crate::kernel::frame::Frame;
use crate::kernel::layout::Params;
use crate::kernel::{Directions, View};
use crate::math::sampling::halton;
use crate::scene::Camera;
use bricks::Resident;
use glam::DVec3;

/// Jitter of sample `sample` within the pixel: its centre for sample 0 (which the AOVs come from), then the Halton sequence
/// in bases 2 and 3.
fn jitter(sample: u32) -> [f32; 2] {
    if sample == 0 {
        return [0.5, 0.5];
    }
    [halton(sample, 0), halton(sample, 1)]
}

/// The view of `camera` for one sample of a picture of `width` x `height` pixels.
pub fn camera_view(
    resident: &Resident,
    camera: &Camera,
    light: &Light,
    effects: &Effects,
    (width, height): (u32, u32),
    sample: u32,
    seed: u32,
) -> View {
    let frame = Frame::near(resident, camera.position);
    let basis = camera.ray_basis(width, height);
    let [jx, jy] = jitter(sample);
    let vec4 = |v: DVec3, w: f64| [v.x as f32, v.y as f32, v.z as f32, w as f32];
    let color = |c: [f32; 3]| [c[0], c[1], c[2], 0.0];
    let origin = frame.point(camera.position);
    let centre = basis.direction(f64::from(width) / 2.0, f64::from(height) / 2.0);
    let mut params = Params {
        origin: [origin[0], origin[1], origin[2], 0.0],
        base: vec4(basis.b, 0.0),
        step_x: vec4(basis.dx, 0.0),
        step_y: vec4(basis.dy, basis.dy.length() / centre.length()),
        sun: vec4(light.sun_direction, 0.0),
        sun_radius: (light.sun_angle_degrees.to_radians() / 2.0).tan() as f32,
        sun_color: color(light.sun_color),
        sky_color: color(light.sky_color),
        ground_color: color(light.ground_color),
        jitter: [jx, jy, 0.0, 0.0],
        emitter_count: light.lamps.emitters().len() as u32,
        emitter_density: (light.lamps.density_of_surfaces() * frame.unit * frame.unit) as f32,
        surface_share: if effects.mirror { SURFACE_SHARE } else { 1.0 },
        sample,
        seed,
        ..Params::default()
    };
    if let Some(environment) = &light.lamps.environment {
        (params.environment_width, params.environment_height) = (environment.width, environment.height);
        let (sin, cos) = environment.turn.sin_cos();
        params.environment_turn = [cos as f32, sin as f32, 0.0, 0.0];
        params.ambient = environment.ambient.map(color);
    }
    let directions = Directions {
        occlusion: effects.occlusion.map_or(0, |occlusion| occlusion.rays),
        occlusion_length: effects.occlusion.map_or(0.0, |occlusion| (occlusion.length / frame.unit) as f32),
        diffuse: effects.diffuse.unwrap_or(0),
        turn: effects.turn_degrees.to_radians(),
        scatter: false,
        glossy: effects.glossy,
    };
    View { frame, params, directions }
}
