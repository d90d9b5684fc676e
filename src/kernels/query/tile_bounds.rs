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
    let mut b = TileBounds {
        origin_min: [T_INFINITE; 3],
        t_min: T_INFINITE,
        origin_max: [-T_INFINITE; 3],
        t_max: 0.0,
        direction_min: [T_INFINITE; 3],
        rays: 0,
        direction_max: [-T_INFINITE; 3],
        spreads: 0,
    };
    let mut spreads = [T_INFINITE, 0.0];
    for y in y0..y1 {
        for x in x0..x1 {
            let at = (y * p.width + x) as usize;
            let ray = &set.rays[at];
            if is_traced(ray, &set.hits[at]) {
                b.origin_min = each(|k| least(b.origin_min[k], ray.origin[k]));
                b.origin_max = each(|k| most(b.origin_max[k], ray.origin[k]));
                b.direction_min = each(|k| least(b.direction_min[k], ray.direction[k]));
                b.direction_max = each(|k| most(b.direction_max[k], ray.direction[k]));
                b.t_min = least(b.t_min, ray.t_min);
                b.t_max = most(b.t_max, set.hits[at].t);
                b.rays += 1;
                let own = spread_of(&set.surfaces[at]);
                spreads = [least(spreads[0], own), most(spreads[1], own)];
            }
        }
    }
    if b.rays > 0 {
        let [least, most] = spreads.map(f32::to_bits);
        b.spreads = least & 0xffff_0000 | (most + 0xffff) >> 16;
    }
    b
}
