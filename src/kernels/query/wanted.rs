//! Queries of the whole top level for bricks in the wanted state: twin of `shaders/query/query_all.wgsl`, for rays of
//! one octant together. Near children first, each ray asks for the bricks of whose root it enters a child box at or
//! before its present hit, and notes whether it asked for any. Each asks for the same as it would alone.

use super::query_all::TOP_STACK_SIZE;
use crate::kernels::bound::{Bound, entry_bits};
use crate::kernels::layout::{
    COUNTER_PAIRS_VISIBLE, COUNTER_STACK_OVERFLOW, INSTANCE_IDENTITY, NONE, PARAM_ANY_HIT, PARAM_NEXT,
};
use crate::kernels::rays::RaySet;
use crate::kernels::simd::isa::Isa;
use crate::kernels::simd::wide::Wide;
use crate::kernels::tiles::PairCounts;
use crate::kernels::trace::intersect_all::{IntersectAll, leading};
use crate::kernels::trace::leaf::BrickRay;
use crate::kernels::trace::levels::set_pending;
use crate::kernels::trace::node::{entered_children, inner_before};
use crate::kernels::trace::packet::{Column, Packet, RAYS, Words};
use crate::kernels::trace::packet_fill::Written;
use crate::kernels::trace::packet_node::Place;
use crate::kernels::trace::packet_walk::{Entries, PacketScratch, Waiting};
use crate::kernels::trace::run::{PacketKernel, Wants, Work, run_for_each_packet};
use crate::kernels::trace::scratch::Scratch;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// Of the rays of `work`, all or those that walk from the root.
pub fn query_all(bound: &Bound, set: &mut RaySet, work: Work, pairs: &PairCounts) {
    let leading = leading(bound, set.rays.len());
    run_for_each_packet(set, bound, work, &Wanted { bound, pairs, leading: &leading });
}

/// [`intersect_all`] with what `intersect` selects, and then [`query_all`], of all rays: the same, but that rays come
/// together once for both. Returns what share of the time was taken by queries.
///
/// [`intersect_all`]: crate::kernels::trace::intersect_all::intersect_all
pub fn intersect_and_query(intersect: &Bound, bound: &Bound, set: &mut RaySet, pairs: &PairCounts) -> f64 {
    let leading = leading(bound, set.rays.len());
    let of_selected = if intersect.count { Vec::new() } else { self::leading(intersect, set.rays.len()) };
    let both = Both {
        intersect: IntersectAll { bound: intersect, pairs, leading: &of_selected },
        wanted: Wanted { bound, pairs, leading: &leading },
        nanoseconds: Default::default(),
    };
    run_for_each_packet(set, intersect, Work::All, &both);
    let [tracing, asking] = both.nanoseconds.map(|ns| ns.into_inner() as f64);
    asking / (tracing + asking).max(1.0)
}

/// Queries of rays that are pending.
struct Wanted<'a> {
    bound: &'a Bound<'a>,
    pairs: &'a PairCounts,
    leading: &'a [u8],
}

/// What rays meet, and then their queries.
struct Both<'a> {
    intersect: IntersectAll<'a, true>,
    wanted: Wanted<'a>,
    /// What each took, over all tasks.
    nanoseconds: [AtomicU64; 2],
}

impl PacketKernel for Both<'_> {
    const NARROWS: bool = true;

    const ASKS: bool = true;

    #[inline(always)]
    fn wants(&self, tile: usize) -> Option<Wants> {
        self.wanted.wants(tile)
    }

    #[inline(always)]
    fn run_packet<I: Isa>(&self, isa: I, scratch: &mut Scratch, packets: &mut PacketScratch, tile: usize) {
        let start = Instant::now();
        self.intersect.run_packet(isa, scratch, packets, tile);
        let met = Instant::now();
        let (found, rays) = (packets.packet.t, packets.packet.all() & !packets.packet.done);
        packets.packet.shorten(isa);
        self.wanted.ask(isa, scratch, packets, (tile, rays));
        packets.packet.t = found;
        for (all, took) in self.nanoseconds.iter().zip([met - start, met.elapsed()]) {
            all.fetch_add(took.as_nanos() as u64, Ordering::Relaxed);
        }
    }

    #[inline(always)]
    fn write<I: Isa>(&self, isa: I, packets: &mut PacketScratch, to: &mut Written) {
        self.intersect.write(isa, packets, to);
        self.wanted.write(isa, packets, to);
    }
}

/// The brick that each ray enters before any other that it asks for, and where.
pub struct First {
    brick: Words,
    near: Column,
    /// Whether limits have come nearer.
    is_nearer: bool,
}

impl PacketKernel for Wanted<'_> {
    const NARROWS: bool = true;

    const ASKS: bool = true;

    #[inline(always)]
    fn wants(&self, _: usize) -> Option<Wants> {
        // No hit is as far as that.
        let reach = if self.bound.params.top_count == 0 { f32::INFINITY } else { f32::NEG_INFINITY };
        Some(Wants { pending: true, unhit: self.bound.has(PARAM_ANY_HIT), reach })
    }

    #[inline(always)]
    fn run_packet<I: Isa>(&self, isa: I, scratch: &mut Scratch, packets: &mut PacketScratch, tile: usize) {
        let rays = packets.packet.all();
        self.ask(isa, scratch, packets, (tile, rays));
    }

    #[inline(always)]
    fn write<I: Isa>(&self, _: I, packets: &mut PacketScratch, to: &mut Written) {
        for (i, &at) in to.places.iter().enumerate() {
            set_pending(&mut to.surfaces[at as usize], packets.packet.asking >> i & 1 != 0);
        }
    }
}

impl Wanted<'_> {
    /// Has `rays` of a packet ask. Their distances are their limits, and come nearer.
    #[inline(always)]
    fn ask<I: Isa>(&self, isa: I, scratch: &mut Scratch, packets: &mut PacketScratch, (tile, rays): (usize, u64)) {
        let bound = self.bound;
        let PacketScratch { packet, entries, .. } = packets;
        let mut r = BrickRay::outside(&packet.ray(0));
        let place = Place::new([0.0; 3], [0.0; 3], bound.params.instance_pad);
        let mut first = First::nothing();
        entries.waiting.clear();
        entries.waiting.push(Waiting { node: 0, rays, near: Column::ZERO });
        'walk: while let Some(Waiting { node: at, rays, near }) = entries.waiting.pop() {
            let rays = first.reaching(isa, packet, &near, rays);
            if rays == 0 {
                continue;
            }
            let node = &bound.scene.top8[at as usize];
            let children = self.leading.get(at as usize).map_or(u32::MAX, |&children| children.into());
            let mut entered = [0; 8];
            let met = packet.enter(isa, (node, &place, children), rays, (&mut entered, &mut entries.children));
            let inner = u32::from(node.inner_mask);
            // The farthest first: the nearest is to be on top of the stack.
            for priority in (0..8).rev() {
                let child = priority ^ packet.flip;
                if met >> child & 1 == 0 {
                    continue;
                }
                let near = &entries.children[child as usize % 8];
                let rays = first.reaching(isa, packet, near, entered[child as usize % 8]);
                if inner & 1 << child != 0 {
                    let node = node.child_base + inner_before(inner, child);
                    let rays = packet.left_by_levels(bound, node, rays);
                    if entries.waiting.len() == TOP_STACK_SIZE {
                        scratch.tally.add(COUNTER_STACK_OVERFLOW, 1);
                        break 'walk;
                    }
                    if rays != 0 {
                        entries.waiting.push(Waiting { node, rays, near: *near });
                    }
                    continue;
                }
                let leaf = node.triangle_base + u32::from(node.meta[child as usize % 8] & 31);
                let is_wanted = bound.is_selected(bound.brick_of(leaf)) && !self.pairs.is_culled(bound, tile, leaf);
                let rays = if is_wanted { packet.taking(bound, leaf, rays) } else { 0 };
                let asking = if rays == 0 { 0 } else { enter_root(isa, (bound, &mut r, leaf), packet, rays, entries) };
                if asking != 0 {
                    let brick = bound.brick_of(leaf);
                    let nearest = first.note(isa, packet, (asking, brick), &entries.brick, bound.has(PARAM_NEXT));
                    scratch.demand.add(bound.demand, brick, asking.count_ones(), nearest);
                    scratch.tally.add(COUNTER_PAIRS_VISIBLE, asking.count_ones());
                }
            }
        }
        packet.asking = first.tell(bound, scratch);
    }
}

/// Which of `rays` enter a child box of the root of a leaf's brick up to their limits; where each enters the nearest is
/// written to `entries`. `r` is any ray of the packet.
#[inline(always)]
pub fn enter_root<'a, I: Isa>(
    isa: I,
    (bound, r, leaf): (&Bound<'a>, &mut BrickRay<'a>, u32),
    packet: &Packet,
    rays: u64,
    entries: &mut Entries,
) -> u64 {
    let Entries { root: near, brick: nearest, .. } = entries;
    let root = &bound.scene.roots[bound.brick_of(leaf)];
    let instance = bound.scene.leaves[leaf as usize].instance;
    let mut asking = 0;
    if bound.scene.instances[instance as usize].flags & INSTANCE_IDENTITY == 0 {
        let mut left = rays;
        while left != 0 {
            let i = left.trailing_zeros() as usize % RAYS;
            left &= left - 1;
            r.enter_leaf(bound.scene, &packet.ray(i), leaf);
            let boxes = isa.hits(&r.ray, &r.lanes, root, 0.0, packet.t.0[i]);
            let (entered, near) = entered_children(&boxes, root);
            asking |= u64::from(entered != 0) << i;
            nearest.0[i] = near;
        }
        return asking;
    }
    let l = &bound.scene.leaves[leaf as usize];
    let place = Place::new(l.offset_high, l.offset_low, 0.0);
    let mut entered = [0; 8];
    let mut met = packet.enter(isa, (root, &place, u32::MAX), rays, (&mut entered, near));
    if met == 0 {
        return 0;
    }
    *nearest = Column([f32::INFINITY; RAYS]);
    while met != 0 {
        let child = met.trailing_zeros() as usize % 8;
        met &= met - 1;
        asking |= entered[child];
        for v in 0..packet.vectors::<I>() {
            let lanes = (entered[child] >> (v * I::Wide::LANES)) as u32;
            let before = nearest.get(isa, v);
            nearest.replace(isa, v, lanes, near[child].get(isa, v).least(before));
        }
    }
    asking
}

impl First {
    /// No ray asks for anything yet.
    pub fn nothing() -> Self {
        Self { brick: Words::NONE, near: Column([f32::INFINITY; RAYS]), is_nearer: false }
    }

    /// Of `rays`, whose limits were not nearer than `near` before they asked, those of which they are not now.
    #[inline(always)]
    fn reaching<I: Isa>(&self, isa: I, packet: &Packet, near: &Column, rays: u64) -> u64 {
        if self.is_nearer { packet.reaching_each(isa, near, rays) } else { rays }
    }

    /// Takes note that the rays `asking` ask for a brick which they enter where `near` says; with `up_to_next` they
    /// then ask for nothing behind. Returns where the first of them enters, as bits.
    #[inline(always)]
    pub fn note<I: Isa>(
        &mut self,
        isa: I,
        packet: &mut Packet,
        (asking, brick): (u64, usize),
        near: &Column,
        up_to_next: bool,
    ) -> u32 {
        let (mut least_of, brick) = (isa.splat(f32::INFINITY), isa.splat_bits(brick as u32));
        for v in 0..packet.vectors::<I>() {
            let lanes = (asking >> (v * I::Wide::LANES)) as u32 & (u32::MAX >> (32 - I::Wide::LANES));
            if lanes == 0 {
                continue;
            }
            let near = near.get(isa, v);
            least_of = near.least(least_of).or_else(lanes, least_of);
            let nearer = near.less(self.near.get(isa, v)) & lanes;
            self.near.replace(isa, v, nearer, near);
            self.brick.replace(isa, v, nearer, brick);
            if up_to_next {
                let limit = packet.t.get(isa, v);
                packet.t.replace(isa, v, nearer, near.least(limit));
            }
        }
        if up_to_next {
            packet.shorten(isa);
            self.is_nearer = true;
        }
        let mut all = [f32::INFINITY; RAYS];
        least_of.store(&mut all);
        entry_bits(all.into_iter().fold(f32::INFINITY, f32::min))
    }

    /// Tells which bricks are asked for before others. Returns the rays that ask.
    #[inline(always)]
    pub fn tell(&self, bound: &Bound, scratch: &mut Scratch) -> u64 {
        let mut asking = 0;
        for (i, &brick) in self.brick.0.iter().enumerate().filter(|(_, brick)| **brick != NONE) {
            asking |= 1 << i;
            scratch.demand.add_next(bound.demand, brick as usize);
        }
        asking
    }
}

#[cfg(test)]
#[path = "wanted_tests.rs"]
mod tests;
