// Which leaves of the top level a ray takes where levels of detail stand for bricks (docs/methods/levels.md).
//
// A level suffices for a ray if its error is at most the width of the ray's cone at the nearest point of the level's
// box. A ray takes the leaves that suffice and whose level above does not. Errors grow and boxes nest toward the root,
// and every step here keeps order, so a ray takes exactly one leaf on each way from a root to a brick. All compares
// squares: the square of a width is the sum of the squares of the width at the origin and of what the cone adds.

#include "common/exact.wgsl"

@group(0) @binding(8) var<storage, read> level_leaves: array<LevelLeaf>;
// For each node of the binary and then of the wide top level the leaf of the level that stands for all below it; NONE.
@group(0) @binding(9) var<storage, read> level_nodes: array<u32>;

struct Cone {             // Of a ray, times the tolerance.
    origin: vec3<f32>,    // of the ray
    square: f32,          // of the width there
    spread: f32,          // square of what the width grows by over a distance of 1
}

fn square_of(v: vec3<f32>) -> f32 {
    return barrier(barrier(barrier(v.x * v.x) + barrier(v.y * v.y)) + barrier(v.z * v.z));
}

// What the widths of a ray's cone are scaled by, squared: with blending at random between two levels.
fn blend_of(direction: vec3<f32>) -> f32 {
    if params.levels.w == 0.0 {
        return 1.0;
    }
    let bits = bitcast<vec3<u32>>(direction);
    var h = (bits.x ^ params.seed) * 0x9e3779b1u;
    h = ((h ^ (h >> 15u)) + bits.y) * 0x85ebca77u;
    h = ((h ^ (h >> 13u)) + bits.z) * 0xc2b2ae3du;
    h = h ^ (h >> 16u);
    return barrier(1.0 - barrier(params.levels.w * barrier(f32(h >> 8u) * 5.9604645e-8)));
}

// Square of what the cone of a ray spreads by: what its pass's do, or more.
fn spread_of(ray: u32) -> f32 {
    return max(params.levels.y, bitcast<f32>(surfaces[ray].pending >> 1u));
}

// Whether a ray may still ask for bricks.
fn is_pending(ray: u32) -> bool {
    return (surfaces[ray].pending & 1u) != 0u;
}

fn set_pending(ray: u32, pending: bool) {
    surfaces[ray].pending = (surfaces[ray].pending & ~1u) | u32(pending);
}

fn cone_of(index: u32, ray: Ray) -> Cone {
    let blend = blend_of(ray.direction);
    let square = barrier(params.levels.x * square_of(barrier3(ray.origin - params.origin.xyz)));
    return Cone(ray.origin, barrier(blend * square), barrier(blend * spread_of(index)));
}

fn width_square(cone: Cone, leaf: u32) -> f32 {
    let d = max(max(level_leaves[leaf].min - cone.origin, cone.origin - level_leaves[leaf].max), vec3<f32>(0.0));
    return barrier(cone.square + barrier(cone.spread * square_of(d)));
}

fn suffices(cone: Cone, leaf: u32) -> bool {
    return level_leaves[leaf].error_square <= width_square(cone, leaf);
}

// Whether the ray takes a leaf.
fn takes(cone: Cone, leaf: u32) -> bool {
    if !suffices(cone, leaf) {
        return false;
    }
    let parent = level_leaves[leaf].parent;
    return parent == NONE || !suffices(cone, parent);
}

// Whether a level that the ray takes, or one above it, stands for all below a node of the binary top level.
fn is_stood_for(cone: Cone, node: u32) -> bool {
    let level = level_nodes[node];
    return level != NONE && suffices(cone, level);
}

// The same of the wide top level.
fn is_stood_for_wide(cone: Cone, node: u32) -> bool {
    return is_stood_for(cone, params.top_count + node);
}

// Ranges of what the cones of a tile have, at the box of a leaf: the squares of widths.
fn tile_widths(tile: TileBounds, leaf: u32) -> vec2<f32> {
    let eye = params.origin.xyz;
    let lo = level_leaves[leaf].min;
    let hi = level_leaves[leaf].max;
    let none = vec3<f32>(0.0);
    let from_eye = max(max(tile.origin_min - eye, eye - tile.origin_max), none);
    let to_eye = max(abs(tile.origin_min - eye), abs(tile.origin_max - eye));
    let nearest = max(max(lo - tile.origin_max, tile.origin_min - hi), none);
    let at_min = max(max(lo - tile.origin_min, tile.origin_min - hi), none);
    let at_max = max(max(lo - tile.origin_max, tile.origin_max - hi), none);
    let blend = barrier(1.0 - params.levels.w);
    let least_square = barrier(blend * barrier(params.levels.x * square_of(from_eye)));
    let least_spread = barrier(blend * max(params.levels.y, bitcast<f32>(tile.spreads & 0xffff0000u)));
    let most_spread = max(params.levels.y, bitcast<f32>(tile.spreads << 16u));
    let most_square = barrier(params.levels.x * square_of(to_eye));
    return vec2<f32>(barrier(least_square + barrier(least_spread * square_of(nearest))),
                     barrier(most_square + barrier(most_spread * square_of(max(at_min, at_max)))));
}

// Whether a level stands for all below a node of the binary top level, for every ray of the tile.
fn tile_is_stood_for(tile: TileBounds, node: u32) -> bool {
    let level = level_nodes[node];
    return level != NONE && level_leaves[level].error_square <= tile_widths(tile, level).x;
}

// Whether any ray of the tile may take a leaf.
fn tile_may_take(tile: TileBounds, leaf: u32) -> bool {
    if level_leaves[leaf].error_square > tile_widths(tile, leaf).y {
        return false;
    }
    let parent = level_leaves[leaf].parent;
    return parent == NONE || level_leaves[parent].error_square > tile_widths(tile, parent).x;
}

// In frames that may load so much only, leaves are marked by the signs of their errors: levels below which something
// is missing, and all that is below these. A marked level suffices for every ray, so that the topmost stands in.
fn is_marked(leaf: u32) -> bool {
    return (bitcast<u32>(level_leaves[leaf].error_square) >> 31u) != 0u;
}

// Whether a level would suffice if nothing were missing.
fn would_suffice(cone: Cone, leaf: u32) -> bool {
    return abs(level_leaves[leaf].error_square) <= width_square(cone, leaf);
}

// Whether the ray would take a leaf.
fn would_take(cone: Cone, leaf: u32) -> bool {
    if !would_suffice(cone, leaf) {
        return false;
    }
    let parent = level_leaves[leaf].parent;
    return parent == NONE || !would_suffice(cone, parent);
}

// Whether a level that the ray would take, or one above it, stands for all below a node of the wide top level.
fn would_be_stood_for_wide(cone: Cone, node: u32) -> bool {
    let level = level_nodes[params.top_count + node];
    return level != NONE && would_suffice(cone, level);
}

// The leaf that stands in for one that the ray would take: itself where nothing is marked above it.
fn stand_in_of(leaf: u32) -> u32 {
    var level = leaf;
    var parent = level_leaves[level].parent;
    while parent != NONE && is_marked(parent) {
        level = parent;
        parent = level_leaves[level].parent;
    }
    return level;
}

// By what rays that start at a hit start off along its normal, beside the rounding of the point: the error of the level
// that they take there, which is the coarsest of those that the hit and they may be on.
fn level_offset(point: vec3<f32>, leaf: u32) -> f32 {
    let square = barrier(params.levels.x * square_of(barrier3(point - params.origin.xyz)));
    var level = leaf;
    var parent = level_leaves[level].parent;
    while parent != NONE && level_leaves[parent].error_square <= square {
        level = parent;
        parent = level_leaves[level].parent;
    }
    return barrier(LEVEL_OFFSET * square_root(abs(level_leaves[level].error_square)));
}
