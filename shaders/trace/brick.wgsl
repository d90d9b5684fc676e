// What a ray meets inside one brick: vertices and triangles fetched from the cache, hits written out.
#include "trace/hidden.wgsl"
#include "trace/opacity.wgsl"
#include "trace/levels.wgsl"

struct Best {
    t: f32,
    id: u32,
    leaf: u32,
    triangle: u32,
    u: f32,                   // edge values of the accepted triangle, not divided
    v: f32,
    w: f32,
    det: f32,
    source: u32,              // triangle that the ray starts from
}

// Points `r` at the brick's geometry in the cache.
fn enter_brick(r: ptr<function, BrickRay>, brick: u32) {
    let b = bricks[brick];
    let nodes = slots[brick].geometry_offset;
    (*r).page = slots[brick].geometry_page;
    (*r).nodes = nodes;
    (*r).vertices = 4u * nodes + b.vertices;
    (*r).ids = 4u * nodes + b.ids;
    (*r).indices = 4u * nodes + b.indices;
    (*r).flags = b.flags;
}

// A vertex in the object's frame: the correctly rounded difference of its lattice position and the reference point.
fn vertex(r: ptr<function, BrickRay>, index: u32) -> vec3<f32> {
    let page = (*r).page;
    if ((*r).flags & BRICK_WIDE) == 0u {
        let i = (*r).vertices + 3u * index;
        let l = bitcast<vec3<f32>>(vec3<u32>(cache_word(page, i), cache_word(page, i + 1u), cache_word(page, i + 2u)));
        return barrier3(l + (*r).offset_high);
    }
    let i = (*r).vertices + 6u * index;
    let high = bitcast<vec3<f32>>(vec3<u32>(cache_word(page, i), cache_word(page, i + 1u), cache_word(page, i + 2u)));
    let low_bits = vec3<u32>(cache_word(page, i + 3u), cache_word(page, i + 4u), cache_word(page, i + 5u));
    let low = bitcast<vec3<f32>>(low_bits);
    return barrier3(barrier3(high + (*r).offset_high) + barrier3(low + (*r).offset_low));
}

fn triangle_indices(r: ptr<function, BrickRay>, triangle: u32) -> vec3<u32> {
    let page = (*r).page;
    if ((*r).flags & BRICK_INDEX32) != 0u {
        let i = (*r).indices + 3u * triangle;
        return vec3<u32>(cache_word(page, i), cache_word(page, i + 1u), cache_word(page, i + 2u));
    }
    let half = 3u * triangle;
    let i = (*r).indices + (half >> 1u);
    let a = cache_word(page, i);
    let b = cache_word(page, i + 1u);
    if (half & 1u) == 0u {
        return vec3<u32>(a & 0xffffu, a >> 16u, b & 0xffffu);
    }
    return vec3<u32>(a >> 16u, b & 0xffffu, b >> 16u);
}

// Tests one triangle and keeps the nearer hit; at equal distance the lower global id, so that no order shows.
// The triangle that the ray starts from is never met (docs/methods/exact.md, "Secondary rays"). Returns whether it is
// the best so far.
fn test_triangle(r: ptr<function, BrickRay>, best: ptr<function, Best>, triangle: u32) -> bool {
    let index = triangle_indices(r, triangle);
    let a = barrier3(vertex(r, index.x) - (*r).ray.origin);
    let b = barrier3(vertex(r, index.y) - (*r).ray.origin);
    let c = barrier3(vertex(r, index.z) - (*r).ray.origin);
    let h = intersect_triangle((*r).ray.frame, a, b, c, (*r).ray.t_min);
    if !h.hit || h.t > (*best).t {
        return false;
    }
    let id = (*r).base + cache_word((*r).page, (*r).ids + triangle);
    if (h.t == (*best).t && id >= (*best).id) || id == (*best).source {
        return false;
    }
    if is_hidden(id) || passes(r, triangle, id, h) {
        return false;
    }
    *best = Best(h.t, id, (*r).leaf, triangle, h.u, h.v, h.w, h.det, (*best).source);
    return true;
}

// Writes what a ray is told that asks whether it hits anything: no ray starts from there. By what probability it was
// drawn counts no more.
fn write_occluder(best: Best, ray: u32) {
    hits[ray].t = best.t;
    hits[ray].id = best.id;
    surfaces[ray].leaf = best.leaf;
    surfaces[ray].triangle = best.triangle;
    surfaces[ray].area = 0.0;
}

// Writes a hit that became the best in this dispatch: distance, id, barycentrics, and the point secondary rays start
// from.
fn write_hit(r: ptr<function, BrickRay>, best: Best, world_direction: vec3<f32>, ray: u32) {
    let instance = leaves[best.leaf].instance;
    let index = triangle_indices(r, best.triangle);
    let s = surface_point(vertex(r, index.x), vertex(r, index.y), vertex(r, index.z),
                          best.u, best.v, best.w, best.det, (*r).ray.direction);
    hits[ray] = Hit(best.t, best.id, divide(best.v, best.det), divide(best.w, best.det));
    var point = offset_origin(s);
    var normal = s.n;
    var area = s.area;
    if (instances[instance].flags & INSTANCE_IDENTITY) == 0u {
        let m = instances[instance];
        // Normals go by the inverse transpose: the columns of object_from_world.
        let rows = m.object_from_world;
        let n = vec3<f32>(row_direction(vec4<f32>(rows[0].x, rows[1].x, rows[2].x, 0.0), s.n),
                          row_direction(vec4<f32>(rows[0].y, rows[1].y, rows[2].y, 0.0), s.n),
                          row_direction(vec4<f32>(rows[0].z, rows[1].z, rows[2].z, 0.0), s.n));
        let stretch = length_of(n);
        normal = vec3<f32>(divide(n.x, stretch), divide(n.y, stretch), divide(n.z, stretch));
        // Area vectors go by the cofactor matrix, det * inverse transpose.
        area = barrier(barrier(area * stretch) * m.volume);
        let to = m.world_from_object;
        let p = vec3<f32>(row_point(to[0], point), row_point(to[1], point), row_point(to[2], point));
        // The rounding of the transforms there and back (src/kernels/frame.rs), along the normal.
        let reach = max(
            max(abs(p.x), max(abs(p.y), abs(p.z))),
            max(abs(to[0].w), max(abs(to[1].w), abs(to[2].w))),
        );
        let error = 16.0 * UNIT * m.scale * reach;
        // A zero component moves away from where the ray points.
        let sign = bitcast<vec3<u32>>(select(normal, -world_direction, normal == vec3<f32>(0.0))) >> vec3<u32>(31u);
        point = offset_origin(SurfacePoint(p, error, normal, sign.x | (sign.y << 1u) | (sign.z << 2u), area));
    }
    let off = level_offset(point, best.leaf);
    if off > 0.0 {
        point = barrier3(point + barrier3(off * normal));
    }
    let before = surfaces[ray];
    surfaces[ray] =
        Surface(point, best.leaf, normal, best.triangle, area, best.source, before.pending, before.emitter);
}
