//! How kernels run over the rays of a set: bands of rows in parallel, in each blocks of neighbours, ray by ray or in
//! packets.

use super::levels::set_pending;
use super::node::octant;
use super::packet::{Packet, RAYS};
use super::packet_fill::{Known, Taken, Written, four_of_square};
use super::packet_walk::PacketScratch;
use super::scratch::Scratch;
use crate::kernels::bound::Bound;
use crate::kernels::layout::{
    Hit, PARAM_ANY_HIT, PARAM_BOUNCE, PARAM_CULLED, PARAM_EMITTER, PARAM_ENVIRONMENT, Ray, Surface, T_INFINITE,
    TileList,
};
use crate::kernels::rays::{RaySet, Slot};
use crate::kernels::simd::isa::{self, Isa};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};

/// Edge of the blocks of rays that one thread traces in a row.
const BLOCK: usize = 8;

/// Calls `visit` with the number of each bit that is set.
#[inline(always)]
fn for_each_set(mut bits: u64, mut visit: impl FnMut(usize)) {
    while bits != 0 {
        visit(bits.trailing_zeros() as usize);
        bits &= bits - 1;
    }
}

/// Whose rays a kernel runs over.
#[derive(Clone, Copy)]
pub enum Work<'a> {
    /// All tiles'.
    All,
    /// Those of the tiles that have been chosen: whether each has.
    Chosen(&'a [bool]),
    /// Those of the tiles whose rays walk from the root, as their lists say.
    Rooted(&'a [TileList]),
}

impl Work<'_> {
    fn includes(self, tile: usize) -> bool {
        match self {
            Self::All => true,
            Self::Chosen(chosen) => chosen[tile],
            Self::Rooted(lists) => lists[tile].from_root != 0,
        }
    }
}

/// What a task works with.
#[derive(Default)]
struct Task {
    /// What kernels keep from ray to ray.
    scratch: Scratch,
    /// What packets work with, once there was one.
    packets: Option<Box<PacketScratch>>,
    /// How rays come together in packets, once there was one.
    groups: Option<Box<Groups>>,
}

/// A rectangle of rays that lies in one band, and in one tile where tiles differ.
struct Block {
    tile: usize,
    /// The first row of its band in the set.
    row: usize,
    /// First column.
    first: usize,
    columns: usize,
    rows: usize,
}

impl Block {
    /// Squares of 8 x 8 that it consists of.
    #[inline(always)]
    fn squares(&self) -> usize {
        self.columns.div_ceil(BLOCK) * self.rows.div_ceil(BLOCK)
    }

    /// Calls `visit` with the numbers of the rays of a square within the band of rows of `width`: squares of 4 x 4 one
    /// after the other, so that neighbours come together.
    #[inline(always)]
    fn for_each_place(&self, width: usize, square: usize, mut visit: impl FnMut(usize)) {
        let across = self.columns.div_ceil(BLOCK);
        let (first, row, end) =
            (self.first + square % across * BLOCK, square / across * BLOCK, self.first + self.columns);
        for quarter in 0..4 {
            let (x, y) = (first + quarter % 2 * BLOCK / 2, row + quarter / 2 * BLOCK / 2);
            for row in y..(y + BLOCK / 2).min(self.rows) {
                for column in x..(x + BLOCK / 2).min(end) {
                    visit(row * width + column);
                }
            }
        }
    }

    /// The same of the rays whose bit is set, in the order of [`Self::for_each_place`].
    #[inline(always)]
    fn for_each_bit(&self, width: usize, square: usize, mut bits: u64, mut visit: impl FnMut(usize)) {
        let across = self.columns.div_ceil(BLOCK);
        let (first, row, end) =
            (self.first + square % across * BLOCK, square / across * BLOCK, self.first + self.columns);
        while bits != 0 {
            let bit = bits.trailing_zeros() as usize;
            bits &= bits - 1;
            let column = first + (bit >> 4 & 1) * BLOCK / 2 + (bit & 3);
            let row = row + (bit >> 5) * BLOCK / 2 + (bit >> 2 & 3);
            if row < self.rows && column < end {
                visit(row * width + column);
            }
        }
    }

    /// The number of the first ray of a square that has all 64, within the band of rows of `width`.
    #[inline(always)]
    fn whole(&self, width: usize, square: usize) -> Option<usize> {
        let across = self.columns.div_ceil(BLOCK);
        let (column, row) = (square % across * BLOCK, square / across * BLOCK);
        (column + BLOCK <= self.columns && row + BLOCK <= self.rows).then_some(row * width + self.first + column)
    }

    /// The bit of a ray of the band within its square.
    #[inline(always)]
    fn bit_of(width: usize, at: usize) -> u64 {
        let (x, y) = (at % width % BLOCK, at / width % BLOCK);
        1 << ((y / 4 * 2 + x / 4) * 16 + y % 4 * 4 + x % 4)
    }

    /// The number of a square among those of all rows of `width`.
    #[inline(always)]
    fn number_of(&self, width: usize, square: usize) -> usize {
        let across = self.columns.div_ceil(BLOCK);
        (self.row / BLOCK + square / across) * width.div_ceil(BLOCK) + self.first / BLOCK + square % across
    }
}

/// The rays of a band with what is written of them.
struct Band<'a> {
    rays: &'a [Ray],
    hits: &'a mut [Hit],
    surfaces: &'a mut [Surface],
    /// [`RaySet::waiting`] of all bands.
    waiting: &'a [AtomicU64],
}

impl Band<'_> {
    #[inline(always)]
    fn known(&self) -> Known<'_> {
        Known { rays: self.rays, hits: self.hits, surfaces: self.surfaces }
    }

    #[inline(always)]
    fn slot(&mut self, tile: usize, at: usize) -> Slot<'_> {
        Slot { tile, ray: &self.rays[at], hit: &mut self.hits[at], surface: &mut self.surfaces[at] }
    }
}

/// Calls `visit` for the blocks of `work`, of at most so many rows and columns: bands of rows in parallel. Unless tiles
/// are chosen, or have pairs of their own that are culled, blocks may reach over several.
fn for_each_block(
    set: &mut RaySet,
    bound: &Bound,
    work: Work,
    [rows, columns]: [usize; 2],
    visit: impl Fn(&mut Task, &mut Band, Block) + Sync,
) {
    let [width, tile_edge, tiles_x] = [bound.params.width, bound.params.tile, bound.params.tiles_x].map(|x| x as usize);
    // Tiles are powers of two of at least 8.
    let tiles_differ = !matches!(work, Work::All) || bound.has(PARAM_CULLED);
    let rows = rows.min(tile_edge);
    let columns = if tiles_differ { columns.min(tile_edge) } else { columns };
    let band = rows * width;
    let RaySet { rays, hits, surfaces, waiting } = set;
    let bands = rays.par_chunks(band).zip(hits.par_chunks_mut(band)).zip(surfaces.par_chunks_mut(band));
    bands.enumerate().for_each(|(number, ((rays, hits), surfaces))| {
        let mut task = Task::default();
        let row = number * rows;
        let rows = rays.len() / width;
        let mut band = Band { rays, hits, surfaces, waiting };
        for first in (0..width).step_by(columns) {
            let tile = row / tile_edge * tiles_x + first / tile_edge;
            if work.includes(tile) {
                let columns = columns.min(width - first);
                visit(&mut task, &mut band, Block { tile, row, first, columns, rows });
            }
        }
        bound.counters.add(&task.scratch.tally);
        task.scratch.demand.finish(bound.demand);
    });
}

/// Calls `kernel` for every ray of `work`: bands of rows in parallel, in each blocks of 8 x 8 rays, so that neighbours
/// meet the same nodes.
pub fn for_each_ray(set: &mut RaySet, bound: &Bound, work: Work, kernel: impl Fn(&mut Scratch, Slot) + Sync) {
    let width = bound.params.width as usize;
    for_each_block(set, bound, work, [BLOCK; 2], |task, band, block| {
        for square in 0..block.squares() {
            block.for_each_place(width, square, |at| kernel(&mut task.scratch, band.slot(block.tile, at)));
        }
    });
}

/// Which of the rays that are traced a kernel does something for.
#[derive(Clone, Copy)]
pub struct Wants {
    /// Those alone that are pending,
    pub pending: bool,
    /// that have hit nothing so far,
    pub unhit: bool,
    /// and whose hits are not nearer than this.
    pub reach: f32,
}

impl Wants {
    /// All of them.
    pub const TRACED: Self = Self { pending: false, unhit: false, reach: f32::NEG_INFINITY };

    /// Of the rays that a packet has taken those that are wanted.
    #[inline(always)]
    fn of<I: Isa>(&self, isa: I, packet: &Packet, taken: &Taken) -> u64 {
        let mut rays = taken.traced;
        if self.pending {
            rays &= taken.pending;
        }
        if self.unhit {
            rays &= taken.unhit;
        }
        if self.reach > f32::NEG_INFINITY {
            rays &= packet.reaching(isa, self.reach);
        }
        rays
    }
}

/// A kernel that rays of one octant run together, compiled for every instruction set. Implementations are always
/// inlined, so that all of it is.
pub trait PacketKernel: Sync {
    /// Whether it takes pending rays alone. [`RaySet::waiting`] is narrowed to those then.
    const NARROWS: bool;

    /// Whether rays that it has seen pending are so no more, but for those of which it writes that they are.
    const ASKS: bool = false;

    /// Which rays of a tile it does anything for; `None`: for none.
    fn wants(&self, tile: usize) -> Option<Wants>;

    /// Runs it for the rays of the packet, which are of the tile; what they find stays with them.
    fn run_packet<I: Isa>(&self, isa: I, scratch: &mut Scratch, packets: &mut PacketScratch, tile: usize);

    /// Writes what ray i of the packet has found to the i-th of the places.
    fn write<I: Isa>(&self, isa: I, packets: &mut PacketScratch, to: &mut Written);
}

/// Edge of the blocks whose rays are made packets of, those that go in much the same direction together. Lower ones are
/// as much wider.
const PACKET_BLOCK: usize = 64;
/// Rays of such a block.
const BLOCK_RAYS: usize = PACKET_BLOCK * PACKET_BLOCK;
/// Bands that a thread has at least, if they can be so low.
const BANDS: usize = 8;
/// Steps of a direction's components along x and y within its octant, a power of two, by which rays are sorted.
const STEPS: usize = 4;
/// Steps along either axis across the direction of parallel rays, a power of two, by which these are sorted.
const START_STEPS: usize = 16;
/// Cells of an octant: of directions, or of places where rays begin.
const OCTANT_CELLS: usize = START_STEPS * START_STEPS;
/// Cells of all octants.
const CELLS: usize = 8 * OCTANT_CELLS;
/// So many rays of a square of 8 x 8 go together if they are of one octant; others wait for those of their octant in
/// the block.
const LEAST_SQUARE: usize = 16;

/// [`for_each_ray`] with the dispatch's instruction set, rays of an octant together.
pub fn run_for_each_packet(set: &mut RaySet, bound: &Bound, work: Work, kernel: &impl PacketKernel) {
    // Where there are many threads, each has its share of bands.
    let height = bound.params.height as usize;
    narrow(set, bound, kernel);
    let of_thread = height / (BANDS * rayon::current_num_threads());
    let mut rows = PACKET_BLOCK;
    while rows > BLOCK && rows > of_thread {
        rows /= 2;
    }
    for_each_block(set, bound, work, [rows, BLOCK_RAYS / rows], |task, band, block| {
        bound.isa.run(OfBlock { bound, kernel, task, band, block });
    });
}

/// Has the words of a set be there for a kernel that narrows them.
fn narrow<K: PacketKernel>(set: &mut RaySet, bound: &Bound, _: &K) {
    if K::NARROWS && set.waiting.is_empty() {
        let squares = (bound.params.width as usize).div_ceil(BLOCK) * (bound.params.height as usize).div_ceil(BLOCK);
        set.waiting.resize_with(squares, || AtomicU64::new(u64::MAX));
    }
}

/// A kernel over a block.
struct OfBlock<'a, 'b, 'c, K> {
    bound: &'a Bound<'b>,
    kernel: &'a K,
    task: &'a mut Task,
    band: &'a mut Band<'c>,
    block: Block,
}

impl<K: PacketKernel> isa::Work for OfBlock<'_, '_, '_, K> {
    type Out = ();

    #[inline(always)]
    fn run<I: Isa>(self, isa: I) {
        let Self { bound, kernel, task, band, block } = self;
        run_block(isa, bound, kernel, task, band, block);
    }
}

/// Makes packets of a block's rays and runs them.
#[inline(always)]
fn run_block<I: Isa, K: PacketKernel>(
    isa: I,
    bound: &Bound,
    kernel: &K,
    task: &mut Task,
    band: &mut Band,
    block: Block,
) {
    let Some(wants) = kernel.wants(block.tile) else { return };
    let mut packets = task.packets.take().unwrap_or_default();
    let mut groups = task.groups.take().unwrap_or_default();
    groups.begin(Order::of(bound));
    let width = bound.params.width as usize;
    while groups.next::<I, K>(isa, &wants, (band, &block, width), &mut packets.packet) {
        let places = &groups.places[..groups.count];
        kernel.run_packet(isa, &mut task.scratch, &mut packets, block.tile);
        packets.count(bound, &mut task.scratch.tally);
        let to = &mut Written { hits: band.hits, surfaces: band.surfaces, places };
        kernel.write(isa, &mut packets, to);
    }
    (task.packets, task.groups) = (Some(packets), Some(groups));
}

/// By what rays of an octant are sorted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Order {
    /// By where they lead, but for those of squares that are of one octant: neighbours begin close to each other.
    Direction,
    /// By where they begin, seen along their direction: rays to the sun from what bounces met. They are parallel but
    /// for its disc, and neighbours in the picture may begin far from each other.
    Start,
}

impl Order {
    #[inline(always)]
    fn of(bound: &Bound) -> Self {
        let to_sun = bound.has(PARAM_ANY_HIT) && !bound.has(PARAM_EMITTER) && !bound.has(PARAM_ENVIRONMENT);
        if to_sun && bound.has(PARAM_BOUNCE) { Self::Start } else { Self::Direction }
    }
}

/// Takes the rays of a block by groups of an octant: those of a square of 8 x 8 where they are of one and the order
/// allows it, then the others, sorted.
struct Groups {
    order: Order,
    /// The square that is looked at next.
    square: usize,
    /// Rays that wait for others of their octant.
    waiting: [u32; BLOCK_RAYS],
    /// How many.
    count_waiting: usize,
    /// Their cells,
    cells: [u16; BLOCK_RAYS],
    /// and they by cells, once there are no more squares.
    sorted: [u32; BLOCK_RAYS],
    /// How many of them lie in the octants up to each.
    ends: [usize; 8],
    /// How many have been taken.
    taken: usize,
    /// The group: the places of its rays.
    count: usize,
    places: [u32; RAYS],
}

impl Default for Groups {
    fn default() -> Self {
        let (waiting, cells, sorted) = ([0; BLOCK_RAYS], [0; BLOCK_RAYS], [0; BLOCK_RAYS]);
        let (order, ends, places) = (Order::Direction, [0; 8], [0; RAYS]);
        Self { order, square: 0, waiting, count_waiting: 0, cells, sorted, ends, taken: 0, count: 0, places }
    }
}

/// The first cell of a ray's octant.
#[inline(always)]
fn octant_cell(ray: &Ray) -> usize {
    octant(ray.direction) as usize % 8 * OCTANT_CELLS
}

/// The cell of a pair of steps, along a Z-order curve.
#[inline(always)]
fn z_order([x, y]: [usize; 2]) -> usize {
    let spread = |i: usize| i & 1 | (i & 2) << 1 | (i & 4) << 2 | (i & 8) << 3;
    spread(x) + 2 * spread(y)
}

/// The cell of a ray by its direction: its octant, and in that along a curve. What rays meet that end soon depends on
/// where they begin, so of these the octant is all.
#[inline(always)]
fn cell_of_direction(ray: &Ray) -> usize {
    if ray.t_max < T_INFINITE {
        return octant_cell(ray);
    }
    let m = ray.direction.map(f32::abs);
    let per_sum = STEPS as f32 / (m[0] + m[1] + m[2]);
    // Casts saturate; what is no number is 0.
    let step = |x: f32| ((x * per_sum) as usize).min(STEPS - 1);
    octant_cell(ray) + z_order([step(m[0]), step(m[1])])
}

/// The cells of the rays at `waiting`, of one or more, by where they begin, on a grid over all of them that lies across
/// the direction of the first.
fn cells_of_starts(rays: &[Ray], waiting: &[u32], cells: &mut [u16]) {
    let d = rays[waiting[0] as usize].direction;
    let m = d.map(f32::abs);
    let k = (1..3).fold(0, |k, axis| if m[axis] > m[k] { axis } else { k });
    let across = [(k + 1) % 3, (k + 2) % 3];
    let slopes = across.map(|axis| d[axis] / d[k]);
    let start = |at: u32| -> [f32; 2] {
        let o = rays[at as usize].origin;
        std::array::from_fn(|i| o[across[i]] - o[k] * slopes[i])
    };
    let (mut least, mut most) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
    for &at in waiting {
        let p = start(at);
        for i in 0..2 {
            (least[i], most[i]) = (least[i].min(p[i]), most[i].max(p[i]));
        }
    }
    let scale: [f32; 2] = std::array::from_fn(|i| START_STEPS as f32 / (most[i] - least[i]));
    for (cell, &at) in cells.iter_mut().zip(waiting) {
        let p = start(at);
        // As above.
        let step = |i: usize| (((p[i] - least[i]) * scale[i]) as usize).min(START_STEPS - 1);
        *cell = (octant_cell(&rays[at as usize]) + z_order([step(0), step(1)])) as u16;
    }
}

impl Groups {
    /// Begins with a block.
    fn begin(&mut self, order: Order) {
        (self.order, self.square, self.count_waiting, self.taken) = (order, 0, 0, 0);
    }

    /// Has a packet take the rays of a square, but for those that are known not to be pending: which of them are
    /// wanted, and what is seen of them.
    #[inline(always)]
    fn look<I: Isa, K: PacketKernel>(
        &mut self,
        isa: I,
        wants: &Wants,
        (band, block, width): (&mut Band, &Block, usize),
        packet: &mut Packet,
    ) -> (u64, Taken) {
        let (mut bits, mut word) = (u64::MAX, None);
        if K::NARROWS {
            let of = &band.waiting[block.number_of(width, self.square)];
            (bits, word) = (of.load(Ordering::Relaxed), Some(of));
        }
        let whole = if bits == u64::MAX { block.whole(width, self.square) } else { None };
        if let Some(at) = whole {
            self.count = RAYS;
            for (four, places) in self.places.as_chunks_mut::<4>().0.iter_mut().enumerate() {
                let first = (at + four_of_square(four, width)) as u32;
                *places = [first, first + 1, first + 2, first + 3];
            }
        } else {
            self.count = 0;
            block.for_each_bit(width, self.square, bits, |at| {
                self.places[self.count % RAYS] = at as u32;
                self.count += 1;
            });
        }
        let places = &self.places[..self.count];
        let known = band.known();
        let taken = match whole {
            Some(at) => packet.fill_square(isa, (at, width), known),
            None if places.is_empty() => Taken::default(),
            None => packet.fill(isa, places, known),
        };
        let wanted = wants.of(isa, packet, &taken);
        if let Some(word) = word {
            let mut left = taken.pending;
            if whole.is_none() {
                left = 0;
                for_each_set(taken.pending, |i| left |= Block::bit_of(width, places[i % RAYS] as usize));
            }
            if left != bits {
                word.store(left, Ordering::Relaxed);
            }
        }
        if K::ASKS {
            for_each_set(taken.pending & !wanted, |i| {
                set_pending(&mut band.surfaces[places[i % RAYS] as usize], false)
            });
        }
        (wanted, taken)
    }

    /// Has a packet take the next group of rays that are wanted. False: there is none.
    #[inline(always)]
    fn next<I: Isa, K: PacketKernel>(
        &mut self,
        isa: I,
        wants: &Wants,
        (band, block, width): (&mut Band, &Block, usize),
        packet: &mut Packet,
    ) -> bool {
        while self.square < block.squares() {
            let (wanted, taken) = self.look::<I, K>(isa, wants, (&mut *band, block, width), packet);
            self.square += 1;
            if wanted == 0 {
                continue;
            }
            let together = self.order == Order::Direction && wanted.count_ones() as usize >= LEAST_SQUARE;
            let octant = taken.octant(wanted).filter(|_| together);
            if wanted != packet.all() || octant.is_none() {
                let all = self.places;
                self.count = 0;
                for_each_set(wanted, |i| {
                    self.places[self.count % RAYS] = all[i % RAYS];
                    self.count += 1;
                });
            }
            if let Some(octant) = octant {
                if wanted != packet.all() {
                    packet.fill(isa, &self.places[..self.count], band.known());
                }
                packet.seal(isa, octant);
                return true;
            }
            for &place in &self.places[..self.count.min(RAYS)] {
                self.waiting[self.count_waiting % BLOCK_RAYS] = place;
                self.count_waiting += 1;
            }
        }
        if self.square == block.squares() {
            self.sort(band.rays);
            self.square += 1;
        }
        for (octant, end) in self.ends.into_iter().enumerate() {
            if self.taken < end {
                self.count = (end - self.taken).min(RAYS);
                self.places[..self.count].copy_from_slice(&self.sorted[self.taken..self.taken + self.count]);
                self.taken += self.count;
                packet.fill(isa, &self.places[..self.count], band.known());
                packet.seal(isa, octant as u32);
                return true;
            }
        }
        false
    }

    /// Sorts the rays that wait, of `rays`, by cells.
    fn sort(&mut self, rays: &[Ray]) {
        if self.count_waiting == 0 {
            self.ends = [0; 8];
            return;
        }
        let waiting = &self.waiting[..self.count_waiting.min(BLOCK_RAYS)];
        let cells = &mut self.cells[..waiting.len()];
        match self.order {
            Order::Direction => {
                for (cell, &at) in cells.iter_mut().zip(waiting) {
                    *cell = cell_of_direction(&rays[at as usize]) as u16;
                }
            }
            Order::Start => cells_of_starts(rays, waiting, cells),
        }
        // How many are of each cell, then where those of each go.
        let mut next = [0; CELLS];
        for &cell in &*cells {
            next[cell as usize % CELLS] += 1;
        }
        let mut end = 0;
        for (octant, next) in next.chunks_mut(OCTANT_CELLS).enumerate() {
            for next in next {
                (*next, end) = (end, end + *next);
            }
            self.ends[octant] = end;
        }
        for (&at, &cell) in waiting.iter().zip(&*cells) {
            let to = &mut next[cell as usize % CELLS];
            self.sorted[*to % BLOCK_RAYS] = at;
            *to += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rays along `direction` from points that a hash strews over a cube.
    fn strewn(count: u32, direction: [f32; 3]) -> Vec<Ray> {
        let coordinate = |i: u32| crate::math::sampling::pcg(i) as f32 / u32::MAX as f32;
        let origin = |i: u32| [3 * i, 3 * i + 1, 3 * i + 2].map(coordinate);
        (0..count).map(|i| Ray { origin: origin(i), t_min: 0.0, direction, t_max: T_INFINITE }).collect()
    }

    /// The places of the rays by groups, as packets take them, and what of the square across the direction the groups
    /// of 64 cover on average.
    fn sorted(rays: &[Ray], order: Order) -> (Vec<u32>, f32) {
        let mut groups = Groups { order, count_waiting: rays.len(), ..Groups::default() };
        (0..rays.len()).for_each(|i| groups.waiting[i] = i as u32);
        groups.sort(rays);
        assert_eq!(groups.ends[7], rays.len());
        let places = groups.sorted[..rays.len()].to_vec();
        let d = rays[0].direction;
        let across = |at: u32, axis: usize| {
            let o = rays[at as usize].origin;
            o[axis] - o[1] * d[axis] / d[1]
        };
        let extent = |group: &[u32], axis: usize| {
            let of = |f: fn(f32, f32) -> f32, from| group.iter().fold(from, |x, &at| f(x, across(at, axis)));
            of(f32::max, f32::NEG_INFINITY) - of(f32::min, f32::INFINITY)
        };
        let area = |group: &[u32]| extent(group, 0) * extent(group, 2);
        let all = area(&places);
        let groups = places.chunks(RAYS);
        (places.clone(), groups.clone().map(|group| area(group) / all).sum::<f32>() / groups.len() as f32)
    }

    #[test]
    fn rays_to_the_sun_that_begin_close_to_each_other_go_together() {
        let rays = strewn(4096, [0.3, 0.9, -0.2]);
        let (mut places, share) = sorted(&rays, Order::Start);
        // A 64th at best.
        assert!(share < 0.06, "{share}");
        places.sort_unstable();
        assert!(places.into_iter().eq(0..4096));
        // The direction of all is the same, so that by it they stay as they are.
        let (places, share) = sorted(&rays, Order::Direction);
        assert!(share > 0.5, "{share}");
        assert!(places.into_iter().eq(0..4096));
    }

    #[test]
    fn rays_that_begin_at_one_point_or_nowhere_are_sorted_as_well() {
        for origin in [[7.0; 3], [f32::NAN; 3], [f32::INFINITY; 3]] {
            let rays: Vec<Ray> = strewn(100, [0.0, -1.0, 0.0]).into_iter().map(|ray| Ray { origin, ..ray }).collect();
            assert!(sorted(&rays, Order::Start).0.into_iter().eq(0..100));
        }
        let still: Vec<Ray> = strewn(100, [0.0; 3]);
        let mut places = sorted(&still, Order::Start).0;
        places.sort_unstable();
        assert!(places.into_iter().eq(0..100));
    }
}
