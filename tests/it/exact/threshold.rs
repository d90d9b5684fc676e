//! What `--query-threshold` costs, as `--measure-error` records it: nothing at 0; else what a comparison of the
//! pictures of two walks finds; and the walk itself is as without the measurement.

use crate::common::{folder, frames, polished_city, records, walk};
use serde_json::Value;
use std::path::Path;

/// Radiance and ids of a frame.
fn picture(output: &Path, frame: usize) -> (Vec<[f64; 3]>, Vec<u32>) {
    use exr::prelude::*;
    let image = read_all_flat_layers_from_file(output.join(format!("frames/{frame:04}.exr"))).expect("an EXR");
    let channel = |name: &str| {
        let list = &image.layer_data[0].channel_data.list;
        &list.iter().find(|channel| channel.name.to_string() == name).expect("a channel").sample_data
    };
    let f32s = |name: &str| match channel(name) {
        FlatSamples::F32(v) => v.clone(),
        _ => panic!("{name} is f32"),
    };
    let FlatSamples::U32(ids) = channel("triangle.id") else { panic!("ids are u32") };
    let [r, g, b] = ["R", "G", "B"].map(f32s);
    let pixels = r.iter().zip(&g).zip(&b).map(|((&r, &g), &b)| [r, g, b].map(f64::from)).collect();
    (pixels, ids.clone())
}

#[test]
fn the_error_of_a_threshold_is_that_of_the_pictures() {
    let folder = folder();
    let scene = polished_city(folder.path(), 60_000, 1000);
    let path = scene.with_extension("near.json");
    let view = format!("--frames 3 --size 96x64 --cache 20% --tile 32 --schedule chc --aov --path {}", path.display());
    let run = |name: &str, options: &str| {
        let output = folder.path().join(name);
        walk(&scene, &output, &format!("{view} {options}"));
        output
    };
    let exact = run("exact", "--effects primary");
    let rough = run("rough", "--effects primary --query-threshold 4000 --measure-error");
    let mut differ = 0;
    for (frame, record) in records(&rough).iter().enumerate() {
        let ((a, a_ids), (b, b_ids)) = (picture(&rough, frame), picture(&exact, frame));
        let errors: Vec<f64> =
            a.iter().zip(&b).map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).abs()).sum::<f64>() / 3.0).collect();
        let tile = |k: usize| k / 96 / 32 * 3 + k % 96 / 32;
        let tiles = (0..6).map(|t| {
            let of: Vec<f64> = errors.iter().enumerate().filter(|(k, _)| tile(*k) == t).map(|(_, e)| *e).collect();
            of.iter().sum::<f64>() / of.len() as f64
        });
        let expected = (errors.iter().sum::<f64>() / errors.len() as f64, tiles.fold(0.0, f64::max));
        let pixels = a_ids.iter().zip(&b_ids).filter(|(a, b)| a != b).count() as u64;
        let n = |field: &str| record[field].as_f64().expect("a number");
        // Sums of f64 in another order.
        assert!((n("error_mean") - expected.0).abs() <= 1e-9 * expected.0, "{record}: {expected:?}");
        assert!((n("error_worst_tile") - expected.1).abs() <= 1e-9 * expected.1, "{record}: {expected:?}");
        assert_eq!(record["error_pixels"], pixels, "{record}");
        differ += pixels;
    }
    assert!(differ > 0, "the threshold is too low to show");
    let summary: Value =
        serde_json::from_slice(&std::fs::read(rough.join("summary.json")).expect("a summary")).expect("JSON");
    let most = records(&rough).iter().map(|r| r["error_mean"].as_f64().expect("a number")).fold(0.0, f64::max);
    assert_eq!(summary["error"]["primary"]["mean_most"], most);
    assert!(summary["error"]["primary"]["worst_tile_most"].as_f64() >= Some(most) && most > 0.0);
    let report = std::fs::read_to_string(rough.join("report.html")).expect("a report");
    assert!(report.contains("worst tile") && report.contains("error_pixels"));

    // At 0 there is none, of any effect; and the measurement changes nothing else.
    let all = "--effects shadow,ao,diffuse,glossy --ao-rays 2 --diffuse-rays 2 --spp 2";
    let measured = run("measured", &format!("{all} --measure-error"));
    let plain = run("plain", all);
    assert!(frames(&measured) == frames(&plain));
    for (a, b) in records(&measured).iter().zip(&records(&plain)) {
        for (field, value) in a.as_object().expect("an object") {
            let is_time = field.starts_with("ms") || field == "mrays_per_s";
            assert!(is_time || *value == b[field], "{field}: {value} is not {}", b[field]);
        }
        assert_eq!(
            (&a["error_mean"], &a["error_worst_tile"], &a["error_pixels"]),
            (&0.0.into(), &0.0.into(), &0.into())
        );
    }
    // Control: with a threshold every effect shows some.
    let rough = run("rough-all", &format!("{all} --query-threshold 4000 --measure-error"));
    let errors: Vec<Value> = records(&rough).iter().map(|r| r["error_pixels"].clone()).collect();
    assert!(errors.iter().filter(|&n| *n != 0).count() > errors.len() / 2, "{errors:?}");
}
