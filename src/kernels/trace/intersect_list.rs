//! Intersects each ray with a run of the selected leaves of its tile, in their order: twin of
//! `shaders/trace/intersect_list.wgsl`. Nodes are visited until one has triangles.

use super::brick::Best;
use super::leaf::BrickRay;
use super::node::framed_ray;
use super::packet_walk::PacketScratch;
use super::run::{PacketKernel, RayKernel, Work, run_for_each_packet};
use super::scratch::Scratch;
use super::walk_brick::{Group, Visits, finish_walk};
use crate::kernels::bound::Bound;
use crate::kernels::layout::{Entry, NONE, PARAM_ANY_HIT};
use crate::kernels::rays::{RaySet, Slot};
use crate::kernels::simd::isa::Isa;
use crate::kernels::tiles::TileLists;

/// Of the rays of chosen tiles.
pub fn intersect_list(bound: &Bound, set: &mut RaySet, lists: &TileLists) {
    run_for_each_packet(set, bound, Work::Chosen(&lists.chosen), &IntersectList { bound, lists });
}

struct IntersectList<'a> {
    bound: &'a Bound<'a>,
    lists: &'a TileLists,
}

impl RayKernel for IntersectList<'_> {
    #[inline(always)]
    fn run<I: Isa>(&self, isa: I, scratch: &mut Scratch, slot: Slot) {
        trace(isa, self, scratch, slot);
    }
}

impl IntersectList<'_> {
    /// The run of a tile's selection: its first, and the one after the last.
    #[inline(always)]
    fn run_of(&self, tile: usize) -> (u32, u32) {
        let (entry, params) = (&self.lists.lists[tile], self.bound.params);
        let next = entry.first + params.run_first.min(entry.selected);
        (next, (entry.first + entry.selected).min(next.saturating_add(params.run_count)))
    }

    /// An entry of the selection.
    #[inline(always)]
    fn listed(&self, position: u32) -> Entry {
        self.lists.list[self.lists.selection[position as usize] as usize]
    }
}

impl PacketKernel for IntersectList<'_> {
    #[inline(always)]
    fn takes(&self, slot: &Slot) -> bool {
        let (next, end) = self.run_of(slot.tile);
        next != end && slot.is_traced() && !(self.bound.has(PARAM_ANY_HIT) && slot.hit.id != NONE)
    }

    #[inline(always)]
    fn run_packet<I: Isa>(&self, isa: I, scratch: &mut Scratch, packets: &mut PacketScratch, tile: usize) {
        let (next, end) = self.run_of(tile);
        for position in next..end {
            let listed = self.listed(position);
            let rays = packets.packet.reaching(isa, listed.near) & !packets.packet.done;
            if rays != 0 {
                packets.walk_leaf(isa, self.bound, scratch, listed.leaf, rays, self.bound.has(PARAM_ANY_HIT));
            }
        }
    }
}

#[inline(always)]
fn trace<I: Isa>(isa: I, kernel: &IntersectList, scratch: &mut Scratch, mut slot: Slot) {
    if !kernel.takes(&slot) {
        return;
    }
    let bound = kernel.bound;
    let (mut next, end) = kernel.run_of(slot.tile);
    let ray = *slot.ray;
    let any_hit = bound.has(PARAM_ANY_HIT);
    let world = framed_ray(ray.origin, ray.direction, ray.t_min);
    let mut best = Best::before(&slot);
    let mut visits = Visits::default();
    let mut r = BrickRay::outside(&world);
    let Scratch { stack, tally, .. } = scratch;
    let mut depth = 0;
    let mut group = Group::default();
    loop {
        let mut triangles = Group::default();
        loop {
            if !group.has_children() {
                if depth > 0 {
                    depth -= 1;
                    group = stack[depth];
                } else {
                    if next == end {
                        break;
                    }
                    let listed = kernel.listed(next);
                    next += 1;
                    if listed.near > best.t {
                        continue;
                    }
                    r.enter_leaf(bound.scene, &world, listed.leaf);
                    r.enter_brick(bound, bound.brick_of(listed.leaf));
                    group = Group::root(r.ray.flip);
                }
            }
            let Some(child) = group.take_nearest(r.ray.flip, stack, &mut depth, tally) else { break };
            let opened = r.open_node(isa, bound, &mut visits, best.t, group.child_index(child));
            group = opened.children;
            triangles = opened.triangles;
            if triangles.bits != 0 {
                break;
            }
        }
        if triangles.bits == 0 {
            break;
        }
        r.test_triangles(&mut visits, &mut best, triangles, any_hit);
        if any_hit && best.leaf != NONE {
            break;
        }
    }
    finish_walk(bound, &world, &best, visits, &mut slot, tally);
}
