// One step of jump flooding (Rong and Tan 2006) in three dimensions.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "df/field.wgsl"

// One thread a cell: of the nearest occupied cells that it and the 26 neighbours a step away know, the nearest to it;
// of equally far ones that with the lowest number.
@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n = own.cells;
    let number = (group.x + group.y * groups.x) * 64u + lane;
    let cell = cell_of(number, n);
    if cell.x >= n {
        return;
    }
    let step = i32(own.step);
    let given = half_of(own.half);
    var best = NO_SEED;
    var least = 0xffffffffu;
    for (var x = -step; x <= step; x += step) {
        for (var y = -step; y <= step; y += step) {
            for (var z = -step; z <= step; z += step) {
                // Below zero it is far above.
                let neighbour = vec3<u32>(vec3<i32>(cell) + vec3<i32>(x, y, z));
                if any(neighbour >= vec3<u32>(n)) {
                    continue;
                }
                let seed = nearest[given + element(neighbour, n)];
                if seed == NO_SEED {
                    continue;
                }
                let distance = squared_distance(cell, seed);
                if distance < least || (distance == least && seed < best) {
                    least = distance;
                    best = seed;
                }
            }
        }
    }
    nearest[half_of(1u - own.half) + number] = best;
}
