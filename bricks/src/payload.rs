//! Names of the things that are read on demand.

use std::fmt;

/// A payload of the file: what is read on demand, by index of its [`crate::Brick`], [`crate::Texture`], tile,
/// [`crate::OpacityMap`] or [`crate::DisplacementField`]. Bricks of levels of detail ([`crate::Level`]) have the
/// numbers behind those of the objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Payload {
    /// What traversal of a brick reads, laid out as [`crate::GeometryLayout`] says.
    Geometry(u32),
    /// What shading of hits in a brick reads, loaded as [`crate::AttributeLayout`] says, stored as
    /// [`crate::attributes`] says.
    Attributes(u32),
    /// The [`crate::OccupancyMap`] of a brick, packed.
    Proxies(u32),
    /// The tail of a texture: its levels that fit into a tile.
    Texture(u32),
    /// The texels of an opacity map.
    Opacity(u32),
    /// A tile of a level of a texture, by its number in the file; see [`crate::Resident::tile_of`].
    Tile(u32),
    /// The samples of a [`crate::DisplacementField`], loaded as it says, stored packed ([`crate::pack`]). They lie
    /// behind all other payloads.
    Displacement(u32),
}

impl fmt::Display for Payload {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Payload::Geometry(brick) => write!(f, "brick {brick} geometry"),
            Payload::Attributes(brick) => write!(f, "brick {brick} attributes"),
            Payload::Proxies(brick) => write!(f, "brick {brick} proxies"),
            Payload::Texture(texture) => write!(f, "texture {texture}"),
            Payload::Opacity(map) => write!(f, "opacity map {map}"),
            Payload::Tile(tile) => write!(f, "tile {tile}"),
            Payload::Displacement(field) => write!(f, "displacement field {field}"),
        }
    }
}
