// Sums of 64 bits over blocks of DVF_WALK elements, two a thread.

fn plus(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + u32(low < a.x));
}

// Element `i` of the level at hand; 0 behind its last.
fn element_of(i: u32) -> vec2<u32> {
    if i < own.count {
        return dvf_sums[own.first + i];
    }
    return vec2<u32>(0u);
}
