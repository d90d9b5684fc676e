//! The part of a scene that is always in memory.

use crate::layout::Section;
use crate::manifest::Manifest;
use crate::occupancy::Occupancy;
use crate::payload::Payload;
use crate::records::{
    AttributeLayout, Brick, Instance, Leaf, Material, Object, OpacityMap, Span, Texture, TopNode2, TopNode8,
};

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
    /// The occupancy of each brick, or nothing: then the scene has no proxies.
    pub occupancy: Vec<Occupancy>,
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
            Section::Occupancy => self.occupancy.len(),
        }
    }

    /// Bytes of all opacity maps.
    pub fn opacity_bytes(&self) -> u64 {
        self.opacity_maps.iter().map(|map| map.texels.bytes).sum()
    }

    /// Where a payload lies, or `None` if there is no such brick, texture or map, or no proxies.
    pub fn span(&self, payload: Payload) -> Option<Span> {
        match payload {
            Payload::Geometry(brick) => self.bricks.get(brick as usize).map(|brick| brick.geometry),
            Payload::Attributes(brick) => self.bricks.get(brick as usize).map(|brick| brick.attributes),
            Payload::Proxies(brick) => {
                let brick = self.bricks.get(brick as usize);
                brick.map(|brick| brick.proxies).filter(|span| *span != Span::default())
            }
            Payload::Texture(texture) => self.textures.get(texture as usize).map(|texture| texture.texels),
            Payload::Opacity(map) => self.opacity_maps.get(map as usize).map(|map| map.texels),
        }
    }

    /// Length of a payload as it is loaded by [`crate::SceneFile::copy`], or `None` if there is no such brick or texture. It
    /// is that of its span but for attributes, which are encoded in the file.
    pub fn loaded_bytes(&self, payload: Payload) -> Option<u64> {
        match payload {
            Payload::Attributes(brick) => self.bricks.get(brick as usize).map(|brick| AttributeLayout::of(brick).bytes),
            _ => self.span(payload).map(|span| span.bytes),
        }
    }

    /// Every payload with its span: the bricks' geometry, attributes and, if any, proxies in order of bricks, then the textures, then the
    /// opacity maps.
    pub fn payloads(&self) -> impl Iterator<Item = (Payload, Span)> + '_ {
        let bricks = (0u32..).zip(&self.bricks);
        let bricks = bricks.flat_map(|(index, brick)| {
            let payloads = [Payload::Geometry(index), Payload::Attributes(index), Payload::Proxies(index)];
            let spans = payloads.into_iter().zip([brick.geometry, brick.attributes, brick.proxies]);
            spans.filter(|(payload, span)| !matches!(payload, Payload::Proxies(_)) || *span != Span::default())
        });
        let textures = (0u32..).zip(&self.textures);
        let maps = (0u32..).zip(&self.opacity_maps).map(|(index, map)| (Payload::Opacity(index), map.texels));
        bricks.chain(textures.map(|(index, texture)| (Payload::Texture(index), texture.texels))).chain(maps)
    }
}
