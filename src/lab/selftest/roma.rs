//! Ray-aligned occupancy maps against walks cell by cell (cases 41 and 42).

use super::case::Checks;
use super::lab::{Lab, Stage};
use crate::kernels::layout::{Hit, Level, MET, NONE, Ray, RomaMap};
use crate::math::sampling::pcg;
use crate::schedule::{Lamp, Pass, Step};
use crate::secondary::occupancy::{Bom, Cascades};
use crate::secondary::roma::maps::RomaMaps;
use crate::secondary::roma::{MOST_STEPS, RomaPart};
use crate::session::trace::EXTENT;
use anyhow::Result;
use brickwalk_scenes::Rng;
use glam::DVec3;
use std::sync::Arc;

/// What a walk in f64 may decide otherwise than one in f32, of coordinates up to 128 with ten roundings.
const CLOSE: f64 = 128.0 * 10.0 / 16_777_216.0;

/// Maps whose columns run along an axis of the base maps, cell on cell; `levels`: cells a unit of length, and where the
/// origin lies.
fn aligned(cells: u32, levels: &[(f32, f32)], axis: usize) -> RomaMaps {
    let base = |k: usize| (axis + 1 + k) % 3;
    let map = |&(scale, first): &(f32, f32)| {
        let (mut there, mut back) = ([[0.0; 4]; 3], [[0.0; 4]; 3]);
        for k in 0..3 {
            (there[k][base(k)], there[k][3]) = (scale, first);
            back[base(k)][k] = 1.0;
        }
        let mut direction = [0.0; 4];
        direction[axis] = 1.0;
        RomaMap { cell_from_point: there, base_from_cell: back, direction }
    };
    let level = |&(scale, first): &(f32, f32)| Level { first: [first; 3], scale, ..Level::default() };
    RomaMaps {
        k: 1,
        size: cells,
        cells,
        samples: 1,
        is_part: false,
        levels: levels.iter().map(level).collect(),
        maps: levels.iter().map(map).collect(),
    }
}

/// Has the stage's device make the maps.
fn make(stage: &mut Stage, boms: Vec<Bom>, maps: &RomaMaps) -> Result<()> {
    stage.begin_frame();
    let executor = &mut *stage.opened.executor;
    maps.give(executor, &Arc::new(Cascades { levels: boms }))?;
    executor.run(Pass::Shadow(Lamp::Sun), &[maps.rotate()], &stage.opened.cache.states)?;
    Ok(())
}

/// What the maps that were made answer.
fn answers(stage: &mut Stage, maps: &RomaMaps, rays: &[Ray], steps: u32) -> Result<Vec<Hit>> {
    let pass = Pass::Shadow(Lamp::Sun);
    let executor = &mut *stage.opened.executor;
    let mut hits = Vec::with_capacity(rays.len());
    for chunk in rays.chunks(EXTENT.rays()) {
        executor.set_rays(pass, chunk);
        executor.run(pass, &[Step::StartHits, maps.trace(steps, RomaPart::Whole)], &stage.opened.cache.states)?;
        hits.extend_from_slice(&executor.read_hits(pass)?[..chunk.len()]);
    }
    Ok(hits)
}

/// Whether a cell of a column is occupied.
type Pattern = Box<dyn Fn(u32) -> bool>;

/// Columns: single cells where words begin and end, everything, noise of two densities.
fn patterns(words: u32) -> Vec<Pattern> {
    let single = |t: u32| -> Pattern { Box::new(move |z| z == t) };
    let mut all: Vec<Pattern> = (0..words).flat_map(|w| [32 * w, 32 * w + 31]).map(single).collect();
    all.push(Box::new(|_| true));
    all.push(Box::new(|z| pcg(z) & 1 != 0));
    all.push(Box::new(|z| pcg(z ^ 0x55).is_multiple_of(19)));
    all
}

/// Where the ray from depth `from` to `to` meets the first cell of a pattern of those between its first and its last
/// whose middles it passes, as far along as that middle lies; `None`: nowhere.
fn first_met(pattern: &Pattern, size: u32, from: f32, to: f32, is_upward: bool) -> Option<f32> {
    let middle = |z: i64| if is_upward { z as f32 + 0.5 - from } else { from - z as f32 - 0.5 };
    // The ray is in the maps from the first of these distances on, up to the second or its end.
    let side = |z: f32| if is_upward { z - from } else { from - z };
    let (near, far) = if is_upward { (0.0, size as f32) } else { (size as f32, 0.0) };
    let length = (to - from).abs();
    let first = side(near).max(0.0) + 0.5;
    let last = if side(far) < length { side(far) } else { length - 0.5 };
    if first > last {
        return None;
    }
    let depth = |t: f32| (if is_upward { from + t } else { from - t }).floor() as i64;
    let (low, high) = (depth(first).min(depth(last)), depth(first).max(depth(last)));
    let mut cells: Vec<i64> = (low.max(0)..=high.min(i64::from(size) - 1)).collect();
    if !is_upward {
        cells.reverse();
    }
    let cell = cells.into_iter().find(|&z| pattern(z as u32))?;
    Some(middle(cell).max(first).min(last))
}

/// Case 41: rays along columns from every depth to every other, both ways, of one word, of two, of four and of eight.
pub fn bits(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut stage = lab.bare_stage()?;
    for words in [1u32, 2, 4, 8] {
        let size = 32 * words;
        let patterns = patterns(words);
        let place = |i: usize| [2 + 3 * (i as u32 % 10), 2 + 3 * (i as u32 / 10)];
        let mut bom = Bom::new(size, 0, [0; 3]);
        for (i, pattern) in patterns.iter().enumerate() {
            let [x, y] = place(i);
            for z in 0..size {
                if pattern(z) {
                    bom.occupy([x, y, z]);
                }
                // Columns beside it hold something else.
                let noise = pcg(z ^ i as u32 ^ 0x1234_0000);
                for (bit, [x, y]) in [[x + 1, y], [x, y + 1], [x - 1, y], [x, y - 1]].into_iter().enumerate() {
                    if noise >> bit & 1 != 0 {
                        bom.occupy([x, y, z]);
                    }
                }
            }
        }
        let maps = aligned(size, &[(1.0, 0.0)], 2);
        make(&mut stage, vec![bom], &maps)?;
        let (mut wrong, mut unlike, mut of) = (0u64, 0u64, 0u64);
        for (i, pattern) in patterns.iter().enumerate() {
            let [x, y] = place(i).map(|x| x as f32 + 0.5);
            // Within cells, and on their borders.
            let aside = if i % 2 == 0 { 0.25 } else { 0.0 };
            let depths = || (-1..=size as i32).map(|t| t as f32 + aside);
            let ray = |(from, to, is_upward): (f32, f32, bool)| Ray {
                origin: [x, y, from],
                t_min: 0.0,
                direction: [0.0, 0.0, if is_upward { 1.0 } else { -1.0 }],
                t_max: (to - from).abs(),
            };
            let pairs: Vec<(f32, f32, bool)> = depths()
                .flat_map(|from| depths().map(move |to| (from, to)))
                .flat_map(|(from, to)| {
                    // From a depth to itself both ways.
                    let both = [to >= from, to > from];
                    both.into_iter().take(1 + usize::from(from == to)).map(move |is_upward| (from, to, is_upward))
                })
                .collect();
            let rays: Vec<Ray> = pairs.iter().copied().map(ray).collect();
            let other = &patterns[(i + 1) % patterns.len()];
            for (&(from, to, is_upward), hit) in pairs.iter().zip(answers(&mut stage, &maps, &rays, 0)?) {
                let found = (hit.id == MET).then_some(hit.t);
                let is_sound = hit.id == MET || hit.id == NONE;
                wrong += u64::from(!is_sound || found != first_met(pattern, size, from, to, is_upward));
                unlike += u64::from(found != first_met(other, size, from, to, is_upward));
                of += 1;
            }
        }
        checks.none(&format!("answers unlike a walk cell by cell, {words} words a column"), wrong, of);
        checks.at_least("answers unlike a walk through another column", unlike, of / 20);
    }
    Ok(())
}

/// When a ray is in a box, `grown` by so much to all sides, in a range of t.
fn within(ray: &Ray, [low, high]: [DVec3; 2], grown: f64, mut range: [f64; 2]) -> Option<[f64; 2]> {
    for k in 0..3 {
        let (o, d) = (f64::from(ray.origin[k]), f64::from(ray.direction[k]));
        let sides = [low[k] - grown - o, high[k] + grown - o];
        if d == 0.0 {
            if sides[0] > 0.0 || sides[1] < 0.0 {
                return None;
            }
        } else {
            let [a, b] = sides.map(|s| s / d);
            range = [range[0].max(a.min(b)), range[1].min(a.max(b))];
        }
    }
    (range[0] <= range[1]).then_some(range)
}

/// Ranges of t in which a ray counts for certain, and at most: from where it is half a cell in the maps, up to half a
/// cell before its end, of the level that has this. Levels have 32 cells from 0 on, of side 1, and where there are two
/// 32 of side 2 from -16 on. Rays leave the first one up to two cells before its sides; `None`: it is in none.
fn counted(ray: &Ray, levels: usize) -> Option<[[f64; 2]; 2]> {
    let (low, side) = if levels == 1 { (0.0, 32.0) } else { (-16.0, 64.0) };
    let direction = DVec3::from(ray.direction.map(f64::from));
    let half = 0.5 / direction.length();
    let end = f64::from(ray.t_max);
    let [from, to] = within(ray, of_cell([low; 3], side), 0.0, [f64::from(ray.t_min), end])?;
    let last = DVec3::from(ray.origin.map(f64::from)) + end * direction;
    let is_in = |low: f64, high: f64| last.min_element() >= low && last.max_element() <= high;
    let less = match levels {
        _ if to < end => [0.0; 2],
        1 => [half; 2],
        _ if is_in(2.0, 30.0) => [half; 2],
        _ if is_in(0.0, 32.0) => [2.0 * half, 0.0],
        _ => [2.0 * half; 2],
    };
    Some(less.map(|less| [from + half, to - less]))
}

/// Whether an answer is that of brute force over the boxes of all occupied cells, of so many levels; what is closer to
/// a border than [`CLOSE`] may be decided either way.
fn is_right(ray: &Ray, hit: &Hit, boxes: &[[DVec3; 2]], levels: usize) -> bool {
    let t = f64::from(hit.t);
    let slack = CLOSE / DVec3::from(ray.direction.map(f64::from)).length();
    let Some([certain, most]) = counted(ray, levels) else { return hit.id == NONE };
    let (certain, most) = ([certain[0] + slack, certain[1] - slack], [most[0] - slack, most[1] + slack]);
    // Of the cells that it may meet, when it is there, and whether it meets them for certain.
    let met = |b: &[DVec3; 2]| Some((within(ray, *b, CLOSE, most)?, within(ray, *b, -CLOSE, certain).is_some()));
    let met: Vec<([f64; 2], bool)> = boxes.iter().filter_map(met).collect();
    let is_in_one = || met.iter().any(|([from, to], _)| from - slack <= t && t <= to + slack);
    // It may not have passed through another.
    let is_past = || met.iter().any(|([_, to], is_certain)| *is_certain && to + slack < t);
    match hit.id {
        NONE => met.iter().all(|(_, is_certain)| !is_certain),
        MET => is_in_one() && !is_past(),
        _ => false,
    }
}

/// Rays that start in `starts` of a box and aim anywhere, some along axes, of all lengths.
fn anywhere(rng: &mut Rng, count: usize, starts: [f64; 2]) -> Vec<Ray> {
    let ray = |i: usize| {
        let mut from = DVec3::from([0; 3].map(|_| rng.range(starts[0], starts[1])));
        let mut direction = rng.direction();
        if i.is_multiple_of(4) {
            // Aligned, and on a border of cells.
            let axis = i / 4 % 3;
            direction = [DVec3::X, DVec3::Y, DVec3::Z][axis] * if i.is_multiple_of(8) { 1.0 } else { -1.0 };
            from[(axis + 1) % 3] = from[(axis + 1) % 3].round() + if i % 16 < 8 { 0.5 } else { 0.0 };
        }
        let length = rng.range(0.0, if i.is_multiple_of(3) { 8.0 } else { 80.0 });
        let speed = 2f64.powi(i as i32 % 7 - 3);
        let direction = (direction * speed).as_vec3().to_array();
        Ray { origin: from.as_vec3().to_array(), t_min: 0.0, direction, t_max: (length / speed) as f32 }
    };
    (0..count).map(ray).collect()
}

/// Case 42: rays that start outside of the maps, and that leave them, with a direction of their own; rays that leave
/// maps for the next.
pub fn leaving(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut rng = lab.random(&[42]);
    let mut stage = lab.bare_stage()?;
    let count = lab.share(20_000);
    let cells = 32u32;
    for axis in 0..3 {
        let mut bom = Bom::new(cells, 0, [0; 3]);
        let occupied: Vec<[u32; 3]> = (0..800).map(|_| [0; 3].map(|_| rng.range(0.0, 32.0) as u32)).collect();
        occupied.iter().for_each(|&cell| bom.occupy(cell));
        let maps = aligned(cells, &[(1.0, 0.0)], axis);
        make(&mut stage, vec![bom], &maps)?;
        let boxes: Vec<[DVec3; 2]> = occupied.iter().map(|c| of_cell(c.map(f64::from), 1.0)).collect();
        let rays = anywhere(&mut rng, count, [-8.0, 40.0]);
        let hits = answers(&mut stage, &maps, &rays, MOST_STEPS)?;
        let wrong =
            |boxes: &[[DVec3; 2]]| rays.iter().zip(&hits).filter(|(r, h)| !is_right(r, h, boxes, 1)).count() as u64;
        checks.none(&format!("answers unlike brute force, columns along axis {axis}"), wrong(&boxes), count as u64);
        let met = hits.iter().filter(|hit| hit.id == MET).count() as u64;
        checks.at_least("rays that meet something", met, count as u64 / 20);
        let aside: Vec<[DVec3; 2]> = boxes.iter().map(|b| b.map(|p| p + DVec3::X)).collect();
        checks.at_least("answers unlike those of cells one aside", wrong(&aside), count as u64 / 40);
    }
    // A level of 32 cells of side 1 in the middle of one of side 2. What is between its sides and those that rays may
    // leave it by, a 16th before them, is empty.
    let mut levels = vec![Bom::new(cells, 0, [0; 3]), Bom::new(cells, 1, [-8; 3])];
    let mut boxes = Vec::new();
    for _ in 0..400 {
        let cell = [0; 3].map(|_| rng.range(2.0, 30.0) as u32);
        levels[0].occupy(cell);
        boxes.push(of_cell(cell.map(f64::from), 1.0));
        let cell = [0; 3].map(|_| rng.range(0.0, 32.0) as u32);
        if cell.iter().any(|x| !(8..24).contains(x)) {
            levels[1].occupy(cell);
            boxes.push(of_cell(cell.map(|x| 2.0 * f64::from(x) - 16.0), 2.0));
        }
    }
    let maps = aligned(cells, &[(1.0, 0.0), (0.5, 8.0)], 1);
    make(&mut stage, levels, &maps)?;
    let rays = anywhere(&mut rng, count, [2.0, 30.0]);
    let hits = answers(&mut stage, &maps, &rays, MOST_STEPS)?;
    let wrong = |boxes: &[[DVec3; 2]]| rays.iter().zip(&hits).filter(|(r, h)| !is_right(r, h, boxes, 2)).count() as u64;
    checks.none("answers unlike brute force where rays go on in the next level", wrong(&boxes), count as u64);
    let inner: Vec<[DVec3; 2]> = boxes.iter().filter(|[low, high]| (*high - *low).x < 1.5).copied().collect();
    checks.at_least("answers unlike those of the first level alone", wrong(&inner), count as u64 / 50);
    Ok(())
}

fn of_cell(first: [f64; 3], side: f64) -> [DVec3; 2] {
    [DVec3::from(first), DVec3::from(first) + DVec3::splat(side)]
}
