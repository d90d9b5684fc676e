//! Texels of BC5 blocks that hold directions, in integers: twin of `shaders/texture/bc5.wgsl` (Khronos Data Format
//! Specification 1.3, "RGTC Compressed Texture Image Formats"). Values between endpoints are rounded to the nearest
//! integer.

use super::bc7::bits;

/// Red or green of texel `texel`; its half of the block starts at bit `at`.
fn channel(block: u128, at: u32, texel: u32) -> u32 {
    let [first, last] = [at, at + 8].map(|at| bits(block, at, 8));
    match bits(block, at + 16 + 3 * texel, 3) {
        0 => first,
        1 => last,
        index if first > last => ((8 - index) * first + (index - 1) * last + 3) / 7,
        6 => 0,
        7 => 255,
        index => ((6 - index) * first + (index - 1) * last + 2) / 5,
    }
}

/// 127.5 (1 + z) rounded to the nearest, halves up, for the z >= 0 of a unit vector with x and y of these bytes; 128
/// where there is none. It is 128 + floor(sqrt(s) / 2), s = 255² - (2 red - 255)² - (2 green - 255)².
fn z(red: u32, green: u32) -> u32 {
    let [x, y] = [red, green].map(|byte| 2 * byte as i32 - 255);
    128 + ((65_025 - x * x - y * y).max(0) as u32 / 4).isqrt()
}

/// Texel `texel` = x + 4 y of a block, as the other encodings have directions: red in the lowest byte, then green,
/// blue, alpha.
pub fn texel(block: [u32; 4], texel: u32) -> u32 {
    let block = block.iter().rev().fold(0, |all, &word| all << 32 | u128::from(word));
    let (red, green) = (channel(block, 0, texel), channel(block, 64, texel));
    red | green << 8 | z(red, green) << 16 | 0xff00_0000
}
