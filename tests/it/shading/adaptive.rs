//! Samples until noise is below a part of a pixel's value (`--noise`): what they come to against many samples, and that
//! pictures stay the same bytes however they are made.

use crate::common::{self, city, folder, json, walk};
use brickwalk::Settings;
use brickwalk::frame::luminance;
use brickwalk::scene::path::CameraPath;
use std::path::Path;

const WIDTH: usize = 96;
const HEIGHT: usize = 64;
/// Edge of a block, pixels.
const BLOCK: usize = 8;

/// Luminances of a frame of a city, in light of the sun, the sky and what is around, and samples that it took.
fn rendered(scene: &Path, frame: u32, options: &str) -> (Vec<f64>, f64) {
    let path = CameraPath::read(&scene.with_extension("near.json")).expect("a path");
    let effects = "--effects shadow,diffuse --diffuse-rays 1 --schedule plain --cache 100%";
    let mut renderer = common::renderer(scene, &format!("--size {WIDTH}x{HEIGHT} {effects} {options}"));
    let output = renderer.frame(frame, &path.frame(1, 3)).expect("a frame");
    let rays: u64 = output.records.iter().filter(|r| r.pass == "primary").map(|r| r.rays_traced).sum();
    let of = |c: &[f32; 3]| luminance(c.map(f64::from));
    (output.pixels.radiance.iter().map(of).collect(), rays as f64 / (WIDTH * HEIGHT) as f64)
}

/// Of every block the root mean square of errors over that of values.
fn errors(found: &[f64], truth: &[f64]) -> Vec<f64> {
    let blocks = (0..WIDTH / BLOCK * HEIGHT / BLOCK).map(|block| {
        let [x, y] = [block % (WIDTH / BLOCK), block / (WIDTH / BLOCK)];
        let pixels = (0..BLOCK * BLOCK).map(|i| (BLOCK * y + i / BLOCK) * WIDTH + BLOCK * x + i % BLOCK);
        let [errors, values] = pixels
            .fold([0.0; 2], |[errors, values], i| [errors + (found[i] - truth[i]).powi(2), values + truth[i].powi(2)]);
        (errors / values.max(f64::MIN_POSITIVE)).sqrt()
    });
    blocks.collect()
}

#[test]
fn noise_is_as_low_as_was_asked_and_light_as_bright() {
    let folder = folder();
    let scene = city(folder.path(), "12K", "200");
    let (truth, _) = rendered(&scene, 1_000_000, "--spp 4096");
    let brightness = truth.iter().sum::<f64>();
    // Places of samples in pixels are those of all pixels: few of them err alike.
    let uniform = rendered(&scene, 0, "--spp 16").0.iter().sum::<f64>() / brightness - 1.0;
    let mut taken = Vec::new();
    for target in [0.2, 0.05, 0.02] {
        let frames = [0, 1, 2].map(|frame| rendered(&scene, frame, &format!("--spp 2048 --noise {target}")));
        let [mut worst, mut mean, mut over] = [0.0f64; 3];
        for (found, _) in &frames {
            let errors = errors(found, &truth);
            worst = errors.iter().copied().fold(worst, f64::max);
            mean += errors.iter().sum::<f64>() / (3 * errors.len()) as f64;
            over += errors.iter().filter(|&&error| error > 1.5 * target).count() as f64 / (3 * errors.len()) as f64;
        }
        let off = frames.iter().map(|(found, _)| found.iter().sum::<f64>() / brightness - 1.0).sum::<f64>() / 3.0;
        let samples = frames.iter().map(|(_, samples)| samples).sum::<f64>() / 3.0;
        println!(
            "{target}: {samples:.1} samples, errors {mean:.4}, {worst:.4} at most, {over:.4} over; light {off:+.5}"
        );
        assert!(mean <= target && worst < 3.0 * target && over < 0.03, "{target}: {mean} {worst} {over}");
        assert!(off.abs() < uniform.abs() + 0.001, "{target}: light changed by {off}");
        taken.push((samples, mean));
    }
    // The control: less noise takes more samples, fewer than the most.
    assert!(taken.is_sorted_by(|a, b| 1.5 * a.0 < b.0 && a.1 > 1.5 * b.1), "{taken:?}");
    assert!(taken[0].0 >= 16.0 && taken[2].0 < 1500.0, "{taken:?}");
}

#[test]
fn pictures_are_the_same_however_they_are_made() {
    let folder = folder();
    let scene = city(folder.path(), "12K", "200");
    let common = "--frames 2 --size 40x56 --tile 16 --effects shadow,ao --spp 80 --aov";
    let render = |options: &str| {
        let output = folder.path().join("out");
        walk(&scene, &output, &format!("{common} --adapter cpu {options}"));
        let samples = json(&output.join("summary.json"))["pictures"]["samples_mean"].as_f64().expect("a number");
        (common::frames(&output), samples)
    };
    let (first, samples) = render("--noise 0.03 --cache 100%");
    println!("{samples} samples");
    assert!(samples > 17.0 && samples < 70.0, "{samples}");
    for options in ["--cache 15%", "--cache 15% --schedule demand", "--cache 30% --bands 3", "--schedule plain"] {
        assert!(render(&format!("--noise 0.03 {options}")) == (first.clone(), samples), "{options}");
    }
    // Controls: other noise is another picture; without any all samples are taken, as by default.
    assert!(render("--noise 0.2").0 != first);
    let (all, most) = render("--noise 0.000001");
    assert_eq!(most, 80.0);
    assert!(render("") == (all, 80.0));
}

#[test]
fn what_does_not_go_with_it_is_named() {
    for (options, says) in [
        ("--noise 0.1", "give more, as --spp 256"),
        ("--noise 0.1 --spp 64 --taa", "--taa exclude"),
        ("--noise 0.1 --spp 64 --secondary auto", "--secondary auto exclude"),
        ("--noise 0.1 --spp 64 --measure-error", "--measure-error exclude"),
        ("--noise 0", "1e-6 to 1"),
    ] {
        let found = Settings::from_options(options).and_then(|settings| settings.check()).expect_err(options);
        assert!(found.to_string().contains(says), "{options}: {found}");
    }
    Settings::from_options("--noise 0.1 --spp 17").and_then(|settings| settings.check()).expect("settings");
}
