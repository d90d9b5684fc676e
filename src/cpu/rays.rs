//! Rays of a set and the loops over them.

use super::isa::{Best, Isa};
use super::node::octant;
use super::packet::RAYS;
use super::packet_walk::PacketScratch;
use super::scene::{Bound, Tally};
use super::tile_lists::TileLists;
use super::walk_brick::{STACK_SIZE, Stack};
use crate::kernel::layout::{Hit, NONE, Ray, Surface};
use rayon::prelude::*;

/// Edge of the blocks of rays that one thread traces in a row.
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
    /// The same, and where the ray enters them.
    pub entered: Vec<(u32, f32)>,
    /// What packets work with, once there was one.
    packets: Option<Box<PacketScratch>>,
}

impl Default for Scratch {
    fn default() -> Self {
        Self {
            tally: Tally::default(),
            stack: [Default::default(); STACK_SIZE],
            nodes: Vec::new(),
            entered: Vec::new(),
            packets: None,
        }
    }
}

/// A rectangle of rays that lies in one tile and in one band.
struct Block {
    tile: usize,
    /// First column.
    first: usize,
    columns: usize,
    rows: usize,
}

impl Block {
    /// Calls `visit` with the numbers of its rays within the band of rows of `width`: squares of 8 x 8 one after the other, in each
    /// squares of 4 x 4, so that neighbours come together.
    #[inline(always)]
    fn for_each_place(&self, width: usize, mut visit: impl FnMut(usize)) {
        let end = self.first + self.columns;
        for y in (0..self.rows).step_by(BLOCK) {
            for x in (self.first..end).step_by(BLOCK) {
                for quarter in 0..4 {
                    let (x, y) = (x + quarter % 2 * BLOCK / 2, y + quarter / 2 * BLOCK / 2);
                    for row in y..(y + BLOCK / 2).min(self.rows) {
                        for column in x..(x + BLOCK / 2).min(end) {
                            visit(row * width + column);
                        }
                    }
                }
            }
        }
    }
}

/// The rays of a band with what is written of them.
struct Band<'a> {
    rays: &'a [Ray],
    hits: &'a mut [Hit],
    surfaces: &'a mut [Surface],
}

impl Band<'_> {
    #[inline(always)]
    fn slot(&mut self, tile: usize, at: usize) -> Slot<'_> {
        Slot { tile, ray: &self.rays[at], hit: &mut self.hits[at], surface: &mut self.surfaces[at] }
    }
}

/// Calls `visit` for the blocks of `work`, at most `edge` wide and high: bands of rows in parallel.
fn for_each_block(
    set: &mut RaySet,
    bound: &Bound,
    work: Work,
    edge: usize,
    visit: impl Fn(&mut Scratch, &mut Band, Block) + Sync,
) {
    let [width, tile_edge, tiles_x] = [bound.params.width, bound.params.tile, bound.params.tiles_x].map(|x| x as usize);
    // Tiles are powers of two of at least 8.
    let edge = edge.min(tile_edge);
    let band = edge * width;
    let RaySet { rays, hits, surfaces } = set;
    let bands = rays.par_chunks(band).zip(hits.par_chunks_mut(band)).zip(surfaces.par_chunks_mut(band));
    bands.enumerate().for_each(|(number, ((rays, hits), surfaces))| {
        let mut scratch = Scratch::default();
        let rows = rays.len() / width;
        let mut band = Band { rays, hits, surfaces };
        for first in (0..width).step_by(edge) {
            let tile = number * edge / tile_edge * tiles_x + first / tile_edge;
            if work.includes(tile) {
                let columns = edge.min(width - first);
                visit(&mut scratch, &mut band, Block { tile, first, columns, rows });
            }
        }
        bound.counters.add(&scratch.tally);
    });
}

/// Calls `kernel` for every ray of `work`: bands of rows in parallel, in each blocks of 8 x 8 rays, so that neighbours meet the same
/// nodes.
pub fn for_each_ray(set: &mut RaySet, bound: &Bound, work: Work, kernel: impl Fn(&mut Scratch, Slot) + Sync) {
    let width = bound.params.width as usize;
    for_each_block(set, bound, work, BLOCK, |scratch, band, block| {
        block.for_each_place(width, |at| kernel(scratch, band.slot(block.tile, at)));
    });
}

/// A kernel that is compiled for every instruction set. Implementations are always inlined, so that all of it is.
pub trait RayKernel: Sync {
    /// Runs it for one ray.
    fn run<I: Isa>(&self, isa: I, scratch: &mut Scratch, slot: Slot);
}

/// A kernel that rays of one octant may run together.
pub trait PacketKernel: RayKernel {
    /// Whether it does anything for a ray.
    fn takes(&self, slot: &Slot) -> bool;

    /// Runs it for the rays of the packet, which are of the tile; what they find stays with them.
    fn run_packet<I: Isa>(&self, isa: I, scratch: &mut Scratch, packets: &mut PacketScratch, tile: usize);
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
        #[cfg(target_arch = "x86_64")]
        Best::Avx512(isa) => for_each_ray(set, bound, work, |scratch, slot| {
            // SAFETY: a value of the type exists only where AVX2 has been detected.
            unsafe { run_avx2(isa, kernel, scratch, slot) }
        }),
    }
}

/// What `kernel` is compiled for AVX2 in.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<I: Isa>(isa: I, kernel: &impl RayKernel, scratch: &mut Scratch, slot: Slot) {
    kernel.run(isa, scratch, slot);
}

/// Edge of the blocks whose rays are made packets of, those of an octant together.
const PACKET_BLOCK: usize = 32;
/// Rays of such a block.
const BLOCK_RAYS: usize = PACKET_BLOCK * PACKET_BLOCK;
/// Fewer rays of an octant go one by one.
const LEAST_PACKET: usize = 4;

/// [`run_for_each_ray`], rays of an octant together.
pub fn run_for_each_packet(set: &mut RaySet, bound: &Bound, work: Work, kernel: &impl PacketKernel) {
    for_each_block(set, bound, work, PACKET_BLOCK, |scratch, band, block| match bound.isa {
        Best::Scalar(isa) => run_block(isa, bound, kernel, scratch, band, block),
        #[cfg(target_arch = "x86_64")]
        Best::Avx2(isa) => {
            // SAFETY: a value of the type exists only where AVX2 has been detected.
            unsafe { run_block_avx2(isa, bound, kernel, scratch, band, block) }
        }
        #[cfg(target_arch = "x86_64")]
        Best::Avx512(isa) => {
            // SAFETY: a value of the type exists only where AVX-512 and AVX2 have been detected.
            unsafe { run_block_avx512(isa, bound, kernel, scratch, band, block) }
        }
    });
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_block_avx2(
    isa: super::isa::Avx2,
    bound: &Bound,
    kernel: &impl PacketKernel,
    scratch: &mut Scratch,
    band: &mut Band,
    block: Block,
) {
    run_block(isa, bound, kernel, scratch, band, block);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,avx512f,avx512dq")]
fn run_block_avx512(
    isa: super::isa::Avx512,
    bound: &Bound,
    kernel: &impl PacketKernel,
    scratch: &mut Scratch,
    band: &mut Band,
    block: Block,
) {
    run_block(isa, bound, kernel, scratch, band, block);
}

/// Makes packets of a block's rays and runs them.
#[inline(always)]
fn run_block<I: Isa>(
    isa: I,
    bound: &Bound,
    kernel: &impl PacketKernel,
    scratch: &mut Scratch,
    band: &mut Band,
    block: Block,
) {
    let mut packets = scratch.packets.take().unwrap_or_default();
    let mut order = [0; BLOCK_RAYS];
    let counts = sorted(bound, kernel, band, &block, &mut order);
    let mut rest = &order[..];
    for (flip, count) in counts.into_iter().enumerate() {
        let (octant, others) = rest.split_at(count);
        rest = others;
        for places in octant.chunks(RAYS) {
            if places.len() < LEAST_PACKET {
                for &at in places {
                    kernel.run(isa, scratch, band.slot(block.tile, at as usize));
                }
                continue;
            }
            packets.packet.clear(flip as u32);
            for &at in places {
                let slot = band.slot(block.tile, at as usize);
                packets.packet.add(slot.ray, slot.hit, slot.surface.source);
            }
            packets.packet.seal(isa);
            kernel.run_packet(isa, scratch, &mut packets, block.tile);
            packets.count(bound, &mut scratch.tally);
            packets.packet.write(isa, bound, band.hits, band.surfaces, places);
        }
    }
    scratch.packets = Some(packets);
}

/// The rays of a block for which `kernel` does anything, in `order` by octants; how many are of each.
#[inline(always)]
fn sorted(
    bound: &Bound,
    kernel: &impl PacketKernel,
    band: &mut Band,
    block: &Block,
    order: &mut [u32; BLOCK_RAYS],
) -> [usize; 8] {
    let mut taken = [(0u32, 0u8); BLOCK_RAYS];
    let (mut count, mut counts) = (0, [0; 8]);
    block.for_each_place(bound.params.width as usize, |at| {
        let slot = band.slot(block.tile, at);
        let octant = octant(slot.ray.direction);
        taken[count % BLOCK_RAYS] = (at as u32, octant as u8);
        let takes = usize::from(kernel.takes(&slot));
        counts[octant as usize % 8] += takes;
        count += takes;
    });
    let mut next = [0; 8];
    for octant in 1..8 {
        next[octant] = next[octant - 1] + counts[octant - 1];
    }
    for &(at, octant) in &taken[..count] {
        let to = &mut next[octant as usize % 8];
        order[*to % BLOCK_RAYS] = at;
        *to += 1;
    }
    counts
}

/// Starts a ray's hit: nothing found within its range; triangle `source`, from which it starts, is not met (NONE: of none).
pub fn start_hit(t_max: f32, source: u32) -> (Hit, Surface) {
    (Hit { t: t_max, id: NONE, u: 0.0, v: 0.0 }, Surface { leaf: NONE, source, pending: 1, ..Surface::default() })
}
