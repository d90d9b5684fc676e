//! Intersects each ray with the whole scene, all of it resident, over binary trees: twin of
//! `shaders/trace/intersect_binary.wgsl`.

use super::binary_tree::{Tree, top_height, tree_of};
use super::brick::Best;
use super::leaf::BrickRay;
use super::levels::spread_of;
use super::node::{FramedRay, UNIT, framed_ray};
use super::run::{Work, for_each_ray};
use super::scratch::Scratch;
use super::walk_brick::{Visits, write_found};
use crate::kernels::bound::Bound;
use crate::kernels::layout::{BINARY_LEAF, BinaryNode, COUNTER_STACK_OVERFLOW, NONE, PARAM_ANY_HIT, TopNode2};
use crate::kernels::rays::{RaySet, Slot};
use crate::kernels::vector::{Vec3, each, least, most, most3};
use crate::schedule::ExecutorError;
use bricks::SceneFile;
use rayon::prelude::*;

/// No leaf: bricks have fewer triangles.
const DONE: u32 = u32::MAX;

/// Binary trees of all bricks.
pub struct BinaryTrees {
    /// Nodes of each brick.
    trees: Vec<Vec<BinaryNode>>,
    /// Entries that a traversal's stack holds at most.
    stack: usize,
}

impl BinaryTrees {
    /// Makes the trees of all bricks of `scene` from their geometry.
    ///
    /// # Errors
    /// A brick that cannot be read.
    pub fn new(scene: &SceneFile) -> Result<Self, ExecutorError> {
        let count = scene.resident().bricks.len();
        let trees: Vec<Tree> =
            (0..count).into_par_iter().map(|brick| tree_of(scene, brick)).collect::<Result<_, _>>()?;
        let height = trees.iter().map(|tree| tree.height).max().unwrap_or(0);
        let stack = (height + top_height(scene.resident())).max(1) as usize;
        Ok(Self { trees: trees.into_iter().map(|tree| tree.nodes).collect(), stack })
    }
}

/// Where a ray enters a box, if it does.
struct BoxHit {
    near: f32,
    entered: bool,
}

/// The padded test of a ray against one box, both in one frame. The padding is that of `node_hits` with the box in
/// place of the node's grid; distances take fewer roundings here, and the corners' one to f32 is within twice the term
/// for it.
#[inline(always)]
fn enter_box(ray: &FramedRay, low: Vec3, high: Vec3, offset_low: Vec3, slack: f32, t_max: f32) -> BoxHit {
    let w0 = each(|k| low[k] - ray.origin[k]);
    let w1 = each(|k| high[k] - ray.origin[k]);
    let m = most3(each(|k| most(w0[k].abs(), w1[k].abs())));
    let o = most3(ray.origin.map(f32::abs));
    let all = 64.0 * UNIT * m + slack * (m + o);
    let delta = each(|k| all + 8.0 * UNIT * most(low[k].abs(), high[k].abs()) + 2.0 * UNIT * offset_low[k].abs());
    let a = each(|k| (w0[k] - delta[k]) * ray.frame.inv[k]);
    let b = each(|k| (w1[k] + delta[k]) * ray.frame.inv[k]);
    let tn = each(|k| least(a[k], b[k]));
    let tf = each(|k| most(a[k], b[k]));
    let near = most(most(tn[0], tn[1]), most(tn[2], ray.t_min));
    // Not pruned at equality: a hit at equal distance with a lower id must be found.
    BoxHit { near, entered: near <= least(least(tf[0], tf[1]), least(tf[2], t_max)) }
}

fn top_reference(top2: &[TopNode2], node: u32) -> u32 {
    let n = &top2[node as usize];
    if n.right == NONE { BINARY_LEAF | n.left } else { node }
}

/// What is left to be visited: [`BinaryNode::what`] in a brick; in the top level an inner node, or BINARY_LEAF and the
/// leaf.
struct Walk<'a> {
    stack: &'a mut Vec<u32>,
    /// Stack depth at which the brick ends.
    floor: usize,
    in_brick: bool,
}

impl Walk<'_> {
    fn pop(&mut self) -> u32 {
        let Some(next) = self.stack.pop() else { return DONE };
        self.in_brick = self.in_brick && self.stack.len() >= self.floor;
        next
    }
}

/// Of all rays.
pub fn intersect_binary(bound: &Bound, set: &mut RaySet, trees: &BinaryTrees) {
    for_each_ray(set, bound, Work::All, |scratch, slot| trace(bound, scratch, slot, trees));
}

fn trace(bound: &Bound, scratch: &mut Scratch, slot: Slot, trees: &BinaryTrees) {
    let ray = *slot.ray;
    if !slot.is_traced() || bound.params.top_count == 0 {
        return;
    }
    let any_hit = bound.has(PARAM_ANY_HIT);
    let world = framed_ray(ray.origin, ray.direction, ray.t_min);
    let cone = bound.cone_of(ray.origin, ray.direction, spread_of(slot.surface));
    let mut best = Best::before(&slot);
    let mut visits = Visits::default();
    let mut r = BrickRay::outside(&world);
    let Scratch { nodes, tally, .. } = scratch;
    nodes.clear();
    let mut walk = Walk { stack: nodes, floor: 0, in_brick: false };
    let mut tree: &[BinaryNode] = &[];
    let top2 = &bound.scene.top2;
    let mut at = top_reference(top2, 0);
    loop {
        while at & BINARY_LEAF == 0 {
            let (children, left, right) = if walk.in_brick {
                let (a, b) = (&tree[at as usize], &tree[at as usize + 1]);
                let moved = |p: Vec3| each(|k| (p[k] + r.offset_high[k]) + r.offset_low[k]);
                let enter = |n: &BinaryNode| enter_box(&r.ray, moved(n.min), moved(n.max), r.offset_low, 0.0, best.t);
                ([a.what, b.what], enter(a), enter(b))
            } else {
                let node = &top2[at as usize];
                let enter = |child: u32| {
                    let n = &top2[child as usize];
                    enter_box(&world, n.min, n.max, [0.0; 3], bound.params.instance_pad, best.t)
                };
                let children = [top_reference(top2, node.left), top_reference(top2, node.right)];
                (children, enter(node.left), enter(node.right))
            };
            visits.nodes += 1;
            if left.entered && right.entered {
                if walk.stack.len() == trees.stack {
                    tally.add(COUNTER_STACK_OVERFLOW, 1);
                    at = DONE;
                    break;
                }
                let swap = right.near < left.near;
                walk.stack.push(children[usize::from(!swap)]);
                at = children[usize::from(swap)];
            } else if left.entered || right.entered {
                at = children[usize::from(!left.entered)];
            } else {
                at = walk.pop();
            }
        }
        if at == DONE {
            break;
        }
        if !walk.in_brick {
            let leaf = at & !BINARY_LEAF;
            if !bound.takes(&cone, leaf) {
                at = walk.pop();
                continue;
            }
            let brick = bound.brick_of(leaf);
            bound.note_use(leaf);
            r.enter_leaf(bound.scene, &world, leaf);
            r.enter_brick(bound, brick);
            tree = &trees.trees[brick];
            walk.floor = walk.stack.len();
            walk.in_brick = true;
            at = tree[0].what;
            continue;
        }
        let first = at & 0x1fff_ffff;
        let count = (at >> 29) & 3;
        visits.triangles += count;
        for i in 0..count {
            if r.test_triangle(&mut best, first + i) && any_hit {
                break;
            }
        }
        if any_hit && best.leaf != NONE {
            break;
        }
        at = walk.pop();
    }
    write_found(bound, &world, &best, slot.hit, slot.surface);
    visits.count(bound, tally);
}
