// Bindings of group 3 for the kernels that work on tiles: their bounds and their lists of leaves.
#include "texture/blocks.wgsl"

@group(3) @binding(0) var<storage, read_write> tile_bounds: array<TileBounds>;
@group(3) @binding(1) var<storage, read_write> tile_lists: array<TileList>;
@group(3) @binding(2) var<storage, read_write> list: array<Entry>;              // leaves per tile, near first
@group(3) @binding(3) var<storage, read_write> selection: array<u32>;           // positions in `list`, per tile
@group(3) @binding(4) var<storage, read_write> pair_demand: array<PairDemand>;  // per position in `list`
@group(3) @binding(5) var<storage, read> pairs: array<Pair>;                    // queries of pairs
// Rays that see each of their nodes, or each leaf from each tile.
@group(3) @binding(6) var<storage, read_write> pair_rays: array<atomic<u32>>;
@group(3) @binding(7) var<storage, read> pair_nodes: array<u32>;                // their nodes

// Of a tile and a leaf, the place of their count in pair_rays.
fn place_of_pair(tile: u32, leaf: u32) -> u32 {
    return tile * arrayLength(&leaves) + leaf;
}

// Whether too few rays of a tile see a leaf.
fn is_culled(tile: u32, leaf: u32) -> bool {
    if (params.flags & PARAM_CULLED) == 0u {
        return false;
    }
    return atomicLoad(&pair_rays[place_of_pair(tile, leaf)]) <= params.threshold;
}

const MOST_WORKGROUPS: u32 = 65535u; // in one dimension

// What a workgroup has to do of the work that begins at counter `work`: over chosen tiles alone.
fn work_of(work: u32, workgroup: u32) -> Work {
    if workgroup >= atomicLoad(&counters[work + 3u]) {
        return Work(NONE, vec2<u32>(0u));
    }
    let place = workgroup / blocks_of_tile();
    return block_of_tile(select(tile_lists[place].rooted, tile_lists[place].chosen, work == WORK_CHOSEN), workgroup);
}

// The same over the tiles whose rays walk from the root, or over all tiles.
fn rooted_or_all(rooted: bool, workgroup: u32) -> Work {
    if rooted {
        return work_of(WORK_ROOTED, workgroup);
    }
    return work_of_all(workgroup);
}

// Sets the workgroups of the work that begins at counter `work`: over so many tiles.
fn set_work(work: u32, tiles_with_work: u32) {
    let workgroups = tiles_with_work * blocks_of_tile();
    let x = min(workgroups, MOST_WORKGROUPS);
    atomicStore(&counters[work], x);
    atomicStore(&counters[work + 1u], (workgroups + max(x, 1u) - 1u) / max(x, 1u));
    atomicStore(&counters[work + 2u], 1u);
    atomicStore(&counters[work + 3u], workgroups);
}
