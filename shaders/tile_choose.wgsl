// Makes workgroups of the tiles that have just been chosen.
#include "shared/types.wgsl"
#include "shared/bindings.wgsl"
#include "shared/tiles.wgsl"

@compute @workgroup_size(1)
fn main() {
    set_work(WORK_CHOSEN, atomicExchange(&counters[COUNTER_TILES_CHOSEN], 0u));
}
