//! Ray-by-ray queries of the whole top level: twin of `shaders/query_all.wgsl`. Each ray asks for the bricks in the wanted state of
//! whose root it enters a child box at or before its present hit, and notes whether it asked for any. Rays of tiles without a list
//! count, with a threshold, in their tile's table, and `query_reduce` decides.

use super::leaf::BrickRay;
use super::node::{entered_children, framed_ray, inner_before, node_hits};
use super::rays::{RaySet, Scratch, Slot, Work, for_each_ray};
use super::scene::Bound;
use super::tile_lists::TileLists;
use crate::kernel::layout::{COUNTER_PAIRS_VISIBLE, COUNTER_STACK_OVERFLOW, NONE, PARAM_ANY_HIT};

/// MAX_TOP_HEIGHT levels of which each leaves at most 7 siblings, and the root.
const TOP_STACK_SIZE: usize = 192;

/// Of the rays of `work`, all or those that walk from the root.
pub fn query_all(bound: &Bound, set: &mut RaySet, work: Work) {
    let tables = work.tables(bound);
    for_each_ray(set, bound, work, |scratch, slot| ask(bound, scratch, slot, tables));
}

fn ask(bound: &Bound, scratch: &mut Scratch, slot: Slot, tables: Option<&TileLists>) {
    if slot.surface.pending == 0 {
        return;
    }
    let (ray, hit) = (*slot.ray, *slot.hit);
    let occluded = bound.has(PARAM_ANY_HIT) && hit.id != NONE;
    slot.surface.pending = 0;
    if !slot.is_traced() || bound.params.top_count == 0 || occluded {
        return;
    }
    let scene = bound.scene;
    let world = framed_ray(ray.origin, ray.direction, ray.t_min);
    let mut r = BrickRay::outside(&world);
    let Scratch { nodes: stack, tally, .. } = scratch;
    stack.clear();
    stack.push(0);
    let mut asks = 0;
    // The brick that it enters before any other that it asks for, and where.
    let mut first: Option<(usize, f32)> = None;
    while let Some(at) = stack.pop() {
        let node = &scene.top8[at as usize];
        let boxes = node_hits(&world, node, [0.0; 3], [0.0; 3], bound.params.instance_pad, hit.t);
        let (mut mask, _) = entered_children(&boxes, node);
        let inner = u32::from(node.inner_mask);
        while mask != 0 {
            let child = mask.trailing_zeros();
            mask &= mask - 1;
            if inner & 1 << child != 0 {
                if stack.len() == TOP_STACK_SIZE {
                    tally.add(COUNTER_STACK_OVERFLOW, 1);
                    return;
                }
                stack.push(node.child_base + inner_before(inner, child));
                continue;
            }
            let leaf = node.triangle_base + u32::from(node.meta[child as usize] & 31);
            let brick = bound.brick_of(leaf);
            if !bound.is_selected(brick) {
                continue;
            }
            r.enter_leaf(scene, &world, leaf);
            let root = &scene.roots[brick];
            let boxes = node_hits(&r.ray, root, r.offset_high, r.offset_low, 0.0, hit.t);
            let (entered, near) = entered_children(&boxes, root);
            if entered != 0 {
                // A leaf that the tile's walk has missed counts for itself.
                match tables.and_then(|tiles| Some(&tiles.pair_demand[tiles.position_of(slot.tile, leaf)?])) {
                    Some(listed) if listed.is_culled() => continue,
                    Some(listed) => listed.add_ray(near),
                    None => bound.demand[brick].add_ray(near),
                }
                asks += 1;
                if first.is_none_or(|(_, nearest)| near < nearest) {
                    first = Some((brick, near));
                }
            }
        }
    }
    if let Some((brick, _)) = first {
        slot.surface.pending = 1;
        bound.demand[brick].add_next();
        if tables.is_none() {
            tally.add(COUNTER_PAIRS_VISIBLE, asks);
        }
    }
}
