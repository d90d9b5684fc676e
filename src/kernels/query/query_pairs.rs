//! Occlusion queries of (tile, node) pairs of any size: twin of `shaders/query/query_pairs.wgsl`. How many rays of the
//! tile enter the node at or before their present hit; with PARAM_TIGHTER one of its children's boxes (of a leaf, of
//! its brick's root's), which lie in its own. A query of several nodes asks first whether any ray enters any of them,
//! and only then for each node alone.

use crate::kernels::bound::{Bound, Tally};
use crate::kernels::layout::{COUNTER_PAIRS_TESTED, COUNTER_TIGHTENED, NONE, PARAM_ANY_HIT, PARAM_TIGHTER, Pair};
use crate::kernels::rays::{RaySet, is_traced};
use crate::kernels::tiles::TileLists;
use crate::kernels::trace::leaf::BrickRay;
use crate::kernels::trace::levels::{Cone, spread_of};
use crate::kernels::trace::node::{FramedRay, framed_ray, node_hits, traversal_mask};
use rayon::prelude::*;

/// What a ray sees of a node.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Look {
    /// Not even its own box.
    Nothing,
    /// Its own box alone.
    Own,
    /// What the query asks for.
    Seen,
}

fn look(bound: &Bound, world: &FramedRay, cone: &Cone, index: u32, t_max: f32) -> Look {
    if !bound.enters(world, index, t_max) || bound.is_stood_for(cone, index) {
        return Look::Nothing;
    }
    let seen = |seen: bool| if seen { Look::Seen } else { Look::Own };
    let node = &bound.scene.top2[index as usize];
    if node.right == NONE && !bound.takes(cone, node.left) {
        return Look::Nothing;
    }
    if !bound.has(PARAM_TIGHTER) {
        return Look::Seen;
    }
    if node.right != NONE {
        return seen(bound.enters(world, node.left, t_max) || bound.enters(world, node.right, t_max));
    }
    let mut r = BrickRay::outside(world);
    r.enter_leaf(bound.scene, world, node.left);
    let root = &bound.scene.roots[bound.brick_of(node.left)];
    let entered = node_hits(&r.ray, root, r.offset_high, r.offset_low, 0.0, t_max).mask;
    seen(traversal_mask(entered, root, 0) != 0)
}

/// What the rays of a query see.
#[derive(Default)]
struct Seen {
    /// Rays that see any node of the query.
    visible: u32,
    /// Nodes whose own box a ray enters, a bit each.
    own: u32,
    /// Rays that see each, asked for alone.
    visible_each: [u32; crate::schedule::PairQuery::MOST_NODES],
}

/// Asks the rays of a query for its nodes, until one is seen, or for each alone.
fn ask(bound: &Bound, set: &RaySet, pair: &Pair, nodes: &[u32], each: bool, out: &mut Seen) {
    for y in pair.y0..pair.y1 {
        for x in pair.x0..pair.x1 {
            let at = (y * bound.params.width + x) as usize;
            let (ray, hit) = (&set.rays[at], &set.hits[at]);
            let occluded = bound.has(PARAM_ANY_HIT) && hit.id != NONE;
            if !is_traced(ray, hit) || occluded {
                continue;
            }
            let world = framed_ray(ray.origin, ray.direction, ray.t_min);
            let cone = bound.cone_of(ray.origin, ray.direction, spread_of(&set.surfaces[at]));
            for (k, &node) in nodes.iter().enumerate() {
                let what = look(bound, &world, &cone, node, hit.t);
                out.own |= u32::from(what != Look::Nothing) << k;
                if what == Look::Seen {
                    if each {
                        out.visible_each[k] += 1;
                    } else {
                        out.visible += 1;
                        break;
                    }
                }
            }
        }
    }
}

/// Of all queries.
pub fn query_pairs(bound: &Bound, set: &RaySet, tiles: &mut TileLists) {
    let answered = tiles.pairs.par_iter().map(|pair| {
        let nodes = &tiles.pair_nodes[pair.first as usize..(pair.first + pair.count) as usize];
        let mut seen = Seen::default();
        ask(bound, set, pair, nodes, false, &mut seen);
        let failed = pair.count > 1 && seen.visible > bound.params.threshold;
        if failed {
            ask(bound, set, pair, nodes, true, &mut seen);
        }
        let rays = (0..nodes.len()).map(|k| if failed { seen.visible_each[k] } else { seen.visible });
        let rays: Vec<u32> = rays.collect();
        let mut tally = Tally::default();
        let tightened = rays.iter().enumerate().filter(|&(k, &rays)| rays == 0 && seen.own & 1 << k != 0).count();
        tally.add(COUNTER_TIGHTENED, tightened as u32);
        tally.add(COUNTER_PAIRS_TESTED, if failed { 1 + pair.count } else { 1 });
        bound.counters.add(&tally);
        rays.into_iter().map(|rays| if rays > bound.params.threshold { rays } else { 0 }).collect()
    });
    tiles.pair_rays = answered.collect::<Vec<Vec<u32>>>().concat();
}
