//! The tiles' lists of leaves: where they lie, what is selected of them, their order, and what their queries ask of
//! bricks. Twins of `shaders/query/tile_scan.wgsl`, `tile_select.wgsl`, `tile_choose.wgsl`, `tile_sort.wgsl` and
//! `query_reduce.wgsl`.

use super::interval::tile_meets_box;
use crate::kernels::bound::{Bound, Tally};
use crate::kernels::layout::{
    COUNTER_FRONT_TO_BACK, COUNTER_LIST_ENTRIES, COUNTER_MOST_SELECTED, COUNTER_PAIRS_INTERSECTED,
    COUNTER_PAIRS_INVISIBLE, COUNTER_PAIRS_VISIBLE, COUNTER_TILE_BATCH_LEAVES, COUNTER_TILE_BATCHES,
    COUNTER_TILES_FROM_ROOT, Entry, TileBounds, TileList, TopNode2,
};
use crate::kernels::tiles::TileLists;
use crate::kernels::vector::{dot, each, least, most};
use crate::schedule::ExecutorError;
use rayon::prelude::*;

/// The parts of `data` that belong to the tiles, in order. Lists follow each other, empty ones apart.
pub fn of_tiles<'a, T>(lists: &[TileList], data: &'a mut [T]) -> Vec<&'a mut [T]> {
    let mut rest = data;
    let cut = |list: &TileList| {
        let (own, after) = std::mem::take(&mut rest).split_at_mut(list.count as usize);
        rest = after;
        own
    };
    lists.iter().map(cut).collect()
}

/// Places the tiles' lists one after the other. The rays of tiles with lists of more than `list_most` leaves walk the
/// whole top level, each by itself: such lists are dropped.
///
/// # Errors
/// The lists are too long to be held.
pub fn tile_scan(bound: &Bound, tiles: &mut TileLists) -> Result<(), ExecutorError> {
    let walks_from_root = |count: u32| count > bound.params.list_most;
    let kept = |count: u32| if walks_from_root(count) { 0 } else { u64::from(count) };
    tiles.make_room(tiles.lists.iter().map(|list| kept(list.count)).sum())?;
    let (mut before, mut rooted) = (0, 0);
    for list in &mut tiles.lists {
        let from_root = u32::from(walks_from_root(list.count));
        // There is room, so it is a u32.
        let count = kept(list.count) as u32;
        *list = TileList { first: before, count, from_root, ..TileList::default() };
        rooted += from_root;
        before += count;
    }
    let mut tally = Tally::default();
    tally.add(COUNTER_TILES_FROM_ROOT, rooted);
    tally.add(COUNTER_LIST_ENTRIES, before);
    bound.counters.add(&tally);
    Ok(())
}

/// Picks from each tile's list the leaves whose brick is in the wanted state, but for culled pairs, keeping their
/// order. `INTERSECT`: the selection is intersected next, and counted as such.
pub fn tile_select<const INTERSECT: bool>(bound: &Bound, tiles: &mut TileLists) {
    let TileLists { lists, list, selection, nearest, pair_counts, .. } = tiles;
    let places = of_tiles(lists, selection);
    lists.par_iter_mut().zip(places).zip(nearest).enumerate().for_each(|(tile, ((entry, selection), nearest))| {
        let mut selected = 0;
        *nearest = f32::INFINITY;
        // From the order of the leaves' numbers.
        let (mut departures, mut last) = (0, 0);
        let count = if entry.from_root != 0 { 0 } else { entry.count };
        for i in entry.first..entry.first + count {
            let listed = &list[i as usize];
            let leaf = bound.leaf_of(listed);
            if bound.is_selected(bound.brick_of(leaf)) && !pair_counts.is_culled(bound, tile, leaf) {
                selection[selected as usize] = i;
                selected += 1;
                *nearest = least(*nearest, listed.near);
                departures += u32::from(leaf < last);
                last = leaf;
            }
        }
        entry.selected = selected;
        if INTERSECT && selected > 0 {
            let mut tally = Tally::default();
            tally.add(COUNTER_PAIRS_INTERSECTED, selected);
            tally.add(COUNTER_FRONT_TO_BACK, departures);
            if selected > 1 && bound.params.run_count > 1 {
                tally.add(COUNTER_TILE_BATCHES, 1);
                tally.add(COUNTER_TILE_BATCH_LEAVES, selected);
            }
            bound.counters.add(&tally);
            bound.counters.raise(COUNTER_MOST_SELECTED, selected);
        }
    });
}

/// Sorts each tile's list by the numbers of the leaves, or (`NEAR`) near to far.
pub fn tile_sort<const NEAR: bool>(bound: &Bound, tiles: &mut TileLists) {
    let TileLists { bounds, lists, list, .. } = tiles;
    let places = of_tiles(lists, list);
    bounds.par_iter().zip(places).for_each(|(bounds, list)| {
        let keyed = |listed: &Entry| {
            let node = &bound.scene.top2[listed.node as usize];
            if !NEAR {
                return (node.left, node.left, *listed);
            }
            let near = tile_meets_box(bounds, node.min, node.max, bound.params.instance_pad).near;
            (distance_to(bounds, node, near).to_bits(), node.left, Entry { near, ..*listed })
        };
        let mut sorted: Vec<(u32, u32, Entry)> = list.iter().map(keyed).collect();
        sorted.sort_unstable_by_key(|(key, leaf, _)| (*key, *leaf));
        for (place, (_, _, entry)) in list.iter_mut().zip(sorted) {
            *place = entry;
        }
    });
}

/// Notes which tiles have just been chosen: those with a selection.
pub fn tile_choose(tiles: &mut TileLists) {
    for (chosen, entry) in tiles.chosen.iter_mut().zip(&tiles.lists) {
        *chosen = entry.selected > 0;
    }
}

/// Sums the queries of the selected pairs into the demand of their bricks, and clears them for the next query.
pub fn query_reduce(bound: &Bound, tiles: &TileLists) {
    tiles.lists.par_iter().filter(|entry| entry.selected > 0).for_each(|entry| {
        let mut visible = 0;
        for i in entry.first..entry.first + entry.selected {
            let position = tiles.selection[i as usize] as usize;
            let pair = tiles.pair_demand[position].take();
            if pair.rays > 0 {
                bound.demand[bound.brick_of(bound.leaf_of(&tiles.list[position]))].add(pair.rays, pair.nearest);
                visible += 1;
            }
        }
        let mut tally = Tally::default();
        tally.add(COUNTER_PAIRS_VISIBLE, visible);
        tally.add(COUNTER_PAIRS_INVISIBLE, entry.selected - visible);
        bound.counters.add(&tally);
    });
}

/// Distance of a node's centre along the tile's middle direction.
pub fn centre_along(bounds: &TileBounds, node: &TopNode2) -> f32 {
    let centre = each(|k| 0.5 * (node.min[k] + node.max[k]) - 0.5 * (bounds.origin_min[k] + bounds.origin_max[k]));
    dot(centre, each(|k| bounds.direction_min[k] + bounds.direction_max[k]))
}

/// No ray of the tile enters the node's box before this distance; not negative, so that its bits are in its order.
/// Among boxes that hold the tile's origins the one whose centre is nearer along the tile's middle direction comes
/// first: their distances are below any other's.
fn distance_to(bounds: &TileBounds, node: &TopNode2, near: f32) -> f32 {
    if near <= most(bounds.t_min, 0.0) { 1.0e-30 * most(centre_along(bounds, node), 0.0) } else { near }
}
