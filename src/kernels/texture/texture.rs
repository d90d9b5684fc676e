//! Lookups in textures that are cut into tiles: twin of `shaders/texture/texture.wgsl`.

use super::texels::Sampling;
use super::{bc5, bc7};
use crate::kernels::layout::{NONE, TEXTURE_BC5, TEXTURE_RGBA8, TEXTURE_SRGB, TILE_TEXELS, Texture};
use crate::kernels::vector::{mix, unpack4x8unorm};
use std::sync::LazyLock;

/// One level of a texture around a lookup.
#[derive(Clone, Copy, Debug, Default)]
pub struct Level {
    /// Columns of the texels to the left and to the right, wrapped.
    x: [u32; 2],
    /// Rows of those above and below.
    y: [u32; 2],
    /// Of the right and of the lower ones.
    share: [f32; 2],
    /// The level's first tile; [`NONE`] in the tail.
    first: u32,
    /// Of its tiles.
    columns: u32,
    /// Of the tail.
    page: u32,
    /// Of the level in that page, words.
    offset: u32,
    /// Texels in a row of the level in the tail.
    pitch: u32,
}

/// The levels of a lookup and how much of the coarser one it takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Levels {
    /// The finer one.
    pub finer: u32,
    /// 1 or 2.
    pub count: u32,
    /// Of the coarser one.
    pub share: f32,
}

/// log2(1 + x) for 0 <= x < 1, within 0.001.
fn log2_of_next(x: f32) -> f32 {
    x + x * (1.0 - x) * (0.4229 - 0.1592 * x)
}

/// Levels where a texel is as large as what a pixel covers.
pub fn levels_of(t: &Texture, footprint: f32) -> Levels {
    let texels = footprint * t.width as f32 * t.height as f32;
    if texels.is_nan() || texels <= 1.0 {
        return Levels { finer: 0, count: 1, share: 0.0 };
    }
    let bits = texels.to_bits();
    let exponent = (bits >> 23) - 127;
    let finer = exponent >> 1;
    if finer >= t.levels - 1 {
        return Levels { finer: t.levels - 1, count: 1, share: 0.0 };
    }
    let rest = f32::from_bits(bits & 0x007f_ffff | 0x3f80_0000) - 1.0;
    Levels { finer, count: 2, share: 0.5 * ((exponent & 1) as f32 + log2_of_next(rest)) }
}

fn wrap(x: i32, size: i32, mode: u32) -> u32 {
    let wrapped = match mode {
        bricks::WRAP_CLAMP => x.clamp(0, size - 1),
        bricks::WRAP_MIRROR => {
            let period = 2 * size;
            let m = x.rem_euclid(period);
            if m >= size { period - 1 - m } else { m }
        }
        _ => x.rem_euclid(size),
    };
    wrapped as u32
}

/// The texel before a coordinate and the share of the next one.
fn place(uv: f32, size: u32, mode: u32) -> (i32, f32) {
    // Whole turns are taken off first so that large coordinates keep their fraction; the bound keeps integers in range.
    let turned = if mode == bricks::WRAP_CLAMP { uv } else { uv - 2.0 * (0.5 * uv).floor() };
    let p = turned.clamp(-4.0, 4.0) * size as f32 - 0.5;
    let before = p.floor();
    (before as i32, p - before)
}

fn size_of(t: &Texture, number: u32) -> [u32; 2] {
    [t.width, t.height].map(|side| (side >> number).max(1))
}

/// A level around texture coordinates.
pub fn level_at(t: &Texture, number: u32, uv: [f32; 2]) -> Level {
    let size = size_of(t, number);
    let modes = [t.wrap & 0xffff, t.wrap >> 16];
    let [(x, right), (y, below)] = [0, 1].map(|k| place(uv[k], size[k], modes[k]));
    let mut level = Level {
        x: [x, x + 1].map(|x| wrap(x, size[0] as i32, modes[0])),
        y: [y, y + 1].map(|y| wrap(y, size[1] as i32, modes[1])),
        share: [right, below],
        first: NONE,
        ..Level::default()
    };
    if number < t.tail_level {
        let tiles = |l| size_of(t, l).map(|side| side.div_ceil(TILE_TEXELS));
        level.first = t.first_tile + (0..number).map(tiles).map(|[columns, rows]| columns * rows).sum::<u32>();
        level.columns = tiles(number)[0];
        return level;
    }
    level.page = t.tail_page;
    level.offset = t.tail_offset;
    for l in t.tail_level..number {
        let [width, height] = size_of(t, l).map(|side| side.next_multiple_of(4));
        level.offset += if t.encoding == TEXTURE_RGBA8 { width * height } else { width * height / 4 };
    }
    level.pitch = size[0].next_multiple_of(4);
    level
}

/// The tile of texel `k` of a level: left above, right above, left below, right below. [`NONE`] in the tail, and where
/// it is that of a texel before.
pub fn tile_at(level: &Level, k: usize) -> u32 {
    let [x, y] = [level.x, level.y].map(|sides| sides.map(|side| side / TILE_TEXELS));
    let is_again = (k & 1 == 1 && x[0] == x[1]) || (k & 2 == 2 && y[0] == y[1]);
    if level.first == NONE || is_again { NONE } else { level.first + y[k >> 1] * level.columns + x[k & 1] }
}

/// [`linear_from_srgb`] of the components of texels.
static LINEAR_OF_BYTES: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|byte| linear_from_srgb(byte as f32 / 255.0)));

fn linear_from_srgb(c: f32) -> f32 {
    if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// Texel `k` of a level, linear.
fn texel_at(t: &Texture, level: &Level, k: usize, from: Sampling) -> [f32; 4] {
    let (mut x, mut y) = (level.x[k & 1], level.y[k >> 1]);
    let (words, pitch) = if level.first != NONE {
        let tile = level.first + y / TILE_TEXELS * level.columns + x / TILE_TEXELS;
        (x, y) = (x % TILE_TEXELS, y % TILE_TEXELS);
        (from.tiles[tile as usize], TILE_TEXELS)
    } else {
        (&from.texels.tails[level.page as usize][level.offset as usize..], level.pitch)
    };
    let word = if t.encoding == TEXTURE_RGBA8 {
        words[(y * pitch + x) as usize]
    } else {
        let block = ((y / 4) * (pitch / 4) + x / 4) as usize;
        let four = &words[4 * block..4 * block + 4];
        let decode = if t.encoding == TEXTURE_BC5 { bc5::texel } else { bc7::texel };
        decode([four[0], four[1], four[2], four[3]], (x & 3) + 4 * (y & 3))
    };
    let mut color = unpack4x8unorm(word);
    if t.flags & TEXTURE_SRGB != 0 {
        let bytes = word.to_le_bytes();
        (0..3).for_each(|k| color[k] = LINEAR_OF_BYTES[bytes[k] as usize]);
    }
    color
}

/// Bilinear.
pub fn color_at(t: &Texture, level: &Level, from: Sampling) -> [f32; 4] {
    let four = [0, 1, 2, 3].map(|k| texel_at(t, level, k, from));
    let row = |a: usize| [0, 1, 2, 3].map(|k| mix(four[a][k], four[a + 1][k], level.share[0]));
    let (top, bottom) = (row(0), row(2));
    [0, 1, 2, 3].map(|k| mix(top[k], bottom[k], level.share[1]))
}
