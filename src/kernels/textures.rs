//! What an executor is told of textures, and what their tiles' demand says.

use super::layout;
use crate::schedule::{BrickStates, TileDemand};

/// The record of a texture whose tail lies at word `offset` of page `page`.
pub fn record(texture: &bricks::Texture, page: u32, offset: u32) -> layout::Texture {
    layout::Texture {
        width: texture.width,
        height: texture.height,
        levels: texture.levels,
        wrap: texture.wrap,
        encoding: texture.encoding,
        flags: texture.flags,
        first_tile: texture.first_tile,
        tail_level: texture.tail_level(),
        tail_page: page,
        tail_offset: offset,
        ..Default::default()
    }
}

/// Where every tile lies.
pub fn slots(bricks: &BrickStates) -> Vec<layout::TileSlot> {
    let nowhere = layout::TileSlot { page: layout::NONE, offset: 0 };
    let slot = |slot: &Option<crate::stream::Slot>| {
        slot.map_or(nowhere, |slot| layout::TileSlot { page: slot.page, offset: slot.offset / 16 })
    };
    bricks.tiles().iter().map(slot).collect()
}

/// Of a tile that nothing asks for.
pub const UNASKED: layout::TileDemand = layout::TileDemand { rays: 0, first: u32::MAX, used: 0 };

/// The demand of tiles that something is asked of.
pub fn demand(all: &[layout::TileDemand]) -> Vec<TileDemand> {
    let asked = (0u32..).zip(all).filter(|(_, d)| d.rays > 0 || d.used > 0);
    asked.map(|(tile, d)| TileDemand { tile, rays: d.rays, first: d.first, is_used: d.used > 0 }).collect()
}
