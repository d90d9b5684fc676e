//! `study` as a user runs it: rows say what was measured, their commands render the pictures, and a study that was
//! bounded is gone on with.

use crate::common::{city, folder, has_program, json, settings, skip, succeed};
use brickwalk::metrics::{Image, PIXELS_PER_DEGREE, flip_ldr, load};
use brickwalk::settings::Group as _;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

const TINY: &str = "--quick --size 48x27 --samples 8 --repeat 1 --adapter cpu";

fn study(scene: &Path, output: &Path, options: &str) -> String {
    let first = ["study".as_ref(), scene.as_os_str(), "-o".as_ref(), output.as_os_str()];
    let words = TINY.split_whitespace().chain(options.split_whitespace()).map(std::ffi::OsStr::new);
    succeed(first.into_iter().chain(words))
}

fn rows(output: &Path) -> Vec<Value> {
    let text = std::fs::read_to_string(output.join("rows.jsonl")).expect("rows");
    text.lines().skip(1).map(|line| serde_json::from_str(line).expect("a whole line")).collect()
}

fn number(row: &Value, name: &str) -> f64 {
    row[name].as_f64().unwrap_or_else(|| panic!("{name} of {row}"))
}

/// The picture that the command of a row renders.
fn rendered(folder: &Path, row: &Value) -> Image {
    let output = folder.join("walk");
    let command = row["command"].as_str().expect("a command").replace("OUT", &output.display().to_string());
    succeed(command.split_whitespace().skip(1).map(std::ffi::OsStr::new));
    let view = row["view"].as_u64().expect("a view");
    load(output.join(format!("frames/{view:04}.png"))).expect("a picture").image
}

/// The page's points, made again from the rows by another program; it finds one that was moved.
fn points_are_those_of_rows(output: &Path) {
    if !has_program("python3") {
        skip("no python3");
        return;
    }
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/study_points.py");
    let check = || Command::new("python3").arg("-B").arg(&script).arg(output).output().expect("python3 starts");
    let done = check();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let page = std::fs::read_to_string(output.join("report.html")).expect("a page");
    std::fs::write(output.join("report.html"), page.replacen(" ms, FLIP 0.", " ms, FLIP 1.", 1)).expect("a page");
    assert!(!check().status.success(), "a point that was moved is not found");
    std::fs::write(output.join("report.html"), page).expect("a page");
}

/// Most FLIP and bias, percent, of methods in the small study against exact pictures of the same rays: what they were
/// when samples were spread evenly, and a twentieth. One seed is seen: over 24 the denoiser errs as before (FLIP .026).
/// Since an even sky is drawn by the cosine, the threshold errs by .1256 under it, with nothing added here.
const BOUNDS: [(&str, &str, f64, f64); 8] = [
    ("ao", "roma", 0.0232, 1.72),
    ("ao", "df", 0.0828, 6.66),
    ("ao", "sift", 0.001, 0.1),
    ("ao", "threshold", 0.0763, 2.81),
    ("ao", "denoised", 0.023, 0.506),
    ("environment", "dvf", 0.1196, 6.26),
    ("environment", "threshold", 0.1257, 3.48),
    ("environment", "denoised", 0.166, 9.11),
];

#[test]
fn sources_of_error_are_told() {
    let folder = folder();
    let scene = city(folder.path(), "12K", "200");
    let output = folder.path().join("out");
    let said = study(&scene, &output, "--effects ao --attribute");
    let found = rows(&output);
    let switched: BTreeSet<&str> = found.iter().filter_map(|row| row["source"].as_str()).collect();
    assert!(["cells", "directions", "snapping", "offset", "threshold"].iter().all(|name| switched.contains(name)));
    // All are of one cache and state, and each has its method as it is beside it.
    for row in &found {
        let own = |other: &&Value| other["source"].is_null() && other["method"] == row["method"];
        assert_eq!(found.iter().filter(own).count(), 1, "{row}");
    }
    assert!(said.contains("df: what counts most is cells") && said.contains("roma: "), "{said}");
    let page = std::fs::read_to_string(output.join("report.html")).expect("a page");
    assert!(page.contains("share of the error"));
}

#[test]
fn rows_say_what_commands_render() {
    let folder = folder();
    let scene = city(folder.path(), "12K", "200");
    let output = folder.path().join("out");
    let options = "--effects ao,environment --caches 100,30 --views 2";
    // Nothing fits into no time; the files are there all the same, and the same command goes on.
    study(&scene, &output, &format!("{options} --budget 0"));
    assert!(rows(&output).is_empty() && output.join("report.html").exists());
    let said = study(&scene, &output, options);
    let found = rows(&output);
    let keys: BTreeSet<&str> = found.iter().map(|row| row["key"].as_str().expect("a key")).collect();
    assert!(keys.len() == found.len() && found.len() > 80, "{} rows", found.len());
    let all = json(&output.join("study.json"));
    assert_eq!((all["measured"].as_u64(), &all["planned"]), (Some(found.len() as u64), &all["measured"]));
    assert_eq!(all["rows"], Value::Array(found.clone()));
    let csv = std::fs::read_to_string(output.join("study.csv")).expect("a table");
    assert_eq!(csv.lines().count(), found.len() + 1);
    let page = std::fs::read_to_string(output.join("report.html")).expect("a page");
    assert!(page.contains("FLIP over time") && !page.contains("http://") && !page.contains("https://"));
    points_are_those_of_rows(&output);
    for line in all["recommendations"].as_array().expect("some") {
        assert!(said.contains(line.as_str().expect("a line")));
    }
    for row in &found {
        let times = ["seconds_frame", "seconds_p95"].map(|name| number(row, name));
        assert!(times[0] > 0.0 && times[1] >= times[0] && number(row, "cache_bytes") > 0.0);
        let same = ["flip_same", "relmse_same", "bias_same"].map(|name| number(row, name));
        match row["method"].as_str() {
            // Exact entries sit at the noise of their samples.
            Some("exact") => {
                assert_eq!((same, number(row, "flip_converged")), ([0.0; 3], number(row, "noise_flip")));
                assert_eq!(number(row, "rays_answered"), 0.0);
            }
            Some("roma" | "df") => assert!(same[0] > 0.0 && number(row, "rays_answered") > 0.0),
            Some("dvf") => assert!(number(row, "seconds_making") > 0.0 && number(row, "rays_answered") > 0.0),
            _ => {}
        }
        for (effect, method, most_flip, most_bias) in BOUNDS {
            if row["effect"] == effect && row["method"] == method && row["rays_per_pixel"] == 4 {
                assert!(same[0] <= most_flip && 100.0 * same[2].abs() <= most_bias, "errs more than it did: {row}");
            }
        }
        if row["cold"] == true {
            assert!(number(row, "bytes_loaded") > 0.0, "{row}");
        }
    }
    for (effect, method, ..) in BOUNDS {
        assert!(found.iter().any(|row| row["effect"] == effect && row["method"] == method), "{effect} by {method}");
    }
    let exact = |rays: u64| {
        let is = |row: &&Value| row["method"] == "exact" && row["rays_per_pixel"] == rays && row["effect"] == "ao";
        found.iter().find(is).expect("exact rays")
    };
    assert!(number(exact(16), "noise_flip") < number(exact(1), "noise_flip"), "more rays are nearer");
    // What the commands render is as far apart as the row says; bytes of a PNG are rounded.
    let first = |method: &str| {
        found.iter().find(|row| row["method"] == method && row["rays_per_pixel"] == 4).expect("a row of the method")
    };
    let roma = first("roma");
    let same = rendered(folder.path(), exact(4));
    for row in [roma, first("df")] {
        let flip = flip_ldr(&rendered(folder.path(), row), &same, PIXELS_PER_DEGREE).expect("pictures").mean();
        assert!((flip - number(row, "flip_same")).abs() < 2e-3, "{flip} and {row}");
    }
    // The settings are those of the command.
    let text = roma["command"].as_str().expect("a command").split_once("--quality exact").expect("options").1;
    let parsed = settings(text);
    for (key, value) in roma["settings"].as_object().expect("settings") {
        let is_of_machine = ["adapter", "path"].contains(&key.as_str());
        let own = parsed.get(key).map(|own| own.to_string());
        assert!(is_of_machine || own.as_deref() == value.as_str() || key == "ao_length", "{key}: {own:?} and {value}");
    }
    // Nothing is measured twice, and other settings are other results.
    study(&scene, &output, options);
    assert_eq!(rows(&output), found);
    let other =
        ["study".as_ref(), scene.as_os_str(), "-o".as_ref(), output.as_os_str(), "--samples".as_ref(), "9".as_ref()];
    assert!(!crate::common::brickwalk(other).status.success());
}
