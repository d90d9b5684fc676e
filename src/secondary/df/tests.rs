//! Fields against brute force, and rays through them against exact ones. The selftest has the rounding of distances and
//! maps without a cell.

use super::flood::squared;
use super::{DistanceField, LEVELS, Tracing, jump_flood};
use crate::reference::{Truth, TruthRay};
use crate::secondary::occupancy::{Bom, Settings, assemble};
use bricks::SceneFile;
use brickwalk_convert::build::{BuildSettings, build};
use brickwalk_convert::progress::Progress;
use brickwalk_scenes::{Rng, rotated_instances};
use glam::DVec3;
use half::f16;
use std::sync::Arc;

/// A map with so many cells occupied at random, or with a sphere.
fn map(cells: u32, seeds: u32, rng: &mut Rng) -> Bom {
    let mut map = Bom::new(cells, -3, [-7, 100, 3]);
    for _ in 0..seeds {
        map.occupy([(); 3].map(|()| rng.int(0, i64::from(cells) - 1) as u32));
    }
    map
}

fn cells_of(cells: u32) -> impl Iterator<Item = [u32; 3]> {
    (0..cells.pow(3)).map(move |i| [i / (cells * cells), i / cells % cells, i % cells])
}

#[test]
fn flooded_distances_are_never_too_short_and_seldom_too_long() {
    let mut rng = Rng::new(3, &[56]);
    let mut sphere = Bom::new(32, 0, [0; 3]);
    for [x, y, z] in cells_of(32) {
        let r = DVec3::new(f64::from(x), f64::from(y), f64::from(z)).distance(DVec3::splat(15.0));
        if (11.5..12.5).contains(&r) {
            sphere.occupy([x, y, z]);
        }
    }
    let maps = [1, 2, 30, 300, 3000].map(|seeds| map(32, seeds, &mut rng));
    let (mut longer, mut of, mut worst) = (0u64, 0u64, 0.0f64);
    for map in maps.iter().chain([&sphere]) {
        let seeds: Vec<[u32; 3]> = cells_of(32).filter(|cell| map.is_occupied(cell.map(i64::from))).collect();
        for (cell, &found) in cells_of(32).zip(&jump_flood(map)) {
            let exact = seeds.iter().map(|seed| (0..3).map(|k| cell[k].abs_diff(seed[k]).pow(2)).sum::<u32>()).min();
            let (exact, found) = (exact.unwrap(), squared(cell, found));
            assert!(found >= exact);
            longer += u64::from(found > exact);
            worst = worst.max(f64::from(found).sqrt() - f64::from(exact).sqrt());
            of += 1;
        }
    }
    println!("jump flooding, 32³: {longer} of {of} distances too long, by {worst:.3} cells at most");
    assert!(longer * 200 < of && worst < 2.0, "{longer} {of} {worst}");
}

#[test]
fn levels_are_the_least_and_lookups_are_between() {
    let mut rng = Rng::new(3, &[58]);
    let map = map(64, 40, &mut rng);
    let field = DistanceField::new(&map);
    for level in 1..LEVELS {
        let (n, fine) = (field.cells(level), field.cells(level - 1));
        for [x, y, z] in cells_of(n) {
            let at = |c: u32| ((2 * x + (c >> 2 & 1)) * fine + 2 * y + (c >> 1 & 1)) * fine + 2 * z + (c & 1);
            let least = (0..8).map(|c| field.level(level - 1)[at(c) as usize]).reduce(f16::min).unwrap();
            assert_eq!(field.level(level)[((x * n + y) * n + z) as usize], least);
        }
    }
    for level in 0..LEVELS {
        let (n, width) = (field.cells(level), (1 << level) as f32);
        for cell in cells_of(n) {
            let middle = cell.map(|x| (x as f32 + 0.5) * width);
            let stored = field.level(level)[((cell[0] * n + cell[1]) * n + cell[2]) as usize].to_f32();
            assert_eq!(field.distance(level, middle), stored);
        }
        let beyond = field.distance(level, [-5.0, -1.0, -9.0]);
        assert_eq!(beyond, field.level(level)[0].to_f32());
    }
    // Between middles they are within a cell of the distance there.
    let occupied: Vec<[u32; 3]> = cells_of(64).filter(|cell| map.is_occupied(cell.map(i64::from))).collect();
    for _ in 0..2000 {
        let p = [(); 3].map(|()| rng.range(0.5, 63.5) as f32);
        let apart = |c: &[u32; 3]| (0..3).map(|k| (c[k] as f32 + 0.5 - p[k]).powi(2)).sum::<f32>().sqrt();
        let exact = occupied.iter().map(apart).fold(f32::INFINITY, f32::min);
        assert!((field.distance(0, p) - exact).abs() < 1.0, "{p:?}");
    }
}

/// Where a ray enters the first occupied cell of a map, cells, by walking from cell to cell.
fn exact(map: &Bom, origin: DVec3, along: DVec3) -> Option<f64> {
    let mut crossings: Vec<f64> = vec![0.0];
    for k in 0..3 {
        crossings.extend((0..=map.cells()).map(|face| (f64::from(face) - origin[k]) / along[k]).filter(|t| *t > 0.0));
    }
    crossings.sort_unstable_by(f64::total_cmp);
    let between = crossings.windows(2).find(|t| {
        let p = origin + along * (0.5 * (t[0] + t[1]));
        map.is_occupied(p.to_array().map(|x| x.floor() as i64))
    });
    between.map(|t| t[0])
}

#[test]
fn rays_agree_with_cells_and_with_triangles() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bricks");
    let settings = BuildSettings { brick_triangles: 500, ..BuildSettings::default() };
    build(rotated_instances(3), &settings, &path, &Progress::hidden()).unwrap();
    let file = Arc::new(SceneFile::open(&path).unwrap());
    let truth = Truth::load(&file).unwrap();
    let cascades = assemble(&file, &Settings { cells: 64, ..Settings::default() }, DVec3::ZERO).unwrap();
    let map = &cascades.levels[cascades.levels.len() - 3];
    let field = DistanceField::new(map);
    let mut aside = map.clone();
    aside.first[1] += 9;
    let aside = DistanceField::new(&aside);
    let mut rng = Rng::new(3, &[59]);
    let corner = DVec3::from_array(map.first.map(|x| x as f64 * map.side()));
    let most = Tracing::default();
    let few = Tracing { iterations: 16, ..most };
    let (mut agree, mut agree_few, mut agree_aside, mut agree_truth, mut of) = (0, 0, 0, 0, 0);
    let (mut capped, mut capped_few, mut far, mut hits, mut lookups) = (0, 0, 0, 0, 0u64);
    while of < 4000 {
        let local = DVec3::new(rng.unit(), rng.unit(), rng.unit()) * 64.0;
        let origin = corner + local * map.side();
        if field.distance(0, field.local(origin.to_array())) < 2.5 {
            continue;
        }
        of += 1;
        let along = rng.direction();
        let cells = exact(map, local, along);
        let run = |field: &DistanceField, tracing: &Tracing| {
            field.trace(tracing, origin.to_array(), along.to_array(), 0.0, f64::INFINITY)
        };
        let traced = run(&field, &most);
        let less = run(&field, &few);
        agree += u32::from(traced.t.is_some() == cells.is_some());
        agree_few += u32::from(less.t.is_some() == cells.is_some());
        agree_aside += u32::from(run(&aside, &most).t.is_some() == cells.is_some());
        let ray = TruthRay::new(origin.to_array(), along.to_array(), 0.0, f64::INFINITY);
        agree_truth += u32::from(truth.any(&ray) == traced.t.is_some());
        (capped, capped_few) = (capped + u32::from(traced.is_capped), capped_few + u32::from(less.is_capped));
        lookups += u64::from(traced.iterations);
        if let (Some(t), Some(cells)) = (traced.t, cells) {
            hits += 1;
            far += u32::from((t / map.side() - cells).abs() > 3.0);
        }
    }
    println!(
        "sphere tracing, 64³, {of} rays: {agree} as cells say, {agree_few} with 16 look-ups, {agree_aside} in another \
         map; {agree_truth} as triangles say; {capped} capped ({capped_few} of 16); {lookups} look-ups; of {hits} hits \
         {far} more than 3 cells away"
    );
    assert!(agree * 100 > of * 98 && far * 50 < hits && agree_aside * 10 < of * 9);
}
