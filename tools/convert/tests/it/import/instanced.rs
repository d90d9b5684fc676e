//! Instanced models of 3D Tiles (i3dm), written here.

use super::tiles::*;
use super::writer::*;
use brickwalk_convert::source::SourceScene;
use proptest::prelude::*;
use serde_json::{Value, json};

/// An instanced model: format 0 with a URI, or 1 with a glTF file.
fn i3dm(features: &Value, binary: &[u8], format: u32, body: &[u8]) -> Vec<u8> {
    let features = features.to_string();
    let batches = br#"{"id":[1]}"#;
    let lengths = [features.len(), binary.len(), batches.len(), 0];
    let total = 32 + lengths.iter().sum::<usize>() + body.len();
    let words = [1, total].into_iter().chain(lengths).chain([format as usize]);
    let words: Vec<u8> = words.flat_map(|n| (n as u32).to_le_bytes()).collect();
    [b"i3dm", &words[..], features.as_bytes(), binary, batches, body].concat()
}

/// Images of a point of the model, in the tileset's axes, Z up, for each instance.
fn images(scene: &SourceScene, p: [f64; 3]) -> Vec<[f64; 3]> {
    let image = |m: &[f64; 12]| -> [f64; 3] {
        let [x, y, z]: [f64; 3] =
            std::array::from_fn(|r| m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3]);
        [x, -z, y]
    };
    scene.placements.iter().map(|placement| image(&placement.world_from_mesh)).collect()
}

#[track_caller]
fn close(found: &[[f64; 3]], expected: &[[f64; 3]], within: f64) {
    let apart = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
    assert_eq!(found.len(), expected.len());
    let worst = found.iter().zip(expected).map(apart).fold(0.0, f64::max);
    assert!(worst <= within, "{found:?} is not {expected:?}");
}

#[test]
fn positions_scales_and_axes_place_instances() {
    let positions = [1.0f32, 2.0, 3.0, -4.0, 5.0, 6.5];
    // To the right is +y, up is -x: so forward, right x up, is +z; and the model's own axes.
    let (up, right) = ([-1.0f32, 0.0, 0.0, 0.0, 1.0, 0.0], [0.0f32, 2.0, 0.0, 1.0, 0.0, 0.0]);
    let (scale, scales) = ([2.0f32, 3.0], [1.0f32, 2.0, 4.0, 1.0, 1.0, 1.0]);
    let binary = [&positions[..], &up, &right, &scale, &scales].concat();
    let binary: Vec<u8> = binary.iter().flat_map(|x| x.to_le_bytes()).collect();
    let features = json!({"INSTANCES_LENGTH": 2, "RTC_CENTER": [1000.0, 0.25, 0.0], "POSITION": {"byteOffset": 0},
        "NORMAL_UP": {"byteOffset": 24}, "NORMAL_RIGHT": {"byteOffset": 48}, "SCALE": {"byteOffset": 72},
        "SCALE_NON_UNIFORM": {"byteOffset": 80}});
    let scene = import_content("a.i3dm", &i3dm(&features, &binary, 1, &model(1.0))).unwrap();
    assert_eq!((scene.meshes.len(), scene.placements.len()), (1, 2), "one mesh, two places");
    // A point of the model, Y up, is (x, -z, y) with Z up; then scaled, turned and moved.
    let expected = |p: [f64; 3]| {
        let [x, y, z] = [p[0], -p[2], p[1]];
        let first = {
            let [x, y, z] = [2.0 * x, 4.0 * y, 8.0 * z];
            // x along right, y along up, z along forward.
            [-y + 1001.0, x + 2.25, z + 3.0]
        };
        [first, [3.0 * x + 996.0, 3.0 * y + 5.25, 3.0 * z + 6.5]]
    };
    for p in [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.5, -2.0, 3.0]] {
        close(&images(&scene, p), &expected(p), 1e-12);
    }
    // Without axes and scales they are moved alone.
    let features = json!({"INSTANCES_LENGTH": 2, "POSITION": {"byteOffset": 0}});
    let scene = import_content("a.i3dm", &i3dm(&features, &binary, 1, &model(1.0))).unwrap();
    close(&images(&scene, [1.0, 0.0, 0.0]), &[[2.0, 2.0, 3.0], [-3.0, 5.0, 6.5]], 0.0);
}

#[test]
fn quantised_places_are_those_that_they_stand_for() {
    let quantised: Vec<u8> = [0u16, 65535, 13107, 65535, 0, 26214].iter().flat_map(|q| q.to_le_bytes()).collect();
    // Octahedral: up +y and -z, right +x both: 32767.5 would be 0.
    let octahedral: Vec<u8> =
        [32768u16, 65535, 0, 0, 65535, 32768, 65535, 32768].iter().flat_map(|q| q.to_le_bytes()).collect();
    let binary = [quantised, octahedral].concat();
    let features = json!({"INSTANCES_LENGTH": 2, "POSITION_QUANTIZED": {"byteOffset": 0},
        "QUANTIZED_VOLUME_OFFSET": [10.0, 20.0, 30.0], "QUANTIZED_VOLUME_SCALE": [100.0, 200.0, 50.0],
        "NORMAL_UP_OCT32P": {"byteOffset": 12}, "NORMAL_RIGHT_OCT32P": {"byteOffset": 20}});
    let scene = import_content("a.i3dm", &i3dm(&features, &binary, 1, &model(1.0))).unwrap();
    close(&images(&scene, [0.0; 3]), &[[10.0, 220.0, 40.0], [110.0, 20.0, 50.0]], 1e-9);
    // Z up, the model's y is -z of glTF; it goes up: to +y, and to -z.
    close(&images(&scene, [0.0, 0.0, -1.0]), &[[10.0, 221.0, 40.0], [110.0, 20.0, 49.0]], 1e-4);
    // Forward is right x up: +z, and +y.
    close(&images(&scene, [0.0, 1.0, 0.0]), &[[10.0, 220.0, 41.0], [110.0, 21.0, 50.0]], 1e-4);
}

/// On the equator up is away from the centre; the model stands on its feet there.
#[test]
fn east_north_up_is_that_of_the_place() {
    let binary: Vec<u8> = [0.0f32, 6378137.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let features = |more: Value| {
        let mut features = json!({"INSTANCES_LENGTH": 1, "POSITION": {"byteOffset": 0}});
        features.as_object_mut().unwrap().append(&mut more.as_object().unwrap().clone());
        features
    };
    let scene = import_content("a.i3dm", &i3dm(&features(json!({"EAST_NORTH_UP": true})), &binary, 1, &model(1.0)));
    let scene = scene.unwrap();
    // Up in glTF is y; there it is away from the axis. East is -x, north +z.
    close(&images(&scene, [0.0, 1.0, 0.0]), &[[0.0, 6378138.0, 0.0]], 1e-8);
    close(&images(&scene, [1.0, 0.0, 0.0]), &[[-1.0, 6378137.0, 0.0]], 1e-8);
    close(&images(&scene, [0.0, 0.0, -1.0]), &[[0.0, 6378137.0, 1.0]], 1e-8);
    let flat = import_content("a.i3dm", &i3dm(&features(json!({})), &binary, 1, &model(1.0))).unwrap();
    close(&images(&flat, [0.0, 1.0, 0.0]), &[[0.0, 6378137.0, 1.0]], 1e-8);
}

#[test]
fn models_are_named_or_within() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("trees")).unwrap();
    write(folder.path(), "trees/oak tree.glb", &model(5.0));
    let binary: Vec<u8> = [1.0f32, 0.0, 0.0, 2.0, 0.0, 0.0].iter().flat_map(|x| x.to_le_bytes()).collect();
    let features = json!({"INSTANCES_LENGTH": 2, "POSITION": {"byteOffset": 0}});
    write(folder.path(), "trees/a.i3dm", &i3dm(&features, &binary, 0, b"oak%20tree.glb  "));
    write(folder.path(), "trees/b.i3dm", &i3dm(&features, &binary, 0, b"oak%20tree.glb\0"));
    let shift = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 10.0, 0.0, 0.0, 1.0];
    let children = [
        json!({"content": {"uri": "trees/a.i3dm"}}),
        json!({"transform": shift, "content": {"uri": "trees/b.i3dm"}}),
        json!({"transform": shift, "content": {"uri": "trees/a.i3dm"}}),
        json!({"content": {"uri": "trees/oak%20tree.glb"}}),
    ];
    write_json(folder.path(), "tileset.json", &tileset(json!({"refine": "ADD", "children": children})));
    let scene = import_tiles(folder.path()).unwrap();
    assert_eq!(scene.meshes.len(), 1, "the model is read once");
    let places: Vec<f64> = shown(&scene).into_iter().map(|(_, at)| at[0]).collect();
    // Both files show it at 11 and 12.
    assert_eq!(places, [1.0, 2.0, 11.0, 12.0, 0.0]);
    assert!(scene.warnings.iter().any(|line| line.contains("2 times")), "{:?}", scene.warnings);
}

#[test]
fn defects_of_instanced_models_are_named() {
    let binary: Vec<u8> = [1.0f32; 12].iter().flat_map(|x| x.to_le_bytes()).collect();
    let good = json!({"INSTANCES_LENGTH": 2, "POSITION": {"byteOffset": 0}});
    let whole = i3dm(&good, &binary, 1, &model(1.0));
    assert_eq!(import_content("a.i3dm", &whole).unwrap().placements.len(), 1, "at one place");
    let error = |bytes: &[u8]| {
        let error = import_content("a.i3dm", bytes).unwrap_err();
        assert!(error.contains("a.i3dm: ") && !error.contains('\n'), "{error}");
        error
    };
    for length in [5, 27, 31, 32, 60, whole.len() - 1] {
        error(&whole[..length]);
    }
    let with = |key: &str, value: Value| {
        let mut features = good.clone();
        features[key] = value;
        error(&i3dm(&features, &binary, 1, &model(1.0)))
    };
    assert!(with("INSTANCES_LENGTH", json!(5)).contains("POSITION lies outside the feature table"));
    assert!(with("INSTANCES_LENGTH", json!(4_000_000_000u32)).contains("4000000000 instances are too many"));
    assert!(with("INSTANCES_LENGTH", Value::Null).contains("feature table cannot be read"));
    assert!(with("POSITION", Value::Null).contains("neither POSITION nor POSITION_QUANTIZED"));
    assert!(with("POSITION", json!({"byteOffset": u64::MAX})).contains("POSITION lies outside"));
    assert!(with("NORMAL_UP", json!({"byteOffset": 0})).contains("only one of up and right"));
    assert!(with("RTC_CENTER", json!([1, 2])).contains("feature table cannot be read"));
    let quantised = json!({"INSTANCES_LENGTH": 1, "POSITION_QUANTIZED": {"byteOffset": 0}});
    let found = error(&i3dm(&quantised, &binary, 1, &model(1.0)));
    assert!(found.contains("POSITION_QUANTIZED without QUANTIZED_VOLUME_OFFSET"), "{found}");
    assert!(error(&i3dm(&good, &binary, 2, &model(1.0))).contains("gltfFormat 2"));
    assert!(error(&i3dm(&good, &binary, 0, b"gone.glb")).contains("glTF file \"gone.glb\""));
    assert!(error(&i3dm(&good, &binary, 0, b"../up.glb")).contains("leads out of the folder"));
    assert!(error(&i3dm(&good, &[255; 24], 1, &model(1.0))).contains("instance 0 is not placed"));
    // Directions that are none.
    let features = json!({"INSTANCES_LENGTH": 1, "POSITION": {"byteOffset": 0}, "NORMAL_UP": {"byteOffset": 12},
        "NORMAL_RIGHT": {"byteOffset": 12}});
    let zeros = [&binary[..12], &[0; 12]].concat();
    assert!(error(&i3dm(&features, &zeros, 1, &model(1.0))).contains("instance 0 is not placed"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_instanced_models_do_no_harm(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let binary: Vec<u8> = [1.0f32; 24].iter().flat_map(|x| x.to_le_bytes()).collect();
        let features = json!({"INSTANCES_LENGTH": 2, "POSITION": {"byteOffset": 0}, "EAST_NORTH_UP": true,
            "SCALE": {"byteOffset": 24}, "NORMAL_UP_OCT32P": {"byteOffset": 32},
            "NORMAL_RIGHT_OCT32P": {"byteOffset": 40}});
        let mut bytes = i3dm(&features, &binary, 1, &model(1.0));
        let head = bytes.len() - model(1.0).len();
        for (at, value) in &edits {
            bytes[at.index(head)] = *value;
        }
        match import_content("a.i3dm", &bytes) {
            Ok(scene) => prop_assert!(scene.placements.len() <= 8),
            Err(error) => prop_assert!(!error.contains('\n'), "{}", error),
        }
    }
}
