//! Intersects each ray with the whole scene, or what of it is selected, from the root: twin of
//! `shaders/trace/intersect_all.wgsl`. One loop over the wide top-level tree and, through copies of the bricks' roots
//! in its leaves, the bricks; nodes are visited until one has triangles.

use super::brick::Best;
use super::leaf::BrickRay;
use super::node::{FramedRay, framed_ray, inner_before};
use super::packet_node::Place;
use super::packet_walk::{PacketGroup, PacketScratch, put, take};
use super::run::{PacketKernel, RayKernel, Work, run_for_each_packet};
use super::scratch::Scratch;
use super::walk_brick::{Group, Visits, finish_walk};
use crate::kernels::bound::Bound;
use crate::kernels::layout::{NONE, PARAM_ANY_HIT};
use crate::kernels::rays::{RaySet, Slot};
use crate::kernels::simd::isa::{Isa, Lanes};
use crate::kernels::tiles::PairCounts;

/// A group of the top level: the node, and its entered children, inner ones and leaves alike, by priority in the high
/// byte, so that bricks are met near to far.
#[inline(always)]
fn top_group<I: Isa>(
    isa: I,
    bound: &Bound,
    visits: &mut Visits,
    ray: &FramedRay,
    lanes: &Lanes,
    node: u32,
    t_max: f32,
) -> Group {
    let n = &bound.scene.top8[node as usize];
    visits.nodes += 1;
    Group { base: node, bits: isa.open_top(ray, lanes, n, bound.params.instance_pad, t_max) }
}

/// Of the rays of `work`; `SELECT`: with what is selected, but for culled pairs.
pub fn intersect_all<const SELECT: bool>(bound: &Bound, set: &mut RaySet, work: Work, pairs: &PairCounts) {
    run_for_each_packet(set, bound, work, &IntersectAll::<SELECT> { bound, pairs });
}

struct IntersectAll<'a, const SELECT: bool> {
    bound: &'a Bound<'a>,
    pairs: &'a PairCounts,
}

impl<const SELECT: bool> IntersectAll<'_, SELECT> {
    #[inline(always)]
    fn is_left_out(&self, tile: usize, leaf: u32) -> bool {
        let Self { bound, pairs } = self;
        SELECT && (!bound.is_selected(bound.brick_of(leaf)) || pairs.is_culled(bound, tile, leaf))
    }
}

impl<const SELECT: bool> RayKernel for IntersectAll<'_, SELECT> {
    #[inline(always)]
    fn run<I: Isa>(&self, isa: I, scratch: &mut Scratch, slot: Slot) {
        self.trace(isa, scratch, slot);
    }
}

impl<const SELECT: bool> PacketKernel for IntersectAll<'_, SELECT> {
    #[inline(always)]
    fn takes(&self, slot: &Slot) -> bool {
        takes::<SELECT>(self.bound, slot)
    }

    #[inline(always)]
    fn run_packet<I: Isa>(&self, isa: I, scratch: &mut Scratch, packets: &mut PacketScratch, tile: usize) {
        let bound = self.bound;
        let any_hit = bound.has(PARAM_ANY_HIT);
        let flip = packets.packet.flip;
        let place = Place::new([0.0; 3], [0.0; 3], bound.params.instance_pad);
        let mut depth = 0;
        // The node whose children are visited next, and who visits it.
        let mut next = Some((0, packets.packet.all()));
        loop {
            if let Some((index, rays)) = next.take() {
                let node = &bound.scene.top8[index as usize];
                let mut group = PacketGroup { group: Group { base: index, bits: 0 }, rays: [0; 8] };
                let mut met = packets.packet.open(isa, node, &place, rays, &mut group.rays);
                packets.visits.nodes = packets.visits.nodes.wrapping_add(rays.count_ones());
                while met != 0 {
                    group.group.bits |= 0x8000_0000 >> (met.trailing_zeros() ^ flip);
                    met &= met - 1;
                }
                if !put(&mut packets.top, &mut depth, group, &mut scratch.tally) {
                    break;
                }
            }
            if depth == 0 {
                break;
            }
            let (group, child, rays) = take(&mut packets.top, &mut depth, flip);
            let rays = rays & !packets.packet.done;
            let node = &bound.scene.top8[group.base as usize];
            let inner = u32::from(node.inner_mask);
            if rays == 0 {
                continue;
            } else if inner & 1 << child != 0 {
                next = Some((node.child_base + inner_before(inner, child), rays));
                continue;
            }
            let leaf = node.triangle_base + u32::from(node.meta[child as usize] & 31);
            if !self.is_left_out(tile, leaf) {
                packets.walk_leaf(isa, bound, scratch, leaf, rays, any_hit);
            }
        }
    }
}

#[inline(always)]
fn takes<const SELECT: bool>(bound: &Bound, slot: &Slot) -> bool {
    let is_found = bound.has(PARAM_ANY_HIT) && slot.hit.id != NONE;
    let is_left_out = SELECT && (is_found || slot.surface.pending == 0);
    slot.is_traced() && bound.params.top_count != 0 && !is_left_out
}

impl<const SELECT: bool> IntersectAll<'_, SELECT> {
    #[inline(always)]
    fn trace<I: Isa>(&self, isa: I, scratch: &mut Scratch, mut slot: Slot) {
        let bound = self.bound;
        if !takes::<SELECT>(bound, &slot) {
            return;
        }
        let ray = *slot.ray;
        let any_hit = bound.has(PARAM_ANY_HIT);
        let world = framed_ray(ray.origin, ray.direction, ray.t_min);
        let mut best = Best::before(&slot);
        let mut visits = Visits::default();
        let lanes = Lanes::new(&world, [0.0; 3], [0.0; 3]);
        let mut r = BrickRay::outside(&world);
        let Scratch { stack, tally, .. } = scratch;
        let mut depth = 0;
        // Stack depth at which the brick ends.
        let mut floor = 0;
        let mut in_brick = false;
        let mut group = top_group(isa, bound, &mut visits, &world, &lanes, 0, best.t);
        loop {
            let mut triangles = Group::default();
            loop {
                if !group.has_children() {
                    if in_brick && depth == floor {
                        in_brick = false;
                        r.ray.flip = world.flip;
                    }
                    if depth == 0 {
                        break;
                    }
                    depth -= 1;
                    group = stack[depth];
                }
                let Some(child) = group.take_nearest(r.ray.flip, stack, &mut depth, tally) else { break };
                if in_brick {
                    let opened = r.open_node(isa, bound, &mut visits, best.t, group.child_index(child));
                    group = opened.children;
                    triangles = opened.triangles;
                    if triangles.bits != 0 {
                        break;
                    }
                    continue;
                }
                let node = &bound.scene.top8[group.base as usize];
                let inner = u32::from(node.inner_mask);
                if inner & 1 << child != 0 {
                    let next = node.child_base + inner_before(inner, child);
                    group = top_group(isa, bound, &mut visits, &world, &lanes, next, best.t);
                } else {
                    let leaf = node.triangle_base + u32::from(node.meta[child as usize] & 31);
                    let brick = bound.brick_of(leaf);
                    if self.is_left_out(slot.tile, leaf) {
                        group = Group::default();
                        continue;
                    }
                    floor = depth;
                    in_brick = true;
                    r.enter_leaf(bound.scene, &world, leaf);
                    r.enter_brick(bound, brick);
                    group = Group::root(r.ray.flip);
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
}
