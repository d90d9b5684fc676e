//! What a walk makes of radiance: exposure, tone maps, a video, sums of many samples.

use crate::common::{self, brickwalk, city, folder, frames, succeed, walk};
use brickwalk::metrics::{Channel, load};
use std::path::Path;

/// A Y4M file, read here: its header's words, and its frames as planes Y', Cb, Cr.
struct Movie {
    header: Vec<String>,
    frames: Vec<[Vec<u8>; 3]>,
}

impl Movie {
    fn read(path: &Path, (width, height): (usize, usize)) -> Movie {
        let bytes = std::fs::read(path).expect("a video");
        let end = bytes.iter().position(|&b| b == b'\n').expect("a header");
        let header = String::from_utf8(bytes[..end].to_vec()).expect("text").split(' ').map(String::from).collect();
        let frame = 6 + 3 * width * height;
        let rest = &bytes[end + 1..];
        assert_eq!(rest.len() % frame, 0, "whole frames");
        let planes = |frame: &[u8]| {
            assert_eq!(&frame[..6], b"FRAME\n");
            [0, 1, 2].map(|k| frame[6 + k * width * height..][..width * height].to_vec())
        };
        Movie { header, frames: rest.chunks(frame).map(planes).collect() }
    }

    /// Greatest difference of a frame from a picture, of 255, after the inverse of BT.709's matrix in limited range.
    fn difference(&self, frame: usize, png: &Path) -> f64 {
        let picture = image::open(png).expect("a PNG").into_rgb8();
        let [luma, blue, red] = &self.frames[frame];
        let mut worst = 0.0f64;
        for (i, pixel) in picture.pixels().enumerate() {
            let y = (f64::from(luma[i]) - 16.0) * 255.0 / 219.0;
            let [cb, cr] = [blue[i], red[i]].map(|c| (f64::from(c) - 128.0) * 255.0 / 224.0);
            let (r, b) = (y + 1.5748 * cr, y + 1.8556 * cb);
            let g = (y - 0.2126 * r - 0.0722 * b) / 0.7152;
            for (found, expected) in [r, g, b].into_iter().zip(pixel.0) {
                worst = worst.max((found - f64::from(expected)).abs());
            }
        }
        worst
    }
}

#[test]
fn a_video_holds_the_frames() {
    let folder = folder();
    let scene = city(folder.path(), "30K", "1K");
    // Odd both ways.
    let size = (63, 35);
    let (out, video) = (folder.path().join("out"), folder.path().join("city.y4m"));
    let path = scene.with_extension("near.json");
    let options = format!("--frames 3 --size {}x{} --path {}", size.0, size.1, path.display());
    let printed = walk(&scene, &out, &format!("{options} --video {} --video-fps 12", video.display()));
    let movie = Movie::read(&video, size);
    assert_eq!(movie.header, ["YUV4MPEG2", "W63", "H35", "F12:1", "Ip", "A1:1", "C444", "XCOLORRANGE=LIMITED"]);
    assert_eq!(movie.frames.len(), 3);
    // Each of the three is rounded by a half of its step: 0.5 · 255 · (1/219 + 1.8556/224) of blue, which is the worst.
    let bound = 0.5 * 255.0 * (1.0 / 219.0 + 1.8556 / 224.0) + 1e-3;
    for frame in 0..3 {
        let png = |k: usize| out.join(format!("frames/{k:04}.png"));
        let found = movie.difference(frame, &png(frame));
        assert!(found <= bound, "frame {frame} is off by {found}");
        // The control: another frame.
        assert!(movie.difference(frame, &png((frame + 1) % 3)) > 10.0 * bound);
    }
    // Where frames and report are comes first.
    assert!(printed.contains("frames: 3 frames\n") && printed.contains("report.html: report\n"), "{printed}");
    let commands: Vec<&str> = printed.lines().skip(2).collect();
    assert_eq!(commands.len(), 2, "{printed}");
    assert!(commands[0].starts_with("ffmpeg -i ") && commands[0].contains("city.y4m"), "{printed}");
    assert!(commands[1].starts_with("ffmpeg -framerate 12 -i ") && commands[1].contains("%04d.png"), "{printed}");
    let summary = summary(&out);
    assert_eq!(summary["pictures"]["video"]["ffmpeg"][0], commands[0]);
    assert_eq!(summary["pictures"]["exposure_ev"], serde_json::json!([0.0, 0.0, 0.0]));
    // Records on standard output stay alone there; nothing half-written is left beside the video.
    let printed = walk(&scene, &out, &format!("{options} --json --video {}", video.display()));
    assert!(printed.lines().all(|line| line.starts_with('{')), "{printed}");
    let left = std::fs::read_dir(folder.path()).expect("a folder").flatten();
    assert!(left.into_iter().all(|entry| !entry.file_name().to_string_lossy().ends_with(".tmp")));
    // A video that cannot be written is told before anything is rendered.
    let taken = folder.path().join("taken.y4m");
    std::fs::create_dir(&taken).expect("a folder");
    let words =
        ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), out.as_os_str(), "--video".as_ref(), taken.as_os_str()];
    let refused = brickwalk(words);
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!((refused.status.code(), message.lines().count()), (Some(1), 1), "{message}");
}

#[cfg(unix)]
#[test]
fn an_interrupted_walk_leaves_a_video_of_what_it_finished() {
    use crate::common::wait_for;
    use std::process::{Command, Stdio};
    let folder = folder();
    let scene = city(folder.path(), "30K", "1K");
    let (out, video) = (folder.path().join("out"), folder.path().join("a.y4m"));
    let mut child = Command::new(env!("CARGO_BIN_EXE_brickwalk"))
        .args([
            "walk".as_ref(),
            scene.as_os_str(),
            "-o".as_ref(),
            out.as_os_str(),
            "--video".as_ref(),
            video.as_os_str(),
        ])
        .args("--quality exact --frames 100000 --size 64x36 --spp 65 --adapter cpu".split(' '))
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command starts");
    wait_for(&out.join("frames/0001.png"));
    assert!(!video.exists(), "it has its name only when it is whole");
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill");
    assert!(killed.success());
    let status = child.wait().expect("a child");
    assert_eq!(status.code(), Some(1));
    let finished = summary(&out)["frames"].as_u64().expect("a count") as usize;
    let movie = Movie::read(&video, (64, 36));
    assert_eq!((movie.frames.len(), frames(&out).len()), (finished, finished));
    assert!(movie.difference(finished - 1, &out.join(format!("frames/{:04}.png", finished - 1))) < 2.0);
}

fn summary(out: &Path) -> serde_json::Value {
    serde_json::from_slice(&std::fs::read(out.join("summary.json")).expect("a summary")).expect("JSON")
}

/// Mean of the sRGB bytes of a PNG.
fn brightness(png: &Path) -> f64 {
    let picture = image::open(png).expect("a PNG").into_rgb8();
    picture.as_raw().iter().map(|&x| f64::from(x)).sum::<f64>() / picture.as_raw().len() as f64
}

fn red(exr: &Path) -> Vec<f32> {
    match load(exr).expect("an EXR").channels.remove("R") {
        Some(Channel::Float(values)) => values,
        other => panic!("{other:?}"),
    }
}

#[test]
fn exposure_and_tone_maps_change_pictures_and_not_radiance() {
    let folder = folder();
    let scene = city(folder.path(), "30K", "1K");
    let path = scene.with_extension("near.json");
    let run = |name: &str, options: &str| {
        let out = folder.path().join(name);
        walk(&scene, &out, &format!("--frames 2 --size 64x36 --aov --path {} {options}", path.display()));
        (frames(&out), summary(&out)["pictures"].clone(), brightness(&out.join("frames/0001.png")))
    };
    let of = |files: &[(String, Vec<u8>)], kind: &str| -> Vec<(String, Vec<u8>)> {
        files.iter().filter(|(name, _)| name.ends_with(kind)).cloned().collect()
    };
    let (plain, pictures, plain_mean) = run("plain", "");
    assert_eq!((&pictures["exposure"], &pictures["tone_map"]), (&0.0.into(), &"none".into()));
    assert!(run("zero", "--exposure -0 --tone-map none").0 == plain, "the defaults, said aloud");
    let (_, _, bright) = run("bright", "--exposure 1.5");
    let (_, _, dark) = run("dark", "--exposure -1.5");
    assert!(dark < plain_mean && plain_mean < bright, "{dark} {plain_mean} {bright}");
    for (map, white) in [("agx", 3.0), ("aces", 1.5), ("reinhard", 1.0)] {
        let (files, pictures, _) = run(map, &format!("--tone-map {map} --exposure auto"));
        assert!(of(&files, "exr") == of(&plain, "exr"), "{map}: radiance stays");
        assert!(of(&files, "png") != of(&plain, "png"), "{map}: pictures do not");
        assert_eq!((&pictures["exposure"], &pictures["tone_map"]), (&"auto".into(), &map.into()));
        let stops: Vec<f64> =
            pictures["exposure_ev"].as_array().expect("a list").iter().map(|x| x.as_f64().expect("stops")).collect();
        // The first frame's, computed here of what it hits: the log-average luminance of the middle nine tenths,
        // floored, to half a stop above middle grey, or less for 98 % to stay below white.
        let mut channels = load(folder.path().join(map).join("frames/0000.exr")).expect("an EXR").channels;
        let [r, g, b, depth] = ["R", "G", "B", "depth.Z"].map(|name| match channels.remove(name) {
            Some(Channel::Float(values)) => values,
            other => panic!("{other:?}"),
        });
        let hit: Vec<usize> = (0..depth.len()).filter(|&i| depth[i].is_finite()).collect();
        assert!(hit.len() > 500 && hit.len() < depth.len(), "surfaces and sky");
        let sorted = |value: &dyn Fn(usize) -> f64| {
            let mut values: Vec<f64> = hit.iter().map(|&i| value(i)).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let luminance = sorted(&|i| 0.2126 * f64::from(r[i]) + 0.7152 * f64::from(g[i]) + 0.0722 * f64::from(b[i]));
        let trimmed = hit.len() / 20;
        let middle = &luminance[trimmed..hit.len() - trimmed];
        let floor = middle.iter().sum::<f64>() / middle.len() as f64 / 256.0;
        let average = middle.iter().map(|y| y.max(floor).ln()).sum::<f64>() / middle.len() as f64;
        let brightest = sorted(&|i| f64::from(r[i].max(g[i]).max(b[i])));
        let most = (white / brightest[((hit.len() - 1) as f64 * 0.98) as usize]).log2();
        let expected = ((0.18 / average.exp()).log2() + 0.5).min(most);
        assert!((stops[0] - expected).abs() < 1e-4, "{map}: {stops:?}, not {expected}");
        assert_eq!(stops.len(), 2);
    }
}

const BOX: &str = "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n";
const SIDES: &str = "f 1 2 3 4\nf 5 8 7 6\nf 1 5 6 2\nf 4 3 7 8\nf 1 4 8 5\nf 2 6 7 3\n";

#[test]
fn many_samples_are_summed_in_batches() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("box.mtl"), "newmtl glow\nKd 0.5 0.5 0.5\nKe 0.1 0.1 0.1\n").expect("materials");
    std::fs::write(at("box.obj"), format!("mtllib box.mtl\n{BOX}usemtl glow\n{SIDES}")).expect("a box");
    let (input, scene) = (at("box.obj"), at("box.bricks"));
    succeed(["convert".as_ref(), input.as_os_str(), "-o".as_ref(), scene.as_os_str()]);
    let inside = at("inside.json");
    let text =
        r#"{"fov_y_degrees": 90, "keyframes": [{"time": 0, "position": [0.1,0.2,0.3], "target": [0.7,-0.1,1]}]}"#;
    std::fs::write(&inside, text).expect("a camera path");
    let render = |name: &str, options: &str| {
        let out = at(name);
        let dark = "--sun-intensity 0 --sky-intensity 0 --cache 100% --aov --frames 1 --size 9x7";
        walk(&scene, &out, &format!("{dark} --path {} {options}", inside.display()));
        red(&out.join("frames/0000.exr"))
    };
    // Emission and the reflected half of it, whatever the number of samples: one batch, a whole number of them, and a
    // part of one.
    for samples in [64, 65, 128, 130] {
        let seen = render("many", &format!("--effects diffuse --diffuse-rays 2 --spp {samples}"));
        assert!(seen.iter().all(|x| (x - 0.15).abs() < 1e-6), "{samples}: {seen:?}");
    }
    // The control: a mean over the samples of the last batch alone, with the count of all, would be 2/130 of it.
    assert!(render("one", "--effects primary --spp 130").iter().all(|x| (x - 0.1).abs() < 1e-6));
}

#[test]
fn effects_are_compared_over_all_batches() {
    let folder = folder();
    let scene = city(folder.path(), "30K", "256");
    let path = scene.with_extension("far.json");
    let error = |samples: u32| {
        let out = folder.path().join(samples.to_string());
        let options = "--frames 1 --size 48x32 --effects shadow --query-threshold 4000 --measure-error --cache 30%";
        walk(&scene, &out, &format!("{options} --spp {samples} --path {}", path.display()));
        ["primary", "shadow"].map(|effect| summary(&out)["error"][effect]["mean"].as_f64().expect("an error"))
    };
    let (one, two) = (error(64), error(128));
    println!("{one:?} {two:?}");
    for (one, two) in one.into_iter().zip(two) {
        // The second batch has other points of the pixels, of as even a distribution.
        assert!(one > 1e-3 && (two / one - 1.0).abs() < 0.1, "{one} of one batch, {two} of two");
    }
}

#[test]
fn a_frame_of_many_samples_is_shown_while_it_is_made() {
    let folder = common::folder();
    let scene = common::city(folder.path(), "10K", "1K");
    let output = folder.path().join("out");
    let options = "--quality exact --frames 1 --size 64x48 --cache 100% --spp 100K --progressive";
    let words = ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), output.as_os_str()];
    let words = words.into_iter().chain(options.split(' ').map(std::ffi::OsStr::new));
    let mut command =
        std::process::Command::new(env!("CARGO_BIN_EXE_brickwalk")).args(words).spawn().expect("it starts");
    let preview = output.join("preview.png");
    let mut seen = Vec::new();
    for _ in 0..600 {
        std::thread::sleep(std::time::Duration::from_millis(100));
        match std::fs::read(&preview) {
            Ok(bytes) if seen.last() != Some(&bytes) => seen.push(bytes),
            _ => {}
        }
        if seen.len() == 2 || command.try_wait().expect("a child").is_some() {
            break;
        }
    }
    command.kill().expect("it still runs");
    command.wait().expect("a child");
    assert_eq!(seen.len(), 2, "pictures that differ");
    for bytes in seen {
        let picture = image::load_from_memory(&bytes).expect("a whole PNG");
        assert_eq!((picture.width(), picture.height()), (64, 48));
    }
    walk(&scene, &output, "--frames 1 --size 64x48 --cache 100% --spp 130 --progressive");
    assert!(!preview.exists() && output.join("frames/0000.png").exists());
}

#[test]
fn what_leaving_out_saves_is_measured_where_it_is_asked_for() {
    let folder = common::folder();
    let scene = common::city(folder.path(), "10K", "1K");
    let summed = |options: &str| -> serde_json::Value {
        let output = folder.path().join("out");
        common::walk(&scene, &output, &format!("--frames 1 --size 48x32 --cache 100% --adapter cpu {options}"));
        let text = std::fs::read_to_string(output.join("summary.json")).expect("a summary");
        serde_json::from_str(&text).expect("JSON")
    };
    let listed = |summary: &serde_json::Value, list: &str| summary[list].as_array().expect("a list").clone();
    let summary = summed("--measure-left-out --effects shadow,ao,diffuse");
    let measured = listed(&summary, "left_out");
    let entry = |what: &str| measured.iter().find(|one| one["what"] == what).expect("an entry").clone();
    for what in ["queries for missing bricks", "texture lookups"] {
        let one = entry(what);
        let ms = |field: &str| one[field].as_f64().expect("a time");
        assert!(ms("ms_frame") > 0.0 && ms("ms_frame_kept") > 0.0 && one["repetitions"] == 5, "{one}");
        assert!((ms("ms_frame_kept") - ms("ms_frame") - ms("ms_saved")).abs() < 1e-9, "{one}");
        assert_eq!(one["same_picture"], true, "{one}");
    }
    for what in ["instance transforms", "alpha tests in traversal"] {
        assert!(entry(what).get("ms_saved").is_none(), "the processor's kernels decide on {what} as they run");
    }
    let together = &summary["left_out_together"];
    assert!(together["ms_frame_kept"].as_f64().is_some_and(|ms| ms > 0.0) && together["same_picture"] == true);
    let bare = summed("--effects shadow");
    let out = listed(&bare, "left_out");
    assert!(out.iter().all(|one| one.get("ms_frame").is_none() && one["why"].is_string() && one["how"].is_string()));
    assert!(bare["left_out_together"].is_null());
    // Every component is in one of the lists, and what is asked for is there.
    let names = |summary: &serde_json::Value, list: &str| -> Vec<String> {
        listed(summary, list).iter().map(|one| one["what"].as_str().expect("a name").to_owned()).collect()
    };
    let all = |summary: &serde_json::Value| {
        let mut all = [names(summary, "kept"), names(summary, "left_out")].concat();
        all.sort();
        all
    };
    assert_eq!(all(&summary), all(&bare));
    let bounces = "rays from hits of rays".to_owned();
    assert!(names(&summary, "kept").contains(&bounces) && names(&bare, "left_out").contains(&bounces));
    let size = out.iter().find(|one| one["what"] == bounces).and_then(|one| one["bytes"].as_u64());
    assert!(size.is_some_and(|bytes| bytes > 48 * 32 * 64), "{size:?}");
}
