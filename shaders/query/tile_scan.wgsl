// Places the tiles' lists one after the other. The rays of tiles with lists of more than list_most leaves walk the
// whole top level, each by itself: such lists are dropped. If the entries do not fit, all lists are emptied and the
// total says how many entries they need: the pass is then repeated with larger ones.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "query/tiles.wgsl"

var<workgroup> sums: array<u32, 256>;
var<workgroup> roots_of: array<u32, 256>;

fn kept(count: u32) -> u32 {
    return select(count, 0u, count > params.list_most);
}

// The sum, or the greatest number: so many entries fit nowhere.
fn plus(a: u32, b: u32) -> u32 {
    return select(a + b, 0xffffffffu, b > 0xffffffffu - a);
}

// One workgroup: each thread sums a run of tiles, then all shift by the sum of the runs before.
@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    let run = (params.tiles + 255u) / 256u;
    let first = min(lane * run, params.tiles);
    let last = min(first + run, params.tiles);
    var sum = 0u;
    var from_root = 0u;
    for (var i = first; i < last; i++) {
        let count = tile_lists[i].count;
        sum = plus(sum, kept(count));
        from_root += u32(count > params.list_most);
    }
    sums[lane] = sum;
    roots_of[lane] = from_root;
    workgroupBarrier();
    var before = 0u;
    var total = 0u;
    var place = 0u;
    var rooted = 0u;
    for (var i = 0u; i < 256u; i++) {
        if i < lane {
            before += sums[i];
            place += roots_of[i];
        }
        total = plus(total, sums[i]);
        rooted += roots_of[i];
    }
    let fits = total <= params.list_capacity;
    for (var i = first; i < last; i++) {
        let all = tile_lists[i].count;
        let count = kept(all);
        tile_lists[i].first = before;
        tile_lists[i].count = select(0u, count, fits);
        tile_lists[i].selected = 0u;
        tile_lists[i].from_root = u32(fits && all > params.list_most);
        before += count;
        if all > params.list_most {
            tile_lists[place].rooted = i;
            place += 1u;
        }
    }
    if lane == 0u {
        atomicStore(&counters[COUNTER_LIST_ENTRIES], total);
        atomicAdd(&counters[COUNTER_TILES_FROM_ROOT], rooted);
        set_work(WORK_ROOTED, select(0u, rooted, fits));
    }
}
