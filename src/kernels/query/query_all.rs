//! Ray-by-ray queries of the whole top level: twin of `shaders/query/query_all.wgsl`. Near children first, each ray
//! looks for the bricks of whose root it enters a child box at or before its present hit. It asks for nothing, and
//! counted is how many rays of a tile see each leaf. Or it asks, for the bricks that it would enter if nothing were
//! missing, those that stand in for them. Rays that ask for missing bricks do so together: [`super::wanted`].

use crate::kernels::bound::{Bound, Tally};
use crate::kernels::layout::{
    COUNTER_PAIRS_INVISIBLE, COUNTER_PAIRS_VISIBLE, COUNTER_STACK_OVERFLOW, NONE, PARAM_ANY_HIT, PARAM_NEXT,
    PENDING_MISSING,
};
use crate::kernels::rays::{RaySet, Slot};
use crate::kernels::simd::isa::Lanes;
use crate::kernels::tiles::PairCounts;
use crate::kernels::trace::leaf::BrickRay;
use crate::kernels::trace::levels::{Cone, is_pending, set_pending, spread_of};
use crate::kernels::trace::node::{by_priority, entered_children, framed_ray, inner_before};
use crate::kernels::trace::run::{Work, for_each_ray};
use crate::kernels::trace::scratch::Scratch;
use crate::kernels::vector::least;

/// MAX_TOP_HEIGHT levels of which each leaves at most 7 siblings, and the root.
pub const TOP_STACK_SIZE: usize = 192;

/// Of all rays: how many of a tile see each leaf. `pairs` have been started.
pub fn count_pairs(bound: &Bound, set: &mut RaySet, pairs: &PairCounts) {
    for_each_ray(set, bound, Work::All, |scratch, slot| ask::<PAIRS>(bound, scratch, slot, pairs));
}

/// What a ray asks for: nothing, it counts for pairs.
const PAIRS: u32 = 1;
/// What stands in.
pub const STAND_INS: u32 = 2;

/// Queries of one ray.
pub fn ask<const WHAT: u32>(bound: &Bound, scratch: &mut Scratch, slot: Slot, pairs: &PairCounts) {
    let (ray, hit) = (*slot.ray, *slot.hit);
    // Of rays for stand-ins those that are pending may ask.
    let asks_nothing = WHAT == STAND_INS && !is_pending(slot.surface);
    let occluded = bound.has(PARAM_ANY_HIT) && hit.id != NONE;
    if WHAT != PAIRS {
        set_pending(slot.surface, false);
    }
    let cone = bound.cone_of(ray.origin, ray.direction, spread_of(slot.surface));
    if WHAT == STAND_INS && is_stand_in(bound, &cone, slot.surface.leaf) {
        scratch.demand.add_ray(bound.demand, bound.brick_of(slot.surface.leaf), hit.t);
        set_pending(slot.surface, true);
    }
    if !slot.is_traced() || bound.params.top_count == 0 || occluded || asks_nothing {
        return;
    }
    let scene = bound.scene;
    let world = framed_ray(ray.origin, ray.direction, ray.t_min);
    let up_to_next = WHAT != PAIRS && bound.has(PARAM_NEXT);
    let mut r = BrickRay::outside(&world);
    let lanes = Lanes::new(&world, [0.0; 3], [0.0; 3]);
    let Scratch { entered: stack, tally, demand, .. } = scratch;
    stack.clear();
    stack.push((0, 0.0));
    let mut asks = 0;
    let mut is_missing = false;
    // The brick that it enters before any other that it asks for, and where.
    let mut first: Option<(usize, f32)> = None;
    let mut limit = hit.t;
    while let Some((at, near)) = stack.pop() {
        if near > limit {
            continue;
        }
        let node = &scene.top8[at as usize];
        let boxes = bound.isa.hits(&world, &lanes, node, bound.params.instance_pad, limit);
        let mut bits = by_priority(boxes.mask, node, world.flip);
        let inner = u32::from(node.inner_mask);
        while bits != 0 {
            // The farthest: the nearest is to be on top of the stack.
            let child = (31 - bits.trailing_zeros()) ^ world.flip;
            bits &= bits - 1;
            let near = boxes.near[child as usize];
            if near > limit {
                continue;
            }
            if inner & 1 << child != 0 {
                let index = node.child_base + inner_before(inner, child);
                let is_left = match WHAT {
                    STAND_INS => bound.would_be_stood_for_wide(&cone, index),
                    _ => bound.is_stood_for_wide(&cone, index),
                };
                if is_left {
                    continue;
                }
                if stack.len() == TOP_STACK_SIZE {
                    tally.add(COUNTER_STACK_OVERFLOW, 1);
                    return;
                }
                stack.push((index, near));
                continue;
            }
            let leaf = node.triangle_base + u32::from(node.meta[child as usize] & 31);
            let mut brick = bound.brick_of(leaf);
            let is_selected = bound.is_selected(brick);
            let is_asked_for = match WHAT {
                STAND_INS => (!is_selected || bound.stand_in_of(leaf) != leaf) && bound.would_take(&cone, leaf),
                _ => is_selected && bound.takes(&cone, leaf),
            };
            if !is_asked_for || WHAT != PAIRS && pairs.is_culled(bound, slot.tile, leaf) {
                continue;
            }
            r.enter_leaf(scene, &world, leaf);
            let root = &scene.roots[brick];
            let boxes = bound.isa.hits(&r.ray, &r.lanes, root, 0.0, limit);
            let (entered, near) = entered_children(&boxes, root);
            if entered == 0 {
                continue;
            }
            if WHAT == STAND_INS {
                brick = bound.brick_of(bound.stand_in_of(leaf));
                is_missing |= !bound.is_selected(brick);
            }
            if WHAT == PAIRS {
                count(bound, tally, pairs.add(slot.tile, leaf));
                continue;
            }
            demand.add_ray(bound.demand, brick, near);
            asks += 1;
            if first.is_none_or(|(_, nearest)| near < nearest) {
                first = Some((brick, near));
                if up_to_next {
                    limit = least(limit, near);
                }
            }
        }
    }
    if let Some((brick, _)) = first {
        set_pending(slot.surface, true);
        slot.surface.pending |= if is_missing { PENDING_MISSING } else { 0 };
        demand.add_next(bound.demand, brick);
        tally.add(COUNTER_PAIRS_VISIBLE, asks);
    }
}

/// Whether what a ray has hit stands in for something else.
fn is_stand_in(bound: &Bound, cone: &Cone, leaf: u32) -> bool {
    leaf != NONE && bound.is_marked(leaf) && !bound.would_suffice(cone, leaf)
}

/// Counts a ray that sees a pair which `before` saw. A pair is visible from one ray above the threshold on.
fn count(bound: &Bound, tally: &mut Tally, before: u32) {
    if before == 0 {
        tally.add(COUNTER_PAIRS_INVISIBLE, 1);
    }
    if before == bound.params.threshold {
        // One less.
        tally.add(COUNTER_PAIRS_INVISIBLE, u32::MAX);
        tally.add(COUNTER_PAIRS_VISIBLE, 1);
    }
}
