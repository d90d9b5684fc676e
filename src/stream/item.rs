//! What is streamed and where it lies: items, slots.

use serde::{Deserialize, Serialize};
use std::fmt;

/// The kind of a streamed payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Kind {
    /// What traversal reads: nodes, vertices, ids, indices.
    Geometry,
    /// What shading of hits reads: normals, texture coordinates, colours, materials.
    Attributes,
    /// Texels of a tile of a texture.
    Tile,
}

impl Kind {
    /// Every kind, in the order in which a pass asks for them.
    pub const ALL: [Self; 3] = [Self::Geometry, Self::Attributes, Self::Tile];
}

/// One streamed payload: the unit that is loaded, placed and evicted. Serialised it is its short form.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Item {
    /// Number of the brick, or of the tile.
    pub number: u32,
    /// What of it.
    pub kind: Kind,
}

impl Item {
    /// The geometry of `brick`.
    pub const fn geometry(brick: u32) -> Self {
        Self { number: brick, kind: Kind::Geometry }
    }

    /// The attributes of `brick`.
    pub const fn attributes(brick: u32) -> Self {
        Self { number: brick, kind: Kind::Attributes }
    }

    /// The texels of tile `tile`.
    pub const fn tile(tile: u32) -> Self {
        Self { number: tile, kind: Kind::Tile }
    }

    /// Position in a table with a row for each number and kind, the kinds of a number together.
    pub const fn index(self) -> usize {
        self.number as usize * Kind::ALL.len() + self.kind as usize
    }

    /// The inverse of [`Self::index`]; `None` when no number is that large.
    pub fn from_index(index: usize) -> Option<Self> {
        let number = u32::try_from(index / Kind::ALL.len()).ok()?;
        Some(Self { number, kind: Kind::ALL[index % Kind::ALL.len()] })
    }

    /// The short form used in request traces: `g17`, `a17` or, of a tile, `t17`.
    pub fn code(self) -> String {
        match self.kind {
            Kind::Geometry => format!("g{}", self.number),
            Kind::Attributes => format!("a{}", self.number),
            Kind::Tile => format!("t{}", self.number),
        }
    }
}

impl From<Item> for String {
    fn from(item: Item) -> Self {
        item.code()
    }
}

/// Reads the short form written by [`Item::code`].
impl TryFrom<String> for Item {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let read = || {
            let (kind, digits) = text.split_at_checked(1)?;
            let kind = Kind::ALL["gat".find(kind)?];
            let are_digits = digits.bytes().all(|b| b.is_ascii_digit());
            digits.parse().ok().filter(|_| are_digits).map(|number| Self { number, kind })
        };
        read().ok_or_else(|| {
            format!("{text:?} is not an item: expected g or a and a brick number, or t and that of a tile, such as g17")
        })
    }
}

impl fmt::Display for Item {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.kind {
            Kind::Geometry => write!(f, "brick {} geometry", self.number),
            Kind::Attributes => write!(f, "brick {} attributes", self.number),
            Kind::Tile => write!(f, "tile {}", self.number),
        }
    }
}

/// Where an item lies in the device cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Slot {
    /// The page, an index into [`super::Residency::page_sizes`].
    pub page: u32,
    /// Bytes from the start of the page, a multiple of 16.
    pub offset: u32,
}
