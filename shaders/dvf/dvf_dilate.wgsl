// Widens the masks of every cell by a texel to all sides, across the seams of the octahedral map: dilating what was
// brought together is the same as bringing together what was dilated.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "common/exact.wgsl"
#include "dvf/dvf.wgsl"

var<private> rows: array<u32, 32>;

// A row from right to left.
fn mirrored(row: u32) -> u32 {
    return reverseBits(row) >> (32u - dvf.octahedral);
}

// One thread a mask.
@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let mask = (group.y * groups.x + group.x) * 64u + lane;
    if mask >= 2u * dvf.size.x * dvf.size.y * dvf.size.z {
        return;
    }
    let side = dvf.octahedral;
    let a_word = 32u / side;
    let first = mask * dvf_words();
    let all_bits = 0xffffffffu >> (32u - side);
    var some = 0u;
    for (var y = 0u; y < side; y++) {
        let row = atomicLoad(&dvf_masks[first + y / a_word]) >> (y % a_word * side % 32u) & all_bits;
        rows[y] = row;
        some |= row;
    }
    if some == 0u {
        return;
    }
    // Along rows: beside the end of a row lies the end of the one that lies as far from the middle on the other side.
    for (var y = 0u; y <= (side - 1u) / 2u; y++) {
        let other = side - 1u - y;
        let ends = (rows[y] | rows[other]) & (1u | 1u << (side - 1u));
        rows[y] = (rows[y] | rows[y] << 1u | rows[y] >> 1u | ends) & all_bits;
        rows[other] = (rows[other] | rows[other] << 1u | rows[other] >> 1u | ends) & all_bits;
    }
    // From row to row: beyond the first lies itself, mirrored, and so beyond the last.
    var word = 0u;
    for (var y = 0u; y < side; y++) {
        var before = mirrored(rows[0]);
        if y > 0u {
            before = rows[y - 1u];
        }
        var after = mirrored(rows[side - 1u]);
        if y + 1u < side {
            after = rows[y + 1u];
        }
        word |= (rows[y] | before | after) << (y % a_word * side % 32u);
        if y % a_word == a_word - 1u {
            atomicStore(&dvf_masks[first + y / a_word], word);
            word = 0u;
        }
    }
}
