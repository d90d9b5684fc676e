//! Where payloads come from.

use bricks::{Payload, SceneFile};

use super::item::{Item, Kind};
use super::sizes::Sizes;

/// Why a payload could not be had: a corrupt, truncated or unreadable brick. The text names the item, what was found
/// and what was expected.
pub type SourceError = Box<dyn std::error::Error + Send + Sync>;

/// A scene file as the workers see it. Only they call [`Self::copy`].
pub trait PayloadSource: Send + Sync + 'static {
    /// Number of bricks.
    fn brick_count(&self) -> u32;

    /// Number of tiles of textures.
    fn tile_count(&self) -> u32 {
        0
    }

    /// Whether there is such an item.
    fn has(&self, item: Item) -> bool {
        item.number < if item.kind == Kind::Tile { self.tile_count() } else { self.brick_count() }
    }

    /// Length of a payload as it is loaded in bytes, a multiple of 16, from the always-resident part: touches no
    /// payload. There is such an item. The source may hold fewer bytes, from which it decodes the payload.
    fn bytes(&self, item: Item) -> u64;

    /// Loads a payload into `out`, [`Self::bytes`] long, and verifies *the copy*: after `Ok` it can be indexed freely.
    /// After an error the contents of `out` are unspecified.
    ///
    /// # Errors
    /// The payload is corrupt or cannot be read.
    fn copy(&self, item: Item, out: &mut [u8]) -> Result<(), SourceError>;

    /// Says that these items will be copied next, each once: what comes from far away is fetched together.
    fn announce(&self, _items: &[Item]) {}

    /// Most bytes of items to announce at a time, unless one is longer; `None`: announcing has no effect.
    fn announced_bytes(&self) -> Option<u64> {
        None
    }

    /// Bytes of everything, as [`super::Residency::new`] wants them.
    fn sizes(&self) -> Sizes {
        let brick = |brick| (self.bytes(Item::geometry(brick)), self.bytes(Item::attributes(brick)));
        Sizes {
            bricks: (0..self.brick_count()).map(brick).collect(),
            tiles: (0..self.tile_count()).map(|tile| self.bytes(Item::tile(tile))).collect(),
        }
    }
}

impl From<Item> for Payload {
    fn from(item: Item) -> Self {
        match item.kind {
            Kind::Geometry => Payload::Geometry(item.number),
            Kind::Attributes => Payload::Attributes(item.number),
            Kind::Tile => Payload::Tile(item.number),
        }
    }
}

impl PayloadSource for SceneFile {
    fn brick_count(&self) -> u32 {
        // The format numbers bricks by u32; opening checked it.
        self.resident().bricks.len() as u32
    }

    fn tile_count(&self) -> u32 {
        self.resident().tiles.len() as u32
    }

    fn bytes(&self, item: Item) -> u64 {
        self.loaded_bytes(item.into())
    }

    fn copy(&self, item: Item, out: &mut [u8]) -> Result<(), SourceError> {
        Ok(SceneFile::copy(self, item.into(), out)?)
    }

    fn announce(&self, items: &[Item]) {
        SceneFile::announce(self, items.iter().map(|&item| item.into()));
    }

    fn announced_bytes(&self) -> Option<u64> {
        SceneFile::announced_bytes(self)
    }
}
