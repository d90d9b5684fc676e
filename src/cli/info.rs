//! `info`: what a `.bricks` file holds, and where a triangle comes from.

use super::instances;
use super::options::args::InfoArgs;
use super::quality::{Bin, PerTriangle, Sections, Trees, histogram, human_histogram};
use crate::cli::output::{print, print_json};
use crate::session::opened::scene_bytes;
use crate::settings::sizes::{human_bytes, human_count};
use crate::stream::Residency;
use anyhow::{Context, Result};
use bricks::{
    AttributeLayout, BRICK_WIDE, LIGHT_DISTANT, LIGHT_POINT, LIGHT_SPOT, Manifest, Payload, PunctualLight, SceneFile,
    Texture,
};
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt::Write;

/// Raised when a field of the JSON changes its meaning.
pub const FORMAT: u32 = 4;

/// Runs `info`.
///
/// # Errors
/// The file cannot be opened or is damaged, or no triangle has the id that was asked for.
pub fn run(args: &InfoArgs) -> Result<()> {
    let scene = SceneFile::open(&args.scene)?;
    if let Some(id) = args.id {
        let origin = origin(&scene, id)?;
        return if args.json { print_json(&origin) } else { print(&origin.human()) };
    }
    if args.instances {
        let rows = instances::rows(scene.resident());
        return if args.json { print_json(&rows) } else { print(&instances::human(&rows)) };
    }
    let info = Info::of(&scene, args.deep)?;
    if args.json { print_json(&info) } else { print(&info.human()) }
}

/// A statement about a scene for reports: what rendering leaves out, or what it cannot show, and why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LeftOut {
    /// What.
    pub what: String,
    /// Why.
    pub why: String,
}

/// What rendering leaves out because the scene has no use for it, and what this version does not draw as the source
/// means it; from the manifest.
pub fn left_out(manifest: &Manifest) -> Vec<LeftOut> {
    let facts = [
        (!manifest.has_textures, "texture lookups", "no material has a texture"),
        (!manifest.has_normal_maps, "normal maps", "no material in use has one"),
        (!manifest.is_glossy, "glossy reflection", "every material in use is Lambertian"),
        (!manifest.has_alpha_mask && !manifest.has_alpha_blend, "alpha tests", "no material in use has alpha"),
        (!manifest.has_instances, "ray transforms of instances", "everything is placed once"),
        (!manifest.has_wide_bricks, "two-part positions", "no brick is wide"),
        (!manifest.has_emission, "emission", "no material in use emits light"),
        (manifest.has_animation, "animation", "the scene is drawn at rest"),
    ];
    let facts = facts.into_iter().filter(|(left_out, ..)| *left_out);
    facts.map(|(_, what, why)| LeftOut { what: what.into(), why: why.into() }).collect()
}

/// What `info --json` prints.
#[derive(Debug, Serialize)]
struct Info<'a> {
    format: u32,
    file: String,
    file_bytes: u64,
    resident_bytes: u64,
    generator: &'a str,
    sources: &'a [bricks::Source],
    triangles_stored: u64,
    triangles_instanced: u64,
    triangle_ids: u64,
    dropped_zero_area: u64,
    dropped_non_finite: u64,
    bounds_min: [f64; 3],
    bounds_max: [f64; 3],
    objects: usize,
    instances: usize,
    instance_scale_ratio: f64,
    bricks: usize,
    wide_bricks: usize,
    brick_triangles: u32,
    largest_brick_triangles: u32,
    tallest_brick_levels: u32,
    geometry_bytes: u64,
    /// As they lie in the file.
    attribute_bytes: u64,
    /// As they are loaded.
    loaded_attribute_bytes: u64,
    /// Occupancy maps that are read on demand.
    proxy_bytes: u64,
    /// Tiles and tails of textures.
    texture_bytes: u64,
    /// Of these, tails: the coarse levels, which stay resident.
    texture_tail_bytes: u64,
    /// Geometry and attributes of the two largest bricks, as loaded.
    two_largest_bricks_bytes: u64,
    /// What a cache must hold at least: the two largest bricks, or the tiles of a texture lookup.
    least_cache_bytes: u64,
    /// Step of the world's lattice, world units.
    lattice_step: f64,
    /// World units of one unit of length on the device.
    device_unit: f64,
    top_level_leaves: usize,
    top_level_nodes_binary: usize,
    top_level_nodes_wide: usize,
    materials: usize,
    textures: usize,
    /// Tiles of their levels that are streamed.
    texture_tiles: usize,
    /// How textures are stored, each encoding once: bc5, bc7, raw.
    texture_encodings: Vec<&'static str>,
    has_textures: bool,
    has_normal_maps: bool,
    is_glossy: bool,
    has_alpha_mask: bool,
    has_alpha_blend: bool,
    has_emission: bool,
    has_instances: bool,
    has_animation: bool,
    has_wide_bricks: bool,
    has_proxies: bool,
    provenance_ranges: usize,
    /// Names of nodes whose meshes were kept as instances, as the conversion was asked.
    movable: &'a [String],
    /// Lights without extent.
    lights: Vec<Light>,
    left_out: Vec<LeftOut>,
    warnings: &'a [String],
    /// Bytes of the file by what they hold.
    sections: Sections,
    /// Bytes a stored triangle.
    per_triangle: PerTriangle,
    brick_histogram: Vec<Bin>,
    trees: Trees,
}

impl<'a> Info<'a> {
    fn of(scene: &'a SceneFile, deep: bool) -> Result<Self> {
        let r = scene.resident();
        let m = &r.manifest;
        let bytes = |wanted: fn(&Payload) -> bool| -> u64 {
            r.payloads().filter(|(payload, _)| wanted(payload)).map(|(_, span)| span.bytes).sum()
        };
        // The world object always exists.
        let world = r.objects.first();
        let sections = Sections::of(scene);
        Ok(Self {
            format: FORMAT,
            file: scene.path().display().to_string(),
            file_bytes: scene.file_bytes(),
            resident_bytes: scene.resident_bytes(),
            generator: &m.generator,
            sources: &m.sources,
            triangles_stored: m.triangles_stored,
            triangles_instanced: m.triangles_instanced,
            triangle_ids: m.triangle_ids,
            dropped_zero_area: m.dropped_zero_area,
            dropped_non_finite: m.dropped_non_finite,
            bounds_min: m.min,
            bounds_max: m.max,
            objects: r.objects.len(),
            instances: r.instances.len(),
            instance_scale_ratio: m.instance_scale_ratio,
            bricks: r.bricks.len(),
            wide_bricks: r.bricks.iter().filter(|b| b.flags & BRICK_WIDE != 0).count(),
            brick_triangles: m.brick_triangles,
            largest_brick_triangles: r.bricks.iter().map(|b| b.triangle_count).max().unwrap_or(0),
            tallest_brick_levels: r.bricks.iter().map(|b| b.height).max().unwrap_or(0),
            geometry_bytes: bytes(|p| matches!(p, Payload::Geometry(_))),
            attribute_bytes: bytes(|p| matches!(p, Payload::Attributes(_))),
            loaded_attribute_bytes: r.bricks.iter().map(|b| AttributeLayout::of(b).bytes).sum(),
            proxy_bytes: bytes(|p| matches!(p, Payload::Proxies(_))),
            texture_bytes: bytes(|p| matches!(p, Payload::Texture(_) | Payload::Tile(_) | Payload::Opacity(_))),
            texture_tail_bytes: bytes(|p| matches!(p, Payload::Texture(_))),
            two_largest_bricks_bytes: scene_bytes(scene).sizes().two_largest_bricks(),
            least_cache_bytes: Residency::least_budget(scene_bytes(scene).sizes()),
            lattice_step: world.map_or(0.0, |o| 2f64.powi(o.step_log2)),
            device_unit: world.map_or(0.0, |o| 2f64.powi(o.unit_log2)),
            top_level_leaves: r.leaves.len(),
            top_level_nodes_binary: r.top2.len(),
            top_level_nodes_wide: r.top8.len(),
            materials: r.materials.len(),
            textures: r.textures.len(),
            texture_tiles: r.tiles.len(),
            texture_encodings: r
                .textures
                .iter()
                .map(Texture::encoding_name)
                .collect::<BTreeSet<_>>()
                .into_iter()
                .collect(),
            has_textures: m.has_textures,
            has_normal_maps: m.has_normal_maps,
            is_glossy: m.is_glossy,
            has_alpha_mask: m.has_alpha_mask,
            has_alpha_blend: m.has_alpha_blend,
            has_emission: m.has_emission,
            has_instances: m.has_instances,
            has_animation: m.has_animation,
            has_wide_bricks: m.has_wide_bricks,
            has_proxies: m.has_proxies,
            provenance_ranges: m.provenance.len(),
            movable: &m.movable,
            lights: r.lights.iter().map(Light::of).collect(),
            left_out: left_out(m),
            warnings: &m.warnings,
            per_triangle: PerTriangle::of(r, &sections, scene.file_bytes()),
            sections,
            brick_histogram: histogram(&r.bricks),
            trees: Trees::of(scene, deep)?,
        })
    }

    fn human(&self) -> String {
        let mut text = format!("{}\n", self.file);
        let mut row = |name: &str, value: String| {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "  {name:<18} {value}");
        };
        row("written by", self.generator.to_string());
        row("file", format!("{}, {} always resident", human_bytes(self.file_bytes), human_bytes(self.resident_bytes)));
        for source in self.sources {
            row("source", format!("{} ({}, xxh3 {})", source.name, human_bytes(source.bytes), source.hash));
        }
        row(
            "triangles",
            format!(
                "{} stored, {} with every instance, {} ids",
                human_count(self.triangles_stored),
                human_count(self.triangles_instanced),
                human_count(self.triangle_ids)
            ),
        );
        if self.dropped_zero_area + self.dropped_non_finite > 0 {
            let (zero, bad) = (human_count(self.dropped_zero_area), human_count(self.dropped_non_finite));
            row("dropped", format!("{zero} of zero area, {bad} with a non-finite vertex"));
        }
        if self.bricks > 0 {
            let [x0, y0, z0] = self.bounds_min;
            let [x1, y1, z1] = self.bounds_max;
            row("bounds", format!("[{x0}, {y0}, {z0}] to [{x1}, {y1}, {z1}]"));
        } else {
            row("bounds", "the scene is empty".into());
        }
        row(
            "objects",
            format!("{}, placed {} times, scale ratio {}", self.objects, self.instances, self.instance_scale_ratio),
        );
        row(
            "bricks",
            format!(
                "{} ({} wide) of at most {} triangles; largest {}, up to {} levels",
                human_count(self.bricks as u64),
                self.wide_bricks,
                self.brick_triangles,
                self.largest_brick_triangles,
                self.tallest_brick_levels
            ),
        );
        for line in human_histogram(&self.brick_histogram) {
            row("", line);
        }
        let payloads = [
            ("geometry", human_bytes(self.geometry_bytes)),
            (
                "attributes",
                format!("{} ({} loaded)", human_bytes(self.attribute_bytes), human_bytes(self.loaded_attribute_bytes)),
            ),
            ("proxies", human_bytes(self.proxy_bytes)),
            ("textures", human_bytes(self.texture_bytes)),
        ];
        row("payloads", payloads.map(|(name, bytes)| format!("{name} {bytes}")).join(", "));
        for line in self.sections.human() {
            row("sections", line);
        }
        row("a triangle", self.per_triangle.human());
        let what = if self.least_cache_bytes == self.two_largest_bricks_bytes {
            "two largest bricks"
        } else {
            "tiles of a lookup"
        };
        row("least cache", format!("{} (the {what})", human_bytes(self.least_cache_bytes)));
        row("lattice", format!("step {:e}, device unit {}, world units", self.lattice_step, self.device_unit));
        row(
            "top level",
            format!(
                "{} leaves, {} binary nodes, {} wide nodes",
                self.top_level_leaves, self.top_level_nodes_binary, self.top_level_nodes_wide
            ),
        );
        for (name, value) in self.trees.human() {
            row(name, value);
        }
        let textures = match self.textures {
            0 => "0 textures".into(),
            count => format!(
                "{count} textures ({}): {} tiles, {} of coarse levels always resident",
                self.texture_encodings.join(", "),
                human_count(self.texture_tiles as u64),
                human_bytes(self.texture_tail_bytes)
            ),
        };
        row("materials", format!("{}, {textures}", self.materials));
        for light in self.lights.iter().take(MOST_LIGHTS) {
            row("light", light.human());
        }
        if let Some(more) = self.lights.len().checked_sub(MOST_LIGHTS).filter(|more| *more > 0) {
            row("light", format!("and {} more", human_count(more as u64)));
        }
        for LeftOut { what, why } in &self.left_out {
            row("left out", format!("{what}: {why}"));
        }
        for warning in self.warnings {
            row("warning", warning.clone());
        }
        text
    }
}

/// Lights that are listed for people.
const MOST_LIGHTS: usize = 16;

/// A light without extent.
#[derive(Debug, PartialEq, Serialize)]
struct Light {
    /// point, spot or distant.
    kind: &'static str,
    /// World units.
    position: [f64; 3],
    /// Along the light.
    direction: [f64; 3],
    /// Candela, of distant lights lux.
    color: [f32; 3],
    /// World units; 0: nowhere.
    range: f32,
    /// Where a spot begins to fall off and where it ends, from its axis.
    cone_degrees: [f32; 2],
}

impl Light {
    fn of(light: &PunctualLight) -> Self {
        let PunctualLight { position, direction, color, range, .. } = *light;
        let kind = match light.kind {
            LIGHT_POINT => "point",
            LIGHT_SPOT => "spot",
            LIGHT_DISTANT => "distant",
            _ => "unknown",
        };
        Self { kind, position, direction, color, range, cone_degrees: light.cone.map(f32::to_degrees) }
    }

    fn human(&self) -> String {
        let Self { kind, position, direction, color, .. } = self;
        let range = if self.range > 0.0 { format!(", up to {}", self.range) } else { String::new() };
        let [inner, outer] = self.cone_degrees;
        match *kind {
            "distant" => format!("distant, {color:?} lux along {direction:?}"),
            "spot" => {
                format!("spot, {color:?} cd at {position:?} along {direction:?}, {inner} to {outer} degrees{range}")
            }
            _ => format!("{kind}, {color:?} cd at {position:?}{range}"),
        }
    }
}

/// Where a triangle comes from.
#[derive(Debug, PartialEq, Serialize)]
struct Origin {
    format: u32,
    id: u32,
    file: String,
    node: String,
    mesh: String,
    primitive: u32,
    /// Within the primitive, strips and fans expanded.
    triangle: u32,
}

impl Origin {
    fn human(&self) -> String {
        format!(
            "triangle {}: file {}, node {}, mesh {}, primitive {}, triangle {} of it\n",
            self.id, self.file, self.node, self.mesh, self.primitive, self.triangle
        )
    }
}

/// Finds a global triangle id in the manifest's provenance.
fn origin(scene: &SceneFile, id: u32) -> Result<Origin> {
    let manifest = &scene.resident().manifest;
    find(manifest, id).with_context(|| {
        let file = scene.path().display();
        match manifest.triangle_ids {
            0 => format!("{file}: no triangle has the id {id}; the scene is empty"),
            n => format!("{file}: no triangle has the id {id}; its ids are 0 to {}", n - 1),
        }
    })
}

fn find(manifest: &Manifest, id: u32) -> Option<Origin> {
    let after = manifest.provenance.partition_point(|p| p.first_id <= id);
    let p = &manifest.provenance[after.checked_sub(1)?];
    let triangle = id - p.first_id;
    let source = manifest.sources.get(p.source as usize);
    (triangle < p.count).then(|| Origin {
        format: FORMAT,
        id,
        file: source.map_or_else(|| format!("source {}", p.source), |s| s.name.clone()),
        node: p.node.clone(),
        mesh: p.mesh.clone(),
        primitive: p.primitive,
        triangle,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::{Provenance, Source};

    fn manifest() -> Manifest {
        let range = |first_id, count, node: &str| Provenance {
            first_id,
            count,
            source: 0,
            node: node.into(),
            mesh: "mesh".into(),
            primitive: first_id,
            under: Vec::new(),
        };
        Manifest {
            sources: vec![Source { name: "a.gltf".into(), bytes: 5, hash: "00".into() }],
            triangle_ids: 30,
            provenance: vec![range(0, 10, "left"), range(10, 0, "empty"), range(10, 20, "right")],
            ..Manifest::default()
        }
    }

    #[test]
    fn ids_are_traced_to_their_primitive() {
        let m = manifest();
        for (id, node, triangle) in [(0, "left", 0), (9, "left", 9), (10, "right", 0), (29, "right", 19)] {
            let o = find(&m, id).unwrap();
            assert_eq!((o.node.as_str(), o.triangle, o.file.as_str()), (node, triangle, "a.gltf"), "{id}");
        }
        assert_eq!(find(&m, 30), None);
        assert_eq!(find(&m, u32::MAX), None);
        assert_eq!(find(&Manifest::default(), 0), None);
        let text = find(&m, 12).unwrap().human();
        for part in ["triangle 12:", "a.gltf", "node right", "mesh mesh", "primitive 10", "triangle 2 of it"] {
            assert!(text.contains(part), "{text}");
        }
    }

    #[test]
    fn what_is_left_out_follows_the_manifest() {
        let names = |m: &Manifest| left_out(m).into_iter().map(|l| l.what).collect::<Vec<_>>();
        let bare = names(&Manifest::default());
        assert!(bare.contains(&"texture lookups".into()) && !bare.contains(&"animation".into()), "{bare:?}");
        let full = Manifest {
            has_textures: true,
            has_normal_maps: true,
            is_glossy: true,
            has_alpha_mask: true,
            has_alpha_blend: true,
            has_emission: true,
            has_instances: true,
            has_animation: true,
            has_wide_bricks: true,
            ..Manifest::default()
        };
        assert_eq!(names(&full), ["animation"]);
    }
}
