// Discrete visibility fields (src/secondary/dvf): bindings of group 2, and where things lie in them. Twin:
// src/secondary/dvf/twin.rs.

#include "dvf/types.wgsl"

@group(1) @binding(6) var<uniform> own: DvfOwn;
@group(2) @binding(0) var<storage, read> dvf: DvfGrid;
// Of each cell, texel by texel: where some ray missed, then where some ray hit.
@group(2) @binding(1) var<storage, read_write> dvf_masks: array<atomic<u32>>;
// Of each cell: DVF_VISIBLE, DVF_OCCLUDED or DVF_UNKNOWN.
@group(2) @binding(2) var<storage, read_write> dvf_labels: array<u32>;
@group(2) @binding(3) var<storage, read> dvf_triangles: array<DvfTriangle>;   // of the group at hand
// Sums of 64 bits, the low word first, level by level.
@group(2) @binding(4) var<storage, read_write> dvf_sums: array<vec2<u32>>;
// dvf.rays of rays about z, then points of the unit circle, then numbers of these for a tile of pixels, four to an
// element.
@group(2) @binding(5) var<storage, read> dvf_directions: array<vec4<f32>>;
// A bit for each ray of some blocks: whether it waits for bricks.
@group(2) @binding(6) var<storage, read_write> dvf_waiting: array<atomic<u32>>;
// With DVF_RENEW: of each cell the number of its entry, NONE where it is not made anew; then of each entry the texels
// that are.
@group(2) @binding(7) var<storage, read> dvf_fresh: array<u32>;
// dvf_seen: hits in each cell; dvf_points: entry and rays of each side of each point; dvf_rays: numbers of those whose
// rays are made.
@group(2) @binding(8) var<storage, read_write> dvf_tally: array<atomic<u32>>;

const DVF_VISIBLE_LABEL: u32 = 0u;  // more directions miss than hit
const DVF_OCCLUDED_LABEL: u32 = 1u;
const DVF_UNKNOWN_LABEL: u32 = 2u;  // no ray started there
const DVF_CIRCLE_POINTS: u32 = 1024u;
const DVF_TILE_SIDE: u32 = 64u;

// Words of a mask.
fn dvf_words() -> u32 {
    return dvf.octahedral * dvf.octahedral / 32u;
}

// The cell that holds a point of the frame; NONE: none does.
fn dvf_cell(p: vec3<f32>) -> u32 {
    let at = barrier3(barrier3(p * dvf.scale) + dvf.first);
    if !(all(at >= vec3<f32>(0.0)) && all(at < vec3<f32>(dvf.size))) {
        return NONE;
    }
    let cell = min(vec3<u32>(at), dvf.size - 1u);
    return (cell.z * dvf.size.y + cell.y) * dvf.size.x + cell.x;
}

// The texel of a direction of any length but 0 (octahedral map: Cigolle et al. 2014; a component of 0 counts as
// positive).
fn dvf_texel(d: vec3<f32>) -> u32 {
    let m = abs(d);
    let sum = barrier(barrier(m.x + m.y) + m.z);
    var u = divide(d.x, sum);
    var v = divide(d.y, sum);
    if d.z < 0.0 {
        let folded = barrier(1.0 - abs(v));
        v = select(-1.0, 1.0, v >= 0.0) * barrier(1.0 - abs(u));
        u = select(-1.0, 1.0, u >= 0.0) * folded;
    }
    let side = f32(dvf.octahedral);
    let last = dvf.octahedral - 1u;
    let x = min(u32(max(barrier(barrier(barrier(u + 1.0) * 0.5) * side), 0.0)), last);
    let y = min(u32(max(barrier(barrier(barrier(v + 1.0) * 0.5) * side), 0.0)), last);
    return y * dvf.octahedral + x;
}

// Direction `local` about z, turned by the point `around` of the unit circle, about the unit vector n instead.
fn dvf_around(around: vec2<f32>, local: vec3<f32>, n: vec3<f32>) -> vec3<f32> {
    let x = barrier(barrier(around.x * local.x) - barrier(around.y * local.y));
    let y = barrier(barrier(around.y * local.x) + barrier(around.x * local.y));
    // Two directions across the normal (Duff et al. 2017).
    let side = select(-1.0, 1.0, n.z >= 0.0);
    let a = -divide(1.0, barrier(side + n.z));
    let b = barrier(barrier(n.x * n.y) * a);
    let across = vec3<f32>(barrier(1.0 + barrier(barrier(side * barrier(n.x * n.x)) * a)), side * b, -side * n.x);
    let up = vec3<f32>(b, barrier(side + barrier(barrier(n.y * n.y) * a)), -n.y);
    return barrier3(barrier3(barrier3(x * across) + barrier3(y * up)) + barrier3(local.z * n));
}
