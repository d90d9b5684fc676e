//! Implicit tilesets, written here tile by tile.

use super::tiles::*;
use super::writer::*;
use proptest::prelude::*;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::Path;

/// A tile: level, and place on each axis.
type Cell = (u32, [u64; 3]);

/// What tiles there are, and which have contents; of a tree that splits `axes` axes.
struct Tree {
    axes: u32,
    levels: u32,
    subtree_levels: u32,
    tiles: BTreeSet<Cell>,
    /// One set for each content of a tile.
    contents: Vec<BTreeSet<Cell>>,
}

/// How subtrees are written.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    /// A binary file.
    Binary,
    /// A JSON file, bits in other files.
    Json,
    /// A JSON file, bits in data URIs; names of drafts.
    Draft,
}

impl Tree {
    /// A random one, the same for each seed.
    fn random(axes: u32, levels: u32, subtree_levels: u32, contents: usize, seed: u64) -> Self {
        let mut state = seed;
        let mut chance = |percent: u64| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 33) % 100 < percent
        };
        let mut tree =
            Self { axes, levels, subtree_levels, tiles: BTreeSet::new(), contents: vec![BTreeSet::new(); contents] };
        let mut next = vec![(0, [0; 3])];
        while let Some(cell) = next.pop() {
            tree.tiles.insert(cell);
            for content in &mut tree.contents {
                if chance(60) {
                    content.insert(cell);
                }
            }
            if cell.0 + 1 < levels {
                next.extend(tree.children(cell).filter(|_| chance(45)));
            }
        }
        tree
    }

    fn children(&self, (level, at): Cell) -> impl Iterator<Item = Cell> + use<> {
        let side = |axis: u32| if axis < self.axes { 0..2 } else { 0..1 };
        let [x, y, z] = [side(0), side(1), side(2)];
        let each = x.flat_map(move |i| {
            y.clone().flat_map({
                let z = z.clone();
                move |j| z.clone().map(move |k| [i, j, k])
            })
        });
        each.map(move |half: [u64; 3]| (level + 1, std::array::from_fn(|axis| 2 * at[axis] + half[axis])))
    }

    /// The number of each model: content, level and place, told from its triangle's size.
    fn size(content: usize, (level, at): Cell) -> f64 {
        1.0 + content as f64 * 4096.0 + f64::from(level) * 512.0 + (at[0] * 64 + at[1] * 8 + at[2]) as f64
    }

    /// Sizes of the models that are shown.
    fn expected(&self, replaces: bool) -> Vec<f64> {
        let below = |above: Cell, cell: Cell| {
            cell.0 > above.0 && (0..3).all(|axis| cell.1[axis] >> (cell.0 - above.0) == above.1[axis])
        };
        let has_content = |cell: &Cell| self.contents.iter().any(|content| content.contains(cell));
        let is_shown =
            |cell: Cell| !replaces || !self.tiles.iter().any(|&other| below(cell, other) && has_content(&other));
        let mut sizes: Vec<f64> = Vec::new();
        for (number, content) in self.contents.iter().enumerate() {
            sizes.extend(content.iter().filter(|&&cell| is_shown(cell)).map(|&cell| Self::size(number, cell)));
        }
        sizes.sort_by(f64::total_cmp);
        sizes
    }

    /// The place of a tile in the bits of the subtree of `root`: level by level, x in the lowest bit of each group.
    fn number(&self, root: Cell, cell: Cell) -> usize {
        let depth = cell.0 - root.0;
        let local: [u64; 3] = std::array::from_fn(|axis| cell.1[axis] - (root.1[axis] << depth));
        let mut number = 0;
        for bit in 0..depth {
            for axis in 0..self.axes {
                number |= (local[axis as usize] >> bit & 1) << (bit * self.axes + axis);
            }
        }
        let before: u64 = (0..depth).map(|level| 1u64 << (level * self.axes)).sum();
        (before + number) as usize
    }

    fn bits(count: usize, set: impl Iterator<Item = usize>) -> Vec<u8> {
        let mut bytes = vec![0; count.div_ceil(8)];
        set.for_each(|bit| bytes[bit / 8] |= 1 << (bit % 8));
        bytes
    }

    /// Bits of the subtree of `root`: of tiles, of child subtrees, of contents.
    fn subtree(&self, root: Cell) -> Vec<Vec<u8>> {
        let levels = self.subtree_levels;
        let count = (0..levels).map(|level| 1usize << (level * self.axes)).sum();
        let inside = |cell: &&Cell, depths: std::ops::Range<u32>| {
            cell.0 >= root.0
                && depths.contains(&(cell.0 - root.0))
                && (0..3).all(|axis| cell.1[axis] >> (cell.0 - root.0) == root.1[axis])
        };
        let of = |set: &BTreeSet<Cell>| {
            Self::bits(count, set.iter().filter(|cell| inside(cell, 0..levels)).map(|&cell| self.number(root, cell)))
        };
        let next = self.tiles.iter().filter(|cell| inside(cell, levels..levels + 1));
        // Without the levels above.
        let children = next.map(|&cell| self.number(root, cell) - count);
        let children = Self::bits(1 << (levels * self.axes), children);
        [of(&self.tiles), children].into_iter().chain(self.contents.iter().map(of)).collect()
    }

    /// Writes subtrees, models and the tileset.
    fn write(&self, folder: &Path, form: Form, refine: &str) {
        let z = if self.axes == 3 { "/{z}" } else { "" };
        let place = |(level, [x, y, z]): Cell| match self.axes {
            3 => format!("{level}/{x}/{y}/{z}"),
            _ => format!("{level}/{x}/{y}"),
        };
        let put = |name: String, bytes: &[u8]| {
            std::fs::create_dir_all(folder.join(&name).parent().unwrap()).unwrap();
            write(folder, &name, bytes);
        };
        for (number, content) in self.contents.iter().enumerate() {
            for &cell in content {
                put(format!("c{number}/{}.glb", place(cell)), &model(Self::size(number, cell) as f32));
            }
        }
        for &root in self.tiles.iter().filter(|cell| cell.0.is_multiple_of(self.subtree_levels)) {
            let bits = self.subtree(root);
            let name = format!("subtrees/{}.subtree", place(root));
            match form {
                Form::Binary => put(name, &binary_subtree(&bits, 1)),
                Form::Json | Form::Draft => {
                    let json = json_subtree(&bits, form, |index, bytes| {
                        put(format!("subtrees/{}.{index}.bin", place(root)), bytes);
                        format!("{}.{index}.bin", place(root).rsplit('/').next().unwrap())
                    });
                    put(name, json.to_string().as_bytes());
                }
            }
        }
        let scheme = if self.axes == 3 { "OCTREE" } else { "QUADTREE" };
        let mut implicit = json!({"subdivisionScheme": scheme, "subtreeLevels": self.subtree_levels,
            "subtrees": {"uri": format!("subtrees/{{level}}/{{x}}/{{y}}{z}.subtree")}});
        let uris: Vec<Value> = (0..self.contents.len())
            .map(|number| json!({"uri": format!("c{number}/{{level}}/{{x}}/{{y}}{z}.glb")}))
            .collect();
        let root = if form == Form::Draft {
            implicit["maximumLevel"] = json!(self.levels - 1);
            let multiple = json!({"content": uris});
            json!({"refine": refine, "extensions": {
                "3DTILES_implicit_tiling": implicit, "3DTILES_multiple_contents": multiple}})
        } else {
            implicit["availableLevels"] = json!(self.levels);
            match &uris[..] {
                [uri] => json!({"refine": refine, "content": uri, "implicitTiling": implicit}),
                _ => json!({"refine": refine, "contents": uris, "implicitTiling": implicit}),
            }
        };
        write_json(folder, "tileset.json", &tileset(root));
    }
}

/// JSON that refers to bits of tiles, child subtrees and contents in views of these numbers.
fn availability(contents: usize, name: &str) -> Value {
    let one = |view: usize| json!({name: view, "availableCount": 3});
    json!({"tileAvailability": one(0), "childSubtreeAvailability": one(1),
        "contentAvailability": (0..contents).map(|content| one(2 + content)).collect::<Vec<_>>()})
}

/// A binary subtree; bits lie in the binary chunk, `padding` bytes apart.
fn binary_subtree(bits: &[Vec<u8>], padding: usize) -> Vec<u8> {
    let (mut binary, mut views) = (Vec::new(), Vec::new());
    for bits in bits {
        binary.resize(binary.len() + padding, 0xff);
        views.push(json!({"buffer": 0, "byteOffset": binary.len(), "byteLength": bits.len()}));
        binary.extend(bits);
    }
    let mut json = availability(bits.len() - 2, "bitstream");
    json["buffers"] = json!([{"byteLength": binary.len()}]);
    json["bufferViews"] = json!(views);
    chunked(&json, &binary)
}

/// A binary file of JSON and bits.
fn chunked(json: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(8), b' ');
    let mut file = b"subt\x01\0\0\0".to_vec();
    file.extend((text.len() as u64).to_le_bytes());
    file.extend((binary.len() as u64).to_le_bytes());
    [file, text, binary.to_vec()].concat()
}

fn json_subtree(bits: &[Vec<u8>], form: Form, put: impl Fn(usize, &[u8]) -> String) -> Value {
    let uri = |(index, bytes): (usize, &Vec<u8>)| match form {
        Form::Draft => {
            let text: String = bytes.iter().map(|byte| format!("%{byte:02x}")).collect();
            json!({"uri": format!("data:,{text}"), "byteLength": bytes.len()})
        }
        _ => json!({"uri": put(index, bytes), "byteLength": bytes.len()}),
    };
    let mut json = availability(bits.len() - 2, if form == Form::Draft { "bufferView" } else { "bitstream" });
    json["buffers"] = bits.iter().enumerate().map(uri).collect();
    json["bufferViews"] = (0..bits.len()).map(|i| json!({"buffer": i, "byteLength": bits[i].len()})).collect();
    if form == Form::Draft {
        let contents = json["contentAvailability"].take();
        json["contentAvailability"] = contents[0].clone();
        if bits.len() > 3 {
            json["extensions"] = json!({"3DTILES_multiple_contents": {"contentAvailability": contents}});
        }
    }
    json
}

fn sorted(folder: &Path) -> Vec<f64> {
    let mut found = sizes(&import_tiles(folder).unwrap_or_else(|e| panic!("{e}")));
    found.sort_by(f64::total_cmp);
    found
}

#[test]
fn the_tiles_that_bits_say_are_shown() {
    for (axes, levels, subtree_levels, contents) in
        [(2, 5, 2, 1), (2, 4, 3, 2), (2, 3, 4, 1), (3, 3, 1, 1), (3, 4, 2, 2), (3, 2, 2, 3)]
    {
        let first = u64::from(axes * 100 + levels * 10) + 7;
        let mut trees = (first..).map(|seed| Tree::random(axes, levels, subtree_levels, contents, seed));
        // One with some tiles, of which some replace others.
        let is_varied = |tree: &Tree| tree.tiles.len() > 4 && tree.expected(true) != tree.expected(false);
        let tree = trees.by_ref().take(1000).find(is_varied).expect("a tree of some tiles");
        for form in [Form::Binary, Form::Json, Form::Draft] {
            let folder = tempfile::tempdir().unwrap();
            for (refine, replaces) in [("ADD", false), ("REPLACE", true)] {
                tree.write(folder.path(), form, refine);
                let (found, expected) = (sorted(folder.path()), tree.expected(replaces));
                assert_eq!(found, expected, "{axes} axes, {levels} levels, {form:?}, {refine}");
            }
            // What was read is listed once: models of one name in several folders differ in what they hold.
            let sources = import_tiles(folder.path()).unwrap().sources;
            let read: BTreeSet<_> = sources.iter().map(|source| (&source.name, &source.hash)).collect();
            assert_eq!(read.len(), sources.len());
            let names: BTreeSet<&str> = sources.iter().map(|source| source.name.as_str()).collect();
            assert!(names.iter().any(|name| name.ends_with("0/0/0.subtree") || name.ends_with("0/0/0/0.subtree")));
        }
    }
}

/// An implicit tileset below an explicit tile, with a transformation; constants in place of bits.
#[test]
fn constants_stand_for_bits() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("s")).unwrap();
    let constant = |bit: u8| json!({"constant": bit});
    let subtree = |tiles: u8, contents: u8, children: u8| {
        json!({"tileAvailability": constant(tiles), "contentAvailability": [constant(contents)],
            "childSubtreeAvailability": constant(children)})
    };
    write(folder.path(), "s/a.glb", &model(3.0));
    let implicit = json!({"subdivisionScheme": "QUADTREE", "subtreeLevels": 2, "availableLevels": 3,
        "subtrees": {"uri": "s/{level}.json"}});
    let shift = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 7.0, 8.0, 9.0, 1.0];
    let child = json!({"transform": shift, "content": {"uri": "s/a.glb"}, "implicitTiling": implicit});
    write_json(folder.path(), "tileset.json", &tileset(json!({"refine": "ADD", "children": [child]})));
    let shows = |root: Value, next: Value| {
        write(folder.path(), "s/0.json", root.to_string().as_bytes());
        write(folder.path(), "s/2.json", next.to_string().as_bytes());
        import_tiles(folder.path())
    };
    // One template for all tiles: they show one model at one place, 1 + 4 + 16 times.
    let scene = shows(subtree(1, 1, 1), subtree(1, 1, 1)).unwrap();
    assert_eq!(shown(&scene), [(3.0, [7.0, 9.0, -8.0])]);
    assert!(scene.warnings.iter().any(|line| line.contains("20 times")), "{:?}", scene.warnings);
    let scene = shows(subtree(1, 1, 0), subtree(1, 1, 0)).unwrap();
    assert!(scene.warnings.iter().any(|line| line.contains("4 times")), "{:?}", scene.warnings);
    assert!(shown(&shows(subtree(1, 0, 0), json!({})).unwrap()).is_empty());
    assert!(shown(&shows(subtree(0, 1, 1), json!({})).unwrap()).is_empty());
    let error = shows(subtree(1, 1, 1), json!({})).unwrap_err();
    assert!(error.contains("2.json: subtree: its JSON cannot be read: missing field"), "{error}");
    let error = shows(subtree(2, 1, 1), json!({})).unwrap_err();
    assert!(error.contains("the availability of tiles is neither a bitstream nor a constant"), "{error}");
    std::fs::remove_file(folder.path().join("s/2.json")).unwrap();
    write(folder.path(), "s/0.json", subtree(1, 0, 1).to_string().as_bytes());
    let error = import_tiles(folder.path()).unwrap_err();
    assert!(error.contains("s/2.json: cannot read the file"), "{error}");
}

#[test]
fn trees_that_cannot_be_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    write(
        folder.path(),
        "all.json",
        br#"{"tileAvailability": {"constant": 1}, "childSubtreeAvailability": {"constant": 1}}"#,
    );
    let error = |change: &dyn Fn(&mut Value)| {
        let mut root = json!({"content": {"uri": "a.glb"}, "implicitTiling": {"subdivisionScheme": "OCTREE",
            "subtreeLevels": 3, "availableLevels": 4, "subtrees": {"uri": "all.json"}}});
        change(&mut root);
        write_json(folder.path(), "tileset.json", &tileset(root));
        let error = import_tiles(folder.path()).unwrap_err();
        assert!(error.contains("tileset.json: ") && !error.contains('\n'), "{error}");
        error
    };
    let set = |key: &'static str, value: Value| move |root: &mut Value| root["implicitTiling"][key] = value.clone();
    assert!(error(&set("subdivisionScheme", json!("BINARY"))).contains("subdivisionScheme is \"BINARY\""));
    assert!(error(&set("subtreeLevels", json!(0))).contains("subtreeLevels is 0, not 1 to 16"));
    assert!(error(&set("subtreeLevels", json!(17))).contains("subtreeLevels is 17"));
    assert!(error(&set("availableLevels", json!(0))).contains("availableLevels is 0, not 1 to 48"));
    assert!(error(&set("availableLevels", json!(4_000_000_000u32))).contains("availableLevels is 4000000000"));
    assert!(error(&set("availableLevels", Value::Null)).contains("availableLevels is missing"));
    assert!(error(&set("subtrees", json!({"uri": "../{x}.subtree"}))).contains("leads out of the folder"));
    assert!(error(&|root| root["children"] = json!([{}])).contains("lists children, too"));
    // 8^15 tiles of a file of a hundred bytes.
    assert!(error(&set("availableLevels", json!(16))).contains("more than 4194304 tiles"));
    // A tileset as the content of a tile would multiply them.
    let with = br#"{"tileAvailability": {"constant": 1}, "contentAvailability": [{"constant": 1}],
        "childSubtreeAvailability": {"constant": 0}}"#;
    write(folder.path(), "with.json", with);
    write_json(folder.path(), "other.json", &tileset(json!({})));
    let found = error(&|root| {
        root["content"]["uri"] = json!("other.json");
        root["implicitTiling"]["subtrees"]["uri"] = json!("with.json");
    });
    assert!(found.contains("an implicit tile shows a tileset"), "{found}");
}

#[test]
fn subtrees_are_checked() {
    let tree = Tree::random(2, 3, 3, 1, 5);
    let folder = tempfile::tempdir().unwrap();
    tree.write(folder.path(), Form::Binary, "ADD");
    let bits = tree.subtree((0, [0; 3]));
    let error = |bytes: &[u8]| {
        write(folder.path(), "subtrees/0/0/0.subtree", bytes);
        let error = import_tiles(folder.path()).unwrap_err();
        assert!(error.contains("subtrees/0/0/0.subtree: subtree: ") && !error.contains('\n'), "{error}");
        error
    };
    let whole = binary_subtree(&bits, 0);
    for length in [0, 3, 4, 23, 24, 60, whole.len() - 1] {
        error(&whole[..length]);
    }
    let with = |change: &dyn Fn(&mut Value)| {
        let mut json = availability(1, "bitstream");
        json["buffers"] = json!([{"byteLength": 64}]);
        json["bufferViews"] = json!([{"buffer": 0, "byteLength": 8}, {"buffer": 0, "byteLength": 8},
            {"buffer": 0, "byteLength": 8}]);
        change(&mut json);
        error(&chunked(&json, &[0xff; 64]))
    };
    assert!(with(&|j| j["bufferViews"][0]["byteLength"] = json!(2)).contains("tiles: 2 bytes are too few for 21 bits"));
    assert!(with(&|j| j["bufferViews"][1]["byteOffset"] = json!(60)).contains("lies outside the buffer"));
    assert!(with(&|j| j["bufferViews"][1]["byteOffset"] = json!(u64::MAX)).contains("lies outside the buffer"));
    assert!(with(&|j| j["bufferViews"][2]["buffer"] = json!(1)).contains("contents: there is no buffer 1"));
    assert!(with(&|j| j["tileAvailability"]["bitstream"] = json!(9)).contains("there is no buffer view 9"));
    assert!(with(&|j| j["buffers"][0]["uri"] = json!("gone.bin")).contains("gone.bin: cannot read the file"));
    assert!(with(&|j| j["buffers"][0]["uri"] = json!("../../../../up.bin")).contains("leads out of the folder"));
    let mut version = whole;
    version[4] = 3;
    assert!(error(&version).contains("version 3 is not 1"));
    let without = br#"{"tileAvailability": {"bitstream": 0}, "buffers": [{}],
        "bufferViews": [{"buffer": 0, "byteLength": 3}], "childSubtreeAvailability": {"constant": 0}}"#;
    assert!(error(without).contains("has neither URI nor binary chunk"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_subtrees_do_no_harm(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in any::<prop::sample::Index>(),
    ) {
        let tree = Tree::random(2, 3, 2, 1, 11);
        let folder = tempfile::tempdir().unwrap();
        tree.write(folder.path(), Form::Binary, "ADD");
        let whole = binary_subtree(&tree.subtree((0, [0; 3])), 0);
        let mut changed = whole.clone();
        for (at, value) in &edits {
            *at.get_mut(&mut changed) = *value;
        }
        for bytes in [&changed[..], &whole[..cut.index(whole.len())]] {
            write(folder.path(), "subtrees/0/0/0.subtree", bytes);
            match import_tiles(folder.path()) {
                Ok(scene) => prop_assert!(scene.placements.len() <= 21),
                Err(error) => prop_assert!(!error.contains('\n'), "{}", error),
            }
        }
    }
}
