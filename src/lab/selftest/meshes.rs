//! Closed meshes: places far away, cuts into bricks, scales, edges and vertices (cases 1 to 5, 8, 20, 23, 59).
//!
//! **No false miss.** The rays start strictly inside of a closed mesh and have no end, so every one of them meets it:
//! the count of misses needs no reference. It is 0 because the test decides with exact signs on one planar map of the
//! mesh (docs/methods/exact.md, "Triangles").
//!
//! **Hits** are judged by [`crate::reference`]: the same id and a t within the interval that its bounds derive from γₙ
//! = n u / (1 − n u), u = 2⁻²⁴; a difference is excused only where f32 could not have told.

use super::case::Checks;
use super::lab::{Judged, Lab, cached, different, misses, scheduled, settings, triangles};
use super::rays::{Aim, Targets, lattice_point, ray};
use crate::kernels::layout::Ray;
use crate::reference::Tally;
use crate::settings::Schedule;
use anyhow::Result;
use brickwalk_scenes::{Stiff, moved, rotated_instances, stiff};
use glam::DVec3;
use rayon::prelude::*;

/// Shifts that are multiples of 2²⁰ steps of a lattice of 2⁻¹⁴ m.
pub const SHIFTS: [[f64; 3]; 2] = [[1e7, 0.0, 0.0], [1e6, -1e6, 1024.0]];

/// Shifts that are no multiples of anything.
pub const OTHER_SHIFTS: [[f64; 3]; 2] = [[12_345.678, -9_876.543_21, 1e5 / 3.0], [-7.1e6, 3.3e5, 0.1]];

/// Case 1: far from the origin all is as at the origin.
pub fn far_origin(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let count = lab.share(60_000);
    let mut expected = None;
    for shift in [[0.0; 3], SHIFTS[0], SHIFTS[1]] {
        let mut stage = far_shell(lab, 1.0 / 16384.0, shift)?;
        let rays = stage.aimed(&mut lab.random(&[1]), 0.3, count);
        let hits = stage.trace(&rays, false)?;
        let (tally, _) = stage.judge(&rays[..count.min(10_000)])?;
        let place = format!("{:.0} m away", DVec3::from(shift).length());
        checks.none(&format!("{place}: misses inside a closed mesh"), misses(&hits), count as u64);
        checks.judged(&place, &tally);
        let expected = expected.get_or_insert_with(|| hits.clone());
        checks.none(&format!("{place}: hits unlike those at the origin"), different(expected, &hits), count as u64);
    }
    // Elsewhere the lattice lies otherwise in the mesh, and hits are those of the mesh there.
    for shift in OTHER_SHIFTS {
        let mut stage = far_shell(lab, 0.0, shift)?;
        let count = count.min(10_000);
        let rays = stage.aimed(&mut lab.random(&[1]), 0.3, count);
        let (tally, hits) = stage.judge(&rays)?;
        let place = format!("{:.0} m away, beside the lattice", DVec3::from(shift).length());
        checks.none(&format!("{place}: misses inside a closed mesh"), misses(&hits), count as u64);
        checks.judged(&place, &tally);
    }
    Ok(())
}

/// A bumpy sphere, its vertices on multiples of `step`, around a place that rays are relative to.
fn far_shell(lab: &mut Lab, step: f64, shift: [f64; 3]) -> Result<Judged> {
    let source = moved(stiff(Stiff::Shell, 3, lab.seed), step, 1.0, shift);
    lab.stage(source, &settings(64, -14), &scheduled(100, Schedule::Plain))?.judged(shift.into())
}

/// Case 2: where a mesh is cut changes no bit.
pub fn cuts(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let count = lab.share(100_000);
    let mut expected = None;
    let ways =
        [(8192, 100, Schedule::Plain), (100, 100, Schedule::Chc), (16, 30, Schedule::Demand), (1, 20, Schedule::Chc)];
    for (bricks, cache, schedule) in ways {
        let source = stiff(Stiff::Shell, 3, lab.seed);
        let mut stage = lab.judged(source, &settings(bricks, -20), &scheduled(cache, schedule))?;
        let rays = stage.aimed(&mut lab.random(&[2]), 0.3, count);
        let hits = stage.trace(&rays, false)?;
        let name = format!("{} bricks", stage.file.resident().bricks.len());
        checks.none(&format!("{name}: misses inside a closed mesh"), misses(&hits), count as u64);
        let expected = expected.get_or_insert_with(|| hits.clone());
        checks.none(&format!("{name}: hits unlike those of one brick"), different(expected, &hits), count as u64);
    }
    Ok(())
}

/// Case 3: ten decades of size in one scene.
pub fn scale_mix(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let count = lab.share(1000);
    let mut stage = lab.judged(stiff(Stiff::ScaleMix, 1, lab.seed), &settings(64, -19), &cached(50))?;
    let mut rng = lab.random(&[3]);
    for (number, decade) in (-4..=6).enumerate() {
        let shell = Targets(stage.targets.0[80 * number..80 * (number + 1)].to_vec());
        let size = 10f64.powi(decade) / stage.frame.unit;
        let step = stage.step().min(size / 64.0);
        let rays = shell.aimed(&mut rng, (DVec3::ZERO, 0.1 * size), step, count);
        let (tally, hits) = stage.judge(&rays)?;
        checks.none(&format!("size 1e{decade}: misses from inside"), misses(&hits), count as u64);
        checks.judged(&format!("size 1e{decade}, from inside"), &tally);
        let rays = shell.aimed(&mut rng, (DVec3::ZERO, 40.0 * size), step, count);
        stage.note(checks, &format!("size 1e{decade}, from around"), &rays)?;
    }
    Ok(())
}

/// Case 4: scales from 10⁻¹² to 10¹².
pub fn scale_sweep(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let count = lab.share(4000);
    let mut run = |scale: f64| -> Result<_> {
        let source = moved(stiff(Stiff::Shell, 2, lab.seed), 0.0, scale, [0.0; 3]);
        let mut stage = lab.judged(source, &settings(64, 0), &cached(100))?;
        let rays = stage.aimed(&mut lab.random(&[4]), 0.3 * scale, count);
        stage.judge(&rays)
    };
    let (_, expected) = run(1.0)?;
    let (mut unlike, mut of) = (0, 0);
    for k in [-40, -27, -13, -1, 1, 14, 26, 40] {
        let (_, hits) = run(f64::from(k).exp2())?;
        unlike += different(&expected, &hits);
        of += hits.len() as u64;
    }
    checks.none("powers of two from 2^-40 to 2^40: hits unlike those at 1", unlike, of);
    let (mut sum, mut missed) = (Tally::default(), 0);
    for decade in (-12..=12).filter(|&decade| decade != 0) {
        let (tally, hits) = run(10f64.powi(decade))?;
        missed += misses(&hits);
        sum.join(tally);
    }
    checks.judged("powers of ten from 1e-12 to 1e12", &sum);
    checks.none("powers of ten: misses inside a closed mesh", missed, sum.total());
    Ok(())
}

/// Case 5: slivers a hundred million times longer than wide.
pub fn slivers(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let count = lab.share(5000);
    let mut stage = lab.judged(stiff(Stiff::Slivers, 4000, lab.seed), &settings(256, -32), &cached(50))?;
    let mut rng = lab.random(&[5]);
    let (unit, step) = (1.0 / stage.frame.unit, stage.step());
    let rays: Vec<Ray> = (0..count)
        .map(|i| {
            let origin = lattice_point(&mut rng, DVec3::ZERO, 2.0 * unit, step.max(unit / 1024.0));
            // At them, and beside them by some of their widths.
            let beside = [0.0, 1e-7, 1e-5][i % 3] * unit * rng.direction();
            ray(origin, stage.targets.point(&mut rng, Aim::ALL[i / 3 % 3]) + beside)
        })
        .collect();
    let hits = stage.note(checks, "slivers", &rays)?;
    checks.at_least("hits", hits.len() as u64 - misses(&hits), count as u64 / 200);
    Ok(())
}

/// Case 8: denormal components of rays are as zero.
pub fn denormals(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let count = lab.share(20_000);
    let mut stage = lab.stage(stiff(Stiff::Shell, 2, lab.seed), &settings(64, 0), &cached(100))?;
    let mut rng = lab.random(&[8]);
    let rays: Vec<[Ray; 2]> = (0..count)
        .map(|i| {
            let mut plain = ray(DVec3::ZERO, rng.direction());
            let k = rng.int(0, 2) as usize;
            plain.direction[k] = [0.0, -0.0][i % 2];
            if plain.direction.iter().all(|x| x.abs() < 1e-3) {
                plain.direction[(k + 1) % 3] = 1.0;
            }
            let tiny = f32::from_bits(rng.int(1, 0x7f_ffff) as u32);
            let mut denormal = plain;
            denormal.direction[k] = tiny.copysign(plain.direction[k]);
            denormal.origin[(k + i) % 3] = [tiny, -tiny][i / 2 % 2];
            [plain, denormal]
        })
        .collect();
    let [plain, denormal] = [0, 1].map(|which| rays.iter().map(|pair| pair[which]).collect::<Vec<_>>());
    let (a, b) = (stage.trace(&plain, false)?, stage.trace(&denormal, false)?);
    checks.none("misses inside a closed mesh", misses(&b), count as u64);
    checks.none("hits unlike those of zeros", different(&a, &b), count as u64);
    Ok(())
}

/// Case 20: rays at the edges and vertices of closed meshes.
pub fn edges(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let meshes = [
        ("bumpy sphere", Stiff::Shell, 4, 0.3, 512),
        ("two fans of 1000", Stiff::Fans, 1000, 0.2, 100),
        ("cube", Stiff::Cube, 16, 0.6, 256),
    ];
    let share = lab.rays.div_ceil(2 * meshes.len());
    let mut total = 0;
    for (name, kind, n, half, bricks) in meshes {
        for shift in [[0.0; 3], SHIFTS[0]] {
            let source = moved(stiff(kind, n, lab.seed), 0.0, 1.0, shift);
            let stage = lab.stage(source, &settings(bricks, -14), &scheduled(100, Schedule::Plain))?;
            let mut stage = stage.judged(shift.into())?;
            let (mut missed, mut traced) = (0, 0);
            let mut first = None;
            while traced < share {
                let count = (share - traced).min(1 << 16);
                let rays = at_edges(lab, &stage, half, &[20, kind as i64, traced as i64], count);
                let hits = stage.trace(&rays, false)?;
                missed += misses(&hits);
                if first.is_none() {
                    let judged: Vec<Ray> = rays.iter().step_by(ALIKE).take(lab.share(1000)).copied().collect();
                    first = Some(stage.judge(&judged)?.0);
                }
                traced += count;
            }
            total += traced;
            let place = format!("{name}, {:.0} m away", DVec3::from(shift).length());
            checks.none(&format!("{place}: misses"), missed, traced as u64);
            checks.judged(&place, &first.unwrap_or_default());
        }
    }
    checks.at_least("rays", total, lab.rays);
    Ok(())
}

/// Rays in a row that are alike.
const ALIKE: usize = 8;

/// Rays from within `half` at vertices and points of edges by turns. [`ALIKE`] that follow each other start within a
/// thousandth of the room and aim at one vertex or edge: where lanes run in lockstep, they go one way.
fn at_edges(lab: &Lab, stage: &Judged, half: f64, key: &[i64], count: usize) -> Vec<Ray> {
    const RUN: usize = 4096;
    let (targets, half, step) = (&stage.targets, half / stage.frame.unit, stage.step());
    let runs: Vec<Vec<Ray>> = (0..count.div_ceil(RUN))
        .into_par_iter()
        .map(|run| {
            let mut rng = lab.random(&[key, &[run as i64]].concat());
            let mut rays = Vec::with_capacity(RUN);
            for group in 0..RUN / ALIKE {
                let near = lattice_point(&mut rng, DVec3::ZERO, 0.9 * half, step);
                let triangle = targets.triangle(&mut rng);
                let fine = if group % 4 < 2 { step } else { step / 4096.0 };
                for _ in 0..ALIKE {
                    let origin = lattice_point(&mut rng, near, 0.1 * half, fine);
                    let aim = Aim::ALL[group % 2].point(&mut rng, triangle);
                    rays.push(ray(origin, aim));
                }
            }
            rays.truncate(count - (run * RUN).min(count));
            rays
        })
        .collect();
    runs.concat()
}

/// Case 23: rays that graze a floor at 10⁻⁷ rad.
pub fn grazing(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let count = lab.share(20_000);
    // A cube of side 64 whose floor is at y = 0, where f32 has steps fine enough for such rays.
    let source = moved(stiff(Stiff::Cube, 16, lab.seed), 0.0, 32.0, [0.0, 32.0, 0.0]);
    let mut stage = lab.judged(source, &settings(128, -20), &cached(100))?;
    let mut rng = lab.random(&[23]);
    let rays: Vec<Ray> = (0..count)
        .map(|_| {
            let angle = 1e-7 * 4f64.powf(rng.range(-1.0, 1.0));
            let turn = rng.range(0.0, std::f64::consts::TAU);
            let length = rng.range(1.0, 30.0);
            let origin = DVec3::new(rng.range(-1.0, 1.0), angle * length, rng.range(-1.0, 1.0)) / stage.frame.unit;
            let mut grazing = ray(origin, origin + DVec3::X);
            grazing.direction = [turn.cos() as f32, -angle as f32, turn.sin() as f32];
            grazing
        })
        .collect();
    let hits = stage.note(checks, "grazing", &rays)?;
    checks.none("misses inside a closed mesh", misses(&hits), count as u64);
    needles(lab, checks)
}

/// Rays in the planes of long triangles: the plane says nothing of t, and the triangle's own slabs must hold it, or
/// what is pruned depends on the order. A point of the ray at t lies in the triangle's box grown by the kernel's 32 u
/// of the greatest coordinate, as seen from the origin, and by its rounding, at most 8 u more; 64 u are allowed.
fn needles(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut rng = lab.random(&[23, 1]);
    // Each: a point to look from, the direction of view, and the one along the needle; on one axis the needle has
    // hardly any extent.
    let needles: Vec<[DVec3; 6]> = (0..400)
        .map(|i| {
            let base = DVec3::new(rng.range(-1.0, 1.0), rng.range(-1.0, 1.0), rng.range(-1.0, 1.0));
            let (mut d, mut along) = (DVec3::ZERO, DVec3::ZERO);
            (d[i % 3], d[(i + 1) % 3], d[(i + 2) % 3]) = (1.0, rng.range(0.3, 0.9), rng.range(0.1, 0.9));
            (along[i % 3], along[(i + 2) % 3]) = (1.0, rng.range(-1.0, 1.0));
            let (long, thin) = (rng.range(1.0, 5.0), rng.range(0.0, 0.002));
            let at = |s: f64, t: f64| base + t * d + s * along;
            [base, d, along, at(-long, 20.0), at(long, 20.0), at(0.7 * long, 20.0 + thin)]
        })
        .collect();
    let corners: Vec<_> = needles.iter().map(|n| [n[3], n[4], n[5]].map(|p| p.to_array())).collect();
    let source = triangles("needles", &corners);
    let mut stage = lab.judged(source, &settings(32, -20), &scheduled(40, Schedule::Chc))?;
    let unit = stage.frame.unit;
    let rays: Vec<Ray> = (0..lab.share(20_000))
        .map(|i| {
            let [base, d, along, ..] = needles[i % needles.len()];
            let origin = base + rng.range(-0.9, 0.9) * along;
            ray(origin / unit, (origin + d) / unit)
        })
        .collect();
    let hits = stage.trace(&rays, false)?;
    let (mut outside, mut met) = (0, 0);
    for (ray, hit) in rays.iter().zip(&hits) {
        let Some(vertices) = stage.truth.vertices(hit.id) else { continue };
        let [o, d] = [ray.origin, ray.direction].map(|v| DVec3::from(v.map(f64::from)));
        let [a, b, c] = vertices.map(|v| (DVec3::from(v) - stage.frame.origin) / unit - o);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let slack = 64.0 * 2f64.powi(-24) * low.abs().max(high.abs()).max_element();
        let at = f64::from(hit.t) * d;
        met += 1;
        outside += u64::from(at.cmplt(low - slack).any() || at.cmpgt(high + slack).any());
    }
    checks.none("along needles: hits outside of their triangle's box grown by 64 u", outside, met);
    Ok(())
}

/// Case 59: instances that are turned, mirrored and scaled unevenly.
pub fn instances(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let count = lab.share(12_000);
    let mut stage = lab.judged(rotated_instances(lab.seed), &settings(256, 0), &cached(40))?;
    let rays = stage.aimed(&mut lab.random(&[59]), 8.0, count);
    stage.note_both(checks, &rays)?;
    checks.at_least("instances", stage.file.resident().instances.len(), 16);
    Ok(())
}
