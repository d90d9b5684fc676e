//! Ray-by-ray queries of the selected (tile, leaf) pairs: twin of `shaders/query/query.wgsl`. How many rays of the tile
//! enter a child box of the brick's root at or before their present hit, and where the nearest does.

use super::wanted::{First, enter_root};
use crate::kernels::bound::Bound;
use crate::kernels::layout::{NONE, PARAM_ANY_HIT, PARAM_NEEDED, PARAM_NEXT};
use crate::kernels::rays::{RaySet, Slot};
use crate::kernels::simd::isa::Isa;
use crate::kernels::tiles::TileLists;
use crate::kernels::trace::leaf::BrickRay;
use crate::kernels::trace::levels::spread_of;
use crate::kernels::trace::node::{entered_children, framed_ray};
use crate::kernels::trace::packet_fill::Written;
use crate::kernels::trace::packet_walk::PacketScratch;
use crate::kernels::trace::run::{PacketKernel, Wants, Work, for_each_ray, run_for_each_packet};
use crate::kernels::trace::scratch::Scratch;

/// Of the rays of chosen tiles. With PARAM_NEEDED the hits are final and the rays of an any-hit pass that ended
/// occluded ask only for the brick that holds their hit.
pub fn query(bound: &Bound, set: &mut RaySet, lists: &TileLists) {
    if bound.has(PARAM_NEEDED) {
        for_each_ray(set, bound, Work::Chosen(&lists.chosen), |scratch, slot| needed(bound, scratch, &slot, lists));
    } else {
        run_for_each_packet(set, bound, Work::Chosen(&lists.chosen), &Query { bound, lists });
    }
}

/// Queries of rays whose hits are not final.
struct Query<'a> {
    bound: &'a Bound<'a>,
    lists: &'a TileLists,
}

impl PacketKernel for Query<'_> {
    const NARROWS: bool = false;

    #[inline(always)]
    fn wants(&self, tile: usize) -> Option<Wants> {
        Some(Wants { unhit: self.bound.has(PARAM_ANY_HIT), reach: self.lists.nearest[tile], ..Wants::TRACED })
    }

    /// As [`needed`] for hits that are not final, where the rays that enter no child of a root are told together.
    #[inline(always)]
    fn run_packet<I: Isa>(&self, isa: I, scratch: &mut Scratch, packets: &mut PacketScratch, tile: usize) {
        let Self { bound, lists } = self;
        let entry = lists.lists[tile];
        let PacketScratch { packet, entries, .. } = packets;
        let mut r = BrickRay::outside(&packet.ray(0));
        let mut first = First::nothing();
        for next in entry.first..entry.first + entry.selected {
            let position = lists.selection[next as usize] as usize;
            let listed = lists.list[position];
            let leaf = bound.leaf_of(&listed);
            // Their distances are their limits.
            let rays = packet.taking(bound, leaf, packet.reaching(isa, listed.near));
            let rays = packet.meeting(bound, listed.node, rays);
            if rays == 0 {
                continue;
            }
            let asking = enter_root(isa, (bound, &mut r, leaf), packet, rays, entries);
            if asking != 0 {
                let brick = bound.brick_of(leaf);
                let nearest = first.note(isa, packet, (asking, brick), &entries.brick, bound.has(PARAM_NEXT));
                lists.pair_demand[position].add(asking.count_ones(), nearest);
            }
        }
        first.tell(bound, scratch);
    }

    /// Their limits are no hits.
    #[inline(always)]
    fn write<I: Isa>(&self, _: I, _: &mut PacketScratch, _: &mut Written) {}
}

/// What a ray needed, its hit being final.
fn needed(bound: &Bound, scratch: &mut Scratch, slot: &Slot, lists: &TileLists) {
    let entry = lists.lists[slot.tile];
    if !slot.is_traced() {
        return;
    }
    let (ray, hit) = (slot.ray, &slot.hit);
    let occluded = bound.has(PARAM_ANY_HIT) && hit.id != NONE;
    let world = framed_ray(ray.origin, ray.direction, ray.t_min);
    let cone = bound.cone_of(ray.origin, ray.direction, spread_of(slot.surface));
    let mut r = BrickRay::outside(&world);
    // The brick that it enters before any other that it asks for, and where.
    let mut first: Option<(usize, f32)> = None;
    for next in entry.first..entry.first + entry.selected {
        let position = lists.selection[next as usize] as usize;
        let listed = lists.list[position];
        let leaf = bound.leaf_of(&listed);
        if occluded {
            if slot.surface.leaf == leaf {
                lists.pair_demand[position].add(1, 0);
            }
            continue;
        }
        if listed.near > hit.t || !bound.takes(&cone, leaf) || !bound.may_meet(&world, listed.node, hit.t) {
            continue;
        }
        r.enter_leaf(bound.scene, &world, leaf);
        let brick = bound.brick_of(leaf);
        let root = &bound.scene.roots[brick];
        let boxes = bound.isa.hits(&r.ray, &r.lanes, root, 0.0, hit.t);
        let (entered, near) = entered_children(&boxes, root);
        if entered != 0 {
            lists.pair_demand[position].add_ray(near);
            if first.is_none_or(|(_, nearest)| near < nearest) {
                first = Some((brick, near));
            }
        }
    }
    if let Some((brick, _)) = first {
        scratch.demand.add_next(bound.demand, brick);
    }
}
