//! What to generate: kinds of scenes and their settings.

use std::fmt;
use std::ops::RangeInclusive;

/// Kinds of generated scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Streets, buildings, trees, cars.
    City,
    /// A plant in an open frame of steel, full of pipes.
    Pipes,
    /// Mountains, woods and meadows around a pond.
    Terrain,
    /// An ornate teapot in a stadium.
    Stadium,
    /// A Cornell box in which a box orbits.
    Cornell,
}

impl Kind {
    /// Every kind.
    pub const ALL: [Self; 5] = [Self::City, Self::Pipes, Self::Terrain, Self::Stadium, Self::Cornell];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::City => "city",
            Self::Pipes => "pipes",
            Self::Terrain => "terrain",
            Self::Stadium => "stadium",
            Self::Cornell => "cornell",
        }
    }

    /// The numbers of triangles it can have.
    pub fn triangles(self) -> RangeInclusive<u64> {
        match self {
            Self::City | Self::Pipes => 10_000..=150_000_000,
            Self::Terrain => 50_000..=150_000_000,
            Self::Stadium => 500_000..=150_000_000,
            Self::Cornell => 10_000..=10_000_000,
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What to generate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Kind of the scene.
    pub kind: Kind,
    /// Triangles wanted, instances multiplied out: [`Kind::triangles`].
    pub triangles: u64,
    /// Seed.
    pub seed: u64,
    /// City: trees and vehicles as instances of shared meshes instead of copies within the blocks. The triangles are
    /// the same. The other kinds always store once what they have many of.
    pub instanced: bool,
    /// How often the whole is placed, at least once; [`Self::triangles`] are those of one copy.
    pub copies: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self { kind: Kind::City, triangles: 1_000_000, seed: 0, instanced: false, copies: 1 }
    }
}

impl Settings {
    /// The settings of the scene whose source is called `name`, as in "city seed=0 triangles=2000000";
    /// [`Self::instanced`] is not part of the name. `None` if no generated scene is called so.
    pub fn of_source(name: &str) -> Option<Self> {
        let (kind, rest) = name.split_once(" seed=")?;
        let (seed, rest) = rest.split_once(" triangles=")?;
        let (triangles, copies) = rest.split_once(" copies=").unwrap_or((rest, "1"));
        let (kind, seed) = (kind.parse().ok()?, seed.parse().ok()?);
        let (triangles, copies) = (triangles.parse().ok()?, copies.parse().ok()?);
        Some(Self { kind, triangles, seed, instanced: false, copies })
    }
}
