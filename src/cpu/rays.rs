//! Rays of a set and the loops over them.

use super::isa::{Best, Isa};
use super::scene::{Bound, Tally};
use super::tile_lists::TileLists;
use super::walk_brick::{STACK_SIZE, Stack};
use crate::kernel::layout::{Hit, NONE, Ray, Surface};
use rayon::prelude::*;

/// Edge of the blocks of rays that one thread traces in a row; also the rows of a band.
const BLOCK: usize = 8;

/// Rays, hits and surfaces of one set, row by row.
#[derive(Default)]
pub struct RaySet {
    /// Rays.
    pub rays: Vec<Ray>,
    /// Hits.
    pub hits: Vec<Hit>,
    /// Surfaces.
    pub surfaces: Vec<Surface>,
}

impl RaySet {
    /// For `rays` rays, none of which has an end.
    pub fn new(rays: usize) -> Self {
        Self {
            rays: vec![Ray::default(); rays],
            hits: vec![Hit::default(); rays],
            surfaces: vec![Surface::default(); rays],
        }
    }
}

/// A ray with its tile and what is written of it.
pub struct Slot<'a> {
    /// Number of its tile.
    pub tile: usize,
    /// The ray.
    pub ray: &'a Ray,
    /// Its hit.
    pub hit: &'a mut Hit,
    /// Its surface.
    pub surface: &'a mut Surface,
}

impl Slot<'_> {
    /// Whether the ray is traced.
    #[inline(always)]
    pub fn is_traced(&self) -> bool {
        self.ray.t_min <= self.ray.t_max
    }
}

/// Whose rays a kernel runs over.
#[derive(Clone, Copy)]
pub enum Work<'a> {
    /// All tiles'.
    All,
    /// Those of the tiles that have been chosen.
    Chosen(&'a TileLists),
    /// Those of the tiles whose rays walk from the root.
    Rooted(&'a TileLists),
}

impl Work<'_> {
    fn includes(self, tile: usize) -> bool {
        match self {
            Self::All => true,
            Self::Chosen(tiles) => tiles.chosen[tile],
            Self::Rooted(tiles) => tiles.lists[tile].from_root != 0,
        }
    }
}

/// What a task keeps from ray to ray.
pub struct Scratch {
    /// What it counts.
    pub tally: Tally,
    /// The stack of a traversal.
    pub stack: Stack,
    /// That of a traversal over single nodes.
    pub nodes: Vec<u32>,
}

impl Default for Scratch {
    fn default() -> Self {
        Self { tally: Tally::default(), stack: [Default::default(); STACK_SIZE], nodes: Vec::new() }
    }
}

/// Calls `kernel` for every ray of `work`: bands of rows in parallel, in each blocks of 8 x 8 rays, so that neighbours meet the same
/// nodes. A block lies in one tile.
pub fn for_each_ray(set: &mut RaySet, bound: &Bound, work: Work, kernel: impl Fn(&mut Scratch, Slot) + Sync) {
    let [width, edge, tiles_x] = [bound.params.width, bound.params.tile, bound.params.tiles_x].map(|x| x as usize);
    let band = BLOCK * width;
    let RaySet { rays, hits, surfaces } = set;
    let bands = rays.par_chunks(band).zip(hits.par_chunks_mut(band)).zip(surfaces.par_chunks_mut(band));
    bands.enumerate().for_each(|(number, ((rays, hits), surfaces))| {
        let mut scratch = Scratch::default();
        for first in (0..width).step_by(BLOCK) {
            let tile = number * BLOCK / edge * tiles_x + first / edge;
            if !work.includes(tile) {
                continue;
            }
            for row in 0..rays.len() / width {
                for x in first..(first + BLOCK).min(width) {
                    let at = row * width + x;
                    let (ray, hit, surface) = (&rays[at], &mut hits[at], &mut surfaces[at]);
                    let slot = Slot { tile, ray, hit, surface };
                    kernel(&mut scratch, slot);
                }
            }
        }
        bound.counters.add(&scratch.tally);
    });
}

/// A kernel that is compiled for every instruction set.
pub trait RayKernel: Sync {
    /// Runs it for one ray. Implementations are always inlined, so that all of it is compiled for `isa`.
    fn run<I: Isa>(&self, isa: I, scratch: &mut Scratch, slot: Slot);
}

/// [`for_each_ray`] with the dispatch's instruction set.
pub fn run_for_each_ray(set: &mut RaySet, bound: &Bound, work: Work, kernel: &impl RayKernel) {
    match bound.isa {
        Best::Scalar(isa) => for_each_ray(set, bound, work, |scratch, slot| kernel.run(isa, scratch, slot)),
        #[cfg(target_arch = "x86_64")]
        Best::Avx2(isa) => for_each_ray(set, bound, work, |scratch, slot| {
            // SAFETY: a value of the type exists only where AVX2 has been detected.
            unsafe { run_avx2(isa, kernel, scratch, slot) }
        }),
    }
}

/// What `kernel` is compiled for AVX2 in.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2(isa: super::isa::Avx2, kernel: &impl RayKernel, scratch: &mut Scratch, slot: Slot) {
    kernel.run(isa, scratch, slot);
}

/// Starts a ray's hit: nothing found within its range; triangle `source`, from which it starts, is not met (NONE: of none).
pub fn start_hit(t_max: f32, source: u32) -> (Hit, Surface) {
    (Hit { t: t_max, id: NONE, u: 0.0, v: 0.0 }, Surface { leaf: NONE, source, pending: 1, ..Surface::default() })
}
