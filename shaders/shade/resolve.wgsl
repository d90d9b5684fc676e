// Reads the attributes of hits in bricks whose attributes are resident: normal, tangent, texture coordinates, the
// material without its textures, and what of these the pixel covers.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "common/exact.wgsl"
#include "trace/cache.wgsl"
#include "shade/shading.wgsl"
#include "shade/material.wgsl"
#include "shade/more.wgsl"

// Of the angle between a ray and a normal; below it a footprint is that of this one.
const LEAST_COSINE: f32 = 0.05;
// As much as a ray of a hundred over the hemisphere stands for: the root of pi / 100.
const WIDEST_BEND: f32 = 0.17724539;

// The normal of an attribute vertex; zero if it has none.
fn octahedral(word: u32) -> vec3<f32> {
    if word == NO_NORMAL {
        return vec3<f32>(0.0);
    }
    let e = unpack2x16snorm(word);
    var n = vec3<f32>(e.x, e.y, 1.0 - abs(e.x) - abs(e.y));
    let t = max(-n.z, 0.0);
    n.x += select(t, -t, n.x >= 0.0);
    n.y += select(t, -t, n.y >= 0.0);
    return normalize(n);
}

// Normals and tangents of vertices are unit vectors in the world before they are interpolated, as of a copy that was
// baked into the world; where an instance does not stretch them, interpolating first gives the same directions.
fn unit_or_zero(v: vec3<f32>) -> vec3<f32> {
    return v * inverseSqrt(max(dot(v, v), 1.0e-30));
}

// x y + ..., rounded after every operation.
fn rounded_dot(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return barrier(barrier(barrier(a.x * b.x) + barrier(a.y * b.y)) + barrier(a.z * b.z));
}

// Of the surface that has such unit normals at the corners of a triangle of half this area: how much of the sphere of
// directions the normals cover by how much of the surface (Gauss). Rotations do not change it.
fn curvature_of(n: array<vec3<f32>, 3>, area: f32) -> f32 {
    return length(cross(n[1] - n[0], n[2] - n[0])) / max(area, 1.0e-30);
}

// Tangent of the angle by which a reflection widens the cone of a camera ray that went so far, by the curvature of what
// reflects it: cones.wgsl.
fn bend(curvature: f32, way: f32) -> f32 {
    if curvature == 0.0 {
        return 0.0;
    }
    return min(barrier(barrier(way * params.step_y.w) * square_root(curvature)), WIDEST_BEND);
}

// What the pixel covers of the textures' unit square, an area, by ray cones (Akenine-Möller et al. 2021, "Improved
// shader and texture level of detail using ray cones", eq. 2): the cone's width at the hit by the cosine there,
// squared, times the area of the triangle in texture coordinates by that in the world. A cone is as wide as the part of
// a pixel that its sample stands for, the pixel over the root of the number of samples, so that many samples show what
// a larger picture does. Cones go on from hits as they are, so their width follows from the way from the camera, and
// from the curvature of what reflects them (cones.wgsl). Rounded as it stands: which tiles are read depends on it.
fn footprint_of(ray: Ray, t: f32, surface: Surface, uvs: array<vec2<f32>, 3>) -> f32 {
    let e1 = uvs[1] - uvs[0];
    let e2 = uvs[2] - uvs[0];
    let uv_area = abs(barrier(barrier(e1.x * e2.y) - barrier(e1.y * e2.x)));
    let way = ray.origin - params.origin.xyz;
    let length = square_root(rounded_dot(ray.direction, ray.direction));
    let to_origin = square_root(rounded_dot(way, way));
    let from_origin = barrier(t * length);
    let distance = barrier(to_origin + from_origin);
    let cosine = max(divide(abs(rounded_dot(ray.direction, surface.normal)), length), LEAST_COSINE);
    let width = divide(barrier(distance * params.step_y.w), cosine);
    let spread = divide(barrier(bend(bitcast<f32>(surface.emitter), to_origin) * from_origin), cosine);
    let square = barrier(barrier(width * width) + barrier(spread * spread));
    return barrier(divide(uv_area, max(surface.area, 1.0e-30)) * square);
}

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let surface = seen_surfaces[index];
    if surface.leaf == NONE || gbuffer[index].state != 0u {
        return;
    }
    let leaf = leaves[surface.leaf];
    if (slots[leaf.brick].state & STATE_ATTRIBUTES) == 0u {
        return;
    }
    let b = bricks[leaf.brick];
    let page = slots[leaf.brick].attributes_page;
    let at = 4u * slots[leaf.brick].attributes_offset;
    let word = cache_word(page, at + b.surfaces + surface.triangle);
    let material = materials[word & 0x3fffffffu];
    let rotation = word >> 30u;
    var corner: vec3<u32>;
    if (b.flags & BRICK_INDEX32) != 0u {
        let i = at + b.attribute_indices + 3u * surface.triangle;
        corner = vec3<u32>(cache_word(page, i), cache_word(page, i + 1u), cache_word(page, i + 2u));
    } else {
        let half = 3u * surface.triangle;
        let i = at + b.attribute_indices + (half >> 1u);
        let x = cache_word(page, i);
        let y = cache_word(page, i + 1u);
        if (half & 1u) == 0u {
            corner = vec3<u32>(x & 0xffffu, x >> 16u, y & 0xffffu);
        } else {
            corner = vec3<u32>(x >> 16u, y & 0xffffu, y >> 16u);
        }
    }
    let hit = seen_hits[index];
    let weights = vec3<f32>(1.0 - hit.u - hit.v, hit.u, hit.v);
    let place = instances[leaf.instance];
    let m = place.object_from_world;
    let is_stretched = (place.flags & INSTANCE_STRETCHED) != 0u;
    var normal = vec3<f32>(0.0);
    var uvs: array<vec2<f32>, 3>;
    var uv = vec2<f32>(0.0);
    var color = vec4<f32>(0.0);
    var normals: array<vec3<f32>, 3>;
    for (var k = 0u; k < 3u; k++) {
        let v = cache_vec4(page, (at >> 2u) + corner[k]);
        var n = octahedral(v.x);
        if is_stretched {
            n = unit_or_zero(m[0].xyz * n.x + m[1].xyz * n.y + m[2].xyz * n.z);
        }
        normals[k] = n;
        normal += weights[k] * n;
        uvs[k] = bitcast<vec2<f32>>(v.yz);
        // Rounded as it stands: which tiles are read depends on it.
        uv.x = barrier(uv.x + barrier(weights[k] * uvs[k].x));
        uv.y = barrier(uv.y + barrier(weights[k] * uvs[k].y));
        color += weights[k] * unpack4x8unorm(v.w);
    }
    var n = normal;
    if !is_stretched {
        n = m[0].xyz * normal.x + m[1].xyz * normal.y + m[2].xyz * normal.z;
    }
    let size = dot(n, n);
    // No normals, normals that cancel, and normals turned away from the side that was hit give way to the geometric
    // one.
    n = select(surface.normal, n * inverseSqrt(max(size, 1.0e-30)), size > 1.0e-12);
    let is_turned = dot(n, surface.normal) < 0.0;
    if is_turned {
        n = -n;
    }
    let base = material.base_color * color;
    // Source vertex (i + rotation) mod 3 was stored as vertex i.
    let source = array<f32, 3>(
        weights[(3u - rotation) % 3u],
        weights[(4u - rotation) % 3u],
        weights[(5u - rotation) % 3u],
    );
    var g: GBuffer;
    g.albedo = base.rgb;
    g.state = GBUFFER_READ;
    g.normal = n;
    g.material = word & 0x3fffffffu;
    g.emission = material.emission;
    g.weights = vec2<f32>(source[1], source[2]);
    g.uv = uv;
    g.occlusion = 1.0;
    g.metallic = material.metallic;
    g.roughness = material.roughness;
    g.curvature = curvature_of(normals, surface.area);
    for (var place = 0u; place < MATERIAL_TEXTURES; place++) {
        if texture_of(material, place) != NONE {
            g.state |= 1u << (GBUFFER_FIRST + place);
        }
    }
    if g.state != GBUFFER_READ || (material.flags & (MATERIAL_ANISOTROPIC | MATERIAL_MORE)) != 0u {
        g.footprint = footprint_of(seen_rays[index], hit.t, surface, uvs);
        if (b.flags & BRICK_DETAIL) != 0u {
            let w = place.world_from_object;
            var along = vec3<f32>(0.0);
            for (var k = 0u; k < 3u; k++) {
                let v = cache_vec4(page, ((at + b.details) >> 2u) + corner[k]);
                var t = octahedral(v.x);
                if is_stretched {
                    t = unit_or_zero(vec3<f32>(dot(w[0].xyz, t), dot(w[1].xyz, t), dot(w[2].xyz, t)));
                }
                along += weights[k] * t;
                g.handedness = bitcast<f32>(v.y);
                uvs[k] = bitcast<vec2<f32>>(v.zw);
                g.uv1.x = barrier(g.uv1.x + barrier(weights[k] * uvs[k].x));
                g.uv1.y = barrier(g.uv1.y + barrier(weights[k] * uvs[k].y));
            }
            g.footprint1 = footprint_of(seen_rays[index], hit.t, surface, uvs);
            g.tangent = along;
            if !is_stretched {
                g.tangent = vec3<f32>(dot(w[0].xyz, along), dot(w[1].xyz, along), dot(w[2].xyz, along));
            }
            // Seen from behind, the frame is turned about with its normal.
            if is_turned {
                g.tangent = -g.tangent;
                g.handedness = -g.handedness;
            }
            if (place.flags & INSTANCE_MIRRORED) != 0u {
                g.handedness = -g.handedness;
            }
        }
        if g.handedness == 0.0 {
            g.state &= ~(1u << (GBUFFER_FIRST + NORMAL));
        }
    }
    start_more(index, g, n);
    if g.state == GBUFFER_READ {
        g = settled(g, material.flags);
    }
    g.state |= select(0u, GBUFFER_BACK, is_turned);
    if (material.flags & MATERIAL_REFRACTS) != 0u && (params.flags & PARAM_REFRACT) != 0u {
        g.state |= GBUFFER_REFRACTS;
    }
    gbuffer[index] = g;
}
