//! Rays as they are given, cameras, pictures (cases 24, 25, 27 to 30, 60, and the pictures of case 1).

use super::case::Checks;
use super::lab::{Lab, cached, camera, lit, misses, primary, scheduled, settings, tally};
use super::meshes::{OTHER_SHIFTS, SHIFTS};
use crate::frame::{Pixels, Renderer};
use crate::kernels::frame::Frame;
use crate::kernels::layout::{NONE, Ray};
use crate::output::npy;
use crate::reference::{Tally, Truth};
use crate::scene::Camera;
use crate::schedule::Pass;
use crate::session::Settings;
use crate::session::trace::{check, device_ray, trace};
use crate::settings::Schedule;
use anyhow::Result;
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::SourceScene;
use brickwalk_scenes::{Kind, Settings as Generated, Stiff, generate, moved, stiff};
use glam::DVec3;

/// The smallest city, on a lattice of 2⁻¹⁴ m, moved.
///
/// # Errors
/// It cannot be generated.
pub fn city(seed: u64, shift: [f64; 3]) -> Result<SourceScene> {
    let settings = Generated { kind: Kind::City, triangles: 10_000, seed, ..Generated::default() };
    Ok(moved(generate(&settings, &Progress::hidden())?.whole(), 1.0 / 16384.0, 1.0, shift))
}

/// Eyes in the city, on its lattice.
pub fn in_city(k: u32, shift: [f64; 3]) -> Camera {
    let eyes =
        [([2.0, 1.75, 1.0], [30.0, 3.0, 8.0]), ([-3.5, 1.75, 12.0], [0.0, 2.5, -40.0]), ([40.0, 30.0, 40.0], [0.0; 3])];
    let (position, target) = eyes[k as usize % 3];
    let moved = |p: [f64; 3]| DVec3::from(p) + DVec3::from(shift);
    camera(moved(position).to_array(), moved(target), 1.0)
}

/// How many pixels differ in any bit.
pub fn pixels_unlike(a: &Pixels, b: &Pixels) -> u64 {
    let bits = |p: &Pixels, i: usize| {
        let aov = p
            .depth
            .get(i)
            .map(|d| (d.to_bits(), p.id[i], p.normal[i].map(f32::to_bits), p.albedo[i].map(f32::to_bits)));
        (p.radiance[i].map(f32::to_bits), aov)
    };
    (0..a.radiance.len()).filter(|&i| bits(a, i) != bits(b, i)).count() as u64
}

/// Case 1, of pictures: the city far away is the city at the origin.
///
/// # Errors
/// The builder's, the device's.
pub fn far_city(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let options = Settings { schedule: Schedule::Chc, ..lit(96, 64, 30, 1) };
    let mut expected: Vec<Pixels> = Vec::new();
    for shift in [[0.0; 3], SHIFTS[0], SHIFTS[1]] {
        let scene = lab.build(city(lab.seed, shift)?, &settings(1024, -14))?;
        let mut renderer = lab.renderer(&scene, &options)?;
        let (mut unlike, mut of, mut met) = (0, 0, 0);
        for k in 0..3 {
            let pixels = renderer.frame(k, &in_city(k, shift))?.pixels;
            met += pixels.id.iter().filter(|&&id| id != NONE).count();
            of += pixels.radiance.len() as u64;
            match expected.get(k as usize) {
                Some(expected) => unlike += pixels_unlike(expected, &pixels),
                None => expected.push(pixels),
            }
        }
        let place = format!("city {:.0} m away", DVec3::from(shift).length());
        checks.none(&format!("{place}: pixels unlike those at the origin"), unlike, of);
        checks.at_least(&format!("{place}: pixels that show something"), met, 1000);
    }
    // Elsewhere: the rule of exactness.
    for shift in OTHER_SHIFTS {
        let scene = lab.build(city(lab.seed, shift)?, &settings(1024, -14))?;
        let mut renderer = lab.renderer(&scene, &primary(96, 64, 30, Schedule::Chc))?;
        let camera = in_city(0, shift);
        renderer.frame(0, &camera)?;
        let (tally, missed) = judge_picture(&mut renderer, &Truth::load(&scene.file)?, &camera)?;
        let place = format!("city {:.0} m away, beside the lattice", DVec3::from(shift).length());
        checks.judged(&place, &tally);
        checks.at_least(&format!("{place}: pixels that show something"), tally.total() - missed, 1000);
    }
    Ok(())
}

/// Case 24: directions of all lengths; none at all.
pub fn directions(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut stage = lab.stage(stiff(Stiff::Shell, 2, lab.seed), &settings(64, 0), &cached(100))?;
    let mut rng = lab.random(&[24]);
    let count = lab.share(4000);
    let base: Vec<npy::Ray> = (0..count)
        .map(|_| npy::Ray {
            origin: (0.2 * rng.direction()).to_array(),
            direction: rng.direction().to_array(),
            t_min: 0.0,
            t_max: f64::INFINITY,
        })
        .collect();
    let (expected, _) = trace(&mut stage.opened.traced(), &base, false, &mut |_| ())?;
    let (mut unlike, mut of) = (0, 0);
    for power in [-1000, -300, -60, -1, 1, 60, 300, 1000] {
        let length = f64::from(power / 2).exp2() * f64::from(power - power / 2).exp2();
        let scaled: Vec<npy::Ray> =
            base.iter().map(|ray| npy::Ray { direction: ray.direction.map(|x| x * length), ..*ray }).collect();
        let (hits, _) = trace(&mut stage.opened.traced(), &scaled, false, &mut |_| ())?;
        let same = |(a, b): &(&npy::Hit, &npy::Hit)| a.triangle == b.triangle && a.t / length == b.t && a.u == b.u;
        unlike += expected.iter().zip(&hits).filter(|pair| !same(pair)).count() as u64;
        of += count as u64;
    }
    checks.none("lengths from 2^-1000 to 2^1000: hits unlike those of unit length, t scaled", unlike, of);
    let zero = npy::Ray { direction: [0.0, -0.0, 0.0], ..base[0] };
    checks.refuses("direction of no length", check(&zero), &["no length"]);
    let nan = npy::Ray { direction: [f64::NAN, 1.0, 0.0], ..base[0] };
    checks.refuses("direction that is not a number", check(&nan), &["finite"]);
    Ok(())
}

/// Case 25: intervals: empty, a single point, endless.
pub fn intervals(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut stage = lab.judged(stiff(Stiff::Shell, 3, lab.seed), &settings(64, -20), &scheduled(40, Schedule::Chc))?;
    let count = lab.share(20_000);
    let rays = stage.aimed(&mut lab.random(&[25]), 0.3, count);
    let hits = stage.trace(&rays, false)?;
    let of = count as u64;
    let mut run = |change: &dyn Fn(&Ray, f32) -> Ray, any: bool| -> Result<Vec<u32>> {
        let changed: Vec<Ray> = rays.iter().zip(&hits).map(|(ray, hit)| change(ray, hit.t)).collect();
        Ok(stage.trace(&changed, any)?.iter().map(|hit| hit.id).collect())
    };
    let unlike = |ids: &[u32]| ids.iter().zip(&hits).filter(|(id, hit)| **id != hit.id).count() as u64;
    let found = |ids: &[u32]| ids.iter().filter(|&&id| id != NONE).count() as u64;
    // Closed at both ends: the one point that is left is the hit.
    let point = run(&|ray, t| Ray { t_min: t, t_max: t, ..*ray }, false)?;
    checks.none("t_min = t_max = t of the hit: other hits", unlike(&point), of);
    let up_to = run(&|ray, t| Ray { t_max: t, ..*ray }, false)?;
    checks.none("t_max = t of the hit: other hits", unlike(&up_to), of);
    let short = run(&|ray, t| Ray { t_max: t.next_down(), ..*ray }, false)?;
    checks.none("t_max just below t of the hit: hits", found(&short), of);
    let short = run(&|ray, t| Ray { t_max: t.next_down(), ..*ray }, true)?;
    checks.none("t_max just below t of the hit: occluded", found(&short), of);
    let empty = run(&|ray, t| Ray { t_min: t.next_up(), t_max: t.next_down(), ..*ray }, false)?;
    checks.none("t_min above t_max: hits", found(&empty), of);
    let given = |t_min: f64, t_max: f64| npy::Ray { origin: [0.0; 3], direction: [1.0, 2.0, 3.0], t_min, t_max };
    let is_empty = |given: &npy::Ray| {
        let ray = device_ray(given, &stage.frame).ray;
        ray.t_min > ray.t_max
    };
    checks.holds("given: t_min above t_max is an empty interval", is_empty(&given(2.0, 1.0)));
    checks.holds("given: t_max = inf is not", !is_empty(&given(0.0, f64::INFINITY)));
    checks.refuses("given: t_max = NaN", check(&given(0.0, f64::NAN)), &["numbers"]);
    Ok(())
}

/// How far a camera's axes are from right-handed and orthonormal.
fn deviation(camera: &Camera) -> f64 {
    let (right, up, forward) = camera.frame();
    let lengths = [right, up, forward].map(|v| (v.length() - 1.0).abs());
    let angles =
        [right.dot(up).abs(), up.dot(forward).abs(), forward.dot(right).abs(), (right.cross(up) + forward).length()];
    lengths.into_iter().chain(angles).fold(0.0, |worst, x| if x > worst || x.is_nan() { x } else { worst })
}

/// Case 27: an up vector along the view.
pub fn up_along_view(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut rng = lab.random(&[27]);
    let mut worst = 0.0f64;
    for i in 0..3000 {
        let up = if i < 6 { [DVec3::X, DVec3::Y, DVec3::Z][i / 2] } else { rng.direction() };
        let lean = [0.0, 1e-16, 1e-12, 1e-8][i % 4] * rng.direction();
        let along = if i % 2 == 0 { up } else { -up };
        let camera = Camera { position: DVec3::ZERO, target: 5.0 * along + lean, up, fov_y: 1.0 };
        let found = deviation(&camera);
        worst = if found.is_nan() { found } else { worst.max(found) };
    }
    // Each axis is a cross product of unit vectors and normalised: a handful of roundings of 2^-53, twice.
    checks.at_most("deviation from orthonormal axes", worst, 32.0 * 2f64.powi(-53));
    Ok(())
}

/// Case 28: fields of view from 10⁻⁶ to 179.99 degrees.
pub fn fields_of_view(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let scene = lab.build(stiff(Stiff::Shell, 3, lab.seed), &settings(64, 0))?;
    let truth = Truth::load(&scene.file)?;
    for degrees in [1e-6, 1e-3, 1.0, 90.0, 179.0, 179.99] {
        let camera = camera([0.1, 0.0, 0.2], DVec3::X, f64::to_radians(degrees));
        let basis = camera.ray_basis(64, 48);
        let vectors = [basis.b, basis.dx, basis.dy].into_iter().all(|v| v.is_finite() && v != DVec3::ZERO);
        checks.holds(&format!("{degrees} degrees: rays are finite"), vectors);
        let options = Settings { aov: true, ..primary(64, 48, 40, Schedule::Chc) };
        let mut renderer = lab.renderer(&scene, &options)?;
        let pixels = renderer.frame(0, &camera)?.pixels;
        let (tally, missed) = judge_picture(&mut renderer, &truth, &camera)?;
        checks.none(&format!("{degrees} degrees: unexcused differences from truth"), tally.mismatches, tally.total());
        checks.none(&format!("{degrees} degrees: pixels that miss a closed mesh"), missed, 64 * 48);
        checks.holds(
            &format!("{degrees} degrees: pixels are finite"),
            pixels.radiance.iter().flatten().all(|x| x.is_finite()),
        );
    }
    Ok(())
}

/// Judges the primary hits of the frame just rendered; also how many are misses.
fn judge_picture(renderer: &mut Renderer, truth: &Truth, camera: &Camera) -> Result<(Tally, u64)> {
    let frame = Frame::near(renderer.scene.resident(), camera.position);
    let (rays, hits) = (renderer.executor.read_rays(Pass::Primary)?, renderer.executor.read_hits(Pass::Primary)?);
    Ok((tally(truth, &frame, &rays, &hits), misses(&hits)))
}

/// Cases 29 and 30: renders pictures of odd sizes from inside of a closed mesh with each schedule.
pub fn odd_sizes(lab: &mut Lab, checks: &mut Checks, sizes: &[(u32, u32)], tiles: &[u32]) -> Result<()> {
    let scene = lab.build(stiff(Stiff::Shell, 3, lab.seed), &settings(32, 0))?;
    let truth = Truth::load(&scene.file)?;
    let camera = camera([0.1, 0.0, 0.2], DVec3::X, 1.4);
    for &(w, h) in sizes {
        let (mut wrong, mut missed, mut rays, mut pixels) = (0, 0, 0, 0);
        for &tile in tiles {
            for schedule in [Schedule::Chc, Schedule::Demand, Schedule::Plain] {
                let options = Settings { tile, aov: true, ..primary(w, h, 100, schedule) };
                let mut renderer = lab.renderer(&scene, &options)?;
                let output = renderer.frame(0, &camera)?;
                let (tally, out) = judge_picture(&mut renderer, &truth, &camera)?;
                wrong += tally.mismatches;
                missed += out;
                rays += output.records.iter().map(|record| record.rays_traced).sum::<u64>();
                pixels += u64::from(w) * u64::from(h);
            }
        }
        checks.equal(&format!("{w}x{h}: rays traced"), rays, pixels);
        checks.none(&format!("{w}x{h}: unexcused differences from truth"), wrong, pixels);
        checks.none(&format!("{w}x{h}: pixels that miss a closed mesh"), missed, pixels);
    }
    Ok(())
}

/// Case 60: ten runs are one.
pub fn ten_runs(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let scene = lab.build(city(lab.seed, [0.0; 3])?, &settings(512, -14))?;
    let options = Settings { schedule: Schedule::Chc, ..lit(80, 56, 25, 1) };
    let mut expected: Option<Pixels> = None;
    let (mut unlike, mut of) = (0, 0);
    for _ in 0..10 {
        let pixels = lab.renderer(&scene, &options)?.frame(0, &in_city(0, [0.0; 3]))?.pixels;
        of += pixels.radiance.len() as u64;
        unlike += pixels_unlike(expected.get_or_insert_with(|| pixels.clone()), &pixels);
    }
    checks.none("ten runs: pixels unlike those of the first", unlike, of);
    Ok(())
}
