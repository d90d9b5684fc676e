// Texels of BC5 blocks that hold directions, in integers: Khronos Data Format Specification 1.3, "RGTC Compressed
// Texture Image Formats". One texel is decoded at a time. Values between endpoints are rounded to the nearest integer.

// Red or green of texel `texel`; its half of the block starts at bit `at`.
fn bc5_channel(block: vec4<u32>, at: u32, texel: u32) -> u32 {
    let first = bc7_bits(block, at, 8u);
    let last = bc7_bits(block, at + 8u, 8u);
    let index = bc7_bits(block, at + 16u + 3u * texel, 3u);
    if index < 2u {
        return select(first, last, index == 1u);
    }
    if first > last {
        return ((8u - index) * first + (index - 1u) * last + 3u) / 7u;
    }
    if index > 5u {
        return select(0u, 255u, index == 7u);
    }
    return ((6u - index) * first + (index - 1u) * last + 2u) / 5u;
}

// 127.5 (1 + z) rounded to the nearest, halves up, for the z >= 0 of a unit vector with x and y of these bytes; 128
// where there is none. It is 128 + floor(sqrt(s) / 2), s = 255^2 - (2 red - 255)^2 - (2 green - 255)^2.
fn bc5_z(red: u32, green: u32) -> u32 {
    let x = 2i * i32(red) - 255i;
    let y = 2i * i32(green) - 255i;
    let q = u32(max(0i, 65025i - x * x - y * y)) / 4u;
    // Below 2^14, so that the estimate is off by 1 at most.
    var root = u32(sqrt(f32(max(q, 1u))));
    root -= u32(root * root > q);
    root += u32((root + 1u) * (root + 1u) <= q);
    return 128u + root;
}

// Texel `texel` = x + 4 y of a block, as the other encodings have directions: red in the lowest byte, then green, blue,
// alpha.
fn bc5_texel(block: vec4<u32>, texel: u32) -> u32 {
    let red = bc5_channel(block, 0u, texel);
    let green = bc5_channel(block, 64u, texel);
    return red | (green << 8u) | (bc5_z(red, green) << 16u) | 0xff000000u;
}
