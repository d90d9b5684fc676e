//! Up to where rays that occupancy maps do not find free are traced: as far as measured errors ask for.

use super::{Pilots, Role};
use crate::kernels::layout::HANDOVERS;
use serde_json::{Value, json};
use std::fmt::{Display, Formatter};

/// One ray in so many is traced to its end, to measure by.
pub const PILOTS: u32 = 16;
/// From so many on all counts are halved, so that what was seen long ago fades.
const MOST: u64 = 1 << 14;

/// What maps are trusted with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trust {
    /// With what is so many cells of a map away from where rays start, and to find rays free.
    Beyond(u32),
    /// To find rays free.
    Free,
    /// With nothing: all rays are traced.
    Nothing,
}

impl Trust {
    /// Every one of them, the furthest first.
    pub fn all() -> impl Iterator<Item = Self> {
        let beyond = (0..HANDOVERS).map(|i| Self::Beyond(if i == 0 { 0 } else { 1 << i }));
        beyond.chain([Self::Free, Self::Nothing])
    }
}

impl Display for Trust {
    fn fmt(&self, f: &mut Formatter) -> std::fmt::Result {
        match self {
            Self::Beyond(cells) => write!(f, "beyond {cells} cells"),
            Self::Free => f.write_str("rays found free"),
            Self::Nothing => f.write_str("nothing"),
        }
    }
}

/// What was measured of the rays of a kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Handover {
    seen: Pilots,
}

impl Handover {
    /// What was measured of rays of a role that maps sift: shares of all, 0 to 1, that would be answered otherwise than
    /// exact ones, by how far rays in doubt are traced.
    pub fn report(&self, role: Role) -> Option<Value> {
        let Role::Sift { most_wrong: Some(most_wrong) } = role else { return None };
        let ways = Trust::all().map(|trust| json!({ "trust": trust.to_string(), "wrong": self.share_wrong(trust) }));
        Some(json!({
            "pilots": self.pilots(),
            "trust": self.trust(most_wrong).to_string(),
            "measured": ways.collect::<Vec<_>>(),
        }))
    }

    /// Adds what the pilots of a pass showed.
    pub fn note(&mut self, pilots: Pilots) {
        self.seen.add(pilots);
        if self.seen.rays >= MOST {
            self.seen.rays /= 2;
            self.seen.missed /= 2;
            self.seen.doubted = self.seen.doubted.map(|count| count / 2);
        }
    }

    /// What maps may answer so that of a million rays at most so many are answered otherwise than exact ones, to about
    /// 95 %: wrong ones come by chance (Poisson), and where none was seen there may be three. So nothing, until enough
    /// is measured.
    pub fn trust(&self, most_wrong: u32) -> Trust {
        let is_allowed = |wrong: u64| {
            let wrong = wrong as f64;
            (wrong + 2.0 * wrong.sqrt() + 3.0) * 1e6 <= f64::from(most_wrong) * self.seen.rays as f64
        };
        Trust::all().find(|&trust| is_allowed(self.wrong(trust))).unwrap_or(Trust::Nothing)
    }

    /// Share of rays, 0 to 1, that are answered otherwise than exact ones when maps are trusted so far.
    pub fn share_wrong(&self, trust: Trust) -> f64 {
        self.wrong(trust) as f64 / self.seen.rays.max(1) as f64
    }

    /// Rays that it was measured by.
    pub fn pilots(&self) -> u64 {
        self.seen.rays
    }

    fn wrong(&self, trust: Trust) -> u64 {
        match trust {
            Trust::Beyond(cells) => self.seen.missed + self.seen.doubted[cells.max(1).ilog2() as usize],
            Trust::Free => self.seen.missed,
            Trust::Nothing => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEEN: Pilots = Pilots { rays: 1000, missed: 2, doubted: [300, 100, 40, 10, 4, 0] };

    #[test]
    fn the_nearest_handover_that_keeps_the_bound_is_taken() {
        let mut handover = Handover::default();
        assert_eq!(handover.trust(1_000_000), Trust::Nothing, "nothing is measured");
        handover.note(SEEN);
        for (most_wrong, expected) in [
            (1_000_000, Trust::Beyond(0)),
            (340_000, Trust::Beyond(0)),
            (300_000, Trust::Beyond(2)),
            (102_000, Trust::Beyond(4)),
            (22_000, Trust::Beyond(8)),
            (14_000, Trust::Beyond(16)),
            (8_000, Trust::Beyond(32)),
            (7_000, Trust::Nothing),
        ] {
            assert_eq!(handover.trust(most_wrong), expected, "{most_wrong} of a million");
        }
        assert_eq!(handover.share_wrong(Trust::Beyond(8)), 0.012);
        assert_eq!(handover.share_wrong(Trust::Beyond(0)), 0.302);
        assert_eq!(handover.share_wrong(Trust::Nothing), 0.0);
        let doubted = Pilots { doubted: [300; 6], ..SEEN };
        let mut handover = Handover::default();
        handover.note(doubted);
        assert_eq!(handover.trust(8_000), Trust::Free, "what is found free may be");
    }

    #[test]
    fn what_was_seen_long_ago_fades() {
        let mut handover = Handover::default();
        handover.note(Pilots { rays: 20_000, missed: 20_000, doubted: [0; 6] });
        (0..20).for_each(|_| handover.note(Pilots { rays: 8_000, ..Pilots::default() }));
        assert_eq!(handover.trust(1_000), Trust::Beyond(0));
    }
}
