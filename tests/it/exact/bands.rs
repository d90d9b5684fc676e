//! A picture that is rendered in bands is the picture that is rendered at once, byte by byte, and its records say as
//! much as those of one band do.

use crate::common::{self, adapters, city, folder, frames, polished_city, settings, walk};
use brickwalk::session::{Ray, Session};
use serde_json::Value;
use std::path::Path;

/// Five rows of tiles, the last half as high.
const VIEW: &str = "--frames 2 --size 104x72 --tile 16";

fn near(scene: &Path) -> String {
    format!("{VIEW} --path {}", scene.with_extension("near.json").display())
}

/// In how many bands the frames of a walk were rendered.
fn bands(output: &Path) -> u64 {
    let summary = std::fs::read(output.join("summary.json")).expect("a summary");
    let summary: Value = serde_json::from_slice(&summary).expect("JSON");
    summary["bands"].as_u64().expect("a number")
}

#[test]
fn frames_are_byte_identical_whatever_the_number_of_bands() {
    let folder = folder();
    let scene = polished_city(folder.path(), 30_000, 1000);
    let lit = "--effects shadow,ao,diffuse,glossy --ao-rays 1 --ao-length 4 --diffuse-rays 1 --spp 3 \
               --rect-light -2,6,-2,4,0,0,0,0,4 --rotation full";
    let sky = "--effects shadow,diffuse,glossy,environment --environment sky --diffuse-rays 1 --spp 2 --exposure auto";
    let variants = [
        format!("{lit} --aov --schedule chc --cache 20%"),
        format!("{sky} --denoise --taa --schedule auto --cache 20%"),
        format!("{lit} --aov --denoise --schedule plain --cache 100%"),
        format!("{sky} --aov --schedule demand --cache 20%"),
        "--effects ao --ao-rays 1 --ao-length 4 --aov --spp 70 --schedule chc --cache 5% --query-threshold 20"
            .to_string(),
    ];
    for name in adapters() {
        let adapter = name.split_whitespace().next().expect("a name");
        // All sizes of bands on the processor, some with rows below the picture; on software Vulkan a narrow picture of
        // the first two.
        let is_cpu = adapter == "cpu";
        let (counts, size): (&[u64], _) = if is_cpu { (&[2, 3, 5], "104x72") } else { (&[5], "24x72") };
        for options in &variants[..if is_cpu { variants.len() } else { 2 }] {
            let run = |name: &str, more: &str| {
                let output = folder.path().join(name);
                let view = near(&scene).replace("104x72", size);
                walk(&scene, &output, &format!("{view} {options} {more} --adapter {adapter}"));
                output
            };
            let whole = run("whole", "");
            assert_eq!(bands(&whole), 1);
            let truth = frames(&whole);
            assert_eq!(truth.len(), if options.contains("--aov") { 4 } else { 2 });
            for &count in counts {
                let output = run("bands", &format!("--bands {count}"));
                assert_eq!(bands(&output), count);
                assert!(frames(&output) == truth, "{adapter}, {options}: {count} bands differ from one");
            }
            // The control: other random numbers, such as those of a band by itself, show.
            assert!(frames(&run("other", "--bands 5 --seed 1")) != truth, "{adapter}, {options}: a seed must show");
        }
    }
}

#[test]
fn records_of_bands_add_up() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "512");
    let run = |count: u32, options: &str| -> Vec<Value> {
        let output = folder.path().join("out");
        walk(&scene, &output, &format!("{} --spp 2 --adapter cpu --bands {count} {options}", near(&scene)));
        let text = std::fs::read_to_string(output.join("records.jsonl")).expect("records");
        text.lines().map(|line| serde_json::from_str(line).expect("a record")).collect()
    };
    let number = |record: &Value, field: &str| record[field].as_u64().expect(field);
    for schedule in ["chc", "demand"] {
        let effects = "--effects shadow,ao,diffuse --ao-rays 1 --ao-length 4 --diffuse-rays 1";
        let options = format!("{effects} --schedule {schedule} --cache 100% --measure-needed");
        let whole = run(1, &options);
        assert_eq!(whole.len(), 2 * 5, "two frames of primary, shadow, ao, diffuse and its shadows");
        let mut more = 0;
        for count in [2, 5] {
            let banded = run(count, &options);
            assert_eq!(banded.len(), whole.len());
            for (one, many) in whole.iter().zip(&banded) {
                let name = format!("{schedule}, {count} bands: {one} and {many}");
                for field in ["frame", "pass", "rays", "rays_traced"] {
                    assert!(one[field] == many[field], "{field} of {name}");
                }
                // Any hit may be another where other bricks are there already.
                let is_closest = one["pass"] == "primary" || one["pass"] == "diffuse";
                for field in ["bricks_hit", "bricks_needed"].into_iter().filter(|_| is_closest) {
                    assert!(one[field] == many[field], "{field} of {name}");
                }
                assert_eq!(number(many, "rays"), number(many, "rays_traced") + number(many, "rays_answered"), "{name}");
                more += u64::from(number(many, "round_trips") > number(one, "round_trips"));
            }
            // What all effects load, from an empty cache that evicts nothing, is what there is in the end.
            let loaded: u64 = banded.iter().map(|record| number(record, "bricks_loaded")).sum();
            let most = banded.iter().map(|record| number(record, "bricks_resident_end")).max();
            assert_eq!((number(&banded[0], "bricks_resident_start"), most), (0, Some(loaded)), "{schedule}, {count}");
        }
        assert!(more > 0, "control: bands ask by themselves");
    }
    // A cache that evicts: what was there, loaded and evicted is what is there, of camera rays, which come alone.
    let alone = |count: u32| {
        let records = run(count, "--effects primary --schedule chc --cache 10%");
        for record in &records {
            let [start, loaded, evicted, end] =
                ["bricks_resident_start", "bricks_loaded", "bricks_evicted", "bricks_resident_end"]
                    .map(|field| number(record, field));
            assert!(evicted > 0 && start + loaded == evicted + end, "{record}");
        }
        records.len()
    };
    assert_eq!([1, 5].map(alone), [2, 2]);
}

#[test]
fn rays_are_traced_by_a_session_of_bands() {
    let folder = folder();
    let scene = city(folder.path(), "30K", "1K");
    let rays: Vec<Ray> = (0..4000)
        .map(|i| {
            let (x, z) = (f64::from(i % 80) - 40.0, f64::from(i / 80) - 25.0);
            Ray { origin: [x, 60.0, z], direction: [0.1, -1.0, 0.05], t_min: 0.0, t_max: f64::INFINITY }
        })
        .collect();
    let hits = |count: u32, rays: &[Ray]| {
        let options = settings(&format!("{} --adapter cpu --bands {count}", near(&scene)));
        let mut session = Session::open(&scene, &options).expect("a session");
        let camera = session.path().frame(0, 2);
        session.frame(&camera).expect("a frame");
        let hits = session.trace(rays, false).expect("hits");
        hits.iter().map(|hit| (hit.t.to_bits(), hit.triangle)).collect::<Vec<_>>()
    };
    // A band has 104 x 16 rays.
    let found = hits(5, &rays);
    assert!(found == hits(1, &rays) && found.iter().any(|hit| hit.1 != u32::MAX));
    assert!(found != hits(5, &rays.iter().rev().copied().collect::<Vec<_>>()), "the control: order matters");
}

#[test]
fn what_needs_the_whole_picture_is_refused_in_bands() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "4K");
    let out = folder.path().join("out");
    for options in ["--secondary roma --effects ao", "--fronts on", "--frame-budget 1M", "--measure-error"] {
        let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), out.as_os_str()];
        let given = format!("{VIEW} --adapter cpu --bands 4 {options}");
        let output = common::brickwalk(words.into_iter().chain(given.split(' ').map(AsRef::as_ref)));
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!((output.status.code(), text.lines().count()), (Some(2), 1), "{text}");
        let option = options.split(' ').next().expect("a word");
        assert!(text.contains(&format!("--bands 4: {option}")) && text.contains("leave one of them out"), "{text}");
        assert!(!out.exists());
    }
}
