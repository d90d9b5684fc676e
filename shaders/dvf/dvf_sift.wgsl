// Answers the rays of the pass that a discrete visibility field tells: those are ended before they are traced. In a
// cell that is mostly visible directions that no ray from it met anything in are free; in one that is mostly occluded,
// directions in which none went free are not. All others are traced, and are the same rays as without a field.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/exact.wgsl"
#include "dvf/dvf.wgsl"

var<workgroup> counted: atomic<u32>;

// As the paper has it: only what the masks know to be against the label is traced; the label is noted.
fn sift_as_in_paper(index: u32, ray: Ray) -> bool {
    let cell = dvf_cell(ray.origin);
    var is_free = false;
    var is_met = false;
    var is_occluded_cell = false;
    if cell != NONE {
        let texel = dvf_texel(ray.direction);
        let words = dvf_words();
        let at = 2u * cell * words + texel / 32u;
        is_free = (atomicLoad(&dvf_masks[at]) >> (texel % 32u) & 1u) != 0u;
        is_met = (atomicLoad(&dvf_masks[at + words]) >> (texel % 32u) & 1u) != 0u;
        is_occluded_cell = dvf_labels[cell] == DVF_OCCLUDED_LABEL;
    }
    gbuffer[index].padding0 = select(0u, 1u, is_occluded_cell);
    if !is_traced(index, ray) || select(is_met, is_free, is_occluded_cell) {
        return false;
    }
    hits[index].t = -1.0;
    if is_occluded_cell {
        hits[index].id = MET;
    }
    return true;
}

// Answers a ray; whether it did.
fn sift(index: u32, ray: Ray) -> bool {
    if (dvf.flags & DVF_PAPER) != 0u {
        return sift_as_in_paper(index, ray);
    }
    let cell = dvf_cell(ray.origin);
    if !is_traced(index, ray) {
        return false;
    }
    if cell == NONE {
        return false;
    }
    let label = dvf_labels[cell];
    if label == DVF_UNKNOWN_LABEL {
        return false;
    }
    let texel = dvf_texel(ray.direction);
    let words = dvf_words();
    let at = 2u * cell * words + texel / 32u;
    let is_free = (atomicLoad(&dvf_masks[at]) >> (texel % 32u) & 1u) != 0u;
    let is_met = (atomicLoad(&dvf_masks[at + words]) >> (texel % 32u) & 1u) != 0u;
    if is_free == is_met {
        return false;
    }
    if (dvf.flags & DVF_DOUBT) == 0u && is_met != (label == DVF_OCCLUDED_LABEL) {
        return false;
    }
    hits[index].t = -1.0;
    if is_met {
        hits[index].id = MET;
    }
    return true;
}

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    if global.x < params.width && global.y < params.height {
        let index = global.y * params.width + global.x;
        let ray = rays[index];
        if sift(index, ray) {
            atomicAdd(&counted, 1u);
        }
    }
    workgroupBarrier();
    if lane == 0u {
        atomicAdd(&counters[COUNTER_RAYS_ANSWERED], atomicLoad(&counted));
    }
}
