// A block of the rays of a group: points on its triangles, and around their normals the directions of the table, turned at random (Günay, Akyüz,
// compute shader 4, and the rays of Algorithm 2). Points are numbered over all triangles and found by the sums of their numbers, so that large
// triangles are shared out as small ones are; the rays of a point are shared out over lanes. Every operation is rounded by itself.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/surface.wgsl"
#include "shared/sampling_words.wgsl"
#include "shared/dvf.wgsl"
#include "shared/dvf_triangle.wgsl"

// The triangle that point `point` of the group lies on: the last before which there are no more.
fn triangle_of(point: u32) -> u32 {
    var low = 0u;
    var high = dvf.triangles;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if dvf_sums[middle].x <= point {
            low = middle;
        } else {
            high = middle;
        }
    }
    return low;
}

// Whether a ray is made: all, or those that wait.
fn is_made(index: u32) -> bool {
    if params.dvf_next == NONE {
        return true;
    }
    return (atomicLoad(&dvf_waiting[params.dvf_next + index / 32u]) >> (index % 32u) & 1u) != 0u;
}

// No ray.
fn no_ray() -> Ray {
    return Ray(vec3<f32>(0.0), 1.0, vec3<f32>(0.0, 1.0, 0.0), 0.0);
}

// The ray of lane `slot` of the block.
fn ray_of(slot: u32) -> Ray {
    var ray = no_ray();
    let point = slot / dvf.lanes;
    var turn = slot % dvf.lanes + params.dvf_turn * dvf.lanes;
    let is_both = (dvf.flags & DVF_BOTH) != 0u;
    let all_rays = select(dvf.rays, 2u * dvf.rays, is_both);
    if point >= dvf.point_count || turn >= all_rays {
        return ray;
    }
    let is_behind = turn >= dvf.rays;
    if is_behind {
        turn -= dvf.rays;
    }
    let number = triangle_of(point);
    let t = dvf_triangles[number];
    var end = dvf.point_count;
    if number + 1u < dvf.triangles {
        end = dvf_sums[number + 1u].x;
    }
    let first = dvf_sums[number].x;
    let count = max(end - first, 1u);
    let own = point - first;
    let words = random4(own, t.id, dvf.seed);
    var r = vec2<f32>(unit_of(words.x), unit_of(words.y));
    if (dvf.flags & DVF_HAMMERSLEY) != 0u {
        r = vec2<f32>(divide(barrier(f32(own) + 0.5), f32(count)), unit_of(reverseBits(own)));
    }
    // P = (1 - sqrt(r1)) A + sqrt(r1) (1 - r2) B + sqrt(r1) r2 C (eq. 2); the set's first number may round to 1.
    let s = square_root(min(r.x, 0x1.fffffep-1));
    let weights = vec3<f32>(barrier(1.0 - s), barrier(s * barrier(1.0 - r.y)), barrier(s * r.y));
    let back = back_of(t);
    let m = abs(back);
    if max(m.x, max(m.y, m.z)) == 0.0 {
        return ray;
    }
    let start = surface_point(t.a, t.b, t.c, weights.x, weights.y, weights.z, 1.0, scaled(select(back, -back, is_behind)).x);
    ray.origin = offset_origin(start);
    if dvf_cell(ray.origin) == NONE {
        return ray;
    }
    let local = dvf_directions[turn].xyz;
    let around = dvf_directions[dvf.rays + words.z % DVF_CIRCLE_POINTS].xy;
    ray.direction = dvf_around(around, local, start.n);
    ray.t_min = 0.0;
    ray.t_max = T_INFINITE;
    return ray;
}

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let slot = params.dvf_first + index;
    var ray = no_ray();
    if is_made(index) {
        ray = ray_of(slot);
    }
    var source = NONE;
    if ray.t_min <= ray.t_max {
        source = dvf_triangles[triangle_of(slot / dvf.lanes)].id;
    }
    rays[index] = ray;
    start_hit(index, ray.t_max, source);
}
