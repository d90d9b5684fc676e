// Walks the binary top level for each tile, near child first, and lists the leaves its rays may meet. Run twice: first
// to count, as far as list_most and one more, then, after tile_scan has placed the lists, to WRITE them.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "query/tiles.wgsl"
#include "query/interval.wgsl"
#include "trace/levels.wgsl"

override WRITE: bool = false;

const WALK_STACK: u32 = 72u;

// One thread a tile.
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) global: vec3<u32>) {
    let tile = global.x;
    if tile >= params.tiles {
        return;
    }
    let bounds = tile_bounds[tile];
    var entry = tile_lists[tile];
    if WRITE && entry.count == 0u {
        return;
    }
    var stack: array<Entry, WALK_STACK>; // nodes here, with what the list notes of leaves
    var depth = 0u;
    var node = 0u;
    var near = 0.0;
    var found = 0u;
    var tested = 0u;
    var culled = 0u;
    if params.top_count > 0u {
        tested = 1u;
        let root = tile_meets_box(bounds, top2[0].min, top2[0].max, params.instance_pad);
        near = root.near;
        if root.hit {
            loop {
                let n = top2[node];
                if n.right == NONE {
                    if tile_may_take(bounds, n.left) {
                        if WRITE {
                            list[entry.first + found] = Entry(node, near);
                            pair_demand_clear(entry.first + found);
                        }
                        found += 1u;
                        if !WRITE && found > params.list_most {
                            break;
                        }
                    }
                } else {
                    var l = tile_meets_box(bounds, top2[n.left].min, top2[n.left].max, params.instance_pad);
                    var r = tile_meets_box(bounds, top2[n.right].min, top2[n.right].max, params.instance_pad);
                    l.hit = l.hit && !tile_is_stood_for(bounds, n.left);
                    r.hit = r.hit && !tile_is_stood_for(bounds, n.right);
                    tested += 2u;
                    culled += u32(!l.hit) + u32(!r.hit);
                    if l.hit && r.hit {
                        // Nearer first; when both hold the tile's origins, the one whose box centre is nearer.
                        let swap = r.near < l.near || (r.near == l.near
                            && centre_distance(bounds, n.right) < centre_distance(bounds, n.left));
                        if depth == WALK_STACK {
                            atomicAdd(&counters[COUNTER_STACK_OVERFLOW], 1u);
                            break;
                        }
                        stack[depth] = Entry(select(n.right, n.left, swap), select(r.near, l.near, swap));
                        depth += 1u;
                        node = select(n.left, n.right, swap);
                        near = select(l.near, r.near, swap);
                        continue;
                    }
                    if l.hit || r.hit {
                        node = select(n.right, n.left, l.hit);
                        near = select(r.near, l.near, l.hit);
                        continue;
                    }
                }
                if depth == 0u {
                    break;
                }
                depth -= 1u;
                node = stack[depth].node;
                near = stack[depth].near;
            }
        } else {
            culled = 1u;
        }
    }
    if !WRITE {
        tile_lists[tile].count = found;
        atomicAdd(&counters[COUNTER_PAIRS_TESTED], tested);
        atomicAdd(&counters[COUNTER_PAIRS_CULLED], culled);
    }
}

fn pair_demand_clear(entry: u32) {
    atomicStore(&pair_demand[entry].rays, 0u);
    atomicStore(&pair_demand[entry].nearest, 0xffffffffu);
}

// Distance of a node's centre along the tile's middle direction.
fn centre_distance(bounds: TileBounds, node: u32) -> f32 {
    let centre = 0.5 * (top2[node].min + top2[node].max) - 0.5 * (bounds.origin_min + bounds.origin_max);
    return dot(centre, bounds.direction_min + bounds.direction_max);
}
