//! `bench displacement` as a user runs it, on a small bumpy sphere: its files agree with each other and with what was
//! measured, and say what the paper says.

use crate::common::{brickwalk, folder, json, succeed};
use serde_json::Value;
use std::ffi::OsStr;
use std::path::Path;

const SMALL: &str = "--quick --adapter cpu --triangles 3000 --rings 4,8 --directions 16,32 --rays 32 --repeat 3 \
                     --most-triangles 20K";

fn words<'a>(output: &'a Path, options: &'a str) -> impl Iterator<Item = &'a OsStr> {
    let first = ["bench".as_ref(), "displacement".as_ref(), "-o".as_ref(), output.as_os_str()];
    first.into_iter().chain(options.split_whitespace().map(OsStr::new))
}

fn results(output: &Path) -> Value {
    json(&output.join("displacement.json"))
}

fn table<'a>(json: &'a Value, name: &str) -> &'a Value {
    json["tables"].as_array().unwrap().iter().find(|table| table["name"] == name).expect("the table")
}

/// Column `name` of all rows that have `words` among their entries.
fn entries(table: &Value, words: &[Value], name: &str) -> Vec<f64> {
    let column = table["columns"].as_array().unwrap().iter().position(|column| column == name).expect("the column");
    let rows = table["rows"].as_array().unwrap().iter();
    let of = rows.filter(|row| words.iter().all(|word| row.as_array().unwrap().contains(word)));
    of.map(|row| row[column].as_f64().expect("a number")).collect()
}

/// What was found of the claim that begins so, and the result.
fn verdict(json: &Value, claim: &str) -> (Value, String) {
    let rows = table(json, "verdict")["rows"].as_array().unwrap();
    let row = rows.iter().find(|row| row[0].as_str().unwrap().starts_with(claim)).expect("the verdict");
    (row[1].clone(), row[3].as_str().unwrap().to_string())
}

#[test]
fn all_stages_are_measured_once_and_say_what_the_paper_says() {
    let folder = folder();
    let output = folder.path().join("out");
    // Nothing fits into no time; the files are there all the same.
    succeed(words(&output, &format!("{SMALL} --minutes 0")));
    assert_eq!(results(&output)["rows"], Value::Array(Vec::new()));
    succeed(words(&output, &format!("{SMALL} --stages figure5")));
    assert_eq!(results(&output)["rows"].as_array().unwrap().len(), 12);
    let printed = succeed(words(&output, SMALL));
    let json = results(&output);
    let counts = [("figure6", 4 * 3), ("figure4", 6), ("figure5", 12), ("figure8", 2), ("figure8-paper", 4)];
    for (name, count) in counts {
        let csv = std::fs::read_to_string(output.join(format!("{name}.csv"))).expect("a CSV");
        let rows = table(&json, name)["rows"].as_array().unwrap();
        assert_eq!((rows.len(), csv.lines().count()), (count, count + 1), "{name}");
    }
    let markdown = std::fs::read_to_string(output.join("displacement.md")).expect("displacement.md");
    assert!(printed.ends_with(&markdown), "{printed}");
    let page = std::fs::read_to_string(output.join("report.html")).expect("a page");
    for text in ["RMS over positions, aimed", "Nanoseconds of a ray over triangles", "RMS falls from 82 to 290"] {
        assert!(page.contains(text), "{text}");
    }
    errors(&json);
    times(&json);
    // What is measured is not measured again.
    succeed(words(&output, SMALL));
    assert_eq!(results(&output)["rows"], json["rows"]);
}

/// Errors fall with positions, and aiming makes them less; 8 bits are as good as 32, 1 bit is not.
fn errors(json: &Value) {
    let own = table(json, "figure6");
    let rms = |way: &str, positions: u32| {
        let words = [way.into(), f64::from(positions).into(), "32²".into()];
        entries(own, &words, "RMS, levels")[0]
    };
    for way in ["paper", "aimed", "interpolated"] {
        assert!(rms(way, 82) > 1.2 * rms(way, 290) && rms(way, 290) > 0.0, "{way}");
    }
    assert!(rms("aimed", 290) < rms("paper", 290));
    let (found, _) = verdict(json, "RMS falls from 82 to 290 positions");
    let fall = |n: &str| {
        let of = |positions: u32| entries(own, &["paper".into(), f64::from(positions).into(), n.into()], "RMS, levels");
        of(82)[0] / of(290)[0]
    };
    assert_eq!(found.as_f64(), Some(fall("16²").min(fall("32²"))));
    let bits =
        |bits: u32, name: &str| entries(table(json, "figure4"), &[bits.to_string().into(), "paper".into()], name);
    assert_eq!(bits(32, "RMS ÷ 32 bits'"), [1.0]);
    assert!((bits(8, "RMS ÷ 32 bits'")[0] - 1.0).abs() < 0.05 && bits(1, "RMS ÷ 32 bits'")[0] > 1.05);
    assert_eq!(verdict(json, "RMS of 8 bits").1, "OK");
    // The samples of the same shape are those of figure 6.
    assert_eq!(bits(8, "RMS, levels"), entries(own, &["paper".into(), 290.0.into(), "32²".into()], "RMS, levels"));
    let of =
        |map: &str, name: &str| entries(table(json, "figure5"), &[map.into(), "32²".into(), "paper".into()], name)[0];
    let [concentric, uniform] = ["concentric", "uniform"].map(|map| of(map, "RMS, levels"));
    assert_eq!(verdict(json, "RMS of uniform directions (paper, 32²)").0.as_f64(), Some(uniform / concentric));
    assert!((of("concentric", "RMS, levels") / bits(8, "RMS, levels")[0] - 1.0).abs() < 1e-3, "the same samples");
    assert!(of("rejection", "samples used, %") < 90.0 && of("uniform", "samples used, %") == 100.0);
}

/// Times are there for every object, and verdicts follow from them.
fn times(json: &Value) {
    let own = table(json, "figure8");
    let of = |name: &str| entries(own, &[], name);
    let triangles = of("triangles");
    assert!((triangles[0] / 2000.0 - 1.0).abs() < 0.1 && (triangles[1] / 20_000.0 - 1.0).abs() < 0.1, "{triangles:?}");
    let [aimed, closest] = ["field, aimed, ns a ray", "exact, closest hit, ns a ray"].map(of);
    assert!(aimed.iter().chain(&closest).all(|&ns| ns > 0.0));
    let [least, most] = [aimed[0].min(aimed[1]), aimed[0].max(aimed[1])];
    let spread = verdict(json, "Time of a ray by fields (aimed)").0.as_f64().expect("a number");
    assert!((spread - 100.0 * (most - least) / (most + least)).abs() < 1e-9, "{spread}");
    let ratio = verdict(json, "Tracing (closest hits) over fields (aimed)").0.as_f64().expect("a number");
    assert!((ratio - closest[1] / aimed[1]).abs() < 1e-12, "{ratio}");
    assert_eq!(of("closest ÷ aimed")[1], closest[1] / aimed[1]);
}

#[test]
fn other_models_are_converted_and_told_apart() {
    let folder = folder();
    let output = folder.path().join("out");
    let shape = folder.path().join("tent.obj");
    let tent = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n";
    std::fs::write(&shape, tent).expect("a shape");
    let options = format!("{SMALL} --stages figure5 --model {}", shape.display());
    succeed(words(&output, &options));
    let json = results(&output);
    assert_eq!((&json["settings"]["model"], &json["settings"]["triangles"]), (&"tent.obj".into(), &4.into()));
    // The same folder with another model.
    let refused = brickwalk(words(&output, SMALL));
    let says = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(!refused.status.success() && says.contains("measured with model \"tent.obj\" rather than"), "{says}");
}
