//! What `scene` can generate.

use super::units::UNITS;
use brickwalk_scenes::{Error, Kind, Stiff};
use std::fmt::Write;
use std::str::FromStr;

/// What to generate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneKind {
    /// A scene of any size.
    Generated(Kind),
    /// A small scene that is hard for arithmetic or for builders, which `--case` names.
    Stiff,
}

impl FromStr for SceneKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "stiff" => Ok(Self::Stiff),
            // What there is comes last in the message.
            _ => text.parse().map(Self::Generated).map_err(|error: Error| format!("{error}, stiff")),
        }
    }
}

/// What the help of `scene` ends with: the stiff scenes, one a line, with their triangles.
pub fn scene_help() -> String {
    let mut text = String::from("Cases of stiff, with their default --triangles:\n");
    for kind in Stiff::ALL {
        // Writing to a string does not fail.
        let _ = writeln!(text, "  {:<16} {:>8}  {}", kind.name(), kind.default_triangles(), kind.about());
    }
    text + "By default slivers, scale-mix and far-origin have their own --lattice, and all but duplicates and \
            series have 64\n\
            triangles per brick. glTF stores positions as f32, in which slivers are less thin.\n\n"
        + UNITS
}
