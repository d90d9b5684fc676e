// Sums the queries of the selected pairs, and those in tables, into the demand of their bricks, and clears them for the next query.
// Pairs that no more rays see than the threshold are culled for the rest of the pass: hits only move nearer, so no more will.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/tiles.wgsl"

// One thread a tile.
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    let tile = global.x;
    if tile >= params.tiles {
        return;
    }
    let entry = tile_lists[tile];
    let is_table = entry.from_root != 0u;
    let pairs_asked = select(entry.selected, entry.count, is_table);
    var asked = 0u;
    var visible = 0u;
    for (var i = entry.first; i < entry.first + pairs_asked; i++) {
        var position = i;
        if !is_table {
            position = selection[i];
        }
        let leaf = list[position].leaf;
        if leaf == NONE {
            continue;
        }
        let count = atomicLoad(&pair_demand[position].rays);
        // Of a table only what rays have asked for counts as a query.
        if is_table && (count == 0u || count == PAIR_CULLED) {
            continue;
        }
        let nearest = atomicExchange(&pair_demand[position].nearest, 0xffffffffu);
        let is_visible = count > params.threshold;
        atomicStore(&pair_demand[position].rays, select(PAIR_CULLED, 0u, is_visible));
        asked += 1u;
        if is_visible {
            let brick = leaves[leaf].brick;
            atomicAdd(&demand[brick].rays, count);
            atomicMin(&demand[brick].nearest, nearest);
            visible += 1u;
        }
    }
    if asked > 0u {
        atomicAdd(&counters[COUNTER_PAIRS_VISIBLE], visible);
        atomicAdd(&counters[COUNTER_PAIRS_INVISIBLE], asked - visible);
    }
}
