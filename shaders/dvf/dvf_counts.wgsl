// How many points lie on each of a group's triangles, as what is to be summed.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "trace/surface.wgsl"
#include "dvf/dvf.wgsl"
#include "dvf/dvf_triangle.wgsl"

// One thread a triangle.
@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let i = (group.y * groups.x + group.x) * 64u + lane;
    if i < dvf.triangles {
        dvf_sums[i] = vec2<u32>(points_on(dvf_triangles[i]), 0u);
    }
}
