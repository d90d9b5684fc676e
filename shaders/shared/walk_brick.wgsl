// Traversal of one brick, the inner part of every intersection kernel's one flat loop.

const STACK_SIZE: u32 = 52u;   // MAX_BRICK_HEIGHT + MAX_TOP_HEIGHT and the entries that a change of tree leaves

// Visits node `index` of the brick: returns the mask of what the ray enters and the bases of its children.
fn visit_node(r: ptr<function, BrickRay>, index: u32, t_max: f32) -> vec3<u32> {
    let at = (*r).nodes + 5u * index;
    let page = (*r).page;
    let n1 = cache_vec4(page, at + 1u);
    let n0 = cache_vec4(page, at);
    let entered = node_hits((*r).box, n0, cache_vec4(page, at + 2u), cache_vec4(page, at + 3u), cache_vec4(page, at + 4u),
                            (*r).offset_high, (*r).offset_low, 0.0, t_max).mask;
    let bits = traversal_mask(entered, n1, (*r).box.flip);
    return vec3<u32>(n1.x, (bits & 0xff000000u) | (n0.w >> 24u), (bits & 0x00ffffffu));
}

// Index of the nearest inner child of a group (child base, priorities in the high byte | inner mask in the low byte).
fn nearest_child(group: vec2<u32>, flip: u32) -> vec2<u32> {
    let bit = firstLeadingBit(group.y);
    let slot = (31u - bit) ^ flip;
    return vec2<u32>(group.x + countOneBits(group.y & 0xffu & ((1u << slot) - 1u)), group.y & ~(1u << bit));
}

// A group whose one child is node 0: slot 0 is set by its priority, and no inner child lies below it.
fn root_group(flip: u32) -> vec2<u32> {
    return vec2<u32>(0u, 0x80000000u >> flip);
}
