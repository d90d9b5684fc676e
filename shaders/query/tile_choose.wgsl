// Makes workgroups of the tiles that have just been chosen.
#include "common/types.wgsl"
#include "common/bindings.wgsl"
#include "query/tiles.wgsl"

@compute @workgroup_size(1)
fn main() {
    set_work(WORK_CHOSEN, atomicExchange(&counters[COUNTER_TILES_CHOSEN], 0u));
}
