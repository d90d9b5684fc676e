// What the kernels of distance fields share (src/secondary/df): bindings of group 2, and where things lie
// in them. Cell (x, y, z) of a cube of n on each axis is element (x n + y) n + z.

#include "occupancy/types.wgsl"
#include "df/types.wgsl"

@group(1) @binding(6) var<uniform> own: DfOwn;
@group(2) @binding(0) var<storage, read> field_levels: array<Level>;     // the base maps, the finest first
// Of all levels: cell (x, y, z) is bit z % 32 of a word.
@group(2) @binding(1) var<storage, read> boms: array<u32>;
// Of one field, the nearest occupied cell to each, twice.
@group(2) @binding(2) var<storage, read_write> nearest: array<u32>;
// Of all fields, their levels one by one: two f16 a word, the first lowest.
@group(2) @binding(3) var<storage, read_write> distances: array<u32>;

// The nearest occupied cell where there is none.
const NO_SEED: u32 = 0xffffffffu;
// The bits of an infinite f16.
const INFINITE: u32 = 0x7c00u;

fn element(cell: vec3<u32>, cells: u32) -> u32 {
    return (cell.x * cells + cell.y) * cells + cell.z;
}

fn cell_of(element: u32, cells: u32) -> vec3<u32> {
    return vec3<u32>(element / (cells * cells), element / cells % cells, element % cells);
}

// First of the nearest cells of a half.
fn half_of(half: u32) -> u32 {
    return half * own.cells * own.cells * own.cells;
}

// Words of the distances of a level, `mip`, of a field.
fn mip_words(mip: u32) -> u32 {
    let n = own.cells >> mip;
    return n * n * n / 2u;
}

// First word of those of field `level`.
fn first_distance(level: u32, mip: u32) -> u32 {
    let before = select(0u, mip_words(0u), mip > 0u) + select(0u, mip_words(1u), mip > 1u);
    return level * (mip_words(0u) + mip_words(1u) + mip_words(2u)) + before;
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
