//! The part of a scene that is always in memory.

use crate::displacement::DisplacementField;
use crate::layout::{ENTRY_BYTES, Section};
use crate::levels::Level;
use crate::manifest::Manifest;
use crate::occupancy::Occupancy;
use crate::payload::Payload;
use crate::records::{
    AttributeLayout, Brick, Instance, Leaf, Material, Object, OpacityMap, PunctualLight, Span, Texture, TopNode2,
    TopNode8,
};
use crate::texture::TilePlace;

/// The always-resident part of a scene file: everything but the payloads.
///
/// `objects[0]` is the world object, `instances[0]` places it by the identity; both always exist. A scene without
/// triangles has no bricks, leaves or top-level nodes. A `Resident` that came out of a [`crate::SceneFile`] satisfies
/// [`crate::validate::resident`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Resident {
    /// What the scene has.
    pub manifest: Manifest,
    /// Objects; the first is the world.
    pub objects: Vec<Object>,
    /// Instances; the first is the world's.
    pub instances: Vec<Instance>,
    /// Leaves of both top-level trees: one for every brick of every instance.
    pub leaves: Vec<Leaf>,
    /// The binary top-level tree.
    pub top2: Vec<TopNode2>,
    /// The 8-wide top-level tree over the same leaves.
    pub top8: Vec<TopNode8>,
    /// Bricks, those of one object together.
    pub bricks: Vec<Brick>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Textures.
    pub textures: Vec<Texture>,
    /// Opacity maps.
    pub opacity_maps: Vec<OpacityMap>,
    /// The tiles of all textures, those of one together.
    pub tiles: Vec<Span>,
    /// Lights without extent.
    pub lights: Vec<PunctualLight>,
    /// The occupancy of each brick, or nothing: then the scene has no proxies.
    pub occupancy: Vec<Occupancy>,
    /// Displacement fields, ascending by object and brick.
    pub displacement: Vec<DisplacementField>,
    /// Levels of detail, children before those that stand for them.
    pub levels: Vec<Level>,
    /// Leaves of the top level over bricks and levels: one for every brick and level of every instance. Empty once
    /// levels are in use.
    pub level_leaves: Vec<Leaf>,
    /// The binary tree over them.
    pub level_top2: Vec<TopNode2>,
    /// The 8-wide tree over them.
    pub level_top8: Vec<TopNode8>,
}

impl Resident {
    /// Number of records of a section; 0 for the manifest, which has none.
    pub fn count(&self, section: Section) -> usize {
        match section {
            Section::Manifest => 0,
            Section::Objects => self.objects.len(),
            Section::Instances => self.instances.len(),
            Section::Leaves => self.leaves.len(),
            Section::Top2 => self.top2.len(),
            Section::Top8 => self.top8.len(),
            Section::Bricks => self.bricks.len(),
            Section::Materials => self.materials.len(),
            Section::Textures => self.textures.len(),
            Section::OpacityMaps => self.opacity_maps.len(),
            Section::Tiles => self.tiles.len(),
            Section::Lights => self.lights.len(),
            Section::Occupancy => self.occupancy.len(),
            Section::Displacement => self.displacement.len(),
            Section::Levels => self.levels.len(),
            Section::LevelLeaves => self.level_leaves.len(),
            Section::LevelTop2 => self.level_top2.len(),
            Section::LevelTop8 => self.level_top8.len(),
        }
    }

    /// The sections that its file has, in their order: all but optional ones without records.
    pub fn sections(&self) -> impl Iterator<Item = Section> + '_ {
        Section::ALL.into_iter().filter(|&section| !section.is_optional() || self.count(section) > 0)
    }

    /// Length of the directory of its file.
    pub fn directory_bytes(&self) -> u64 {
        self.sections().count() as u64 * ENTRY_BYTES
    }

    /// Bytes of all opacity maps.
    pub fn opacity_bytes(&self) -> u64 {
        self.opacity_maps.iter().map(|map| map.texels.bytes).sum()
    }

    /// Bytes of all textures: tails, tiles and opacity maps.
    pub fn texture_bytes(&self) -> u64 {
        let spans = self.textures.iter().map(|texture| &texture.tail).chain(&self.tiles);
        spans.map(|span| span.bytes).sum::<u64>() + self.opacity_bytes()
    }

    /// Where a payload lies, or `None` if there is no such brick, level, texture, tile, map or field, or no proxies.
    pub fn span(&self, payload: Payload) -> Option<Span> {
        match payload {
            Payload::Geometry(brick) => self.brick(brick).map(|brick| brick.geometry),
            Payload::Attributes(brick) => self.brick(brick).map(|brick| brick.attributes),
            Payload::Proxies(brick) => {
                let brick = self.bricks.get(brick as usize);
                brick.map(|brick| brick.proxies).filter(|span| *span != Span::default())
            }
            Payload::Opacity(map) => self.opacity_maps.get(map as usize).map(|map| map.texels),
            Payload::Texture(texture) => self.textures.get(texture as usize).map(|texture| texture.tail),
            Payload::Tile(tile) => self.tiles.get(tile as usize).copied(),
            Payload::Displacement(field) => self.displacement.get(field as usize).map(|field| field.span),
        }
    }

    /// Length of a payload as it is loaded by [`crate::SceneFile::copy`], or `None` if there is no such payload. It
    /// is that of its span but for attributes and displacement fields, which are encoded in the file.
    pub fn loaded_bytes(&self, payload: Payload) -> Option<u64> {
        match payload {
            Payload::Attributes(brick) => self.brick(brick).map(|brick| AttributeLayout::of(brick).bytes),
            Payload::Displacement(field) => self.displacement.get(field as usize).map(DisplacementField::loaded_bytes),
            _ => self.span(payload).map(|span| span.bytes),
        }
    }

    /// Every payload with its span: geometry, attributes and, if any, proxies in order of bricks and levels, then the
    /// textures' tails, then the tiles, then the opacity maps, then the displacement fields.
    pub fn payloads(&self) -> impl Iterator<Item = (Payload, Span)> + '_ {
        let levels = self.levels_beside().iter().map(|level| &level.brick);
        let bricks = (0u32..).zip(self.bricks.iter().chain(levels));
        let bricks = bricks.flat_map(|(index, brick)| {
            let payloads = [Payload::Geometry(index), Payload::Attributes(index), Payload::Proxies(index)];
            let spans = payloads.into_iter().zip([brick.geometry, brick.attributes, brick.proxies]);
            spans.filter(|(payload, span)| !matches!(payload, Payload::Proxies(_)) || *span != Span::default())
        });
        let textures = (0u32..).zip(&self.textures);
        let tails = textures.map(|(index, texture)| (Payload::Texture(index), texture.tail));
        let tiles = (0u32..).zip(&self.tiles).map(|(index, span)| (Payload::Tile(index), *span));
        let maps = (0u32..).zip(&self.opacity_maps).map(|(index, map)| (Payload::Opacity(index), map.texels));
        let fields = (0u32..).zip(&self.displacement).map(|(index, field)| (Payload::Displacement(index), field.span));
        bricks.chain(tails).chain(tiles).chain(maps).chain(fields)
    }

    /// The texture of a tile, and where the tile is in it; `None` if there is no such tile.
    pub fn tile_of(&self, tile: u32) -> Option<(u32, TilePlace)> {
        // Of textures with the same first tile, all but the last have none.
        let index = self.textures.partition_point(|texture| texture.first_tile <= tile).checked_sub(1)?;
        let texture = &self.textures[index];
        let own = tile - texture.first_tile;
        (own < texture.tile_count).then(|| (index as u32, texture.place_of(own)))
    }

    /// The texture, by its name in the source, that a payload is part of, and which part, in words; or of
    /// which level it is what; `None` if it is of neither.
    pub fn place_of(&self, payload: Payload) -> Option<String> {
        let named = |texture: u32| {
            let name = self.manifest.texture_names.get(texture as usize).map_or("", String::as_str);
            format!("texture {texture} \"{name}\"")
        };
        match payload {
            Payload::Texture(texture) => Some(format!("the coarse levels of {}", named(texture))),
            Payload::Tile(tile) => {
                let (texture, TilePlace { level, x, y }) = self.tile_of(tile)?;
                Some(format!("column {x}, row {y} of level {level} of {}", named(texture)))
            }
            Payload::Geometry(_) | Payload::Attributes(_) => {
                self.level_of(payload).is_some().then(|| self.name_of(payload))
            }
            Payload::Proxies(_) | Payload::Opacity(_) | Payload::Displacement(_) => None,
        }
    }
}
