//! Distance fields: twins of `shaders/df/flood_seeds.wgsl`, `jump_flood.wgsl`, `flood_distances.wgsl`,
//! `halve_distances.wgsl` and `df_trace.wgsl`.

use super::field::{FieldView, distances, halve};
use super::{LEAST_STEP, LEVELS, Tracing, Way, flood, seeds};
use crate::kernels::bound::{Bound, Tally};
use crate::kernels::layout::{COUNTER_RAYS_ANSWERED, COUNTER_RAYS_CAPPED, DfOwn, Hit, Level, MET, Params, Ray};
use crate::kernels::rays::RaySet;
use crate::kernels::table::words;
use crate::kernels::vector::{Vec3, each};
use crate::math::sampling::random2;
use crate::schedule::ExecutorError;
use crate::secondary::roma::twin::{BLEND, clipped, end_of};
use half::f16;
use half::slice::HalfBitsSliceExt;
use rayon::prelude::*;

/// Rays that a task traces in a row.
const RUN: usize = 256;

/// Words of the distances of a level of a field of so many cells.
fn mip_words(cells: u32, mip: usize) -> usize {
    (cells >> mip).pow(3) as usize / 2
}

/// The distances of the levels of field `level`.
fn field_of(distances: &[u32], cells: u32, level: u32) -> FieldView<'_> {
    let mut rest = &distances[level as usize * (0..LEVELS).map(|mip| mip_words(cells, mip)).sum::<usize>()..];
    let levels = std::array::from_fn(|mip| {
        let words;
        (words, rest) = rest.split_at(mip_words(cells, mip));
        bytemuck::cast_slice::<u32, u16>(words).reinterpret_cast()
    });
    FieldView { cells, levels }
}

/// The distances of level `mip` of field `level`, and those of the level before.
fn levels_of(distances: &mut [u32], cells: u32, level: u32, mip: usize) -> (&[f16], &mut [f16]) {
    let words = |mip| mip_words(cells, mip);
    let first = level as usize * (0..LEVELS).map(words).sum::<usize>() + (0..mip).map(words).sum::<usize>();
    let (before, own) = distances.split_at_mut(first);
    let fine = if mip == 0 { &[][..] } else { &before[first - words(mip - 1)..] };
    let own = bytemuck::cast_slice_mut::<u32, u16>(&mut own[..words(mip)]).reinterpret_cast_mut();
    (bytemuck::cast_slice::<u32, u16>(fine).reinterpret_cast(), own)
}

/// Begins flooding a field.
pub fn flood_seeds(bound: &Bound, buffers: &mut [Vec<u32>]) -> Result<(), ExecutorError> {
    let own: &DfOwn = bound.own();
    let [_, boms, nearest, _] = words(buffers)?;
    let words = (own.cells * own.cells * (own.cells / 32)) as usize;
    seeds(own.cells, &boms[own.level as usize * words..][..words], &mut nearest[..own.cells.pow(3) as usize]);
    Ok(())
}

/// One step of flooding.
pub fn jump_flood(bound: &Bound, buffers: &mut [Vec<u32>]) -> Result<(), ExecutorError> {
    let own: &DfOwn = bound.own();
    let [_, _, nearest, _] = words(buffers)?;
    let cells = own.cells.pow(3) as usize;
    let (zero, one) = nearest[..2 * cells].split_at_mut(cells);
    let (given, next) = if own.half == 0 { (zero, one) } else { (one, zero) };
    flood(given, next, own.cells, own.step);
    Ok(())
}

/// Makes distances of the nearest cells.
pub fn flood_distances(bound: &Bound, buffers: &mut [Vec<u32>]) -> Result<(), ExecutorError> {
    let own: &DfOwn = bound.own();
    let [_, _, nearest, all] = words(buffers)?;
    let cells = own.cells.pow(3) as usize;
    distances(&nearest[own.half as usize * cells..][..cells], own.cells, levels_of(all, own.cells, own.level, 0).1);
    Ok(())
}

/// Makes a level of half as many cells.
pub fn halve_distances(bound: &Bound, buffers: &mut [Vec<u32>]) -> Result<(), ExecutorError> {
    let own: &DfOwn = bound.own();
    let [_, _, _, all] = words(buffers)?;
    let (fine, coarse) = levels_of(all, own.cells, own.level, own.mip as usize);
    halve(fine, own.cells >> (own.mip - 1), coarse);
    Ok(())
}

/// What rays are traced against.
struct Fields<'a> {
    params: &'a Params,
    own: &'a DfOwn,
    levels: &'a [Level],
    fields: Vec<FieldView<'a>>,
}

impl Fields<'_> {
    /// Where a ray meets something, and whether it was capped.
    fn trace(&self, index: u32, ray: &Ray, normal: Vec3) -> (Option<f32>, bool) {
        let (p, own) = (self.params, self.own);
        let tracing = Tracing { iterations: own.steps, hit: own.hit, least_step: LEAST_STEP };
        let side = own.cells as f32;
        let margin = BLEND * (side * random2(index, !p.stream, p.seed)[0]);
        let at = |level: &Level| each(|k| (ray.origin[k] + level.lift * normal[k]) * level.scale + level.first[k]);
        let holds = |level: &Level| at(level).iter().all(|&x| x >= margin && x <= side - margin);
        let start_level = self.levels.iter().position(holds).unwrap_or(self.levels.len() - 1);
        let d = ray.direction;
        let squares = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
        let rise = d[0] * normal[0] + d[1] * normal[1] + d[2] * normal[2];
        // A ray starts near a surface.
        let mut way = Way::default();
        let mut t = ray.t_min;
        for (l, level) in self.levels.iter().enumerate().skip(start_level) {
            let at = at(level);
            let speed = ray.direction.map(|x| x * level.scale);
            let low = if l + 1 == self.levels.len() { 0.0 } else { margin };
            let high = side - low;
            let end = end_of(ray.t_max, level.lift, squares, rise);
            let range = (0..3).fold([t, end], |range, k| clipped(range, at[k], speed[k], low, high));
            if range[0] <= range[1] {
                let (found, is_capped) = self.fields[l].through(&tracing, at, speed, range, &mut way);
                if found.is_some() || is_capped || range[1] >= end {
                    return (found, is_capped);
                }
                // The distances of a level are those to what it holds: the ray goes on where it left it, however far it
                // saw.
                t = range[1];
            }
        }
        (None, false)
    }
}

/// Answers the pass's rays by distance fields (Zeng et al., §6, their baseline): in the finest level that holds the
/// start, then in the next where the ray leaves one. What is met is written as a hit of no triangle.
pub fn df_trace(bound: &Bound, buffers: &mut [Vec<u32>], own: &mut RaySet, seen: &RaySet) -> Result<(), ExecutorError> {
    let told: &DfOwn = bound.own();
    let [levels, _, _, distances] = words(buffers)?;
    let fields = (0..told.levels).map(|level| field_of(distances, told.cells, level)).collect();
    let levels = &bytemuck::cast_slice(levels)[..told.levels as usize];
    let of = Fields { params: bound.params, own: told, levels, fields };
    let normal = |index: usize| seen.surfaces.get(index).map_or([0.0; 3], |surface| surface.normal);
    own.hits.par_chunks_mut(RUN).zip(own.rays.par_chunks(RUN)).enumerate().for_each(|(run, (hits, rays))| {
        let mut tally = Tally::default();
        for (i, (hit, ray)) in hits.iter_mut().zip(rays).enumerate().filter(|(_, (_, ray))| ray.t_min <= ray.t_max) {
            let index = run * RUN + i;
            tally.add(COUNTER_RAYS_ANSWERED, 1);
            if of.levels.is_empty() {
                continue;
            }
            let (found, is_capped) = of.trace(index as u32, ray, normal(index));
            tally.add(COUNTER_RAYS_CAPPED, u32::from(is_capped));
            if let Some(t) = found {
                *hit = Hit { t, id: MET, u: 0.0, v: 0.0 };
            }
        }
        bound.counters.add(&tally);
    });
    Ok(())
}
