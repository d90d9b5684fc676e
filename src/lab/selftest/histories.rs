//! Histories of the denoiser (cases 52, 53 and 55).

use super::case::Checks;
use super::lab::{Lab, camera, picture, settings};
use super::views::{city, in_city};
use crate::kernels::denoise::{push, variance_of_mean};
use crate::kernels::layout::NONE;
use crate::math::welford::Welford;
use crate::picture::denoise::{DenoisePast, Denoiser};
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
            for layer in 0..2 {
                for (pixel, past) in denoiser.past(layer).iter_mut().enumerate().filter(|(pixel, _)| pixel % 7 == 0) {
                    past.long[pixel % 3] = [f32::NAN, f32::INFINITY][pixel % 2];
                    past.mean[pixel % 3] = f32::NAN;
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
        let of = |past: &[DenoisePast]| {
            let is_bad = |past: &&DenoisePast| past.long.iter().chain(&past.mean).any(|x| !x.is_finite());
            past.iter().filter(is_bad).count() as u64
        };
        let bad = of(denoiser.past(0)) + of(denoiser.past(1));
        checks.none(&format!("frame {frame}: pixels of the history that are not finite"), bad, hits);
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
    let (mut found, mut below, mut sum, mut squares) = (Welford::default(), Welford::default(), 0.0f32, 0.0f32);
    for _ in 0..count {
        // The sum of twelve even numbers has variance 1.
        let value = 1e8 + (0..12).map(|_| random.unit()).sum::<f64>() - 6.0;
        found.push(value);
        // What was put in, about the known mean.
        below.push(value - 1e8);
        sum += value as f32;
        squares += (value * value) as f32;
    }
    let [found, truth] = [found, below].map(|moments| moments.variance().unwrap_or(f64::NAN).sqrt());
    // Each of n steps rounds the mean by u 10^8 = 1.1e-8, at random: the sum of squares is off by far less than 1e-6 of
    // it.
    checks.at_most("relative error of sigma", (found / truth - 1.0).abs(), 1e-6);
    // The control: the mean of squares less the square of the mean, in f32.
    let naive = f64::from((squares / count as f32 - (sum / count as f32).powi(2)).abs()).sqrt();
    checks.at_least("relative error of sigma from moments in f32", (naive / truth - 1.0).abs(), 1.0);
    history_variance(lab, checks)
}

/// The same of a denoiser's history, in f32: a mean of 10^5, by its weights of 1, 1/2 and so on to 1/12. Single values
/// of f32 near 10^8 are 8 apart: there a deviation of 1 cannot be told by any recurrence.
fn history_variance(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut random = lab.random(&[53]);
    let (mut worst, mut worst_naive) = (0.0f64, 0.0f64);
    for _ in 0..100 {
        let mut past = DenoisePast::default();
        let (mut sum, mut squares) = (0.0f32, 0.0f32);
        let mut values: Vec<(f64, f64)> = Vec::new();
        for k in 0..200u32 {
            // The sum of twelve even numbers has variance 1.
            let normal = (0..12).map(|_| random.unit()).sum::<f64>() - 6.0;
            let value = (1e5 + normal) as f32;
            push(&mut past, [value; 3], (1.0, 0.0));
            let alpha = 1.0 / f64::from((k + 1).min(12));
            values.iter_mut().for_each(|(_, weight)| *weight *= 1.0 - alpha);
            values.push((f64::from(value), alpha));
            sum += alpha as f32 * (value - sum);
            squares += alpha as f32 * (value * value - squares);
        }
        let over = |of: &dyn Fn(f64) -> f64| values.iter().map(|&(value, weight)| weight * of(value)).sum::<f64>();
        let mean = over(&|value| value);
        let own: f64 = values.iter().map(|(_, weight)| weight * weight).sum();
        let truth = over(&|value| (value - mean).powi(2)) * own / (1.0 - own);
        past.count = 1.0 / past.squares;
        let found = f64::from(variance_of_mean(&past).unwrap_or(f32::NAN));
        worst = worst.max(((found / truth).sqrt() - 1.0).abs());
        let naive = f64::from((squares - sum * sum).abs()) * own / (1.0 - own);
        worst_naive = worst_naive.max(((naive / truth).sqrt() - 1.0).abs());
    }
    // The mean is rounded by 2^-8 a step, of which the last twelve steps keep most: by about 0.01 of sigma at most.
    checks.at_most("greatest relative error of sigma", worst, 0.01);
    // The control: the mean of squares less the square of the mean.
    checks.at_least("greatest relative error of sigma from moments", worst_naive, 1.0);
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
