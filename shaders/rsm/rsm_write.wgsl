// Writes a block of texels of a reflective shadow map from the hits of set 0, whose rays a lamp sent: where they are,
// how they are turned, and what they reflect of its light to all sides.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "common/exact.wgsl"
#include "common/random.wgsl"
#include "shade/lamps.wgsl"
#include "shade/light.wgsl"
#include "shade/gloss.wgsl"
#include "rsm/rsm.wgsl"

// One thread a ray.
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    let map = rsm_maps[own.map];
    let x = own.x + global.x;
    let y = own.y + global.y;
    if global.x >= params.width || global.y >= params.height || x >= map.width || y >= map.height {
        return;
    }
    let index = global.y * params.width + global.x;
    let surface = seen_surfaces[index];
    var texel = RsmTexel(vec3<f32>(0.0), -1.0, vec3<f32>(0.0), 0.0);
    if surface.leaf != NONE {
        let ray = seen_rays[index];
        let g = gbuffer[index];
        let to_lamp = -ray.direction;
        var light: vec3<f32>;
        if map.lamp == NONE {
            light = sunlight(g.normal);
        } else {
            let e = emitters[map.lamp];
            // Of distant lights the unit vector toward them, of others the way there: as rays to lamps have it.
            let d = select(to_lamp, to_lamp * seen_hits[index].t, (map.flags & RSM_PERSPECTIVE) != 0u);
            let squared = dot(d, d);
            light = e.radiance * max(dot(g.normal, d), 0.0) * shines(e, d) / (PI * squared * squared);
        }
        let n = surface.normal;
        let facing = barrier(barrier(barrier(n.x * to_lamp.x) + barrier(n.y * to_lamp.y)) + barrier(n.z * to_lamp.z));
        texel = RsmTexel(gloss_of(g, index, to_lamp).diffuse * light, seen_hits[index].t, n, facing);
    }
    rsm_texels[map.first + y * map.width + x] = texel;
}
