//! Bytes of everything that is streamed.

use super::item::{Item, Kind};

/// Most tiles that one texture lookup reads: two levels, in each the tiles around a corner.
const TILES_OF_A_LOOKUP: usize = 8;

/// Bytes of everything that is streamed, as it is loaded.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sizes {
    /// Geometry and attributes of every brick.
    pub bricks: Vec<(u64, u64)>,
    /// Every tile.
    pub tiles: Vec<u64>,
}

impl Sizes {
    /// Bytes of an item; `None` if there is none such.
    pub fn of(&self, item: Item) -> Option<u64> {
        let number = item.number as usize;
        match item.kind {
            Kind::Geometry => self.bricks.get(number).map(|brick| brick.0),
            Kind::Attributes => self.bricks.get(number).map(|brick| brick.1),
            Kind::Tile => self.tiles.get(number).copied(),
        }
    }

    /// Every item with its bytes.
    pub fn items(&self) -> impl Iterator<Item = (Item, u64)> + '_ {
        let bricks = (0u32..).zip(&self.bricks);
        let bricks = bricks.flat_map(|(i, &(g, a))| [(Item::geometry(i), g), (Item::attributes(i), a)]);
        bricks.chain((0u32..).zip(&self.tiles).map(|(i, &bytes)| (Item::tile(i), bytes)))
    }

    /// Rows of a table over all items by [`Item::index`].
    pub fn rows(&self) -> usize {
        self.bricks.len().max(self.tiles.len()) * Kind::ALL.len()
    }

    /// The sum of all; saturates.
    pub fn sum(&self) -> u64 {
        self.items().fold(0, |sum, (_, bytes)| sum.saturating_add(bytes))
    }

    /// The largest of all.
    pub fn largest(&self) -> u64 {
        self.items().map(|(_, bytes)| bytes).max().unwrap_or(0)
    }

    /// The two largest bricks, geometry and attributes. Saturates.
    pub fn two_largest_bricks(&self) -> u64 {
        let (mut first, mut second) = (0u64, 0u64);
        for &(geometry, attributes) in &self.bricks {
            let brick = geometry.saturating_add(attributes);
            if brick > first {
                (first, second) = (brick, first);
            } else {
                second = second.max(brick);
            }
        }
        first.saturating_add(second)
    }

    /// What the tiles of any one texture lookup find room in, wherever those of them lie that are resident already:
    /// twice the largest that a lookup may read, since between two tiles that stay less than one may be lost.
    /// Saturates.
    pub fn tiles_of_a_lookup(&self) -> u64 {
        let mut largest = self.tiles.clone();
        largest.sort_unstable_by(|a, b| b.cmp(a));
        largest.iter().take(TILES_OF_A_LOOKUP).fold(0, |sum: u64, &tile| sum.saturating_add(tile)).saturating_mul(2)
    }
}

/// Bricks alone, without textures.
impl<T: AsRef<[(u64, u64)]> + ?Sized> From<&T> for Sizes {
    fn from(bricks: &T) -> Self {
        Self { bricks: bricks.as_ref().to_vec(), tiles: Vec::new() }
    }
}

impl From<&Sizes> for Sizes {
    fn from(sizes: &Sizes) -> Self {
        sizes.clone()
    }
}
