//! Intersects each ray with a run of the selected leaves of its tile, in their order: twin of `shaders/intersect_list.wgsl`.
//! Nodes are visited until one has triangles.

use super::brick::Best;
use super::isa::Isa;
use super::leaf::BrickRay;
use super::node::framed_ray;
use super::rays::{RayKernel, RaySet, Scratch, Slot, Work, run_for_each_ray};
use super::scene::Bound;
use super::tile_lists::TileLists;
use super::walk_brick::{Group, STACK_SIZE, Visits, finish_walk};
use crate::kernel::layout::{COUNTER_LEAF_GROUPS, COUNTER_STACK_OVERFLOW, NONE, PARAM_ANY_HIT};

/// Of the rays of chosen tiles. With `LEAF_CACHE` two groups of triangles are gathered, as long as the ray does not enter another
/// leaf.
pub fn intersect_list<const LEAF_CACHE: bool>(bound: &Bound, set: &mut RaySet, lists: &TileLists) {
    run_for_each_ray(set, bound, Work::Chosen(lists), &IntersectList::<LEAF_CACHE> { bound, lists });
}

struct IntersectList<'a, const LEAF_CACHE: bool> {
    bound: &'a Bound<'a>,
    lists: &'a TileLists,
}

impl<const LEAF_CACHE: bool> RayKernel for IntersectList<'_, LEAF_CACHE> {
    #[inline(always)]
    fn run<I: Isa>(&self, isa: I, scratch: &mut Scratch, slot: Slot) {
        trace::<I, LEAF_CACHE>(isa, self.bound, scratch, slot, self.lists);
    }
}

#[inline(always)]
fn trace<I: Isa, const LEAF_CACHE: bool>(
    isa: I,
    bound: &Bound,
    scratch: &mut Scratch,
    mut slot: Slot,
    lists: &TileLists,
) {
    let entry = lists.lists[slot.tile];
    let mut next = entry.first + bound.params.run_first.min(entry.selected);
    let end = (entry.first + entry.selected).min(next.saturating_add(bound.params.run_count));
    if next == end {
        return;
    }
    let ray = *slot.ray;
    if !slot.is_traced() {
        return;
    }
    let any_hit = bound.has(PARAM_ANY_HIT);
    let before = *slot.hit;
    if any_hit && before.id != NONE {
        return;
    }
    let world = framed_ray(ray.origin, ray.direction, ray.t_min);
    let source = slot.surface.source;
    let mut best = Best { t: before.t, id: before.id, leaf: NONE, triangle: 0, hit: Default::default(), source };
    let mut visits = Visits::default();
    let mut r = BrickRay::outside(&world);
    let Scratch { stack, tally, .. } = scratch;
    let mut depth = 0;
    let mut group = Group::default();
    let mut leaf_groups_postponed = 0;
    loop {
        let mut postponed = Group::default();
        let mut triangles = Group::default();
        loop {
            if !group.has_children() {
                if depth > 0 {
                    depth -= 1;
                    group = stack[depth];
                } else {
                    if next == end || (LEAF_CACHE && postponed.bits != 0) {
                        break;
                    }
                    let listed = lists.list[lists.selection[next as usize] as usize];
                    next += 1;
                    if listed.near > best.t {
                        continue;
                    }
                    r.enter_leaf(bound.scene, &world, listed.leaf);
                    r.brick = bound.bricks[bound.brick_of(listed.leaf)];
                    group = Group::root(r.ray.flip);
                }
            }
            let (child, rest) = group.nearest_child(r.ray.flip);
            if rest.has_children() {
                if depth == STACK_SIZE {
                    tally.add(COUNTER_STACK_OVERFLOW, 1);
                    break;
                }
                stack[depth] = rest;
                depth += 1;
            }
            let opened = r.open_node(isa, bound, &mut visits, best.t, group.child_index(child));
            group = opened.children;
            triangles = opened.triangles;
            if triangles.bits != 0 {
                if !LEAF_CACHE || postponed.bits != 0 {
                    break;
                }
                postponed = std::mem::take(&mut triangles);
                leaf_groups_postponed += 1;
            }
        }
        if postponed.bits | triangles.bits == 0 {
            break;
        }
        if LEAF_CACHE {
            r.test_triangles(&mut visits, &mut best, postponed, any_hit);
        }
        r.test_triangles(&mut visits, &mut best, triangles, any_hit);
        if any_hit && best.leaf != NONE {
            break;
        }
    }
    tally.add(COUNTER_LEAF_GROUPS, leaf_groups_postponed);
    finish_walk(bound, &world, &best, visits, &mut slot, tally);
}
