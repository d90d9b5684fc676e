// Makes the ray-aligned maps of all levels from their base maps (Zeng et al., Algorithm 1, with texel centres at (i +
// 0.5) / N): a cell is occupied where one of its look-ups, evenly spaced along the column, finds an occupied cell of
// the base map.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "common/exact.wgsl"
#include "roma/roma.wgsl"

// Steps of a column along an axis of the base map that are too short to bound it by.
const LEAST_STEP: f32 = 1.0 / 1024.0;

// Cells of a block on each axis.
const BLOCK_CELLS: u32 = 4u;

// Words of a level: a bit a cell, a byte a block.
fn words_of_level() -> u32 {
    let n = own.cells;
    let side = n / BLOCK_CELLS;
    return n * n * (n / 32u) + side * side * side / 4u;
}

fn is_within(c: vec3<u32>) -> bool {
    return all(c < vec3<u32>(own.cells));
}

fn is_occupied(level: u32, c: vec3<u32>) -> bool {
    let n = own.cells;
    let word = level * words_of_level() + (c.x + n * c.y) * (n / 32u) + c.z / 32u;
    return ((boms[word] >> (c.z % 32u)) & 1u) != 0u;
}

// Cells around one, on every axis, that are empty as it is.
fn empty_around(level: u32, c: vec3<u32>) -> u32 {
    let n = own.cells;
    let side = n / BLOCK_CELLS;
    let b = c / BLOCK_CELLS;
    let at = (b.x * side + b.y) * side + b.z;
    let word = level * words_of_level() + n * n * (n / 32u) + at / 4u;
    let distance = (boms[word] >> (8u * (at % 4u))) & 255u;
    return BLOCK_CELLS * (max(distance, 1u) - 1u);
}

// The part of the range of depths in which a column lies between 0 and the base map's side on one axis, a cell more at
// both ends.
fn bounded(range: vec2<f32>, start: f32, step: f32) -> vec2<f32> {
    if abs(step) < LEAST_STEP {
        return range;
    }
    let a = -start / step;
    let b = (f32(own.cells) - start) / step;
    return vec2<f32>(max(range.x, min(a, b) - 1.0), min(range.y, max(a, b) + 1.0));
}

// One thread a column.
@compute @workgroup_size(64)
fn main(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let n = own.size;
    let maps = own.k * own.k;
    let column = (group.x + group.y * groups.x) * 64u + lane;
    let map = column / (n * n);
    if map >= maps * own.levels {
        return;
    }
    let level = map / maps;
    let rows = roma_maps[map].base_from_cell;
    let foot = vec3<f32>(f32(column % n) + 0.5, f32(column / n % n) + 0.5, 0.0);
    let start = vec3<f32>(affine(rows[0], foot), affine(rows[1], foot), affine(rows[2], foot));
    let step = vec3<f32>(rows[0].z, rows[1].z, rows[2].z);
    var range = vec2<f32>(0.0, f32(n));
    range = bounded(bounded(bounded(range, start.x, step.x), start.y, step.y), start.z, step.z);
    let part = 1.0 / f32(own.samples);
    let per_cell = 1.0 / max(max(abs(step.x), abs(step.y)), abs(step.z));
    var next = 0u;
    for (var w = 0u; w < words(); w++) {
        var bits = 0u;
        for (; next < 32u * w + 32u; next++) {
            let depth = f32(next);
            if depth + 1.0 < range.x || depth > range.y {
                continue;
            }
            let i = next - 32u * w;
            for (var s = 0u; s < own.samples; s++) {
                let at = depth + (f32(s) + 0.5) * part;
                let cell = vec3<u32>(vec3<i32>(floor(barrier3(start + barrier3(at * step)))));
                if !is_within(cell) {
                    continue;
                }
                if is_occupied(level, cell) {
                    bits |= 1u << (31u - i);
                    break;
                }
                let passed = u32(f32(empty_around(level, cell)) * per_cell);
                if passed > 0u {
                    // All look-ups before the cell that is `passed` ahead lie in what is empty, by half a step more
                    // than roundings take.
                    next += passed - 1u;
                    break;
                }
            }
        }
        columns[column * words() + w] = bits;
    }
}
