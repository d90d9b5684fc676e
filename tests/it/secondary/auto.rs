//! `--secondary auto` and `calibrate`: what is taken follows from rates and measured errors, and pictures show it.

use crate::common::{brickwalk, city, folder, json, settings, succeed, walk};
use brickwalk::Session;
use brickwalk::cpu::device_info;
use brickwalk::metrics::{Image, PIXELS_PER_DEGREE, flip_ldr};
use brickwalk::session::auto::BLOCK;
use brickwalk::session::auto::rates::{MethodRate, RateFile, Rates, SceneRates, device_key, scene_key};
use brickwalk::session::open_scene;
use serde_json::Value;
use std::path::{Path, PathBuf};

const COMMON: &str = "--adapter cpu --size 64x36 --effects ao --ao-rays 4 --ao-length 60 --frames 64";
const MAPS: &str = "--secondary ao=roma --roma-size 64 --roma-k 4";
const NAME: &str = "roma, 64 cells";

/// Rates by which a ray of ao takes a microsecond, and `NAME` so much of that; it errs by at least `least` percent.
fn rates(share: f64, least: f64) -> Rates {
    let method = MethodRate {
        effect: "ao".into(),
        name: NAME.into(),
        making: 0.0,
        sample: 0.0,
        ray: share * 1e-6,
        percent: [least, 2.0 * least],
        flip_error: [0.0, 1.0],
    };
    Rates { exact: [("ao".to_owned(), 1e-6)].into(), methods: vec![method], ..Rates::default() }
}

/// A file with these rates for the scene.
fn rate_file(scene: &Path, rates: Rates) -> PathBuf {
    let (file, mut all) = (scene.with_extension("rates.json"), RateFile::default());
    let device = all.devices.entry(device_key(&device_info())).or_default();
    let checksum = open_scene(scene).expect("a scene").checksum();
    device.scenes.insert(scene_key(checksum), SceneRates { name: "scene".into(), rates });
    all.write(&file).expect("a file");
    file
}

/// The radiance of a frame.
fn frame(session: &mut Session, number: u32) -> Vec<[f32; 3]> {
    session.frame_watched(number, &mut ()).expect("a frame").expect("nobody stops it").pixels.radiance
}

fn open(scene: &Path, options: &str) -> Session {
    Session::open(scene, &settings(&format!("{COMMON} {options}"))).expect("a session")
}

fn auto(scene: &Path, rates: Rates, options: &str) -> Session {
    open(scene, &format!("--secondary auto --rates {} {options}", rate_file(scene, rates).display()))
}

#[test]
fn a_method_that_pays_and_errs_little_answers_all_frames_but_the_first() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "1K");
    let (mut exact, mut maps) = (open(&scene, ""), open(&scene, MAPS));
    let mut own = auto(&scene, rates(0.3, 1.0), "--error 1");
    for number in [0, 1, 2] {
        let (own, exact, maps) = (frame(&mut own, number), frame(&mut exact, number), frame(&mut maps, number));
        assert!(exact != maps, "frame {number}: maps must show");
        assert!(own == if number == 0 { exact } else { maps }, "frame {number}");
    }
    // The controls: what errs by more than is allowed, or would take longer, or errs by more wherever it was measured.
    for (rates, limit) in [(rates(0.3, 1.0), "0.0005"), (rates(0.95, 1.0), "1"), (rates(0.3, 7.0), "5%")] {
        let mut own = auto(&scene, rates, &format!("--error {limit}"));
        for number in [0, 1] {
            assert!(frame(&mut own, number) == frame(&mut exact, number), "--error {limit}, frame {number}");
        }
    }
}

#[test]
fn a_part_of_a_walk_shows_what_the_whole_walk_does() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "1K");
    let options = "--error 1";
    let mut whole = auto(&scene, rates(0.3, 1.0), options);
    let last = BLOCK + 2;
    let all: Vec<_> = (0..=last).map(|number| frame(&mut whole, number)).collect();
    let mut part = auto(&scene, rates(0.3, 1.0), &format!("{options} --cache 20% --schedule demand"));
    for number in [last, BLOCK, BLOCK + 1] {
        assert!(frame(&mut part, number) == all[number as usize], "frame {number}");
    }
    let mut maps = open(&scene, MAPS);
    assert!(frame(&mut maps, last) == all[last as usize], "the method is in force");
}

#[test]
fn errors_are_those_of_the_pictures() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "1K");
    let file = rate_file(&scene, rates(0.3, 1.0));
    let image = |options: &str| {
        let rgb = frame(&mut open(&scene, options), 0);
        Image { width: 64, height: 36, rgb }
    };
    let (exact, maps) = (image(""), image(MAPS));
    let flip = flip_ldr(&maps, &exact, PIXELS_PER_DEGREE).expect("images of a size").mean();
    let output = folder.path().join("out");
    let common = COMMON.replace("--frames 64", "--frames 32");
    walk(&scene, &output, &format!("{common} --secondary auto --error 0.5 --rates {}", file.display()));
    let summary = json(&output.join("summary.json"));
    let ao = &summary["secondary_auto"]["effects"]["ao"];
    let trial = &ao["trials"][0];
    let measured = trial["error"].as_f64().expect("an error");
    assert!((measured - flip).abs() < 1e-4 * flip.max(1e-3), "{measured} and {flip}");
    assert_eq!((&ao["takes"], &trial["method"]), (&Value::from(NAME), &Value::from(NAME)));
    assert_eq!((&ao["frames"]["exact"], &ao["frames"][NAME]), (&Value::from(1), &Value::from(31)));
    assert!(summary["secondary_auto"]["rates"]["hash"].as_str().is_some_and(|hash| hash.len() == 16));
    let records = crate::common::records(&output);
    let by = |frame: u64| {
        let own = records.iter().find(|record| record["frame"] == frame && record["pass"] == "ao");
        own.expect("a record")["methods"].as_str().expect("names").to_owned()
    };
    assert_eq!((by(0), by(1)), (String::new(), "roma".to_owned()));
}

#[test]
fn without_rates_all_is_traced_and_said_so() {
    let folder = folder();
    let scene = city(folder.path(), "20K", "1K");
    let mut own = open(&scene, "--secondary auto");
    let nothing = own.take_warnings().join("\n");
    let mut exact = open(&scene, "");
    assert!(frame(&mut own, 1) == frame(&mut exact, 1));
    assert!(nothing.contains("brickwalk calibrate"), "{nothing}");
    let [named, bad] = ["none.json", "bad.json"].map(|name| folder.path().join(name));
    std::fs::write(&bad, "{").expect("a file");
    for (file, says) in [(&named, "no such file"), (&bad, "not a file of rates")] {
        let options = format!("{COMMON} --secondary auto --rates {}", file.display());
        let error = Session::open(&scene, &settings(&options)).err().expect("an error");
        let error = format!("{error:#}");
        assert!(error.contains(says) && error.contains("calibrate"), "{error}");
    }
}

#[test]
fn calibration_measures_a_scene_and_keeps_others() {
    let folder = folder();
    let scene = city(folder.path(), "20K", "1K");
    let file = folder.path().join("rates.json");
    let name = file.display().to_string();
    let mut before = RateFile::default();
    before.devices.entry("another device".into()).or_default().any = Some(rates(0.5, 1.0));
    before.write(&file).expect("a file");
    let scene_name = scene.display().to_string();
    let said = succeed(["calibrate", &scene_name, "--rates", &name, "--size", "48x32", "--adapter", "cpu"]);
    assert!(said.contains("times exact") && said.contains("rates.json"), "{said}");
    let after = RateFile::read(&file).expect("rates").expect("a file");
    assert_eq!(after.devices["another device"], before.devices["another device"]);
    let (_, own) = after.devices.iter().find(|(name, _)| *name != "another device").expect("this device");
    let rates = &own.scenes.values().next().expect("the scene").rates;
    assert!(["ao", "shadow", "diffuse", "environment"].iter().all(|effect| rates.exact[*effect] > 0.0), "{rates:?}");
    assert!(rates.method("ao", NAME).is_some_and(|rate| rate.ray + rate.sample > 0.0), "{rates:?}");
    // A file that is none stays as it is.
    std::fs::write(&file, "{").expect("a file");
    let failed = brickwalk(["calibrate", &scene_name, "--rates", &name, "--size", "48x32", "--adapter", "cpu"]);
    assert_eq!(failed.status.code(), Some(1));
    assert_eq!(std::fs::read_to_string(&file).expect("a file"), "{");
}
