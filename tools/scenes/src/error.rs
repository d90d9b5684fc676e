//! Why a scene could not be named, generated or written.

use crate::settings::Kind;
use crate::stiff::Stiff;
use brickwalk_convert::progress::Interrupted;
use brickwalk_convert::source::SourceError;
use std::path::PathBuf;
use std::str::FromStr;

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
    #[error(
        "{}: a GLB file has less than 4 GiB, and this scene needs more; name it {}, which keeps its buffer in a file \
         of its own",
        path.display(), path.with_extension("gltf").display()
    )]
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

impl FromStr for Kind {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        Self::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| Error::Kind { name: name.into() })
    }
}

impl FromStr for Stiff {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        Self::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| Error::Case { name: name.into() })
    }
}
