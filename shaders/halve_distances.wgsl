// The next level of distances: the least of each eight.
#include "shared/flood.wgsl"

// One thread two cells along z of a level of params.x on each axis. Given: the level with twice as many. What is not negative is ordered as its bits.
@compute @workgroup_size(32, 2)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let cell = vec3<u32>(id.zy, 2u * id.x);
    if any(cell >= vec3<u32>(params.x)) {
        return;
    }
    var least = vec2<u32>(0xffffu);
    for (var corner = 0u; corner < 4u; corner++) {
        let at = element(2u * cell + vec3<u32>(corner >> 1u, corner & 1u, 0u), 2u * params.x) / 2u;
        let words = vec2<u32>(given[at], given[at + 1u]);
        least = min(least, min(words & vec2<u32>(0xffffu), words >> vec2<u32>(16u)));
    }
    results[element(cell, params.x) / 2u] = least.x | least.y << 16u;
}
