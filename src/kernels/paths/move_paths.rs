//! Where the rays of paths lie: twin of `shaders/paths/move_paths.wgsl` and what it is prepared by.

use crate::kernels::bound::Bound;
use crate::kernels::layout::{COUNTER_PATHS, NONE, Origin, Params, Ray, Surface};
use crate::kernels::rays::{RaySet, start_hit};
use crate::kernels::shade::generate::none;
use crate::kernels::shade::shade::Pixels;
use crate::kernels::vector::Vec3;
use rayon::prelude::*;

/// Edge of the blocks whose rays stay neighbours.
const BLOCK: usize = 8;

/// Calls `visit` for the places of a row of tiles, or what lies below the last whole one: tile by tile, in a tile block
/// by block, in a block row by row.
fn for_each_place(p: &Params, places: usize, mut visit: impl FnMut(usize)) {
    let [width, tile] = [p.width, p.tile].map(|x| x as usize);
    let rows = places / width;
    for first in (0..width).step_by(tile) {
        let end = (first + tile).min(width);
        for y in (0..rows).step_by(BLOCK) {
            for x in (first..end).step_by(BLOCK) {
                for row in y..(y + BLOCK).min(rows) {
                    (x..(x + BLOCK).min(end)).for_each(|column| visit(row * width + column));
                }
            }
        }
    }
}

/// What is known of a ray by which a path goes on, but for its hit.
#[derive(Clone, Copy)]
struct Path {
    ray: Ray,
    /// Its source, its cone, and the curvature of what it starts from.
    surface: Surface,
    /// Throughput, and the density of its direction.
    carried: [f32; 4],
    origin: Origin,
}

impl Path {
    /// As [`super::generate_path::generate_path`] leaves it.
    fn of(own: &RaySet, index: usize) -> Self {
        let ray = own.rays[index];
        let Surface { point: [r, g, b], normal, area, emitter, triangle, source, pending, .. } = own.surfaces[index];
        let (_, started) = start_hit(ray.t_max, source);
        let surface = Surface { pending, emitter: normal[0].to_bits(), ..started };
        Self { ray, surface, carried: [r, g, b, area], origin: Origin { pixel: emitter, direction: triangle } }
    }

    /// None.
    fn none() -> Self {
        let origin: Vec3 = [0.0; 3];
        let (_, surface) = start_hit(0.0, NONE);
        Self { ray: none(origin), surface, carried: [0.0; 4], origin: Origin::default() }
    }
}

/// Moves the rays of `own` to `seen`, each to its place.
pub fn keep_paths(_: &Bound, own: &RaySet, seen: &mut RaySet, pixels: &mut Pixels) {
    let RaySet { rays, hits, surfaces, .. } = seen;
    let places = rays.par_iter_mut().zip(hits).zip(surfaces).zip(&mut pixels.throughput).zip(&mut pixels.origins);
    places.enumerate().with_min_len(1024).for_each(|(index, ((((ray, hit), surface), carried), origin))| {
        let path = Path::of(own, index);
        (*hit, _) = start_hit(path.ray.t_max, path.surface.source);
        (*ray, *surface, *carried, *origin) = (path.ray, path.surface, path.carried, path.origin);
    });
}

/// The same, and those that go on come together in the first rows in the order that they had; what lies in rows behind
/// them is not written.
pub fn compact_paths(bound: &Bound, own: &RaySet, seen: &mut RaySet, pixels: &mut Pixels) {
    bound.counters.raise(COUNTER_PATHS, compact(bound.params, own, seen, pixels));
}

/// As [`compact_paths`]; how many go on.
fn compact(p: &Params, own: &RaySet, seen: &mut RaySet, pixels: &mut Pixels) -> u32 {
    let width = p.width as usize;
    let band = width * p.tile as usize;
    let of_bands: Vec<Vec<u32>> = (own.rays.par_chunks(band).enumerate())
        .map(|(number, rays)| {
            let mut alive = Vec::new();
            for_each_place(p, rays.len(), |at| {
                if rays[at].t_min <= rays[at].t_max {
                    alive.push((number * band + at) as u32);
                }
            });
            alive
        })
        .collect();
    let order = of_bands.concat();
    let places = order.len().div_ceil(width).max(1) * width;
    let RaySet { rays, hits, surfaces, .. } = seen;
    let moved = rays[..places].par_chunks_mut(band).zip(hits[..places].par_chunks_mut(band));
    let known = surfaces[..places].par_chunks_mut(band).zip(pixels.throughput[..places].par_chunks_mut(band));
    let all = moved.zip(known).zip(pixels.origins[..places].par_chunks_mut(band));
    all.enumerate().for_each(|(number, (((rays, hits), (surfaces, throughput)), origins))| {
        let mut from = order[(number * band).min(order.len())..].iter();
        for_each_place(p, rays.len(), |at| {
            let path = from.next().map_or_else(Path::none, |&index| Path::of(own, index as usize));
            (hits[at], _) = start_hit(path.ray.t_max, path.surface.source);
            (rays[at], surfaces[at], throughput[at], origins[at]) = (path.ray, path.surface, path.carried, path.origin);
        });
    });
    order.len() as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampling::pcg;

    const SIZE: [usize; 2] = [75, 37];

    /// Moves rays of which those go on that `goes_on` names; each notes its own number wherever it may.
    fn moved(tile: u32, goes_on: impl Fn(u32) -> bool) -> (u32, RaySet, Pixels) {
        let [width, height] = SIZE;
        let p = Params { width: width as u32, height: height as u32, tile, ..Params::default() };
        let mut own = RaySet::new(width * height);
        for (index, (ray, surface)) in (0u32..).zip(own.rays.iter_mut().zip(&mut own.surfaces)) {
            let number = index as f32;
            *ray = Ray { origin: [number; 3], t_min: if goes_on(index) { 0.0 } else { 9.0 }, t_max: 5.0, ..*ray };
            *surface = Surface { point: [number, 1.0, 2.0], area: number, source: index, pending: 7, ..*surface };
            (surface.emitter, surface.triangle, surface.normal[0]) = (index, 3, 0.5);
        }
        let mut seen = RaySet::new(own.rays.len());
        let mut pixels = Pixels::new(own.rays.len(), false);
        pixels.allow_bounces();
        let count = compact(&p, &own, &mut seen, &mut pixels);
        (count, seen, pixels)
    }

    /// The numbers of the rays in their places, in the order of places; all that is known of each came along.
    fn numbers(tile: u32, (count, seen, pixels): &(u32, RaySet, Pixels)) -> Vec<u32> {
        let [width, height] = SIZE;
        let p = Params { width: width as u32, height: height as u32, tile, ..Params::default() };
        let places = (*count as usize).div_ceil(width).max(1) * width;
        let (band, mut numbers) = (width * tile as usize, Vec::new());
        for first in (0..places).step_by(band) {
            for_each_place(&p, band.min(places - first), |at| {
                let at = first + at;
                let (ray, hit, surface) = (seen.rays[at], seen.hits[at], seen.surfaces[at]);
                if ray.t_min > ray.t_max {
                    return;
                }
                let Origin { pixel, direction } = pixels.origins[at];
                let number = pixel as f32;
                assert_eq!((ray.origin, hit.t, direction), ([number; 3], 5.0, 3));
                assert_eq!(pixels.throughput[at], [number, 1.0, 2.0, number]);
                let kept = (surface.source, surface.pending, f32::from_bits(surface.emitter));
                assert_eq!((kept, surface.point), ((pixel, 7, 0.5), [0.0; 3]));
                numbers.push(pixel);
            });
        }
        numbers
    }

    #[test]
    fn those_that_go_on_come_together_in_their_order() {
        let all = |tile| numbers(tile, &moved(tile, |_| true));
        for tile in [8, 16, 32] {
            let in_order = all(tile);
            for share in [0, 1, 3, 250] {
                let goes_on = |index: u32| pcg(index) % 256 < share;
                let found = moved(tile, goes_on);
                let kept: Vec<u32> = in_order.iter().copied().filter(|&index| goes_on(index)).collect();
                assert_eq!((found.0 as usize, numbers(tile, &found)), (kept.len(), kept), "{tile}, {share}");
            }
        }
        assert_ne!(all(8), all(16), "the order follows the tiles");
    }

    #[test]
    fn where_all_go_on_each_keeps_its_place() {
        let (count, seen, _) = moved(16, |_| true);
        assert_eq!(count as usize, seen.rays.len());
        let own = |(index, ray): (usize, &Ray)| ray.origin[0] == index as f32;
        assert!(seen.rays.iter().enumerate().all(own));
    }

    #[test]
    fn neighbours_stay_neighbours() {
        let width = SIZE[0] as u32;
        // Of runs of 64 rays: how many columns they come from.
        let columns = |numbers: &[u32]| -> u32 {
            let of_run = |run: &[u32]| {
                let own = || run.iter().map(|number| number % width);
                own().max().unwrap_or(0) - own().min().unwrap_or(0)
            };
            numbers.chunks(64).map(of_run).sum()
        };
        let found = numbers(16, &moved(16, |index| pcg(index).is_multiple_of(4)));
        let mut by_rows = found.clone();
        by_rows.sort_unstable();
        assert!(3 * columns(&found) < 2 * columns(&by_rows), "{} of {}", columns(&found), columns(&by_rows));
    }
}
