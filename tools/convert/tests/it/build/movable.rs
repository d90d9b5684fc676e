//! What is kept movable, and what moving it does to the resident part.

use super::scenes::*;
use bricks::{Error, PlaceError, Resident, SceneFile, TOP_LEAF, validate};
use brickwalk_convert::build::{BuildError, BuildSettings, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, SourceScene};
use std::collections::BTreeMap;

/// A floor, a thing on it, and a small one below the node "group"; the thing is where `matrix` says.
fn source(thing: [f64; 12]) -> SourceScene {
    let meshes = vec![
        mesh("floor", vec![sheet(20, 50.0)]),
        mesh("thing", vec![sheet(12, 2.0)]),
        mesh("small", vec![sheet(2, 1.0)]),
    ];
    let mut placements = vec![
        placement("floor", 0, IDENTITY),
        placement("thing", 1, thing),
        placement("lamp", 2, matrix(rotation(0.4, [1.0; 3]), [2.0, 3.0, 4.0])),
    ];
    placements[2].under = vec!["group".into()];
    scene(meshes, placements)
}

fn turned() -> [f64; 12] {
    matrix(rotation(0.7, [1.0, 2.0, 1.5]), [3.0, 1.0, -2.0])
}

fn built(source: SourceScene, movable: &[&str]) -> Result<Resident, BuildError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bricks");
    let movable = movable.iter().map(|&name| name.to_owned()).collect();
    let settings = BuildSettings { brick_triangles: 30, movable, ..BuildSettings::default() };
    build(source, &settings, &path, &Progress::hidden())?;
    Ok(SceneFile::open(&path).map_err(|error: Error| BuildError::File(error))?.resident().clone())
}

#[test]
fn named_nodes_and_those_below_are_instances_and_ids_stay() {
    let all = built(source(turned()), &[]).unwrap();
    assert_eq!((all.objects.len(), all.instances.len(), all.manifest.movable.len()), (1, 1, 0));
    for (movable, names) in [
        (vec!["thing"], vec!["thing"]),
        (vec!["th?ng", "group"], vec!["thing", "lamp"]),
        (vec!["*"], vec!["floor", "thing", "lamp"]),
    ] {
        let kept = built(source(turned()), &movable).unwrap();
        assert_eq!((kept.objects.len(), kept.instances.len()), (1 + names.len(), 1 + names.len()), "{movable:?}");
        assert_eq!(kept.manifest.movable, movable);
        assert_eq!(kept.manifest.provenance, all.manifest.provenance, "ids are what they were");
        assert_eq!(kept.manifest.provenance[2].under, ["group"]);
        for (instance, name) in kept.instances[1..].iter().zip(names) {
            let origin = kept.manifest.provenance.iter().find(|one| one.first_id == instance.base).unwrap();
            assert_eq!(origin.node, name);
        }
    }
}

#[test]
fn names_of_nothing_and_matrices_without_inverse_are_refused() {
    let error = built(source(turned()), &["thing", "thong*"]).unwrap_err().to_string();
    assert!(error.contains("--movable thong*") && error.contains("floor, thing, lamp"), "{error}");
    let mut flat = turned();
    flat[0..3].fill(0.0);
    let error = built(source(flat), &["thing"]).unwrap_err().to_string();
    assert!(error.contains("node \"thing\"") && error.contains("inverse"), "{error}");
}

/// Boxes of the leaves.
fn boxes(resident: &Resident) -> BTreeMap<(u32, u32), [[i64; 3]; 2]> {
    let leaves = resident.top2.iter().filter(|node| node.right == TOP_LEAF);
    let of_leaf = leaves.map(|node| {
        let leaf = &resident.leaves[node.left as usize];
        ((leaf.instance, leaf.brick), [node.min, node.max])
    });
    of_leaf.collect()
}

#[test]
fn places_give_the_boxes_of_a_conversion_there_and_return() {
    let still = built(source(turned()), &["thing", "lamp"]).unwrap();
    let places = [
        matrix(rotation(2.0, [-1.0, 0.5, 0.75]), [-20.0, 5.0, 1.0 / 3.0]),
        matrix(rotation(0.1, [1.0, 1.5, 0.5]), [30.0, 7.0, 20.0]).map(|x| 1.25 * x),
    ];
    let mut moved = still.clone();
    for place in places {
        let there = built(source(place), &["thing", "lamp"]).unwrap();
        let before = moved.clone();
        moved.place(&[(1, place)]).unwrap();
        validate::resident(&moved).unwrap();
        assert_eq!(boxes(&moved), boxes(&there), "boxes are those of a conversion");
        assert_eq!((moved.manifest.min, moved.manifest.max), (there.manifest.min, there.manifest.max));
        assert_eq!((moved.top2[0].min, moved.top2[0].max), (there.top2[0].min, there.top2[0].max));
        assert_eq!(moved.instances, there.instances);
        assert!(boxes(&before) != boxes(&moved), "the control: it was elsewhere");
    }
    // Back where it was all is as it was, bit for bit: the trees keep their topology.
    moved.place(&[(1, turned())]).unwrap();
    assert_eq!(moved, still);
}

#[test]
fn places_that_cannot_be_are_refused_and_change_nothing() {
    let still = built(source(turned()), &["thing"]).unwrap();
    let mut moved = still.clone();
    let far = |x: f64| matrix(rotation(0.0, [1.0; 3]), [x, 0.0, 0.0]);
    for (instance, place, says) in [
        (0, turned(), "instance 0"),
        (2, turned(), "instance 2"),
        (1, [0.0; 12], "no inverse"),
        (1, far(f64::NAN), "not finite"),
        (1, far(1e30), "nearer"),
        (1, far(1e9), "nearer"),
    ] {
        let error: PlaceError = moved.place(&[(1, far(3.0)), (instance, place)]).unwrap_err();
        assert!(error.to_string().contains(says), "{error}");
        assert_eq!(moved, still, "{says}");
    }
}
