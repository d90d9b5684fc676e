//! Displacement fields as a user makes and uses them: files, repair, rays that they answer, caches, scenes without any.

use crate::common::{adapters, brickwalk, city, folder, succeed};
use bricks::{Payload, SceneFile};
use serde_json::Value;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// Runs a command on `scene` with more words.
fn on(command: &str, scene: &Path, words: &str) -> (Option<i32>, String) {
    let all = [OsStr::new(command), scene.as_os_str()].into_iter().chain(words.split_whitespace().map(OsStr::new));
    let output = brickwalk(all);
    let said = if output.status.success() { output.stdout } else { output.stderr };
    (output.status.code(), String::from_utf8_lossy(&said).into_owned())
}

/// Walks through a scene into the folder `name`; the summary, the sums of a record's field in the pass `ao`, and frame
/// 1.
fn walk(scene: &Path, name: &str, words: &str) -> (Value, impl Fn(&str) -> u64 + use<>, Vec<u8>) {
    let out = scene.with_file_name(name);
    let path = scene.with_extension("near.json");
    let words = format!(
        "-o {} --path {} --frames 2 --size 96x64 --tile 16 --effects ao --ao-length 60 {words}",
        out.display(),
        path.display()
    );
    let (status, said) = on("walk", scene, &words);
    assert_eq!(status, Some(0), "{said}");
    let read = |name: &str| std::fs::read_to_string(out.join(name)).expect("a file of the walk");
    let summary = serde_json::from_str(&read("summary.json")).expect("JSON");
    let records: Vec<Value> =
        read("records.jsonl").lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let sum = move |key: &str| {
        let own = records.iter().filter(|record| record["pass"] == "ao");
        own.map(|record| record[key].as_u64().unwrap_or(0)).sum()
    };
    (summary, sum, std::fs::read(out.join("frames/0001.png")).expect("a frame"))
}

#[test]
fn fields_answer_rays_whatever_the_cache_and_load_less() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "500");
    let (status, said) = on("bake-displacement", &scene, "--adapter cpu");
    assert!(status == Some(0) && said.contains("displacement fields of 0 objects and"), "{said}");
    assert!(said.contains(" bricks: "), "{said}");
    let (_, exact, picture) = walk(&scene, "exact", "--adapter cpu --cache 10%");
    assert_eq!([exact("rays_answered"), exact("rays_shortened")], [0, 0]);
    for adapter in adapters() {
        // A name that has no spaces.
        let adapter = adapter.split_whitespace().next().expect("a name");
        let by_fields = |name: &str, cache: &str, against: &str| {
            let words = format!(
                "--adapter {adapter} --cache {cache} --secondary displacement --displacement-against {against} \
                 --displacement-near 1"
            );
            walk(&scene, &format!("{name}-{adapter}"), &words)
        };
        let (summary, few, one) = by_fields("few", "10%", "all");
        let (_, all, other) = by_fields("all", "100%", "all");
        assert!(one == other, "{adapter}: the picture depends on the cache");
        assert!(one != picture, "{adapter}: fields changed nothing");
        assert_eq!(few("rays"), exact("rays"), "{adapter}");
        for key in ["rays_traced", "rays_answered", "rays_shortened"] {
            assert!(few(key) == all(key) && few(key) > 0, "{adapter}: {key} {} {}", few(key), all(key));
        }
        assert!(few("bricks_loaded") < exact("bricks_loaded"), "{adapter}");
        let told = &summary["settings"]["displacement"];
        assert!(told["fields"].as_u64() > Some(10) && told["fields"] == told["fields_held"], "{told}");
        // Where every brick is there, and nothing is placed twice, all rays are traced.
        let (_, absent, picture_of) = by_fields("absent", "100%", "absent");
        assert!(absent("rays_answered") < few("rays_answered"), "{adapter}");
        if absent("bricks_loaded") == 0 {
            assert!(picture_of == picture, "{adapter}");
        }
    }
}

#[test]
fn the_most_useful_fields_are_kept() {
    let folder = folder();
    let scene = city(folder.path(), "40K", "500");
    assert_eq!(on("bake-displacement", &scene, "--adapter cpu --bits 1").0, Some(0));
    let (summary, sum, _) =
        walk(&scene, "small", "--adapter cpu --cache 10% --secondary displacement --displacement-memory 100KiB");
    let told = &summary["settings"]["displacement"];
    let number = |key: &str| told[key].as_u64().expect("a number");
    assert!(number("bytes_held") <= 100 << 10 && number("fields_held") > 2, "{told}");
    assert!(number("fields_held") < number("fields") && number("exchanges") > 0, "{told}");
    assert!(sum("rays_answered") + sum("rays_shortened") > 0);
}

#[test]
fn damaged_fields_are_found_and_made_anew() {
    let folder = folder();
    let scene = city(folder.path(), "20K", "500");
    let before = std::fs::read(&scene).expect("the scene");
    let with: PathBuf = folder.path().join("with.bricks");
    let words = format!("--adapter cpu -o {}", with.display());
    assert_eq!(on("bake-displacement", &scene, &words).0, Some(0));
    assert!(std::fs::read(&scene).expect("the scene") == before, "the scene is as it was");
    let whole = std::fs::read(&with).expect("the scene");
    assert_eq!(on("verify", &with, "").0, Some(0));
    let span = SceneFile::open(&with).expect("a scene").span(Payload::Displacement(3));
    let mut damaged = whole.clone();
    damaged[(span.offset + span.bytes / 2) as usize] ^= 8;
    std::fs::write(&with, &damaged).expect("the damaged file");
    let (status, said) = on("verify", &with, "");
    assert!(status == Some(1) && said.contains("displacement field 3"), "{said}");
    let (status, said) = on("repair", &with, "");
    assert!(status == Some(0) && said.contains("repaired displacement field 3"), "{said}");
    assert!(std::fs::read(&with).expect("the scene") == whole);
    // Made once more, the same bytes; made with others, those are gone.
    assert_eq!(on("bake-displacement", &with, "--adapter cpu").0, Some(0));
    assert!(std::fs::read(&with).expect("the scene") == whole);
    assert_eq!(on("bake-displacement", &with, "--adapter cpu --of objects").0, Some(0));
    assert!(std::fs::read(&with).expect("the scene") == before, "no object is placed twice: no field is left");
}

#[test]
fn a_scene_without_fields_runs_no_line_of_them() {
    let folder = folder();
    let scene = city(folder.path(), "20K", "500");
    let out = folder.path().join("out");
    let words = format!("-o {} --frames 1 --size 32x32 --adapter cpu", out.display());
    let (status, said) = on("walk", &scene, &format!("{words} --effects ao --secondary displacement"));
    assert!(status == Some(1) && said.contains("bake-displacement"), "{said}");
    assert_eq!(on("walk", &scene, &words).0, Some(0));
    let text = std::fs::read_to_string(out.join("summary.json")).expect("a summary");
    let summary: Value = serde_json::from_str(&text).expect("JSON");
    let left_out = summary["left_out"].as_array().expect("a list");
    assert!(left_out.iter().any(|one| one["what"] == "displacement fields"), "{left_out:?}");
    assert!(summary["settings"]["displacement"].is_null());
    // Fields come with the conversion where they are asked for.
    let words = ["scene", "city", "--triangles", "20K", "--brick-triangles", "500", "--displacement", "-o"];
    let made = folder.path().join("made.bricks");
    let said = succeed(words.map(OsStr::new).into_iter().chain([made.as_os_str()]));
    assert!(said.contains("displacement fields of"), "{said}");
    for (words, says) in [("--bits 4", "one of 1, 8"), ("--positions 300", "290, 1090, 4226, 16642")] {
        let (status, said) = on("bake-displacement", &scene, words);
        assert!(status == Some(2) && said.contains(says), "{said}");
    }
    let (status, said) = on("bake-displacement", &scene, "--memory 1KiB --adapter cpu");
    assert!(status == Some(1) && said.contains("--memory"), "{said}");
}
