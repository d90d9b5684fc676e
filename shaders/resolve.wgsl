// Reads the attributes of hits in bricks whose attributes are resident: normal, texture coordinates, base colour.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/cache.wgsl"
#include "shared/texels.wgsl"
#include "shared/shading.wgsl"

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

fn wrap(x: i32, size: i32, mode: u32) -> i32 {
    if mode == 1u {
        return clamp(x, 0, size - 1);
    }
    if mode == 2u {
        let period = 2 * size;
        let m = ((x % period) + period) % period;
        return select(m, period - 1 - m, m >= size);
    }
    return ((x % size) + size) % size;
}

fn linear_from_srgb(c: vec3<f32>) -> vec3<f32> {
    return select(pow((c + vec3<f32>(0.055)) / 1.055, vec3<f32>(2.4)), c / 12.92, c <= vec3<f32>(0.04045));
}

fn texel(t: Texture, level_offset: u32, size: vec2<i32>, x: i32, y: i32) -> vec4<f32> {
    let u = wrap(x, size.x, t.wrap & 0xffffu);
    let v = wrap(y, size.y, t.wrap >> 16u);
    let c = unpack4x8unorm(texel_word(t.page, t.offset + level_offset + u32(v * size.x + u)));
    return vec4<f32>(linear_from_srgb(c.rgb), c.a);
}

// Bilinear lookup in the level nearest to the footprint: `texels_squared` is the area of a pixel in texels of level 0.
fn sample_texture(t: Texture, uv: vec2<f32>, texels_squared: f32) -> vec4<f32> {
    let lod = 0.5 * log2(clamp(texels_squared, 1.0e-12, 1.0e12));
    let level = u32(clamp(floor(lod + 0.5), 0.0, f32(t.levels - 1u)));
    var offset = 0u;
    for (var l = 0u; l < level; l++) {
        offset += max(1u, t.width >> l) * max(1u, t.height >> l);
    }
    let size = vec2<i32>(vec2<u32>(max(1u, t.width >> level), max(1u, t.height >> level)));
    // Whole turns are taken off first so that large coordinates keep their fraction; the bound keeps integers in range.
    let turned = select(uv - 2.0 * floor(0.5 * uv), uv, vec2<bool>((t.wrap & 0xffffu) == 1u, (t.wrap >> 16u) == 1u));
    let p = clamp(turned, vec2<f32>(-4.0), vec2<f32>(4.0)) * vec2<f32>(size) - vec2<f32>(0.5);
    let f = p - floor(p);
    let i = vec2<i32>(floor(p));
    let top = mix(texel(t, offset, size, i.x, i.y), texel(t, offset, size, i.x + 1, i.y), f.x);
    let bottom = mix(texel(t, offset, size, i.x, i.y + 1), texel(t, offset, size, i.x + 1, i.y + 1), f.x);
    return mix(top, bottom, f.y);
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
    var normal = vec3<f32>(0.0);
    var uvs: array<vec2<f32>, 3>;
    var uv = vec2<f32>(0.0);
    var color = vec4<f32>(0.0);
    for (var k = 0u; k < 3u; k++) {
        let v = cache_vec4(page, (at >> 2u) + corner[k]);
        normal += weights[k] * octahedral(v.x);
        uvs[k] = bitcast<vec2<f32>>(v.yz);
        uv += weights[k] * uvs[k];
        color += weights[k] * unpack4x8unorm(v.w);
    }
    let m = instances[leaf.instance].object_from_world;
    var n = m[0].xyz * normal.x + m[1].xyz * normal.y + m[2].xyz * normal.z;
    let size = dot(n, n);
    // No normals, normals that cancel, and normals turned away from the side that was hit give way to the geometric one.
    n = select(surface.normal, n * inverseSqrt(max(size, 1.0e-30)), size > 1.0e-12);
    if dot(n, surface.normal) < 0.0 {
        n = -n;
    }
    var base = material.base_color * color;
    if material.base_color_texture != NONE {
        let t = textures[material.base_color_texture];
        let e1 = uvs[1] - uvs[0];
        let e2 = uvs[2] - uvs[0];
        let uv_area = abs(e1.x * e2.y - e1.y * e2.x) * f32(t.width) * f32(t.height);
        let ray = seen_rays[index];
        let distance = hit.t * length(ray.direction);
        let cosine = max(abs(dot(ray.direction, surface.normal)) / length(ray.direction), 0.05);
        let footprint = distance * params.step_y.w;
        base *= sample_texture(t, uv, uv_area / max(surface.area, 1.0e-30) * footprint * footprint / cosine);
    }
    // Source vertex (i + rotation) mod 3 was stored as vertex i.
    let source = array<f32, 3>(weights[(3u - rotation) % 3u], weights[(4u - rotation) % 3u], weights[(5u - rotation) % 3u]);
    gbuffer[index] = GBuffer(base.rgb, 1u, n, word & 0x3fffffffu, material.emission, 0u, vec2<f32>(source[1], source[2]), uv);
}
