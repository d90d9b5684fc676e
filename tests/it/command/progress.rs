//! Caches much smaller than what a pass works on: every frame is finished, in as many fillings of the cache as it
//! takes, and the records say how many.

use crate::common::{folder, frames, polished_city, records, walk};

const EFFECTS: &str = "--effects primary,shadow,ao,diffuse,glossy --ao-rays 2 --diffuse-rays 2 --ao-length 5";

#[test]
fn every_frame_is_finished_by_a_cache_of_two_bricks() {
    let folder = folder();
    let scene = polished_city(folder.path(), 100_000, 512);
    let bricks = bricks::SceneFile::open(&scene).expect("a scene");
    let sizes: Vec<(u64, u64)> =
        bricks.resident().bricks.iter().map(|b| (b.geometry.bytes, bricks::AttributeLayout::of(b).bytes)).collect();
    let least = brickwalk::stream::Residency::least_budget(&sizes);
    let view =
        format!("--frames 1 --size 48x32 --measure-needed --path {}", scene.with_extension("far.json").display());
    let run = |name: &str, options: &str| {
        let output = folder.path().join(name);
        walk(&scene, &output, &format!("{view} {EFFECTS} {options}"));
        (frames(&output), records(&output))
    };
    let (picture, whole) = run("plain", "--cache 100% --schedule plain");
    for record in &whole {
        assert_eq!(record["cache_passes"], 1, "{record}");
        assert_eq!(record["bricks_reloaded_frame"], 0, "{record}");
    }
    for (name, options) in [
        ("chc", "--schedule chc"),
        ("fronts", "--schedule chc --fronts on"),
        ("demand", "--schedule demand"),
        ("auto", "--schedule auto"),
        ("chances", "--schedule chc --evict second-chance"),
        ("lru", "--schedule demand --evict lru"),
    ] {
        let (frames, records) = run(name, &format!("--cache {least} {options}"));
        assert!(frames == picture, "{name}: another picture than with everything resident");
        let mut reloaded = 0;
        for record in &records {
            let n = |field: &str| record[field].as_u64().unwrap_or_else(|| panic!("{field} is a count"));
            assert_eq!(n("unresolved_pixels"), 0, "{name}: {record}");
            assert!(n("cache_passes") <= 1 + n("bricks_evicted"), "{name}: {record}");
            assert!(n("bricks_reloaded_frame") <= n("bricks_loaded"), "{name}: {record}");
            reloaded += n("bricks_reloaded_frame");
            // Effects with one pass a frame: its fillings hold what it needed, and nothing else comes and goes.
            if ["primary", "shadow", "glossy"].contains(&record["pass"].as_str().expect("a name")) {
                assert!(n("cache_passes") * n("cache_bytes") >= n("bytes_needed"), "{name}: {record}");
                let end = n("bricks_resident_start") + n("bricks_loaded") - n("bricks_evicted");
                assert_eq!(end, n("bricks_resident_end"), "{name}: {record}");
            }
        }
        let primary = &records[0];
        let n = |field: &str| primary[field].as_u64().expect("a count");
        assert!(n("bytes_needed") >= 10 * n("cache_bytes"), "{name}: the view is too easy: {primary}");
        assert!(n("cache_passes") >= 10, "{name}: {primary}");
        assert!(reloaded > 0, "{name}: passes of a frame want the same bricks");
    }
}
