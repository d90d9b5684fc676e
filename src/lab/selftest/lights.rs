//! Light with a great range (case 50).

use super::case::Checks;
use super::lab::{Lab, mesh, picture, settings};
use crate::frame::{Equirectangular, environment};
use crate::kernels::Lamps;
use crate::kernels::layout::NONE;
use crate::scene::Camera;
use crate::session::Settings;
use crate::settings::{Effect, EffectList};
use anyhow::Result;
use glam::DVec3;
use std::f64::consts::PI;
use std::sync::Arc;

/// Of the texel of the sun.
const SUN: f64 = 1e6;

/// An image of `width` x `width / 2` that is black but for one texel, 1/8 of the way down and ahead.
fn sun(width: u32) -> Equirectangular {
    let mut image = Equirectangular { width, height: width / 2, texels: vec![[0.0; 3]; (width * width / 2) as usize] };
    image.texels[(width * width / 16 + width / 2) as usize] = [SUN as f32; 3];
    image
}

/// Case 50: an environment that is black but for a texel of 10^6: neither in storage nor on its way to a pixel does it
/// overflow or lose energy. Half floats end at 65504.
pub fn sun_texel(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let (small, notes) = environment(sun(256), 1.0, 0.0);
    let brightest = small.texels.iter().map(|texel| texel[0]).fold(0.0, f32::max);
    checks.equal("radiance of the texel as kernels read it", f64::from(brightest), SUN);
    checks.equal("texels that are no radiance", notes.bad_texels, 0);
    let (_, notes) = environment(sun(4096), 1.0, 0.0);
    checks.at_most("relative change of the power by a reduction to half", notes.energy_change.abs(), 1e-6);

    let positions = vec![[-4.0, 0.0, -4.0], [-4.0, 0.0, 4.0], [4.0, 0.0, 4.0], [4.0, 0.0, -4.0]];
    let scene = lab.build(mesh("floor", positions, vec![0, 1, 2, 0, 2, 3]), &settings(16, 0))?;
    let camera = Camera { position: DVec3::Y * 3.0, target: DVec3::ZERO, up: DVec3::Z, fov_y: 0.2 };
    let effects = EffectList::of(&[Effect::Environment]);
    let options = Settings { aov: true, spp: 4, sun_intensity: Some(0.0), effects, ..picture(64, 64, 100) };
    let mut renderer = lab.renderer(&scene, &options)?;
    // Lookups are bilinear: the integral of a tent over its four texels, in both angles.
    let (rows, steps) = (128.0, 1000);
    let tent = |i: u32| {
        let offset = (f64::from(i) + 0.5) / f64::from(steps) * 2.0 - 1.0;
        let down = PI * (rows / 8.0 + 0.5 + offset) / rows;
        (1.0 - offset.abs()) * down.sin() * down.cos() * 2.0 / f64::from(steps)
    };
    let irradiance = SUN * (0..steps).map(tent).sum::<f64>() * (PI / rows).powi(2);
    renderer.light.lamps = Arc::new(Lamps::new(Some(small), Vec::new(), 1.0));
    let pixels = renderer.frame(0, &camera)?.pixels;
    checks.equal("pixels that are not finite", pixels.not_finite(), 0);
    let shown = pixels.radiance.iter().zip(&pixels.albedo).zip(&pixels.id).filter(|(_, id)| **id != NONE);
    let shares: Vec<f64> =
        shown.map(|((c, albedo), _)| f64::from(c[0]) * PI / f64::from(albedo[0]) / irradiance).collect();
    let mean = shares.iter().sum::<f64>() / shares.len().max(1) as f64;
    // 16384 draws of what varies by about a half of its mean: 0.4 %.
    checks.at_most("relative error of the mean irradiance", (mean - 1.0).abs(), 0.02);
    Ok(())
}
