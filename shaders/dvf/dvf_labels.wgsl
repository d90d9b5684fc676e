// Labels every cell by whether more directions miss or hit (Günay, Akyüz, compute shader 5).
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "common/exact.wgsl"
#include "dvf/dvf.wgsl"

// One thread a cell.
@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let cell = (group.y * groups.x + group.x) * 64u + lane;
    if cell >= dvf.size.x * dvf.size.y * dvf.size.z {
        return;
    }
    let words = dvf_words();
    var missed = 0u;
    var hit = 0u;
    for (var i = 0u; i < words; i++) {
        missed += countOneBits(atomicLoad(&dvf_masks[2u * cell * words + i]));
        hit += countOneBits(atomicLoad(&dvf_masks[(2u * cell + 1u) * words + i]));
    }
    var label = select(DVF_VISIBLE_LABEL, DVF_OCCLUDED_LABEL, hit > missed);
    if hit + missed == 0u {
        label = DVF_UNKNOWN_LABEL;
    }
    dvf_labels[cell] = label;
}
