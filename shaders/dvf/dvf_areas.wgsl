// The areas of a group's triangles, as what is to be summed (Günay, Akyüz, compute shader 1). Sums are whole numbers of
// 64 bits, so that they are the same in every order and never fall.
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
        dvf_sums[i] = steps_of(twice_area(dvf_triangles[i]));
    }
}
