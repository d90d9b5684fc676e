//! Ray-aligned occupancy maps: twins of `shaders/roma/roma_rotate.wgsl` and `roma_trace.wgsl`.

use super::bits::{cells_between, first_cell};
use super::directions::stratum_of;
use crate::kernels::bound::{Bound, Tally};
use crate::kernels::layout::{
    COUNTER_PILOTS, COUNTER_RAYS_ANSWERED, COUNTER_RAYS_CAPPED, HANDOVERS, Hit, Level, MET, NONE, PARAM_ANY_HIT,
    Params, ROMA_CORRECT, ROMA_FAR, ROMA_SIFT, ROMA_WHOLE, Ray, RomaMap, RomaOwn, Surface, T_INFINITE,
};
use crate::kernels::rays::{RaySet, is_traced};
use crate::kernels::table::words;
use crate::kernels::vector::{Vec3, each, least, most};
use crate::math::exact::{barrier, divide, square_root};
use crate::math::sampling::{random2, random4};
use crate::schedule::ExecutorError;
use crate::secondary::occupancy::{BLOCK_CELLS, clearance_bytes};
use rayon::prelude::*;

/// Steps of a column along an axis of the base map that are too short to bound it by.
const LEAST_STEP: f32 = 1.0 / 1024.0;

/// A level ends before its sides, ray by ray, by up to this share of them.
pub(crate) const BLEND: f32 = 1.0 / 16.0;

/// Share of a level's lift by which rays start that are sifted.
const SIFTED_LIFT: f32 = 0.4;

/// What hits of rays have in place of a distance that are not traced: answered.
const ANSWERED: f32 = -1.0;

/// The same: waiting for maps to answer them.
const WAITING: f32 = -2.0;

/// Columns that a ray passes at most which would be snapped to below its surface and is not.
const GRAZING_STEPS: u32 = 64;

/// Rays that are this long, device units, have no end that matters, and its square does not overflow.
const UNBOUNDED: f32 = f32::from_bits((127 + 40) << 23);

/// Slower than this, in cells a unit of t, a ray stays where it is.
const LEAST_SPEED: f32 = f32::from_bits((127 - 60) << 23);

/// The golden section of 2³².
pub(crate) const GOLDEN: u32 = 0x9e37_79b9;

/// Rays that a task traces in a row.
pub(crate) const RUN: usize = 256;

fn linear(row: &[f32; 4], v: Vec3) -> f32 {
    row[0] * v[0] + row[1] * v[1] + row[2] * v[2]
}

fn affine(row: &[f32; 4], p: Vec3) -> f32 {
    linear(row, p) + row[3]
}

/// The part of the range of depths in which a column lies between 0 and the base map's side on one axis, a cell more at
/// both ends.
fn bounded(cells: u32, range: [f32; 2], start: f32, step: f32) -> [f32; 2] {
    if step.abs() < LEAST_STEP {
        return range;
    }
    let a = -start / step;
    let b = (cells as f32 - start) / step;
    [most(range[0], least(a, b) - 1.0), least(range[1], most(a, b) + 1.0)]
}

/// Makes the ray-aligned maps of all levels from their base maps (Zeng et al., Algorithm 1): a cell is occupied where
/// one of its look-ups, evenly spaced along the column, finds an occupied cell of the base map.
pub fn roma_rotate(bound: &Bound, buffers: &mut [Vec<u32>]) -> Result<(), ExecutorError> {
    let own: &RomaOwn = bound.own();
    let [_, maps, boms, columns] = words(buffers)?;
    let (maps, words) = (bytemuck::cast_slice::<_, RomaMap>(maps), own.size / 32);
    let row = (own.size * words) as usize;
    let rows = (own.levels * own.k * own.k * own.size) as usize;
    columns.par_chunks_mut(row.max(1)).take(rows).enumerate().for_each(|(number, row)| {
        let (map, y) = (number as u32 / own.size, number as u32 % own.size);
        let base = BaseMap::of(own.cells, boms, map / (own.k * own.k));
        let rows = &maps[map as usize].base_from_cell;
        for (x, column) in row.chunks_mut(words as usize).enumerate() {
            rotate_column(own, &base, rows, [x as f32 + 0.5, y as f32 + 0.5, 0.0], column);
        }
    });
    Ok(())
}

/// A base map in cells of its own.
struct BaseMap<'a> {
    cells: u32,
    words: &'a [u32],
    clearance: &'a [u8],
}

impl<'a> BaseMap<'a> {
    /// That of a level, of all base maps with what is empty behind each.
    fn of(cells: u32, boms: &'a [u32], level: u32) -> Self {
        let (words, bytes) = ((cells * cells * (cells / 32)) as usize, clearance_bytes(cells));
        let own = &boms[level as usize * (words + bytes / 4)..];
        Self { cells, words: &own[..words], clearance: &bytemuck::cast_slice(&own[words..])[..bytes] }
    }

    /// The cell that a point lies in; `None` outside.
    fn cell(&self, point: Vec3) -> Option<[u32; 3]> {
        // Rounding down is a call on processors of the baseline, rounding to 0 an instruction.
        let c = point.map(|x| if x < 0.0 { u32::MAX } else { x as u32 });
        c.iter().all(|&x| x < self.cells).then_some(c)
    }

    fn is_occupied(&self, c: [u32; 3]) -> bool {
        let word = (c[0] + self.cells * c[1]) * (self.cells / 32) + c[2] / 32;
        self.words[word as usize] >> (c[2] % 32) & 1 != 0
    }

    /// Cells around one, on every axis, that are empty as it is.
    fn empty_around(&self, c: [u32; 3]) -> u32 {
        let side = self.cells / BLOCK_CELLS;
        let [x, y, z] = c.map(|x| x / BLOCK_CELLS);
        let distance = self.clearance[((x * side + y) * side + z) as usize];
        BLOCK_CELLS * u32::from(distance.saturating_sub(1))
    }
}

fn rotate_column(own: &RomaOwn, base: &BaseMap, rows: &[[f32; 4]; 3], foot: Vec3, column: &mut [u32]) {
    let start = each(|k| affine(&rows[k], foot));
    let step = each(|k| rows[k][2]);
    let whole = [0.0, own.size as f32];
    let range = (0..3).fold(whole, |range, k| bounded(own.cells, range, start[k], step[k]));
    let part = 1.0 / own.samples as f32;
    let per_cell = 1.0 / step.iter().fold(0.0, |greatest, &x| most(greatest, x.abs()));
    column.fill(0);
    let mut i = 0;
    while i < own.size {
        let depth = i as f32;
        i += 1;
        if depth + 1.0 < range[0] || depth > range[1] {
            continue;
        }
        for s in 0..own.samples {
            let at = depth + (s as f32 + 0.5) * part;
            let Some(cell) = base.cell(each(|k| start[k] + at * step[k])) else { continue };
            if base.is_occupied(cell) {
                column[((i - 1) / 32) as usize] |= 1 << (31 - (i - 1) % 32);
                break;
            }
            let passed = (base.empty_around(cell) as f32 * per_cell) as u32;
            if passed > 0 {
                // All look-ups before the cell that is `passed` ahead lie in what is empty, by half a step more than
                // roundings take.
                i += passed - 1;
                break;
            }
        }
    }
}

/// What a ray finds in a level.
struct Found {
    /// Where it meets something; below 0: nothing.
    t: f32,
    /// It passed as many columns as it may, and was finished snapped.
    is_capped: bool,
}

/// The map that a ray takes, among those of a level.
pub(crate) struct Taken {
    pub map: u32,
    /// The direction that is travelled.
    pub direction: Vec3,
    /// Columns that are passed before it is that of the map; 0: it is.
    pub steps: u32,
}

/// What is known of a whole ray.
pub(crate) struct Answer {
    met: Option<Met>,
    /// The direction that was travelled.
    pub direction: Vec3,
    /// It was capped in some level.
    pub is_capped: bool,
    /// It meets something, or all of it lies in the levels.
    is_known: bool,
}

impl Answer {
    /// Writes what the ray meets, and where it is asked for what is known of its surface: the point, against the
    /// direction travelled as its normal, and the level's lift as its area.
    pub fn write(&self, hit: &mut Hit, surface: Option<&mut Surface>) {
        let Some(Met { t, point, lift }) = self.met else { return };
        *hit = Hit { t, id: MET, u: 0.0, v: 0.0 };
        if let Some(surface) = surface {
            (surface.point, surface.normal, surface.area) = (point, self.direction.map(|x| -x), lift);
        }
    }
}

/// A hit of a ray, known to a cell.
struct Met {
    t: f32,
    point: Vec3,
    /// Of the level.
    lift: f32,
}

/// The part of the range of t in which a coordinate lies between `low` and `high`.
pub(crate) fn clipped(range: [f32; 2], at: f32, speed: f32, low: f32, high: f32) -> [f32; 2] {
    if speed.abs() < LEAST_SPEED {
        return if at >= low && at <= high { range } else { [1.0, 0.0] };
    }
    let inverse = divide(1.0, speed);
    let a = barrier((low - at) * inverse);
    let b = barrier((high - at) * inverse);
    [most(range[0], least(a, b)), least(range[1], most(a, b))]
}

/// Position at t.
fn along(at: f32, speed: f32, t: f32) -> f32 {
    at + t * speed
}

/// t at which a ray meets the next border of cell `cell`.
fn border(at: f32, speed: f32, cell: i32) -> f32 {
    if speed.abs() < LEAST_SPEED {
        return T_INFINITE;
    }
    let side = (cell + i32::from(speed > 0.0)) as f32;
    (side - at) * divide(1.0, speed)
}

/// Cells before its sides at which a level ends for ray `index`.
fn margin_of(p: &Params, own: &RomaOwn, index: u32) -> f32 {
    BLEND * (own.cells as f32 * random2(index, !p.stream, p.seed)[0])
}

/// Whether a ray is traced to its end, whatever maps say of it, and shows what they get wrong: of the directions of a
/// pixel one in so many, the first at random, and those of a workgroup together. Where pilots alone are traced, those
/// of as many pixels as a tile mostly has are together, since for tiles without any no query is made; which one of so
/// many directions goes on by the golden section, so that over samples all have their turn.
fn is_pilot(p: &Params, own: &RomaOwn, index: u32) -> bool {
    let n = own.pilots;
    if n == 0 {
        return false;
    }
    let block = |side: u32| index / p.width / side * p.width + index % p.width / side;
    if own.part == ROMA_CORRECT {
        let first = random4(block(64), !p.stream.wrapping_sub(p.sample), p.seed)[2];
        let word = first.wrapping_add((p.direction / n).wrapping_mul(GOLDEN));
        return p.direction % n == ((word >> 8) as f32 / 16_777_216.0 * n as f32) as u32;
    }
    let first = (random2(block(8), !p.stream, p.seed)[0] * n as f32) as u32;
    (first + p.direction).is_multiple_of(n)
}

/// What is missing to a level's lift of a ray that is `height` off its surface.
fn lift_of(lift: f32, height: f32) -> f32 {
    least(most(lift - height, 0.0), lift)
}

fn lifted(origin: Vec3, normal: Vec3, lift: f32) -> Vec3 {
    each(|k| origin[k] + lift * normal[k])
}

/// Where a ray ends that is `lift` off its surface, so that it leaves the ball around its origin no farther than
/// without: what it goes along must not reach across a narrow room. `squares` and `rise` are the products of its
/// direction with itself and with the normal.
pub(crate) fn end_of(t_max: f32, lift: f32, squares: f32, rise: f32) -> f32 {
    if t_max >= UNBOUNDED {
        return t_max;
    }
    let height = lift * rise;
    let past = t_max * t_max * squares - lift * lift;
    let root = square_root(most(height * height + squares * past, 0.0));
    least(most(divide(root - height, squares), 0.0), t_max)
}

/// The part of a range between whose first and last cell the middles lie: half a cell less at the ends that are the
/// ray's own, so that on the average over the places of maps it is as long as it is. `speed` in cells a unit of t.
fn trimmed(range: [f32; 2], speed: Vec3, [is_first, is_last]: [bool; 2]) -> [f32; 2] {
    let half = divide(0.5, square_root(speed[0] * speed[0] + speed[1] * speed[1] + speed[2] * speed[2]));
    [if is_first { range[0] + half } else { range[0] }, if is_last { range[1] - half } else { range[1] }]
}

/// The finest level that holds the start; the number of levels where none does.
fn start_level_of(own: &RomaOwn, levels: &[Level], origin: Vec3, normal: Vec3, margin: f32) -> usize {
    let side = own.cells as f32;
    let holds = |level: &Level| {
        let start = lifted(origin, normal, level.lift);
        let at = each(|k| start[k] * level.scale + level.first[k]);
        at.iter().all(|&x| x >= margin && x <= side - margin)
    };
    levels.iter().position(holds).unwrap_or(levels.len() - usize::from(own.is_part == 0))
}

pub(crate) fn length_of(d: Vec3) -> f32 {
    square_root(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
}

pub(crate) fn normal_of(seen: &RaySet, index: usize) -> Vec3 {
    seen.surfaces.get(index).map_or([0.0; 3], |surface: &Surface| surface.normal)
}

/// What rays are traced against.
pub(crate) struct Maps<'a> {
    pub params: &'a Params,
    pub own: &'a RomaOwn,
    pub levels: &'a [Level],
    pub maps: &'a [RomaMap],
    columns: &'a [u32],
}

impl<'a> Maps<'a> {
    /// Those of a dispatch.
    ///
    /// # Errors
    /// A defect: other buffers.
    pub fn of(bound: &'a Bound, buffers: &'a mut [Vec<u32>]) -> Result<Self, ExecutorError> {
        let own: &RomaOwn = bound.own();
        let [levels, maps, _, columns] = words(buffers)?;
        let levels = &bytemuck::cast_slice(levels)[..own.levels as usize];
        let maps = &bytemuck::cast_slice(maps)[..(own.levels * own.k * own.k) as usize];
        Ok(Self { params: bound.params, own, levels, maps, columns })
    }
}

impl Maps<'_> {
    /// First word of column (x, y) of a map.
    fn first_word(&self, map: u32, x: i32, y: i32) -> u32 {
        let n = self.own.size;
        ((map * n + y as u32) * n + x as u32) * (n / 32)
    }

    /// The first cell of a column that a ray at height `at` with vertical `speed` meets in a range of t; below 0: none.
    fn met(&self, column: u32, at: f32, speed: f32, [from, to]: [f32; 2]) -> f32 {
        let cells = cells_between(along(at, speed, from), along(at, speed, to), self.own.size);
        let word = |w: u32| self.columns[(column + w) as usize];
        let Some(depth) = cells.and_then(|cells| first_cell(word, cells, speed >= 0.0)) else { return -1.0 };
        if speed.abs() < LEAST_SPEED {
            return from;
        }
        least(most(divide(depth - at, speed), from), to)
    }

    /// Through a map: `at` and `speed` in its cells, `range` within it. With no `steps` the ray is along the columns.
    fn through(&self, map: u32, at: Vec3, speed: Vec3, range: [f32; 2], steps: u32) -> Found {
        if range[0] > range[1] {
            return Found { t: -1.0, is_capped: false };
        }
        let last = self.own.size as i32 - 1;
        let mut x = (along(at[0], speed[0], range[0]) as i32).clamp(0, last);
        let mut y = (along(at[1], speed[1], range[0]) as i32).clamp(0, last);
        let mut t = range[0];
        for _ in 0..steps {
            let to_x = border(at[0], speed[0], x);
            let to_y = border(at[1], speed[1], y);
            let end = most(t, least(range[1], least(to_x, to_y)));
            let hit = self.met(self.first_word(map, x, y), at[2], speed[2], [t, end]);
            if hit >= 0.0 || end >= range[1] {
                return Found { t: hit, is_capped: false };
            }
            if to_x <= to_y {
                x += if speed[0] > 0.0 { 1 } else { -1 };
            } else {
                y += if speed[1] > 0.0 { 1 } else { -1 };
            }
            if x.min(y) < 0 || x.max(y) > last {
                return Found { t: -1.0, is_capped: false };
            }
            t = end;
        }
        let hit = self.met(self.first_word(map, x, y), at[2], speed[2], [t, range[1]]);
        Found { t: hit, is_capped: steps > 0 }
    }

    /// The map of the stratum that a ray lies in. A snapped ray takes its direction, unless that leads below the
    /// surface.
    pub fn nearest(&self, ray: &Ray, normal: Vec3) -> Taken {
        let own = self.own;
        let (map, is_upper) = stratum_of(ray.direction, own.k);
        if own.steps == 0 {
            let signed = if is_upper { length_of(ray.direction) } else { -length_of(ray.direction) };
            let snapped = each(|k| signed * self.maps[map as usize].direction[k]);
            let above = snapped[0] * normal[0] + snapped[1] * normal[1] + snapped[2] * normal[2];
            if above >= 0.0 {
                return Taken { map, direction: snapped, steps: 0 };
            }
        }
        Taken { map, direction: ray.direction, steps: if own.steps == 0 { GRAZING_STEPS } else { own.steps } }
    }

    /// Asks for a ray from t = `from` on: in the finest level that holds its start, then in the next where it leaves
    /// one. Rays are off their surface by the level's lift where they enter it, so that no level meets what they leave;
    /// with `is_sifted` by less, and must be free to their own ends.
    pub fn answer(&self, index: u32, ray: &Ray, taken: &Taken, normal: Vec3, from: f32, is_sifted: bool) -> Answer {
        let (p, own) = (self.params, self.own);
        let maps = own.k * own.k;
        let &Taken { map: stratum, direction, steps } = taken;
        let side = own.cells as f32;
        let margin = margin_of(p, own, index);
        let start_level = start_level_of(own, self.levels, ray.origin, normal, margin);
        let rise = direction[0] * normal[0] + direction[1] * normal[1] + direction[2] * normal[2];
        let squares = direction[0] * direction[0] + direction[1] * direction[1] + direction[2] * direction[2];
        let mut t = most(ray.t_min, from);
        let mut is_capped = false;
        for (l, level) in self.levels.iter().enumerate().skip(start_level) {
            let lift = lift_of(if is_sifted { SIFTED_LIFT * level.lift } else { level.lift }, t * rise);
            let start = lifted(ray.origin, normal, lift);
            let end = if is_sifted { ray.t_max } else { end_of(ray.t_max, lift, squares, rise) };
            let at = each(|k| start[k] * level.scale + level.first[k]);
            let speed = direction.map(|x| x * level.scale);
            let low = if l + 1 == self.levels.len() && own.is_part == 0 { 0.0 } else { margin };
            let high = side - low;
            let range = (0..3).fold([t, end], |range, k| clipped(range, at[k], speed[k], low, high));
            if range[0] <= range[1] {
                let map = l as u32 * maps + stratum;
                let rows = &self.maps[map as usize].cell_from_point;
                let cell = each(|k| affine(&rows[k], start));
                let cells = each(|k| linear(&rows[k], direction));
                let ends = [l == start_level, range[1] >= end];
                let trimmed = if is_sifted { range } else { trimmed(range, cells, ends) };
                let found = self.through(map, cell, cells, trimmed, steps);
                is_capped |= found.is_capped;
                if found.t >= 0.0 {
                    let point = each(|k| start[k] + found.t * direction[k]);
                    let met = Met { t: found.t, point, lift: level.lift };
                    return Answer { met: Some(met), direction, is_capped, is_known: true };
                }
                t = range[1];
                if t >= end {
                    break;
                }
            }
        }
        Answer { met: None, direction, is_capped, is_known: own.is_part == 0 || t >= ray.t_max }
    }
}

/// t at which a ray is so many cells of the base map that holds its start from there; [`T_INFINITE`] where none holds
/// it.
fn near_end(p: &Params, own: &RomaOwn, levels: &[Level], index: u32, ray: &Ray, normal: Vec3, cells: u32) -> f32 {
    let d = ray.direction;
    let length = square_root(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    let level = levels.get(start_level_of(own, levels, ray.origin, normal, margin_of(p, own, index)));
    level.map_or(T_INFINITE, |level| divide(cells as f32, level.scale * length))
}

/// Ends those of the pass's rays that are no pilots before they are traced: maps answer them.
pub fn roma_pilots(bound: &Bound, set: &mut RaySet) {
    let (p, own) = (bound.params, bound.own::<RomaOwn>());
    if own.levels == 0 {
        return;
    }
    set.hits.par_chunks_mut(RUN).zip(set.rays.par_chunks(RUN)).enumerate().for_each(|(run, (hits, rays))| {
        for (i, (hit, _)) in hits.iter_mut().zip(rays).enumerate().filter(|(_, (_, ray))| ray.t_min <= ray.t_max) {
            if own.pilots != 0 && !is_pilot(p, own, (run * RUN + i) as u32) {
                hit.t = ANSWERED;
            }
        }
    });
}

/// Answers the pass's rays by ray-aligned maps. What is met is written as a hit of no triangle, but where rays are
/// sifted: there, those that meet nothing are ended, and others are traced up to `near` cells from their start.
/// Where pilots have been traced, these count for what maps get wrong.
pub fn roma_trace(
    bound: &Bound,
    buffers: &mut [Vec<u32>],
    set: &mut RaySet,
    seen: &RaySet,
) -> Result<(), ExecutorError> {
    let (p, own) = (bound.params, bound.own::<RomaOwn>());
    let of = Maps::of(bound, buffers)?;
    let (is_far, is_sifted) = (own.part == ROMA_FAR, own.part == ROMA_SIFT);
    let RaySet { rays, hits, surfaces, .. } = set;
    let all = hits.par_chunks_mut(RUN).zip(surfaces.par_chunks_mut(RUN)).zip(rays.par_chunks(RUN));
    all.enumerate().for_each(|(run, ((hits, surfaces), rays))| {
        let mut tally = Tally::default();
        for (i, ray) in rays.iter().enumerate().filter(|(_, ray)| ray.t_min <= ray.t_max) {
            let (hit, surface, index) = (&mut hits[i], &mut surfaces[i], run * RUN + i);
            // What has met something is not asked again, nor what was traced to its end or answered; pilots are traced.
            let is_done = hit.id != NONE || hit.t == ANSWERED || hit.t >= ray.t_max;
            if is_far && is_done || is_sifted && is_pilot(p, own, index as u32) {
                continue;
            }
            // What has been traced is not answered, though maps go on with it or correct it.
            let mut is_answered = own.part == ROMA_WHOLE || !is_traced(ray, hit);
            if of.levels.is_empty() {
                tally.add(COUNTER_RAYS_ANSWERED, u32::from(is_answered && !is_sifted));
                continue;
            }
            let normal = normal_of(seen, index);
            let taken = of.nearest(ray, normal);
            let from = if is_far { hit.t } else { ray.t_min };
            let found = of.answer(index as u32, ray, &taken, normal, from, is_sifted);
            tally.add(COUNTER_RAYS_CAPPED, u32::from(found.is_capped));
            if is_sifted {
                is_answered = of.sift(index as u32, ray, normal, &found, hit);
            } else if own.part == ROMA_CORRECT && is_pilot(p, own, index as u32) {
                correct(own, found.met.is_some(), hit);
            } else {
                found.write(hit, (!bound.has(PARAM_ANY_HIT)).then_some(surface));
            }
            tally.add(COUNTER_RAYS_ANSWERED, u32::from(is_answered));
        }
        bound.counters.add(&tally);
    });
    Ok(())
}

/// Counts a pilot, of n rays one, by m + n (e - m), where m is what maps say and e what tracing says: 1, it is free, or
/// 0. So the mean is that of traced rays, and its noise that of what maps get wrong (a control variate).
fn correct(own: &RomaOwn, is_met: bool, hit: &mut Hit) {
    let n = own.pilots as f32;
    match (hit.id == NONE, is_met) {
        (true, true) => hit.u = n - 1.0,
        (false, false) => *hit = Hit { id: NONE, u: -n, v: 0.0, ..*hit },
        _ => {}
    }
}

impl Maps<'_> {
    /// Ends a ray that maps find free, and says whether they do; what they do not is traced.
    fn sift(&self, index: u32, ray: &Ray, normal: Vec3, found: &Answer, hit: &mut Hit) -> bool {
        let (p, own) = (self.params, self.own);
        if found.met.is_none() {
            if found.is_known {
                hit.t = ANSWERED;
            }
            return found.is_known;
        }
        if own.near == 0 {
            hit.t = WAITING;
        } else if own.near != NONE {
            hit.t = least(ray.t_max, near_end(p, own, self.levels, index, ray, normal, own.near));
        }
        false
    }
}

/// Counts, of the pilots, which were traced to their ends, how many maps would have answered wrongly: those that meet
/// something though they were found free, and for each of several distances up to which rays in doubt may be traced,
/// those that are free and meet something in the maps from there on.
pub fn roma_measure(bound: &Bound, buffers: &mut [Vec<u32>], set: &RaySet, seen: &RaySet) -> Result<(), ExecutorError> {
    let (p, own) = (bound.params, bound.own::<RomaOwn>());
    let of = Maps::of(bound, buffers)?;
    set.hits.par_chunks(RUN).zip(set.rays.par_chunks(RUN)).enumerate().for_each(|(run, (hits, rays))| {
        let mut tally = Tally::default();
        for (i, (hit, ray)) in hits.iter().zip(rays).enumerate().filter(|(_, (_, ray))| ray.t_min <= ray.t_max) {
            let index = (run * RUN + i) as u32;
            if !is_pilot(p, own, index) {
                continue;
            }
            tally.add(COUNTER_PILOTS, 1);
            let (is_free, normal) = (hit.id == NONE, normal_of(seen, index as usize));
            let taken = of.nearest(ray, normal);
            let found = of.answer(index, ray, &taken, normal, ray.t_min, true);
            let is_met = found.met.is_some();
            tally.add(COUNTER_PILOTS + 1, u32::from(!is_free && !is_met && found.is_known));
            for i in 0..if is_free && is_met { HANDOVERS } else { 0 } {
                let cells = if i == 0 { 0 } else { 1 << i };
                let from = near_end(p, own, of.levels, index, ray, normal, cells * own.near);
                let is_wrong = from < ray.t_max && of.answer(index, ray, &taken, normal, from, false).met.is_some();
                tally.add(COUNTER_PILOTS + 2 + i, u32::from(is_wrong));
            }
        }
        bound.counters.add(&tally);
    });
    Ok(())
}
