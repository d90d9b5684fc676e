//! Shapes that are hard for the builder, and what it must refuse (cases 6, 7, 9 to 14, 38, 43).

use super::case::Checks;
use super::lab::{Built, GOOD, Lab, Stage, cached, different, misses, scheduled, settings, triangles, truth_ray};
use super::rays::{Aim, lattice_point, ray};
use crate::kernels::layout::{NONE, Ray};
use crate::scene::framing::path_from_bounds;
use crate::secondary::occupancy::{Settings, assemble};
use crate::settings::{Group, Schedule};
use anyhow::{Context, Result};
use bricks::MAX_BRICK_HEIGHT;
use brickwalk_convert::source::SourceScene;
use brickwalk_scenes::{Stiff, stiff};
use glam::DVec3;

/// These triangles as a scene.
fn seven(corners: &[[[f64; 3]; 3]]) -> SourceScene {
    triangles("mesh seven", corners)
}

/// Case 6: triangles without area.
pub fn zero_area(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let line = [[0.0; 3], [1.0, 1.0, 0.0], [2.0, 2.0, 0.0]];
    let thin = [[0.0; 3], [1.0, 0.0, 0.0], [0.5, 1e-12, 0.0]];
    let Built { file, summary, .. } = lab.build(seven(&[GOOD, line, GOOD, [[0.5; 3]; 3], thin]), &settings(4, 0))?;
    checks.equal("triangles dropped and counted", summary.dropped_zero_area, 3);
    checks.equal("triangles that keep a number", file.resident().manifest.triangle_ids, 5);
    checks.equal("warnings in the manifest", file.resident().manifest.warnings.len(), 1);
    checks.equal("triangles stored", summary.triangles_stored, 2);
    Ok(())
}

/// Case 7: vertices that are not finite.
pub fn not_finite(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    for (bad, k) in [(f64::NAN, 0), (f64::INFINITY, 1), (f64::NEG_INFINITY, 2)] {
        let mut broken = GOOD;
        broken[1][k] = bad;
        let result = lab.build(seven(&[GOOD, broken]), &settings(4, 0));
        checks.refuses(&format!("{bad}"), result.map(|_| ()), &["mesh seven", "vertex 4", "not finite"]);
        let dropping = brickwalk_convert::build::BuildSettings { drop_non_finite: true, ..settings(4, 0) };
        let Built { file, summary, .. } = lab.build(seven(&[GOOD, broken]), &dropping)?;
        checks.equal("dropped on request", summary.dropped_non_finite, 1);
        let manifest = &file.resident().manifest;
        checks.holds("bounds are finite", manifest.min.iter().chain(&manifest.max).all(|x| x.is_finite()));
    }
    Ok(())
}

/// Case 9: coordinates near the end of f32 and beyond.
pub fn overflow(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    for size in [1e38, 1e39, 1e300] {
        let mut broken = GOOD;
        broken[2][0] = size;
        let result = lab.build(seven(&[GOOD, broken]), &settings(4, 0));
        checks.refuses(&format!("{size:e}"), result.map(|_| ()), &["mesh seven", "scale the scene down"]);
    }
    Ok(())
}

/// Case 10: coincident triangles; the lowest id wins, also where a ray starts on them.
pub fn coincident(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let (n, count) = (12, lab.share(8000));
    let own = 2 * n * n;
    let mut expected = None;
    let ways = [
        (7, scheduled(30, Schedule::Chc)),
        (64, scheduled(100, Schedule::Plain)),
        (3, scheduled(40, Schedule::Demand)),
    ];
    for (bricks, options) in ways {
        let mut stage = lab.judged(stiff(Stiff::Sheets, n, lab.seed), &settings(bricks, -20), &options)?;
        let options = options.options();
        let (step, unit, targets) = (stage.step(), 1.0 / stage.frame.unit, &stage.targets);
        let mut rng = lab.random(&[10]);
        let rays: Vec<Ray> = (0..count)
            .map(|i| {
                if i % 2 == 0 {
                    // On a vertex, in any direction: t is 0 for all triangles there.
                    let at = targets.point(&mut rng, Aim::Vertex);
                    return ray(at, at + unit * rng.direction());
                }
                let origin = lattice_point(&mut rng, DVec3::ZERO, unit, step);
                targets.ray(&mut rng, origin, Aim::ALL[i / 2 % 3])
            })
            .collect();
        let hits = stage.note(checks, &options, &rays)?;
        let higher = hits.iter().filter(|hit| hit.id != NONE && hit.id >= own).count() as u64;
        checks.none(&format!("{options}: hits of a copy with a higher id"), higher, hits.len() as u64);
        // Where a ray starts on a vertex everything is exact, and so is the choice.
        let starts = rays.iter().zip(&hits).step_by(2);
        let wrong = starts.filter(|(ray, hit)| {
            let truth = stage.truth.closest(&truth_ray(&stage.frame, ray));
            truth.is_none_or(|truth| truth.id != hit.id || hit.t != 0.0)
        });
        checks.none(
            &format!("{options}: rays from a vertex without the lowest id"),
            wrong.count() as u64,
            count as u64 / 2,
        );
        let expected = expected.get_or_insert_with(|| hits.clone());
        checks.none(&format!("{options}: hits unlike the first way's"), different(expected, &hits), count as u64);
    }
    Ok(())
}

/// Cases 11, 13 and 14: builds a scene, checks what holds for every scene, and judges rays at it from up to `size`
/// around.
pub fn build_and_judge(lab: &mut Lab, checks: &mut Checks, kind: Stiff, n: u32, bricks: u32, size: f64) -> Result<()> {
    let count = lab.share(4000);
    let mut stage = build_and_open(lab, checks, kind, n, bricks)?.judged(DVec3::ZERO)?;
    let rays = stage.aimed(&mut lab.random(&[11, kind as i64]), size, count);
    stage.note(checks, &kind.to_string(), &rays)?;
    Ok(())
}

/// Builds a scene, and checks what holds for every scene.
fn build_and_open(lab: &mut Lab, checks: &mut Checks, kind: Stiff, n: u32, bricks: u32) -> Result<Stage> {
    let Built { file, path, summary } = lab.build(stiff(kind, n, lab.seed), &settings(bricks, 0))?;
    let resident = file.resident();
    checks.at_least(&format!("{kind}, {n}: triangles"), summary.triangles_stored, u64::from(n).min(300));
    let highest = resident.bricks.iter().map(|brick| brick.height).max().unwrap_or(0);
    checks.at_most(&format!("{kind}: height of bricks"), highest, MAX_BRICK_HEIGHT);
    let largest = resident.bricks.iter().map(|brick| brick.triangle_count).max().unwrap_or(0);
    checks.at_most(&format!("{kind}: triangles of a brick"), largest, bricks);
    let report = file.verify(&mut |_, _| ())?;
    checks.holds(&format!("{kind}: every checksum and reference"), report.is_ok());
    let cache = if resident.bricks.len() > 8 { 50 } else { 100 };
    lab.open_stage(file, &path, &cached(cache))
}

/// Case 12: a million times the same triangle.
pub fn duplicates(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let (kind, n) = (Stiff::Duplicates, if lab.rays < 1_000_000 { 20_000 } else { 1_000_000 });
    let mut stage = build_and_open(lab, checks, kind, n, 16_384)?;
    let unit = stage.frame.unit;
    // Truth over a million copies of one triangle, all of which a ray meets: the first.
    let rays: Vec<Ray> = (0..lab.share(4000).min(32))
        .map(|i| {
            let x = 0.1 + 0.016 * i as f64;
            ray(DVec3::new(x, 0.1, 9.0) / unit, DVec3::new(x, 0.1, -9.0) / unit)
        })
        .collect();
    let other = stage.trace(&rays, false)?.iter().filter(|hit| hit.id != 0).count() as u64;
    checks.none(&format!("{kind}: rays that do not hit the first copy"), other, rays.len() as u64);
    Ok(())
}

/// Case 38: nothing, and one triangle.
pub fn least_scenes(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut stage = lab.stage(stiff(Stiff::Empty, 0, lab.seed), &settings(16, 0), &cached(100))?;
    let mut rng = lab.random(&[38]);
    let rays: Vec<Ray> = (0..512).map(|_| ray(10.0 * rng.direction(), 10.0 * rng.direction())).collect();
    checks.equal("nothing: misses", misses(&stage.trace(&rays, false)?), 512);

    let mut stage = lab.stage(stiff(Stiff::Triangle, 1, lab.seed), &settings(16, -20), &cached(100))?;
    let unit = stage.frame.unit;
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z) / unit;
    // The triangle (-1, -1), (1, -1), (0, 1) of the plane z = 0, seen from z = 4 and from behind: t is exactly 1/2.
    let grid = (-20..=20).flat_map(|i| (-20..=20).map(move |j| (f64::from(i) / 16.0, f64::from(j) / 16.0)));
    let cases: Vec<_> = grid.flat_map(|(x, y)| [4.0, -4.0].map(|z| (x, y, z))).collect();
    let rays: Vec<Ray> = cases.iter().map(|&(x, y, z)| ray(at(x, y, z), at(x, y, -z))).collect();
    let hits = stage.trace(&rays, false)?;
    let is_inside = |x: f64, y: f64| y >= -1.0 && y - 1.0 <= 2.0 * x && y - 1.0 <= -2.0 * x;
    let wrong = cases.iter().zip(&hits).filter(|((x, y, _), hit)| (hit.id == 0) != is_inside(*x, *y)).count() as u64;
    let wrong_t = hits.iter().filter(|hit| hit.id == 0 && hit.t != 0.5).count() as u64;
    let of = rays.len() as u64;
    checks.none("one triangle: rays that hit or miss wrongly", wrong, of);
    checks.none("one triangle: t other than 1/2", wrong_t, of);
    checks.equal("one triangle: bricks", stage.file.resident().bricks.len(), 1);
    Ok(())
}

/// Case 43: a scene without height.
pub fn flat_scene(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let square = [
        [[-4.0, 0.0, -4.0], [4.0, 0.0, -4.0], [4.0, 0.0, 4.0]],
        [[-4.0, 0.0, -4.0], [4.0, 0.0, 4.0], [-4.0, 0.0, 4.0]],
    ];
    let mut stage = lab.judged(seven(&square), &settings(16, 0), &cached(100))?;
    let manifest = stage.file.resident().manifest.clone();
    let path = path_from_bounds(manifest.min, manifest.max);
    let cameras: Vec<_> = (0..5).map(|k| path.frame(k, 5)).collect();
    let are_sound = cameras.iter().all(|camera| camera.check().is_ok());
    checks.holds("the camera path made from its bounds is sound", are_sound);
    let mut rng = lab.random(&[43]);
    let count = lab.share(5000);
    let rays: Vec<Ray> = (0..count)
        .map(|i| {
            let from = DVec3::new(rng.range(-5.0, 5.0), [2.0, -2.0, 0.0][i % 3], rng.range(-5.0, 5.0));
            let to = DVec3::new(rng.range(-4.5, 4.5), 0.0, rng.range(-4.5, 4.5));
            ray(from / stage.frame.unit, to / stage.frame.unit)
        })
        .collect();
    let hits = stage.note(checks, "rays at it and along it", &rays)?;
    checks.at_least("hits", count as u64 - misses(&hits), count as u64 / 4);
    let settings = Settings { cells: 32, ..Settings::default() };
    let levels = assemble(&stage.file, &settings, DVec3::new(1.0, 2.0, -1.0))?.levels;
    let points = (-16..=16).flat_map(|x| (-16..=16).map(move |z| DVec3::new(f64::from(x), 0.0, f64::from(z)) / 4.0));
    let coarsest = levels.last().context("the scene has occupancy")?;
    let (empty, of) = points.fold((0, 0), |(empty, of), p| {
        (empty + u64::from(!coarsest.is_occupied(coarsest.cell_at(p.to_array()))), of + 1)
    });
    checks.none("points of it in empty cells of the occupancy around it", empty, of);
    Ok(())
}
