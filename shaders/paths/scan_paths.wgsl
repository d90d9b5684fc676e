// Numbers the rays that go on: for each block of 8 x 8 the number of its first, and how many there are.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "texture/blocks.wgsl"
#include "paths/alive.wgsl"

var<workgroup> sums: array<u32, 256>;

// One workgroup: each thread sums a run of blocks, then all shift by the sum of the runs before.
@compute @workgroup_size(256)
fn main(@builtin(local_invocation_index) lane: u32) {
    let run = (blocks() + 255u) / 256u;
    let first = min(lane * run, blocks());
    let last = min(first + run, blocks());
    var sum = 0u;
    for (var i = first; i < last; i++) {
        sum += origins[first_of_block(i)].pixel;
    }
    sums[lane] = sum;
    workgroupBarrier();
    var before = 0u;
    var all = 0u;
    for (var i = 0u; i < 256u; i++) {
        if i == lane {
            before = all;
        }
        all += sums[i];
    }
    for (var i = first; i < last; i++) {
        let count = origins[first_of_block(i)].pixel;
        origins[first_of_block(i)].pixel = before;
        before += count;
    }
    if lane == 0u {
        origins[first_of_block(blocks())].pixel = all;
        atomicStore(&counters[COUNTER_PATHS], all);
    }
}
