//! Walks the binary top level for each tile, near child first, and lists the leaves its rays may meet: twin of
//! `shaders/query/tile_walk.wgsl`. Run twice: first to count, then, after `tile_scan` has placed the lists, to write
//! them.

use super::interval::tile_meets_box;
use super::tile_lists::{centre_along, of_tiles};
use crate::kernels::bound::{Bound, Tally};
use crate::kernels::layout::{
    COUNTER_PAIRS_CULLED, COUNTER_PAIRS_TESTED, COUNTER_STACK_OVERFLOW, Entry, NONE, TileBounds, TileList, TopNode2,
};
use crate::kernels::tiles::TileLists;
use rayon::prelude::*;

const WALK_STACK: usize = 72;

/// Counts the leaves of every tile, as far as `list_most` and one more.
pub fn tile_walk_count(bound: &Bound, tiles: &mut TileLists) {
    let TileLists { bounds, lists, .. } = tiles;
    bounds.par_iter().zip(lists.par_iter_mut()).for_each(|(bounds, list)| {
        let mut tally = Tally::default();
        let mut found = 0;
        let walked = walk(bound, bounds, &mut tally, |_| {
            found += 1;
            found <= bound.params.list_most
        });
        *list = TileList { count: found, ..TileList::default() };
        tally.add(COUNTER_PAIRS_TESTED, walked.tested);
        tally.add(COUNTER_PAIRS_CULLED, walked.culled);
        bound.counters.add(&tally);
    });
}

/// Writes the lists of the tiles that keep one.
pub fn tile_walk_write(bound: &Bound, tiles: &mut TileLists) {
    let TileLists { bounds, lists, list, pair_demand, .. } = tiles;
    pair_demand.par_iter_mut().for_each(|demand| *demand = Default::default());
    let places = of_tiles(lists, list);
    bounds.par_iter().zip(places).filter(|(_, place)| !place.is_empty()).for_each(|(bounds, place)| {
        let mut tally = Tally::default();
        let mut free = place.iter_mut();
        // The walk finds what it counted.
        walk(bound, bounds, &mut tally, |entry| free.next().map(|place| *place = entry).is_some());
        bound.counters.add(&tally);
    });
}

/// How many nodes a walk tested, and how many of them it culled.
struct Walked {
    tested: u32,
    culled: u32,
}

/// Calls `list` for every leaf until it says that it takes no more.
fn walk(bound: &Bound, bounds: &TileBounds, tally: &mut Tally, mut list: impl FnMut(Entry) -> bool) -> Walked {
    let top2: &[TopNode2] = &bound.scene.top2;
    let meets = |node: u32| {
        let n = &top2[node as usize];
        tile_meets_box(bounds, n.min, n.max, bound.params.instance_pad)
    };
    let centre = |node: u32| centre_along(bounds, &top2[node as usize]);
    let mut walked = Walked { tested: 0, culled: 0 };
    if bound.params.top_count == 0 {
        return walked;
    }
    walked.tested = 1;
    let root = meets(0);
    if !root.hit {
        walked.culled = 1;
        return walked;
    }
    let mut stack = [Entry::default(); WALK_STACK];
    let mut depth = 0;
    let (mut node, mut near) = (0, root.near);
    loop {
        let n = &top2[node as usize];
        if n.right == NONE {
            if bound.tile_may_take(bounds, n.left) && !list(Entry { node, near }) {
                break;
            }
        } else {
            let (mut l, mut r) = (meets(n.left), meets(n.right));
            l.hit = l.hit && !bound.tile_is_stood_for(bounds, n.left);
            r.hit = r.hit && !bound.tile_is_stood_for(bounds, n.right);
            walked.tested += 2;
            walked.culled += u32::from(!l.hit) + u32::from(!r.hit);
            if l.hit && r.hit {
                // Nearer first; when both hold the tile's origins, the one whose box centre is nearer.
                let swap = r.near < l.near || (r.near == l.near && centre(n.right) < centre(n.left));
                if depth == WALK_STACK {
                    tally.add(COUNTER_STACK_OVERFLOW, 1);
                    break;
                }
                let (left, right) = (Entry { node: n.left, near: l.near }, Entry { node: n.right, near: r.near });
                let (first, second) = if swap { (right, left) } else { (left, right) };
                stack[depth] = second;
                depth += 1;
                (node, near) = (first.node, first.near);
                continue;
            }
            if l.hit || r.hit {
                (node, near) = if l.hit { (n.left, l.near) } else { (n.right, r.near) };
                continue;
            }
        }
        if depth == 0 {
            break;
        }
        depth -= 1;
        (node, near) = (stack[depth].node, stack[depth].near);
    }
    walked
}
