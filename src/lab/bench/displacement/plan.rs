//! What is measured.

use super::args::Settings;
use super::mapping::Mapping;
use crate::kernels::layout::{DISPLACEMENT_AIMED, DISPLACEMENT_DIRECTIONS, DISPLACEMENT_POSITIONS};
use crate::secondary::displacement::Shape;
use crate::settings::names;
use std::fmt;

names! {
    /// A part of the measurements that can be asked for alone, after the paper's figures.
    Stage {
        /// Errors by positions and directions.
        Figure6 = "figure6",
        /// Bits of a sample; with figure 7.
        Figure4 = "figure4",
        /// How directions are mapped.
        Figure5 = "figure5",
        /// Times by triangles.
        Figure8 = "figure8",
    }
}

names! {
    /// Which stored rays stand for a ray's.
    Look {
        /// The one in its direction from the nearest position, as in the paper.
        Paper = "paper",
        /// The one that meets it in the middle of its chord.
        Aimed = "aimed",
        /// Those around that, weighed.
        Interpolated = "interpolated",
    }
}

impl Look {
    /// As fields know it.
    pub fn bits(self) -> u32 {
        match self {
            Self::Paper => 0,
            Self::Aimed => DISPLACEMENT_AIMED,
            Self::Interpolated => DISPLACEMENT_AIMED | DISPLACEMENT_POSITIONS | DISPLACEMENT_DIRECTIONS,
        }
    }
}

/// A way to hold and to ask samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Way {
    /// Of 8 bits.
    Asked(Look),
    /// Of so many bits.
    Held(u32, Look),
    /// Of 8 bits, with directions so mapped.
    Mapped(Mapping, Look),
    /// All ways to answer a ray against an object of so many triangles, in turns.
    Timed(u64),
}

/// Bits of samples.
pub const BITS: [u32; 3] = [32, 8, 1];

impl Way {
    /// Bits of a sample.
    pub fn bits(self) -> u32 {
        if let Self::Held(bits, _) = self { bits } else { 8 }
    }

    /// How samples are asked; of all ways in turns, as in the paper.
    pub fn look(self) -> Look {
        match self {
            Self::Asked(look) | Self::Held(_, look) | Self::Mapped(_, look) => look,
            Self::Timed(_) => Look::Paper,
        }
    }
}

impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Asked(look) => write!(f, "{look}"),
            Self::Held(bits, look) => write!(f, "{bits} bits, {look}"),
            Self::Mapped(mapping, look) => write!(f, "{mapping}, {look}"),
            Self::Timed(triangles) => write!(f, "{triangles} triangles"),
        }
    }
}

/// Ways that share samples.
#[derive(Clone, Debug)]
pub struct Job {
    /// What it is a part of.
    pub stage: Stage,
    /// How many samples.
    pub shape: Shape,
    /// The ways.
    pub ways: Vec<Way>,
}

impl Job {
    /// Names a measurement.
    pub fn key(&self, way: Way) -> String {
        let Shape { directions, .. } = self.shape;
        format!("{}/{} x {directions}²/{way}", self.stage, self.shape.positions())
    }
}

/// All jobs, in their order.
pub fn jobs(settings: &Settings) -> Vec<Job> {
    let Settings { rings, directions, objects } = settings;
    let or_last = |all: &[u32]| all.get(1).or(all.last()).copied().unwrap_or(2);
    let job =
        |stage, rings, directions, ways: &[Way]| Job { stage, shape: Shape { rings, directions }, ways: ways.to_vec() };
    let asked = [Look::Paper, Look::Aimed, Look::Interpolated].map(Way::Asked);
    let held = BITS.map(|bits| [Look::Paper, Look::Aimed].map(|look| Way::Held(bits, look))).concat();
    let both = |&mapping: &Mapping| [Look::Paper, Look::Aimed].map(|look| Way::Mapped(mapping, look));
    let mapped: Vec<Way> = Mapping::ALL.iter().flat_map(both).collect();
    let (few, usual) = (directions.first().copied().unwrap_or(2), or_last(directions));
    let mut jobs = Vec::new();
    jobs.extend(rings.iter().flat_map(|&m| directions.iter().map(move |&n| job(Stage::Figure6, m, n, &asked))));
    let fine = if rings.len() > 1 { &rings[1..] } else { &rings[..] };
    jobs.extend(fine.iter().map(|&m| job(Stage::Figure4, m, usual, &held)));
    jobs.extend(directions.iter().take(2).map(|&n| job(Stage::Figure5, or_last(rings), n, &mapped)));
    let last = rings.last().copied().unwrap_or(2);
    let timed: Vec<Way> = objects.iter().map(|&triangles| Way::Timed(triangles)).collect();
    jobs.push(job(Stage::Figure8, last, few, &timed));
    jobs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::bench::displacement::args::DisplacementBenchArgs;

    #[test]
    fn measurements_have_names_of_their_own() {
        for (quick, count) in [(false, 12 * 3 + 2 * 6 + 12 + 5), (true, 4 * 3 + 6 + 12 + 3)] {
            let args = DisplacementBenchArgs { quick, ..DisplacementBenchArgs::default() };
            let all = jobs(&args.settings());
            let mut keys: Vec<String> = all.iter().flat_map(|job| job.ways.iter().map(|&way| job.key(way))).collect();
            assert_eq!(keys.len(), count);
            keys.sort();
            keys.dedup();
            assert_eq!(keys.len(), count);
        }
        let one = DisplacementBenchArgs { rings: vec![4], directions: vec![8], ..DisplacementBenchArgs::default() };
        let all = jobs(&one.settings());
        assert!(Stage::ALL.iter().all(|stage| all.iter().any(|job| job.stage == *stage)));
        assert!(all.iter().all(|job| job.shape == Shape { rings: 4, directions: 8 }));
    }
}
