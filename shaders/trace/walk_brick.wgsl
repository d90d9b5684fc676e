// Traversal of one brick, the inner part of every intersection kernel's loop.
//
// A group is a node's entered inner children, still to be visited: the base of its children, and a word of priorities
// in the high byte (the highest is nearest) and the mask of inner slots in the low byte.

override COUNT: bool = false;  // count nodes and triangles visited

const STACK_SIZE: u32 = 52u;   // MAX_BRICK_HEIGHT + MAX_TOP_HEIGHT and the entries that a change of tree leaves

var<private> nodes_visited: u32;
var<private> triangles_tested: u32;

// What a ray meets of a node: the group of the inner children that it enters, and triangles: the first of the node's,
// and bits from there on.
struct OpenedNode {
    children: vec2<u32>,
    triangles: vec2<u32>,
}

// Notes that a ray enters a child box of the brick's root: what a resident brick's demand says (the host knows which
// are). Most rays find it noted, and only read.
fn note_use(leaf: u32) {
    let brick = leaves[leaf].brick;
    if atomicLoad(&demand[brick].rays) == 0u {
        atomicStore(&demand[brick].rays, 1u);
    }
}

fn open_node(r: ptr<function, BrickRay>, t_max: f32, index: u32) -> OpenedNode {
    let at = (*r).nodes + 5u * index;
    let page = (*r).page;
    let n1 = cache_vec4(page, at + 1u);
    let n0 = cache_vec4(page, at);
    let entered = node_hits((*r).ray, n0, cache_vec4(page, at + 2u), cache_vec4(page, at + 3u),
                            cache_vec4(page, at + 4u), (*r).offset_high, (*r).offset_low, 0.0, t_max).mask;
    let mask = traversal_mask(entered, n1, (*r).ray.flip);
    nodes_visited += 1u;
    if index == 0u && mask != 0u {
        note_use((*r).leaf);
    }
    return OpenedNode(vec2<u32>(n1.x, (mask & 0xff000000u) | (n0.w >> 24u)), vec2<u32>(n1.y, mask & 0x00ffffffu));
}

// Tests a group of triangles. With `any_hit` the first one accepted ends it.
fn test_triangles(r: ptr<function, BrickRay>, best: ptr<function, Best>, group: vec2<u32>, any_hit: bool) {
    var triangles = group.y;
    triangles_tested += countOneBits(triangles);
    while triangles != 0u {
        let bit = firstTrailingBit(triangles);
        triangles &= triangles - 1u;
        if test_triangle(r, best, group.x + bit) && any_hit {
            break;
        }
    }
}

// Whether a group holds children to be visited.
fn has_children(group: vec2<u32>) -> bool {
    return group.y > 0x00ffffffu;
}

// Slot of the nearest child of a group, and the group without it.
struct NearestChild {
    slot: u32,
    rest: vec2<u32>,
}

fn nearest_child(group: vec2<u32>, flip: u32) -> NearestChild {
    let bit = firstLeadingBit(group.y);
    return NearestChild((31u - bit) ^ flip, vec2<u32>(group.x, group.y & ~(1u << bit)));
}

// Node index of the inner child in `slot`: children lie in the order of their slots.
fn child_index(group: vec2<u32>, slot: u32) -> u32 {
    return group.x + countOneBits(group.y & 0xffu & ((1u << slot) - 1u));
}

// A group whose one child is node 0: slot 0 is set by its priority, and no inner child lies below it.
fn root_group(flip: u32) -> vec2<u32> {
    return vec2<u32>(0u, 0x80000000u >> flip);
}

// Writes what the walk found, if it found something nearer than was known.
fn finish_walk(r: ptr<function, BrickRay>, world: FramedRay, best: Best, ray: u32) {
    if best.leaf != NONE {
        if (params.flags & PARAM_ANY_HIT) != 0u {
            write_occluder(best, ray);
        } else {
            enter_leaf(r, world, best.leaf);
            enter_brick(r, leaves[best.leaf].brick);
            write_hit(r, best, world.direction, ray);
        }
    }
    if COUNT {
        atomicAdd(&counters[COUNTER_NODES], nodes_visited);
        atomicAdd(&counters[COUNTER_TRIANGLES], triangles_tested);
    }
}
