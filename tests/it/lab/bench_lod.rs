//! `bench lod` as a user runs it, on a small city and copies of a small plant: its files agree with each other, what is
//! measured is not measured again, and levels load less than exact rays and err.

use crate::common::{folder, json, succeed};
use serde_json::Value;
use std::path::Path;

const SMALL: &str =
    "--quick --triangles 40K --size 64x36 --samples 32 --frames 2 --repeat 1 --adapter cpu --inputs nowhere";

fn run(output: &Path, options: &str) -> String {
    let first = ["bench".as_ref(), "lod".as_ref(), "-o".as_ref(), output.as_os_str()];
    let rest = SMALL.split_whitespace().chain(options.split_whitespace()).map(std::ffi::OsStr::new);
    succeed(first.into_iter().chain(rest))
}

fn results(output: &Path) -> Value {
    json(&output.join("lod.json"))
}

fn table<'a>(json: &'a Value, name: &str) -> &'a Value {
    json["tables"].as_array().unwrap().iter().find(|table| table["name"] == name).expect("the table")
}

/// Column `name` of all rows that have `words` among their entries.
fn entries(table: &Value, words: &[&str], name: &str) -> Vec<f64> {
    let column = table["columns"].as_array().unwrap().iter().position(|column| column == name).expect("the column");
    let rows = table["rows"].as_array().unwrap().iter();
    let of = rows.filter(|row| words.iter().all(|word| row.as_array().unwrap().contains(&Value::from(*word))));
    of.map(|row| row[column].as_f64().expect("a number")).collect()
}

#[test]
fn stages_are_measured_once_and_levels_load_less() {
    let folder = folder();
    let output = folder.path().join("out");
    // Nothing fits into no time; the files are there all the same, and say what is left out.
    let printed = run(&output, "--minutes 0");
    assert!(printed.contains("sponza: left out: nowhere"), "{printed}");
    assert_eq!(results(&output)["rows"], Value::Array(Vec::new()));
    let own = ["city/pictures", "walks/city/walks/15", "popping/city", "plants"];
    let own = own.map(|text| format!("--only {text}")).join(" ");
    let printed = run(&output, &own);
    let json = results(&output);
    // Seven ways with 1 and 16 samples, by the sun and with diffuse light; seven walks, and two along the near path.
    let counts = [("pictures", 14), ("pictures-diffuse", 14), ("walks", 9), ("popping", 3), ("working-set", 3)];
    for (name, count) in counts {
        let csv = std::fs::read_to_string(output.join(format!("{name}.csv"))).expect("a CSV");
        let rows = table(&json, name)["rows"].as_array().unwrap();
        assert_eq!((rows.len(), csv.lines().count()), (count, count + 1), "{name}");
    }
    let markdown = std::fs::read_to_string(output.join("lod.md")).expect("lod.md");
    assert!(printed.ends_with(&markdown), "{printed}");
    let page = std::fs::read_to_string(output.join("report.html")).expect("a page");
    for text in ["FLIP of 16 samples over the tolerance", "Bytes resident over triangles", "not 640x360"] {
        assert!(page.contains(text), "{text}");
    }
    pictures(table(&json, "pictures"));
    let walks = table(&json, "walks");
    let loaded = |way: &str| entries(walks, &[way, "far"], "MB cold")[0];
    assert!(loaded("tau 4") < loaded("exact"), "{} {}", loaded("tau 4"), loaded("exact"));
    let first = |way: &str| entries(walks, &[way, "far"], "bricks, primary")[0];
    assert!(first("tau 4") < first("exact"));
    // What is measured is not measured again.
    run(&output, &own);
    assert_eq!(results(&output)["rows"], json["rows"]);
}

/// Exact pictures see through nothing; coarse levels are farther from them than fine ones.
fn pictures(own: &Value) {
    let of = |way: &str, name: &str| entries(own, &[way], name);
    let through = |way: &str| {
        let column = own["columns"].as_array().unwrap().iter().position(|column| column == "sees through, %").unwrap();
        let rows = own["rows"].as_array().unwrap().iter();
        rows.filter(|row| row[1] == way).find_map(|row| row[column].as_f64()).expect("a share")
    };
    assert_eq!(through("exact"), 0.0);
    assert!((0.0..5.0).contains(&through("tau 1")));
    // With 16 samples what is left is mostly the levels' error.
    let [exact, coarse] = ["exact", "tau 4"].map(|way| of(way, "FLIP")[1]);
    assert!(exact > 0.0 && coarse > exact, "{exact} {coarse}");
    assert!(of("exact", "RMSE")[0] > of("exact", "RMSE")[1], "more samples have less noise");
    assert_eq!(of("exact", "÷ exact"), [1.0, 1.0]);
}
