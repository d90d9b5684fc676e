// Sorts each tile's list of leaves: by number, or, from a list of leaf nodes of the binary top level, near to far.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "query/tiles.wgsl"
#include "query/interval.wgsl"

override NEAR: bool = false;

// One thread a tile, by insertion: lists are short.
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    let tile = global.x;
    if tile >= params.tiles {
        return;
    }
    let bounds = tile_bounds[tile];
    let entry = tile_lists[tile];
    // Until the first query an entry's demand has room for its key.
    for (var i = entry.first; i < entry.first + entry.count; i++) {
        var listed = list[i];
        let node = listed.node;
        let leaf = top2[node].left;
        var key = leaf;
        if NEAR {
            listed.near = tile_meets_box(bounds, top2[node].min, top2[node].max, params.instance_pad).near;
            key = bitcast<u32>(distance_to(bounds, node, listed.near));
        }
        var at = i;
        while at > entry.first {
            let before = atomicLoad(&pair_demand[at - 1u].nearest);
            if before < key || (before == key && top2[list[at - 1u].node].left < leaf) {
                break;
            }
            list[at] = list[at - 1u];
            atomicStore(&pair_demand[at].nearest, before);
            at -= 1u;
        }
        list[at] = listed;
        atomicStore(&pair_demand[at].nearest, key);
    }
    for (var i = entry.first; i < entry.first + entry.count; i++) {
        atomicStore(&pair_demand[i].nearest, 0xffffffffu);
    }
}

// No ray of the tile enters the node's box before this distance; not negative, so that its bits are in its order. Among
// boxes that hold the tile's origins the one whose centre is nearer along the tile's middle direction comes first:
// their distances are below any other's.
fn distance_to(bounds: TileBounds, node: u32, near: f32) -> f32 {
    let centre = 0.5 * (top2[node].min + top2[node].max) - 0.5 * (bounds.origin_min + bounds.origin_max);
    let along = dot(centre, bounds.direction_min + bounds.direction_max);
    return select(near, 1.0e-30 * max(along, 0.0), near <= max(bounds.t_min, 0.0));
}
