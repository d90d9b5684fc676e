// Of every point of a group, on each side that has rays: the cell that these start in, if it is made anew, and how many
// of them are made.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "trace/surface.wgsl"
#include "common/sampling_words.wgsl"
#include "dvf/dvf.wgsl"
#include "dvf/dvf_triangle.wgsl"
#include "dvf/dvf_point.wgsl"

// One thread a side of a point.
@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = (group.y * groups.x + group.x) * 64u + lane;
    if i >= own.count {
        return;
    }
    let sides = select(1u, 2u, (dvf.flags & DVF_BOTH) != 0u);
    let number = own.first + i;
    let start = start_of(number / sides, number % sides == 1u);
    let entry = entry_of(start.cell);
    var count = 0u;
    if entry != NONE {
        for (var turn = 0u; turn < dvf.rays; turn++) {
            count += select(0u, 1u, is_fresh(entry, direction_of(start, turn)));
        }
    }
    atomicStore(&dvf_tally[2u * i], entry);
    atomicStore(&dvf_tally[2u * i + 1u], count);
}
