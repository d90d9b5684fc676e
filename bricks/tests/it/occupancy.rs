//! Occupancy maps in files: read, refused when they break a rule, left out.

use crate::common::{self, Scene, scene};
use bricks::*;
use std::path::Path;

/// Every level of a map, one after the other.
fn bytes(map: &OccupancyMap) -> Vec<u8> {
    (0..OCCUPANCY_LEVELS).flat_map(|level| map.level(level).to_vec()).collect()
}

fn map(scene: &Scene, brick: u32) -> OccupancyMap {
    OccupancyMap::unpack(&scene.payloads[&Payload::Proxies(brick)]).unwrap()
}

fn grid(scene: &Scene, brick: u32) -> (OccupancyGrid, i32) {
    let brick = &scene.resident.bricks[brick as usize];
    let step_log2 = scene.resident.objects[brick.object as usize].step_log2;
    (OccupancyGrid::of(step_log2, brick.min, brick.max), step_log2)
}

fn write(scene: &mut Scene) -> (tempfile::TempDir, std::path::PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    scene.write(&path);
    (folder, path)
}

#[test]
fn maps_are_read() {
    let mut scene = scene();
    let (_folder, path) = write(&mut scene);
    let file = SceneFile::open(&path).unwrap();
    for brick in 0..3 {
        let read = file.occupancy(brick).unwrap();
        assert_eq!(read, map(&scene, brick));
        let record = &file.resident().occupancy[brick as usize];
        assert_eq!(record.bits, read.level(RESIDENT_LEVEL));
    }
    assert!(matches!(file.occupancy(3), Err(Error::Request { payload: Payload::Proxies(3), .. })));
}

#[test]
fn they_may_be_left_out() {
    let mut scene = scene();
    scene.payloads.retain(|payload, _| !matches!(payload, Payload::Proxies(_)));
    scene.resident.occupancy.clear();
    scene.resident.manifest.has_proxies = false;
    let (_folder, path) = write(&mut scene);
    assert_eq!(common::problems(&path), "");
    let file = SceneFile::open(&path).unwrap();
    assert_eq!(file.resident().payloads().count(), scene.payloads.len());
    let error = file.occupancy(0).unwrap_err().to_string();
    assert!(error.contains("brick 0 proxies") && error.contains("0 bricks with proxies"), "{error}");
    assert!(file.copy(Payload::Proxies(0), &mut []).is_err());
}

/// The file opens; the map is refused when read, and verifying says so and nothing else.
#[track_caller]
fn refused(path: &Path, brick: u32, found: &str) {
    let file = SceneFile::open(path).unwrap();
    let error = file.occupancy(brick).unwrap_err().to_string();
    assert!(error.contains(&format!("brick {brick} proxies is not valid")) && error.contains(found), "{error}");
    assert_eq!(common::problems(path), format!("{error}\n"));
    file.occupancy((brick + 1) % 3).unwrap();
}

#[test]
fn levels_that_differ_are_refused() {
    for at in [32768, 32768 + 4096 + 512, OCCUPANCY_BYTES - 1, OCCUPANCY_BYTES - 2] {
        let mut scene = scene();
        let mut bytes = bytes(&map(&scene, 1));
        bytes[at] ^= 0x80;
        scene.payloads.insert(Payload::Proxies(1), pack::pack(&bytes));
        let (_folder, path) = write(&mut scene);
        refused(&path, 1, "does not follow from the finest");
    }
    // The finest level and all others agree, but not with the resident one.
    let mut scene = scene();
    let record = map(&scene, 1);
    let mut columns = map(&scene, 0).finest();
    columns[0] |= 1;
    let more = OccupancyMap::of_finest(&columns);
    assert_ne!(more, record);
    scene.resident.occupancy[0].bits[511] ^= 1;
    let (_folder, path) = write(&mut scene);
    refused(&path, 0, "section occupancy");
}

#[test]
fn cells_beyond_the_bounds_are_refused() {
    let whole = scene();
    let (grid, step_log2) = grid(&whole, 2);
    let last = grid.cell(step_log2, whole.resident.bricks[2].max);
    let cases = [[last[0] + 1, 0, 0], [0, last[1] + 1, 0], [0, 0, last[2] + 1]];
    for (case, cell) in (0..).zip(cases) {
        assert!(cell.iter().all(|x| *x < 64), "{cell:?}");
        let mut scene = scene();
        let mut columns = map(&scene, 2).finest();
        columns[(cell[0] + 64 * cell[1]) as usize] |= 1 << cell[2];
        let map = OccupancyMap::of_finest(&columns);
        scene.resident.occupancy[2] = map.record(&grid);
        scene.payloads.insert(Payload::Proxies(2), map.pack());
        let (_folder, path) = write(&mut scene);
        refused(&path, 2, "beyond the brick's bounds");
        // The control: the last cell within.
        let mut cell = cell;
        cell[case] -= 1;
        columns[(cases[case][0] + 64 * cases[case][1]) as usize] &= !(1 << cases[case][2]);
        columns[(cell[0] + 64 * cell[1]) as usize] |= 1 << cell[2];
        let map = OccupancyMap::of_finest(&columns);
        scene.resident.occupancy[2] = map.record(&grid);
        scene.payloads.insert(Payload::Proxies(2), map.pack());
        let (_folder, path) = write(&mut scene);
        assert_eq!(common::problems(&path), "");
    }
}

#[test]
fn vertices_in_empty_cells_are_found_by_verifying() {
    for brick in 0..3 {
        let mut scene = scene();
        let (grid, _) = grid(&scene, brick);
        let mut columns = map(&scene, brick).finest();
        let column = columns.iter_mut().find(|column| **column != 0).unwrap();
        *column &= *column - 1;
        let map = OccupancyMap::of_finest(&columns);
        scene.resident.occupancy[brick as usize] = map.record(&grid);
        scene.payloads.insert(Payload::Proxies(brick), map.pack());
        let (_folder, path) = write(&mut scene);
        assert_eq!(SceneFile::open(&path).unwrap().occupancy(brick).unwrap(), map);
        let problems = common::problems(&path);
        assert!(problems.contains(&format!("brick {brick} proxies is not valid: found an empty cell")), "{problems}");
        assert_eq!(problems.lines().count(), 1, "{problems}");
    }
}
