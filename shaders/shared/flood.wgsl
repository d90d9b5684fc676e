// What the kernels of distance fields share (src/visibility/distance_field): cell (x, y, z) of n on each axis is element (x n + y) n + z.

@group(0) @binding(0) var<uniform> params: vec4<u32>;                       // cells on each axis, step of flooding, no seed, 0
@group(0) @binding(1) var<storage, read> given: array<u32>;
@group(0) @binding(2) var<storage, read_write> results: array<u32>;

fn element(cell: vec3<u32>, cells: u32) -> u32 {
    return (cell.x * cells + cell.y) * cells + cell.z;
}

// A cell's coordinates in 10 bits each, the first lowest.
fn pack_cell(cell: vec3<u32>) -> u32 {
    return cell.x | cell.y << 10u | cell.z << 20u;
}

// Squared distance of a cell to a packed one, cells.
fn squared_distance(cell: vec3<u32>, seed: u32) -> u32 {
    let apart = vec3<i32>(cell) - vec3<i32>(vec3<u32>(seed & 1023u, seed >> 10u & 1023u, seed >> 20u));
    let squares = apart * apart;
    return u32(squares.x + squares.y + squares.z);
}
