//! Queries, lists, caches and damaged files (cases 31 to 37).

use super::case::Checks;
use super::lab::{Built, Lab, lit, misses, scheduled, settings};
use super::rays::{Aim, Targets, ray};
use super::views::{city, in_city, pixels_unlike};
use crate::frame::{Pixels, Renderer};
use crate::kernels::layout::Ray;
use crate::reference::Truth;
use crate::schedule::Optimisation;
use crate::session::Settings;
use crate::session::opened::open_scene;
use crate::settings::{CacheSize, Schedule};
use crate::stream::{Item, PayloadSource, Policy, Residency};
use anyhow::{Context, Result, anyhow};
use bricks::{BRICK_INDEX32, BRICK_WIDE, Brick, GeometryLayout, Payload};
use brickwalk_convert::source::Primitive;
use brickwalk_scenes::{Stiff, one_mesh, stiff};
use bytemuck::Zeroable;
use glam::DVec3;

/// Settings of pictures with several effects.
fn options(percent: u32) -> Settings {
    lit(72, 48, percent, 1)
}

/// A city of many bricks, and what it looks like from three places with everything resident.
struct Place {
    scene: Built,
    expected: Vec<Pixels>,
}

fn place(lab: &mut Lab, bricks: u32) -> Result<Place> {
    let scene = lab.build(city(lab.seed, [0.0; 3])?, &settings(bricks, -14))?;
    let mut plain = lab.renderer(&scene, &Settings { schedule: Schedule::Plain, tile: 64, ..options(100) })?;
    let expected = (0..3).map(|k| Ok(plain.frame(k, &in_city(k, [0.0; 3]))?.pixels)).collect::<Result<_>>()?;
    Ok(Place { scene, expected })
}

/// Frame `k`, which looks at the k-th view, and how many of its pixels differ from the expected ones.
fn unlike(renderer: &mut Renderer, place: &Place, k: u32) -> Result<u64> {
    let pixels = renderer.frame(k % 3, &in_city(k, [0.0; 3]))?.pixels;
    Ok(pixels_unlike(&place.expected[k as usize % 3], &pixels))
}

/// Case 31: every pair of a pixel and a brick lies in exactly one leaf pair of the fronts.
pub fn fronts(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let place = place(lab, 128)?;
    let options = Settings { tile: 8, schedule: Schedule::Chc, fronts: true, ..options(25) };
    let mut renderer = lab.renderer(&place.scene, &options)?;
    let (mut defects, mut pixels, mut states) = (0, 0, 0);
    // Still, then from place to place.
    for k in [0, 0, 0, 1, 1, 2, 0] {
        pixels += unlike(&mut renderer, &place, k)?;
        let fronts = renderer.fronts.as_ref().context("the options ask for fronts")?;
        defects += u64::from(fronts.partition_defect(renderer.scene.resident()).is_some());
        states += fronts.states() as u64;
    }
    checks.none("visibility states that do not partition rays and bricks", defects, states);
    checks.none("pixels unlike those without fronts", pixels, 7 * 72 * 48);
    Ok(())
}

/// Case 32: a cut of the camera is a cold start.
pub fn cut(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let place = place(lab, 256)?;
    for (fronts, name) in [(false, "off"), (true, "on")] {
        let options = Settings { schedule: Schedule::Chc, fronts, ..options(25) };
        let mut walking = lab.renderer(&place.scene, &options)?;
        for k in [0, 0, 1] {
            unlike(&mut walking, &place, k)?;
        }
        let after = walking.frame(2, &in_city(2, [0.0; 3]))?.pixels;
        let cold = lab.renderer(&place.scene, &options)?.frame(2, &in_city(2, [0.0; 3]))?.pixels;
        checks.none(&format!("fronts {name}: pixels unlike a cold start's"), pixels_unlike(&cold, &after), 72 * 48);
    }
    Ok(())
}

/// Case 33: what a query says late changes nothing; what it never says is an error.
///
/// Fronts ask for visible pairs in every third frame: in between their answer is the one from before. A query whose
/// answer does not come back ends the frame with an error, so no picture can lack a brick silently.
pub fn late_queries(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let place = place(lab, 256)?;
    let options = Settings { schedule: Schedule::Chc, ..options(25) };
    let mut late = lab.renderer(&place.scene, &Settings { fronts: true, ..options.clone() })?;
    let (mut differ, mut deferred) = (0, 0);
    for k in [0, 0, 0, 0, 1, 1, 1, 0] {
        let output = late.frame(k, &in_city(k, [0.0; 3]))?;
        differ += pixels_unlike(&place.expected[k as usize], &output.pixels);
        deferred += output.records.iter().map(|record| record.requeries_deferred).sum::<u64>();
    }
    checks.none("late answers: pixels unlike those without fronts", differ, 8 * 72 * 48);
    checks.at_least("queries left to a later frame", deferred, 1);
    for submission in [1, 3, 6] {
        lab.fails_at = Some(submission);
        let frame = lab
            .renderer(&place.scene, &options)
            .and_then(|mut renderer| renderer.frame(0, &in_city(0, [0.0; 3])).map_err(anyhow::Error::from));
        lab.fails_at = None;
        checks.refuses(&format!("lost answer of submission {submission}"), frame.map(|_| ()), &["lost"]);
    }
    Ok(())
}

/// Case 34: lists longer than there is room for at first are made again, and nothing is left out.
pub fn overflow(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let place = place(lab, 32)?;
    // One tile, whose list starts with room for 64 leaves.
    let without = vec![Optimisation::RootWalk];
    let options = Settings { tile: 128, schedule: Schedule::Chc, without, ..options(25) };
    let mut renderer = lab.renderer(&place.scene, &options)?;
    checks.at_least("leaves", place.scene.file.resident().leaves.len(), 256);
    let differ = unlike(&mut renderer, &place, 2)? + unlike(&mut renderer, &place, 0)?;
    checks.none("pixels unlike those without lists", differ, 2 * 72 * 48);
    Ok(())
}

/// Case 35: a cache below two bricks is refused, of two bricks it works, and what is pinned is not overwritten.
pub fn least_cache(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let place = place(lab, 256)?;
    let sizes = place.scene.file.sizes();
    let least = Residency::least_budget(&sizes);
    let of_bytes = |bytes| Settings { cache: CacheSize::Bytes(bytes), ..options(100) };
    let small = lab.renderer(&place.scene, &of_bytes(least - 16));
    checks.refuses("one unit less than two bricks", small.map(|_| ()), &["too small", "two largest bricks"]);
    for &evict in Policy::ALL {
        let options = Settings { schedule: Schedule::Chc, evict, ..of_bytes(least) };
        let mut renderer = lab.renderer(&place.scene, &options)?;
        let differ = unlike(&mut renderer, &place, 0)? + unlike(&mut renderer, &place, 2)?;
        checks.none(&format!("two bricks, {evict}: pixels unlike those with all"), differ, 2 * 72 * 48);
    }
    let mut rng = lab.random(&[35]);
    let (mut lost, mut of) = (0, 0);
    for &policy in Policy::ALL {
        let sizes: Vec<(u64, u64)> =
            (0..40).map(|_| (16 * rng.int(1, 64) as u64, 16 * rng.int(0, 16) as u64)).collect();
        let mut residency = Residency::new(&sizes, 3 * Residency::least_budget(&sizes), 4096, policy)?;
        for _ in 0..400 {
            residency.unpin_all();
            let mut pinned: Vec<Item> = Vec::new();
            // A batch: until something does not fit beside what is pinned.
            for _ in 0..12 {
                let item = Item::geometry(rng.int(0, 39) as u32);
                if residency.insert(item).is_err() {
                    break;
                }
                residency.pin(item);
                pinned.push(item);
                of += pinned.len() as u64;
                lost += pinned.iter().filter(|&&item| residency.slot(item).is_none()).count() as u64;
            }
            residency.validate().map_err(|reason| anyhow!(reason))?;
        }
    }
    checks.none("pinned payloads that were overwritten in a batch", lost, of);
    Ok(())
}

/// Case 36: a damaged brick is named, and what does not need it is still rendered.
pub fn damage(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let cube = stiff(Stiff::Cube, 6, lab.seed).meshes.remove(0).primitives.remove(0);
    let mut both = Primitive::default();
    for x in [-10.0, 10.0] {
        let first = both.positions.len() as u32;
        both.positions.extend(cube.positions.iter().map(|p| [p[0] + x, p[1], p[2]]));
        both.indices.extend(cube.indices.iter().map(|i| first + i));
    }
    let Built { file: sound, path, .. } = lab.build(one_mesh("two cubes", both), &settings(64, -20))?;
    let resident = sound.resident();
    let is_right = |brick: &Brick| brick.origin[0] > 0;
    let bad = resident.bricks.iter().position(|brick| !is_right(brick)).context("a brick of the left cube")? as u32;
    let mut bytes = std::fs::read(&path)?;
    let middle = sound.span(Payload::Geometry(bad));
    bytes[(middle.offset + middle.bytes / 2) as usize] ^= 4;
    let damaged = lab.scene_path();
    std::fs::write(&damaged, &bytes)?;
    let file = open_scene(&damaged)?;
    let report = file.verify(&mut |_, _| ())?;
    checks.equal("parts that verify finds damaged", report.problems.len(), 1);

    let mut stage = lab.open_stage(file, &damaged, &scheduled(60, Schedule::Demand))?;
    let unit = stage.frame.unit;
    let targets = Targets::of(&Truth::load(&sound)?, &stage.frame);
    let mut rng = lab.random(&[36]);
    let mut toward = |side: f64| -> Result<u64> {
        let rays: Vec<Ray> = (0..400)
            .map(|i| {
                let own = |p: DVec3| p.x * side > 0.0;
                let aim = std::iter::repeat_with(|| targets.point(&mut rng, Aim::ALL[i % 3])).find(|&p| own(p));
                // From inside, so that every brick of the cube is seen.
                ray(DVec3::new(10.0 * side, 0.1, 0.2) / unit, aim.unwrap_or_default())
            })
            .collect();
        Ok(misses(&stage.trace(&rays, false)?))
    };
    checks.equal("rays at the sound cube that miss", toward(1.0)?, 0);
    let name = format!("brick {bad}");
    checks.refuses("rays at the damaged cube", toward(-1.0).map(|_| ()), &[name.as_str()]);
    checks.equal("rays at the sound cube that miss afterwards", toward(1.0)?, 0);

    let cut = lab.scene_path();
    std::fs::write(&cut, &bytes[..bytes.len() * 2 / 3])?;
    checks.refuses("a file that was cut off", open_scene(&cut).map(|_| ()), &[&cut.display().to_string()]);
    Ok(())
}

/// Case 37: more than 2³¹ indices or bytes.
pub fn large_counts(_: &mut Lab, checks: &mut Checks) -> Result<()> {
    let most = u32::MAX;
    let brick = Brick {
        node_count: most,
        vertex_count: most,
        triangle_count: most,
        flags: BRICK_WIDE | BRICK_INDEX32,
        ..Brick::zeroed()
    };
    // Nodes of 80 bytes, vertices of 24, ids of 4, indices of 12.
    let bytes = u128::from(most) * (80 + 24 + 4 + 12);
    let found = u128::from(GeometryLayout::of(&brick).bytes);
    checks.holds("bytes of the largest brick that counts could say", (bytes..bytes + 64).contains(&found));
    let sizes = [(3u64 << 30, 1u64 << 30); 9];
    checks.equal("bytes for nine bricks of 4 GiB", Residency::budget_for_all(&sizes, 1 << 32) >= 36 << 30, true);
    let mut residency = Residency::new(&sizes, 17 << 30, u64::from(u32::MAX), Policy::RoundRobin)?;
    for brick in 0..9 {
        residency.insert(Item::geometry(brick))?;
        residency.validate().map_err(|reason| anyhow!(reason))?;
    }
    checks.equal("bytes in use after nine loads of 3 GiB", residency.used_bytes() % (3 << 30), 0);
    checks.at_least("bytes in use", residency.used_bytes(), 9 << 30);
    Ok(())
}
