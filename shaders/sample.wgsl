// Looks up the textures of hits whose tiles are resident together; the others ask for all of theirs and wait.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/exact.wgsl"
#include "shared/cache.wgsl"
#include "shared/texels.wgsl"
#include "shared/sampling.wgsl"
#include "shared/bc7.wgsl"
#include "shared/texture.wgsl"

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    if global.x >= params.width || global.y >= params.height {
        return;
    }
    let index = global.y * params.width + global.x;
    if gbuffer[index].state != GBUFFER_WAITS {
        return;
    }
    let uv = gbuffer[index].uv;
    let t = textures[materials[gbuffer[index].material].base_color_texture];
    let levels = levels_of(t, gbuffer[index].footprint);
    var around: array<Level, 2>;
    var is_missing = false;
    for (var n = 0u; n < levels.count; n++) {
        around[n] = level_at(t, levels.finer + n, uv);
        for (var k = 0u; k < 4u; k++) {
            let tile = tile_at(around[n], k);
            if tile != NONE {
                is_missing |= tile_slots[tile].page == NONE;
            }
        }
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
        return;
    }
    var color = color_at(t, around[0]);
    if levels.count == 2u {
        color = mix(color, color_at(t, around[1]), levels.share);
    }
    gbuffer[index].albedo *= color.rgb;
    gbuffer[index].state = GBUFFER_READ;
}
