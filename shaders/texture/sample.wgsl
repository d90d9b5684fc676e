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

// Coordinates of texture `place`, rounded as they stand: which tiles are read depends on them.
fn coordinates(g: GBuffer, u: vec4<f32>, v: vec4<f32>, second: bool) -> vec2<f32> {
    let uv = select(g.uv, g.uv1, second);
    return vec2<f32>(
        barrier(barrier(barrier(u.x * uv.x) + barrier(u.y * uv.y)) + u.z),
        barrier(barrier(barrier(v.x * uv.x) + barrier(v.y * uv.y)) + v.z),
    );
}

// The normal that a texel of the normal texture stands for.
fn turned_normal(g: GBuffer, texel: vec3<f32>, scale: f32) -> vec3<f32> {
    let n = 2.0 * texel - vec3<f32>(1.0);
    let along = g.tangent - g.normal * dot(g.normal, g.tangent);
    let size = dot(along, along);
    // The tangent may have no part beside the normal.
    let t = along * inverseSqrt(max(size, 1.0e-30));
    let b = cross(g.normal, t) * sign(g.handedness);
    let turned = scale * n.x * t + scale * n.y * b + n.z * g.normal;
    let length = dot(turned, turned);
    return select(g.normal, turned * inverseSqrt(max(length, 1.0e-30)), size > 1.0e-30 && length > 1.0e-12);
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

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    var g = gbuffer[index];
    if (g.state & GBUFFER_WAITS) == 0u {
        return;
    }
    let m = materials[g.material];
    let takes_coarser = (params.flags & PARAM_COARSER) != 0u;
    var is_coarser = false;
    for (var which = 0u; which < MATERIAL_TEXTURES; which++) {
        let bit = 1u << (GBUFFER_FIRST + which);
        if (g.state & bit) == 0u {
            continue;
        }
        let t = textures[texture_of(m, which)];
        let second = ((m.uv_sets >> which) & 1u) != 0u;
        let u = materials[g.material].uv_from_set[2u * which];
        let uv = coordinates(g, u, materials[g.material].uv_from_set[2u * which + 1u], second);
        var levels = levels_of(t, barrier(select(g.footprint, g.footprint1, second) * u.w));
        var around: array<Level, 2>;
        var is_missing = false;
        for (var n = 0u; n < levels.count; n++) {
            around[n] = level_at(t, levels.finer + n, uv);
            is_missing |= !is_resident(around[n]);
        }
        if is_missing && takes_coarser {
            // The tail ends this: it is resident throughout.
            levels.count = 1u;
            while !is_resident(around[0]) {
                levels.finer += 1u;
                around[0] = level_at(t, levels.finer, uv);
            }
            is_missing = false;
            is_coarser = true;
        }
        for (var i = 0u; i < 4u * levels.count; i++) {
            let tile = tile_at(around[i / 4u], i & 3u);
            if tile == NONE {
                continue;
            }
            if is_missing {
                atomicAdd(&tile_demand[tile].rays, 1u);
                atomicMin(&tile_demand[tile].first, index);
            } else if atomicLoad(&tile_demand[tile].used) == 0u {
                atomicStore(&tile_demand[tile].used, 1u);
            }
        }
        if is_missing {
            continue;
        }
        var color = color_at(t, around[0]);
        if levels.count == 2u {
            color = mix(color, color_at(t, around[1]), levels.share);
        }
        switch which {
            case BASE_COLOR: { g.albedo *= color.rgb; }
            case NORMAL: { g.normal = turned_normal(g, color.rgb, m.normal_scale); }
            case METALLIC_ROUGHNESS: {
                g.roughness *= color.g;
                g.metallic *= color.b;
            }
            case OCCLUSION: { g.occlusion = 1.0 + m.occlusion_strength * (color.r - 1.0); }
            default: { g.emission *= color.rgb; }
        }
        g.state &= ~bit;
    }
    if (g.state & GBUFFER_WAITS) == 0u {
        g = settled(g, m.flags);
    }
    if is_coarser {
        atomicAdd(&counters[COUNTER_UNRESOLVED], 1u);
        g.state |= GBUFFER_COARSER;
    }
    gbuffer[index] = g;
}
