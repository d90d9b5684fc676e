// Ray-aligned occupancy maps (Zeng et al., ROMA): bindings of group 2, cells of a column in words of 32 bits (depth t
// at bit 31 - t % 32 of word t / 32), strata of directions. Twins: src/secondary/roma/bits.rs and directions.rs.

#include "common/angles.wgsl"
#include "occupancy/types.wgsl"
#include "roma/types.wgsl"

@group(1) @binding(6) var<uniform> own: RomaOwn;
@group(2) @binding(0) var<storage, read> roma_levels: array<Level>;
// Of the finest level, by their strata, then of the next.
@group(2) @binding(1) var<storage, read> roma_maps: array<RomaMap>;
// Of each level: cell (x, y, z) is bit z % 32 of a word; then what is empty, a byte a block
// (src/secondary/occupancy/clearance.rs).
@group(2) @binding(2) var<storage, read> boms: array<u32>;
// Of all maps, row by row, the words of a column together.
@group(2) @binding(3) var<storage, read_write> columns: array<u32>;

fn linear(row: vec4<f32>, v: vec3<f32>) -> f32 {
    return barrier(barrier(barrier(row.x * v.x) + barrier(row.y * v.y)) + barrier(row.z * v.z));
}

fn affine(row: vec4<f32>, p: vec3<f32>) -> f32 {
    return barrier(linear(row, p) + row.w);
}

// Words of a column.
fn words() -> u32 {
    return own.size / 32u;
}

// First word of column (x, y) of a map.
fn first_word(map: u32, x: u32, y: u32) -> u32 {
    return ((map * own.size + y) * own.size + x) * words();
}

// Depth of the middle of the first occupied cell between two depths of the column whose words start at `first`, in the
// order of travel; below 0: none is.
fn first_cell(first: u32, start: f32, end: f32, is_forward: bool) -> f32 {
    let from_depth = floor(min(start, end));
    let to_depth = floor(max(start, end));
    let deepest = f32(own.size) - 1.0;
    if !(to_depth >= 0.0 && from_depth <= deepest) {
        return -1.0;
    }
    let low = u32(max(from_depth, 0.0));
    let high = u32(min(to_depth, deepest));
    let first_of = low >> 5u;
    let last_of = high >> 5u;
    for (var i = 0u; i <= last_of - first_of; i++) {
        let w = select(last_of - i, first_of + i, is_forward);
        let bit_from = select(0u, low & 31u, w == first_of);
        let bit_to = select(31u, high & 31u, w == last_of);
        let within = ((columns[first + w] << bit_from) >> (31u - bit_to + bit_from)) << (31u - bit_to);
        if within != 0u {
            let cell = select(31u - countTrailingZeros(within), countLeadingZeros(within), is_forward);
            return f32(32u * w + cell) + 0.5;
        }
    }
    return -1.0;
}

// Where in the unit square a direction of the upper hemisphere lies, |z| its height: the inverse of the concentric map
// (Shirley, Chiu 1997) and of z = 1 - r^2. It needs no unit length.
fn square_of(d: vec3<f32>) -> vec2<f32> {
    let across = barrier(barrier(d.x * d.x) + barrier(d.y * d.y));
    let length = square_root(barrier(across + barrier(d.z * d.z)));
    let radius = square_root(divide(across, barrier(length * barrier(length + abs(d.z)))));
    return square_of_disc(d.xy, radius);
}

// The stratum that a direction, or in the lower hemisphere its opposite, lies in.
fn stratum_of(direction: vec3<f32>) -> u32 {
    let d = select(-direction, direction, direction.z >= 0.0);
    let s = min(vec2<u32>(square_of(d) * f32(own.k)), vec2<u32>(own.k - 1u));
    return s.x + own.k * s.y;
}
