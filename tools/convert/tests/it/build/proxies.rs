//! Occupancy maps of converted scenes hold the triangles of their bricks, and leaving them out changes nothing else.

use super::bounded::Computed;
use super::decode::{Decoded, DecodedBrick, decode};
use super::scenes::*;
use bricks::{OCCUPANCY_LEVELS, OccupancyMap, Payload, SceneFile, Section, Span, verify_file};
use brickwalk_convert::build::{BuildSettings, LatticeStep, build_source};
use brickwalk_convert::progress::Progress;
use std::path::Path;

/// Draws points of triangles; returns how many were drawn and how many lie in cells of `map` that are empty. Points
/// within 2^-10 of a cell of a border are left out: f64 is not that far off.
fn outside(scene: &Decoded, brick: &DecodedBrick, map: &OccupancyMap, random: &mut Random) -> (u32, u32) {
    let object = &scene.resident.objects[brick.record.object as usize];
    let index = scene.bricks.iter().position(|other| std::ptr::eq(other, brick)).unwrap();
    let record = &scene.resident.occupancy[index];
    let side = 2f64.powi(record.cell_log2 - object.step_log2);
    let (mut drawn, mut outside) = (0, 0);
    for indices in &brick.indices {
        let (s, t) = (random.next().sqrt(), random.next());
        let weights = [1.0 - s, s * (1.0 - t), s * t];
        let cell: [f64; 3] = std::array::from_fn(|k| {
            let corner = |i: usize| (brick.vertices[indices[i] as usize][k] + brick.record.origin[k]) as f64;
            let from_origin = (0..3).map(|i| weights[i] * corner(i)).sum::<f64>() / side;
            from_origin - record.origin[k] as f64
        });
        if cell.iter().any(|x| (x - x.round()).abs() < 2f64.powi(-10)) {
            continue;
        }
        drawn += 1;
        let empty = |level: u32| !map.is_occupied(level, cell.map(|x| x as u32 >> level));
        outside += u32::from((0..OCCUPANCY_LEVELS).any(empty));
    }
    (drawn, outside)
}

/// Points of all triangles of a file lie in occupied cells.
fn check(path: &Path) {
    let (scene, file) = (decode(path), SceneFile::open(path).unwrap());
    let mut random = Random(7);
    let (mut drawn, mut drawn_elsewhere) = (0, (0, 0));
    for (index, brick) in (0..).zip(&scene.bricks) {
        let map = file.occupancy(index).unwrap();
        let (points, outside_own) = outside(&scene, brick, &map, &mut random);
        assert_eq!(outside_own, 0, "brick {index}");
        drawn += points;
        // The control: in the map of the next brick they do not.
        let next = file.occupancy((index + 1) % scene.bricks.len() as u32).unwrap();
        let (points, outside_next) = outside(&scene, brick, &next, &mut random);
        drawn_elsewhere = (drawn_elsewhere.0 + points, drawn_elsewhere.1 + outside_next);
    }
    assert!(drawn > 1000 && drawn_elsewhere.1 > drawn_elsewhere.0 / 4, "{drawn} {drawn_elsewhere:?}");
}

#[test]
fn points_of_triangles_are_in_their_maps() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bricks");
    build_source(&Computed::new(20_000, 8000), &settings(500), &path, &Progress::hidden()).unwrap();
    check(&path);
    // Wide bricks, and bricks of few steps.
    let mut random = Random(3);
    let soup: Vec<_> = (0..3000).map(|_| [(); 3].map(|()| random.point(1000.0))).collect();
    for (lattice_log2, wide) in [(-30, true), (4, false)] {
        let settings = BuildSettings { lattice: Some(LatticeStep::Log2(lattice_log2)), ..settings(300) };
        let built = built(&plain(vec![super::scenes::soup(&soup)]), &settings);
        check(&built.path());
        assert_eq!(built.summary.wide_bricks > 0, wide);
    }
}

#[test]
fn without_proxies_all_else_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let [with, without] = [true, false].map(|proxies| {
        let path = folder.path().join(format!("{proxies}.bricks"));
        let settings = BuildSettings { proxies, ..settings(500) };
        let summary = build_source(&Computed::new(20_000, 8000), &settings, &path, &Progress::hidden()).unwrap();
        assert_eq!(summary.bytes_proxies > 0, proxies);
        assert!(verify_file(&path, &mut |_, _| {}).unwrap().is_ok());
        SceneFile::open(&path).unwrap()
    });
    let (a, b) = (with.resident(), without.resident());
    assert!(a.manifest.has_proxies && !b.manifest.has_proxies);
    assert_eq!((a.occupancy.len(), b.occupancy.len()), (a.bricks.len(), 0));
    assert!(!b.payloads().any(|(payload, _)| matches!(payload, Payload::Proxies(_))));
    let place = |span: Span| Span { offset: 0, ..span };
    let mut stripped = a.clone();
    stripped.occupancy.clear();
    stripped.manifest.has_proxies = false;
    for (brick, other) in stripped.bricks.iter_mut().zip(&b.bricks) {
        assert_eq!(
            [place(brick.geometry), place(brick.attributes)],
            [place(other.geometry), place(other.attributes)],
            "bytes and checksums"
        );
        (brick.geometry, brick.attributes, brick.proxies) = (other.geometry, other.attributes, Span::default());
    }
    assert_eq!(stripped, *b);
    // Payloads of a brick follow each other.
    for brick in &a.bricks {
        assert!(brick.geometry.offset < brick.attributes.offset && brick.attributes.offset < brick.proxies.offset);
        let end = brick.attributes.offset + brick.attributes.bytes;
        assert_eq!(brick.proxies.offset, end.next_multiple_of(4096));
    }
}

#[test]
fn every_damaged_byte_is_found() {
    let built = built(&plain(vec![sheet(20, 10.0)]), &settings(300));
    let path = built.path();
    let file = SceneFile::open(&path).unwrap();
    let span = file.span(Payload::Proxies(1));
    let whole = std::fs::read(&path).unwrap();
    let records = bytemuck::cast_slice::<_, u8>(&file.resident().occupancy);
    let section = whole.windows(records.len()).rposition(|window| window == records).unwrap();
    let proxies = span.offset as usize..(span.offset + span.bytes) as usize;
    for at in proxies.step_by(7).chain((section..section + records.len()).step_by(61)) {
        let mut damaged = whole.clone();
        damaged[at] ^= 1 << (at % 8);
        std::fs::write(&path, &damaged).unwrap();
        let report = verify_file(&path, &mut |_, _| {}).unwrap();
        let expected = if at < section {
            bricks::Part::Payload(Payload::Proxies(1))
        } else {
            bricks::Part::Section(Section::Occupancy)
        };
        let parts: Vec<_> = report.problems.iter().filter_map(bricks::Error::part).collect();
        assert_eq!(parts, [expected], "byte {at}");
    }
}
