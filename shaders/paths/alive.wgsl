// Which rays of a block of 8 x 8 go on, and where the blocks' counts lie.

var<workgroup> alive: array<atomic<u32>, 2>;

// Number of blocks, those of tiles at the border that lie outside among them.
fn blocks() -> u32 {
    return params.tiles * blocks_of_tile();
}

// Where a block's count lies among the origins.
fn first_of_block(block: u32) -> u32 {
    return params.width * params.height + block;
}

// Notes whether the ray of a thread goes on. A barrier must follow.
fn note_alive(index: u32, lane: u32) {
    if index != NONE {
        if rays[index].t_min <= rays[index].t_max {
            atomicOr(&alive[lane / 32u], 1u << (lane % 32u));
        }
    }
}

// How many of the first `lanes` rays of the block go on.
fn alive_before(lanes: u32) -> u32 {
    let low = atomicLoad(&alive[0]);
    let high = atomicLoad(&alive[1]);
    if lanes >= 64u {
        return countOneBits(low) + countOneBits(high);
    }
    let mask = (1u << (lanes % 32u)) - 1u;
    if lanes >= 32u {
        return countOneBits(low) + countOneBits(high & mask);
    }
    return countOneBits(low & mask);
}
