// Distances from cells to the nearest occupied one, as f16 rounded toward zero, two in a word, the first lowest.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "df/field.wgsl"

// The bits of the largest f16 whose square is not above a whole number less than 2^18. An f16 has 11 bits: its square
// has 22, and is exact in f32.
fn root_toward_zero(squared: u32) -> u32 {
    if squared == 0u {
        return 0u;
    }
    let exact = f32(squared);
    var bits = bitcast<u32>(sqrt(exact)) & 0xffffe000u;
    let root = bitcast<f32>(bits);
    let next = bitcast<f32>(bits + 0x2000u);
    if root * root > exact {
        bits -= 0x2000u;
    } else if next * next <= exact {
        bits += 0x2000u;
    }
    // From the exponent's bias of 127 to that of 15: the root is from 1 to 2^9.
    return (bits >> 13u) - (112u << 10u);
}

fn distance_bits(cell: vec3<u32>) -> u32 {
    let seed = nearest[half_of(own.half) + element(cell, own.cells)];
    if seed == NO_SEED {
        return INFINITE;
    }
    return root_toward_zero(squared_distance(cell, seed));
}

// One thread two cells along z.
@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n = own.cells;
    let number = (group.x + group.y * groups.x) * 64u + lane;
    let cell = cell_of(2u * number, n);
    if cell.x >= n {
        return;
    }
    let word = distance_bits(cell) | distance_bits(cell + vec3<u32>(0u, 0u, 1u)) << 16u;
    distances[first_distance(own.level, 0u) + number] = word;
}
