// Bindings of group 3 for the kernels that work on tiles: their bounds and their lists of leaves.

@group(3) @binding(0) var<storage, read_write> tile_bounds: array<TileBounds>;
@group(3) @binding(1) var<storage, read_write> tile_lists: array<TileList>;
@group(3) @binding(2) var<storage, read_write> list: array<Entry>;              // leaves per tile, near first
@group(3) @binding(3) var<storage, read_write> selection: array<u32>;           // positions in `list`, per tile
@group(3) @binding(4) var<storage, read_write> pair_demand: array<PairDemand>;  // per position in `list`
@group(3) @binding(5) var<storage, read> pairs: array<Pair>;                    // queries of pairs
@group(3) @binding(6) var<storage, read_write> pair_rays: array<u32>;           // rays that see each of their nodes
@group(3) @binding(7) var<storage, read> pair_nodes: array<u32>;                // their nodes

struct PairDemand {
    rays: atomic<u32>,
    nearest: atomic<u32>,
}
