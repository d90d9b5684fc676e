//! `walk --checkpoints`: errors over samples are those that `compare` finds, and fall as noise does.

use crate::common::{brickwalk, city, folder, succeed, walk};
use serde_json::Value;
use std::ffi::OsStr;
use std::path::Path;

/// Noise, and nothing that filters it.
const NOISY: &str = "--frames 2 --size 48x27 --adapter cpu --schedule chc --effects primary,ao --ao-rays 1 \
                     --ao-length 20 --rotation full --aov --exposure 0";

fn rows(out: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(out.join("checkpoints.jsonl")).expect("checkpoints");
    text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

#[test]
fn errors_fall_as_noise_does_and_are_those_of_compare() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "4K");
    let (truth, out) = (folder.path().join("truth"), folder.path().join("out"));
    walk(&scene, &truth, &format!("{NOISY} --spp 768 --seed 7"));
    // The folder of a walk is one of references; --spp follows from the checkpoints.
    let options = format!("{NOISY} --checkpoints 1,4,16,96 --reference {}", truth.display());
    walk(&scene, &out, &options);
    let found = rows(&out);
    let numbers = |name: &str| found.iter().map(|row| row[name].as_f64().expect("a number")).collect::<Vec<_>>();
    assert_eq!(numbers("frame"), [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]);
    assert_eq!(numbers("samples")[..4], [1.0, 4.0, 16.0, 96.0]);
    for frame in [0, 4] {
        let (rmse, rel_mse, seconds) = (numbers("rmse"), numbers("rel_mse"), numbers("seconds"));
        for k in frame..frame + 3 {
            // A few bright pixels make most of the error of few samples: a step alone says little.
            assert!(rmse[k] > rmse[k + 1] && rel_mse[k] > rel_mse[k + 1], "{rmse:?} {rel_mse:?}");
            assert!(seconds[k] < seconds[k + 1]);
        }
        // Samples of a pixel are spread evenly: errors fall at least as 1/√N, as noise does, and at most as 1/N.
        let samples: f64 = 96.0;
        let [root, square] = [rmse[frame] / rmse[frame + 3], rel_mse[frame] / rel_mse[frame + 3]];
        let falls = (0.7 * samples.sqrt()..1.3 * samples).contains(&root);
        assert!(falls, "RMSE fell by {root} over {samples} times the samples");
        let falls = (0.45 * samples..1.6 * samples * samples).contains(&square);
        assert!(falls, "relMSE fell by {square} over {samples} times the samples");
    }
    // The last of a frame is its EXR.
    for (frame, row) in [(0, &found[3]), (1, &found[7])] {
        let exr = |folder: &Path| folder.join(format!("frames/{frame:04}.exr"));
        let words = ["compare".into(), exr(&out), exr(&truth), "--json".into()];
        let compared: Value = serde_json::from_str(&succeed(words)).expect("JSON");
        for name in ["rmse", "rel_mse", "bias", "bias_rgb", "flip"] {
            assert_eq!(row[name], compared[name], "{name} of frame {frame}");
        }
    }
    // One in the middle is the EXR of a walk of as many samples.
    let short = folder.path().join("short");
    walk(&scene, &short, &format!("{NOISY} --spp 4 --frames 1").replace("--frames 2 ", ""));
    let words = ["compare".into(), short.join("frames/0000.exr"), truth.join("frames/0000.exr"), "--json".into()];
    let compared: Value = serde_json::from_str(&succeed(words)).expect("JSON");
    assert_eq!(found[1]["rmse"], compared["rmse"]);
    // The report has the plots, and the numbers lie beside it.
    let report = std::fs::read_to_string(out.join("report.html")).expect("a report");
    assert!(report.contains("Error over samples") && report.contains("Error over seconds"));
    assert_eq!(std::fs::read_to_string(out.join("checkpoints.csv")).expect("CSV").lines().count(), 9);
    // A walk without leaves none.
    walk(&scene, &out, &format!("{NOISY} --spp 1"));
    assert!(!out.join("checkpoints.jsonl").exists() && !out.join("checkpoints.csv").exists());
}

#[test]
fn references_that_do_not_fit_are_refused_before_the_walk() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "4K");
    let (small, out) = (folder.path().join("small"), folder.path().join("out"));
    walk(&scene, &small, "--frames 1 --size 16x9 --adapter cpu --aov --spp 1");
    let run = |options: &str| {
        let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), out.as_os_str()];
        let output = brickwalk(words.into_iter().chain(options.split(' ').map(OsStr::new)));
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let at = |name: &str| small.join(name).display().to_string();
    let fit = "--frames 2 --size 16x9 --adapter cpu --checkpoints 1,2";
    for (options, code, says) in [
        (fit.to_string(), 2, "--reference"),
        (format!("{fit} --denoise --reference {}", at("frames/0000.exr")), 2, "--denoise"),
        (format!("{fit} --reference {}", at("frames/0000.png")), 1, "give an EXR"),
        (format!("{fit} --reference {}", at("none.exr")), 1, "none.exr"),
        (format!("{fit} --reference {}", small.display()), 1, "0001.exr"),
        (
            format!("{} --reference {}", fit.replace("16x9", "32x18"), at("frames/0000.exr")),
            1,
            "has 16x9 pixels, frames have 32x18; render it with the same --size",
        ),
    ] {
        let (found, text) = run(&options);
        assert!(found == Some(code) && text.contains(says) && text.trim().lines().count() == 1, "{options}: {text}");
        assert!(!out.join("frames/0000.png").exists(), "{options}");
    }
    // A file is the reference of frame 0, which is said.
    let (found, text) = run(&format!("{fit} --reference {}", at("frames/0000.exr")));
    assert!(found == Some(0) && text.contains("reference of frame 0"), "{text}");
    assert!(rows(&out).iter().all(|row| row["frame"] == 0));
}
