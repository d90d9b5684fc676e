//! The processor renders what software Vulkan renders: ids and depths bit for bit, pictures but for the last level of a
//! few pixels, the same bricks loaded by the same queries; and it does so whatever the number of its threads, and where
//! there is no driver.

use crate::common::{
    brickwalk, city, folder, frames, polished, polished_city, records, shared_scenes, software, succeed, walk,
    walk_on_threads,
};
use exr::prelude::{FlatSamples, read_all_flat_layers_from_file};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

const VIEW: &str = "--frames 2 --size 104x72 --aov";
const EFFECTS: &str = "--effects shadow,ao,diffuse,glossy --ao-rays 2 --ao-length 4 --diffuse-rays 2 --rotation full";

/// Bits of the channels of an EXR by name.
fn channels(file: &Path) -> BTreeMap<String, Vec<u32>> {
    let image = read_all_flat_layers_from_file(file).expect("an EXR");
    let bits = |samples: &FlatSamples| match samples {
        FlatSamples::F16(v) => v.iter().map(|x| u32::from(x.to_bits())).collect(),
        FlatSamples::F32(v) => v.iter().map(|x| x.to_bits()).collect(),
        FlatSamples::U32(v) => v.clone(),
    };
    image.layer_data[0].channel_data.list.iter().map(|c| (c.name.to_string(), bits(&c.sample_data))).collect()
}

/// Pixels of two PNGs that differ by more than one level of any channel, and all pixels.
fn differing(a: &Path, b: &Path) -> (usize, usize) {
    let [a, b] = [a, b].map(|file| image::open(file).expect("a PNG").to_rgb8());
    assert_eq!(a.dimensions(), b.dimensions());
    let differs = |(a, b): (&image::Rgb<u8>, &image::Rgb<u8>)| a.0.iter().zip(b.0).any(|(a, b)| a.abs_diff(b) > 1);
    (a.pixels().zip(b.pixels()).filter(|&pixels| differs(pixels)).count(), a.pixels().count())
}

/// The records without times, and without what says how lists have grown on a device.
fn counters(mut records: Vec<Value>) -> Vec<Value> {
    for record in &mut records {
        let object = record.as_object_mut().expect("an object");
        object.retain(|key, _| !key.starts_with("ms") && key != "mrays_per_s" && key != "round_trips");
    }
    records
}

/// Compares two walks; `what` names them.
fn compare(what: &str, cpu: &Path, vulkan: &Path) {
    let files = frames(vulkan);
    assert_eq!(files.len(), 4, "{what}: two frames, PNG and EXR");
    let mut hits = 0;
    for (name, _) in files {
        let [a, b] = [cpu, vulkan].map(|output| output.join("frames").join(&name));
        if name.ends_with(".png") {
            let (count, all) = differing(&a, &b);
            println!("{what}, {name}: {count} of {all} pixels differ");
            // Of rays that graze an edge some may turn out otherwise, their directions being off by some ulps.
            assert!(count * 500 <= all, "{what}, {name}: {count} of {all} pixels differ");
            continue;
        }
        let [a, b] = [channels(&a), channels(&b)];
        for channel in ["triangle.id", "depth.Z", "normal.X", "normal.Y", "normal.Z"] {
            assert!(a[channel] == b[channel], "{what}, {name}: {channel} differs");
        }
        hits += a["triangle.id"].iter().filter(|&&id| id != u32::MAX).count();
    }
    assert!(hits >= 15, "{what}: only {hits} hits; the view shows nothing");
    let primary = |output: &Path| -> Vec<Value> {
        counters(records(output)).into_iter().filter(|record| record["pass"] == "primary").collect()
    };
    assert_eq!(primary(cpu), primary(vulkan), "{what}: records of camera rays");
}

/// Walks `scene` on both and compares.
fn check(folder: &Path, software: &str, name: &str, scene: &Path, options: &str) {
    let outputs = ["cpu", software].map(|adapter| {
        let output = folder.join(format!("{name}-{}", if adapter == "cpu" { "cpu" } else { "vulkan" }));
        let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), output.as_os_str(), "--adapter".as_ref()];
        let options = format!("--quality exact {VIEW} {options}");
        let options: Vec<&str> = options.split_whitespace().collect();
        succeed(words.into_iter().chain([adapter.as_ref()]).chain(options.iter().map(std::ffi::OsStr::new)));
        output
    });
    compare(&format!("{name} {options}"), &outputs[0], &outputs[1]);
}

fn generated(folder: &Path, kind: &str) -> PathBuf {
    let scene = folder.join(format!("{kind}.bricks"));
    let words = ["scene", kind, "--triangles", "60K", "--brick-triangles", "1K", "-o"];
    succeed(words.iter().map(std::ffi::OsStr::new).chain([scene.as_os_str()]));
    scene
}

#[test]
fn generated_scenes_look_the_same() {
    let Some(software) = software() else { return };
    let folder = folder();
    let city = polished_city(folder.path(), 40_000, 1000);
    let near = format!("--path {}", city.with_extension("near.json").display());
    let lamp = "--rect-light -2,6,-2,4,0,0,0,0,4";
    let of_city = [
        format!("{near} {EFFECTS} {lamp} --schedule plain --cache 100%"),
        format!("{near} {EFFECTS} {lamp} --schedule chc --cache 20% --tile 16"),
        format!("{near} {EFFECTS} --schedule demand --cache 10% --evict lru"),
        format!("{near} --schedule chc --cache 20% --fronts on --tile 16 --measure-needed"),
        format!("{near} --schedule chc --cache 20% --query-threshold 20 --tile 16"),
        format!(
            "{near} --effects shadow,diffuse --diffuse-rays 2 --rotation full --secondary diffuse=roma,shadow=roma \
             --schedule chc --cache 20%"
        ),
        format!("{near} --schedule plain-bvh2 --cache 100% --spp 2"),
    ];
    for options in &of_city {
        check(folder.path(), &software, "city", &city, options);
    }
    let pipes = generated(folder.path(), "pipes");
    let near = format!("--path {}", pipes.with_extension("near.json").display());
    check(folder.path(), &software, "pipes", &pipes, &format!("{near} {EFFECTS} --schedule chc --cache 30%"));
    let terrain = generated(folder.path(), "terrain");
    let far = format!("--path {}", terrain.with_extension("far.json").display());
    check(folder.path(), &software, "terrain", &terrain, &format!("{far} {EFFECTS} --schedule demand --cache 50%"));
}

#[test]
fn soups_and_instances_look_the_same() {
    use brickwalk_convert::build::{BuildSettings, build};
    use brickwalk_convert::progress::Progress;
    use brickwalk_scenes::{SoupKind, rotated_instances, soup};
    let Some(software) = software() else { return };
    let sources = [
        ("uniform", soup(SoupKind::Uniform, 3000, 11)),
        ("clustered", soup(SoupKind::Clustered, 3000, 11)),
        ("slivers", soup(SoupKind::Slivers, 20_000, 11)),
        ("instances", rotated_instances(5)),
    ];
    for (name, source) in sources {
        let folder = folder();
        let scene = folder.path().join("scene.bricks");
        let settings = BuildSettings { brick_triangles: 256, ..BuildSettings::default() };
        build(polished(source), &settings, &scene, &Progress::hidden()).expect("a scene");
        let options = format!("{EFFECTS} --schedule chc --cache 35% --tile 16");
        check(folder.path(), &software, name, &scene, &options);
    }
}

#[test]
fn sponza_looks_the_same() {
    let (Some(software), Some(scenes)) = (software(), shared_scenes()) else { return };
    let folder = folder();
    let scene = folder.path().join("sponza.bricks");
    let input = scenes.join("sponza/Sponza.gltf");
    let words = ["convert".as_ref(), input.as_os_str(), "-o".as_ref(), scene.as_os_str()];
    succeed(words.into_iter().chain(["--brick-triangles", "4K"].map(std::ffi::OsStr::new)));
    for (schedule, cache) in [("plain", "100%"), ("chc", "40%"), ("chc", "15%"), ("demand", "25%")] {
        check(folder.path(), &software, "sponza", &scene, &format!("{EFFECTS} --schedule {schedule} --cache {cache}"));
    }
}

/// Negative control: a view that differs a little is noticed.
#[test]
#[should_panic(expected = "differs")]
fn another_view_is_noticed() {
    let folder = folder();
    let scene = city(folder.path(), "20K", "1K");
    let outputs = ["60", "60.01"].map(|fov| {
        let output = folder.path().join(fov);
        let path = scene.with_extension("near.json");
        walk(&scene, &output, &format!("{VIEW} --adapter cpu --fov {fov} --path {}", path.display()));
        output
    });
    compare("views", &outputs[0], &outputs[1]);
}

#[test]
fn the_number_of_threads_does_not_show() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "1K");
    let run = |threads: &str, options: &str| {
        let output = folder.path().join(format!("threads-{threads}"));
        let path = scene.with_extension("near.json");
        let options = format!("{VIEW} {EFFECTS} {options} --adapter cpu --path {}", path.display());
        let records = walk_on_threads(&scene, &output, &options, threads);
        (frames(&output), counters(records))
    };
    for options in ["--schedule chc --cache 20%", "--schedule demand --cache 10%"] {
        let one = run("1", options);
        for threads in ["2", "5"] {
            assert!(run(threads, options) == one, "{threads} threads: {options}");
        }
        // Control: the comparison can fail.
        assert!(run("2", &format!("{options} --seed 1")).0 != one.0);
    }
}

#[test]
fn no_driver_is_needed() {
    let folder = folder();
    let scene = city(folder.path(), "20K", "1K");
    let command = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_brickwalk"));
        command.env_remove("BRICKWALK_ADAPTER").args(words);
        command
    };
    let without_driver = |words: &[&str]| {
        let mut command = command(words);
        // The loader finds no driver in a folder that does not exist.
        for variable in ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"] {
            command.env(variable, folder.path().join("none.json"));
        }
        command.output().expect("the command starts")
    };
    let listed = without_driver(&["adapters", "--json"]);
    assert!(listed.status.success());
    let listed: Value = serde_json::from_slice(&listed.stdout).expect("JSON");
    let adapters = listed["adapters"].as_array().expect("a list");
    // OpenGL, where it is there, is listed and never chosen.
    let [rest @ .., last] = &adapters[..] else { panic!("{listed}") };
    assert_eq!((&last["name"], &last["chosen"]), (&"cpu".into(), &true.into()), "{listed}");
    assert!(rest.iter().all(|one| one["backend"] == "gl" && one["chosen"] == false), "{listed}");
    let output = folder.path().join("out");
    let [scene, out] = [&scene, &output].map(|path| path.to_str().expect("test paths are UTF-8"));
    let walked = without_driver(&["walk", scene, "-o", out, "--frames", "1", "--size", "32x24"]);
    assert!(walked.status.success(), "{}", String::from_utf8_lossy(&walked.stderr));
    let summary: Value =
        serde_json::from_slice(&std::fs::read(output.join("summary.json")).expect("a summary")).expect("JSON");
    assert_eq!(summary["adapter"]["name"], "cpu");
    // A name is taken at its word.
    let refused = without_driver(&["walk", scene, "-o", out, "--adapter", "llvmpipe"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("llvmpipe"));
    assert_eq!(brickwalk(["walk", scene, "-o", out, "--adapter", "no such thing"]).status.code(), Some(1));
    // Where the loader, too, is no library that can be loaded.
    let libraries = folder.path().join("libraries");
    std::fs::create_dir(&libraries).expect("a folder");
    for name in ["libvulkan.so.1", "libvulkan.so"] {
        std::fs::write(libraries.join(name), "").expect("a file");
    }
    let output = folder.path().join("demo");
    let out = output.to_str().expect("test paths are UTF-8");
    let demo = ["demo", "-o", out, "--triangles", "20K", "--cache", "1M", "--frames", "1", "--size", "32x24"];
    let demo = command(&demo).env("LD_LIBRARY_PATH", &libraries).output().expect("the command starts");
    assert!(demo.status.success(), "{}", String::from_utf8_lossy(&demo.stderr));
    assert!(output.join("report.html").is_file());
}
