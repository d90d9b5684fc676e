//! Replay through the command line: a replay of the recorded requests in the recorded cache does what the walk's own
//! records say.

use crate::common::{brickwalk, city, folder, records, succeed, walk};
use serde_json::Value;
use std::path::Path;

fn near(scene: &Path) -> String {
    format!("--frames 6 --size 96x64 --path {}", scene.with_extension("near.json").display())
}

/// The sum of a field over all records of a walk.
fn total(output: &Path, field: &str) -> u64 {
    records(output).iter().map(|record| record[field].as_u64().expect("a count")).sum()
}

fn replayed(trace: &Path, options: &[&str]) -> Value {
    let words = ["replay", trace.to_str().expect("UTF-8"), "--json"];
    serde_json::from_str(&succeed(words.iter().chain(options))).expect("JSON")
}

/// Runs a command that must find its input bad; returns its one line.
fn refused(words: &[&str]) -> String {
    let output = brickwalk(words);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{words:?}: {text}");
    assert!(text.starts_with("brickwalk: ") && text.lines().count() == 1, "{words:?}: {text}");
    assert!(!text.contains("internal error") && output.stdout.is_empty(), "{words:?}: {text}");
    text
}

#[test]
fn a_replay_reproduces_the_walk() {
    let folder = folder();
    let scene = city(folder.path(), "60K", "1K");
    let least = bricks::SceneFile::open(&scene).expect("a scene");
    let sizes: Vec<(u64, u64)> =
        least.resident().bricks.iter().map(|b| (b.geometry.bytes, bricks::AttributeLayout::of(b).bytes)).collect();
    let least = brickwalk::stream::Residency::least_budget(&sizes);
    let mut loads = Vec::new();
    for (i, options) in [
        "--cache 10% --evict round-robin".to_owned(),
        "--cache 10% --evict second-chance".to_owned(),
        "--cache 10% --evict lru".to_owned(),
        // As small as it may be: batches do not fit and are cut short.
        format!("--cache {least} --evict round-robin"),
        format!("--cache {least} --evict lru --fronts on"),
        "--cache 100% --schedule plain".to_owned(),
    ]
    .iter()
    .enumerate()
    {
        let out = folder.path().join(format!("walk{i}"));
        let trace = folder.path().join(format!("trace{i}.jsonl"));
        walk(&scene, &out, &format!("{} {options} --requests-out {}", near(&scene), trace.display()));
        let replayed = replayed(&trace, &[]);
        assert_eq!(replayed["format"], 2);
        let rows = replayed["results"].as_array().expect("rows");
        let recorded: Vec<&Value> = rows.iter().filter(|row| row["recorded"] == true).collect();
        assert_eq!(recorded.len(), 1, "{options}");
        let row = recorded[0];
        let bytes: u64 =
            ["bytes_bvh", "bytes_geometry", "bytes_attributes"].iter().map(|field| total(&out, field)).sum();
        assert_eq!(row["loads"], total(&out, "bricks_loaded"), "{options}");
        // Over the walk; in records it is told within a pass, where no brick is loaded twice.
        let again = row["loads"].as_u64().zip(replayed["distinct"].as_u64()).map(|(loads, distinct)| loads - distinct);
        assert_eq!(row["loaded_again"].as_u64(), again, "{options}");
        assert_eq!((total(&out, "bricks_reloaded"), &row["reloads"]), (0, &Value::Null), "{options}");
        assert_eq!(row["evicted"], total(&out, "bricks_evicted"), "{options}");
        assert_eq!(row["loaded_bytes"], bytes, "{options}");
        loads.push(row["loads"].as_u64().expect("a count"));
        // Per size: round robin, second chances, LRU, Bélády, which knows the future.
        for four in rows.chunks(4) {
            let loads: Vec<u64> = four.iter().map(|row| row["loads"].as_u64().expect("a count")).collect();
            assert!(loads.iter().all(|&others| loads[3] <= others), "{options}: {four:?}");
            assert!(loads[3] >= replayed["distinct"].as_u64().expect("a count"));
            for row in four {
                let n = |field: &str| row[field].as_u64().expect("a count");
                assert_eq!(n("hits") + n("loads"), replayed["requests"].as_u64().expect("a count"));
                assert!(n("cache_bytes") >= least);
            }
        }
    }
    // Controls: the walks differ, so the numbers cannot agree by accident; a small cache has something to choose.
    assert!(loads[0] != loads[3] && loads[3] > loads[5], "{loads:?}");
    let [ring, belady] = [0, 3].map(|i| {
        let rows = replayed(&folder.path().join("trace3.jsonl"), &["--cache", "100%"]);
        rows["results"][i]["loads"].as_u64().expect("a count")
    });
    assert!(belady < ring, "{belady} {ring}");

    // A page: four plots with a curve per policy, a table, nothing from elsewhere; the sizes are denser.
    let (trace, page) = (folder.path().join("trace0.jsonl"), folder.path().join("replay.html"));
    let rows = replayed(&trace, &["--plot", page.to_str().expect("UTF-8")]);
    let sizes = rows["results"].as_array().expect("rows").len() / 4;
    assert!(sizes > 15, "{sizes}");
    let text = std::fs::read_to_string(&page).expect("a page");
    assert_eq!(
        (text.matches("<figure").count(), text.matches("class=\"key\"").count()),
        (4, 3 * 4 + 3),
        "a curve per policy, and one less where they are measured by Belady's"
    );
    assert_eq!(text.matches("<th scope=\"row\">").count(), sizes);
    assert!(
        text.ends_with("</html>") && !text.contains("src=") && !text.replace("href=\"data:", "").contains("href="),
        "one offline page"
    );
    let missing = folder.path().join("none/replay.html");
    let words = ["replay", trace.to_str().expect("UTF-8"), "--plot", missing.to_str().expect("UTF-8")];
    assert!(refused(&words).contains("none/replay.html"));

    // Sizes asked for: too small ones are named and skipped.
    let trace = folder.path().join("trace0.jsonl");
    let rows = replayed(&trace, &["--cache", "16", "30%,40%"]);
    assert_eq!(rows["skipped_cache_bytes"], serde_json::json!([16]));
    assert_eq!(rows["results"].as_array().expect("rows").len(), 12, "recorded, 30 %, 40 %");
    let text = succeed(["replay", trace.to_str().expect("UTF-8"), "--cache", "16"]);
    assert!(
        text.contains("as recorded")
            && text.contains("Loaded again: what the walk had loaded before")
            && text.contains("Skipped, smaller than the least cache of this scene (")
    );
}

#[test]
fn a_trace_that_is_not_whole_is_refused() {
    let folder = folder();
    let scene = city(folder.path(), "12K", "1K");
    let rays = folder.path().join("rays.npy");
    // One ray straight down, written as NumPy writes it.
    let header = format!("{:<117}\n", "{'descr': '<f8', 'fortran_order': False, 'shape': (1, 8), }");
    let mut npy = b"\x93NUMPY\x01\x00".to_vec();
    npy.extend((header.len() as u16).to_le_bytes());
    npy.extend(header.bytes());
    [0.0, 500.0, 0.0, 0.0, -1.0, 0.0, 0.0, f64::INFINITY].iter().for_each(|x: &f64| npy.extend(x.to_le_bytes()));
    std::fs::write(&rays, npy).expect("rays");
    let whole = folder.path().join("whole.jsonl");
    let [scene, rays, whole] = [&scene, &rays, &whole].map(|path| path.to_str().expect("UTF-8"));
    let hits = format!("{rays}.hits.npy");
    let missing = format!("{scene}.no/such/folder.jsonl");
    let words = |requests| ["trace", scene, "--rays", rays, "-o", &hits, "--cache", "30%", "--requests-out", requests];
    let line = refused(&words(&missing));
    assert!(line.contains("--requests-out") && !Path::new(&hits).exists(), "{line}");
    succeed(words(whole));
    assert!(replayed(Path::new(whole), &[])["requests"].as_u64() > Some(0), "trace records requests, too");

    let good = std::fs::read(whole).expect("a trace");
    let last_line = good[..good.len() - 1].iter().rposition(|&byte| byte == b'\n').expect("two lines") + 1;
    let huge = concat!(
        r#"{"format":4,"policy":"lru","budget_bytes":18446744073709551600,"page_bytes":16,"passes":0,"#,
        r#""sizes":[[18446744073709551600,16]],"tiles":[]}"#
    );
    let file = folder.path().join("bad.jsonl");
    let name = file.to_str().expect("UTF-8");
    for bad in [
        &b""[..],
        b"no trace",
        b"\xff\xfe\x00",
        b"{\"format\":1}",
        &good[..good.len() / 2],
        &good[..good.len() - 3],
        // Cut between two lines.
        &good[..last_line],
        &[&good[..], b"{}"].concat(),
        huge.as_bytes(),
        &std::fs::read(scene).expect("a scene"),
    ] {
        std::fs::write(&file, bad).expect("a file");
        let line = refused(&["replay", name]);
        assert!(line.contains("bad.jsonl"), "{line}");
    }
    assert!(refused(&["replay", &missing]).contains("cannot open this file"));
    assert!(refused(&["replay", folder.path().to_str().expect("UTF-8")]).contains("folder"));
    // Control: whole, it is read.
    std::fs::write(&file, &good).expect("a file");
    succeed(["replay", name]);
}
