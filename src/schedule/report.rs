//! What comes back from round trips.

use crate::counters::Counters;

/// Counters that a secondary method has for itself.
pub const OWN_COUNTERS: usize = 8;

/// What rays still ask of a brick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Its number.
    pub brick: u32,
    /// Rays that enter a child box of its root at or before their hit.
    pub rays: u32,
    /// Distance at which the first of them enters, in device units.
    pub nearest: f32,
    /// Rays that enter it before any other that they ask for. Where there are some, the brick is needed: no closest hit
    /// of theirs lies before it.
    pub next: u32,
}

/// What texture lookups ask of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileDemand {
    /// Its number.
    pub tile: u32,
    /// Hits that wait for some tile, and need this one, resident or not.
    pub rays: u32,
    /// The least number of a ray among them; of none `u32::MAX`.
    pub first: u32,
    /// Whether a lookup that was carried out has read it.
    pub is_used: bool,
}

/// What came back from one round trip.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// What was counted. Round trips are 2 when the lists had to grow, else 1.
    pub counters: Counters,
    /// Bricks still wanted, ascending.
    pub demand: Vec<Demand>,
    /// Tiles that lookups read or ask for, ascending.
    pub tiles: Vec<TileDemand>,
    /// Resident bricks that a step of intersection entered: some ray met a child box of their root before its hit at
    /// that time. Ascending.
    pub used: Vec<u32>,
    /// Bricks that hold a final hit, after [`Step::QueryHits`](super::Step::QueryHits). Ascending.
    pub hit: Vec<u32>,
    /// Entries that the tiles' lists hold, or would hold.
    pub list_entries: u32,
    /// Most leaves that a tile selected to be intersected.
    pub most_selected: u32,
    /// Paths that go on, after [`Step::MovePaths`](super::Step::MovePaths) that has them come together.
    pub paths: u32,
    /// What kernels of a method counted for it, from its first counter on.
    pub own: [u64; OWN_COUNTERS],
    /// After [`Step::QueryStandIns`](super::Step::QueryStandIns) for each ray 0 where it has the hit that it has with
    /// everything resident, else 1, and 3 where nothing stands in for some brick that it would enter.
    pub states: Vec<u32>,
    /// Rays that see each node, after [`Step::QueryPairs`](super::Step::QueryPairs).
    pub pair_rays: Vec<u32>,
}

impl AsRef<Counters> for Report {
    fn as_ref(&self) -> &Counters {
        &self.counters
    }
}
