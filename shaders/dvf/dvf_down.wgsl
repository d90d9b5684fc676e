// Down-sweep: each element of a level becomes the sum of all before it, given that the level above has been so changed
// (Günay, Akyüz, compute shader 3; within a block after Hillis and Steele 1986).
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "common/exact.wgsl"
#include "dvf/dvf.wgsl"
#include "dvf/sweep.wgsl"

var<workgroup> sums: array<vec2<u32>, 512>; // twice: what is read, and what is written

// One thread two elements.
@compute @workgroup_size(256)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group.y * groups.x + group.x;
    let first = block * DVF_WALK + 2u * lane;
    let one = element_of(first);
    let both = plus(one, element_of(first + 1u));
    sums[lane] = both;
    var read = 0u;
    for (var step = 1u; step < 256u; step *= 2u) {
        workgroupBarrier();
        var sum = sums[read + lane];
        if lane >= step {
            sum = plus(sum, sums[read + lane - step]);
        }
        sums[256u - read + lane] = sum;
        read = 256u - read;
    }
    workgroupBarrier();
    var before = vec2<u32>(0u);
    if lane > 0u {
        before = sums[read + lane - 1u];
    }
    if own.next != NONE && block * DVF_WALK < own.count {
        before = plus(before, dvf_sums[own.next + block]);
    }
    if first < own.count {
        dvf_sums[own.first + first] = before;
    }
    if first + 1u < own.count {
        dvf_sums[own.first + first + 1u] = plus(before, one);
    }
}
