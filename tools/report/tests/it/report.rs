//! Reports of synthetic walks: complete, interrupted, with fields missing, and malformed.

use crate::markup;

use brickwalk_report::{Field, ReportError, write};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// Every field of a record, in the order of the interface.
const FIELDS: [&str; 40] = [
    "frame",
    "pass",
    "rays",
    "rays_traced",
    "rays_answered",
    "ms",
    "ms_phase1",
    "ms_phase2",
    "ms_phase3",
    "ms_stream",
    "mrays_per_s",
    "queries",
    "queries_visible",
    "queries_interval_culled",
    "multi_queries",
    "multi_queries_failed",
    "pairs_visible",
    "pairs_invisible",
    "pulled_up",
    "pairs_intersected",
    "round_trips",
    "bricks_needed",
    "bricks_hit",
    "bricks_loaded",
    "bricks_reloaded",
    "bricks_evicted",
    "bricks_resident_start",
    "bricks_resident_end",
    "load_batches",
    "bytes_needed",
    "bytes_needed_missing",
    "bytes_bvh",
    "bytes_geometry",
    "bytes_attributes",
    "bytes_textures",
    "nodes_visited",
    "triangles_tested",
    "cache_bytes",
    "cache_used_bytes",
    "unresolved_pixels",
];

/// Titles of the plots that every pass has, and of those that all passes share.
const PASS_PLOTS: [&str; 6] = ["Time per phase", "Queries", "Pairs", "Bytes moved", "Bytes needed", "Bricks"];
const SHARED_PLOTS: [&str; 3] = ["Throughput", "Cache use", "Round trips"];

/// A record without zeros except for `unresolved_pixels` and `non_finite`.
fn record(frame: u64, pass: &str) -> Value {
    let mut record = json!({});
    for (k, field) in FIELDS.iter().enumerate() {
        record[*field] = match *field {
            "frame" => frame.into(),
            "pass" => pass.into(),
            "unresolved_pixels" => 0.into(),
            _ if field.starts_with("ms") || *field == "mrays_per_s" => (1.5 + k as f64 + frame as f64 / 7.0).into(),
            _ => (1000 * k as u64 + 37 * frame).into(),
        };
    }
    record["non_finite"] = 0.into();
    record
}

pub fn records(frames: u64, passes: &[&str]) -> Vec<Value> {
    (0..frames).flat_map(|frame| passes.iter().map(move |pass| record(frame, pass))).collect()
}

pub fn summary(frames: u64) -> Value {
    json!({
        "format": 2, "version": "0.1.0", "commit": "0123abc",
        "adapter": { "name": "Test <adapter> & co", "driver": "drv", "driver_info": "1.2.3", "backend": "vulkan" },
        "scene": { "file": "city \"<1M>\".bricks", "file_bytes": 123456789, "bricks": 84,
                   "brick_bytes": 104857600, "triangles": 1000003 },
        "settings": { "frames": 30, "width": 1280, "height": 720, "schedule": "chc", "fronts": "on",
                      "cache_bytes": 26214400, "cache_percent": 25.0, "sun": [0.4, 0.8, 0.45] },
        "frames": frames,
        "left_out": [{ "what": "texture lookups", "why": "no material has a texture" }],
        "memory": { "peak_bytes": 456789012, "mapped_bytes": 20971520 },
        "unresolved_pixels": 0,
    })
}

/// A PNG's signature and header: enough to be embedded.
fn png() -> Vec<u8> {
    let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec();
    png.extend([0, 0, 5, 0, 0, 0, 2, 208, 8, 2, 0, 0, 0]);
    png
}

pub fn walk(records: &[Value], summary: &Value, frames: u64) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let lines: String = records.iter().map(|record| format!("{record}\n")).collect();
    fs::write(dir.path().join("records.jsonl"), lines).unwrap();
    fs::write(dir.path().join("summary.json"), summary.to_string()).unwrap();
    fs::create_dir(dir.path().join("frames")).unwrap();
    for frame in 0..frames {
        fs::write(dir.path().join(format!("frames/{frame:04}.png")), png()).unwrap();
    }
    dir
}

/// Writes the report, checks what every report has to be, and returns it.
pub fn report(dir: &Path) -> String {
    let field = |name, adds_up, only| Field { name, meaning: format!("what {name} means"), only, adds_up };
    let fronts = "with `--fronts on` and multi-queries";
    let known = [field("ms", true, ""), field("cache_bytes", false, ""), field("multi_queries", true, fronts)];
    write(dir, &known).unwrap();
    let html = fs::read_to_string(dir.join("report.html")).unwrap();
    markup::check(&html).unwrap();
    for outside in ["http", "<script src", "import(", "fetch(", "<link", "@import", "url(", "src=\"/", "href=\"/"] {
        assert!(!html.contains(outside), "the page refers to something outside: {outside}");
    }
    let names: Vec<_> = fs::read_dir(dir).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    assert!(names.iter().all(|name| !name.ends_with(".tmp")), "{names:?}");
    html
}

/// The titles of the drawn plots.
fn titles(html: &str) -> Vec<&str> {
    html.split("<h3>").skip(1).filter_map(|part| part.split('<').next()).collect()
}

#[test]
fn a_complete_walk_has_every_plot_field_and_frame() {
    let dir = walk(&records(30, &["primary", "shadow"]), &summary(30), 30);
    let html = report(dir.path());
    let mut expected = SHARED_PLOTS.to_vec();
    expected.extend(PASS_PLOTS.repeat(2));
    assert_eq!(titles(&html), expected);
    assert_eq!(html.matches("role=\"img\"").count(), expected.len());
    for field in FIELDS.iter().filter(|field| !["frame", "pass"].contains(field)) {
        assert!(html.contains(&format!("<code>{field}</code>")), "{field} is not in the table");
    }
    assert_eq!(html.matches("src=\"data:image/png;base64,iVBORw0KGgo").count(), 12);
    assert_eq!(html.matches("width=\"1280\" height=\"720\"").count(), 12);
    for frame in 0..30 {
        assert_eq!(html.matches(&format!("href=\"frames/{frame:04}.png\"")).count(), 1, "frame {frame}");
    }
    for fact in [
        "city &quot;&lt;1M&gt;&quot;.bricks",
        "1,000,003",
        "84, 100 MiB",
        "118 MiB",
        "1280 × 720 px",
        "25.0 MiB, 25.0 % of the bricks",
        "chc, fronts on",
        "Test &lt;adapter&gt; &amp; co (vulkan)",
        "drv 1.2.3",
        "0123abc, version 0.1.0",
        "30 of 30 frames finished",
        "every pixel is final and finite",
        "no material has a texture",
        "436 MiB (456,789,012 bytes)",
        "0.4, 0.8, 0.45",
    ] {
        assert!(html.contains(fact), "{fact} is missing");
    }
}

#[test]
fn the_statistics_are_those_of_the_records() {
    let with = |frame: u64, rays: u64, ms: f64| {
        let rate = rays as f64 / ms * 1e-3;
        json!({
            "frame": frame, "pass": "primary", "rays_traced": rays, "rays_answered": 7 * frame,
            "ms": ms, "mrays_per_s": rate, "cache_bytes": 7
        })
    };
    // Median 3 ms, p95 linear between the fourth and fifth: 4 + 0.8·(14 − 4) = 12 ms; 24 ms and 60M rays in all.
    let rows: Vec<Value> =
        [1.0, 2.0, 3.0, 4.0, 14.0].iter().zip(0..).map(|(ms, frame)| with(frame, 12_000_000, *ms)).collect();
    let html = report(walk(&rows, &summary(5), 0).path());
    for cells in [
        "<code>ms</code></th><td>24</td><td>3</td><td>12.0</td>",
        "<code>rays_traced</code></th><td>60,000,000</td><td>12,000,000</td><td>12,000,000</td>",
    ] {
        assert!(html.contains(cells), "{cells}");
    }
    assert_eq!(html.matches("what ms means").count(), 1);
    // A state has no total.
    assert!(html.contains("<code>cache_bytes</code></th><td>–</td><td>7</td><td>7</td>"));
    // All rays over all time, not the sum of rates.
    assert!(html.contains("<th scope=\"row\">total</th><td>60,000,000</td><td>70</td><td>2,500</td><td>24.0</td>"));
}

#[test]
fn ratios_of_moved_to_needed_tell_cold_from_steady() {
    let row = |frame: u64, moved: u64, needed: u64, missing: u64| {
        json!({ "frame": frame, "pass": "primary", "bytes_bvh": moved >> 1, "bytes_geometry": moved >> 1,
                "bytes_attributes": 1u64 << 40, "bytes_needed": needed, "bytes_needed_missing": missing })
    };
    let mib = 1u64 << 20;
    let rows =
        [row(0, 50 * mib, 40 * mib, 40 * mib), row(1, 4 * mib, 40 * mib, 2 * mib), row(2, 2 * mib, 40 * mib, 2 * mib)];
    let html = report(walk(&rows, &summary(3), 0).path());
    assert!(html.contains("<td>50.0</td><td>40.0</td><td>40.0</td><td>1.25</td><td>1.25</td>"));
    assert!(html.contains("<td>6.00</td><td>80.0</td><td>4.00</td><td>0.075</td><td>1.50</td>"));
}

#[test]
fn an_interrupted_walk_without_frames_says_so() {
    let html = report(walk(&[], &summary(0), 0).path());
    assert!(html.contains("Interrupted after 0 of 30 frames"));
    assert!(html.contains("No frame was finished"));
    assert!(titles(&html).is_empty());
    assert!(!html.contains("every pixel is final"), "there is no pixel");
    assert!(html.contains("no material has a texture"), "settings and the rest stay");
}

#[test]
fn an_almost_empty_summary_and_record_suffice() {
    let html = report(walk(&[json!({ "frame": 3, "pass": "odd <pass>" })], &json!({}), 0).path());
    assert!(html.contains("odd &lt;pass&gt;") && html.contains("not recorded"));
    assert!(titles(&html).is_empty());
    assert!(
        html.contains(
            "Time per phase: not drawn, because phase 1, phase 2, phase 3, loading and total are not measured."
        )
    );

    let dir = walk(
        &[json!({ "frame": 0, "pass": "p", "ms": 2.0, "later_field": 7, "queries": null })],
        &json!({ "memory": null }),
        0,
    );
    fs::remove_dir(dir.path().join("frames")).unwrap();
    let html = report(dir.path());
    assert_eq!(titles(&html), ["Time per phase"]);
    assert!(html.contains("<code>later_field</code></th><td>7</td>"), "a field that is not known is shown");
    assert!(html.contains("Not known on this system."));
}

#[test]
fn unknown_passes_and_passes_of_some_frames_are_drawn() {
    let mut rows = records(4, &["primary", "glossy"]);
    rows.retain(|row| row["pass"] == "primary" || row["frame"] == 2);
    let html = report(walk(&rows, &summary(4), 4).path());
    assert!(html.contains("Pass: glossy"));
    assert_eq!(titles(&html).len(), 3 + 2 * 6);
}

#[test]
fn zero_series_are_left_out_with_a_sentence() {
    let mut rows = records(3, &["primary"]);
    for row in &mut rows {
        for field in [
            "bytes_textures",
            "round_trips",
            "bricks_needed",
            "bricks_hit",
            "bricks_loaded",
            "bricks_reloaded",
            "bricks_evicted",
        ] {
            row[field] = 0.into();
        }
    }
    let html = report(walk(&rows, &summary(3), 3).path());
    assert!(html.contains("Left out: textures is zero in every frame."));
    assert!(
        html.contains(
            "Bricks: not drawn, because needed, hit, loaded, loaded again and evicted are zero in every frame."
        )
    );
    assert!(html.contains("Round trips: not drawn, because primary is zero in every frame."));
    assert!(!titles(&html).contains(&"Bricks") && !titles(&html).contains(&"Round trips"));
    // Nothing is left out where nothing is zero.
    let html = report(walk(&records(3, &["primary"]), &summary(3), 3).path());
    assert!(!html.contains("Left out: ") && !html.contains("not drawn"));
}

#[test]
fn needs_that_were_not_measured_are_no_zeros() {
    let with_needs = |bytes: u64| {
        let mut rows = records(3, &["primary"]);
        for row in &mut rows {
            row["bytes_needed"] = bytes.into();
            row["bytes_needed_missing"] = 0.into();
        }
        report(walk(&rows, &summary(3), 3).path())
    };
    let html = with_needs(0);
    assert!(!titles(&html).contains(&"Bytes needed"));
    assert!(html.contains("Left out: missing is not measured."));
    assert!(html.contains("Bytes needed: not drawn, because needed and missing are not measured."));
    assert!(html.contains("Not measured: walk with --measure-needed."));
    // Where nothing was missing, that is a measurement.
    let html = with_needs(5);
    assert!(titles(&html).contains(&"Bytes needed"));
    assert!(html.contains("Left out: missing is zero in every frame."));
    assert!(!html.contains("ot measured"));
}

#[test]
fn pixels_that_cannot_be_trusted_are_on_top() {
    let mut rows = records(2, &["primary"]);
    rows[1]["unresolved_pixels"] = 12.into();
    rows[0]["non_finite"] = 3.into();
    let html = report(walk(&rows, &summary(2), 2).path());
    assert!(html.contains("12 pixels are not final") && html.contains("3 pixels were not finite"));
    assert!(!html.contains("every pixel is final"));
}

#[test]
fn pictures_of_another_walk_are_left_out() {
    let dir = walk(&records(2, &["primary"]), &summary(2), 4);
    fs::write(dir.path().join("frames/0001.png"), b"").unwrap();
    fs::write(dir.path().join("frames/0001.exr"), b"").unwrap();
    let html = report(dir.path());
    assert!(html.contains("not PNG files: 0001.png, 0002.png, 0003.png."));
    assert_eq!(html.matches("data:image/png").count(), 1);
}

#[test]
fn malformed_lines_are_named() {
    let good = record(0, "primary").to_string();
    let with = |field: &str, value: Value| {
        let mut record = record(1, "primary");
        record[field] = value;
        record.to_string()
    };
    let bad = [
        ("{\"frame\": 1, \"pass\"".to_string(), "EOF"),
        ("[]".to_string(), "must be a JSON object"),
        ("{\"frame\": 1}".to_string(), "no \"pass\""),
        ("{\"pass\": \"primary\"}".to_string(), "no \"frame\""),
        (with("frame", (-1).into()), "\"frame\" must be an integer"),
        (with("pass", 1.into()), "\"pass\" must be a string"),
        (with("queries", "many".into()), "\"queries\" must be a number"),
        (with("queries", (-5).into()), "\"queries\" must be a finite number from 0"),
    ];
    for (line, reason) in bad {
        let dir = walk(&[], &summary(1), 0);
        // The blank line counts but is no error.
        fs::write(dir.path().join("records.jsonl"), format!("{good}\n\n{line}\n{good}\n")).unwrap();
        let error = write(dir.path(), &[]).unwrap_err();
        assert!(matches!(error, ReportError::Record { line: 3, .. }), "{line}: {error:?}");
        let text = error.to_string();
        assert!(text.contains("records.jsonl: line 3: ") && text.contains(reason), "{text}");
        assert!(!dir.path().join("report.html").exists(), "no report of bad records");
    }
}

#[test]
fn a_bad_or_missing_file_is_named() {
    let dir = walk(&records(1, &["primary"]), &summary(1), 1);
    for (text, reason) in
        [("{\n\"format\": 2,\n}", "line 3: "), ("[]", "must be a JSON object"), ("{\"format\": 1}", "format 2, not 1")]
    {
        fs::write(dir.path().join("summary.json"), text).unwrap();
        let error = write(dir.path(), &[]).unwrap_err().to_string();
        assert!(error.contains("summary.json: line ") && error.contains(reason), "{error}");
    }
    fs::remove_file(dir.path().join("summary.json")).unwrap();
    assert!(write(dir.path(), &[]).unwrap_err().to_string().contains("summary.json: cannot read this file"));
    fs::write(dir.path().join("summary.json"), "{}").unwrap();
    fs::remove_file(dir.path().join("records.jsonl")).unwrap();
    assert!(write(dir.path(), &[]).unwrap_err().to_string().contains("records.jsonl: cannot read this file"));
}

#[test]
fn an_older_report_is_replaced_and_anyone_may_read_it() {
    let dir = walk(&records(1, &["primary"]), &summary(1), 1);
    fs::write(dir.path().join("report.html"), "old").unwrap();
    let html = report(dir.path());
    assert!(html.starts_with("<!DOCTYPE html>"));
    assert_eq!(html, report(dir.path()), "the same walk gives the same page");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = |name: &str| fs::metadata(dir.path().join(name)).unwrap().permissions().mode();
        assert_eq!(mode("report.html"), mode("records.jsonl"));
    }
}
