//! The command line as a user runs it, above all on bad input: one line, exit 1 or 2, nothing half-written.

use crate::common::{self, brickwalk, city, folder, walk};
use std::ffi::OsString;
use std::path::Path;

/// Runs a command that must fail with `status` and one line that holds every word of `says`.
fn refuse(words: &[&str], status: i32, says: &[&str]) {
    let output = brickwalk(words);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(status), "{words:?}: {message}");
    if status == 1 {
        assert_eq!(message.lines().count(), 1, "{words:?}: {message}");
        assert!(message.starts_with("brickwalk: "), "{words:?}: {message}");
    }
    for word in says {
        assert!(message.contains(word), "{words:?}: {message:?} does not say {word:?}");
    }
}

fn text(path: &Path) -> &str {
    path.to_str().expect("test paths are UTF-8")
}

#[test]
fn usage_is_refused_with_status_2() {
    refuse(&[], 2, &[]);
    refuse(&["fly"], 2, &["fly"]);
    refuse(&["walk", "s.bricks"], 2, &["--output"]);
    for (option, value) in [
        ("--size", "0x10"),
        ("--size", "10"),
        ("--size", "99999999x2"),
        ("--frames", "0"),
        ("--cache", "0"),
        ("--cache", "99999999999999999999G"),
        ("--cache", "101%"),
        ("--effects", "primary,glow"),
        ("--environment-rotation", "400"),
        ("--df-size", "100"),
        ("--schedule", "best"),
        ("--spp", "0"),
        ("--tile", "0"),
        ("--sun", "0,0,0"),
        ("--fov", "180"),
    ] {
        refuse(&["walk", "s.bricks", "-o", "out", option, value], 2, &[option]);
    }
}

#[test]
fn bad_scenes_are_refused_with_status_1() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    let out = at("out");
    refuse(&["walk", text(&at("missing.bricks")), "-o", text(&out)], 1, &["missing.bricks"]);
    std::fs::write(at("noise.bricks"), vec![7u8; 100_000]).expect("a file");
    refuse(&["walk", text(&at("noise.bricks")), "-o", text(&out)], 1, &["noise.bricks"]);
    refuse(&["info", text(&at("noise.bricks"))], 1, &["noise.bricks"]);
    refuse(&["verify", text(&at("noise.bricks"))], 1, &["noise.bricks"]);
    refuse(&["info", text(folder.path())], 1, &[]);
    assert!(!out.exists(), "a refused walk leaves nothing");

    let scene = city(folder.path(), "30K", "1K");
    let whole = std::fs::read(&scene).expect("the scene");
    for keep in [0, 100, 4096, whole.len() / 2, whole.len() - 1] {
        std::fs::write(at("cut.bricks"), &whole[..keep]).expect("a file");
        refuse(&["walk", text(&at("cut.bricks")), "-o", text(&out)], 1, &["cut.bricks"]);
        refuse(&["verify", text(&at("cut.bricks"))], 1, &["cut.bricks"]);
    }
    // A flipped byte in the geometry of brick 7: verify names the brick, a walk that loads it fails with its name.
    let mut flipped = whole.clone();
    let geometry = bricks::SceneFile::open(&scene).expect("the scene").resident().bricks[7].geometry;
    flipped[geometry.offset as usize + 100] ^= 16;
    std::fs::write(at("flipped.bricks"), &flipped).expect("a file");
    refuse(&["verify", text(&at("flipped.bricks"))], 1, &["flipped.bricks", "brick 7"]);
    let everything = ["--cache", "100%", "--schedule", "plain", "--frames", "1", "--size", "32x32"];
    let (damaged, flipped_out) = (at("flipped.bricks"), at("flipped"));
    let words = [&["walk", text(&damaged), "-o", text(&flipped_out)], &everything[..]].concat();
    refuse(&words, 1, &["flipped.bricks", "brick 7", "brickwalk repair"]);
    refuse(&["walk", text(&scene), "-o", text(&out), "--cache", "1K"], 1, &["cache", "two largest bricks"]);
    refuse(
        &["walk", text(&scene), "-o", text(&out), "--cache", "20%", "--schedule", "plain"],
        1,
        &["plain", "--cache"],
    );
    refuse(&["walk", text(&scene), "-o", text(&out), "--path", text(&at("none.json"))], 1, &["none.json"]);
    std::fs::write(at("bad.json"), "{\"fov_y_degrees\": 60}").expect("a file");
    refuse(&["walk", text(&scene), "-o", text(&out), "--path", text(&at("bad.json"))], 1, &["bad.json"]);
    refuse(&["walk", text(&scene), "-o", "/proc/none/out"], 1, &["/proc/none/out"]);
    refuse(&["walk", text(&scene), "-o", text(&out), "--adapter", "no such adapter"], 1, &["no such adapter"]);
}

#[test]
fn bad_inputs_of_conversion_leave_the_old_file_alone() {
    let folder = folder();
    let old = folder.path().join("old.bricks");
    std::fs::write(&old, "precious").expect("a file");
    let input = folder.path().join("broken.gltf");
    std::fs::write(&input, "{\"asset\": {\"version\": \"2.0\"").expect("a file");
    refuse(&["convert", text(&input), "-o", text(&old)], 1, &["broken.gltf"]);
    refuse(&["convert", "missing.glb", "-o", text(&old)], 1, &["missing.glb"]);
    refuse(&["convert", text(&old), "-o", text(&old)], 1, &["old.bricks"]);
    assert_eq!(std::fs::read(&old).expect("the old file"), b"precious");
    let names: Vec<OsString> =
        std::fs::read_dir(&folder).expect("a folder").map(|e| e.expect("an entry").file_name()).collect();
    assert_eq!(names.len(), 2, "nothing half-written: {names:?}");
}

#[test]
fn an_empty_scene_renders_background() {
    let folder = folder();
    let input = folder.path().join("empty.gltf");
    std::fs::write(&input, r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": []}], "scene": 0}"#).expect("a file");
    let scene = folder.path().join("empty.bricks");
    common::succeed(["convert", text(&input), "-o", text(&scene)]);
    common::succeed(["verify", text(&scene)]);
    common::succeed(["info", text(&scene)]);
    for schedule in ["chc", "demand", "plain", "auto"] {
        let out = folder.path().join(schedule);
        walk(&scene, &out, &format!("--frames 1 --size 32x16 --schedule {schedule}"));
        let image = image::open(out.join("frames/0000.png")).expect("a frame").to_rgb8();
        assert!(image.pixels().all(|p| p.0[2] > 0), "{schedule}: sky everywhere");
    }
}

#[test]
fn records_and_summary_hold_every_field_and_agree() {
    let folder = folder();
    let scene = city(folder.path(), "60K", "1K");
    let out = folder.path().join("out");
    let path = scene.with_extension("near.json");
    let printed = walk(
        &scene,
        &out,
        &format!("--frames 3 --size 96x64 --cache 20% --json --measure-needed --path {}", path.display()),
    );
    let lines = std::fs::read_to_string(out.join("records.jsonl")).expect("records");
    assert_eq!(printed, lines, "--json prints the records");
    let records: Vec<serde_json::Value> = lines.lines().map(|l| serde_json::from_str(l).expect("a record")).collect();
    assert_eq!(records.len(), 6, "one row per frame and pass");
    let fields = "frame pass rays rays_traced rays_answered ms ms_phase1 ms_phase2 ms_phase3 ms_stream mrays_per_s \
        queries queries_visible queries_interval_culled multi_queries multi_queries_failed pairs_visible \
        pairs_invisible pulled_up pairs_intersected round_trips bricks_needed bricks_hit bricks_loaded bricks_reloaded \
        bricks_evicted bytes_bvh bytes_geometry bytes_attributes bytes_textures cache_bytes cache_used_bytes \
        unresolved_pixels non_finite";
    for record in &records {
        for field in fields.split_whitespace() {
            assert!(!record[field].is_null(), "{field} is missing in {record}");
        }
        let n = |field: &str| record[field].as_u64().unwrap_or_else(|| panic!("{field} is a count"));
        assert_eq!(n("bricks_resident_start") + n("bricks_loaded") - n("bricks_evicted"), n("bricks_resident_end"));
        assert!(n("bricks_hit") <= n("bricks_needed"), "{record}");
        assert!(n("cache_used_bytes") <= n("cache_bytes"));
        assert_eq!(n("bricks_reloaded"), 0, "no brick is loaded twice in a pass");
        assert!(n("round_trips") <= 4 + n("load_batches"), "{record}");
        assert_eq!(n("non_finite") + n("unresolved_pixels"), 0);
    }
    assert!(records.iter().any(|r| r["bricks_evicted"].as_u64() > Some(0)), "the cache is small enough to evict");
    let summary: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("summary.json")).expect("a summary")).expect("JSON");
    assert_eq!(summary["format"], 2);
    for pass in ["primary", "shadow"] {
        for field in fields.split_whitespace().filter(|f| !["frame", "pass"].contains(f)) {
            let total: f64 = records.iter().filter(|r| r["pass"] == pass).filter_map(|r| r[field].as_f64()).sum();
            let stated = summary["passes"][pass]["total"][field].as_f64().unwrap_or_else(|| panic!("{pass} {field}"));
            assert!((total - stated).abs() <= 1e-9 * total.abs(), "{pass} {field}: {total} is not {stated}");
        }
    }
    assert_eq!(summary["passes"]["primary"]["total"]["rays"], 3 * 96 * 64);
    let report = std::fs::read_to_string(out.join("report.html")).expect("a report");
    assert!(report.contains("</html>") && !report.contains("src=\"http"), "one offline page");
}
