// Places the tiles' lists one after the other. Lists of more than list_most leaves are dropped: the rays of those tiles walk the
// whole top level, each by itself. If they do not fit, all are emptied and the total says how many entries
// the lists need: the pass is then repeated with larger ones.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/tiles.wgsl"

var<workgroup> sums: array<u32, 256>;

fn kept(count: u32) -> u32 {
    return select(count, 0u, count > params.list_most);
}

// One workgroup: each thread sums a run of tiles, then all shift by the sum of the runs before.
@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    let run = (params.tiles + 255u) / 256u;
    let first = min(lane * run, params.tiles);
    let last = min(first + run, params.tiles);
    var sum = 0u;
    for (var i = first; i < last; i++) {
        sum += kept(tile_lists[i].count);
    }
    sums[lane] = sum;
    workgroupBarrier();
    var before = 0u;
    var total = 0u;
    for (var i = 0u; i < 256u; i++) {
        if i < lane {
            before += sums[i];
        }
        total += sums[i];
    }
    var from_root = 0u;
    let fits = total <= params.list_capacity;
    for (var i = first; i < last; i++) {
        let all = tile_lists[i].count;
        let count = kept(all);
        tile_lists[i] = TileList(before, select(0u, count, fits), 0u, u32(fits && all > count));
        from_root += u32(all > count);
        before += count;
    }
    if from_root > 0u {
        atomicAdd(&counters[COUNTER_TILES_FROM_ROOT], from_root);
    }
    if lane == 0u {
        atomicStore(&counters[COUNTER_LIST_ENTRIES], total);
    }
}
