// One ray from every hit of the shaded set to a point of the pass's lamp; from surfaces that face away, none.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/exact.wgsl"
#include "common/random.wgsl"
#include "shade/lamps.wgsl"
#include "shade/choose.wgsl"

// Rays to emitters end short of them by this share of the distance, so that what lies in their plane casts no shadow.
const SHORT_OF_LIGHT: f32 = 1.0 / 65536.0;
// Of the coordinates: more than what three roundings may leave a point of an emitter beside its triangle, and more on
// instances.
const BESIDE: f32 = 1.0 / 1048576.0;

fn greatest(v: vec3<f32>) -> f32 {
    return max(abs(v.x), max(abs(v.y), abs(v.z)));
}

// From `start` to the point of `e` that `r` draws evenly. Triangles are surfaces of the scene themselves, so the point
// is lifted off them by what roundings leave; a start that lies in the plane of the triangle within as much has no
// light from it: zero.
fn toward(e: Emitter, start: vec3<f32>, r: vec2<f32>) -> vec3<f32> {
    let kind = e.kind & EMITTER_KIND;
    if kind == EMITTER_DISTANT {
        return -e.u;
    }
    if kind > EMITTER_TRIANGLE {
        return barrier3(e.corner - start);
    }
    let is_triangle = kind == EMITTER_TRIANGLE;
    let s = select(r, vec2<f32>(1.0) - r, is_triangle && r.x + r.y > 1.0);
    let p = barrier3(e.corner + barrier3(barrier3(s.x * e.u) + barrier3(s.y * e.v)));
    let direction = barrier3(p - start);
    if !is_triangle {
        return direction;
    }
    let n = normalize(cross(e.u, e.v));
    let above = -dot(direction, n);
    let beside = BESIDE * (greatest(p) + greatest(start));
    if abs(above) <= beside {
        return vec3<f32>(0.0);
    }
    return direction + select(-beside, beside, above > 0.0) * n;
}

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let surface = seen_surfaces[index];
    var ray = Ray(surface.point, 1.0, params.sun.xyz, 0.0);
    var chosen = Chosen(0u, 0.0);
    if surface.leaf != NONE {
        let r = points2(pixel_of(index), params.stream, params.seed);
        var faces = true;
        var t_max = T_INFINITE;
        if (params.flags & PARAM_EMITTER) != 0u {
            // The first two words draw the point.
            chosen = choose_emitter(lamp_words(index, 0u).z, surface.point, surface.normal);
            faces = chosen.emitter != NONE;
            if faces {
                let e = emitters[chosen.emitter];
                ray.direction = toward(e, surface.point, r);
                faces = shines(e, ray.direction) > 0.0;
                t_max = select(1.0 - SHORT_OF_LIGHT, T_INFINITE, (e.kind & EMITTER_KIND) == EMITTER_DISTANT);
            }
        } else if (params.flags & PARAM_ENVIRONMENT) != 0u {
            chosen = choose_direction(index, surface.normal);
            ray.direction = environment_sample(lamp_words(index, chosen.emitter)).direction;
            faces = chosen.probability > 0.0;
        } else if params.sun_radius > 0.0 {
            let d = params.sun.xyz;
            let disc = disc_point(r) * params.sun_radius;
            let x = tangent(d);
            let y = cross(d, x);
            ray.direction = barrier3(d + barrier3(barrier3(x * disc.x) + barrier3(y * disc.y)));
        }
        if faces && dot(surface.normal, ray.direction) > 0.0 {
            ray.t_min = 0.0;
            ray.t_max = t_max;
        }
    }
    rays[index] = ray;
    start_hit(index, ray.t_max, seen_hits[index].id);
    surfaces[index].emitter = chosen.emitter;
    surfaces[index].area = chosen.probability;
}
