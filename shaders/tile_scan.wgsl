// Places the tiles' lists one after the other. If they do not fit, all are emptied and the total says how many entries
// the lists need: the pass is then repeated with larger ones.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/tiles.wgsl"

var<workgroup> sums: array<u32, 256>;

// One workgroup: each thread sums a run of tiles, then all shift by the sum of the runs before.
@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    let run = (params.tiles + 255u) / 256u;
    let first = min(lane * run, params.tiles);
    let last = min(first + run, params.tiles);
    var sum = 0u;
    for (var i = first; i < last; i++) {
        sum += tile_lists[i].count;
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
    let fits = total <= params.list_capacity;
    for (var i = first; i < last; i++) {
        let count = tile_lists[i].count;
        tile_lists[i] = TileList(before, select(0u, count, fits), 0u, 0u);
        before += count;
    }
    if lane == 0u {
        atomicStore(&counters[COUNTER_LIST_ENTRIES], total);
    }
}
