// A block of the rays of a group: points on its triangles, and around their normals the directions of the table, turned
// at random (Günay, Akyüz, compute shader 4, and the rays of Algorithm 2). Points are numbered over all triangles, so
// that large triangles are shared out as small ones are; the rays of a point are shared out over lanes. Where cells are
// made anew, the points are those that are listed, each on one side, and rays are made in the texels that are.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "trace/surface.wgsl"
#include "common/sampling_words.wgsl"
#include "dvf/dvf.wgsl"
#include "dvf/dvf_triangle.wgsl"
#include "dvf/dvf_point.wgsl"

struct Made {
    ray: Ray,
    source: u32, // id of the triangle that it starts from
}

// Whether a ray is made: all, or those that wait.
fn is_made(index: u32) -> bool {
    if own.next == NONE {
        return true;
    }
    return (atomicLoad(&dvf_waiting[own.next + index / 32u]) >> (index % 32u) & 1u) != 0u;
}

// No ray.
fn no_ray() -> Made {
    return Made(Ray(vec3<f32>(0.0), 1.0, vec3<f32>(0.0, 1.0, 0.0), 0.0), NONE);
}

// The ray of lane `slot` of the block.
fn ray_of(slot: u32) -> Made {
    var made = no_ray();
    var point = slot / dvf.lanes;
    var turn = slot % dvf.lanes + own.turn * dvf.lanes;
    let is_both = (dvf.flags & DVF_BOTH) != 0u;
    var is_behind = false;
    if dvf_renews() {
        if point >= dvf.listed || turn >= dvf.rays {
            return made;
        }
        let sides = select(1u, 2u, is_both);
        let listed = atomicLoad(&dvf_tally[point]);
        point = listed / sides;
        is_behind = listed % sides == 1u;
    } else {
        let all_rays = select(dvf.rays, 2u * dvf.rays, is_both);
        if point >= dvf.point_count || turn >= all_rays {
            return made;
        }
        is_behind = turn >= dvf.rays;
        if is_behind {
            turn -= dvf.rays;
        }
    }
    let start = start_of(point, is_behind);
    if start.cell == NONE {
        return made;
    }
    let direction = direction_of(start, turn);
    if dvf_renews() {
        let entry = entry_of(start.cell);
        if entry == NONE || !is_fresh(entry, direction) {
            return made;
        }
    }
    return Made(Ray(start.origin, 0.0, direction, T_INFINITE), start.source);
}

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    var made = no_ray();
    if is_made(index) {
        made = ray_of(own.first + index);
    }
    rays[index] = made.ray;
    start_hit(index, made.ray.t_max, made.source);
}
