// Puts a frame together again. The light on second surfaces is that of pixels nearby which see these first.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "denoise/denoise.wgsl"

const REACH: i32 = 2;              // of pixels that lend their light to second surfaces, each way

fn light_of(pixel: u32) -> vec3<f32> {
    return lit[pixel].color + lit[pixels() + pixel].color;
}

// One thread a pixel.
@compute @workgroup_size(8, 8)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
) {
    let place = place_of(group, groups, local);
    if !is_inside(place) {
        return;
    }
    let pixel = index_of(place);
    let albedo = given[pixel].albedo;
    var radiance = picture[pixel];
    let light = barrier3(albedo * light_of(pixel));
    for (var k = 0u; k < 3u; k++) {
        radiance[k] += select(light[k], 0.0, albedo[k] < LEAST_ALBEDO);
    }
    if seen[pixel].second != NONE {
        let second = seconds[seen[pixel].second];
        let first = least_around(place, REACH);
        let last = most_around(place, REACH);
        var sum = vec3<f32>(0.0);
        var count = 0u;
        for (var y = first.y; y <= last.y; y++) {
            for (var x = first.x; x <= last.x; x++) {
                let other = index_of(vec2<i32>(x, y));
                if is_same_surface(seen[other], second.id, second.normal, second.point) {
                    sum += light_of(other);
                    count += 1u;
                }
            }
        }
        for (var k = 0u; k < 3u; k++) {
            if count > 0u && second.albedo[k] >= LEAST_ALBEDO {
                radiance[k] += divide(barrier(second.albedo[k] * sum[k]), f32(count)) - second.light[k];
            }
        }
    }
    picture[pixel] = radiance;
}
