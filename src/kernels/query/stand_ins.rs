//! What stands in for bricks that rays would enter: `query_all` with STAND_INS, where rays of one octant find together
//! whether any of them asks. Most do not, and only the others ask one by one.

use super::query_all::{STAND_INS, ask};
use crate::kernels::bound::Bound;
use crate::kernels::layout::{INSTANCE_IDENTITY, PARAM_ANY_HIT, Surface};
use crate::kernels::rays::RaySet;
use crate::kernels::simd::isa::Isa;
use crate::kernels::tiles::PairCounts;
use crate::kernels::trace::leaf::BrickRay;
use crate::kernels::trace::levels::{is_pending, set_pending};
use crate::kernels::trace::node::inner_before;
use crate::kernels::trace::packet_fill::Written;
use crate::kernels::trace::packet_node::Place;
use crate::kernels::trace::packet_walk::{PacketScratch, put, take, top_group};
use crate::kernels::trace::run::{PacketKernel, Wants, Work, for_each_ray, run_for_each_packet};
use crate::kernels::trace::scratch::Scratch;

/// Of all rays: what stands in for what they would enter.
pub fn query_stand_ins(bound: &Bound, set: &mut RaySet, pairs: &PairCounts) {
    run_for_each_packet(set, bound, Work::All, &Askers { bound });
    for_each_ray(set, bound, Work::All, |scratch, slot| ask::<STAND_INS>(bound, scratch, slot, pairs));
}

/// What [`query_stand_ins`] left each ray with: [`crate::schedule::Report::states`].
pub fn states(set: &RaySet) -> Vec<u32> {
    let state = |surface: &Surface| u32::from(is_pending(surface)) | surface.pending >> 31 << 1;
    set.surfaces.iter().map(state).collect()
}

/// Leaves those rays pending that may ask.
struct Askers<'a> {
    bound: &'a Bound<'a>,
}

impl PacketKernel for Askers<'_> {
    const NARROWS: bool = false;

    #[inline(always)]
    fn wants(&self, _: usize) -> Option<Wants> {
        let wants = Wants { pending: true, unhit: self.bound.has(PARAM_ANY_HIT), ..Wants::TRACED };
        (self.bound.params.top_count != 0).then_some(wants)
    }

    #[inline(always)]
    fn run_packet<I: Isa>(&self, isa: I, scratch: &mut Scratch, packets: &mut PacketScratch, _: usize) {
        let bound = self.bound;
        let PacketScratch { packet, top, .. } = packets;
        let flip = packet.flip;
        let whole = Place::new([0.0; 3], [0.0; 3], bound.params.instance_pad);
        let any = packet.ray(0);
        let mut r = BrickRay::outside(&any);
        let mut depth = 0;
        let mut next = Some((0, packet.all()));
        loop {
            if let Some((index, rays)) = next.take() {
                let group = top_group(isa, bound, packet, &whole, (index, u32::MAX, rays));
                if !put(top, &mut depth, group, &mut scratch.tally) {
                    break;
                }
            }
            if depth == 0 {
                break;
            }
            let (group, child, rays) = take(top, &mut depth, flip, f32::INFINITY);
            let rays = rays & !packet.done;
            let node = &bound.scene.top8[group.base as usize];
            let inner = u32::from(node.inner_mask);
            if rays == 0 {
                continue;
            } else if inner & 1 << child != 0 {
                let index = node.child_base + inner_before(inner, child);
                let rays = packet.whose_cones(bound, rays, |cone| !bound.would_be_stood_for_wide(cone, index));
                next = (rays != 0).then_some((index, rays));
                continue;
            }
            let leaf = node.triangle_base + u32::from(node.meta[child as usize] & 31);
            let brick = bound.brick_of(leaf);
            if bound.is_selected(brick) && bound.stand_in_of(leaf) == leaf {
                continue;
            }
            let mut rays = packet.whose_cones(bound, rays, |cone| bound.would_take(cone, leaf));
            let instance = bound.scene.leaves[leaf as usize].instance;
            if rays != 0 && bound.scene.instances[instance as usize].flags & INSTANCE_IDENTITY != 0 {
                r.enter_leaf(bound.scene, &any, leaf);
                let place = Place::new(r.offset_high, r.offset_low, 0.0);
                let mut entered = [0; 8];
                packet.open(isa, &bound.scene.roots[brick], &place, rays, &mut entered);
                rays = entered.iter().fold(0, |all, rays| all | rays);
            }
            packet.done |= rays;
        }
    }

    #[inline(always)]
    fn write<I: Isa>(&self, _: I, packets: &mut PacketScratch, to: &mut Written) {
        for (i, &at) in to.places.iter().enumerate() {
            set_pending(&mut to.surfaces[at as usize], packets.packet.done >> i & 1 != 0);
        }
    }
}
