//! Distance fields: twins of `shaders/df/flood_seeds.wgsl`, `jump_flood.wgsl`, `flood_distances.wgsl`,
//! `halve_distances.wgsl` and `field_trace.wgsl`.

use super::maps::FieldMaps;
use super::{DistanceField, LEAST_STEP, Tracing, Way, flood, seeds};
use crate::kernels::bound::{Bound, Tally};
use crate::kernels::dispatch::{FLOOD_DISTANCES, FLOOD_SEEDS, HALVE_DISTANCES, JUMP_FLOOD};
use crate::kernels::layout::{COUNTER_FIELD_CAPPED, COUNTER_RAYS, FIELD_HIT, Hit, Params, Ray, RomaLevel};
use crate::kernels::rays::RaySet;
use crate::kernels::vector::{Vec3, each};
use crate::math::sampling::random2;
use crate::secondary::roma::twin::{BLEND, clipped, end_of};
use rayon::prelude::*;

/// Rays that a task traces in a row.
const RUN: usize = 256;

/// The fields.
#[derive(Default)]
pub struct FieldTables {
    /// How they are placed.
    pub maps: FieldMaps,
    /// Those that were made last, by their levels.
    pub fields: Vec<DistanceField>,
    /// Of the one in the making, the nearest occupied cells.
    nearest: [Vec<u32>; 2],
}

/// Runs a kernel that makes a part of a field.
pub fn make_field(kernel: &str, bound: &Bound, tables: &mut FieldTables) {
    let p = bound.params;
    let FieldTables { maps, fields, nearest } = tables;
    let (number, half) = (p.field_level as usize, p.field_half as usize);
    let map = &maps.cascades.levels[number];
    match kernel {
        FLOOD_SEEDS => {
            nearest.iter_mut().for_each(|half| half.resize(p.field_cells.pow(3) as usize, 0));
            seeds(map, &mut nearest[0]);
            fields.truncate(number);
            fields.push(DistanceField::unfilled(map));
        }
        JUMP_FLOOD => {
            let [zero, one] = nearest;
            let (given, next) = if half == 0 { (zero, one) } else { (one, zero) };
            flood(given, next, p.field_cells, p.field_step);
        }
        FLOOD_DISTANCES => fields[number].fill(&nearest[half]),
        HALVE_DISTANCES => fields[number].halve(p.field_mip as usize),
        _ => unreachable!("no kernel of fields"),
    }
}

/// What rays are traced against.
struct Fields<'a> {
    params: &'a Params,
    levels: &'a [RomaLevel],
    fields: &'a [DistanceField],
}

impl Fields<'_> {
    /// Where a ray meets something, and whether it was capped.
    fn trace(&self, index: u32, ray: &Ray, normal: Vec3) -> (Option<f32>, bool) {
        let p = self.params;
        let tracing = Tracing { iterations: p.field_steps, hit: p.field_hit, least_step: LEAST_STEP };
        let side = p.field_cells as f32;
        let margin = BLEND * (side * random2(index, !p.stream, p.seed)[0]);
        let at = |level: &RomaLevel| each(|k| (ray.origin[k] + level.lift * normal[k]) * level.scale + level.first[k]);
        let holds = |level: &RomaLevel| at(level).iter().all(|&x| x >= margin && x <= side - margin);
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
pub fn field_trace(bound: &Bound, tables: &FieldTables, own: &mut RaySet, seen: &RaySet) {
    let of = Fields { params: bound.params, levels: &tables.maps.levels, fields: &tables.fields };
    let normal = |index: usize| seen.surfaces.get(index).map_or([0.0; 3], |surface| surface.normal);
    own.hits.par_chunks_mut(RUN).zip(own.rays.par_chunks(RUN)).enumerate().for_each(|(run, (hits, rays))| {
        let mut tally = Tally::default();
        for (i, (hit, ray)) in hits.iter_mut().zip(rays).enumerate().filter(|(_, (_, ray))| ray.t_min <= ray.t_max) {
            let index = run * RUN + i;
            tally.add(COUNTER_RAYS, 1);
            if of.levels.is_empty() {
                continue;
            }
            let (found, is_capped) = of.trace(index as u32, ray, normal(index));
            tally.add(COUNTER_FIELD_CAPPED, u32::from(is_capped));
            if let Some(t) = found {
                *hit = Hit { t, id: FIELD_HIT, u: 0.0, v: 0.0 };
            }
        }
        bound.counters.add(&tally);
    });
}
