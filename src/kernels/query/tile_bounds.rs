//! Bounds of the rays of each tile: twin of `shaders/query/tile_bounds.wgsl`. Origins, directions, and the range of
//! distances in which they can still hit.

use crate::kernels::bound::{Bound, Tally};
use crate::kernels::layout::{COUNTER_RAYS_TRACED, T_INFINITE, TileBounds};
use crate::kernels::rays::{RaySet, is_traced};
use crate::kernels::trace::levels::spread_of;
use crate::kernels::vector::{each, least, most};
use rayon::prelude::*;

/// Of all tiles.
pub fn tile_bounds(bound: &Bound, set: &RaySet, bounds: &mut [TileBounds]) {
    bounds.par_iter_mut().enumerate().for_each(|(tile, out)| {
        *out = bounds_of(bound, set, tile as u32);
        let mut tally = Tally::default();
        tally.add(COUNTER_RAYS_TRACED, out.rays);
        bound.counters.add(&tally);
    });
}

fn bounds_of(bound: &Bound, set: &RaySet, tile: u32) -> TileBounds {
    let p = bound.params;
    let (x0, y0) = ((tile % p.tiles_x) * p.tile, (tile / p.tiles_x) * p.tile);
    let (x1, y1) = ((x0 + p.tile).min(p.width), (y0 + p.tile).min(p.height));
    // Of the numbers of a ray, which lie side by side: origin, t_min, direction, t_max.
    let (mut min, mut max) = ([T_INFINITE; 8], [-T_INFINITE; 8]);
    let (mut rays, mut t_max, mut spreads) = (0, 0.0, [T_INFINITE, 0.0]);
    for y in y0..y1 {
        for x in x0..x1 {
            let at = (y * p.width + x) as usize;
            let ray = &set.rays[at];
            if is_traced(ray, &set.hits[at]) {
                let numbers: [f32; 8] = bytemuck::cast(*ray);
                for k in 0..8 {
                    min[k] = least(min[k], numbers[k]);
                    max[k] = most(max[k], numbers[k]);
                }
                t_max = most(t_max, set.hits[at].t);
                rays += 1;
                let own = spread_of(&set.surfaces[at]);
                spreads = [least(spreads[0], own), most(spreads[1], own)];
            }
        }
    }
    let mut b = TileBounds {
        origin_min: each(|k| min[k]),
        t_min: min[3],
        origin_max: each(|k| max[k]),
        t_max,
        direction_min: each(|k| min[4 + k]),
        rays,
        direction_max: each(|k| max[4 + k]),
        spreads: 0,
    };
    if b.rays > 0 {
        let [least, most] = spreads.map(f32::to_bits);
        b.spreads = least & 0xffff_0000 | (most + 0xffff) >> 16;
    }
    b
}
