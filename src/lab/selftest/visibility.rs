//! Fields of visibility (cases 47, 48, 49 and 51).

use super::case::Checks;
use super::lab::{Lab, camera, picture, settings};
use crate::frame::{Equirectangular, environment};
use crate::kernels::Lamps;
use crate::kernels::layout::{DvfTriangle, MET, NONE, Ray};
use crate::schedule::{Lamp, Pass, Step};
use crate::secondary::dvf::maps::{DvfMaps, directions, sum};
use crate::secondary::dvf::{
    Areas, Cells, Dvf, DvfField, DvfSettings, DvfTracing, DvfUse, Region, Shape, kernels, mask,
};
use crate::session::Settings;
use crate::settings::{Effect, EffectList};
use anyhow::Result;
use brickwalk_scenes::{Stiff, stiff};
use glam::DVec3;
use std::f64::consts::PI;
use std::sync::Arc;

const PASS: Pass = Pass::Shadow(Lamp::Environment);

/// Case 47: of two cells one knows a way out upward and nothing else: rays upward from it are answered, also from its
/// lower faces; those from its upper ones, which belong to the next cell, in other directions, from the other cell and
/// from outside are traced.
pub fn unknown(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut stage = lab.bare_stage()?;
    stage.begin_frame();
    let frame = stage.frame;
    // Cells on whole numbers of device units, so that points on faces are exact.
    let corner = frame.origin;
    let shape = Shape { corner, side: frame.unit, size: [2, 1, 1], octahedral: 8 };
    let mut field = DvfField::unknown(shape);
    let up = mask::texel([0.0, 1.0, 0.0], 8);
    field.masks[up as usize / 32] |= 1 << (up % 32);
    field.finish(false);
    checks.equal("cells of which something is known", field.known_cells(), 1);
    let executor = &mut *stage.opened.executor;
    let ray = |origin: [f32; 3], direction: [f32; 3]| Ray { origin, t_min: 0.0, direction, t_max: f32::MAX };
    let (upward, aside) = ([1e-3, 1.0, 1e-3], [1.0, 0.1, 0.1]);
    let cases = [
        ("inside, upward", ray([0.5, 0.5, 0.5], upward), true),
        ("on a lower face", ray([0.0, 0.5, 0.5], upward), true),
        ("on a lower corner", ray([0.0; 3], upward), true),
        ("on the face to the empty cell", ray([1.0, 0.5, 0.5], upward), false),
        ("just before it", ray([1.0 - f32::EPSILON / 2.0, 0.5, 0.5], upward), true),
        ("on an outer face", ray([0.5, 1.0, 0.5], upward), false),
        ("in a direction that no ray took", ray([0.5, 0.5, 0.5], aside), false),
        ("in the empty cell", ray([1.5, 0.5, 0.5], upward), false),
        ("outside", ray([-0.5, 0.5, 0.5], upward), false),
        ("far outside", ray([1e30, -1e30, 0.5], upward), false),
    ];
    let rays: Vec<Ray> = cases.iter().map(|case| case.1).collect();
    let field = Arc::new(field);
    DvfMaps::to_answer(&field, &frame, DvfUse { doubt: true, ..DvfUse::default() }).give(executor)?;
    executor.set_rays(PASS, &rays);
    let report = executor.run(PASS, &[Step::StartHits, kernels::sift()], &stage.opened.cache.states)?;
    let hits = executor.read_hits(PASS)?;
    for ((what, ray, is_answered), hit) in cases.iter().zip(&hits) {
        checks.equal(&format!("{what}: answered"), hit.t < ray.t_min, *is_answered);
        checks.equal(&format!("{what}: said to be met"), hit.id == MET, false);
        checks.equal(&format!("{what}: nothing was met"), hit.id == NONE, true);
    }
    let expected = cases.iter().filter(|case| case.2).count() as u64;
    checks.equal("rays answered", report.counters.rays_answered, expected);
    Ok(())
}

/// Triangles of a group of case 48: a binding holds some 2.8 million.
const GROUP: usize = 1 << 20;

/// Case 48: areas from 10^-12 to 10^6, summed and shared out by the device: sums against f64, prefix sums of points
/// that never fall, at least one point a triangle, their numbers against f64.
pub fn prefix_sums(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut stage = lab.bare_stage()?;
    let count = if lab.rays >= 1_000_000 { 3_000_000 } else { 3 * lab.share(1_000_000) };
    let mut random = lab.random(&[48]);
    let triangles: Vec<DvfTriangle> = (0..count as u32)
        .map(|id| {
            let area = 10f64.powf(random.range(-12.0, 6.0));
            // Twice the area is the product of the legs.
            let leg = area.sqrt() as f32;
            DvfTriangle { b: [leg, 0.0, 0.0], c: [0.0, leg, 0.0], id, ..DvfTriangle::default() }
        })
        .collect();
    let area = |t: &DvfTriangle| f64::from(t.b[0]) * f64::from(t.c[1]);
    let truth: f64 = triangles.iter().map(area).sum();
    stage.begin_frame();
    let frame = stage.frame;
    let executor = &mut *stage.opened.executor;
    let states = &stage.opened.cache.states;
    let shape = Shape::new(DVec3::ZERO, DVec3::ONE, 1, 8);
    let plan = DvfSettings { points: 10_000_000, rays: 1, ..DvfSettings::default() };
    let table = Arc::new(directions(1));
    let mut areas = Areas::of(count as u64, 1e6);
    let mut total = 0u64;
    for group in triangles.chunks(GROUP) {
        DvfMaps::to_make(&shape, &frame, &plan, 1, &areas, &table).give(executor)?;
        kernels::give_triangles(executor, group, 0)?;
        executor.run(PASS, &kernels::areas(group.len() as u32), states)?;
        let before = total;
        total += kernels::read_sums(executor)?.last().map_or(0, |&words| sum(words));
        checks.holds("a group adds at least one step a triangle", total - before >= group.len() as u64);
    }
    areas = areas.with_sum(total);
    // A rounding of the leg, of the product, of the sum's steps: the least area of one step adds 3M of 2^-41 of 10^6.
    checks.at_most("relative error of the sum", (f64::from(areas.total) / truth - 1.0).abs(), 1e-6);
    let (mut falls, mut empty, mut wrong, mut points) = (0u64, 0u64, 0u64, 0u64);
    for group in triangles.chunks(GROUP) {
        DvfMaps::to_make(&shape, &frame, &plan, 1, &areas, &table).give(executor)?;
        kernels::give_triangles(executor, group, 0)?;
        executor.run(PASS, &kernels::counts(group.len() as u32), states)?;
        let sums = kernels::read_sums(executor)?;
        let last = sums.last().map_or(0, |words| words[0]);
        let prefix: Vec<u32> = sums[..group.len()].iter().map(|words| words[0]).chain([last]).collect();
        falls += prefix.windows(2).filter(|pair| pair[1] < pair[0]).count() as u64;
        empty += prefix.windows(2).filter(|pair| pair[1] == pair[0]).count() as u64;
        for (pair, t) in prefix.windows(2).zip(group) {
            let share = 10_000_000.0 * area(t) / truth;
            // The share's relative error may carry it over a whole number.
            let near = (share * 1e-5).max(1e-5);
            let (least, most) = ((share - near).ceil().max(1.0), (share + near).ceil().max(1.0));
            let found = f64::from(pair[1].wrapping_sub(pair[0]));
            wrong += u64::from(!(least..=most).contains(&found));
        }
        points += u64::from(last);
    }
    checks.none("prefix sums below the one before", falls, count as u64);
    checks.none("triangles without a point", empty, count as u64);
    checks.none("numbers of points that are not the share", wrong, count as u64);
    checks.at_least("points", points, 10_000_000);
    Ok(())
}

/// Case 49: what a white surface reflects of a light from one direction by spherical harmonics of order 2, over the
/// light: 1.0625 toward it, least at a cosine of -8/15, with -0.03958.
pub fn delta_light(_: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut image = Equirectangular { width: 512, height: 256, texels: vec![[0.0; 3]; 512 * 256] };
    let (column, row) = (300, 90);
    image.texels[row * 512 + column] = [1.0; 3];
    // The middle of the texel, and its solid angle.
    let (up, around) = (PI * (row as f64 + 0.5) / 256.0, 2.0 * PI * ((column as f64 + 0.5) / 512.0 - 0.5));
    let toward = DVec3::new(up.sin() * around.sin(), up.cos(), -up.sin() * around.cos());
    let angle = 2.0 * PI / 512.0 * ((PI * row as f64 / 256.0).cos() - (PI * (row as f64 + 1.0) / 256.0).cos());
    let ambient = environment(image, 1.0, 0.0).0.ambient.map(|c| f64::from(c[0]));
    // The sum of `shaders/shade/light.wgsl`, in f64 and before what lies below 0 is cut off.
    let reflected = |n: DVec3| {
        let terms = [1.0, n.y, n.z, n.x, n.x * n.y, n.y * n.z, 3.0 * n.z * n.z - 1.0, n.x * n.z, n.x * n.x - n.y * n.y];
        terms.iter().zip(&ambient).map(|(term, factor)| term * factor).sum::<f64>() * PI / angle
    };
    let across = toward.any_orthonormal_vector();
    let at = |cosine: f64| reflected(cosine * toward + (1.0 - cosine * cosine).max(0.0).sqrt() * across);
    // Nine factors in f32, of terms of at most 3.
    let bound = 1e-5;
    checks.at_most("error toward the light", (at(1.0) - 1.0625).abs(), bound);
    let steps = 30_000;
    let (least, place) = (0..=steps)
        .map(|i| 2.0 * f64::from(i) / f64::from(steps) - 1.0)
        .map(|cosine| (at(cosine), cosine))
        .fold((f64::MAX, 0.0), |best, found| if found.0 < best.0 { found } else { best });
    let truth: f64 = 0.25 - 4.0 / 15.0 + 5.0 / 32.0 * (3.0 * 64.0 / 225.0 - 1.0);
    checks.at_most("-0.03958 as the closed form has it", (truth + 0.03958).abs(), 5e-6);
    checks.at_most("error of the least", (least - truth).abs(), bound);
    // About its least the sum is flat: an error of 1e-5 moves it by (1e-5 / 0.47)^0.5.
    checks.at_most("distance of its place from -8/15", (place + 8.0 / 15.0).abs(), 0.005);
    Ok(())
}

/// Case 51: in a closed box nothing of a bright environment is seen, whether rays are traced or answered: all light
/// that was counted is taken off again.
pub fn closed_box(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let scene = lab.build(stiff(Stiff::Cube, 4, lab.seed), &settings(64, 0))?;
    let camera = camera([0.1, 0.2, -0.3], DVec3::X, 1.5);
    let effects = EffectList::of(&[Effect::Environment]);
    let options = Settings { spp: 4, sun_intensity: Some(0.0), effects, ..picture(64, 64, 100) };
    let mut renderer = lab.renderer(&scene, &options)?;
    let image = Equirectangular::of(32, 16, |[x, y, z]| [1e4 * (1.1 + x), 1e4 * (1.1 + y), 1e4 * (1.1 + z)]);
    renderer.light.lamps = Arc::new(Lamps::new(Some(environment(image, 1.0, 0.0).0), Vec::new(), 1.0));
    // The front of the cube is outside.
    // So coarse that as few rays reach every texel.
    let plan = DvfSettings { octahedral: 16, points: 4000, rays: 64, both: true, ..DvfSettings::default() };
    let plan = DvfSettings { cells: Cells::Longest(4), ..plan };
    let made =
        renderer.make_dvf(&plan, &Region::scene(scene.file.resident()), DvfTracing::over(64), &mut |_, _| true)?;
    checks.at_least("points", made.points, 4000);
    for doubt in [false, true] {
        renderer.methods.set(Dvf::new(Arc::new(made.field.clone()), DvfUse { doubt, ..DvfUse::default() }));
        let frame = renderer.frame(0, &camera)?;
        let least = frame.pixels.radiance.iter().flatten().copied().fold(f32::MAX, f32::min);
        let most = frame.pixels.radiance.iter().flatten().copied().fold(f32::MIN, f32::max);
        checks.equal("the least that is seen", least, 0.0);
        checks.equal("the most", most, 0.0);
        let record = frame.records.iter().find(|record| record.pass == "environment");
        let [traced, answered] = record.map_or([0; 2], |record| [record.rays_traced, record.rays_answered]);
        checks.at_least("rays", traced + answered, 64 * 64);
        if doubt {
            // The outside of the walls, which sees the environment, lies in the same cells.
            checks.at_least("rays answered", answered, (traced + answered) / 4);
        }
    }
    Ok(())
}
