//! Intersects each ray with the whole scene, or what of it is selected, from the root: twin of
//! `shaders/trace/intersect_all.wgsl`, for rays of one octant together. They walk the wide top-level tree and, in its
//! leaves, the bricks.

use super::node::inner_before;
use super::packet_fill::Written;
use super::packet_node::Place;
use super::packet_walk::{PacketScratch, put, take, top_group};
use super::run::{PacketKernel, Wants, Work, run_for_each_packet};
use super::scratch::Scratch;
use crate::kernels::bound::Bound;
use crate::kernels::layout::PARAM_ANY_HIT;
use crate::kernels::rays::RaySet;
use crate::kernels::simd::isa::Isa;
use crate::kernels::tiles::PairCounts;

/// Of the rays of `work`; `SELECT`: with what is selected, but for culled pairs.
pub fn intersect_all<const SELECT: bool>(bound: &Bound, set: &mut RaySet, work: Work, pairs: &PairCounts) {
    // Nodes are counted as they are visited without.
    let leading = if SELECT && !bound.count { leading(bound, set.rays.len()) } else { Vec::new() };
    run_for_each_packet(set, bound, work, &IntersectAll::<SELECT> { bound, pairs, leading: &leading });
}

/// With fewer rays for each node of the top level, looking through all nodes costs more than it saves.
const RAYS_A_NODE: usize = 4;

/// Of each node of the top level the children that lead to a selected brick, a bit each. A ray meets and asks for
/// nothing below others, so it need not walk there. Empty where there are too few rays for that to pay: then all may
/// lead there.
pub fn leading(bound: &Bound, rays: usize) -> Vec<u8> {
    let nodes = &bound.scene.top8;
    if nodes.len() > rays / RAYS_A_NODE {
        return Vec::new();
    }
    let mut leading = vec![0u8; nodes.len()];
    // Children lie behind their parents.
    for (index, node) in nodes.iter().enumerate().rev() {
        let inner = u32::from(node.inner_mask);
        let leads = |slot: &u32| {
            if inner & 1 << slot != 0 {
                return leading[(node.child_base + inner_before(inner, *slot)) as usize] != 0;
            }
            let leaf = node.triangle_base + u32::from(node.meta[*slot as usize] & 31);
            bound.is_selected(bound.brick_of(leaf))
        };
        let children = (0..8u32).filter(|&slot| node.meta[slot as usize] != 0);
        leading[index] = children.filter(leads).fold(0, |bits, slot| bits | 1 << slot);
    }
    leading
}

/// Intersects packets.
pub struct IntersectAll<'a, const SELECT: bool> {
    /// With what.
    pub bound: &'a Bound<'a>,
    /// Which pairs are culled.
    pub pairs: &'a PairCounts,
    /// [`leading`] to what is selected.
    pub leading: &'a [u8],
}

impl<const SELECT: bool> IntersectAll<'_, SELECT> {
    #[inline(always)]
    fn is_left_out(&self, tile: usize, leaf: u32) -> bool {
        let Self { bound, pairs, .. } = self;
        SELECT && (!bound.is_selected(bound.brick_of(leaf)) || pairs.is_culled(bound, tile, leaf))
    }
}

impl<const SELECT: bool> PacketKernel for IntersectAll<'_, SELECT> {
    const NARROWS: bool = SELECT;

    #[inline(always)]
    fn wants(&self, _: usize) -> Option<Wants> {
        let unhit = SELECT && self.bound.has(PARAM_ANY_HIT);
        (self.bound.params.top_count != 0).then_some(Wants { pending: SELECT, unhit, ..Wants::TRACED })
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
                let children = self.leading.get(index as usize).map_or(u32::MAX, |&children| children.into());
                let group = top_group(isa, bound, &packets.packet, &place, (index, children, rays));
                packets.visits.nodes = packets.visits.nodes.wrapping_add(rays.count_ones());
                if !put(&mut packets.top, &mut depth, group, &mut scratch.tally) {
                    break;
                }
            }
            if depth == 0 {
                break;
            }
            let (group, child, rays) = take(&mut packets.top, &mut depth, flip, f32::INFINITY);
            let rays = rays & !packets.packet.done;
            let node = &bound.scene.top8[group.base as usize];
            let inner = u32::from(node.inner_mask);
            if rays == 0 {
                continue;
            } else if inner & 1 << child != 0 {
                let index = node.child_base + inner_before(inner, child);
                let rays = packets.packet.left_by_levels(bound, index, rays);
                next = (rays != 0).then_some((index, rays));
                continue;
            }
            let leaf = node.triangle_base + u32::from(node.meta[child as usize] & 31);
            let rays = if self.is_left_out(tile, leaf) { 0 } else { packets.packet.taking(bound, leaf, rays) };
            if rays != 0 {
                packets.walk_leaf(isa, bound, scratch, leaf, rays, any_hit);
            }
        }
    }

    #[inline(always)]
    fn write<I: Isa>(&self, isa: I, packets: &mut PacketScratch, to: &mut Written) {
        packets.write(isa, self.bound, to);
    }
}
