// Distances from cells to the nearest occupied one, as f16 rounded toward zero, two in a word, the first lowest.
#include "shared/flood.wgsl"

// The bits of the largest f16 whose square is not above a whole number less than 2^18. An f16 has 11 bits: its square has 22, and is exact in f32.
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
    let seed = given[element(cell, params.x)];
    if seed == params.z {
        return 0x7c00u; // infinite
    }
    return root_toward_zero(squared_distance(cell, seed));
}

// One thread two cells along z. Given: the nearest occupied cells.
@compute @workgroup_size(32, 2)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let cell = vec3<u32>(id.zy, 2u * id.x);
    if any(cell >= vec3<u32>(params.x)) {
        return;
    }
    results[element(cell, params.x) / 2u] = distance_bits(cell) | distance_bits(cell + vec3<u32>(0u, 0u, 1u)) << 16u;
}
