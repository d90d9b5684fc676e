//! The kernels of ray-aligned occupancy maps, and the steps that they are run by.

use super::cosine::roma_draw;
use super::maps::RomaMaps;
use super::twin::{roma_measure, roma_pilots, roma_rotate, roma_trace};
use crate::kernels;
use crate::kernels::layout::{HANDOVERS, Level, NONE, ROMA_CORRECT, ROMA_FAR, ROMA_SIFT, ROMA_WHOLE, RomaMap, RomaOwn};
use crate::kernels::table::{Family, FamilyBuffer};
use crate::schedule::{Over, Own, Pass, Report, Step};

kernels! {
    /// The kernels.
    static KERNELS, names;

    roma_rotate: "roma/roma_rotate" Own [] |b, t| roma_rotate(b, t.buffers);
    roma_pilots: "roma/roma_pilots" Own [] |b, t| roma_pilots(b, t.own);
    roma_trace: "roma/roma_trace" Own [] |b, t| roma_trace(b, t.buffers, t.own, t.seen);
    roma_draw: "roma/roma_draw" Own [] |b, t| roma_draw(b, t.buffers, t.own, t.seen, (t.pixels, t.shaded));
    roma_measure: "roma/roma_measure" Own [] |b, t| roma_measure(b, t.buffers, t.own, t.seen);
}

/// Number of the buffer of base maps in the frame.
pub const LEVELS: usize = 0;
/// Of ray-aligned maps.
pub const MAPS: usize = 1;
/// Of the bits of base maps, of each behind them what is empty.
pub const BOMS: usize = 2;

/// The kernels and their buffers.
pub static FAMILY: Family = Family {
    name: "roma",
    what: "occupancy maps",
    remedy: "give a smaller --roma-size, --roma-k or --roma-shadow-k",
    has_lamps: false,
    buffers: &[
        FamilyBuffer { name: "levels", stride: size_of::<Level>(), is_written: false },
        FamilyBuffer { name: "maps", stride: size_of::<RomaMap>(), is_written: false },
        FamilyBuffer { name: "boms", stride: 4, is_written: false },
        FamilyBuffer { name: "columns", stride: 4, is_written: true },
    ],
    kernels: KERNELS,
};

/// Which part of rays occupancy maps answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RomaPart {
    /// All of them, by the map of the stratum that they lie in.
    Whole,
    /// All of them, which are snapped, by the maps that are drawn in proportion to the cosines between their directions
    /// and the normals of the set before; they go on in these directions.
    Cosine,
    /// Of those that have met nothing up to where [`Sift::near`] ended them, what lies beyond: they have been traced.
    Far,
    /// Whether they meet anything. Those that do not are answered; the others are still to be traced.
    Sift(Sift),
    /// All of them, after the pilots of [`RomaMaps::pilots`] were traced; each of these counts for what maps get wrong
    /// of so many.
    Correct {
        /// One ray in so many is a pilot.
        one_in: u32,
    },
}

impl RomaPart {
    /// The one that answers all rays of a pass; with no `steps` they are snapped. `is_long`: so far do they go that
    /// what the cosine is within a stratum counts.
    pub fn answering(pass: Pass, steps: u32, is_long: bool) -> Self {
        let is_around_normal = matches!(pass, Pass::Occlusion(_) | Pass::Diffuse(_));
        if is_around_normal && steps == 0 && is_long { Self::Cosine } else { Self::Whole }
    }
}

/// How rays are sifted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sift {
    /// Those in doubt are traced up to so many cells of the base map that holds their start from it; `None`: to their
    /// ends.
    pub near: Option<u32>,
    /// One ray in so many is a pilot: it is not sifted; 0: none.
    pub pilots: u32,
}

/// Rays that are traced to their ends though they could be sifted, and what maps would have answered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pilots {
    /// How many there are.
    pub rays: u64,
    /// That meet something and would have been found free.
    pub missed: u64,
    /// That are free and would have met something in the maps, had they been traced up to each of [`HANDOVERS`]
    /// distances.
    pub doubted: [u64; HANDOVERS as usize],
}

impl Pilots {
    /// What [`RomaMaps::measure`] counted.
    pub fn of(report: &Report) -> Self {
        let [rays, missed, doubted @ ..] = report.own;
        Self { rays, missed, doubted }
    }

    /// Adds others.
    pub fn add(&mut self, other: Self) {
        self.rays += other.rays;
        self.missed += other.missed;
        for (total, doubted) in self.doubted.iter_mut().zip(other.doubted) {
            *total += doubted;
        }
    }
}

impl RomaMaps {
    /// What all kernels are told of these maps.
    fn own(&self) -> RomaOwn {
        RomaOwn {
            k: self.k,
            size: self.size,
            cells: self.cells,
            levels: self.levels.len() as u32,
            samples: self.samples,
            is_part: self.is_part.into(),
            ..RomaOwn::default()
        }
    }

    /// Makes the maps: phase 1.
    pub fn rotate(&self) -> Step {
        let own = self.own();
        let columns = own.levels * own.k * own.k * own.size * own.size;
        Own::new(names::roma_rotate, &own).over(Over::Elements(columns)).in_phase(0).into()
    }

    /// Ends those of the pass's rays, not traced yet, that are no pilots: one ray in so many is one.
    pub fn pilots(&self, one_in: u32) -> Step {
        let own = RomaOwn { part: ROMA_CORRECT, pilots: one_in, ..self.own() };
        Own::new(names::roma_pilots, &own).in_phase(0).into()
    }

    /// Answers a part of the pass's rays, and counts them: phase 3. `steps`: columns that a ray passes before it is
    /// finished along the map's direction; 0: it takes that direction from the start.
    pub fn trace(&self, steps: u32, part: RomaPart) -> Step {
        let (number, Sift { near, pilots }) = match part {
            RomaPart::Whole | RomaPart::Cosine => (ROMA_WHOLE, Sift::default()),
            RomaPart::Far => (ROMA_FAR, Sift::default()),
            RomaPart::Sift(sift) => (ROMA_SIFT, sift),
            RomaPart::Correct { one_in } => (ROMA_CORRECT, Sift { near: None, pilots: one_in }),
        };
        let own = RomaOwn { steps, part: number, near: near.unwrap_or(NONE), pilots, ..self.own() };
        let kernel = if part == RomaPart::Cosine { names::roma_draw } else { names::roma_trace };
        Own::new(kernel, &own).in_phase(2).into()
    }

    /// Counts what maps would have answered wrongly of the rays that were not sifted, after they have been traced:
    /// phase 3. `steps` as of [`Self::trace`], `pilots` as of [`Sift::pilots`], `cell`: cells of a base map in one of a
    /// map.
    pub fn measure(&self, steps: u32, pilots: u32, cell: u32) -> Step {
        let own = RomaOwn { steps, pilots, near: cell, ..self.own() };
        Own::new(names::roma_measure, &own).in_phase(2).into()
    }
}
