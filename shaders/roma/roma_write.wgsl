// What rays through ray-aligned occupancy maps meet, and how many they answer.

// Writes what a ray meets. Where the closest is asked for, with the point, against the direction travelled as its
// normal, and the level's lift as its area: such a hit is known to a cell.
fn write(index: u32, found: Answer) {
    if found.t < 0.0 {
        return;
    }
    hits[index] = Hit(found.t, MET, 0.0, 0.0);
    if (params.flags & PARAM_ANY_HIT) == 0u {
        surfaces[index].point = found.point;
        surfaces[index].normal = -found.direction;
        surfaces[index].area = found.lift;
    }
}

var<workgroup> counted: atomic<u32>; // rays answered, and in the upper half those that were capped

fn count(is_answered: bool, is_capped: bool) {
    atomicAdd(&counted, select(0u, 1u, is_answered) + select(0u, 65536u, is_capped));
}

// Adds the workgroup's to the counters. All threads call it, at their end.
fn sum_up(lane: u32) {
    workgroupBarrier();
    if lane == 0u {
        let sum = atomicLoad(&counted);
        atomicAdd(&counters[COUNTER_RAYS_ANSWERED], sum & 0xffffu);
        atomicAdd(&counters[COUNTER_RAYS_CAPPED], sum >> 16u);
    }
}
