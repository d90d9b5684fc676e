// What src/gpu/probe.rs asks of a device at start: the results of basic and exact arithmetic, compared with their twin.

@group(0) @binding(0) var<uniform> params: vec4<u32>;                       // 0, number of cases
@group(0) @binding(1) var<storage, read> cases: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> results: array<u32>;

fn zero_bits() -> u32 {
    return params.x;
}

#include "trace/surface.wgsl"

fn put(at: u32, x: f32) {
    results[at] = bitcast<u32>(x);
}

fn put3(at: u32, x: vec3<f32>) {
    put(at, x.x);
    put(at + 1u, x.y);
    put(at + 2u, x.z);
}

// One thread a case of 4 words; 12 words of results.
@compute @workgroup_size(64)
fn arithmetic(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.y {
        return;
    }
    let x = cases[id.x];
    let at = 12u * id.x;
    put(at, x.x + x.y);
    put(at + 1u, x.x - x.y);
    put(at + 2u, x.x * x.y);
    put(at + 3u, barrier(x.x * x.y) - barrier(x.z * x.w));
    put(at + 4u, x.x * x.y - x.z * x.w);
    put(at + 5u, divide(x.x, x.y));
    put(at + 6u, square_root(abs(x.x)));
    put(at + 7u, diffprod(x.x, x.y, x.z, x.w));
    put(at + 8u, x.x);
    put(at + 9u, max(x.x, x.y));
    put(at + 10u, min(x.x, x.y));
}

// One thread a case of 16 words: vertices a, b, c, origin and direction of a ray, t_min; 28 words of results.
@compute @workgroup_size(64)
fn triangles(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.y {
        return;
    }
    let x0 = cases[4u * id.x];
    let x1 = cases[4u * id.x + 1u];
    let x2 = cases[4u * id.x + 2u];
    let x3 = cases[4u * id.x + 3u];
    let a = x0.xyz;
    let b = vec3<f32>(x0.w, x1.xy);
    let c = vec3<f32>(x1.zw, x2.x);
    let o = x2.yzw;
    let d = x3.xyz;
    let at = 28u * id.x;

    let f = ray_frame(d);
    results[at] = f.kx | f.ky << 8u | f.kz << 16u;
    put(at + 1u, f.sx);
    put(at + 2u, f.sy);
    put(at + 3u, f.iz);
    put3(at + 4u, f.inv);

    let h = intersect_triangle(f, barrier3(a - o), barrier3(b - o), barrier3(c - o), x3.w);
    results[at + 7u] = u32(h.hit);
    put(at + 8u, h.t);
    put(at + 9u, h.u);
    put(at + 10u, h.v);
    put(at + 11u, h.w);
    put(at + 12u, h.det);
    if !h.hit {
        return;
    }
    let s = surface_point(a, b, c, h.u, h.v, h.w, h.det, d);
    put3(at + 13u, s.p);
    put(at + 16u, s.delta);
    put3(at + 17u, s.n);
    results[at + 20u] = s.down;
    put3(at + 21u, offset_origin(s));
    put(at + 24u, s.area);
}
