//! The invariant that everything hangs on: pixels, ids and depths do not depend on schedule, cache size, eviction,
//! fronts, tile size, threads or run; ids and depths not on brick size.

use crate::common::{self, city, folder, frames, polished_city, records, walk};
use std::path::Path;

fn near(scene: &Path) -> String {
    // Software that stands in for a GPU takes long for pixels, and has the same tiles at the edge with fewer.
    let size = if std::env::var_os("BRICKWALK_ADAPTER").is_some() { "72x40" } else { "104x72" };
    format!("--frames 3 --size {size} --aov --path {}", scene.with_extension("near.json").display())
}

/// The least `--cache` in bytes, from the error that asks for it.
fn least_cache(scene: &Path, output: &Path) -> String {
    let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), output.as_os_str()];
    let refused = common::brickwalk(words.into_iter().chain(["--cache", "1K"].map(std::ffi::OsStr::new)));
    assert_eq!(refused.status.code(), Some(1), "a cache of 1K must be refused");
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    let needed = message.split("two largest bricks need ").nth(1).expect("the message names what is needed");
    needed.split_whitespace().next().expect("a number").to_string()
}

#[test]
fn frames_are_byte_identical_whatever_the_cache_and_schedule() {
    let folder = folder();
    let scene = city(folder.path(), "60K", "1K");
    let view = near(&scene);
    let run = |name: &str, options: &str| {
        let output = folder.path().join(name);
        walk(&scene, &output, &format!("{view} {options}"));
        frames(&output)
    };
    let truth = run("plain", "--schedule plain --cache 100%");
    assert_eq!(truth.len(), 6, "three frames, PNG and EXR");
    let least = least_cache(&scene, &folder.path().join("refused"));
    let variants = [
        "--schedule chc --cache 100%".to_string(),
        "--schedule chc --cache 20%".to_string(),
        "--schedule chc --cache 5% --tile 16".to_string(),
        format!("--schedule chc --cache {least}"),
        "--schedule chc --cache 20% --evict lru --workers 1".to_string(),
        "--schedule chc --cache 100% --fronts on".to_string(),
        "--schedule chc --cache 20% --fronts on --tile 16".to_string(),
        format!("--schedule chc --cache {least} --fronts on --host-cache 0"),
        "--schedule demand --cache 100%".to_string(),
        "--schedule demand --cache 5% --evict lru".to_string(),
        format!("--schedule demand --cache {least}"),
        "--schedule auto --cache 20%".to_string(),
        "--schedule auto --cache 100%".to_string(),
        "--schedule plain-bvh2 --cache 100%".to_string(),
    ];
    for (i, options) in variants.iter().enumerate() {
        assert!(run(&format!("variant{i}"), options) == truth, "{options}: frames differ from plain");
    }
    // Negative control: another seed moves the penumbrae, so the comparison can fail.
    let other = run("other", "--schedule chc --cache 20% --seed 1");
    assert!(other != truth, "a different seed must change some frame");
}

#[test]
fn effects_do_not_depend_on_the_cache() {
    let folder = folder();
    let scene = polished_city(folder.path(), 60_000, 1000);
    let effects = "--effects shadow,ao,diffuse,glossy --ao-rays 2 --ao-length 4 --diffuse-rays 2 \
                   --rect-light -2,6,-2,4,0,0,0,0,4 --rotation full";
    let view = near(&scene).replace("--frames 3", "--frames 2");
    let run = |name: &str, options: &str| {
        let output = folder.path().join(name);
        walk(&scene, &output, &format!("{view} {effects} {options}"));
        frames(&output)
    };
    let truth = run("plain", "--schedule plain --cache 100%");
    assert_eq!(truth.len(), 4, "two frames, PNG and EXR");
    let least = least_cache(&scene, &folder.path().join("refused"));
    let variants = [
        "--schedule chc --cache 20% --tile 16".to_string(),
        format!("--schedule chc --cache {least} --evict lru"),
        "--schedule chc --cache 20% --fronts on".to_string(),
        format!("--schedule demand --cache {least}"),
        "--schedule demand --cache 100%".to_string(),
        "--schedule auto --cache 20%".to_string(),
        "--schedule plain-bvh2 --cache 100%".to_string(),
    ];
    for (i, options) in variants.iter().enumerate() {
        assert!(run(&format!("variant{i}"), options) == truth, "{options}: frames differ from plain");
    }
    // Negative control: other directions give other pictures.
    assert!(run("other", "--cache 20% --seed 1") != truth, "a different seed must turn rays");
}

#[test]
fn light_of_the_sky_does_not_depend_on_the_cache() {
    let folder = folder();
    let scene = polished_city(folder.path(), 30_000, 1000);
    let options = "--effects shadow,diffuse,glossy,environment --environment sky --diffuse-rays 2 --rotation full";
    let view = near(&scene).replace("--frames 3", "--frames 2");
    let run = |name: &str, more: &str| {
        let output = folder.path().join(name);
        walk(&scene, &output, &format!("{view} {options} {more}"));
        frames(&output)
    };
    let truth = run("plain", "--schedule plain --cache 100%");
    for more in [
        "--schedule chc --cache 20% --tile 16",
        "--schedule chc --cache 20% --fronts on",
        "--schedule demand --cache 20%",
    ] {
        assert!(run("other", more) == truth, "{more}: frames differ from plain");
    }
    // Negative control: other random numbers give other pictures.
    assert!(run("other", "--cache 20% --seed 1") != truth, "a different seed must draw other directions");
}

#[test]
fn ten_runs_are_one() {
    let folder = folder();
    let scene = city(folder.path(), "30K", "1K");
    let options = format!("{} --cache 20% --frames 1", near(&scene).replace("--frames 3", ""));
    for (schedule, runs) in [("chc", 10), ("demand", 3)] {
        let mut first = None;
        for run in 0..runs {
            let output = folder.path().join(format!("run{run}"));
            walk(&scene, &output, &format!("{options} --schedule {schedule}"));
            let counters = counters(&output);
            let these = (frames(&output), counters);
            match &first {
                None => first = Some(these),
                Some(first) => assert!(*first == these, "{schedule}: run {run} differs from run 0"),
            }
        }
    }
}

/// The records without their times.
fn counters(output: &Path) -> Vec<serde_json::Value> {
    let mut all = records(output);
    for record in &mut all {
        let object = record.as_object_mut().expect("an object");
        object.retain(|key, _| !key.starts_with("ms") && key != "mrays_per_s");
    }
    all
}

#[test]
fn ids_and_depths_do_not_depend_on_brick_size() {
    let folder = folder();
    let mut truth = None;
    for brick_triangles in ["512", "4K"] {
        let scene = city(folder.path(), "40K", brick_triangles);
        let output = folder.path().join(brick_triangles);
        walk(&scene, &output, &near(&scene));
        let images: Vec<_> = (0..3).map(|k| channels(&output.join(format!("frames/{k:04}.exr")))).collect();
        match &truth {
            None => truth = Some(images),
            Some(truth) => assert!(*truth == images, "brick size changes an id or a depth"),
        }
    }
    // Negative control: another frame has other depths.
    let truth = truth.expect("two brick sizes");
    assert!(truth[0] != truth[2], "frames of a moving camera differ");
}

/// Bits of `triangle.id` and `depth.Z`.
fn channels(file: &Path) -> Vec<(String, Vec<u32>)> {
    use exr::prelude::*;
    let image = read_all_flat_layers_from_file(file).expect("an EXR");
    let mut out = Vec::new();
    for channel in &image.layer_data[0].channel_data.list {
        let bits = match &channel.sample_data {
            FlatSamples::F16(v) => v.iter().map(|x| u32::from(x.to_bits())).collect::<Vec<u32>>(),
            FlatSamples::F32(v) => v.iter().map(|x| x.to_bits()).collect::<Vec<u32>>(),
            FlatSamples::U32(v) => v.clone(),
        };
        let name = channel.name.to_string();
        if name == "triangle.id" || name == "depth.Z" {
            out.push((name, bits));
        }
    }
    assert_eq!(out.len(), 2, "{}: both channels", file.display());
    out
}
