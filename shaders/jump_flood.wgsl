// One step of jump flooding (Rong and Tan 2006) in three dimensions.
#include "shared/flood.wgsl"

// One thread a cell: of the nearest occupied cells that it and the 26 neighbours a step away know, the nearest to it; of equally far ones that
// with the lowest number. Given: those of the step before.
@compute @workgroup_size(32, 2)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let cells = params.x;
    let cell = id.zyx;
    if any(cell >= vec3<u32>(cells)) {
        return;
    }
    let step = i32(params.y);
    var nearest = params.z;
    var least = 0xffffffffu;
    for (var x = -step; x <= step; x += step) {
        for (var y = -step; y <= step; y += step) {
            for (var z = -step; z <= step; z += step) {
                // Below zero it is far above.
                let neighbour = vec3<u32>(vec3<i32>(cell) + vec3<i32>(x, y, z));
                if any(neighbour >= vec3<u32>(cells)) {
                    continue;
                }
                let seed = given[element(neighbour, cells)];
                if seed == params.z {
                    continue;
                }
                let distance = squared_distance(cell, seed);
                if distance < least || (distance == least && seed < nearest) {
                    least = distance;
                    nearest = seed;
                }
            }
        }
    }
    results[element(cell, cells)] = nearest;
}
