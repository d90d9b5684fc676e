// Picks from each tile's list the leaves whose brick is in the wanted state, but for culled pairs, keeping their order.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "query/tiles.wgsl"

override INTERSECT: bool = false; // the selection is intersected next: counted as such

// One thread a tile.
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    let tile = global.x;
    if tile >= params.tiles {
        return;
    }
    let entry = tile_lists[tile];
    var selected = 0u;
    var departures = 0u;  // from the order of the leaves' numbers
    var last = 0u;
    let end = select(entry.first + entry.count, entry.first, entry.from_root != 0u);
    for (var i = entry.first; i < end; i++) {
        let leaf = top2[list[i].node].left;
        let state = slots[leaves[leaf].brick].state;
        if (state & params.select_mask) == params.select_want && !is_culled(tile, leaf) {
            selection[entry.first + selected] = i;
            selected += 1u;
            departures += u32(leaf < last);
            last = leaf;
        }
    }
    tile_lists[tile].selected = selected;
    if selected > 0u {
        // In any order: tiles do not depend on each other.
        tile_lists[atomicAdd(&counters[COUNTER_TILES_CHOSEN], 1u)].chosen = tile;
    }
    if INTERSECT && selected > 0u {
        atomicAdd(&counters[COUNTER_PAIRS_INTERSECTED], selected);
        atomicAdd(&counters[COUNTER_FRONT_TO_BACK], departures);
        atomicMax(&counters[COUNTER_MOST_SELECTED], selected);
        if selected > 1u && params.run_count > 1u {
            atomicAdd(&counters[COUNTER_TILE_BATCHES], 1u);
            atomicAdd(&counters[COUNTER_TILE_BATCH_LEAVES], selected);
        }
    }
}
