// Counts the rays of each block of 8 x 8 that go on. Blocks are numbered tile by tile.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "texture/blocks.wgsl"
#include "paths/alive.wgsl"

// One workgroup a block.
@compute @workgroup_size(8, 8)
fn main(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = workgroup.x + workgroup.y * workgroups.x;
    note_alive(ray_of(work_of_all(block), local), lane);
    workgroupBarrier();
    if lane == 0u && block < blocks() {
        origins[first_of_block(block)].pixel = alive_before(64u);
    }
}
