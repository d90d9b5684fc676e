// Counts, per brick, the final hits of a pass.
#include "common/types.wgsl"
#include "common/bindings.wgsl"

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let leaf = surfaces[global.y * params.width + global.x].leaf;
    if leaf != NONE {
        let brick = leaves[leaf].brick;
        atomicAdd(&demand[brick].rays, 1u);
        atomicMin(&demand[brick].nearest, 0u);
    }
}
