// Up-sweep: the sum of each block of a level is an element of the level above (Günay, Akyüz, compute shader 2; Blelloch
// 1990).
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "common/exact.wgsl"
#include "dvf/dvf.wgsl"
#include "dvf/sweep.wgsl"

var<workgroup> sums: array<vec2<u32>, 256>;

// One thread two elements.
@compute @workgroup_size(256)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group.y * groups.x + group.x;
    let first = block * DVF_WALK + 2u * lane;
    sums[lane] = plus(element_of(first), element_of(first + 1u));
    for (var step = 128u; step > 0u; step /= 2u) {
        workgroupBarrier();
        if lane < step {
            sums[lane] = plus(sums[lane], sums[lane + step]);
        }
    }
    if lane == 0u && block * DVF_WALK < own.count {
        dvf_sums[own.next + block] = sums[0];
    }
}
