//! `bench dvf` as a user runs it, on a tiny Cornell box: its files agree with each other, what is measured is not
//! measured again, and pictures of what moves flicker in the paper's mode alone.

use crate::common::{folder, json, succeed};
use exr::prelude::write_rgb_file;
use serde_json::Value;
use std::path::Path;

fn run(output: &Path, options: &str) -> String {
    let first = ["bench".as_ref(), "dvf".as_ref(), "-o".as_ref(), output.as_os_str()];
    let rest =
        "--adapter cpu --repeat 1".split_whitespace().chain(options.split_whitespace()).map(std::ffi::OsStr::new);
    succeed(first.into_iter().chain(rest))
}

fn results(output: &Path) -> Value {
    json(&output.join("dvf.json"))
}

fn table<'a>(json: &'a Value, name: &str) -> &'a Value {
    json["tables"].as_array().unwrap().iter().find(|table| table["name"] == name).expect("the table")
}

/// Column `name` of all rows whose options hold `words`.
fn entries(table: &Value, words: &[&str], name: &str) -> Vec<f64> {
    let column = table["columns"].as_array().unwrap().iter().position(|column| column == name).expect("the column");
    let rows = table["rows"].as_array().unwrap().iter();
    let of = rows.filter(|row| row[1].as_str().is_some_and(|options| words.iter().all(|word| options.contains(word))));
    of.map(|row| row[column].as_f64().expect("a number")).collect()
}

#[test]
fn all_stages_are_measured_once_and_their_files_agree() {
    let folder = folder();
    let output = folder.path().join("out");
    let tiny = "--size 32x24 --samples 4 --points 5000 --rays 8";
    // Nothing fits into no time; the files are there all the same.
    run(&output, &format!("{tiny} --minutes 0"));
    assert_eq!(results(&output)["rows"], Value::Array(Vec::new()));
    run(&output, &format!("{tiny} --stages grid,rays"));
    assert_eq!(results(&output)["rows"].as_array().unwrap().len(), 6 + 5);
    let printed = run(&output, tiny);
    let json = results(&output);
    let counts = [
        ("points", 9),
        ("making", 9),
        ("grid", 6),
        ("rays", 5),
        ("lanes", 4),
        ("masks", 8),
        ("modes", 2),
        ("flicker", 6),
        ("memory", 1),
    ];
    for (name, count) in counts {
        let (table, file) = (table(&json, name), output.join(format!("{name}.csv")));
        let csv = std::fs::read_to_string(&file).expect("a CSV");
        let columns = table["columns"].as_array().unwrap().len();
        assert_eq!((table["rows"].as_array().unwrap().len(), csv.lines().count()), (count, count + 1), "{name}");
        let is_whole = |row: &Value| row.as_array().unwrap().len() == columns;
        assert!(table["rows"].as_array().unwrap().iter().all(is_whole), "{name}");
    }
    let markdown = std::fs::read_to_string(output.join("dvf.md")).expect("dvf.md");
    assert!(printed.ends_with(&markdown), "{printed}");
    let page = std::fs::read_to_string(output.join("report.html")).expect("a page");
    for title in [
        "Error over points, cornell",
        "Faster over cells",
        "Error over rays",
        "over lanes",
        "Greatest change over frames, cornell",
    ] {
        assert!(page.contains(title), "{title}");
    }
    // Lanes, executors and caches do not show.
    let flips = entries(table(&json, "lanes"), &[], "FLIP");
    assert!(flips.windows(2).all(|pair| pair[0] == pair[1]), "{flips:?}");
    assert_eq!(entries(table(&json, "memory"), &[], "pixels other than in core"), [0.0]);
    // Of eight rays a point, masks that are not widened know few directions.
    let of_masks = |words: &[&str]| entries(table(&json, "masks"), words, "fewer rays");
    let (all, narrow) = (of_masks(&["octahedral 16"]), of_masks(&["octahedral 16", "dilate off"]));
    assert!(all[0] > narrow[0] && narrow[0] > 1.0, "{narrow:?} of {all:?}");
    let shares =
        ["areas and sums, %", "points and rays, %", "labels, %"].map(|name| entries(table(&json, "making"), &[], name));
    for ((a, b), c) in shares[0].iter().zip(&shares[1]).zip(&shares[2]) {
        assert!(*a > 0.0 && *b > 0.0 && *c > 0.0 && a + b + c <= 100.0, "{a} {b} {c}");
    }
    // What is measured is not measured again.
    run(&output, tiny);
    assert_eq!(results(&output)["rows"], json["rows"]);
}

/// Pixels whose light has not changed do not change where rays are answered; where light is added as in the paper, by
/// the labels of cells, they do.
#[test]
fn only_the_papers_mode_flickers() {
    let folder = folder();
    let output = folder.path().join("out");
    // Directions are drawn by the light of an uneven environment: a sky over black ground.
    let sky = folder.path().join("sky.exr");
    let above = |y: usize| if y < 15 { 1.0f32 } else { 0.0 };
    write_rgb_file(&sky, 64, 32, |_, y| (above(y), above(y), above(y))).expect("a sky");
    let options = "--size 64x48 --samples 160 --points 100K --rays 32 --stages flicker --environment";
    run(&output, &format!("{options} {}", sky.display()));
    let json = results(&output);
    let flicker = table(&json, "flicker");
    let of = |mode: &str, name: &str| entries(flicker, &[&format!("mode {mode}")], name);
    let (mean, greatest, jumps) =
        ("mean change ÷ mean noise", "greatest change ÷ noise", "pixels that jump in the worst frame, %");
    for name in [mean, greatest, jumps, "fewer rays"] {
        println!("{name}: {:?}, {:?}", of("same-sample", name), of("paper", name));
    }
    // A field of the scene as it was that knows of what has moved, one of which cells are made anew, and one made anew
    // in every frame.
    for way in 0..3 {
        assert!(of("same-sample", jumps)[way] == 0.0 && of("same-sample", greatest)[way] < 0.5);
        assert!(of("same-sample", mean)[way] < 0.002);
    }
    // Cells made anew leave fewer rays to be traced and take no more than that; all of it made anew leaves fewer still.
    let rays = |name: &str| of("same-sample", name);
    let (traced, spent) = (rays("rays traced"), rays("rays of fields"));
    println!("{traced:?} rays are traced, {spent:?} are of fields");
    assert!(traced[0] > traced[1] + spent[1] && traced[1] > traced[2] && spent[0] == 0.0 && spent[2] > spent[1]);
    // Control: where the light of a cell is found by its label, what the mover touches changes by its label, some of it
    // by more than the noise.
    assert!(of("paper", jumps)[0] > 0.0 && of("paper", greatest)[0] > 1.0);
    let [same, paper] = ["same-sample", "paper"].map(|mode| of(mode, mean)[0]);
    assert!(paper > 5.0 * same, "{paper} of the noise by the paper's mode, {same} where rays are answered");
}
