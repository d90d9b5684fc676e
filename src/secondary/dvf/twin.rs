//! Discrete visibility fields: twins of `shaders/dvf/dvf_areas.wgsl`, `dvf_counts.wgsl`, `dvf_up.wgsl`,
//! `dvf_down.wgsl`, `dvf_rays.wgsl`, `dvf_write.wgsl`, `dvf_dilate.wgsl`, `dvf_labels.wgsl`, `dvf_sift.wgsl`,
//! `dvf_seen.wgsl` and `dvf_points.wgsl`.

use super::fresh::FreshView;
use super::maps::{CIRCLE, TILE, sum};
use super::mask;
use super::mask::{OCCLUDED, UNKNOWN};
use crate::kernels::bound::{Bound, Tally, atomic};
use crate::kernels::layout::{
    COUNTER_RAYS_ANSWERED, DVF_BOTH, DVF_DOUBT, DVF_HAMMERSLEY, DVF_PAPER, DVF_RENEW, DVF_ROUND, DVF_WALK, DvfGrid,
    DvfOwn, DvfTriangle, GBuffer, INSTANCE_MIRRORED, MET, NONE, Params, Ray, T_INFINITE,
};
use crate::kernels::rays::{RaySet, is_traced, start_hit};
use crate::kernels::shade::generate::{for_each_leaving, leaving};
use crate::kernels::shade::gloss::Gloss;
use crate::kernels::shade::lamps::unit;
use crate::kernels::shade::light::{ambient, background};
use crate::kernels::shade::shade::{Pixels, for_each_hit, is_traced as is_ray};
use crate::kernels::table::words;
use crate::kernels::trace::levels::is_pending;
use crate::kernels::vector::{Vec3, each, most3};
use crate::math::exact::{
    TriangleHit, barrier, diffprod, divide, length_of, offset_origin, scaled, square_root, surface_point,
};
use crate::math::sampling::{pcg, random4};
use crate::schedule::ExecutorError;
use bricks::Material;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

/// Rays that a task handles in a row.
const RUN: usize = 1024;

/// A field, and what is made of it: the buffers of its kernels.
pub struct Tables<'a> {
    /// How it is placed.
    grid: &'a DvfGrid,
    /// Of all cells.
    masks: &'a [AtomicU32],
    /// Of all cells.
    labels: &'a mut [u32],
    /// Of the group at hand.
    triangles: &'a [DvfTriangle],
    /// Level by level.
    pub sums: &'a mut [[u32; 2]],
    /// Of rays about z, then points of the unit circle.
    directions: &'a [[f32; 4]],
    /// A bit for each ray of some blocks: whether it waits for bricks.
    waiting: &'a [AtomicU32],
    /// The cells that are made anew, where some are.
    fresh: Option<FreshView<'a>>,
    /// Hits in cells, points in cells that are made anew, or those of these that rays start from.
    tally: &'a [AtomicU32],
}

impl<'a> Tables<'a> {
    /// Those of a dispatch.
    ///
    /// # Errors
    /// A defect: other buffers.
    pub fn of(buffers: &'a mut [Vec<u32>]) -> Result<Self, ExecutorError> {
        let [grid, masks, labels, triangles, sums, directions, waiting, fresh, tally] = words(buffers)?;
        let grid: &DvfGrid = &bytemuck::cast_slice(grid)[0];
        let cells = grid.size.iter().product::<u32>() as usize;
        let is_renewed = grid.flags & DVF_RENEW != 0;
        Ok(Self {
            grid,
            masks: atomic(masks),
            labels: &mut labels[..cells],
            triangles: &bytemuck::cast_slice(triangles)[..grid.triangles as usize],
            sums: bytemuck::cast_slice_mut(sums),
            directions: bytemuck::cast_slice(directions),
            waiting: atomic(waiting),
            fresh: is_renewed.then(|| FreshView::new(fresh, cells, grid.octahedral)),
            tally: &atomic(tally)[..grid.listed as usize],
        })
    }
}

/// The cell that holds a point of the frame.
fn cell_of(grid: &DvfGrid, p: Vec3) -> Option<usize> {
    let at = each(|k| barrier(barrier(p[k] * grid.scale) + grid.first[k]));
    if !(0..3).all(|k| at[k] >= 0.0 && at[k] < grid.size[k] as f32) {
        return None;
    }
    let [x, y, z] = [0, 1, 2].map(|k| (at[k] as u32).min(grid.size[k] - 1));
    Some(((z * grid.size[1] + y) * grid.size[0] + x) as usize)
}

/// a, b, c turned against the front, of any length; zero where the vertices lie on a line.
fn back_of(t: &DvfTriangle) -> Vec3 {
    let ab = each(|k| barrier(t.b[k] - t.a[k]));
    let ca = each(|k| barrier(t.a[k] - t.c[k]));
    // cross(ab, ac) is -cross(ab, ca): this one.
    let back = [
        diffprod(ab[1], ca[2], ab[2], ca[1]),
        diffprod(ab[2], ca[0], ab[0], ca[2]),
        diffprod(ab[0], ca[1], ab[1], ca[0]),
    ];
    if t.flags & INSTANCE_MIRRORED != 0 { back.map(|x| -x) } else { back }
}

/// Twice the area of a triangle, device units.
fn twice_area(t: &DvfTriangle) -> f32 {
    let back = back_of(t);
    if most3(back.map(f32::abs)) == 0.0 {
        return 0.0;
    }
    let (s, scale) = scaled(back);
    barrier(length_of(s) * scale)
}

/// An area in steps of the sums, at least one.
fn steps_of(grid: &DvfGrid, area: f32) -> [u32; 2] {
    let steps = barrier(area * grid.area_scale);
    let high = barrier(steps / 4_294_967_296.0).floor();
    [if steps < 1.0 { 1 } else { barrier(steps - barrier(high * 4_294_967_296.0)) as u32 }, high as u32]
}

/// Points on a triangle: their share by area (Günay, Akyüz, eq. 1).
fn points_on(grid: &DvfGrid, t: &DvfTriangle) -> u32 {
    let share = divide(barrier(grid.points * twice_area(t)), grid.total);
    if grid.flags & DVF_ROUND != 0 { barrier(share + 0.5).floor() as u32 } else { (share.ceil() as u32).max(1) }
}

fn plus(a: [u32; 2], b: [u32; 2]) -> [u32; 2] {
    let all = sum(a).wrapping_add(sum(b));
    [all as u32, (all >> 32) as u32]
}

/// Sums each block of the level at hand into an element of the level above.
pub fn up(own: &DvfOwn, sums: &mut [[u32; 2]]) {
    let (first, count) = (own.first as usize, own.count as usize);
    for (block, at) in (first..first + count).step_by(DVF_WALK as usize).enumerate() {
        let end = (at + DVF_WALK as usize).min(first + count);
        let total = sums[at..end].iter().fold([0; 2], |all, one| plus(all, *one));
        sums[own.next as usize + block] = total;
    }
}

/// Makes each element of the level at hand the sum of all before it.
pub fn down(own: &DvfOwn, sums: &mut [[u32; 2]]) {
    let (first, count) = (own.first as usize, own.count as usize);
    for (block, at) in (first..first + count).step_by(DVF_WALK as usize).enumerate() {
        let end = (at + DVF_WALK as usize).min(first + count);
        let mut before = if own.next == NONE { [0; 2] } else { sums[own.next as usize + block] };
        for element in &mut sums[at..end] {
            let own = std::mem::replace(element, before);
            before = plus(before, own);
        }
    }
}

/// Areas of triangles, in steps of their sums.
pub fn areas(tables: Tables) {
    let Tables { grid, triangles, sums, .. } = tables;
    sums.par_iter_mut().zip(triangles).for_each(|(steps, t)| *steps = steps_of(grid, twice_area(t)));
}

/// Numbers of points on triangles.
pub fn counts(tables: Tables) {
    let Tables { grid, triangles, sums, .. } = tables;
    sums.par_iter_mut().zip(triangles).for_each(|(count, t)| *count = [points_on(grid, t), 0]);
}

/// Widens the masks of all cells.
pub fn dilate(tables: Tables) {
    let side = tables.grid.octahedral;
    let cells = tables.masks[..2 * mask::words(side) * tables.labels.len()].par_chunks_exact(mask::words(side));
    cells.for_each(|words| {
        let mut mask: Vec<u32> = words.iter().map(|word| word.load(Ordering::Relaxed)).collect();
        mask::dilate(&mut mask, side);
        words.iter().zip(mask).for_each(|(word, dilated)| word.store(dilated, Ordering::Relaxed));
    });
}

/// Labels all cells.
pub fn labels(tables: Tables) {
    let cells = tables.masks.par_chunks_exact(2 * mask::words(tables.grid.octahedral)).zip(tables.labels);
    cells.for_each(|(words, label)| {
        let masks: Vec<u32> = words.iter().map(|word| word.load(Ordering::Relaxed)).collect();
        *label = mask::label(&masks);
    });
}

/// Whether a ray is made: all, or those that wait.
fn is_made(tables: &Tables, own: &DvfOwn, index: usize) -> bool {
    let word = |first: u32| tables.waiting[first as usize + index / 32].load(Ordering::Relaxed);
    own.next == NONE || word(own.next) >> (index % 32) & 1 != 0
}

/// No ray.
const NO_RAY: Ray = Ray { origin: [0.0; 3], t_min: 1.0, direction: [0.0, 1.0, 0.0], t_max: 0.0 };

/// Direction `local` about z, turned by the point `around` of the unit circle, about the unit vector `n` instead.
fn turned(around: [f32; 2], local: Vec3, n: Vec3) -> Vec3 {
    let x = barrier(barrier(around[0] * local[0]) - barrier(around[1] * local[1]));
    let y = barrier(barrier(around[1] * local[0]) + barrier(around[0] * local[1]));
    let side = if n[2] >= 0.0 { 1.0 } else { -1.0 };
    let a = -divide(1.0, barrier(side + n[2]));
    let b = barrier(barrier(n[0] * n[1]) * a);
    let across = [barrier(1.0 + barrier(barrier(side * barrier(n[0] * n[0])) * a)), side * b, -side * n[0]];
    let up = [b, barrier(side + barrier(barrier(n[1] * n[1]) * a)), -n[1]];
    each(|k| barrier(barrier(barrier(x * across[k]) + barrier(y * up[k])) + barrier(local[2] * n[k])))
}

/// Where the rays of a point start.
struct Start {
    origin: Vec3,
    cell: usize,
    /// Unit normal on the side of the rays.
    n: Vec3,
    /// Id of the triangle.
    source: u32,
    /// Point of the unit circle by which directions are turned.
    around: [f32; 2],
}

/// Where the rays of a point start, on the front of its triangle or behind it; `None`: no ray does.
fn start_of(tables: &Tables, point: u32, is_behind: bool) -> Option<Start> {
    let grid = tables.grid;
    let sums = &tables.sums[..tables.triangles.len()];
    let number = sums.partition_point(|sum| sum[0] <= point).max(1) - 1;
    let t = &tables.triangles[number];
    let first = sums[number][0];
    let end = sums.get(number + 1).map_or(grid.point_count, |sum| sum[0]);
    let count = (end - first).max(1);
    let own = point - first;
    let words = random4(own, t.id, grid.seed);
    let r = match grid.flags & DVF_HAMMERSLEY != 0 {
        true => [divide(barrier(own as f32 + 0.5), count as f32), unit(own.reverse_bits())],
        false => [unit(words[0]), unit(words[1])],
    };
    let s = square_root(r[0].min(1.0 - f32::EPSILON / 2.0));
    let (u, v, w) = (barrier(1.0 - s), barrier(s * barrier(1.0 - r[1])), barrier(s * r[1]));
    let back = back_of(t);
    if most3(back.map(f32::abs)) == 0.0 {
        return None;
    }
    let toward = scaled(if is_behind { back.map(|x| -x) } else { back }).0;
    let weights = TriangleHit { u, v, w, det: 1.0, ..TriangleHit::default() };
    let start = surface_point(t.a, t.b, t.c, &weights, toward);
    let origin = offset_origin(&start);
    let cell = cell_of(grid, origin)?;
    let [x, y, ..] = tables.directions[(grid.rays + words[2] % CIRCLE) as usize];
    Some(Start { origin, cell, n: start.n, source: t.id, around: [x, y] })
}

/// Direction `turn` of the rays that start there.
fn direction_of(tables: &Tables, start: &Start, turn: u32) -> Vec3 {
    let [x, y, z, _] = tables.directions[turn as usize];
    turned(start.around, [x, y, z], start.n)
}

/// The ray of lane `slot` of the block, and the triangle that it starts from.
fn ray_of(tables: &Tables, own: &DvfOwn, slot: u32) -> Option<(Ray, u32)> {
    let grid = tables.grid;
    let mut point = slot / grid.lanes;
    let mut turn = slot % grid.lanes + own.turn * grid.lanes;
    let sides = sides_of(grid);
    let is_behind;
    if tables.fresh.is_some() {
        if point >= grid.listed || turn >= grid.rays {
            return None;
        }
        let listed = tables.tally[point as usize].load(Ordering::Relaxed);
        (point, is_behind) = (listed / sides, listed % sides == 1);
    } else {
        if point >= grid.point_count || turn >= sides * grid.rays {
            return None;
        }
        is_behind = turn >= grid.rays;
        if is_behind {
            turn -= grid.rays;
        }
    }
    let start = start_of(tables, point, is_behind)?;
    let direction = direction_of(tables, &start, turn);
    if let Some(fresh) = &tables.fresh {
        let entry = fresh.entry(start.cell)?;
        if !fresh.has(entry, mask::texel(direction, grid.octahedral)) {
            return None;
        }
    }
    Some((Ray { origin: start.origin, t_min: 0.0, direction, t_max: T_INFINITE }, start.source))
}

/// Sides of triangles that rays start from.
fn sides_of(grid: &DvfGrid) -> u32 {
    if grid.flags & DVF_BOTH != 0 { 2 } else { 1 }
}

/// Finds of every side of every point of a group the cell that its rays start in, if that is made anew, and how many of
/// them are made.
pub fn points(bound: &Bound, tables: &Tables) {
    let own: &DvfOwn = bound.own();
    let Some(fresh) = &tables.fresh else { return };
    let grid = tables.grid;
    let sides = sides_of(grid);
    let all = tables.tally.as_chunks::<2>().0.par_iter().enumerate().with_min_len(RUN);
    all.take(own.count as usize).for_each(|(i, [found, count])| {
        let number = own.first + i as u32;
        let start = start_of(tables, number / sides, number % sides == 1);
        let start = start.and_then(|start| Some((fresh.entry(start.cell)?, start)));
        let texel = |start: &Start, turn: u32| mask::texel(direction_of(tables, start, turn), grid.octahedral);
        let (entry, rays) = match start {
            Some((entry, start)) => {
                let is_made = |turn: &u32| fresh.has(entry, texel(&start, *turn));
                (entry as u32, (0..grid.rays).filter(is_made).count() as u32)
            }
            None => (NONE, 0),
        };
        found.store(entry, Ordering::Relaxed);
        count.store(rays, Ordering::Relaxed);
    });
}

/// Counts the primary hits in each cell.
pub fn seen(bound: &Bound, tables: &Tables, seen: &RaySet) {
    let pixels = (bound.params.width * bound.params.height) as usize;
    seen.surfaces.par_iter().take(pixels).with_min_len(RUN).filter(|surface| surface.leaf != NONE).for_each(
        |surface| {
            if let Some(count) = cell_of(tables.grid, surface.point).and_then(|cell| tables.tally.get(cell)) {
                count.fetch_add(1, Ordering::Relaxed);
            }
        },
    );
}

/// Makes a block of the rays of a group.
pub fn rays(bound: &Bound, tables: &Tables, set: &mut RaySet) {
    let own: &DvfOwn = bound.own();
    let RaySet { rays, hits, surfaces, .. } = set;
    let all = rays.par_iter_mut().zip(hits.par_iter_mut()).zip(surfaces.par_iter_mut());
    all.enumerate().with_min_len(RUN).for_each(|(index, ((ray, hit), surface))| {
        let is_made = is_made(tables, own, index);
        let made = is_made.then(|| ray_of(tables, own, own.first + index as u32)).flatten();
        let source;
        (*ray, source) = made.unwrap_or((NO_RAY, NONE));
        (*hit, *surface) = start_hit(ray.t_max, source);
    });
}

/// By which the rays of a pixel are turned: a point of the unit circle.
fn turn_of(tables: &Tables, params: &Params, index: usize) -> [f32; 2] {
    let moved = pcg(params.seed);
    let pixel = [index as u32 % params.width, index as u32 / params.width];
    let [x, y] = [pixel[0].wrapping_add(moved) % TILE, pixel[1].wrapping_add(moved >> 8) % TILE];
    let place = (y * TILE + x) as usize;
    let (first, directions) = (tables.grid.rays as usize, tables.directions);
    let number = directions[first + CIRCLE as usize + place / 4][place % 4] as usize;
    [directions[first + number][0], directions[first + number][1]]
}

/// Makes a ray from every primary hit, about its normal.
pub fn cosine(bound: &Bound, tables: &Tables, set: &mut RaySet, seen: &RaySet, gbuffer: &[GBuffer]) {
    let around = bound.own::<DvfOwn>().around;
    for_each_leaving(set, seen, |index, surface| {
        let turn = turn_of(tables, bound.params, index);
        let direction = turned(turn, [around[0], around[1], around[2]], gbuffer[index].normal);
        leaving(surface, direction, T_INFINITE)
    });
}

/// Notes whether a ray waits.
fn note(tables: &Tables, first: u32, index: usize, waits: bool) {
    let (word, bit) = (&tables.waiting[first as usize + index / 32], 1 << (index % 32));
    if waits {
        word.fetch_or(bit, Ordering::Relaxed);
    } else {
        word.fetch_and(!bit, Ordering::Relaxed);
    }
}

/// Enters what a block's rays met into the masks of the cells that they start in; those that wait are noted and ended.
pub fn write(bound: &Bound, tables: &Tables, set: &mut RaySet) {
    let own: &DvfOwn = bound.own();
    let RaySet { rays, hits, surfaces, .. } = set;
    let grid = tables.grid;
    let words = mask::words(grid.octahedral);
    let first = own.next;
    let rays = rays.par_iter().zip(hits.par_iter_mut()).zip(&*surfaces).enumerate().with_min_len(RUN);
    rays.for_each(|(index, ((ray, hit), surface))| {
        if first != NONE {
            let waits = is_traced(ray, hit) && is_pending(surface);
            note(tables, first, index, waits);
            if waits {
                hit.t = -1.0;
                return;
            }
        }
        let is_ray = ray.t_min <= ray.t_max;
        if own.count == 0 || !is_ray {
            return;
        }
        // The masks of a cell that is made anew are those of its entry.
        let fresh = tables.fresh.as_ref();
        let cell = cell_of(grid, ray.origin).and_then(|cell| fresh.map_or(Some(cell), |fresh| fresh.entry(cell)));
        if let Some(cell) = cell {
            let texel = mask::texel(ray.direction, grid.octahedral);
            let mask = 2 * cell + usize::from(hit.id != NONE);
            tables.masks[mask * words + texel as usize / 32].fetch_or(1 << (texel % 32), Ordering::Relaxed);
        }
    });
}

/// Answers a ray: whether it meets something; `None`: it is to be traced.
fn answer(tables: &Tables, ray: &Ray) -> Option<bool> {
    let grid = tables.grid;
    let cell = cell_of(grid, ray.origin)?;
    let label = tables.labels[cell];
    if label == UNKNOWN {
        return None;
    }
    let texel = mask::texel(ray.direction, grid.octahedral);
    let words = mask::words(grid.octahedral);
    let at = 2 * cell * words + texel as usize / 32;
    let bit = |at: usize| tables.masks[at].load(Ordering::Relaxed) >> (texel % 32) & 1 != 0;
    let (is_free, is_met) = (bit(at), bit(at + words));
    let is_told = is_free != is_met && (grid.flags & DVF_DOUBT != 0 || is_met == (label == OCCLUDED));
    is_told.then_some(is_met)
}

/// Whether a ray, as the paper has it, is traced, and whether its cell is mostly occluded.
fn as_in_paper(tables: &Tables, ray: &Ray) -> (bool, bool) {
    let grid = tables.grid;
    let Some(cell) = cell_of(grid, ray.origin) else { return (false, false) };
    let texel = mask::texel(ray.direction, grid.octahedral);
    let words = mask::words(grid.octahedral);
    let at = 2 * cell * words + texel as usize / 32;
    let bit = |at: usize| tables.masks[at].load(Ordering::Relaxed) >> (texel % 32) & 1 != 0;
    let is_occluded = tables.labels[cell] == OCCLUDED;
    (bit(if is_occluded { at } else { at + words }), is_occluded)
}

/// Answers the rays of the pass that the field tells; those are not traced.
pub fn sift(bound: &Bound, tables: &Tables, set: &mut RaySet, gbuffer: &mut [GBuffer]) {
    let is_paper = tables.grid.flags & DVF_PAPER != 0;
    let all = set.hits.par_chunks_mut(RUN).zip(set.rays.par_chunks(RUN)).zip(gbuffer.par_chunks_mut(RUN));
    all.for_each(|((hits, rays), gbuffer)| {
        let mut tally = Tally::default();
        for ((hit, ray), g) in hits.iter_mut().zip(rays).zip(gbuffer) {
            let is_met = if is_paper {
                let (is_to_trace, is_occluded) = as_in_paper(tables, ray);
                g.padding0 = is_occluded.into();
                (is_traced(ray, hit) && !is_to_trace).then_some(is_occluded)
            } else {
                is_traced(ray, hit).then(|| answer(tables, ray)).flatten()
            };
            let Some(is_met) = is_met else { continue };
            hit.t = -1.0;
            if is_met {
                hit.id = MET;
            }
            tally.add(COUNTER_RAYS_ANSWERED, 1);
        }
        bound.counters.add(&tally);
    });
}

/// Adds the light of the environment to the primary hits as the paper of visibility fields has it: twin of
/// `shaders/dvf/dvf_light.wgsl`.
pub fn dvf_light(
    bound: &Bound,
    pixels: &mut Pixels,
    shaded: usize,
    (seen, own): (&RaySet, &RaySet),
    materials: &[Material],
) {
    for_each_hit(bound, pixels, shaded, |index, g, _| {
        if seen.surfaces[index].leaf == NONE {
            return None;
        }
        let ray = &own.rays[index];
        let is_met = !is_ray(ray) || own.hits[index].id != NONE;
        let is_occluded_cell = g.padding0 == 1;
        let mut light = if is_met != is_occluded_cell { background(bound, ray.direction) } else { [0.0; 3] };
        if !is_occluded_cell {
            let all = ambient(bound.params, g.normal);
            light = each(|k| all[k] - light[k]);
        }
        let s = Gloss::of(g, &materials[g.material as usize], seen.rays[index].direction.map(|x| -x));
        Some(each(|k| s.diffuse[k] * light[k]))
    });
}
