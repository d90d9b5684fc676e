//! `bench chc` and `bench roma` as a user runs them, on tiny scenes: their files agree with each other and with what
//! was measured, and a run that was bounded is gone on with.

use crate::common::{brickwalk, folder, json, succeed};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

const TINY: &str = "--triangles 10K,12K,10K --size 64x36 --frames 3 --rays 1 --skip 1";

fn words<'a>(output: &'a Path, options: &'a str) -> Vec<&'a std::ffi::OsStr> {
    let first = ["bench".as_ref(), "chc".as_ref(), "-o".as_ref(), output.as_os_str()];
    let rest = TINY.split_whitespace().chain(options.split_whitespace()).map(std::ffi::OsStr::new);
    first.into_iter().chain(rest).collect()
}

/// What `bench chc` found.
fn found(folder: &Path) -> Value {
    json(&folder.join("chc.json"))
}

fn cases(folder: &Path) -> Vec<(String, u64)> {
    let text = std::fs::read_to_string(folder.join("cells.jsonl")).expect("cells");
    let cells = text.lines().skip(1).map(|line| serde_json::from_str::<Value>(line).expect("a whole line"));
    cells.map(|cell| (cell["case"].as_str().unwrap().into(), cell["repetition"].as_u64().unwrap())).collect()
}

fn table<'a>(json: &'a Value, name: &str) -> &'a Value {
    json["tables"].as_array().unwrap().iter().find(|table| table["name"] == name).expect("the table")
}

/// Column `name` of the row that begins with `start`.
fn entry(table: &Value, start: &[&str], name: &str) -> Value {
    let column = table["columns"].as_array().unwrap().iter().position(|column| column == name).expect("the column");
    let rows = table["rows"].as_array().unwrap();
    let row = rows.iter().find(|row| start.iter().enumerate().all(|(i, text)| row[i] == *text)).expect("the row");
    row[column].clone()
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

#[test]
fn files_agree_and_a_bounded_run_is_gone_on_with() {
    let folder = folder();
    let output = folder.path().join("out");
    let options = "--repeat 1 --stages table2,targets";
    // Nothing fits into no time; the files are there all the same.
    succeed(words(&output, &format!("{options} --minutes 0")));
    assert_eq!(cases(&output), []);
    assert_eq!(found(&output)["walks"], 0);
    succeed(words(&output, "--repeat 1 --stages targets --only pipes"));
    assert!(cases(&output).len() == 6 && cases(&output).iter().all(|(name, _)| name.contains("pipes")));
    succeed(words(&output, "--repeat 1 --stages targets"));
    let before = cases(&output);
    assert_eq!(
        before.len(),
        13,
        "two scenes, three effects, camera rays also without each of two optimisations and both; the large city"
    );
    // A process that was killed in the middle of a line.
    let file = output.join("cells.jsonl");
    let whole = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, format!("{whole}{{\"case\": \"tab")).unwrap();
    let printed = succeed(words(&output, &format!("{options} --resume")));
    let after = cases(&output);
    assert_eq!(after[..13], before[..], "what was measured is kept");
    let distinct: BTreeSet<_> = after.iter().collect();
    assert_eq!((after.len(), distinct.len()), (37, 37), "two scenes, two paths, six schedules");
    succeed(words(&output, options));
    assert_eq!(cases(&output), after, "nothing is measured twice");
    assert!(printed.contains("rule not met"), "{printed}");
    agree(&output);
}

/// JSON, CSV, Markdown and HTML hold the same numbers, which follow from the cells, beside the paper's.
fn agree(output: &Path) {
    let json = found(output);
    let table2 = table(&json, "table2");
    let csv = std::fs::read_to_string(output.join("table2.csv")).unwrap();
    let rows = table2["rows"].as_array().unwrap();
    assert_eq!(csv.lines().count(), rows.len() + 1);
    for (line, row) in csv.lines().skip(1).zip(rows) {
        for (text, value) in line.split(',').zip(row.as_array().unwrap()) {
            match value {
                Value::Null => assert_eq!(text, ""),
                Value::String(words) => assert_eq!(text, words),
                other => assert_eq!(text.parse::<f64>().unwrap(), number(other)),
            }
        }
    }
    let html = std::fs::read_to_string(output.join("report.html")).unwrap();
    let markdown = std::fs::read_to_string(output.join("chc.md")).unwrap();
    assert!(html.contains("Figure 7") && html.contains("Figure 8") && html.contains("<svg"));
    assert!(!html.contains("<script src") && !html.contains("http://") && !html.contains("https://"));

    let start = ["city", "near", "primary", "chc"];
    let ratio = number(&entry(table2, &start, "speed-up over plain-bvh2, wall"));
    let cells = json["cells"].as_array().unwrap();
    let ms = |schedule: &str| {
        let path = format!("table2/city/100%/tile 64/near/primary,ao,diffuse/{schedule}/threshold 0/turn 36");
        let cell = cells.iter().find(|cell| cell["case"] == *path).expect("the cell");
        let frames = cell["passes"]["primary"]["ms"].as_array().unwrap();
        let late: Vec<f64> = frames[1..].iter().map(|ms| ms.as_f64().unwrap()).collect();
        late.iter().sum::<f64>() / late.len() as f64
    };
    let expected = ms("plain-bvh2") / ms("chc");
    // Both are the same quotient of sums of two numbers.
    assert!((ratio - expected).abs() < 1e-12 * expected, "{ratio} against {expected}");
    // Control: the other baseline has another time.
    assert!(ratio != ms("plain") / ms("chc"));
    let shown = if ratio >= 9.995 { format!("{ratio:.1}×") } else { format!("{ratio:.2}×") };
    assert!(ratio < 0.9995 || (html.contains(&shown) && markdown.contains(&shown)), "{shown}");

    // CHC+RT, table 2: speed-up of primary, AO and diffuse rays, near and far.
    for (scene, view, expected) in [
        ("city", "near", [1.61, 1.22, 1.28]),
        ("city", "far", [1.12, 0.97, 0.89]),
        ("pipes", "near", [5.46, 4.46, 5.92]),
        ("pipes", "far", [5.50, 3.82, 3.23]),
    ] {
        for (effect, expected) in ["primary", "ao", "diffuse"].into_iter().zip(expected) {
            assert_eq!(number(&entry(table2, &[scene, view, effect, "chc"], "paper")), expected);
            assert_eq!(entry(table2, &[scene, view, effect, "plain"], "paper"), Value::Null);
        }
    }
    let targets = table(&json, "targets");
    let cold = number(&entry(targets, &["city", "20 %", "primary", "chc"], "cold: moved ÷ needed"));
    assert!((0.99..1.01).contains(&cold), "{cold} times what was needed");
    let without = number(&entry(targets, &["city", "20 %", "primary", "chc without requery"], "cold: moved ÷ needed"));
    assert!(without > 1.01, "{without} times what was needed, with nothing asked again");
}

#[test]
fn what_cannot_be_measured_is_refused() {
    let folder = folder();
    let output = folder.path().join("out");
    let outcome = |words: Vec<&std::ffi::OsStr>| {
        let found = brickwalk(words);
        (found.status.code(), String::from_utf8_lossy(&found.stderr).into_owned())
    };
    let refused = |options: &str| outcome(words(&output, options));
    for (options, part) in [
        ("--stages table9", "table2"),
        ("--triangles 1M", "three counts"),
        ("--frames 0", "1 to 300"),
        ("--frames 4 --skip 4", "above 4"),
        ("--minutes soon", "minutes"),
        ("--only nothing", "no case"),
    ] {
        let start = ["bench".as_ref(), "chc".as_ref(), "-o".as_ref(), output.as_os_str()];
        let (code, message) = outcome(start.into_iter().chain(options.split(' ').map(std::ffi::OsStr::new)).collect());
        assert!(code == Some(2) && message.contains(part), "{options}: {message}");
    }
    assert!(!output.exists(), "wrong usage writes nothing");
    let (code, message) = refused("--resume");
    assert!(code == Some(1) && message.contains("cells.jsonl"), "{message}");
    let (code, message) = refused("--minutes 0 --sponza missing.bricks --stages table2");
    assert_eq!(code, Some(0), "nothing is opened without time: {message}");
    let (code, message) = refused("--minutes 0 --repeat 3");
    assert!(code == Some(1) && message.contains("repetitions"), "{message}");
    std::fs::write(output.join("cells.jsonl"), "nothing\n").unwrap();
    let (code, message) = refused("--minutes 0");
    assert!(code == Some(1) && message.contains("line 1"), "{message}");
    std::fs::remove_dir_all(&output).unwrap();
    std::fs::write(&output, "a file").unwrap();
    let (code, message) = refused("");
    assert!(code == Some(1) && message.contains("out"), "{message}");
}

#[test]
fn executors_render_the_same_frames() {
    let folder = folder();
    let output = folder.path().join("out");
    let line = "--quick --triangles 10K --size 64x36 --frames 1 --effects primary,ao --adapter cpu --adapter cpu";
    let first = ["bench".as_ref(), "executors".as_ref(), "-o".as_ref(), output.as_os_str()];
    let printed = succeed(first.into_iter().chain(line.split_whitespace().map(std::ffi::OsStr::new)));
    let json: Value = serde_json::from_slice(&std::fs::read(output.join("executors.json")).unwrap()).unwrap();
    let rows = json["table"]["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 4, "two devices, two passes: {rows:?}");
    for row in rows {
        assert_eq!(row[0].as_str(), Some("cpu"));
        assert!(number(&row[3]) > 0.0, "it takes time");
    }
    assert_eq!(rows.iter().map(|row| row[1].as_str().unwrap()).collect::<Vec<_>>(), ["primary", "ao", "primary", "ao"]);
    assert!(rows.iter().filter(|row| row[1] == "primary").all(|row| number(&row[2]) == 64.0 * 36.0));
    let second = &json["devices"][1];
    let [pixels, ids, ulps, rmse] =
        ["pixels_compared", "other_ids", "depth_ulps", "radiance_rmse"].map(|field| number(&second[field]));
    assert_eq!((pixels, ids, ulps, rmse), (64.0 * 36.0, 0.0, 0.0, 0.0), "the same pictures");
    assert!(printed.ends_with(&std::fs::read_to_string(output.join("executors.md")).unwrap()), "{printed}");
}

#[test]
fn occupancy_maps_are_measured_beside_exact_rays() {
    let folder = folder();
    let output = folder.path().join("out");
    let run = |options: &str| {
        let first = ["bench".as_ref(), "roma".as_ref(), "-o".as_ref(), output.as_os_str()];
        let tiny = "--triangles 10K --size 32x18 --samples 4 --repeat 1 --adapter cpu";
        let rest = tiny.split_whitespace().chain(options.split_whitespace()).map(std::ffi::OsStr::new);
        succeed(first.into_iter().chain(rest))
    };
    let results = || json(&output.join("roma.json"));
    run("--stages out-of-core --minutes 0");
    assert_eq!(results()["measured"], 0);
    run("--stages out-of-core");
    let json = results();
    // Exact rays and maps, with an empty cache and with a filled one.
    assert_eq!(json["measured"], 4);
    let own = table(&json, "out-of-core");
    let empty = |way: &str, name: &str| number(&entry(own, &["city", "cache 15 %, empty", way], name));
    assert_eq!(empty("roma 128 K=4", "bricks loaded"), 0.0, "maps need no bricks");
    assert!(empty("exact (noise)", "bricks loaded") > 0.0, "exact rays do");
    assert!(empty("roma 128 K=4", "FLIP") > empty("exact (noise)", "FLIP"), "maps are an approximation");
    let key = "out-of-core/city/cache 15 %, empty/roma 128 K=4";
    let row = json["rows"].as_array().unwrap().iter().find(|row| row["key"] == key).expect("the row").clone();
    let nanoseconds = 1e6 * number(&row["values"]["ms_trace"]) / number(&row["values"]["rays"]);
    assert_eq!(empty("roma 128 K=4", "ns a ray"), nanoseconds);
    for file in ["roma.md", "report.html", "out-of-core.csv"] {
        assert!(output.join(file).exists(), "{file}");
    }
    // What is measured is not measured again.
    run("--stages out-of-core");
    assert_eq!(results()["rows"], json["rows"]);
}

#[test]
fn maps_and_bricks_together_are_measured() {
    let folder = folder();
    let output = folder.path().join("out");
    let tiny = "bench roma --triangles 10K --size 32x18 --samples 2 --repeat 1 --adapter cpu --stages handover -o";
    succeed(tiny.split_whitespace().map(std::ffi::OsStr::new).chain([output.as_os_str()]));
    let json = json(&output.join("roma.json"));
    // Exact rays, maps, four corrections, all in doubt and three bounds, of two lengths.
    assert_eq!(json["measured"], 20);
    let own = table(&json, "handover");
    let of = |way: &str, name: &str| number(&entry(own, &["city", "rays of 64, cache 15 %", way], name));
    assert!(of("sift, in doubt traced", "FLIP") < of("roma 128 K=4", "FLIP"), "what is traced is not in doubt");
    assert!(of("sift, 2 % wrong", "FLIP") <= of("roma 128 K=4", "FLIP"), "maps answer what they answer well");
    assert_eq!(of("exact (noise)", "whole ÷ exact"), 1.0);
    for way in ["roma 128 K=4", "sift, one in 8"] {
        let ratio = of(way, "whole, ms") / of("exact (noise)", "whole, ms");
        assert_eq!(of(way, "whole ÷ exact"), ratio, "{way}");
    }
    let page = std::fs::read_to_string(output.join("report.html")).expect("a page");
    assert!(page.contains("Error over time, rays of 64"));
}

#[test]
fn seams_and_leaks_of_occupancy_maps_are_measured() {
    let folder = folder();
    let output = folder.path().join("out");
    let tiny = "bench roma --triangles 10K --size 64x36 --samples 6 --repeat 1 --adapter cpu --stages seams,leaks -o";
    succeed(tiny.split_whitespace().map(std::ffi::OsStr::new).chain([output.as_os_str()]));
    let json = json(&output.join("roma.json"));
    // Exact rays, maps and a field, of two scenes; base maps of two kinds.
    assert_eq!(json["measured"], 8);
    let leaks = table(&json, "leaks")["rows"].as_array().unwrap();
    assert_eq!(leaks.len(), 18);
    for row in leaks.iter().filter(|row| row[4].is_number()) {
        let [found, before] = [3, 4].map(|k| number(&row[k]));
        // Conservative base maps that are looked up closely leak less than they did then.
        let is_closed = row[0] == "conservative" && number(&row[2]) > 1.0;
        assert!(found <= 1.5 * before && (found >= before / 1.5 || is_closed), "{row}");
    }
    let seams = table(&json, "seams")["rows"].as_array().unwrap();
    let pixels = |way: &str| -> f64 {
        let own = seams.iter().filter(|row| row[1] == way && row[3].is_number());
        own.map(|row| number(&row[3])).sum()
    };
    assert!(pixels("roma 128 K=4") > 100.0, "some pixels show what is near a seam");
    assert!(pixels("df 128") > 100.0, "and of the fields, whose maps lie nearly there");
    assert!(seams.iter().filter(|row| row[3].is_number()).all(|row| number(&row[5]) + 1e-9 >= number(&row[4]).abs()));
    let page = std::fs::read_to_string(output.join("report.html")).expect("a page");
    assert!(page.contains("Error over the distance from a seam, pipes"));
}

#[test]
fn distance_fields_are_measured_beside_occupancy_maps() {
    let folder = folder();
    let output = folder.path().join("out");
    let tiny = "bench roma --triangles 10K --size 32x18 --samples 2 --repeat 1 --adapter cpu --stages shadows -o";
    succeed(tiny.split_whitespace().map(std::ffi::OsStr::new).chain([output.as_os_str()]));
    let json = json(&output.join("roma.json"));
    // Exact rays, four kinds of maps and a field, of two lights.
    assert_eq!(json["measured"], 12);
    let own = table(&json, "shadows");
    let of = |way: &str, name: &str| entry(own, &["city", "sun of 10 degrees", way], name);
    let value = |way: &str, name: &str| {
        let key = format!("shadows/city/sun of 10 degrees/{way}");
        let row = json["rows"].as_array().unwrap().iter().find(|row| row["key"] == *key).expect("the row");
        number(&row["values"][name])
    };
    let roma = "roma 128 K=8 unsnapped";
    assert_eq!(number(&of("df 128", "bricks loaded")), 0.0, "fields need no bricks");
    assert!(number(&of("df 128", "generation, ms")) > 0.0, "a field is made for every picture");
    for (column, field, paper) in [
        ("df ÷ generation", "ms_generation", 3.6),
        ("df ÷ tracing", "ms_trace", 1.7),
        ("FLIP ÷ df", "flip_converged", f64::NAN),
    ] {
        let [own, beside] = [value(roma, field), value("df 128", field)];
        let expected = if paper.is_nan() { own / beside } else { beside / own };
        assert_eq!(number(&of(roma, column)), expected, "{column}");
        if !paper.is_nan() {
            assert_eq!(number(&of(roma, &format!("{column}, paper"))), paper);
            // The paper has no others.
            assert_eq!(of("roma 128 K=4", &format!("{column}, paper")), Value::Null);
        }
    }
}
