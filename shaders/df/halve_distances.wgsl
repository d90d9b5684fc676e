// The next level of a field's distances: the least of each eight.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "df/field.wgsl"

// One thread two cells along z of the level that is made. What is not negative is ordered as its bits.
@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n = own.cells >> own.mip;
    let number = (group.x + group.y * groups.x) * 64u + lane;
    let cell = cell_of(2u * number, n);
    if cell.x >= n {
        return;
    }
    let given = first_distance(own.level, own.mip - 1u);
    var least = vec2<u32>(0xffffu);
    for (var corner = 0u; corner < 4u; corner++) {
        let at = given + element(2u * cell + vec3<u32>(corner >> 1u, corner & 1u, 0u), 2u * n) / 2u;
        let words = vec2<u32>(distances[at], distances[at + 1u]);
        least = min(least, min(words & vec2<u32>(0xffffu), words >> vec2<u32>(16u)));
    }
    distances[first_distance(own.level, own.mip) + number] = least.x | least.y << 16u;
}
