//! The optimisations of CHC+RT, each of which can be switched off by itself. They change what is asked, loaded
//! and intersected when, never a hit.

use crate::settings::names;

/// What an optimisation is a part of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartOf {
    /// Loading missing bricks: the schedules `chc` and `demand`.
    Loading,
    /// Lists of leaves per tile: the schedule `chc`.
    Lists,
    /// The temporal fronts of `chc`.
    Fronts,
}

macro_rules! optimisations {
    ($($(#[doc = $doc:literal])* $variant:ident, $field:ident = $name:literal, $part:ident;)*) => {
        names! {
            /// One of the optimisations.
            Optimisation { $($(#[doc = $doc])* $variant = $name,)* }
        }

        /// Which optimisations are on.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct Optimisations { $($(#[doc = $doc])* pub $field: bool,)* }

        impl Default for Optimisations {
            fn default() -> Self {
                Self { $($field: true,)* }
            }
        }

        impl Optimisation {
            /// What it is a part of.
            pub fn part_of(self) -> PartOf {
                match self { $(Self::$variant => PartOf::$part,)* }
            }
        }

        impl Optimisations {
            /// Switches one.
            pub fn set(&mut self, which: Optimisation, on: bool) {
                match which { $(Optimisation::$variant => self.$field = on,)* }
            }

            /// Whether one is on.
            pub fn get(&self, which: Optimisation) -> bool {
                match which { $(Optimisation::$variant => self.$field,)* }
            }
        }
    };
}

optimisations! {
    /// Wanted bricks are taken nearest entry first; else in the order of their numbers (design of the load order).
    NearestFirst, nearest_first = "nearest-first", Loading;
    /// Between two batches of loads everything not loaded yet is asked for again; else what the first query wanted is
    /// loaded whole.
    Requery, requery = "requery", Loading;
    /// What is resident is intersected before missing bricks are asked for (CHC+RT §5.4); else all wanted bricks are
    /// taken in one order, resident ones without a load.
    ResidentFirst, resident_first = "resident-first", Loading;
    /// The leaves of a tile are intersected near to far (CHC+RT §5.2); else by number.
    FrontToBack, front_to_back = "front-to-back", Lists;
    /// A dispatch intersects all selected leaves of a tile (CHC+RT §5.2, which stops at 24); else one leaf a tile.
    ByTile, by_tile = "by-tile", Lists;
    /// The rays of a tile whose list is long walk from the root instead, each by itself; else by the list whatever its
    /// length. In force with `by-tile` and `front-to-back`.
    RootWalk, root_walk = "root-walk", Lists;
    /// Invisible pairs of a tile that will probably stay so are asked for together (CHC+RT §5.1); else each by itself.
    MultiQueries, multi_queries = "multi-queries", Fronts;
    /// A node is asked for by the boxes of its children (CHC+RT §5.1); else by its own.
    TighterBounds, tighter_bounds = "tighter-bounds", Fronts;
    /// Visible pairs are asked for again every third frame (CHC+RT §5.1); else in every frame.
    LazyRequery, lazy_requery = "lazy-requery", Fronts;
    /// Pairs whose children are all invisible become leaves, one level a frame (CHC+RT §5.1); else what was split stays
    /// so.
    PullUp, pull_up = "pull-up", Fronts;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_those_of_the_variants() {
        for (i, &which) in Optimisation::ALL.iter().enumerate() {
            assert_eq!(which as usize, i);
            let mut some = Optimisations::default();
            let on = some.get(which);
            some.set(which, !on);
            assert_eq!(some.get(which), !on, "{}", which.name());
            some.set(which, on);
            assert_eq!(some, Optimisations::default());
        }
    }
}
