// Begins jump flooding: the nearest occupied cell to one that is occupied is itself, to others none is known.
#include "shared/flood.wgsl"

// One thread a cell. Given: the words of an occupancy map.
@compute @workgroup_size(32, 2)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let cells = params.x;
    let cell = id.zyx;
    if any(cell >= vec3<u32>(cells)) {
        return;
    }
    let word = given[(cell.x + cells * cell.y) * (cells / 32u) + cell.z / 32u];
    let is_seed = (word >> (cell.z % 32u) & 1u) != 0u;
    results[element(cell, cells)] = select(params.z, pack_cell(cell), is_seed);
}
