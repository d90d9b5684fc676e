//! The commands that need no graphics adapter, as a user runs them: exit statuses, one line per error, outputs that
//! appear complete or not at all.

use crate::common::{add_fields, add_level, folder, names, succeed};
use brickwalk::reference::Truth;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn brickwalk(folder: &Path, line: &str) -> Output {
    Command::new(env!("CARGO_BIN_EXE_brickwalk"))
        .args(line.split_whitespace())
        .current_dir(folder)
        .stdin(Stdio::null())
        .output()
        .unwrap()
}

fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Runs a command that must succeed without a word on standard error; returns its standard output.
fn done(folder: &Path, line: &str) -> String {
    let output = brickwalk(folder, line);
    assert_eq!(output.status.code(), Some(0), "{line}: {}", stderr(&output));
    assert_eq!(stderr(&output), "", "{line}: a pipe sees no progress");
    stdout(&output)
}

/// Runs a command that must find its input bad; returns its one line.
fn refused(folder: &Path, line: &str) -> String {
    let output = brickwalk(folder, line);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{line}: {text}");
    assert!(text.starts_with("brickwalk: ") && text.lines().count() == 1 && text.ends_with('\n'), "{line}: {text:?}");
    assert!(!text.contains("internal error"), "{text}");
    text
}

#[test]
fn a_generated_scene_is_described_and_verified() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let said = done(folder, "scene city -o city.bricks --triangles 12K --brick-triangles 1K");
    assert!(said.contains("city.bricks: ") && said.contains("city.near.json"), "{said}");
    let found = names(folder);
    for name in ["city.bricks", "city.near.json", "city.far.json"] {
        assert!(found.contains(&name.to_string()), "{found:?}");
    }
    assert!(found.iter().all(|name| name.starts_with("city.")), "no temporary is left: {found:?}");

    let info: serde_json::Value = serde_json::from_str(&done(folder, "info city.bricks --json")).unwrap();
    assert_eq!(info["format"], 4);
    let triangles = info["triangles_stored"].as_u64().unwrap();
    assert!((11_000..=12_000).contains(&triangles), "{triangles}");
    assert!(info["bricks"].as_u64().unwrap() >= triangles / 1000);
    assert!(info["largest_brick_triangles"].as_u64().unwrap() <= 1000);
    assert!(info["two_largest_bricks_bytes"].as_u64().unwrap() > 0);
    assert!(done(folder, "info city.bricks").contains("triangles"));
    let sum = |sizes: &serde_json::Value| -> u64 {
        let sizes = sizes.as_object().unwrap();
        let inner = sizes.values().filter_map(|value| value.as_object()).flat_map(|inner| inner.values());
        inner.chain(sizes.values()).filter_map(|value| value.as_u64()).sum()
    };
    assert_eq!(sum(&info["sections"]), info["file_bytes"].as_u64().unwrap());
    assert!(info["per_triangle"]["traversal"].as_f64().unwrap() > 19.0, "nodes, 6 + 4 bytes, vertices");
    let bins = info["brick_histogram"].as_array().unwrap();
    assert_eq!(bins.iter().map(|bin| bin["bricks"].as_u64().unwrap()).sum::<u64>(), info["bricks"].as_u64().unwrap());
    assert!(info["trees"]["sah"].is_null());
    let deep: serde_json::Value = serde_json::from_str(&done(folder, "info city.bricks --json --deep")).unwrap();
    let cost = |name: &str| deep["trees"]["sah"][name].as_f64().unwrap();
    assert!(cost("nodes") > deep["trees"]["top_level_sah"]["wide_nodes"].as_f64().unwrap());
    assert!(cost("triangles") > 0.0 && cost("cost") > cost("nodes"));

    let ids = info["triangle_ids"].as_u64().unwrap();
    assert!(info.get("displacement").is_none() && info["sections"].get("displacement").is_none());
    assert!(!done(folder, "info city.bricks").contains("displacement"));
    let with_fields = folder.join("fields.bricks");
    std::fs::copy(folder.join("city.bricks"), &with_fields).unwrap();
    add_fields(&with_fields);
    let fields: serde_json::Value = serde_json::from_str(&done(folder, "info fields.bricks --json")).unwrap();
    let list = &fields["displacement"];
    assert_eq!((&list["fields"], &list["objects"], &list["bricks"]), (&2.into(), &1.into(), &1.into()));
    assert_eq!(list["loaded_bytes"], 592 + 1090 * 16);
    assert_eq!(list["sampled"][1]["positions"], 1090);
    assert_eq!(fields["sections"]["displacement"], list["bytes"]);
    assert_eq!(sum(&fields["sections"]), fields["file_bytes"].as_u64().unwrap());
    let text = done(folder, "info fields.bricks");
    assert!(text.contains("2 fields of 1 object and 1 brick, 17.6 KiB loaded, "), "{text}");
    assert!(text.contains("1 field of 1090 positions x 16 directions, 8 bits a sample"), "{text}");
    assert!(done(folder, "verify fields.bricks").contains("OK"));
    assert!(info.get("levels").is_none() && info["sections"].get("levels").is_none());
    assert!(!done(folder, "info city.bricks").contains("depth 1"));
    add_level(&with_fields);
    // Fields are added to levels, which stay.
    add_fields(&with_fields);
    let levels: serde_json::Value = serde_json::from_str(&done(folder, "info fields.bricks --json")).unwrap();
    let list = &levels["levels"];
    assert_eq!((&list["levels"], &list["objects"], &list["depths"][0]["levels"]), (&1.into(), &1.into(), &1.into()));
    assert_eq!((&list["median_error"], &list["largest_bound"]), (&0.5.into(), &2.0.into()));
    assert!(list["share_of_bricks"].as_f64().is_some_and(|share| share > 0.0 && share < 1.0), "{list}");
    assert_eq!(levels["sections"]["levels"], list["bytes"]);
    assert_eq!(levels["displacement"], fields["displacement"]);
    assert_eq!(sum(&levels["sections"]), levels["file_bytes"].as_u64().unwrap());
    assert_eq!(levels["bricks"], info["bricks"]);
    let text = done(folder, "info fields.bricks");
    assert!(text.contains("depth 1: 1 level, error 5.000e-1 median, bound 2.000e0"), "{text}");
    assert!(done(folder, "verify fields.bricks").contains("OK"));
    let origin: serde_json::Value =
        serde_json::from_str(&done(folder, &format!("info city.bricks --json --id {}", ids - 1))).unwrap();
    assert_eq!(origin["id"], ids - 1);
    let line = refused(folder, &format!("info city.bricks --id {ids}"));
    assert!(line.contains(&format!("0 to {}", ids - 1)), "{line}");

    assert!(done(folder, "verify city.bricks").contains("city.bricks: OK: "));
}

/// The greatest difference of a coordinate between triangles of the same id; `None`: other ids.
fn greatest_difference(a: &Path, b: &Path) -> Option<f64> {
    let [a, b] = [a, b].map(|file| Truth::load(&bricks::SceneFile::open(file).unwrap()).unwrap());
    if !a.ids().eq(b.ids()) {
        return None;
    }
    let of_triangle = |id| {
        let (p, q) = (a.vertices(id).unwrap(), b.vertices(id).unwrap());
        p.as_flattened().iter().zip(q.as_flattened()).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
    };
    Some(a.ids().map(of_triangle).fold(0.0, f64::max))
}

#[test]
fn a_scene_by_way_of_glb_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let city = "scene city --triangles 100K";
    done(folder, &format!("{city} -o a.bricks --lattice -12"));
    done(folder, &format!("{city} -o a.glb"));
    done(folder, "convert a.glb -o b.bricks --lattice -12");
    let at = |name: &str| folder.join(name);
    // Each is rounded by half a step of the lattice; f32 relative to anchors within 1 km: 2^-15.
    let difference = greatest_difference(&at("a.bricks"), &at("b.bricks")).expect("the same ids");
    assert!(difference <= 2.0f64.powi(-12) + 2.0f64.powi(-15), "{difference}");
    let origin = |file: &str, id: u32| -> serde_json::Value {
        let mut origin: serde_json::Value =
            serde_json::from_str(&done(folder, &format!("info {file} --json --id {id}"))).unwrap();
        origin.as_object_mut().unwrap().retain(|key, _| key != "file");
        origin
    };
    for id in [0, 1, 40_000, 90_000] {
        assert_eq!(origin("a.bricks", id), origin("b.bricks", id));
    }

    assert_ne!(origin("a.bricks", 0), origin("b.bricks", 90_000));
    done(folder, &format!("{city} -o c.bricks --lattice -12 --seed 1"));
    assert!(greatest_difference(&at("c.bricks"), &at("b.bricks")).is_none_or(|difference| difference > 1.0));
}

#[test]
fn stiff_scenes_convert_verify_and_walk() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for case in brickwalk_scenes::Stiff::ALL {
        let few = if case == brickwalk_scenes::Stiff::Duplicates { "--triangles 20K" } else { "" };
        let output = brickwalk(folder, &format!("scene stiff --case {case} -o {case}.bricks {few}"));
        let (said, warned) = (stdout(&output), stderr(&output));
        // The least triangles of the series are no larger than a step of the lattice.
        let is_known = case == brickwalk_scenes::Stiff::Series && warned.contains("degenerate triangles skipped");
        assert!(output.status.success() && (warned.is_empty() || is_known), "{case}: {warned}");
        let is_empty = case == brickwalk_scenes::Stiff::Empty;
        assert!(said.contains(&format!("{case}.bricks: ")) && is_empty != said.contains(".far.json"), "{said}");
        assert!(done(folder, &format!("verify {case}.bricks")).contains(": OK: "));
        let info: serde_json::Value =
            serde_json::from_str(&done(folder, &format!("info {case}.bricks --json"))).unwrap();
        let stored = info["triangles_stored"].as_u64().unwrap();
        let asked = if few.is_empty() { case.default_triangles() } else { 20_000 };
        assert!(stored <= asked && 2 * stored >= asked, "{case}: {stored} of {asked}");
        let view = if is_empty { String::new() } else { format!("--path {case}.far.json") };
        done(
            folder,
            &format!("walk {case}.bricks -o out --adapter cpu --size 48x32 --frames 2 --cache 100% --aov {view}"),
        );
        let summary = std::fs::read(folder.join("out/summary.json")).unwrap();
        let summary: serde_json::Value = serde_json::from_slice(&summary).unwrap();
        assert_eq!(summary["non_finite"], 0, "{case}");
    }
    // By way of glTF, which is f32, the triangles are as many.
    done(folder, "scene stiff --case sheets -o g.glb");
    done(folder, "convert g.glb -o g.bricks");
    let stored = |file: &str| -> serde_json::Value {
        let info: serde_json::Value = serde_json::from_str(&done(folder, &format!("info {file} --json"))).unwrap();
        info["triangles_stored"].clone()
    };
    assert_eq!(stored("g.bricks"), stored("sheets.bricks"));
    assert!(folder.join("g.far.json").exists() && !folder.join("g.near.json").exists());
    // What it was made from is in its name, with the lattice of the case.
    let scene = bricks::SceneFile::open(folder.join("slivers.bricks")).unwrap();
    let span = scene.span(bricks::Payload::Geometry(0));
    let whole = std::fs::read(folder.join("slivers.bricks")).unwrap();
    let mut damaged = whole.clone();
    damaged[(span.offset + span.bytes / 2) as usize] ^= 0x10;
    std::fs::write(folder.join("slivers.bricks"), damaged).unwrap();
    done(folder, "repair slivers.bricks");
    assert!(std::fs::read(folder.join("slivers.bricks")).unwrap() == whole);
}

#[test]
fn light_that_is_not_finite_fails_a_walk_loudly() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    done(folder, "scene stiff --case cube -o c.bricks");
    // With the usual cache, which holds some of its bricks.
    let walk = "walk c.bricks -o out --quality exact --adapter cpu --size 48x32 --frames 1 --path c.far.json";
    done(folder, walk);
    // Of light too bright for f32 each pass counts what it left out; what overflows in sums is counted, too.
    for (light, pass) in [("--sun-intensity 1e300", "shadow"), ("--sky-intensity 1e300", "primary")] {
        let line = refused(folder, &format!("{walk} {light}"));
        assert!(line.contains("non-finite pixel") && line.contains("records.jsonl"), "{line}");
        let json = |text: &str| -> serde_json::Value { serde_json::from_str(text).unwrap() };
        let summary = json(&std::fs::read_to_string(folder.join("out/summary.json")).unwrap());
        let records = std::fs::read_to_string(folder.join("out/records.jsonl")).unwrap();
        let counts: Vec<(String, u64)> = records
            .lines()
            .map(json)
            .map(|record| (record["pass"].as_str().unwrap().into(), record["non_finite"].as_u64().unwrap()))
            .collect();
        assert_eq!(summary["non_finite"], counts.iter().map(|(_, n)| n).sum::<u64>());
        let of_pass = counts.iter().find(|(name, _)| name == pass).unwrap().1;
        assert!(of_pass > 0, "{light}: {counts:?}");
    }
}

#[test]
fn verify_names_the_damaged_brick() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    done(folder, "scene city -o city.bricks --triangles 12K --brick-triangles 1K");
    let file = folder.join("city.bricks");
    let whole = std::fs::read(&file).unwrap();
    let scene = bricks::SceneFile::open(&file).unwrap();
    for brick in [0, 3] {
        let span = scene.span(bricks::Payload::Geometry(brick));
        let mut damaged = whole.clone();
        damaged[(span.offset + span.bytes / 2) as usize] ^= 0x10;
        std::fs::write(folder.join("damaged.bricks"), damaged).unwrap();
        let line = refused(folder, "verify damaged.bricks");
        assert!(line.contains(&format!("damaged.bricks: brick {brick} ")), "{line}");
        assert!(line.contains("brickwalk repair") && line.matches("damaged.bricks").count() == 1, "{line}");
        // The resident part is whole, so what it says can still be read.
        done(folder, "info damaged.bricks");
    }
    std::fs::write(folder.join("short.bricks"), &whole[..whole.len() / 2]).unwrap();
    assert!(refused(folder, "verify short.bricks").contains("too short"));
    assert!(refused(folder, "info short.bricks").contains("too short"));
}

#[test]
fn bad_input_is_one_line_and_exit_status_1() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("text.bricks"), "this is no scene").unwrap();
    std::fs::write(folder.join("text.gltf"), "{\"asset\": ").unwrap();
    std::fs::write(folder.join("text.png"), "neither").unwrap();
    std::fs::create_dir(folder.join("empty")).unwrap();
    let before = names(folder);
    for (line, part) in [
        ("info missing.bricks", "missing.bricks"),
        ("info text.bricks", "not a .bricks scene file"),
        ("info empty", "empty"),
        ("verify text.bricks", "text.bricks"),
        ("convert missing.gltf -o out.bricks", "missing.gltf"),
        ("convert text.gltf -o out.bricks", "text.gltf"),
        ("convert text.png -o out.bricks", "text.png"),
        ("convert empty -o out.bricks", "no .gltf, .glb, .obj"),
        ("convert text.gltf -o text.gltf", "overwrite"),
        ("convert text.gltf -o empty", "folder"),
        ("scene city -o no/such/out.bricks --triangles 12K", "out.bricks"),
        ("walk missing.bricks -o out", "missing.bricks"),
        ("walk text.bricks -o out", "text.bricks"),
        ("trace missing.bricks --rays r.npy -o h.npy", ""),
        ("compare text.png text.png", "text.png"),
        ("compare missing.png text.png", "missing.png"),
    ] {
        let said = refused(folder, line);
        assert!(said.contains(part), "{line}: {said}");
    }
    assert_eq!(names(folder), before, "nothing is left behind");
}

#[test]
fn wrong_usage_is_exit_status_2_and_help_is_0() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for line in [
        "",
        "fly",
        "info",
        "walk s.bricks",
        "walk s.bricks -o out --frames 0",
        "walk s.bricks -o out --effects surroundings",
        "walk s.bricks -o out --schedule fastest",
        "scene pipe -o s.bricks",
        "scene city -o s.bricks --triangles 3",
        "trace s.bricks --rays r.npy -o h.npy --fronts on",
    ] {
        let output = brickwalk(folder, line);
        assert_eq!(output.status.code(), Some(2), "{line}: {}", stderr(&output));
        assert!(stdout(&output).is_empty() && !stderr(&output).is_empty(), "{line}");
    }
    assert!(done(folder, "--version").starts_with("brickwalk "));
    for command in ["", "demo", "convert", "scene", "info", "verify", "repair", "walk", "trace", "replay", "compare"] {
        assert!(done(folder, &format!("{command} --help")).contains("Usage: brickwalk"), "{command}");
    }
    assert!(names(folder).is_empty());
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    done(folder, "scene city -o city.bricks --triangles 12K");
    let mut child = Command::new(env!("CARGO_BIN_EXE_brickwalk"))
        .args(["info", "city.bricks", "--json"])
        .current_dir(folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!((output.status.code(), stderr(&output).as_str()), (Some(0), ""));
}

/// The finest step that `info` names is one at which no brick is wide; far finer ones make some wide.
#[test]
fn the_finest_lattice_without_wide_bricks_is_named() {
    let folder = folder();
    let input = folder.path().join("hill.obj");
    let point = |i: u32| format!("v {} {} {}\n", i % 60, (i * 7 % 13) as f64 * 0.3, i / 60);
    let square = |i: u32| format!("f {} {} {} {}\n", i + 1, i + 2, i + 62, i + 61);
    let squares = (0..59 * 60).filter(|i| i % 60 < 59).map(square);
    std::fs::write(&input, (0..3600).map(point).chain(squares).collect::<String>()).expect("a model");
    let facts = |lattice: Option<String>| {
        let scene = folder.path().join("hill.bricks");
        let words = ["convert".as_ref(), input.as_os_str(), "-o".as_ref(), scene.as_os_str()];
        let step = lattice.map(|step| format!("--lattice={step}"));
        succeed(words.into_iter().chain(step.iter().map(std::ffi::OsStr::new)));
        let text = succeed(["info".as_ref(), scene.as_os_str()]);
        let json = succeed(["info".as_ref(), scene.as_os_str(), "--json".as_ref()]);
        let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        (text, json["wide_bricks"].as_u64().expect("a count"), json["finest_lattice_log2"].as_i64().expect("a step"))
    };
    let (text, wide, finest) = facts(None);
    assert!(wide == 0 && text.contains(&format!("convert --lattice {finest} rounds finest")), "{text}");
    for lattice in [finest.to_string(), "finest".into()] {
        let (text, wide, again) = facts(Some(lattice));
        assert!(wide == 0 && again == finest && !text.contains("rounds finest"), "{text}");
        assert!(text.contains(&format!("step 2^{finest} ")), "{text}");
    }
    assert!(facts(Some((finest - 2).to_string())).1 > 0, "the comparison can fail");
}
