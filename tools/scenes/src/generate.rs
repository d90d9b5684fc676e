//! One generator a kind of scene.

use crate::error::Error;
use crate::scene::Scene;
use crate::settings::{Kind, Settings};
use crate::{city, cornell, pipes, stadium, terrain};
use brickwalk_convert::progress::Progress;

impl Kind {
    /// The nodes that are meant to move, which the builder keeps as instances of their own.
    pub fn movable(self) -> &'static [&'static str] {
        match self {
            Self::Cornell => &[cornell::MOVER],
            _ => &[],
        }
    }
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
