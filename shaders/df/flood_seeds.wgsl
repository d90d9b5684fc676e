// Begins jump flooding of a field: the nearest occupied cell to one that is occupied is itself, to others none is
// known.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "df/field.wgsl"

// One thread a cell.
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
    let word = boms[(own.level * n * n + cell.x + n * cell.y) * (n / 32u) + cell.z / 32u];
    let is_seed = (word >> (cell.z % 32u) & 1u) != 0u;
    nearest[number] = select(NO_SEED, pack_cell(cell), is_seed);
}
