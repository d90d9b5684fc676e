//! Intersects rays of one octant with a run of the selected leaves of their tile, in their order: twin of
//! `shaders/trace/intersect_list.wgsl`.

use super::packet_fill::Written;
use super::packet_walk::PacketScratch;
use super::run::{PacketKernel, Wants, Work, run_for_each_packet};
use super::scratch::Scratch;
use crate::kernels::bound::Bound;
use crate::kernels::layout::{Entry, PARAM_ANY_HIT};
use crate::kernels::rays::RaySet;
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
    const NARROWS: bool = false;

    #[inline(always)]
    fn wants(&self, tile: usize) -> Option<Wants> {
        let (next, end) = self.run_of(tile);
        (next != end).then_some(Wants { unhit: self.bound.has(PARAM_ANY_HIT), ..Wants::TRACED })
    }

    #[inline(always)]
    fn run_packet<I: Isa>(&self, isa: I, scratch: &mut Scratch, packets: &mut PacketScratch, tile: usize) {
        let (bound, (next, end)) = (self.bound, self.run_of(tile));
        for position in next..end {
            let listed = self.listed(position);
            let rays = packets.packet.reaching(isa, listed.near) & !packets.packet.done;
            let leaf = bound.leaf_of(&listed);
            let rays = packets.packet.taking(bound, leaf, rays);
            let rays = packets.packet.meeting(bound, listed.node, rays);
            if rays != 0 {
                packets.walk_leaf(isa, bound, scratch, leaf, rays, bound.has(PARAM_ANY_HIT));
            }
        }
    }

    #[inline(always)]
    fn write<I: Isa>(&self, isa: I, packets: &mut PacketScratch, to: &mut Written) {
        packets.write(isa, self.bound, to);
    }
}
