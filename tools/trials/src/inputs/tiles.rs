//! Sets of 3D Tiles: a tileset with models, batched and instanced ones, other tilesets, and implicit subtrees.

use super::gltf::Asset;
use super::{Files, Format, Verdict, imported, le16, le32};
use crate::kind::Fault;
use crate::mutate::{Harm, bytes::word, chunks};
use crate::random::Random;
use serde_json::{Value, json};
use std::path::Path;

/// Keys and texts of tilesets.
const NAMES: &[&str] = &[
    "asset",
    "version",
    "0.0",
    "1.0",
    "1.1",
    "root",
    "children",
    "content",
    "contents",
    "uri",
    "url",
    "transform",
    "refine",
    "ADD",
    "REPLACE",
    "geometricError",
    "boundingVolume",
    "box",
    "region",
    "sphere",
    "implicitTiling",
    "subdivisionScheme",
    "QUADTREE",
    "OCTREE",
    "subtreeLevels",
    "availableLevels",
    "maximumLevel",
    "subtrees",
    "extensions",
    "extensionsRequired",
    "3DTILES_implicit_tiling",
    "3DTILES_multiple_contents",
    "3DTILES_content_gltf",
    "a.glb",
    "b.b3dm",
    "c.i3dm",
    "other.json",
    "tileset.json",
    "s/{level}/{x}/{y}.subtree",
    "m/{level}/{x}/{y}.glb",
    "tileAvailability",
    "constant",
    "bitstream",
    "RTC_CENTER",
    "BATCH_LENGTH",
    "INSTANCES_LENGTH",
    "POSITION",
    "byteOffset",
    "POSITION_QUANTIZED",
    "NORMAL_UP",
    "NORMAL_RIGHT_OCT32P",
    "gltfUpAxis",
    "SCALE",
    "EAST_NORTH_UP",
];

/// A tileset.
pub struct Tiles;

/// A model of a few triangles as GLB.
fn model(random: &mut Random) -> Vec<u8> {
    let mut asset = Asset::random(random, Harm::of(0));
    asset.with_buffer(None);
    chunks::glb(asset.root.to_string().as_bytes(), &asset.binary)
}

/// A tile's file with the header of batched or instanced models: magic, words, JSON and binary of both tables, body.
fn wrapped(
    (random, harm): (&mut Random, Harm),
    magic: &[u8; 4],
    (features, binary): (Value, Vec<u8>),
    format: Option<u32>,
    body: Vec<u8>,
) -> Vec<u8> {
    let (mut features, mut binary) = (features, binary);
    harm.json(random, &mut features, NAMES, 30);
    harm.bytes(random, &mut binary, 20);
    let mut features = features.to_string().into_bytes();
    let head = 24 + 4 * (1 + usize::from(format.is_some()));
    features.resize((head + features.len()).next_multiple_of(8) - head, b' ');
    let batches = br#"{"id":[1]}      "#;
    let total = head + features.len() + binary.len() + batches.len() + body.len();
    let lengths = [1, total, features.len(), binary.len(), batches.len(), 0].map(|n| n as u32);
    let mut words: Vec<u32> = lengths.into_iter().chain(format).collect();
    if harm.does(random, 20) {
        let at = random.below(words.len());
        words[at] = word(random) as u32;
    }
    let words = words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>();
    [magic, &words[..], &features, &binary, batches, &body].concat()
}

/// Where two instances stand, in one of the ways that there are: the feature table and its binary part.
fn instances(random: &mut Random) -> (Value, Vec<u8>) {
    let mut features = json!({"INSTANCES_LENGTH": 2, "EAST_NORTH_UP": random.chance(30)});
    let mut binary = Vec::new();
    let mut put = |name: &str, bytes: Vec<u8>, features: &mut Value| {
        // Floats lie at multiples of four.
        binary.resize(binary.len().next_multiple_of(4), 0);
        features[name] = json!({"byteOffset": binary.len()});
        binary.extend(bytes);
    };
    if random.chance(60) {
        put("POSITION", le32(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), &mut features);
    } else {
        put("POSITION_QUANTIZED", le16(&[0, 65535, 9, 7, 300, 40_000]), &mut features);
        features["QUANTIZED_VOLUME_OFFSET"] = json!([-1, 2, 3]);
        features["QUANTIZED_VOLUME_SCALE"] = json!([10, 20, 0.5]);
    }
    match random.below(4) {
        0 => {
            put("NORMAL_UP", le32(&[0.0, 1.0, 0.0, 0.0, 0.0, 1.0]), &mut features);
            put("NORMAL_RIGHT", le32(&[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]), &mut features);
        }
        1 => {
            put("NORMAL_UP_OCT32P", le16(&[32_768, 65_535, 0, 32_768]), &mut features);
            put("NORMAL_RIGHT_OCT32P", le16(&[65_535, 32_768, 32_768, 0]), &mut features);
        }
        _ => {}
    }
    match random.below(3) {
        0 => put("SCALE", le32(&[2.0, 0.5]), &mut features),
        1 => put("SCALE_NON_UNIFORM", le32(&[2.0, 0.5, 1.0, 1.0, 3.0, 1.0]), &mut features),
        _ => {}
    }
    if random.chance(20) {
        features["RTC_CENTER"] = json!([100, 0, -5]);
    }
    (features, binary)
}

/// A subtree in binary form, of as many levels: every second tile of a level is there, with content.
fn subtree(random: &mut Random, harm: Harm, levels: usize) -> Vec<u8> {
    let tiles: Value = if levels == 1 { json!({"constant": 1}) } else { json!({"bitstream": 0}) };
    let mut json = json!({"buffers": [{"byteLength": 8}], "bufferViews": [{"buffer": 0, "byteOffset": 0,
        "byteLength": 1}], "tileAvailability": tiles, "contentAvailability": [{"bitstream": 0}],
        "childSubtreeAvailability": {"constant": 0}});
    let bits = if levels == 1 { 1 } else { 0b01011 };
    harm.json(random, &mut json, NAMES, 40);
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(8), b' ');
    let mut bits = vec![bits, 0, 0, 0, 0, 0, 0, 0];
    harm.bytes(random, &mut bits, 20);
    let lengths = [json.len() as u64, bits.len() as u64].map(u64::to_le_bytes).concat();
    let mut file = [b"subt", &1u32.to_le_bytes()[..], &lengths, &json, &bits].concat();
    harm.bytes(random, &mut file, 15);
    file
}

impl Format for Tiles {
    const NAME: &'static str = "inputs/tiles";
    const ABOUT: &'static str = "Sets of 3D Tiles: explicit and implicit trees, b3dm, i3dm, subtrees, sets within sets";

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let mut others = vec![("a.glb".to_owned(), model(random))];
        let mut children = vec![json!({"content": {"uri": "a.glb"}, "geometricError": 1})];
        if random.chance(40) {
            let (features, body) = (json!({"BATCH_LENGTH": 0, "RTC_CENTER": [1, 2, 3]}), model(random));
            others.push(("b.b3dm".into(), wrapped((random, harm), b"b3dm", (features, Vec::new()), None, body)));
            children.push(json!({"content": {"url": "b.b3dm"}, "refine": "ADD"}));
        }
        if random.chance(40) {
            let (features, binary) = instances(random);
            let (format, body) = match random.chance(50) {
                true => (1, model(random)),
                false => (0, b"a.glb   ".to_vec()),
            };
            let file = wrapped((random, harm), b"i3dm", (features, binary), Some(format), body);
            others.push(("c.i3dm".into(), file));
            children.push(json!({"contents": [{"uri": "c.i3dm"}]}));
        }
        if random.chance(25) {
            let mut other = json!({"asset": {"version": "1.0"}, "geometricError": 9,
                "root": {"content": {"uri": "a.glb"}, "refine": "REPLACE"}});
            if harm.does(random, 5) {
                other["root"]["content"]["uri"] = json!(random.pick(["other.json", "tileset.json"]));
            }
            harm.json(random, &mut other, NAMES, 40);
            others.push(("other.json".into(), other.to_string().into_bytes()));
            children.push(json!({"content": {"uri": "other.json"}}));
        }
        if random.chance(40) {
            let levels = random.within(1, 2);
            children.push(json!({"refine": "ADD", "content": {"uri": "m/{level}/{x}/{y}.glb"}, "implicitTiling": {
                "subdivisionScheme": "QUADTREE", "subtreeLevels": levels, "availableLevels": levels,
                "subtrees": {"uri": "s/{level}/{x}/{y}.subtree"}}}));
            others.push(("s/0/0/0.subtree".into(), subtree(random, harm, levels)));
            // In the order of Morton: the root, and of its children the first and the third.
            for at in ["0/0/0", "1/0/0", "1/0/1"].iter().take(if levels == 1 { 1 } else { 3 }) {
                others.push((format!("m/{at}.glb"), model(random)));
            }
        }
        let shift = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 10, 0, 0, 1];
        if random.chance(10) {
            let magic = random.pick([b"pnts", b"cmpt", b"subt", b"vctr", b"geom", b"abcd"]);
            others.push(("d.bin".into(), [magic.as_slice(), &[0; 28]].concat()));
            if harm.does(random, 50) {
                children.push(json!({"content": {"uri": "d.bin"}}));
            }
        }
        let mut asset = json!({"version": "1.1"});
        if random.chance(20) {
            asset["gltfUpAxis"] = json!(random.pick(["X", "Y", "Z"]));
        }
        let mut root = json!({"asset": asset, "geometricError": 100,
            "root": {"refine": "ADD", "transform": shift, "geometricError": 50, "children": children}});
        harm.json(random, &mut root, NAMES, 60);
        let mut text = root.to_string().into_bytes();
        harm.bytes(random, &mut text, 10);
        if harm.does(random, 10) {
            let at = random.below(others.len());
            harm.bytes(random, &mut others[at].1, 100);
        }
        Files([vec![("tileset.json".to_owned(), text)], others].concat())
    }

    fn read(&self, random: &mut Random, files: &Files, folder: &Path) -> Result<Verdict, Fault> {
        imported::read(random, files, folder, imported::TRIANGLES_A_BYTE)
    }
}
