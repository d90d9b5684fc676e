//! Rays that start on surfaces, and the places they start from (cases 21, 22, 26, 55).

use super::case::Checks;
use super::histories::{at_sphere, plain_sphere};
use super::lab::{Lab, Stage, camera, lit, mesh, scheduled, settings};
use super::rays::{Aim, lattice_point, ray};
use crate::kernels::frame::Frame;
use crate::kernels::layout::{Hit, NONE, Ray, Surface};
use crate::math::exact::{SurfacePoint, offset_origin};
use crate::reference::Truth;
use crate::schedule::Pass;
use crate::session::Settings;
use crate::session::trace::EXTENT;
use crate::settings::{Effect, EffectList, Length, Schedule, Turn};
use anyhow::Result;
use brickwalk_scenes::{Rng, Stiff, moved, stiff};
use glam::{DVec3, Vec3};

/// Traces `rays`, at most as many as fit at once, and reads where rays that leave their hits start.
fn surfaces(stage: &mut Stage, rays: &[Ray]) -> Result<Vec<(Hit, Surface)>> {
    let rays = &rays[..rays.len().min(EXTENT.rays())];
    let hits = stage.trace(rays, false)?;
    let surfaces = stage.opened.executor.read_surfaces(Pass::Primary)?;
    Ok(hits.into_iter().zip(surfaces).collect())
}

/// Sine of the least angle between a leaving ray and its surface. The edges of a triangle are rounded by u of their
/// length, which tilts its normal by some u times the triangle's aspect: less than 8 u · 100 here. A ray that is lower
/// may lead below the surface.
const LEAST_SINE: f64 = 1e-4;

/// A ray that leaves a surface, on the normal's side.
fn leaving(rng: &mut Rng, surface: &Surface, size: f64) -> Ray {
    let normal = Vec3::from(surface.normal).as_dvec3();
    let mut direction = rng.direction();
    while surface.leaf != NONE && direction.dot(normal).abs() < LEAST_SINE {
        direction = rng.direction();
    }
    if direction.dot(normal) < 0.0 {
        direction = -direction;
    }
    let mut one = ray(DVec3::ZERO, size * direction);
    one.origin = surface.point;
    one
}

/// Case 21: rays that leave a closed room's walls meet walls, and not the one that they start on.
pub fn leaving_rays(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let count = lab.share(60_000);
    for (name, kind, n, half) in
        [("cube", Stiff::Cube, 9, 0.8), ("bumpy sphere", Stiff::Shell, 3, 0.4), ("two fans", Stiff::Fans, 300, 0.2)]
    {
        let source = moved(stiff(kind, n, lab.seed), 0.0, 8.0, [3.0, -5.0, 7.0]);
        let stage = lab.stage(source, &settings(100, 0), &scheduled(100, Schedule::Plain))?;
        let mut stage = stage.judged(DVec3::new(3.0, -5.0, 7.0))?;
        let size = 8.0 / stage.frame.unit;
        let mut rng = lab.random(&[21, kind as i64]);
        let rays: Vec<Ray> = (0..count)
            .map(|i| {
                let origin = lattice_point(&mut rng, stage.middle, half * size, stage.step());
                stage.targets.ray(&mut rng, origin, Aim::ALL[i % 3])
            })
            .collect();
        let starts = surfaces(&mut stage, &rays)?;
        let met: Vec<&(Hit, Surface)> = starts.iter().filter(|(hit, _)| hit.id != NONE).collect();
        let leaving: Vec<Ray> = met.iter().map(|(_, surface)| leaving(&mut rng, surface, size)).collect();
        let hits = stage.trace(&leaving, false)?;
        let leaks = hits.iter().filter(|hit| hit.id == NONE).count() as u64;
        let selves = hits.iter().zip(&met).filter(|(hit, (from, _))| hit.id == from.id).count() as u64;
        checks.none(&format!("{name}: rays that leave the closed room"), leaks, hits.len() as u64);
        checks.none(&format!("{name}: rays that meet the triangle they start on"), selves, hits.len() as u64);
    }
    thin_gap(lab, checks)?;
    sky_in_a_box(lab, checks)
}

/// Between two walls (K + 4) u abs(p) apart and more, K = 32, a ray that leaves one meets the other.
fn thin_gap(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    // Two steps of 2^-20 at 0.4 from the reference point, where 36 u abs(p) is 0.9 of one.
    let (h, x) = (1.0 / 1_048_576.0, 419_430.0 / 1_048_576.0);
    let wall = |x: f64| [[x, -0.4, -0.4], [x, 0.4, -0.4], [x, 0.4, 0.4], [x, -0.4, 0.4]];
    let positions = [wall(x), wall(x + 2.0 * h)].concat();
    let indices = vec![0, 1, 2, 0, 2, 3, 4, 5, 6, 4, 6, 7];
    let source = mesh("two walls", positions, indices);
    let mut stage = lab.stage(source, &settings(16, -20), &scheduled(100, Schedule::Plain))?;
    let unit = stage.frame.unit;
    let mut rng = lab.random(&[21, 100]);
    let count = lab.share(20_000);
    let rays: Vec<Ray> = (0..count)
        .map(|i| {
            let from = DVec3::new(x + h, rng.range(-0.3, 0.3), rng.range(-0.3, 0.3)) / unit;
            ray(from, from + DVec3::new([1.0, -1.0][i % 2], rng.range(-0.5, 0.5), rng.range(-0.5, 0.5)))
        })
        .collect();
    let starts = surfaces(&mut stage, &rays)?;
    let leaving: Vec<Ray> = starts
        .iter()
        .map(|(_, surface)| {
            let mut one = leaving(&mut rng, surface, 1.0 / unit);
            // Steep enough that the walls' ends are far.
            one.direction[0] = one.direction[0].signum() / unit as f32;
            one
        })
        .collect();
    let hits = stage.trace(&leaving, false)?;
    let wall = |id: u32| id / 2;
    let wrong = starts
        .iter()
        .zip(&hits)
        .filter(|((from, _), to)| from.id == NONE || to.id == NONE || wall(from.id) == wall(to.id));
    checks.none("two walls 2 steps apart: rays that do not meet the other", wrong.count() as u64, count as u64);
    Ok(())
}

/// The closed form of the sky's light in a closed box: none. Every ray of diffuse light and of occlusion is traced by
/// the renderer.
fn sky_in_a_box(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let scene = lab.build(stiff(Stiff::Cube, 4, lab.seed), &settings(64, 0))?;
    let eye = [0.1, 0.2, -0.3];
    let views = [DVec3::new(1.0, 1.0, 1.0), DVec3::new(-1.0, 0.9, 0.3), DVec3::NEG_Y];
    let (sun_intensity, rotation) = (Some(0.0), Turn::FULL);
    let options =
        Settings { sun_intensity, rotation, ao_length: Length::World(10.0), aov: false, ..lit(64, 48, 100, 2) };
    let (mut lit, mut pixels) = (0, 0);
    for effect in [Effect::Ao, Effect::Diffuse] {
        let options = Settings { effects: EffectList::of(&[effect]), ..options.clone() };
        let mut renderer = lab.renderer(&scene, &options)?;
        for (k, view) in (0..).zip(views) {
            let radiance = renderer.frame(k, &camera(eye, DVec3::from(eye) + view, 1.7))?.pixels.radiance;
            lit += radiance.iter().filter(|c| c.iter().any(|&x| x != 0.0)).count() as u64;
            pixels += radiance.len() as u64;
        }
    }
    checks.none("closed box without a lamp: pixels that are not black", lit, pixels);
    Ok(())
}

/// Case 22: the point that rays start from is on the normal's side of its triangle, exactly; and known vectors.
pub fn offsets(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let up = |p: [f32; 3], delta: f32| SurfacePoint { p, delta, n: [0.0, 0.0, 1.0], down: 0, area: 1.0 };
    let known = [
        (up([1.0, 1.0, 1.0], 0.0), [1.0f32.next_up(), 1.0f32.next_up(), 1.0f32.next_up()]),
        (up([-1.0, 2.0, -1.0], 0.25), [(-1.0f32).next_up(), 2.0f32.next_up(), -0.75]),
        (up([0.0, 0.0, 0.0], 0.0), [0.5f32.powi(60); 3]),
    ];
    let wrong = known.iter().filter(|(s, expected)| offset_origin(s) != *expected).count() as u64;
    checks.none("known vectors that differ", wrong, known.len() as u64);

    let count = lab.share(30_000);
    let (mut behind, mut of) = (0, 0);
    for (kind, n) in [(Stiff::Shell, 3), (Stiff::Cube, 8)] {
        let mut stage = lab.judged(stiff(kind, n, lab.seed), &settings(100, -20), &scheduled(100, Schedule::Plain))?;
        let rays = stage.aimed(&mut lab.random(&[22]), 0.3, count);
        for ((hit, surface), ray) in surfaces(&mut stage, &rays)?.iter().zip(&rays) {
            if hit.id != NONE {
                of += 1;
                behind += u64::from(!is_before(&stage.truth, &stage.frame, hit.id, surface.point, ray.origin));
            }
        }
    }
    checks.none("points not on the ray's side of their triangle", behind, of);
    Ok(())
}

/// Whether `point` and `origin` lie strictly on the same side of a triangle's plane, in integers: vertices are
/// multiples of 2⁻²⁰ of a device unit below 2³¹, points are cut to multiples of 2⁻⁴⁰ below 2⁵¹, so that a volume has at
/// most 115 bits. The cut is less than 2⁻¹⁶ of the distance that is to be told from 0.
fn is_before(truth: &Truth, frame: &Frame, id: u32, point: [f32; 3], origin: [f32; 3]) -> bool {
    let Some(vertices) = truth.vertices(id) else { return false };
    let coarse = 2f64.powi(20);
    let fine = 2f64.powi(40);
    let lattice =
        vertices.map(|v| ((DVec3::from(v) - frame.origin) / frame.unit * coarse).to_array().map(|x| x as i128));
    let [a, b, c] = lattice;
    let minus = |p: [i128; 3], q: [i128; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let (ab, ac) = (minus(b, a), minus(c, a));
    let n = [ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]];
    let side = |p: [f32; 3]| {
        let p = p.map(|x| (f64::from(x) * fine) as i128);
        let v = minus(p, a.map(|x| x << 20));
        (n[0] * v[0] + n[1] * v[1] + n[2] * v[2]).signum()
    };
    side(point) == side(origin) && side(point) != 0
}

/// Case 26: eyes inside of geometry and of boxes.
pub fn inside(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let count = lab.share(8000);
    let mut stage =
        lab.judged(stiff(Stiff::FlatBoxes, 200, lab.seed), &settings(16, -10), &scheduled(40, Schedule::Chc))?;
    let unit = stage.frame.unit;
    let mut rng = lab.random(&[26]);
    let rays: Vec<Ray> = (0..count)
        .map(|i| {
            // On a triangle, beside it, or in the middle of everything.
            let on = stage.targets.point(&mut rng, Aim::ALL[i % 3]);
            let origin = [on, on + 1e-3 / unit * rng.direction(), DVec3::ZERO][i / 3 % 3];
            ray(origin, origin + rng.direction() / unit)
        })
        .collect();
    stage.note_both(checks, &rays)
}

/// Case 55: what reflects nothing stays black under sun and sky.
pub fn black(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let scene = lab.build(plain_sphere(lab.seed, 0.0), &settings(64, 0))?;
    let output = lab.renderer(&scene, &lit(64, 64, 100, 2))?.frame(0, &at_sphere())?;
    let met = || output.pixels.radiance.iter().zip(&output.pixels.id).filter(|(_, id)| **id != NONE);
    let lit = met().filter(|(c, _)| c.iter().any(|&x| x != 0.0)).count() as u64;
    checks.none("pixels of a black sphere that are not black", lit, met().count() as u64);
    let sky = output.pixels.radiance.iter().zip(&output.pixels.id).filter(|(c, id)| **id == NONE && c[0] > 0.0);
    checks.at_least("pixels of the sky that are not black", sky.count(), 500);
    super::histories::black(lab, checks)
}
