//! Intersects each ray with the whole scene, or what of it is selected, from the root: twin of `shaders/intersect_all.wgsl`.
//! One loop over the wide top-level tree and, through copies of the bricks' roots in its leaves, the bricks; nodes are visited until
//! one has triangles.

use super::brick::Best;
use super::isa::{Isa, Lanes};
use super::leaf::BrickRay;
use super::node::{FramedRay, framed_ray, inner_before};
use super::rays::{RayKernel, RaySet, Scratch, Slot, Work, run_for_each_ray};
use super::scene::Bound;
use super::walk_brick::{Group, STACK_SIZE, Visits, finish_walk};
use crate::kernel::layout::{COUNTER_STACK_OVERFLOW, NONE, PARAM_ANY_HIT};

/// A group of the top level: the node, and its entered children, inner ones and leaves alike, by priority in the high byte,
/// so that bricks are met near to far.
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

/// Of the rays of `work`; `SELECT`: with what is selected.
pub fn intersect_all<const SELECT: bool>(bound: &Bound, set: &mut RaySet, work: Work) {
    run_for_each_ray(set, bound, work, &IntersectAll::<SELECT> { bound });
}

struct IntersectAll<'a, const SELECT: bool> {
    bound: &'a Bound<'a>,
}

impl<const SELECT: bool> RayKernel for IntersectAll<'_, SELECT> {
    #[inline(always)]
    fn run<I: Isa>(&self, isa: I, scratch: &mut Scratch, slot: Slot) {
        trace::<I, SELECT>(isa, self.bound, scratch, slot);
    }
}

#[inline(always)]
fn trace<I: Isa, const SELECT: bool>(isa: I, bound: &Bound, scratch: &mut Scratch, mut slot: Slot) {
    let ray = *slot.ray;
    if !slot.is_traced() || bound.params.top_count == 0 {
        return;
    }
    let any_hit = bound.has(PARAM_ANY_HIT);
    let before = *slot.hit;
    if SELECT && ((any_hit && before.id != NONE) || slot.surface.pending == 0) {
        return;
    }
    let world = framed_ray(ray.origin, ray.direction, ray.t_min);
    let source = slot.surface.source;
    let mut best = Best { t: before.t, id: before.id, leaf: NONE, triangle: 0, hit: Default::default(), source };
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
            let (child, rest) = group.nearest_child(r.ray.flip);
            if rest.has_children() {
                if depth == STACK_SIZE {
                    tally.add(COUNTER_STACK_OVERFLOW, 1);
                    break;
                }
                stack[depth] = rest;
                depth += 1;
            }
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
                if SELECT && !bound.is_selected(brick) {
                    group = Group::default();
                    continue;
                }
                floor = depth;
                in_brick = true;
                r.enter_leaf(bound.scene, &world, leaf);
                r.brick = bound.bricks[brick];
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
