//! Sums of many samples (case 54).

use super::case::Checks;
use super::lab::{Lab, camera, primary, settings};
use crate::frame::{Accumulation, BATCH_SAMPLES, Engine, Renderer, camera_view};
use crate::scene::Camera;
use crate::schedule::{Lamp, Pass, Shading, Step};
use crate::session::Settings;
use crate::settings::Schedule;
use anyhow::Result;
use brickwalk_scenes::{Stiff, stiff};
use glam::DVec3;

/// What the walls of the room shine with. None has a short binary fraction, so that every addition rounds.
const GLOW: [f32; 3] = [0.1, 0.7, 3300.3];

/// Relative error of a mean of batches: γ₆₃ of a batch, one rounding of the mean; u = 2⁻²⁴.
const BOUND: f64 = 64.0 / 16_777_216.0;

/// Steps of a submission; a device takes a bounded number.
const STEPS: u32 = 16;

/// Greatest relative deviation of pixels from [`GLOW`]; a NaN is infinite.
fn drift(mean: &[[f32; 3]]) -> f64 {
    let of = |x: f32, truth: f32| (f64::from(x) / f64::from(truth) - 1.0).abs();
    let all = mean.iter().flat_map(|pixel| pixel.iter().zip(GLOW).map(|(&x, truth)| of(x, truth)));
    all.fold(0.0, |worst, x| if x.is_nan() { f64::INFINITY } else { worst.max(x) })
}

/// Adds samples of what the executor holds for the frame just rendered until there are `count`; from `first` on, which
/// is the number of the sample in its frame.
fn add_samples(renderer: &mut Renderer, camera: &Camera, first: u32, count: u32) -> Result<()> {
    let resident = renderer.scene.resident();
    let effects = renderer.settings.effects;
    let view = camera_view(resident, camera, &renderer.light, &effects, renderer.size, first, 0);
    renderer.executor.begin_frame(&view);
    let pass = Pass::Shadow(Lamp::Sun);
    let Engine { executor, cache, .. } = &mut renderer.engine;
    executor.run(pass, &[Step::ClearAttributes, Step::Resolve], &cache.states)?;
    let shade =
        [Step::Shade(Shading { sun: true, sky: true, emission: true, miss: true, environment: false, gloss: false });
            STEPS as usize];
    for _ in 0..count / STEPS {
        executor.run(pass, &shade, &cache.states)?;
    }
    Ok(())
}

/// Case 54: in a closed room of black walls that glow every sample is the glow; so is the mean of any number of them.
pub fn accumulation(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut source = stiff(Stiff::Cube, 1, lab.seed);
    for material in &mut source.materials {
        material.base_color = [0.0, 0.0, 0.0, 1.0];
        material.emission = GLOW;
        // The camera is within.
        material.flags |= bricks::MATERIAL_DOUBLE_SIDED;
    }
    let scene = lab.build(source, &settings(64, 0))?;
    let camera = camera([0.1, 0.2, -0.3], DVec3::X, 1.0);
    let options = |spp| Settings { tile: 8, spp, ..primary(8, 8, 100, Schedule::Plain) };

    // Rendered, sample by sample; not a whole number of batches.
    let samples = lab.share(10_000) as u32 / BATCH_SAMPLES * BATCH_SAMPLES + 1;
    let mut renderer = lab.renderer(&scene, &options(samples))?;
    let mean = renderer.frame(0, &camera)?.pixels.radiance;
    checks.at_most(&format!("{samples} samples of a frame: relative drift"), drift(&mean), BOUND);

    // Shaded again and again: batches of the same frame.
    let frames = (lab.rays as u32).min(1_000_000) / BATCH_SAMPLES * BATCH_SAMPLES;
    let mut renderer = lab.renderer(&scene, &options(1))?;
    renderer.frame(0, &camera)?;
    let mut accumulation = Accumulation::default();
    for first in (0..frames).step_by(BATCH_SAMPLES as usize) {
        add_samples(&mut renderer, &camera, first, BATCH_SAMPLES)?;
        accumulation.add(renderer.executor.read_radiance()?);
    }
    checks.at_most(&format!("{frames} accumulated frames: relative drift"), drift(&accumulation.mean()), BOUND);

    // The control, which the bound must tell from it: one sum in f32.
    let few = frames.min(30_000) / STEPS * STEPS;
    add_samples(&mut renderer, &camera, 0, few)?;
    let mut one = Accumulation::default();
    one.add(renderer.executor.read_radiance()?);
    checks.at_least(&format!("{few} frames in one sum of f32: relative drift"), drift(&one.mean()), 2.0 * BOUND);
    Ok(())
}
