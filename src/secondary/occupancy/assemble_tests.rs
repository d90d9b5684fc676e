//! Maps of a frame against brute force, and against each other.

use super::voxelise::touched;
use super::{Assembler, Bom, BomError, Cascades, Settings, assemble};
use crate::reference::Truth;
use bricks::{Resident, SceneFile};
use brickwalk_convert::build::{BuildSettings, LatticeStep, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{Primitive, SourceScene};
use brickwalk_scenes::{Rng, SoupKind, one_mesh, rotated_instances, soup};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use std::sync::Arc;

/// Positions on a lattice of 2⁻²⁰, whatever the size of bricks.
fn file(source: SourceScene, brick_triangles: u32) -> Arc<SceneFile> {
    file_on(source, brick_triangles, Some(-20))
}

fn file_on(source: SourceScene, brick_triangles: u32, lattice_log2: Option<i32>) -> Arc<SceneFile> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bricks");
    let settings = BuildSettings {
        brick_triangles,
        lattice: lattice_log2.map(LatticeStep::Log2),
        memory_bytes: Some(1 << 30),
        ..BuildSettings::default()
    };
    build(source, &settings, &path, &Progress::hidden()).unwrap();
    Arc::new(SceneFile::open(&path).unwrap())
}

fn triangles(file: &SceneFile) -> Vec<[[f64; 3]; 3]> {
    let truth = Truth::load(file).unwrap();
    truth.ids().filter_map(|id| truth.vertices(id)).collect()
}

fn primitive(triangles: &[[[f64; 3]; 3]]) -> SourceScene {
    let positions: Vec<[f64; 3]> = triangles.as_flattened().to_vec();
    let indices = (0..positions.len() as u32).collect();
    one_mesh("triangles", Primitive { positions, indices, ..Primitive::default() })
}

/// All that a walk wants in full, so that maps are as fine as they can be.
fn exact(cells: u32) -> Settings {
    Settings { cells, detail_log2: 40, ..Settings::default() }
}

/// A map of triangles by brute force: cells that they come within `tolerance` cells of; if it is negative, only those
/// that they reach into by as much.
fn brute(like: &Bom, triangles: &[[[f64; 3]; 3]], tolerance: f64) -> Bom {
    let mut map = Bom::new(like.cells(), like.cell_log2, like.first);
    let first = DVec3::from(like.first.map(|x| x as f64));
    for triangle in triangles {
        touched(&mut map, triangle.map(|p| DVec3::from(p) / like.side() - first), tolerance);
    }
    map
}

/// Cells of `a` that are not in `b`.
fn without(a: &Bom, b: &Bom) -> u64 {
    assert_eq!((a.cells(), a.cell_log2, a.first), (b.cells(), b.cell_log2, b.first));
    a.words().iter().zip(b.words()).map(|(a, b)| u64::from((a & !b).count_ones())).sum()
}

/// Checks that no cell is missing; returns for each level cells that are touched and cells that are occupied besides.
fn check(cascades: &Cascades, triangles: &[[[f64; 3]; 3]]) -> Vec<(i32, u64, u64)> {
    let mut found = Vec::new();
    for map in &cascades.levels {
        let (least, most) = (brute(map, triangles, -1e-6), brute(map, triangles, 1e-6));
        assert_eq!(without(&least, map), 0, "cells of 2^{} are missing", map.cell_log2);
        found.push((map.cell_log2, most.occupied(), without(map, &most)));
        // The control: of a map that is one cell aside they are.
        let mut aside = Bom::new(map.cells(), map.cell_log2, map.first);
        let from = map.words();
        let words = aside.words_mut();
        words[(map.cells() / 32) as usize..].copy_from_slice(&from[..from.len() - (map.cells() / 32) as usize]);
        assert!(least.occupied() < 50 || without(&least, &aside) > 0, "cells of 2^{}", map.cell_log2);
    }
    found
}

/// The largest cell of any brick, log2.
fn coarsest_brick(resident: &Resident) -> i32 {
    resident.occupancy.iter().map(|record| record.cell_log2).max().unwrap()
}

#[test]
fn cells_of_bricks_on_the_lattice_are_exact_and_do_not_depend_on_the_cut() {
    let camera = DVec3::new(1.0, -2.0, 3.0);
    for (kind, triangles_of) in [(SoupKind::Uniform, 1500), (SoupKind::Clustered, 1500)] {
        let files = [40, 700].map(|size| file(soup(kind, triangles_of, 3), size));
        let all = triangles(&files[0]);
        let finest = files.iter().map(|file| coarsest_brick(file.resident())).max().unwrap();
        let settings = Settings { finest_log2: Some(finest), ..exact(64) };
        let [a, b] = files.each_ref().map(|file| assemble(file, &settings, camera).unwrap());
        assert_eq!(a, b, "the maps do not depend on the size of bricks");
        for (cell_log2, touched, besides) in check(&a, &all) {
            assert_eq!(besides, 0, "{touched} cells of 2^{cell_log2}");
        }
        let fine = assemble(&files[1], &exact(64), camera).unwrap().levels[0].cell_log2 - 2;
        let finer = assemble(&files[1], &Settings { finest_log2: Some(fine), ..exact(64) }, camera).unwrap();
        println!("{kind:?}, 64³, finer than bricks: (log2 of cell, touched, besides) {:?}", check(&finer, &all));
        // From resident levels alone there are more, never fewer.
        let coarse = assemble(&files[0], &Settings { detail_log2: i32::MIN, ..settings }, camera).unwrap();
        let besides = check(&coarse, &all);
        println!("{kind:?}, 64³, resident levels alone: {besides:?}");
        assert!(besides[0].2 > 0);
        assert!(a.levels.iter().zip(&coarse.levels).all(|(fine, coarse)| without(fine, coarse) == 0));
    }
}

/// The scene with every placement moved.
fn shifted(mut scene: SourceScene, by: [f64; 3]) -> SourceScene {
    for placement in &mut scene.placements {
        (0..3).for_each(|k| placement.world_from_mesh[4 * k + 3] += by[k]);
    }
    scene
}

#[test]
fn cells_of_turned_mirrored_and_scaled_instances_are_never_missing() {
    for (far, size) in [([0.0; 3], 300), ([1e7, -3e6, 12_345.678], 2000)] {
        let file = file(shifted(rotated_instances(5), far), size);
        assert!(file.resident().instances.len() > 10);
        let all = triangles(&file);
        for camera in [DVec3::ZERO, DVec3::new(2.5, -1.0, 1.0)] {
            let cascades = assemble(&file, &exact(64), DVec3::from_array(far) + camera).unwrap();
            let found = check(&cascades, &all);
            println!("turned instances at {far:?}: (log2 of cell, touched, besides) {found:?}");
            // Where cells are no smaller than those of bricks, which are scaled by 3 at most: boxes around turned cubes
            // of half a cell.
            let finest = coarsest_brick(file.resident()) + 2;
            let of_size = found.iter().filter(|(cell_log2, ..)| *cell_log2 >= finest);
            assert!(of_size.clone().count() > 1);
            assert!(of_size.clone().all(|(_, touched, besides)| besides < &(2 * touched)), "{found:?}");
        }
    }
}

/// Three instances of one mesh: moved by whole cells, scaled by two, mirrored.
#[test]
fn placements_on_the_lattice_are_shifted() {
    let mut scene = rotated_instances(2);
    let matrix = |scale: [f64; 3], at: [f64; 3]| {
        let [x, y, z] = scale;
        [x, 0.0, 0.0, at[0], 0.0, y, 0.0, at[1], 0.0, 0.0, z, at[2]]
    };
    let matrices =
        [matrix([1.0; 3], [13.0, -3.0, 0.25]), matrix([2.0; 3], [-14.0, 8.0, 1.0]), matrix([-1.0, 1.0, 1.0], [0.0; 3])];
    scene.placements.truncate(3);
    for (placement, matrix) in scene.placements.iter_mut().zip(matrices) {
        placement.world_from_mesh = matrix;
    }
    let file = file(scene, 400);
    let settings = Settings { finest_log2: Some(coarsest_brick(file.resident()) + 1), ..exact(64) };
    let all = triangles(&file);
    let (base, per) = (file.resident().instances[1].base as usize, all.len() / 3);
    assert_eq!(base, 0);
    for (k, is_exact) in [(0, true), (1, true), (2, false)] {
        // Those cells that this instance alone touches.
        let cascades = assemble(&file, &settings, DVec3::new(matrices[k][3], matrices[k][7], matrices[k][11])).unwrap();
        let found = check(&cascades, &all);
        let own = brute(&cascades.levels[0], &all[k * per..(k + 1) * per], 1e-6);
        assert!(own.occupied() > 1000, "instance {k}");
        let others = brute(&cascades.levels[0], &[&all[..k * per], &all[(k + 1) * per..]].concat(), 1.5);
        let besides = without(&cascades.levels[0], &own);
        let of_others = without(&others, &own);
        assert_eq!(of_others, 0, "instance {k} is alone there");
        assert_eq!(besides == 0, is_exact, "instance {k}: {found:?}");
        println!("instance {k}: {found:?}, besides its own {besides}, of others {of_others}");
    }
}

#[test]
fn small_and_large_scenes() {
    let empty = file(SourceScene { sources: soup(SoupKind::Uniform, 1, 1).sources, ..SourceScene::default() }, 16);
    let cascades = assemble(&empty, &Settings::default(), DVec3::ZERO).unwrap();
    assert_eq!((cascades.levels.len(), cascades.levels[0].occupied()), (1, 0));
    let flat = [
        [[-4.0, 0.0, -4.0], [4.0, 0.0, -4.0], [4.0, 0.0, 4.0]],
        [[-4.0, 0.0, -4.0], [4.0, 0.0, 4.0], [-4.0, 0.0, 4.0]],
    ];
    let one = [[[1.0, 2.0, 3.0], [1.5, 2.25, 3.5], [1.25, 2.0, 4.0]]];
    let size = 2f64.powi(30);
    let wide = [
        [[-size, 1.0, 2.0], [size, -size, 5.0], [0.3, size, size]],
        [[0.1, 0.2, 0.3], [1.1, 0.2, 0.4], [0.5, 1.0, 0.7]],
    ];
    let far = one.map(|t| t.map(|p| p.map(|x| x + size)));
    for (name, scene) in [("flat", &flat[..]), ("one", &one), ("wide", &wide), ("far", &far)] {
        let file = file_on(primitive(scene), 1, None);
        let all = triangles(&file);
        for camera in [DVec3::ZERO, DVec3::splat(1e300), DVec3::splat(f64::NAN), DVec3::new(0.4, 0.3, 0.4)] {
            let cascades = assemble(&file, &exact(64), camera).unwrap();
            let last = cascades.levels.last().unwrap();
            let inside = all.as_flattened().iter().all(|&p| last.cell_at(p).iter().all(|x| (0..64).contains(x)));
            assert!(inside, "{name}: the coarsest map holds the scene");
            assert!(cascades.levels.len() <= 12);
            for map in &cascades.levels {
                // Vertices are exact, so that no tolerance is wanted.
                for cell in all.as_flattened().iter().map(|&p| map.cell_at(p)) {
                    let is_in = cell.iter().all(|x| (0..64).contains(x));
                    assert_eq!(map.is_occupied(cell), is_in, "{name} {cell:?} of 2^{}", map.cell_log2);
                }
            }
            println!("{name}: {:?} {} levels", check(&cascades, &all), cascades.levels.len());
        }
    }
}

/// The scene with an instance elsewhere, and the bounds of the top level as they follow.
fn with_moved(resident: &Resident, instance: usize, matrix: [f64; 12]) -> Resident {
    let mut moved = resident.clone();
    moved.place(&[(instance as u32, matrix)]).unwrap();
    moved
}

#[test]
fn maps_moved_along_a_walk_are_those_made_anew() {
    let mut rng = Rng::new(4, &[77]);
    for source in [rotated_instances(9), soup(SoupKind::Uniform, 3000, 8)] {
        let file = file(source, 100);
        let mut resident = file.resident().clone();
        let instances = resident.instances.len();
        let settings = Settings { finest_log2: Some(coarsest_brick(&resident) - 1), ..exact(64) };
        let [mut walker, mut anew] = [(); 2].map(|()| Assembler::new(file.clone(), settings).unwrap());
        let (mut camera, mut moved, mut differing) = (DVec3::ZERO, 0, 0);
        let mut before = Cascades::default();
        for frame in 0..40 {
            camera += rng.direction() * [0.02, 0.3, 2.0, 9.0][frame % 4] * rng.unit();
            if instances > 1 && frame % 3 == 2 {
                let turn = DQuat::from_axis_angle(rng.direction(), rng.range(0.0, 6.0));
                let a = DAffine3::from_mat3_translation(
                    DMat3::from_quat(turn) * rng.range(0.5, 1.5),
                    rng.direction() * 2.0,
                );
                let m = a.matrix3.transpose().to_cols_array();
                let t = a.translation;
                let matrix = [m[0], m[1], m[2], t.x, m[3], m[4], m[5], t.y, m[6], m[7], m[8], t.z];
                resident = with_moved(&resident, 1 + frame % (instances - 1), matrix);
            }
            let filled = walker.advance(&resident, camera).unwrap();
            anew.cascades.levels.clear();
            let whole = anew.advance(&resident, camera).unwrap();
            assert_eq!(walker.cascades(), anew.cascades(), "frame {frame}");
            assert!(filled <= whole);
            moved += u64::from(filled < whole);
            differing += u64::from(before != *walker.cascades());
            before = walker.cascades().clone();
        }
        assert!(moved > 20 && differing > 20, "{moved} {differing}");
    }
}

/// What moving maps saves: a scene of many bricks, a camera that goes a quarter of a cell of the coarsest map at a
/// time.
#[test]
fn moving_maps_takes_less_work_than_making_them() {
    let file = file(soup(SoupKind::Uniform, 20_000, 6), 100);
    let settings = Settings::default();
    let [mut walker, mut anew] = [(); 2].map(|()| Assembler::new(file.clone(), settings).unwrap());
    let mut cells = [0, 0];
    let mut camera = DVec3::new(-3.0, 0.5, 1.0);
    walker.advance(file.resident(), camera).unwrap();
    for _ in 0..40 {
        camera += DVec3::new(0.11, 0.02, 0.05);
        anew.cascades.levels.clear();
        for (cells, assembler) in cells.iter_mut().zip([&mut walker, &mut anew]) {
            *cells += assembler.advance(file.resident(), camera).unwrap();
        }
        assert_eq!(walker.cascades(), anew.cascades());
    }
    assert!(cells[0] * 4 < cells[1]);
}

#[test]
fn scenes_without_maps_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bare.bricks");
    let settings = BuildSettings { proxies: false, ..BuildSettings::default() };
    build(soup(SoupKind::Uniform, 100, 1), &settings, &path, &Progress::hidden()).unwrap();
    let file = Arc::new(SceneFile::open(&path).unwrap());
    let error = assemble(&file, &Settings::default(), DVec3::ZERO).unwrap_err();
    assert!(matches!(error, BomError::NoProxies { .. }));
    let text = error.to_string();
    assert!(text.contains("bare.bricks") && text.contains("--no-proxies"), "{text}");
}
