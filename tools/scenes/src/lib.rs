//! Generated scenes of any size, and camera paths through them.
//!
//! A scene depends on its settings alone: not on the number of threads, nor on the machine's clock. The city's detail per
//! block is fixed; asking for more triangles adds blocks around the same centre.

mod block;
mod building;
mod city;
mod facade;
mod furniture;
mod layout;
mod material;
mod mesh;
mod open;
mod path;
mod rng;
mod roof;
mod site;
mod soup;
mod street;
mod style;
mod vegetation;
mod vehicle;
mod window;

use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::SourceScene;
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

pub use city::{MAX_TRIANGLES, MIN_TRIANGLES, placed_triangles};
pub use path::{CameraPath, Keyframe, LONG_FRAMES, NEAR_FRAMES, near_path, path_above, write_paths};
pub use soup::{SoupKind, rotated_instances, soup};

/// Kinds of generated scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Streets, buildings, trees, cars.
    City,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::City => "city",
        })
    }
}

impl FromStr for Kind {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        match name {
            "city" => Ok(Self::City),
            _ => Err(Error::Kind { name: name.into() }),
        }
    }
}

/// What to generate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Kind of the scene.
    pub kind: Kind,
    /// Triangles wanted, instances multiplied out: [`MIN_TRIANGLES`]..=[`MAX_TRIANGLES`].
    pub triangles: u64,
    /// Seed.
    pub seed: u64,
    /// Trees and vehicles as instances of shared meshes instead of copies within the blocks. The triangles are the same.
    pub instanced: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { kind: Kind::City, triangles: 1_000_000, seed: 0, instanced: false }
    }
}

/// Why a scene could not be generated.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// No such kind.
    #[error("there is no generated scene {name:?}; the kinds are: city")]
    Kind {
        /// What was asked for.
        name: String,
    },
    /// A count out of range.
    #[error("a city of {asked} triangles is not possible; ask for {min} to {max}")]
    Triangles {
        /// What was asked for.
        asked: u64,
        /// Fewest.
        min: u64,
        /// Most.
        max: u64,
    },
    /// A file could not be written.
    #[error("cannot write {}: {source}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

/// Generates a scene. Metres, Y up, right-handed; flat-shaded triangles with vertex colours, no textures. The number of
/// triangles is at most the one asked for and short of it by less than 5 %.
///
/// Each block of the city is one mesh, placed once with the identity; `settings.instanced` takes trees and vehicles out of
/// the blocks. The city's first crossing is at the origin, the street at y = 0.
///
/// # Errors
///
/// [`Error::Triangles`] for a count out of range.
pub fn generate(settings: &Settings, progress: &Progress) -> Result<SourceScene, Error> {
    match settings.kind {
        Kind::City => city::generate(settings, progress),
    }
}

/// The source entry of a generated scene: no bytes, and the xxh3-64 of none.
fn source_of(name: String) -> bricks::Source {
    bricks::Source { name, bytes: 0, hash: "2d06800538d394c2".into() }
}
