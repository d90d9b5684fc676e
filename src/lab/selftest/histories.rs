//! Histories of the denoiser (cases 52, 53 and 55).

use super::case::Checks;
use super::lab::{Lab, camera, picture, settings};
use super::views::{city, in_city};
use crate::kernels::layout::NONE;
use crate::picture::denoise::{Denoiser, Moments};
use crate::scene::Camera;
use crate::session::Settings;
use crate::settings::{Effect, EffectList};
use anyhow::{Context, Result};
use brickwalk_convert::source::SourceScene;
use brickwalk_scenes::{Stiff, stiff};
use glam::DVec3;

/// Settings of frames with guides.
fn options() -> Settings {
    let effects = EffectList::of(&[Effect::Shadow, Effect::Diffuse]);
    Settings { denoise: true, effects, diffuse_rays: 1, ..picture(64, 64, 100) }
}

/// Pixels that are not finite.
fn not_finite(radiance: &[[f32; 3]]) -> u64 {
    radiance.iter().filter(|c| !c.iter().all(|x| x.is_finite())).count() as u64
}

/// Case 52: what is not finite in a history is counted, and gone within one frame.
pub fn not_a_number(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let scene = lab.build(city(lab.seed, [0.0; 3])?, &settings(1024, -14))?;
    let mut renderer = lab.renderer(&scene, &options())?;
    let mut denoiser = Denoiser::default();
    let (mut found, mut shown) = (0, 0);
    for frame in 0..4 {
        if frame == 2 {
            for layer in denoiser.layers_mut() {
                for (pixel, past) in layer.past.iter_mut().enumerate().filter(|(pixel, _)| pixel % 7 == 0) {
                    past.averages.long[pixel % 3] = [f32::NAN, f32::INFINITY][pixel % 2];
                    past.moments.mean[pixel % 3] = f64::NAN;
                }
            }
        }
        let mut output = renderer.frame(frame, &in_city(0, [0.0; 3]))?;
        let guides = output.guides.take().context("the options ask for guides")?;
        let hits = guides.seen.iter().filter(|seen| seen.is_hit()).count() as u64;
        let counted = denoiser.frame(guides, &mut output.pixels.radiance);
        if frame == 2 {
            found = counted;
        }
        shown += not_finite(&output.pixels.radiance);
        let left = denoiser.layers_mut().iter().flat_map(|layer| &layer.past);
        let values = left.map(|past| (past.averages.long, past.moments.mean));
        let bad = values.filter(|(long, mean)| !long.iter().all(|x| x.is_finite()) || mean.iter().any(|x| x.is_nan()));
        checks.none(&format!("frame {frame}: pixels of the history that are not finite"), bad.count() as u64, hits);
    }
    checks.none("pixels of four pictures that are not finite", shown, 4 * 64 * 64);
    // The control: it was there.
    checks.equal("planted in two histories, and counted", found, 2 * (64u64 * 64).div_ceil(7));
    Ok(())
}

/// Case 53: a mean of 10^8 with a standard deviation of 1.
pub fn running_variance(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut random = lab.random(&[53]);
    let count = 100_000u32;
    let (mut moments, mut sum, mut squares) = (Moments::default(), 0.0f32, 0.0f32);
    let (mut below, mut below_squares) = (0.0f64, 0.0f64);
    for k in 0..count {
        // The sum of twelve even numbers has variance 1.
        let normal = (0..12).map(|_| random.unit()).sum::<f64>() - 6.0;
        let value = 1e8 + normal;
        moments.push([value; 3], 1.0 / f64::from(k + 1));
        // What was put in, about the known mean.
        let put = value - 1e8;
        below += put;
        below_squares += put * put;
        sum += value as f32;
        squares += (value * value) as f32;
    }
    let n = f64::from(count);
    let truth = ((below_squares - below * below / n) / (n - 1.0)).sqrt();
    let found = moments.variance().unwrap_or(f64::NAN).sqrt();
    // Each of n steps rounds the mean by u 10^8 = 1.1e-8, at random: the sum of squares is off by far less than 1e-6 of
    // it.
    checks.at_most("relative error of sigma", (found / truth - 1.0).abs(), 1e-6);
    // The control: the mean of squares less the square of the mean, in f32.
    let naive = f64::from((squares / count as f32 - (sum / count as f32).powi(2)).abs()).sqrt();
    checks.at_least("relative error of sigma from moments in f32", (naive / truth - 1.0).abs(), 1.0);
    Ok(())
}

/// A sphere of one albedo.
pub fn plain_sphere(seed: u64, albedo: f32) -> SourceScene {
    let mut source = stiff(Stiff::Shell, 2, seed);
    source.materials.iter_mut().for_each(|material| material.base_color = [albedo, albedo, albedo, 1.0]);
    source
}

/// A camera that sees it before the sky.
pub fn at_sphere() -> Camera {
    camera([0.0, 1.0, 4.0], DVec3::ZERO, 0.6)
}

/// Case 55, denoised: black stays black; grey, the control, does not.
pub fn black(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    for albedo in [0.0, 0.5] {
        let scene = lab.build(plain_sphere(lab.seed, albedo), &settings(64, 0))?;
        let mut renderer = lab.renderer(&scene, &options())?;
        let mut denoiser = Denoiser::default();
        let (mut lit, mut met, mut bad) = (0, 0, 0);
        for frame in 0..3 {
            let mut output = renderer.frame(frame, &at_sphere())?;
            let guides = output.guides.take().context("the options ask for guides")?;
            let ids: Vec<u32> = guides.seen.iter().map(|seen| seen.id).collect();
            denoiser.frame(guides, &mut output.pixels.radiance);
            let hits = || output.pixels.radiance.iter().zip(&ids).filter(|(_, id)| **id != NONE);
            lit += hits().filter(|(c, _)| c.iter().any(|&x| x != 0.0)).count() as u64;
            met += hits().count() as u64;
            bad += not_finite(&output.pixels.radiance);
        }
        if albedo == 0.0 {
            checks.none("denoised pixels of a black sphere that are not black", lit, met);
        } else {
            checks.at_least("denoised pixels of a grey sphere that are not black", lit, met / 2);
        }
        checks.none("denoised pixels that are not finite", bad, 3 * 64 * 64);
    }
    Ok(())
}
