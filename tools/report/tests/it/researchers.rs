//! What researchers need of reports: schedules, what is off, data behind plots, CSV, errors over samples.

use super::report::{records, report, summary, walk};
use serde_json::{Value, json};
use std::fs;

/// The data behind the plot with this title, which begins its label.
fn data(html: &str, title: &str) -> Value {
    let figure = html.split("<figure class=\"plot\">").find(|part| part.contains(&format!("aria-label=\"{title}")));
    let figure = figure.unwrap_or_else(|| panic!("no plot {title}"));
    let text = figure.split("<script type=\"application/json\">").nth(1).unwrap().split("</script>").next().unwrap();
    serde_json::from_str(text).unwrap()
}

#[test]
fn switches_of_schedules_are_marked_and_explained() {
    let mut rows = records(8, &["primary", "shadow"]);
    for row in &mut rows {
        let frame = row["frame"].as_u64().unwrap();
        let is_try = row["pass"] == "primary" && frame == 5;
        row["schedule"] = if is_try { "demand" } else { "chc" }.into();
        row["ms"] = if is_try { 215.0 } else { 43.0 }.into();
    }
    let dir = walk(&rows, &summary(8), 8);
    let html = report(dir.path());
    assert_eq!(html.matches("auto changed the schedule: demand from frame 5, chc from frame 6.").count(), 1);
    assert_eq!(data(&html, "Time per phase, primary")["marks"], json!([[5.0, "demand"], [6.0, "chc"]]));
    assert_eq!(data(&html, "Time per phase, shadow")["marks"], json!([]));
    let row = "<td class=\"text\">demand</td><td>1</td><td>215</td><td>215</td>";
    assert!(html.contains(row), "the table of schedules says what the try cost");
    assert!(html.contains("<td class=\"text\">chc</td><td>7</td><td>43.0</td><td>43.0</td>"));
    // The same rows without the try have no mark, and without schedules there is no table.
    for row in &mut rows {
        row["schedule"] = "chc".into();
    }
    let html = report(walk(&rows, &summary(8), 8).path());
    assert!(!html.contains("changed the schedule") && html.contains("Schedules"));
    assert!(!report(walk(&records(2, &["primary"]), &summary(2), 2).path()).contains("Schedules"));
}

#[test]
fn plots_carry_their_values_and_the_script_stands_alone() {
    let dir = walk(&records(3, &["primary"]), &summary(3), 3);
    let html = report(dir.path());
    let queries = data(&html, "Queries, primary");
    let visible = queries["series"].as_array().unwrap().iter().find(|s| s["name"] == "visible").unwrap();
    let recorded =
        records(3, &["primary"]).iter().map(|row| row["queries_visible"].as_u64().unwrap()).collect::<Vec<_>>();
    for (point, value) in visible["points"].as_array().unwrap().iter().zip(&recorded) {
        assert_eq!(point[1].as_str().unwrap().replace(',', ""), value.to_string());
    }
    assert_eq!(html.matches("<script>").count(), 1);
    assert_eq!(html.matches("<script").count(), 1 + html.matches("role=\"img\"").count());
    // Whoever opens it without scripts has plots, tables and links.
    let still: String = html.split("<script").map(|part| part.split_once("</script>").map_or(part, |p| p.1)).collect();
    for text in ["<svg", "<details>", "href=\"records.csv\"", "Throughput, queries and bytes moved"] {
        assert!(still.contains(text), "{text}");
    }
}

#[test]
fn records_are_written_as_csv() {
    let mut rows = records(2, &["primary", "ao"]);
    rows[1]["schedule"] = "chc+demand".into();
    let dir = walk(&rows, &summary(2), 2);
    report(dir.path());
    let csv = fs::read_to_string(dir.path().join("records.csv")).unwrap();
    let lines: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!((lines.len(), &lines[0][..3]), (5, &["frame", "pass", "schedule"][..]));
    assert_eq!(lines[2][..3], ["0", "ao", "chc+demand"]);
    let column = lines[0].iter().position(|name| *name == "queries").unwrap();
    assert_eq!(lines[4][column], rows[3]["queries"].to_string());
    assert!(lines.iter().all(|line| line.len() == lines[0].len()));
}

#[test]
fn what_is_off_is_called_off() {
    let mut rows = records(2, &["primary"]);
    for row in &mut rows {
        row["multi_queries"] = 0.into();
    }
    let with = |fronts: bool| {
        let mut summary = summary(2);
        summary["options"] = json!({ "fronts": fronts });
        summary["settings"]["interactive_bytes"] = Value::Null;
        report(walk(&rows, &summary, 2).path())
    };
    let html = with(false);
    assert!(html.contains("Left out: multi-queries is off."), "the plot says so");
    assert!(html.contains("<code>multi_queries</code></th><td>off</td><td>off</td><td>off</td>"));
    assert!(html.contains("<code>interactive_bytes</code></th><td class=\"text\">off</td>"));
    // Where it is on, zero is a measurement.
    let html = with(true);
    assert!(html.contains("Left out: multi-queries is zero in every frame."));
    assert!(html.contains("<code>multi_queries</code></th><td>0</td><td>0</td><td>0</td>"));
}

#[test]
fn errors_are_plotted_over_samples_and_seconds() {
    let dir = walk(&records(2, &["primary"]), &summary(2), 2);
    let line = |frame: u32, samples: u32| {
        let error = 0.4 / f64::from(samples).sqrt();
        json!({
            "frame": frame, "samples": samples, "seconds": 0.25 * f64::from(samples), "rmse": error,
            "rel_mse": error * error, "bias": -0.001, "bias_rgb": [0.0, 0.0, 0.0], "flip": error / 2.0
        })
    };
    let lines: String =
        (0..2).flat_map(|frame| [1, 4, 16].map(|samples| format!("{}\n", line(frame, samples)))).collect();
    fs::write(dir.path().join("checkpoints.jsonl"), lines).unwrap();
    let html = report(dir.path());
    for (title, last) in [("Error over samples", 16.0), ("Error over seconds", 4.0)] {
        let data = data(&html, title);
        let rmse = &data["series"][0];
        assert_eq!((data["log"].as_bool(), rmse["name"].as_str()), (Some(true), Some("RMSE")), "{title}");
        assert_eq!(rmse["points"][2], json!([last, "0.100"]), "{title}");
        // The last series is noise alone, on which RMSE lies here.
        assert_eq!(data["series"][4]["points"], rmse["points"], "{title}");
    }
    let csv = fs::read_to_string(dir.path().join("checkpoints.csv")).unwrap();
    assert!(csv.starts_with("frame,samples,seconds,rmse,rel_mse,bias,flip\n0,1,0.25,0.4,"), "{csv}");
    assert_eq!(csv.lines().count(), 7);
    // A line that is none is named.
    fs::write(dir.path().join("checkpoints.jsonl"), "{}\n").unwrap();
    let error = brickwalk_report::write(dir.path(), &[]).unwrap_err().to_string();
    assert!(error.contains("checkpoints.jsonl: line 1: missing field"), "{error}");
    // Without the file there is no such section.
    fs::remove_file(dir.path().join("checkpoints.jsonl")).unwrap();
    assert!(!report(dir.path()).contains("Error over samples"));
}

#[test]
fn policies_of_a_replay_are_told_apart() {
    let row = |policy: &str, cache: u64, bytes: u64| {
        json!({
            "cache_bytes": cache, "cache_percent": cache, "recorded": false, "policy": policy, "loads": bytes / 100,
            "loaded_bytes": bytes, "hit_rate": 0.5
        })
    };
    let policies = ["round-robin", "second-chance", "lru", "belady-greedy"];
    let rows: Vec<Value> = [(10, [4000, 3500, 3000, 2000]), (50, [1000; 4])]
        .into_iter()
        .flat_map(|(cache, bytes)| policies.iter().zip(bytes).map(move |(policy, bytes)| row(policy, cache, bytes)))
        .collect();
    let dir = tempfile::tempdir().unwrap();
    let page = dir.path().join("replay.html");
    brickwalk_report::write_replay(&page, "trace", &json!({ "results": rows })).unwrap();
    let html = fs::read_to_string(page).unwrap();
    super::markup::check(&html).unwrap();
    let beyond = data(&html, "Loaded beyond the bound");
    let series = beyond["series"].as_array().unwrap();
    assert_eq!(series.len(), 3, "the bound itself is not drawn");
    assert_eq!(series[0]["points"], json!([[10.0, "100 %"], [50.0, "0 %"]]));
    assert_eq!(series[2]["points"], json!([[10.0, "50.0 %"], [50.0, "0 %"]]));
    // Curves that lie on each other differ in dash and colour.
    let legend = html.split("Bytes loaded").nth(1).unwrap().split("</ul>").next().unwrap();
    let keys: std::collections::BTreeSet<&str> = legend
        .split("<line ")
        .skip(1)
        .map(|key| key.split("stroke=").nth(1).unwrap().split('>').next().unwrap())
        .collect();
    assert_eq!((keys.len(), legend.matches("stroke-dasharray").count()), (4, 3));
    assert!(html.contains("download=\"replay.csv\"") && html.contains("href=\"data:text/csv;base64,"));
}
