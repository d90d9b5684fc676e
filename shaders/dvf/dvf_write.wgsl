// Enters what a block's rays met into the masks of the cells that they start in. Those that wait for bricks are noted
// and ended: they are made again when these have come.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "common/exact.wgsl"
#include "dvf/dvf.wgsl"

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let ray = rays[index];
    if own.next != NONE {
        let word = own.next + index / 32u;
        let bit = 1u << (index % 32u);
        if is_traced(index, ray) && surfaces[index].pending != 0u {
            atomicOr(&dvf_waiting[word], bit);
            hits[index].t = -1.0;
            return;
        }
        atomicAnd(&dvf_waiting[word], ~bit);
    }
    if own.count == 0u {
        return;
    }
    if !(ray.t_min <= ray.t_max) {
        return;
    }
    var cell = dvf_cell(ray.origin);
    if cell != NONE && (dvf.flags & DVF_RENEW) != 0u {
        // Its entry has the masks.
        cell = dvf_fresh[cell];
    }
    if cell == NONE {
        return;
    }
    let texel = dvf_texel(ray.direction);
    let mask = 2u * cell + select(1u, 0u, hits[index].id == NONE);
    atomicOr(&dvf_masks[mask * dvf_words() + texel / 32u], 1u << (texel % 32u));
}
