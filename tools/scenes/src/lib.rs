//! Generated scenes of any size, and camera paths through them.
//!
//! A scene depends on its settings alone: not on the number of threads, nor on the machine's clock. The detail of a
//! place is fixed; asking for more triangles adds more of it around the same centre.

mod block;
mod building;
mod city;
mod copies;
mod cornell;
mod facade;
mod furniture;
mod gltf;
mod layout;
mod material;
mod mesh;
mod motion;
mod open;
mod output;
mod path;
mod pieces;
mod pipes;
mod rings;
mod rng;
mod roof;
mod scene;
mod site;
mod solid;
mod soup;
mod stadium;
mod stiff;
mod street;
mod style;
mod terrain;
mod vegetation;
mod vehicle;
mod window;

use brickwalk_convert::progress::{Interrupted, Progress};
use brickwalk_convert::source::SourceError;
use std::fmt;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::str::FromStr;

pub use gltf::{GltfForm, write_gltf};
pub use motion::{Mover, Pose, write_motion};
pub use path::{CameraPath, Keyframe, LONG_FRAMES, NEAR_FRAMES, write_far_path, write_paths};
pub use rng::Rng;
pub use scene::Scene;
pub use soup::{SoupKind, rotated_instances, soup};
pub use stiff::{Stiff, far_path, moved, one_mesh, stiff};

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

    /// The nodes that are meant to move, which the builder keeps as instances of their own.
    pub fn movable(self) -> &'static [&'static str] {
        match self {
            Self::Cornell => &[cornell::MOVER],
            _ => &[],
        }
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Kind {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        Self::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| Error::Kind { name: name.into() })
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

/// Why a scene could not be generated or written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// No such kind.
    #[error("there is no generated scene {name:?}; the kinds are: {}", Kind::ALL.map(Kind::name).join(", "))]
    Kind {
        /// What was asked for.
        name: String,
    },
    /// No such stiff scene.
    #[error("there is no stiff scene {name:?}; there are: {}", Stiff::ALL.map(Stiff::name).join(", "))]
    Case {
        /// What was asked for.
        name: String,
    },
    /// A count out of range.
    #[error("a scene {kind} of {asked} triangles is not possible; ask for {} to {}",
        kind.triangles().start(), kind.triangles().end())]
    Triangles {
        /// The kind.
        kind: Kind,
        /// What was asked for.
        asked: u64,
    },
    /// A file could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// More than the lengths in a GLB file can say.
    #[error("{}: a GLB file has less than 4 GiB, and this scene needs more; name it {}, which keeps its buffer in a file \
        of its own", path.display(), path.with_extension("gltf").display())]
    GlbSize {
        /// The file.
        path: PathBuf,
    },
    /// Geometry could not be read.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// Somebody asked to stop.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

/// Generates a scene: what there is and how large, the geometry when it is read. The number of triangles is at most the
/// one asked for and short of it by less than 5 %.
///
/// Each block of the city is one mesh, placed once with the identity; `settings.instanced` takes trees and vehicles out
/// of the blocks. The city's first crossing is at the origin, the street at y = 0. Each bay of the plant and each tile
/// of the terrain is one mesh, too; what grows and lies on the terrain is stored once. The stadium is whole in every
/// size: more triangles go into its seats and into the teapot. So is the Cornell box: more of them go into the boxes in
/// it.
///
/// # Errors
///
/// [`Error::Triangles`] for a count out of range.
pub fn generate(settings: &Settings, progress: &Progress) -> Result<Scene, Error> {
    let Settings { kind, triangles: asked, .. } = *settings;
    if !kind.triangles().contains(&asked) {
        return Err(Error::Triangles { kind, asked });
    }
    progress.phase(kind.name(), asked);
    let scene = match kind {
        Kind::City => city::generate(settings, progress),
        Kind::Pipes => pipes::generate(settings, progress),
        Kind::Terrain => terrain::generate(settings, progress),
        Kind::Stadium => stadium::generate(settings, progress),
        Kind::Cornell => cornell::generate(settings, progress),
    };
    progress.finish();
    Ok(scene.copied(settings.copies))
}

/// The source entry of a generated scene: no bytes, and the xxh3-64 of none.
fn source_of(name: String) -> bricks::Source {
    bricks::Source { name, bytes: 0, hash: "2d06800538d394c2".into() }
}
