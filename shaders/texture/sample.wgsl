// Looks up the textures of hits, one by one: each whose tiles are resident together; of the others all tiles are asked
// for, and the hit waits. With PARAM_COARSER none waits: the next coarser level that is resident stands for what is
// missing.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "common/exact.wgsl"
#include "trace/cache.wgsl"
#include "texture/texels.wgsl"
#include "common/sampling.wgsl"
#include "texture/bc7.wgsl"
#include "texture/bc5.wgsl"
#include "texture/texture.wgsl"
#include "shade/material.wgsl"
#include "texture/more.wgsl"

// Coordinates of texture `place`, rounded as they stand: which tiles are read depends on them.
fn coordinates(g: GBuffer, u: vec4<f32>, v: vec4<f32>, second: bool) -> vec2<f32> {
    let uv = select(g.uv, g.uv1, second);
    return vec2<f32>(
        barrier(barrier(barrier(u.x * uv.x) + barrier(u.y * uv.y)) + u.z),
        barrier(barrier(barrier(v.x * uv.x) + barrier(v.y * uv.y)) + v.z),
    );
}

// The normal that a texel of a normal texture stands for on a surface with this one.
fn turned_normal(normal: vec3<f32>, g: GBuffer, texel: vec3<f32>, scale: f32) -> vec3<f32> {
    let n = 2.0 * texel - vec3<f32>(1.0);
    let along = g.tangent - normal * dot(normal, g.tangent);
    let size = dot(along, along);
    // The tangent may have no part beside the normal.
    let t = along * inverseSqrt(max(size, 1.0e-30));
    let b = cross(normal, t) * sign(g.handedness);
    let turned = scale * n.x * t + scale * n.y * b + n.z * normal;
    let length = dot(turned, turned);
    return select(normal, turned * inverseSqrt(max(length, 1.0e-30)), size > 1.0e-30 && length > 1.0e-12);
}

fn is_resident(level: Level) -> bool {
    for (var k = 0u; k < 4u; k++) {
        let tile = tile_at(level, k);
        if tile != NONE && tile_slots[tile].page == NONE {
            return false;
        }
    }
    return true;
}

// What a texture of a hit shows.
struct Texel {
    color: vec4<f32>,
    is_missing: bool,     // its tiles are not resident, and are asked for
    is_coarser: bool,     // a coarser level stands for one that is missing
}

// Texture `which` of a material at a hit, that of ray `index`.
fn look_up(g: GBuffer, material: u32, which: u32, index: u32) -> Texel {
    var found: Texel;
    let m = materials[material];
    let t = textures[texture_of(m, which)];
    let second = ((m.uv_sets >> which) & 1u) != 0u;
    let u = materials[material].uv_from_set[2u * which];
    let uv = coordinates(g, u, materials[material].uv_from_set[2u * which + 1u], second);
    var levels = levels_of(t, barrier(select(g.footprint, g.footprint1, second) * u.w));
    var around: array<Level, 2>;
    for (var n = 0u; n < levels.count; n++) {
        around[n] = level_at(t, levels.finer + n, uv);
        found.is_missing |= !is_resident(around[n]);
    }
    if found.is_missing && (params.flags & PARAM_COARSER) != 0u {
        // The tail ends this: it is resident throughout.
        levels.count = 1u;
        while !is_resident(around[0]) {
            levels.finer += 1u;
            around[0] = level_at(t, levels.finer, uv);
        }
        found.is_missing = false;
        found.is_coarser = true;
    }
    for (var i = 0u; i < 4u * levels.count; i++) {
        let tile = tile_at(around[i / 4u], i & 3u);
        if tile == NONE {
            continue;
        }
        if found.is_missing {
            atomicAdd(&tile_demand[tile].rays, 1u);
            atomicMin(&tile_demand[tile].first, index);
        } else if atomicLoad(&tile_demand[tile].used) == 0u {
            atomicStore(&tile_demand[tile].used, 1u);
        }
    }
    if !found.is_missing {
        found.color = color_at(t, around[0]);
        if levels.count == 2u {
            found.color = mix(found.color, color_at(t, around[1]), levels.share);
        }
    }
    return found;
}

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    var g = gbuffer[index];
    var is_coarser = look_up_more(g, index);
    if (g.state & GBUFFER_WAITS) == 0u {
        count_coarser(index, is_coarser);
        return;
    }
    for (var which = 0u; which < MATERIAL_TEXTURES; which++) {
        let bit = 1u << (GBUFFER_FIRST + which);
        if (g.state & bit) == 0u {
            continue;
        }
        let found = look_up(g, g.material, which, index);
        if found.is_missing {
            continue;
        }
        is_coarser |= found.is_coarser;
        let color = found.color;
        switch which {
            case BASE_COLOR: { g.albedo *= color.rgb; }
            case NORMAL: {
                g.normal = turned_normal(g.normal, g, color.rgb, materials[g.material].normal_scale);
            }
            case METALLIC_ROUGHNESS: {
                g.roughness *= color.g;
                g.metallic *= color.b;
            }
            case OCCLUSION: {
                g.occlusion = 1.0 + materials[g.material].occlusion_strength * (color.r - 1.0);
            }
            default: { g.emission *= color.rgb; }
        }
        g.state &= ~bit;
    }
    if (g.state & GBUFFER_WAITS) == 0u {
        g = settled(g, materials[g.material].flags);
    }
    gbuffer[index] = g;
    count_coarser(index, is_coarser);
}

// Notes that coarser levels stand for some of a hit's textures.
fn count_coarser(index: u32, is_coarser: bool) {
    if is_coarser {
        atomicAdd(&counters[COUNTER_UNRESOLVED], 1u);
        gbuffer[index].state |= GBUFFER_COARSER;
    }
}
