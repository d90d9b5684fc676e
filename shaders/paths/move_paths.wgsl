// Moves the rays by which paths go on to the set before, with what is known of their paths (generate_path.wgsl). With
// COMPACT those that go on come together in the first rows, tile by tile and in a tile block by block, in the order
// that they had: neighbours stay neighbours. The place does not decide what a ray meets or brings.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "shade/shading.wgsl"
#include "texture/blocks.wgsl"
#include "paths/alive.wgsl"

override COMPACT: bool = false;

struct Part {
    corner: vec2<u32>,
    size: vec2<u32>,
    number: u32,          // of a place within it
}

// The square of `edge`, cut off at the border, that holds a place of `part`: squares are numbered through row by row.
fn square_of_place(part: Part, edge: u32) -> Part {
    let row = part.number / (edge * part.size.x);
    let height = min(edge, part.size.y - row * edge);
    let in_row = part.number - row * edge * part.size.x;
    let column = in_row / (edge * height);
    let width = min(edge, part.size.x - column * edge);
    return Part(part.corner + edge * vec2<u32>(column, row), vec2<u32>(width, height), in_row - column * edge * height);
}

// Index of the ray of a number, in so many rows.
fn place_of(number: u32, rows: u32) -> u32 {
    let tile = square_of_place(Part(vec2<u32>(0u), vec2<u32>(params.width, rows), number), params.tile);
    let block = square_of_place(tile, 8u);
    let x = block.corner.x + block.number % block.size.x;
    let y = block.corner.y + block.number / block.size.x;
    return y * params.width + x;
}

fn move_path(index: u32, place: u32) {
    let ray = rays[index];
    let known = surfaces[index];
    seen_rays[place] = ray;
    seen_hits[place] = Hit(ray.t_max, NONE, 0.0, 0.0);
    let curvature = bitcast<u32>(known.normal.x);
    seen_surfaces[place] =
        Surface(vec3<f32>(0.0), NONE, vec3<f32>(0.0), 0u, 0.0, known.source, known.pending, curvature);
    throughput[place] = vec4<f32>(known.point, known.area);
    origins[place] = Origin(known.emitter, known.triangle);
}

// No ray.
fn leave_empty(place: u32) {
    seen_rays[place] = Ray(vec3<f32>(0.0), 1.0, vec3<f32>(0.0, 1.0, 0.0), 0.0);
    seen_hits[place] = Hit(0.0, NONE, 0.0, 0.0);
    seen_surfaces[place] = Surface(vec3<f32>(0.0), NONE, vec3<f32>(0.0), 0u, 0.0, NONE, 1u, 0u);
    throughput[place] = vec4<f32>(0.0);
    origins[place] = Origin(0u, 0u);
}

// One workgroup a block of 8 x 8 rays.
@compute @workgroup_size(8, 8)
fn main(
    @builtin(workgroup_id) workgroup: vec3<u32>,
    @builtin(num_workgroups) workgroups: vec3<u32>,
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = workgroup.x + workgroup.y * workgroups.x;
    let index = ray_of(work_of_all(block), local);
    note_alive(index, lane);
    workgroupBarrier();
    if block >= blocks() {
        return;
    }
    if !COMPACT {
        if index != NONE {
            move_path(index, index);
        }
        return;
    }
    let all = origins[first_of_block(blocks())].pixel;
    let rows = max((all + params.width - 1u) / params.width, 1u);
    if ((atomicLoad(&alive[lane / 32u]) >> (lane % 32u)) & 1u) != 0u {
        move_path(index, place_of(origins[first_of_block(block)].pixel + alive_before(lane), rows));
    }
    let number = 64u * block + lane;
    if number >= all && number < rows * params.width {
        leave_empty(place_of(number, rows));
    }
}
