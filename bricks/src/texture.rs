//! How the levels of a texture lie in its payloads.
//!
//! A level with a side above [`TILE_TEXELS`] is cut into square *tiles* of that side, row by row, the levels one after
//! the other: each tile is a payload of its own ([`crate::Payload::Tile`]), read on demand. Tiles at the right and
//! lower edges go on with repetitions of the last column and row, so that every tile is whole. The levels that are left
//! are the *tail*, one payload ([`crate::Payload::Texture`]) that is meant to stay resident: whatever tiles are
//! missing, there is a coarsest answer.
//!
//! Texels of a tile, and of a level of the tail, lie on a grid of whole blocks of [`BLOCK_TEXELS`] each way:
//! [`crate::TEXTURE_RGBA8`] row by row, [`TEXTURE_BC7`] and [`TEXTURE_BC5`] block row by block row.

use crate::records::{TEXTURE_BC5, TEXTURE_BC7, Texture};

/// Side of a tile in texels.
pub const TILE_TEXELS: u32 = 128;

/// Side of a block in texels.
pub const BLOCK_TEXELS: u32 = 4;

/// Bytes of `width` by `height` texels, multiples of [`BLOCK_TEXELS`].
fn grid_bytes(encoding: u32, width: u32, height: u32) -> u64 {
    let texels = u64::from(width) * u64::from(height);
    if [TEXTURE_BC7, TEXTURE_BC5].contains(&encoding) { texels } else { 4 * texels }
}

/// Which part of its texture a tile is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TilePlace {
    /// The level.
    pub level: u32,
    /// Its column among the level's tiles.
    pub x: u32,
    /// Its row.
    pub y: u32,
}

impl Texture {
    /// Width and height of a level in texels.
    pub fn size(&self, level: u32) -> [u32; 2] {
        [self.width, self.height].map(|side| side.checked_shr(level).unwrap_or(0).max(1))
    }

    /// The first level of the tail.
    pub fn tail_level(&self) -> u32 {
        (0..self.levels).find(|&level| self.size(level).iter().all(|&side| side <= TILE_TEXELS)).unwrap_or(self.levels)
    }

    /// Columns and rows of tiles of a level.
    pub fn tiles_of(&self, level: u32) -> [u32; 2] {
        self.size(level).map(|side| side.div_ceil(TILE_TEXELS))
    }

    /// Number of tiles that the size implies.
    pub fn expected_tiles(&self) -> u64 {
        let tiles = |level| self.tiles_of(level).map(u64::from);
        (0..self.tail_level()).map(tiles).map(|[columns, rows]| columns * rows).sum()
    }

    /// The first of a level's tiles, counted from the texture's first.
    pub fn first_of_level(&self, level: u32) -> u32 {
        (0..level).map(|level| self.tiles_of(level)).map(|[columns, rows]| columns * rows).sum()
    }

    /// Where the tile is that is number `tile` of the texture, below [`Self::tile_count`].
    pub fn place_of(&self, tile: u32) -> TilePlace {
        let mut rest = tile;
        for level in 0..self.tail_level() {
            let [columns, rows] = self.tiles_of(level);
            let count = u64::from(columns) * u64::from(rows);
            if u64::from(rest) < count {
                return TilePlace { level, x: rest % columns, y: rest / columns };
            }
            rest -= count as u32;
        }
        TilePlace { level: self.tail_level(), x: 0, y: 0 }
    }

    /// Bytes of a tile.
    pub fn tile_bytes(&self) -> u64 {
        grid_bytes(self.encoding, TILE_TEXELS, TILE_TEXELS)
    }

    /// Bytes of the tail.
    pub fn tail_bytes(&self) -> u64 {
        self.tail_offset(self.levels)
    }

    /// Where a level of the tail starts in it.
    pub fn tail_offset(&self, level: u32) -> u64 {
        let padded = |level| self.size(level).map(|side| side.next_multiple_of(BLOCK_TEXELS));
        (self.tail_level()..level).map(padded).map(|[width, height]| grid_bytes(self.encoding, width, height)).sum()
    }

    /// The name of the encoding.
    pub fn encoding_name(&self) -> &'static str {
        match self.encoding {
            TEXTURE_BC7 => "bc7",
            TEXTURE_BC5 => "bc5",
            _ => "raw",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::records::TEXTURE_RGBA8;

    fn texture(width: u32, height: u32, encoding: u32) -> Texture {
        Texture { width, height, levels: width.max(height).ilog2() + 1, encoding, ..Texture::default() }
    }

    #[test]
    fn tiles_and_tails_of_some_sizes() {
        for (width, height, tail, tiles) in
            [(1, 1, 0, 0), (128, 128, 0, 0), (129, 5, 1, 2), (1024, 1024, 3, 64 + 16 + 4), (300, 700, 3, 18 + 6 + 2)]
        {
            let texture = texture(width, height, TEXTURE_BC7);
            assert_eq!((texture.tail_level(), texture.expected_tiles()), (tail, tiles), "{width} by {height}");
            assert_eq!(u64::from(texture.first_of_level(tail)), tiles);
            let mut number = 0;
            for level in 0..tail {
                let [columns, rows] = texture.tiles_of(level);
                for (y, x) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
                    assert_eq!(texture.place_of(number), TilePlace { level, x, y });
                    number += 1;
                }
            }
        }
        // Levels of 5 by 3, 2 by 1 and 1 by 1 on grids of 8 by 4 and twice 4 by 4.
        assert_eq!(texture(5, 3, TEXTURE_RGBA8).tail_bytes(), 4 * (32 + 16 + 16));
        assert_eq!(texture(5, 3, TEXTURE_BC7).tail_bytes(), 32 + 16 + 16);
        assert_eq!(texture(5, 3, TEXTURE_BC5).tail_bytes(), 32 + 16 + 16);
        let bytes = [TEXTURE_RGBA8, TEXTURE_BC7, TEXTURE_BC5].map(|encoding| texture(5, 3, encoding).tile_bytes());
        assert_eq!(bytes, [65536, 16384, 16384]);
    }
}
