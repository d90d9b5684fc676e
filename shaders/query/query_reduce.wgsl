// Sums the queries of the selected pairs into the demand of their bricks, and clears them for the next query.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "query/tiles.wgsl"

// One thread a tile.
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    let tile = global.x;
    if tile >= params.tiles {
        return;
    }
    let entry = tile_lists[tile];
    var visible = 0u;
    for (var i = entry.first; i < entry.first + entry.selected; i++) {
        let position = selection[i];
        let count = atomicExchange(&pair_demand[position].rays, 0u);
        let nearest = atomicExchange(&pair_demand[position].nearest, 0xffffffffu);
        if count > 0u {
            let brick = leaves[top2[list[position].node].left].brick;
            atomicAdd(&demand[brick].rays, count);
            atomicMin(&demand[brick].nearest, nearest);
            visible += 1u;
        }
    }
    if entry.selected > 0u {
        atomicAdd(&counters[COUNTER_PAIRS_VISIBLE], visible);
        atomicAdd(&counters[COUNTER_PAIRS_INVISIBLE], entry.selected - visible);
    }
}
