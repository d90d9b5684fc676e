//! Sets of 3D Tiles, written here.

use super::writer::*;
use brickwalk_convert::import::{Input, Up};
use brickwalk_convert::source::SourceScene;
use proptest::prelude::*;
use serde_json::{Value, json};
use std::path::Path;

/// A tileset of version 1.1 with this root tile.
pub fn tileset(root: Value) -> Value {
    json!({"asset": {"version": "1.1"}, "geometricError": 100, "root": root})
}

pub fn write_json(folder: &Path, name: &str, value: &Value) {
    write(folder, name, value.to_string().as_bytes());
}

/// A batched model around `glb`.
fn b3dm(glb: &[u8], features: &str, binary: &[u8]) -> Vec<u8> {
    let batches = br#"{"id": [1]}  "#;
    let lengths = [features.len(), binary.len(), batches.len(), 0];
    let total = 28 + lengths.iter().sum::<usize>() + glb.len();
    let words = [1, total].into_iter().chain(lengths).flat_map(|n| (n as u32).to_le_bytes());
    [b"b3dm", &words.collect::<Vec<u8>>()[..], features.as_bytes(), binary, batches, glb].concat()
}

pub fn import_tiles(folder: &Path) -> Result<SourceScene, String> {
    import_one(&folder.join("tileset.json"))
}

/// The tileset of one content in a folder of its own.
pub fn import_content(name: &str, bytes: &[u8]) -> Result<SourceScene, String> {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), name, bytes);
    write_json(folder.path(), "tileset.json", &tileset(json!({"refine": "ADD", "content": {"uri": name}})));
    import_tiles(folder.path())
}

/// A model that is told from others by its one triangle's size.
pub fn model(size: f32) -> Vec<u8> {
    let mut file = Writer::new();
    let positions = file.floats("VEC3", &[0.0, 0.0, 0.0, size, 0.0, 0.0, 0.0, size, 0.0]);
    let mesh = file.mesh(json!({"attributes": {"POSITION": positions}}));
    file.node(json!({"mesh": mesh}));
    file.glb()
}

/// Sizes of the models that are shown, with their places.
pub fn shown(scene: &SourceScene) -> Vec<(f64, [f64; 3])> {
    let placed = scene.placements.iter().map(|placement| {
        let m = placement.world_from_mesh;
        (scene.meshes[placement.mesh as usize].primitives[0].positions[1][0], [m[3], m[7], m[11]])
    });
    placed.collect()
}

pub fn sizes(scene: &SourceScene) -> Vec<f64> {
    shown(scene).into_iter().map(|(size, _)| size).collect()
}

/// `m`, column-major 4x4, applied to a point: the definition, written out.
pub fn apply(m: &[f64; 16], p: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|r| m[r] * p[0] + m[4 + r] * p[1] + m[8 + r] * p[2] + m[12 + r])
}

/// Earth-centred coordinates keep a nanometre: f64 has half of one at 6.4e6 m, and a handful of roundings.
#[test]
fn transforms_compose_and_turn_what_is_y_up() {
    let folder = tempfile::tempdir().unwrap();
    let center = [1215012.8828876337, -4736313.051199594, 4081605.2212604306];
    // The frame of east, north and up at a place near 40° north.
    let outer = [
        0.96863, 0.24849, 0.0, 0.0, -0.15986, 0.62314, 0.76559, 0.0, 0.19024, -0.74157, 0.64333, 0.0, center[0],
        center[1], center[2], 1.0,
    ];
    let inner = [0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 10.5, -20.25, 0.001, 1.0];
    let rtc = [0.125, 100.0, -7.5];
    let mut file = Writer::triangle();
    file.root["nodes"][0]["translation"] = json!([3.0, 4.0, 5.0]);
    let features = json!({"BATCH_LENGTH": 0, "RTC_CENTER": rtc}).to_string();
    write(folder.path(), "inner tile.b3dm", &b3dm(&file.glb(), &features, &[]));
    let child = json!({"transform": inner, "content": {"uri": "inner%20tile.b3dm"}, "geometricError": 0});
    write_json(
        folder.path(),
        "tileset.json",
        &tileset(json!({"transform": outer, "refine": "REPLACE", "children": [child]})),
    );
    let expected = |p: [f64; 3]| {
        let in_node = [p[0] + 3.0, p[1] + 4.0, p[2] + 5.0];
        let z_up = [in_node[0] + rtc[0], -in_node[2] + rtc[1], in_node[1] + rtc[2]];
        apply(&outer, apply(&inner, z_up))
    };
    let path = folder.path().join("tileset.json");
    let found = |up: Option<Up>, p: [f64; 3]| -> [f64; 3] {
        let scene = import_all(&[Input { up, ..Input::from(path.clone()) }]).unwrap();
        let m = scene.placements[0].world_from_mesh;
        std::array::from_fn(|r| m[4 * r] * p[0] + m[4 * r + 1] * p[1] + m[4 * r + 2] * p[2] + m[4 * r + 3])
    };
    let distance = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    for p in [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
        let [x, y, z] = expected(p);
        // The tileset's own axes, and what takes its Z to Y.
        assert!(distance(found(Some(Up::Y), p), [x, y, z]) < 1e-8, "{p:?}");
        assert!(distance(found(None, p), [x, z, -y]) < 1e-8, "{p:?}");
        // Controls: a model that is not turned, and coordinates in f32.
        let not_turned = apply(&outer, apply(&inner, std::array::from_fn(|k| p[k] + [3.0, 4.0, 5.0][k] + rtc[k])));
        assert!(distance(found(Some(Up::Y), p), not_turned) > 1.0);
        assert!(distance([x, y, z].map(|x| f64::from(x as f32)), [x, y, z]) > 1e-3);
    }
}

#[test]
fn centres_are_read_wherever_they_stand() {
    let place = |bytes: &[u8], name: &str| {
        let scene = import_content(name, bytes).unwrap_or_else(|e| panic!("{e}"));
        shown(&scene)[0].1
    };
    let glb = model(1.0);
    // In the binary part as f32; Z up turns to Y up at the end.
    let binary = le32(&[9.0, 1.5, 2.5, 3.5]);
    assert_eq!(place(&b3dm(&glb, r#"{"RTC_CENTER": {"byteOffset": 4}}"#, &binary), "a.b3dm"), [1.5, 3.5, -2.5]);
    assert_eq!(place(&b3dm(&glb, "", &[]), "a.b3dm"), [0.0; 3]);
    let mut file = Writer::triangle();
    file.root["extensionsUsed"] = json!(["CESIUM_RTC"]);
    file.root["extensionsRequired"] = json!(["CESIUM_RTC"]);
    file.root["extensions"] = json!({"CESIUM_RTC": {"center": [6378137.001, 2.0, 3.0]}});
    let scene = import_content("a.glb", &file.glb()).unwrap();
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    assert_eq!(shown(&scene)[0].1, [6378137.001, 3.0, -2.0]);
    // By itself, in its own axes.
    assert_eq!(shown(&file.scene())[0].1, [6378137.001, 2.0, 3.0]);
}

#[test]
fn the_axis_of_models_may_be_stated() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.glb", &Writer::triangle().glb());
    for (axis, up) in [("X", [0.0, 0.0, 1.0]), ("Y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])] {
        let mut set = tileset(json!({"refine": "ADD", "content": {"url": "a.glb"}}));
        set["asset"] = json!({"version": "1.0", "gltfUpAxis": axis});
        write_json(folder.path(), "tileset.json", &set);
        let scene = import_tiles(folder.path()).unwrap();
        let m = scene.placements[0].world_from_mesh;
        let own = match axis {
            "X" => [1.0, 0.0, 0.0],
            _ => up,
        };
        // The axis that points up in the model points up in the world.
        let world: [f64; 3] = std::array::from_fn(|r| (0..3).map(|k| m[4 * r + k] * own[k]).sum());
        assert_eq!(world, [0.0, 1.0, 0.0], "{axis}");
        let determinant = m[0] * (m[5] * m[10] - m[6] * m[9]) - m[1] * (m[4] * m[10] - m[6] * m[8])
            + m[2] * (m[4] * m[9] - m[5] * m[8]);
        assert_eq!(determinant, 1.0, "{axis}");
    }
}

#[test]
fn the_finest_tiles_are_shown() {
    let folder = tempfile::tempdir().unwrap();
    for size in 1..=6 {
        write(folder.path(), &format!("{size}.glb"), &model(size as f32));
    }
    let tile =
        |size: u32, children: Vec<Value>| json!({"content": {"uri": format!("{size}.glb")}, "children": children});
    let shows = |root: Value| {
        write_json(folder.path(), "tileset.json", &tileset(root));
        sizes(&import_tiles(folder.path()).unwrap_or_else(|e| panic!("{e}")))
    };
    let refine = |mut tile: Value, refine: &str| {
        tile["refine"] = json!(refine);
        tile
    };
    let tree = tile(1, vec![tile(2, vec![tile(3, vec![])]), tile(4, vec![])]);
    assert_eq!(shows(refine(tree.clone(), "REPLACE")), [3.0, 4.0]);
    assert_eq!(shows(refine(tree.clone(), "ADD")), [1.0, 2.0, 3.0, 4.0]);
    let mut mixed = refine(tree, "ADD");
    mixed["children"][0]["refine"] = json!("REPLACE");
    assert_eq!(shows(mixed), [1.0, 3.0, 4.0]);
    // Children without content replace nothing.
    let empty = json!({"children": [{"children": []}]});
    assert_eq!(shows(refine(tile(5, vec![empty]), "REPLACE")), [5.0]);
    let several = json!({"refine": "ADD", "contents": [{"uri": "6.glb"}, {"uri": "2.glb"}]});
    assert_eq!(shows(several), [6.0, 2.0]);
    let extension = json!({"3DTILES_multiple_contents": {"content": [{"uri": "3.glb"}]}});
    assert_eq!(shows(json!({"refine": "ADD", "extensions": extension})), [3.0]);
}

#[test]
fn models_that_several_tiles_show_are_stored_once() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.glb", &model(1.0));
    write(folder.path(), "b.glb", &model(2.0));
    let at = |uri: &str, x: f64| {
        let transform = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, 0.0, 0.0, 1.0];
        json!({"transform": transform, "content": {"uri": uri}})
    };
    let children = [at("a.glb", 1.0), at("b.glb", 2.0), at("./x/../a.glb", 3.0)];
    write_json(folder.path(), "tileset.json", &tileset(json!({"refine": "ADD", "children": children})));
    let scene = import_tiles(folder.path()).unwrap();
    assert_eq!((scene.meshes.len(), scene.sources.len()), (2, 3));
    let places: Vec<_> = shown(&scene).into_iter().map(|(size, at)| (size, at[0])).collect();
    assert_eq!(places, [(1.0, 1.0), (1.0, 3.0), (2.0, 2.0)]);
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let names: Vec<_> = scene.sources.iter().map(|source| source.name.as_str()).collect();
    assert_eq!(names, ["tileset.json", "a.glb", "b.glb"]);
}

/// Two tiles that show a model at one place show it once: the copies coincide, and their ids would differ.
#[test]
fn models_at_one_place_are_taken_once() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "a.glb", &model(1.0));
    let at = |x: f64| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, x, 0.0, 0.0, 1.0];
    // A parent that adds, a child at the same place, one by another way, and others beside it.
    let child = |x: f64| json!({"transform": at(x), "content": {"uri": "a.glb"}});
    let split = json!({"transform": at(-3.0), "children": [child(3.0)]});
    let root = json!({"refine": "ADD", "content": {"uri": "a.glb"},
        "children": [child(0.0), child(-0.0), split, child(1e-9), child(5.0)]});
    write_json(folder.path(), "tileset.json", &tileset(root));
    let scene = import_tiles(folder.path()).unwrap();
    let places: Vec<f64> = shown(&scene).into_iter().map(|(_, at)| at[0]).collect();
    assert_eq!(places, [0.0, 1e-9, 5.0]);
    let [warning] = &scene.warnings[..] else { panic!("{:?}", scene.warnings) };
    assert!(warning.ends_with("3 times tiles show a model where it is shown already; each place is taken once"));
    // By replacement neither the parent nor what is there twice remains.
    let root = json!({"refine": "REPLACE", "content": {"uri": "a.glb"}, "children": [child(0.0), child(0.0)]});
    write_json(folder.path(), "tileset.json", &tileset(root));
    assert_eq!(sizes(&import_tiles(folder.path()).unwrap()), [1.0]);
}

#[test]
fn external_tilesets_are_followed() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("sub/deep")).unwrap();
    write(folder.path(), "a.glb", &model(1.0));
    write(folder.path(), "sub/b.glb", &model(2.0));
    let shift = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 100.0, 0.0, 0.0, 1.0];
    let root = json!({"refine": "REPLACE", "content": {"uri": "a.glb"},
        "children": [{"transform": shift, "content": {"uri": "sub/tiles.json"}}]});
    write_json(folder.path(), "tileset.json", &tileset(root));
    let children = [json!({"content": {"uri": "b.glb"}}), json!({"content": {"uri": "deep/more.json"}})];
    write_json(folder.path(), "sub/tiles.json", &tileset(json!({"refine": "ADD", "children": children})));
    write_json(
        folder.path(),
        "sub/deep/more.json",
        &tileset(json!({"refine": "ADD", "transform": shift, "content": {"uri": "../../a.glb"}})),
    );
    let scene = import_tiles(folder.path()).unwrap_or_else(|e| panic!("{e}"));
    let mut places = shown(&scene);
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    assert_eq!(places, [(1.0, [200.0, 0.0, 0.0]), (2.0, [100.0, 0.0, 0.0])]);

    // Round in a circle, by way of others.
    write_json(folder.path(), "sub/deep/more.json", &tileset(json!({"content": {"uri": "../../tileset.json"}})));
    let error = import_tiles(folder.path()).unwrap_err();
    assert!(error.contains("tileset.json: tileset: refers to itself") && !error.contains('\n'), "{error}");
    write_json(folder.path(), "sub/deep/more.json", &tileset(json!({"content": {"uri": "../../../a.glb"}})));
    let error = import_tiles(folder.path()).unwrap_err();
    assert!(error.contains("more.json: content \"../../../a.glb\": the path leads out of the folder"), "{error}");

    // A chain longer than any that is meant.
    for i in 0..100 {
        let next = tileset(json!({"content": {"uri": format!("{}.json", i + 1)}}));
        write_json(folder.path(), &format!("{i}.json"), &next);
    }
    let error = import_one(&folder.path().join("0.json")).unwrap_err();
    assert!(error.contains("nested too deeply"), "{error}");
}

/// Each tileset refers to the next one twice: 2^30 tilesets of 30 files. Tiles without content, for which nothing is
/// read, bring their number to the limit soon; all files together have far fewer.
#[test]
fn tilesets_that_multiply_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for i in 0..30 {
        let next = json!({"content": {"uri": format!("{}.json", i + 1)}});
        let children: Vec<Value> = vec![json!({}); 1000].into_iter().chain([next.clone(), next]).collect();
        write_json(folder.path(), &format!("{i}.json"), &tileset(json!({"children": children})));
    }
    write_json(folder.path(), "30.json", &tileset(json!({})));
    let error = import_one(&folder.path().join("0.json")).unwrap_err();
    assert!(error.contains("more than 4194304 tiles"), "{error}");
}

#[test]
fn what_is_not_read_is_named() {
    let error = |root: Value| {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "a.glb", &model(1.0));
        for kind in ["pnts", "cmpt", "subt", "what"] {
            write(folder.path(), &format!("a.{kind}"), &[kind.as_bytes(), &[0; 40]].concat());
        }
        write(folder.path(), "wrong.json", b"{\"asset\": 3}");
        write_json(folder.path(), "tileset.json", &root);
        let error = import_tiles(folder.path()).unwrap_err();
        assert!(!error.contains('\n') && error.contains(".json: ") && error.contains("; "), "{error}");
        error
    };
    let of_content = |uri: &str| error(tileset(json!({"content": {"uri": uri}})));
    for (uri, says) in [
        ("a.pnts", "content \"a.pnts\": point clouds (pnts) are not read"),
        ("a.cmpt", "composite tiles (cmpt) are not read"),
        ("a.subt", "it is a subtree, which implicitTiling must name"),
        ("a.what", "neither glTF, b3dm, i3dm nor a tileset"),
        ("data:,a", "data URIs"),
        ("https://example.org/a.glb", "not a relative path"),
        ("wrong.json", "not a readable 3D Tiles tileset"),
    ] {
        assert!(of_content(uri).contains(says), "{uri}: {}", of_content(uri));
    }
    assert!(error(tileset(json!({"implicitTiling": {}}))).contains("missing field `subdivisionScheme`"));
    let mut projective = [0.0; 16];
    projective[3] = 1.0;
    assert!(error(tileset(json!({"transform": projective}))).contains("the last row of its transform is not 0 0 0 1"));
    assert!(error(tileset(json!({"refine": "BLEND"}))).contains("refine is \"BLEND\""));
    assert!(error(json!({"asset": {"version": "2.0"}, "root": {}})).contains("version \"2.0\" of 3D Tiles"));
    assert!(error(json!({"geometries": []})).contains("not a readable 3D Tiles tileset"));
    let mut requires = tileset(json!({}));
    requires["extensionsRequired"] = json!(["3DTILES_metadata", "3DTILES_bounding_volume_S2"]);
    assert!(error(requires).contains("requires 3DTILES_bounding_volume_S2"));
    let mut axis = tileset(json!({}));
    axis["asset"]["gltfUpAxis"] = json!("up");
    assert!(error(axis).contains("gltfUpAxis is \"UP\""));
    let missing = import_one(Path::new("/nonexistent/tileset.json")).unwrap_err();
    assert!(missing.contains("/nonexistent/tileset.json: cannot read the file"), "{missing}");
    let gone = error(tileset(json!({"content": {"uri": "a.json"}})));
    assert!(gone.contains("a.json: cannot read the file"), "{gone}");
}

#[test]
fn headers_of_batched_models_are_checked() {
    let whole = b3dm(&model(1.0), r#"{"BATCH_LENGTH": 0}"#, &[]);
    assert_eq!(sizes(&import_content("a.b3dm", &whole).unwrap()), [1.0]);
    let error = |bytes: &[u8]| {
        let error = import_content("a.b3dm", bytes).unwrap_err();
        assert!(error.contains("a.b3dm: ") && !error.contains('\n'), "{error}");
        error
    };
    for length in [5, 20, 27, 28, 60, whole.len() - 1] {
        error(&whole[..length]);
    }
    // Each length of the header, too large or too small.
    for field in 2..7 {
        for value in [u32::MAX, u32::MAX - 28, whole.len() as u32 + 1, 0] {
            let mut bytes = whole.clone();
            bytes[4 * field..4 * field + 4].copy_from_slice(&value.to_le_bytes());
            if bytes != whole {
                error(&bytes);
            }
        }
    }
    assert!(error(&b3dm(&model(1.0), r#"{"RTC_CENTER": [1, 2]}"#, &[])).contains("feature table cannot be read"));
    assert!(error(&b3dm(&model(1.0), r#"{"RTC_CENTER": {"byteOffset": 8}}"#, &[0; 16])).contains("outside"));
    let infinite = le32(&[f32::INFINITY; 3]);
    assert!(error(&b3dm(&model(1.0), r#"{"RTC_CENTER": {"byteOffset": 0}}"#, &infinite)).contains("not finite"));
    let mut version = whole;
    version[4] = 2;
    assert!(error(&version).contains("version 2 is not 1"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_tilesets_do_no_harm(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in any::<prop::sample::Index>(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), "a.glb", &model(1.0));
        let transform = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1e6, 0.0, 0.0, 1.0];
        let root = json!({"refine": "ADD", "transform": transform, "content": {"uri": "a.glb"},
            "children": [{"content": {"uri": "a.b3dm"}}, {"contents": [{"uri": "a.glb"}]}]});
        let set = tileset(root).to_string().into_bytes();
        let tile = b3dm(&model(2.0), r#"{"RTC_CENTER": [1, 2, 3]}"#, &[0; 12]);
        for (name, other, bytes) in [("tileset.json", "a.b3dm", &set), ("a.b3dm", "tileset.json", &tile)] {
            write(folder.path(), other, if name == "a.b3dm" { &set } else { &tile });
            let mut changed = bytes.clone();
            for (at, value) in &edits {
                *at.get_mut(&mut changed) = *value;
            }
            for bytes in [&changed[..], &bytes[..cut.index(bytes.len())]] {
                write(folder.path(), name, bytes);
                match import_tiles(folder.path()) {
                    Ok(scene) => prop_assert!(scene.placements.len() <= 3),
                    Err(error) => prop_assert!(!error.contains('\n'), "{}", error),
                }
            }
        }
    }
}
