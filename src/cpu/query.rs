//! Ray-by-ray queries of the selected (tile, leaf) pairs: twin of `shaders/query.wgsl`. How many rays of the tile enter a child box
//! of the brick's root at or before their present hit, and where the nearest does.

use super::leaf::BrickRay;
use super::node::{entered_children, framed_ray, node_hits};
use super::rays::{RaySet, Slot, Work, for_each_ray};
use super::scene::Bound;
use super::tile_lists::TileLists;
use super::vector::least;
use crate::kernel::layout::{NONE, PARAM_ANY_HIT, PARAM_NEEDED, PARAM_NEXT};

/// Of the rays of chosen tiles. With PARAM_NEEDED the hits are final and the rays of an any-hit pass that ended occluded ask only for the brick
/// that holds their hit.
pub fn query(bound: &Bound, set: &mut RaySet, lists: &TileLists) {
    for_each_ray(set, bound, Work::Chosen(lists), |_, slot| ask(bound, &slot, lists));
}

fn ask(bound: &Bound, slot: &Slot, lists: &TileLists) {
    let entry = lists.lists[slot.tile];
    if !slot.is_traced() {
        return;
    }
    let (ray, hit) = (slot.ray, &slot.hit);
    let occluded = bound.has(PARAM_ANY_HIT) && hit.id != NONE;
    if occluded && !bound.has(PARAM_NEEDED) {
        return;
    }
    let world = framed_ray(ray.origin, ray.direction, ray.t_min);
    let mut r = BrickRay::outside(&world);
    // The brick that it enters before any other that it asks for, and where.
    let mut first: Option<(usize, f32)> = None;
    let mut limit = hit.t;
    for next in entry.first..entry.first + entry.selected {
        let position = lists.selection[next as usize] as usize;
        let listed = lists.list[position];
        let leaf = listed.leaf;
        if occluded {
            if slot.surface.leaf == leaf {
                lists.pair_demand[position].add(1, 0);
            }
            continue;
        }
        if listed.near > limit {
            continue;
        }
        r.enter_leaf(bound.scene, &world, leaf);
        let brick = bound.brick_of(leaf);
        let root = &bound.scene.roots[brick];
        let boxes = node_hits(&r.ray, root, r.offset_high, r.offset_low, 0.0, limit);
        let (entered, near) = entered_children(&boxes, root);
        if entered != 0 {
            lists.pair_demand[position].add_ray(near);
            if first.is_none_or(|(_, nearest)| near < nearest) {
                first = Some((brick, near));
                if bound.has(PARAM_NEXT) {
                    limit = least(limit, near);
                }
            }
        }
    }
    if let Some((brick, _)) = first {
        bound.demand[brick].add_next();
    }
}
