//! The tables.

use super::measures::{Display, average, flicker, mse};
use super::{Change, Options, ROWS, Walk, Way};
use brickwalk::output::{atomic, png, srgb};
use std::fmt::Write;
use std::path::Path;

pub fn text(options: &Options, display: &Display, walk: &Walk, changes: &[Change]) -> String {
    let mut text = String::new();
    let frames = walk.pictures.len();
    let steady = || frames - options.steady..frames;
    let _ = writeln!(
        text,
        "`{}` from {} s at {} frames a second, {}, `{}`, {} diffuse rays a pixel; references of {} samples with {} \
         diffuse rays each; {:+.2} EV, tone map {}.\n",
        options.path.file_name().unwrap_or_default().display(),
        options.start,
        options.fps,
        options.size,
        options.light,
        options.rays,
        options.spp,
        options.reference_rays,
        display.stops,
        display.tone_map.name()
    );
    let flips = |way: Way, k: usize| display.flip(&walk.pictures[k][way as usize], &walk.truth[&k]);
    let rmses = |way: Way, k: usize| mse(&walk.pictures[k][way as usize], &walk.truth[&k]);
    let heads = Way::ALL.map(Way::name).join(" | ");
    for (name, of) in [("FLIP", &flips as &dyn Fn(Way, usize) -> f64), ("RMSE", &|way, k| rmses(way, k).sqrt())] {
        let _ = writeln!(text, "| {name}, frame | {heads} |\n| --- | --- | --- | --- | --- | --- |");
        for k in ROWS.into_iter().filter(|k| *k <= frames) {
            let row = Way::ALL.map(|way| format!("{:.4}", of(way, k - 1))).join(" | ");
            let _ = writeln!(text, "| {k} | {row} |");
        }
        let mean = |way: Way| average(steady().map(|k| of(way, k)));
        let row = Way::ALL.map(|way| format!("{:.4} ({:.2}x)", mean(way), mean(Way::Noisy) / mean(way))).join(" | ");
        let _ = writeln!(text, "| steady | {row} |\n");
    }
    let _ = writeln!(text, "| steady state | {heads} |\n| --- | --- | --- | --- | --- | --- |");
    let temporal = Way::ALL.map(|way| average(steady().map(|k| rmses(way, k))).sqrt());
    let _ = writeln!(text, "| temporal error | {} |", temporal.map(|x| format!("{x:.4}")).join(" | "));
    let flickers = Way::ALL.map(|way| {
        average(steady().map(|k| {
            let shown = |k: usize| &walk.pictures[k][way as usize][..];
            flicker([shown(k - 1), shown(k)], [&walk.truth[&(k - 1)], &walk.truth[&k]])
        }))
    });
    let _ = writeln!(text, "| flicker | {} |", flickers.map(|x| format!("{x:.4}")).join(" | "));
    let biases = Way::ALL.map(|way| {
        let sum = |picture: &[[f32; 3]]| picture.iter().flatten().map(|x| f64::from(*x)).sum::<f64>();
        let (found, truth) = steady().fold((0.0, 0.0), |(found, truth), k| {
            (found + sum(&walk.pictures[k][way as usize]), truth + sum(&walk.truth[&k]))
        });
        found / truth - 1.0
    });
    let _ = writeln!(text, "| mean, relative | {} |\n", biases.map(|x| format!("{:+.2} %", 100.0 * x)).join(" | "));
    // Halves of the samples differ by twice the error of their mean.
    let noise = average(steady().map(|k| mse(&walk.halves[&k][0], &walk.halves[&k][1]))).sqrt() / 2.0;
    let between = average(steady().map(|k| display.flip(&walk.halves[&k][0], &walk.halves[&k][1])));
    let still = vec![[0.0; 3]; walk.truth[&0].len()];
    let moved = average(steady().map(|k| flicker([&still, &still], [&walk.truth[&(k - 1)], &walk.truth[&k]])));
    let _ = writeln!(
        text,
        "References: RMSE about {noise:.4}; FLIP between the halves of their samples {between:.4}; mean change from \
         frame to frame {moved:.4}.\n"
    );
    let _ = writeln!(text, "| error after | pixels | way | at once | 4th frame | 10th frame | steady | ratio |");
    let _ = writeln!(text, "| --- | --- | --- | --- | --- | --- | --- | --- |");
    for change in changes {
        for (name, [first, fourth, tenth, steady]) in ["--denoise", "--denoise --taa"].into_iter().zip(change.errors) {
            let _ = writeln!(
                text,
                "| {} | {} | {name} | {first:.4} | {fourth:.4} | {tenth:.4} | {steady:.4} | {:.2} |",
                change.name,
                change.pixels,
                tenth / steady
            );
        }
    }
    text
}

/// The last frame's pictures as PNG.
pub fn pictures(folder: &Path, display: &Display, walk: &Walk) {
    atomic::create_folder(folder).expect("a folder");
    let (width, height) = display.size;
    let write = |name: &str, shown: &[[f32; 3]]| {
        let bytes = srgb::pixels(shown);
        png::write(&folder.join(format!("{name}.png")), width, height, &bytes).expect("a picture");
    };
    let last = walk.pictures.len() - 1;
    write("truth", &walk.truth[&last]);
    for (way, name) in Way::ALL.into_iter().zip(["noisy", "taa", "alone", "denoised", "both"]) {
        write(name, &walk.pictures[last][way as usize]);
    }
}
