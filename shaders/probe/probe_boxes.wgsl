// What the selftest asks of a device about boxes: which children of a node a ray enters, and where.

@group(0) @binding(0) var<uniform> params: vec4<u32>;                       // 0, number of cases
@group(0) @binding(1) var<storage, read> cases: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read_write> results: array<u32>;

fn zero_bits() -> u32 {
    return params.x;
}

#include "trace/triangle.wgsl"
#include "trace/node.wgsl"

// One thread a case of 32 words: a node, origin and t_min of a ray, its direction and t_max, the offset of the node's
// brick; 9 words of results: the children entered, and where each is.
@compute @workgroup_size(64)
fn boxes(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.y {
        return;
    }
    let at = 8u * id.x;
    let origin = bitcast<vec4<f32>>(cases[at + 5u]);
    let direction = bitcast<vec4<f32>>(cases[at + 6u]);
    let offset = bitcast<vec3<f32>>(cases[at + 7u].xyz);
    let ray = framed_ray(origin.xyz, direction.xyz, origin.w);
    let entered = node_hits(ray, cases[at], cases[at + 2u], cases[at + 3u], cases[at + 4u],
                            offset, vec3<f32>(0.0), 0.0, direction.w);
    results[9u * id.x] = entered.mask;
    for (var i = 0u; i < 8u; i++) {
        results[9u * id.x + 1u + i] = bitcast<u32>(entered.near[i >> 2u][i & 3u]);
    }
}
