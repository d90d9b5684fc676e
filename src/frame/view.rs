//! What the device gets to know of a camera and the lights.

use super::{Effects, Light};
use crate::kernels::frame::Frame;
use crate::kernels::layout::Params;
use crate::kernels::{Directions, Lod, View};
use crate::math::sampling::r2;
use crate::scene::Camera;
use bricks::Resident;
use glam::DVec3;

/// Where in its pixel sample `sample` lies: in the centre for sample 0, which the AOVs come from. Not by the Halton
/// sequence that directions are made by: every part of a pixel would have directions of a part of the hemisphere only,
/// however many samples there are.
fn jitter(sample: u32) -> [f32; 2] {
    r2(sample)
}

/// The view of `camera` for one sample of a picture of `width` x `height` pixels, from its first row on, as if it were
/// the only one of a pixel.
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
        origin: [origin[0], origin[1], origin[2], frame.unit as f32],
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
        sample,
        seed,
        picture_rows: height,
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
        scatter: effects.turn_degrees >= 360.0,
        lod: Lod::default(),
        glossy: effects.glossy,
        refracts: effects.refracts(),
        shares: effects.environment && light.lamps.environment.is_some() && effects.diffuse.is_some(),
        even: light.lamps.environment.as_ref().is_some_and(|environment| environment.is_even),
    };
    View { frame, params, directions, rays: None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernels::dispatch::direction_around;
    use crate::math::sampling::halton;

    /// Of samples that `place` puts into a part of the pixel: how far the mean squared sine of their directions, which
    /// cosine-weighted ones have evenly spread, is from 1/2 at worst.
    fn dependence(place: impl Fn(u32) -> [f32; 2], samples: u32, count: u32) -> f32 {
        let parts: [fn([f32; 2]) -> bool; 6] = [
            |[x, _]| x < 0.5,
            |[_, y]| y < 0.5,
            |[x, _]| x < 0.25,
            |[x, y]| x + y < 1.0,
            |[x, y]| x > 0.5 && y > 0.5,
            |[x, y]| (x - 0.5).hypot(y - 0.5) < 0.4,
        ];
        let mean = |part: fn([f32; 2]) -> bool| {
            let inside = (0..samples).filter(|&sample| part(place(sample)));
            let squared: Vec<f32> = inside
                .flat_map(|sample| (sample * count..(sample + 1) * count).map(direction_around))
                .map(|[x, y, _]| x * x + y * y)
                .collect();
            squared.iter().sum::<f32>() / squared.len() as f32
        };
        parts.into_iter().map(|part| (mean(part) - 0.5).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn every_part_of_a_pixel_has_directions_of_the_whole_hemisphere() {
        for count in [1, 2, 3, 4, 16, 20] {
            let worst = dependence(jitter, 4096, count);
            assert!(worst < 0.005, "{count} directions a sample: {worst}");
        }
        let halton = |sample| [halton(sample, 0), halton(sample, 1)];
        let control = dependence(halton, 4096, 1);
        assert!(control > 0.1, "points that directions are made of must show: {control}");
        assert_eq!(jitter(0), [0.5, 0.5], "AOVs come from the centre");
    }
}
