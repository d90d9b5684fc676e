//! Options that switch single optimisations.

use super::args::{Schedule, StreamArgs};
use super::named::unknown;
use crate::cli::Usage;
use crate::schedule::{Optimisation, Optimisations, PartOf};
use clap::Args;

/// Options that switch optimisations.
#[derive(Clone, Debug, Args)]
pub struct OptimisationArgs {
    /// Optimisations to switch off, separated by commas, to measure what each is worth; pictures are the same.
    /// Of loading (schedules chc and demand): nearest-first (off: bricks are loaded in the order of their numbers),
    /// requery (off: what the first query wanted is loaded whole, without a fresh query between batches),
    /// resident-first (off: bricks on the device are not intersected before missing ones are asked for, all wanted
    /// bricks are taken nearest first). Of lists (chc): front-to-back (off: a tile's leaves are intersected by number),
    /// by-tile (off: a dispatch intersects one leaf a tile, not all), root-walk (off: a tile has a list however long;
    /// on, the rays of tiles with long lists walk from the root). Of --fronts on:
    /// multi-queries (off: every invisible pair is asked for by itself), tighter-bounds (off: a node is asked for by
    /// its own box, not its children's), lazy-requery (off: visible pairs are asked for again in every frame, not every
    /// third), pull-up (off: pairs stay split where all is invisible) [default: none]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = optimisation)]
    pub without: Vec<Optimisation>,
}

impl OptimisationArgs {
    /// The optimisations that are on.
    pub fn optimisations(&self) -> Optimisations {
        let mut on = Optimisations::default();
        self.without.iter().for_each(|&which| on.set(which, false));
        on
    }

    /// Refuses names that mean nothing with the schedule in `stream`.
    ///
    /// # Errors
    /// Which name, and what it belongs to.
    pub fn check(&self, stream: &StreamArgs) -> Result<(), Usage> {
        let chc = matches!(stream.schedule, Schedule::Chc | Schedule::Auto);
        for which in &self.without {
            let (has_meaning, belongs) = match which.part_of() {
                PartOf::Loading => (
                    !matches!(stream.schedule, Schedule::Plain | Schedule::PlainBvh2),
                    "--schedule chc, demand or auto",
                ),
                PartOf::Lists => (chc, "--schedule chc or auto"),
                PartOf::Fronts => (chc && stream.fronts == "on", "--fronts on (schedule chc)"),
            };
            if !has_meaning {
                return Err(Usage(format!("--without {}: it belongs to {belongs}", which.name())));
            }
        }
        Ok(())
    }
}

/// Names of a list, in one order, each once.
pub fn names(list: &[Optimisation]) -> Vec<&'static str> {
    let mut list = list.to_vec();
    list.sort_unstable();
    list.dedup();
    list.into_iter().map(Optimisation::name).collect()
}

fn optimisation(text: &str) -> Result<Optimisation, String> {
    let found = Optimisation::ALL.iter().find(|which| which.name() == text);
    found.copied().ok_or_else(|| unknown(text, Optimisation::NAMES, &[]))
}
