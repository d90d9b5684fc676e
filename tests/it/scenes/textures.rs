//! Textures out of core: pictures do not depend on which tiles fit into the cache, records count what is loaded, damage
//! is named.

use crate::common::{brickwalk, folder, frames, records, succeed, walk};
use bricks::{Payload, SceneFile};
use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// A floor of 40 x 40 metres with four pictures of 600 x 400 texels, a texel to 10 or 15 centimetres, and a camera path
/// low over it.
fn floor(folder: &Path) -> PathBuf {
    let (mut obj, mut mtl) = (String::from("mtllib f.mtl\n"), String::new());
    for at in 0..9 * 9 {
        let (x, z) = (at % 9 * 5, at / 9 * 5);
        let _ = writeln!(obj, "v {x} 0 {z}\nvt {} {}", f64::from(x) / 60.0, f64::from(z) / 60.0);
    }
    for picture in 0..4 {
        let _ = writeln!(mtl, "newmtl m{picture}\nmap_Kd p{picture}.png");
        let _ = writeln!(obj, "usemtl m{picture}");
        for at in (0..8 * 9).filter(|at| at % 9 < 8 && (at % 9 + at / 9) % 4 == picture) {
            let [a, b, c, d] = [at + 1, at + 2, at + 10, at + 11];
            let _ = writeln!(obj, "f {a}/{a} {c}/{c} {b}/{b}\nf {b}/{b} {c}/{c} {d}/{d}");
        }
        let noise = |x: u32, y: u32| (x / 2 * 7919 + y / 3 * 104_729 + 31 * picture as u32).wrapping_mul(0x9E37_79B1);
        let texel = |x, y| image::Rgb([24, 16, 8].map(|shift| (noise(x, y) >> shift) as u8));
        let name = folder.join(format!("p{picture}.png"));
        image::RgbImage::from_fn(600, 400, texel).save(name).expect("a picture");
    }
    std::fs::write(folder.join("f.obj"), obj).expect("an input");
    std::fs::write(folder.join("f.mtl"), mtl).expect("materials");
    let path = r#"{"fov_y_degrees": 50, "keyframes": [{"time": 0, "position": [3, 4, 3], "target": [20, 0, 20]},
        {"time": 1, "position": [30, 3, 12], "target": [20, 0, 26]}]}"#;
    std::fs::write(folder.join("path.json"), path).expect("a path");
    folder.join("f.obj")
}

fn convert(input: &Path, name: &str, options: &str) -> PathBuf {
    let scene = input.with_file_name(name);
    let words = ["convert".as_ref(), input.as_os_str(), "-o".as_ref(), scene.as_os_str()];
    let options = format!("--brick-triangles 16 {options}");
    succeed(words.into_iter().chain(options.split_whitespace().map(std::ffi::OsStr::new)));
    scene
}

fn info(scene: &Path) -> Value {
    serde_json::from_str(&succeed(["info".as_ref(), scene.as_os_str(), "--json".as_ref()])).expect("JSON")
}

fn total(records: &[Value], field: &str) -> u64 {
    records.iter().map(|record| record[field].as_u64().expect("a count")).sum()
}

const VIEW: &str = "--adapter cpu --frames 3 --size 320x240 --aov --effects shadow,diffuse --diffuse-rays 1";

#[test]
fn pictures_do_not_depend_on_the_tiles_that_fit() {
    let folder = folder();
    let scene = convert(&floor(folder.path()), "f.bricks", "");
    let info = info(&scene);
    let n = |field: &str| info[field].as_u64().expect("a count");
    let tile = 16_384;
    assert_eq!((n("textures"), n("texture_tiles"), &info["texture_encodings"]), (4, 4 * 28, &Value::from(vec!["bc7"])));
    assert_eq!(n("texture_bytes") - n("texture_tail_bytes"), n("texture_tiles") * tile);
    assert_eq!(n("least_cache_bytes"), 16 * tile, "tiles decide");
    let view = format!("{VIEW} --path {}", folder.path().join("path.json").display());
    let run = |name: &str, options: &str| {
        let output = folder.path().join(name);
        walk(&scene, &output, &format!("{view} {options}"));
        (frames(&output), records(&output), output)
    };
    let (pictures, all, _) = run("all", "--cache 100% --schedule plain");
    assert_eq!(total(&all, "bricks_reloaded_frame") + total(&all, "bricks_evicted"), 0);
    assert!(total(&all, "bytes_textures") > 30 * tile, "the view is too easy: {}", total(&all, "bytes_textures"));
    // Each tile is loaded once.
    assert!(total(&all, "bytes_textures") <= n("texture_tiles") * tile);
    for (i, options) in [
        "--schedule chc --evict round-robin",
        "--schedule demand --evict lru",
        "--schedule chc --evict second-chance --host-cache 0",
    ]
    .iter()
    .enumerate()
    {
        let requests = folder.path().join(format!("requests{i}.jsonl"));
        let options = format!("--cache {} {options} --requests-out {}", n("least_cache_bytes"), requests.display());
        let (same, records, _) = run(&format!("least{i}"), &options);
        assert!(same == pictures, "{options}: another picture than with everything resident");
        let bytes = ["bytes_bvh", "bytes_geometry", "bytes_attributes", "bytes_textures"].map(|f| total(&records, f));
        assert!(bytes[3] > total(&all, "bytes_textures"), "{options}: tiles come and go: {bytes:?}");
        let of_primary = |record: &&Value| record["pass"] == "primary" && record["cache_passes"].as_u64() > Some(1);
        assert!(records.iter().any(|record| of_primary(&record)), "{options}: a pass needs more than fits at once");
        assert_eq!(bytes[3] % tile, 0);
        for record in &records {
            let n = |field: &str| record[field].as_u64().expect("a count");
            assert_eq!(n("bricks_resident_start") + n("bricks_loaded") - n("bricks_evicted"), n("bricks_resident_end"));
            assert!(n("cache_used_bytes") <= n("cache_bytes"), "{record}");
        }
        // What the trace of requests says, tiles among them.
        let replayed = succeed(["replay".as_ref(), requests.as_os_str(), "--json".as_ref()]);
        let replayed: Value = serde_json::from_str(&replayed).expect("JSON");
        let rows = replayed["results"].as_array().expect("rows");
        let row = rows.iter().find(|row| row["recorded"] == true).expect("the recorded cache");
        assert_eq!(row["loads"], total(&records, "bricks_loaded"), "{options}");
        assert_eq!(row["evicted"], total(&records, "bricks_evicted"), "{options}");
        assert_eq!(row["loaded_bytes"], bytes.iter().sum::<u64>(), "{options}");
        assert_eq!(replayed["tiles"], n("texture_tiles"));
        assert!(std::fs::read_to_string(&requests).expect("requests").contains("\"t"), "tiles are requests");
    }
    // Control: a view that differs a little is noticed.
    assert!(run("other", "--cache 100% --fov 50.01").0 != pictures);
    // Less than the least is refused, with what is needed.
    let output = folder.path().join("refused");
    let cache = (n("least_cache_bytes") - 16).to_string();
    let words =
        ["walk".as_ref(), scene.as_os_str(), "-o".as_ref(), output.as_os_str(), "--cache".as_ref(), cache.as_ref()];
    let refused = brickwalk(words.map(|word: &std::ffi::OsStr| word));
    let line = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(refused.status.code() == Some(1) && line.contains("the tiles of a texture lookup need"), "{line}");
}

#[test]
fn a_bounded_frame_takes_coarser_levels_and_a_resting_camera_gets_the_exact_picture() {
    let folder = folder();
    let scene = convert(&floor(folder.path()), "f.bricks", "");
    let path = folder.path().join("still.json");
    let text = r#"{"fov_y_degrees": 50, "keyframes": [{"time": 0, "position": [3, 4, 3], "target": [20, 0, 20]}]}"#;
    std::fs::write(&path, text).expect("a path");
    let frames_of_walk = 8;
    let view = format!(
        "--adapter cpu --frames {frames_of_walk} --size 320x240 --aov --cache 100% --effects shadow --path {}",
        path.display()
    );
    let run = |name: &str, options: &str| {
        let output = folder.path().join(name);
        walk(&scene, &output, &format!("{view} {options}"));
        (frames(&output), records(&output), output)
    };
    let of_frame = |records: &[Value], frame: u32, field: &str| {
        total(&records.iter().filter(|r| r["frame"] == frame).cloned().collect::<Vec<_>>(), field)
    };
    let (exact, records, output) = run("exact", "");
    assert_eq!(total(&records, "unresolved_pixels"), 0);
    let needed = of_frame(&records, 0, "bytes_textures");
    assert!(needed > 15 * 16_384, "{needed}");
    // A fifth of what is needed: a frame loads no more, and after five at most everything is there.
    let bytes = needed / 5 + 16_384;
    let (bounded, records, bounded_output) = run("bounded", &format!("--interactive {bytes} --measure-error"));
    let unresolved: Vec<u64> = (0..frames_of_walk).map(|k| of_frame(&records, k, "unresolved_pixels")).collect();
    let loaded: Vec<u64> = (0..frames_of_walk).map(|k| of_frame(&records, k, "bytes_textures")).collect();
    assert!(loaded.iter().all(|&loaded| loaded <= bytes) && loaded[0] > 0, "{loaded:?}");
    assert!(unresolved[0] > 1000 && unresolved[0] <= 2 * 320 * 240, "{unresolved:?}");
    assert!(unresolved.windows(2).all(|two| two[1] < two[0] || two == [0, 0]), "{unresolved:?}");
    assert_eq!(unresolved[5..], [0, 0, 0], "it ends");
    assert_eq!(loaded.iter().sum::<u64>(), needed, "nothing is loaded twice");
    // Of every frame PNG and EXR; one of a budget has its states as well.
    assert_eq!(exact.len(), 2 * frames_of_walk as usize);
    let differs: Vec<bool> =
        exact.iter().zip(&bounded).filter(|(a, _)| a.0.ends_with("png")).map(|(a, b)| a != b).collect();
    assert!(differs[0], "control: the first frame is another picture");
    assert!(differs[5..].iter().all(|&differs| !differs), "the last are the exact ones");
    let at_rest: Vec<u64> = (0..frames_of_walk).map(|k| of_frame(&records, k, "pixels_exact")).collect();
    assert!(at_rest[0] < 320 * 240 && at_rest[5..] == [320 * 240; 3], "{at_rest:?}");
    // Coarse, not wrong: noise is blurred, and the mean stays.
    let mean = |output: &Path| {
        let picture = image::open(output.join("frames/0000.png")).expect("a PNG").to_rgb8();
        picture.iter().map(|&c| f64::from(c)).sum::<f64>() / picture.len() as f64
    };
    assert!((mean(&output) - mean(&bounded_output)).abs() < 4.0, "{} {}", mean(&output), mean(&bounded_output));
    assert!(records[0]["error_mean"].as_f64() > Some(1e-3), "the error of a bounded frame is measured");
    // Less than a tile a frame still comes to an end; bricks come before tiles.
    let (_, records, _) = run("least", "--frame-budget 1B");
    let loaded: Vec<u64> = (0..frames_of_walk).map(|k| of_frame(&records, k, "bytes_textures")).collect();
    assert_eq!(loaded, [0, 16_384, 16_384, 16_384, 16_384, 16_384, 16_384, 16_384]);
    // The bricks are so small that they all come with the first frame: what is hit is what is hit exactly.
    let ids = |output: &Path| {
        brickwalk([
            "compare".as_ref(),
            output.join("frames/0000.exr").as_os_str(),
            folder.path().join("exact/frames/0000.exr").as_os_str(),
            "--json".as_ref(),
        ])
    };
    let compared: Value = serde_json::from_slice(&ids(&bounded_output).stdout).expect("JSON");
    assert_eq!(compared["ids_differing"], 0, "{compared}");
}

#[test]
fn blocks_look_like_texels_and_damage_is_named() {
    let folder = folder();
    let input = floor(folder.path());
    let scenes = ["bc7", "raw"]
        .map(|encoding| convert(&input, &format!("{encoding}.bricks"), &format!("--textures {encoding}")));
    // The bytes do not depend on the number of threads.
    let again = convert(&input, "again.bricks", "--threads 1 --textures bc7");
    assert!(std::fs::read(&scenes[0]).expect("a scene") == std::fs::read(again).expect("a scene"));
    let [bc7, raw] = [&scenes[0], &scenes[1]].map(|scene| info(scene));
    assert_eq!(raw["texture_encodings"], Value::from(vec!["raw"]));
    assert_eq!(raw["texture_bytes"].as_u64(), bc7["texture_bytes"].as_u64().map(|bytes| 4 * bytes));
    let view = format!(
        "--adapter cpu --frames 1 --size 120x80 --cache 100% --path {}",
        folder.path().join("path.json").display()
    );
    let pictures = [0, 1].map(|i| {
        let output = folder.path().join(format!("out{i}"));
        walk(&scenes[i], &output, &view);
        image::open(output.join("frames/0000.png")).expect("a PNG").to_rgb8()
    });
    let apart: u64 = pictures[0].iter().zip(pictures[1].iter()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    let mean = apart as f64 / pictures[0].len() as f64;
    // Noise that changes from texel to texel is the worst that blocks can meet.
    assert!(mean > 0.0 && mean < 12.0, "{mean}");

    // Every tile is damaged: the first that is asked for is named as the source does.
    let scene = SceneFile::open(&scenes[0]).expect("a scene");
    let mut bytes = std::fs::read(&scenes[0]).expect("a scene");
    for tile in 0..scene.resident().tiles.len() as u32 {
        bytes[scene.span(Payload::Tile(tile)).offset as usize + 5] ^= 1;
    }
    std::fs::write(&scenes[0], bytes).expect("a damaged scene");
    let output = folder.path().join("damaged");
    let words = ["walk".as_ref(), scenes[0].as_os_str(), "-o".as_ref(), output.as_os_str()];
    let walked = brickwalk(words.into_iter().chain(view.split_whitespace().map(std::ffi::OsStr::new)));
    let line = String::from_utf8_lossy(&walked.stderr).into_owned();
    assert_eq!(walked.status.code(), Some(1));
    let says = ["bc7.bricks", "tile ", "is damaged", "of level ", "of texture ", ".png"];
    assert!(says.iter().all(|word| line.contains(word)) && line.lines().count() == 1, "{line}");
    let verified = brickwalk(["verify".as_ref(), scenes[0].as_os_str()]);
    let line = String::from_utf8_lossy(&verified.stderr).into_owned();
    assert!(verified.status.code() == Some(1) && line.contains("column 0, row 0 of level 0 of texture 0"), "{line}");
}
