//! `info`: what a `.bricks` file holds, and where a triangle comes from.

mod instances;
mod levels;
mod quality;

use super::cached;
use super::options::scene_args::InfoArgs;
use crate::cli::output::{print, print_json};
use crate::secondary::displacement::is_similarity;
use crate::session::{Origin, open_scene};
use crate::settings::sizes::{counted, human_bytes, human_count};
use crate::stream::PayloadSource;
use crate::stream::Residency;
use anyhow::{Context, Result};
use bricks::{
    BRICK_WIDE, Brick, DisplacementField, Instance, LIGHT_DISTANT, LIGHT_POINT, LIGHT_SPOT, Manifest, NEAR_STEPS,
    ORIGIN_STEPS, PunctualLight, Resident, SceneFile, Texture,
};
use levels::Levels;
use quality::{Bin, PerTriangle, Sections, Trees, histogram, human_histogram, loaded_attribute_bytes};
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// Raised when a field of the JSON changes its meaning.
pub const FORMAT: u32 = 4;

/// Farthest that a conversion lets a vertex be from the origin, steps.
const REACH_STEPS: i64 = 1 << 44;

/// Runs `info`.
///
/// # Errors
/// The file cannot be opened or is damaged, or no triangle has the id that was asked for.
pub fn run(args: &InfoArgs) -> Result<()> {
    let scene = open_scene(&cached::scene(&args.scene)?)?;
    if let Some(id) = args.id {
        let origin = origin(&scene, id)?;
        return if args.json { print_json(&Told { format: FORMAT, origin }) } else { print(&origin.human()) };
    }
    if args.instances {
        let rows = instances::rows(scene.resident());
        return if args.json { print_json(&rows) } else { print(&instances::human(&rows)) };
    }
    let info = Info::of(&scene, args.deep)?;
    if args.json { print_json(&info) } else { print(&info.human()) }
}

/// log2 of the finest step of the world's lattice, world units, at which none of its bricks is wide; that which it has
/// if one is.
fn finest_lattice(resident: &Resident) -> i32 {
    let step_log2 = resident.objects.first().map_or(0, |world| world.step_log2);
    let bricks = || resident.bricks.iter().filter(|brick| brick.object == 0);
    if bricks().any(|brick| brick.flags & BRICK_WIDE != 0) {
        return step_log2;
    }
    let extent = |brick: &Brick| (0..3).map(|k| brick.max[k] - brick.min[k]).max().unwrap_or(0);
    let reach = |brick: &Brick| brick.min.iter().chain(&brick.max).map(|x| x.abs()).max().unwrap_or(0);
    let (most, far) = bricks().fold((0, 0), |(most, far), brick| (most.max(extent(brick)), far.max(reach(brick))));
    // An origin lies up to ORIGIN_STEPS below the least vertex.
    let holds = |finer: &i32| (most << finer) + ORIGIN_STEPS <= NEAR_STEPS && far << finer <= REACH_STEPS;
    step_log2 - (1..=24).take_while(holds).last().unwrap_or(0)
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

/// What `info` prints.
#[derive(Debug, Serialize)]
struct Info<'a> {
    #[serde(skip)]
    scene: &'a SceneFile,
    /// Names and numbers.
    #[serde(flatten)]
    facts: Map<String, Value>,
    /// Lights without extent.
    lights: Vec<Light>,
    /// Displacement fields, where there are some.
    #[serde(skip_serializing_if = "Option::is_none")]
    displacement: Option<Displacement>,
    /// Levels of detail, where there are some.
    #[serde(skip_serializing_if = "Option::is_none")]
    levels: Option<Levels>,
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
        let sections = Sections::of(scene);
        // The world object always exists.
        let world = r.objects.first();
        let sizes = PayloadSource::sizes(scene);
        let facts: [(&str, Value); 52] = [
            ("format", FORMAT.into()),
            ("file", scene.path().display().to_string().into()),
            ("file_bytes", scene.file_bytes().into()),
            ("resident_bytes", scene.resident_bytes().into()),
            ("generator", json!(m.generator)),
            ("sources", json!(m.sources)),
            ("triangles_stored", m.triangles_stored.into()),
            ("triangles_instanced", m.triangles_instanced.into()),
            ("triangle_ids", m.triangle_ids.into()),
            ("dropped_zero_area", m.dropped_zero_area.into()),
            ("dropped_non_finite", m.dropped_non_finite.into()),
            ("bounds_min", json!(m.min)),
            ("bounds_max", json!(m.max)),
            ("objects", r.objects.len().into()),
            ("instances", r.instances.len().into()),
            ("instance_scale_ratio", m.instance_scale_ratio.into()),
            ("bricks", r.bricks.len().into()),
            ("wide_bricks", r.bricks.iter().filter(|b| b.flags & BRICK_WIDE != 0).count().into()),
            ("brick_triangles", m.brick_triangles.into()),
            ("largest_brick_triangles", r.bricks.iter().map(|b| b.triangle_count).max().unwrap_or(0).into()),
            ("tallest_brick_levels", r.bricks.iter().map(|b| b.height).max().unwrap_or(0).into()),
            ("geometry_bytes", sections.geometry().into()),
            // As they lie in the file.
            ("attribute_bytes", sections.attributes.into()),
            // As they are loaded.
            ("loaded_attribute_bytes", loaded_attribute_bytes(r).into()),
            // Occupancy maps that are read on demand.
            ("proxy_bytes", sections.proxies.into()),
            // Tiles and tails of textures.
            ("texture_bytes", sections.textures.into()),
            // Of these, tails: the coarse levels, which stay resident.
            ("texture_tail_bytes", r.textures.iter().map(|texture| texture.tail.bytes).sum::<u64>().into()),
            // Geometry and attributes of the two largest bricks, as loaded.
            ("two_largest_bricks_bytes", sizes.two_largest_bricks().into()),
            // What a cache must hold at least: the two largest bricks, or the tiles of a texture lookup.
            ("least_cache_bytes", Residency::least_budget(&sizes).into()),
            // Step of the world's lattice, world units.
            ("lattice_step", world.map_or(0.0, |o| 2f64.powi(o.step_log2)).into()),
            // What `convert --lattice` may be given at least, so that no brick of these is wide.
            ("finest_lattice_log2", finest_lattice(r).into()),
            // World units of one unit of length on the device.
            ("device_unit", world.map_or(0.0, |o| 2f64.powi(o.unit_log2)).into()),
            ("top_level_leaves", r.leaves.len().into()),
            ("top_level_nodes_binary", r.top2.len().into()),
            ("top_level_nodes_wide", r.top8.len().into()),
            ("materials", r.materials.len().into()),
            ("textures", r.textures.len().into()),
            // Tiles of their levels that are streamed.
            ("texture_tiles", r.tiles.len().into()),
            // How textures are stored, each encoding once: bc5, bc7, raw.
            ("texture_encodings", json!(encodings(scene))),
            ("has_textures", m.has_textures.into()),
            ("has_normal_maps", m.has_normal_maps.into()),
            ("is_glossy", m.is_glossy.into()),
            ("has_alpha_mask", m.has_alpha_mask.into()),
            ("has_alpha_blend", m.has_alpha_blend.into()),
            ("has_emission", m.has_emission.into()),
            ("has_own_light", m.has_own_light.into()),
            ("has_instances", m.has_instances.into()),
            ("has_animation", m.has_animation.into()),
            ("has_wide_bricks", m.has_wide_bricks.into()),
            ("has_proxies", m.has_proxies.into()),
            ("provenance_ranges", m.provenance.len().into()),
            // Names of nodes whose meshes were kept as instances, as the conversion was asked.
            ("movable", json!(m.movable)),
        ];
        Ok(Self {
            scene,
            facts: facts.into_iter().map(|(name, value)| (name.to_string(), value)).collect(),
            lights: r.lights.iter().map(Light::of).collect(),
            displacement: Displacement::of(&r.displacement, &r.instances),
            levels: Levels::of(r),
            left_out: left_out(m),
            warnings: &m.warnings,
            per_triangle: PerTriangle::of(r, &sections, scene.file_bytes()),
            sections,
            brick_histogram: histogram(&r.bricks),
            trees: Trees::of(scene, deep)?,
        })
    }

    fn human(&self) -> String {
        let m = &self.scene.resident().manifest;
        let number = |name: &str| self.facts[name].as_u64().unwrap_or(0);
        let count = |name: &str| human_count(number(name));
        let bytes = |name: &str| human_bytes(number(name));
        let real = |name: &str| self.facts[name].as_f64().unwrap_or(0.0);
        let mut text = format!("{}\n", self.scene.path().display());
        let mut row = |name: &str, value: String| {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "  {name:<18} {value}");
        };
        row("written by", m.generator.clone());
        row("file", format!("{}, {} always resident", bytes("file_bytes"), bytes("resident_bytes")));
        for source in &m.sources {
            row("source", format!("{} ({}, xxh3 {})", source.name, human_bytes(source.bytes), source.hash));
        }
        let [stored, instanced, ids] = ["triangles_stored", "triangles_instanced", "triangle_ids"].map(count);
        row("triangles", format!("{stored} stored, {instanced} with instances, {ids} ids"));
        if m.dropped_zero_area + m.dropped_non_finite > 0 {
            let [zero, bad] = ["dropped_zero_area", "dropped_non_finite"].map(count);
            row("skipped", format!("{zero} degenerate, {bad} with non-finite vertices"));
        }
        if number("bricks") > 0 {
            let ([x0, y0, z0], [x1, y1, z1]) = (m.min, m.max);
            row("bounds", format!("[{x0}, {y0}, {z0}] to [{x1}, {y1}, {z1}]"));
        } else {
            row("bounds", "the scene is empty".into());
        }
        let [objects, instances] = ["objects", "instances"].map(number);
        row("objects", format!("{objects}, placed {instances} times, scale ratio {}", m.instance_scale_ratio));
        let (all, most) = (count("bricks"), m.brick_triangles);
        let [wide, largest, tallest] = ["wide_bricks", "largest_brick_triangles", "tallest_brick_levels"].map(number);
        row(
            "bricks",
            format!("{all} ({wide} wide) of at most {most} triangles; largest {largest}, up to {tallest} levels"),
        );
        for line in human_histogram(&self.brick_histogram) {
            row("", line);
        }
        let [geometry, attributes, loaded, proxies, textures] =
            ["geometry_bytes", "attribute_bytes", "loaded_attribute_bytes", "proxy_bytes", "texture_bytes"].map(bytes);
        row(
            "payloads",
            format!(
                "geometry {geometry}, attributes {attributes} ({loaded} loaded), proxies {proxies}, textures {textures}"
            ),
        );
        for line in self.sections.human() {
            row("sections", line);
        }
        row("a triangle", self.per_triangle.human());
        let is_of_bricks = number("least_cache_bytes") == number("two_largest_bricks_bytes");
        let what = if is_of_bricks { "two largest bricks" } else { "tiles of a lookup" };
        row("least cache", format!("{} (the {what})", bytes("least_cache_bytes")));
        let (step, unit) = (real("lattice_step"), real("device_unit"));
        let mut lattice = format!("step 2^{} ({step:e}), device unit {unit}, world units", step.log2());
        if real("finest_lattice_log2") < step.log2() {
            lattice +=
                &format!("; convert --lattice {} rounds finest without wide bricks", real("finest_lattice_log2"));
        }
        row("lattice", lattice);
        let [leaves, binary, wide] = ["top_level_leaves", "top_level_nodes_binary", "top_level_nodes_wide"].map(number);
        row("top level", format!("{leaves} leaves, {binary} binary nodes, {wide} wide nodes"));
        for (name, value) in self.trees.human() {
            row(name, value);
        }
        let (tiles, coarse) = (count("texture_tiles"), bytes("texture_tail_bytes"));
        let textures = match number("textures") {
            0 => "0 textures".into(),
            textures => {
                let encodings = encodings(self.scene).join(", ");
                format!("{textures} textures ({encodings}): {tiles} tiles, {coarse} of coarse levels always resident")
            }
        };
        row("materials", format!("{}, {textures}", number("materials")));
        for light in self.lights.iter().take(MOST_LIGHTS) {
            row("light", light.human());
        }
        if let Some(more) = self.lights.len().checked_sub(MOST_LIGHTS).filter(|more| *more > 0) {
            row("light", format!("and {} more", human_count(more as u64)));
        }
        let levels = self.levels.iter().flat_map(Levels::human);
        for (name, value) in self.displacement.iter().flat_map(Displacement::human).chain(levels) {
            row(name, value);
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

/// How textures are stored, each encoding once.
fn encodings(scene: &SceneFile) -> Vec<&'static str> {
    let all: BTreeSet<_> = scene.resident().textures.iter().map(Texture::encoding_name).collect();
    all.into_iter().collect()
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

/// The displacement fields of a scene.
#[derive(Debug, PartialEq, Serialize)]
struct Displacement {
    fields: u64,
    /// Objects with a field of the whole of them.
    objects: u64,
    /// Bricks with a field of their own.
    bricks: u64,
    /// As they lie in the file.
    bytes: u64,
    /// As they are loaded.
    loaded_bytes: u64,
    /// Instances that no field answers for, as they are not scaled alike on all axes: rays against them are traced.
    uneven_instances: u64,
    /// How the fields are sampled, each way once.
    sampled: Vec<Sampled>,
}

/// How displacement fields are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
struct Sampled {
    rings: u32,
    /// On the sphere.
    positions: u64,
    /// Of each position.
    directions: u64,
    /// Of a sample.
    bits: u32,
    /// Fields that are sampled so.
    fields: u64,
}

impl Displacement {
    /// Nothing of no fields.
    fn of(records: &[DisplacementField], instances: &[Instance]) -> Option<Self> {
        let mut counts = BTreeMap::<_, u64>::new();
        for field in records {
            let directions = u64::from(field.directions) * u64::from(field.directions);
            *counts.entry((field.rings, field.positions(), directions, field.bits)).or_default() += 1;
        }
        let sampled = counts.into_iter().map(|((rings, positions, directions, bits), fields)| Sampled {
            rings,
            positions,
            directions,
            bits,
            fields,
        });
        let bricks = records.iter().filter_map(DisplacementField::of_brick).count() as u64;
        let fields = records.len() as u64;
        (fields > 0).then(|| Self {
            fields,
            objects: fields - bricks,
            bricks,
            bytes: records.iter().map(|field| field.span.bytes).sum(),
            loaded_bytes: records.iter().map(DisplacementField::loaded_bytes).sum(),
            uneven_instances: instances.iter().filter(|instance| !is_similarity(instance)).count() as u64,
            sampled: sampled.collect(),
        })
    }

    /// Rows for people.
    fn human(&self) -> Vec<(&'static str, String)> {
        let (objects, bricks) = (counted(self.objects, "object"), counted(self.bricks, "brick"));
        let (loaded, stored) = (human_bytes(self.loaded_bytes), human_bytes(self.bytes));
        let all = counted(self.fields, "field");
        let mut rows =
            vec![("displacement", format!("{all} of {objects} and {bricks}, {loaded} loaded, {stored} stored"))];
        if self.uneven_instances > 0 {
            let uneven = counted(self.uneven_instances, "instance");
            rows.push(("", format!("none for {uneven}, scaled unevenly: rays against them are traced")));
        }
        rows.extend(self.sampled.iter().map(|sampled| {
            let Sampled { positions, directions, bits, fields, .. } = sampled;
            let (fields, bits) = (counted(*fields, "field"), counted((*bits).into(), "bit"));
            ("", format!("{fields} of {positions} positions x {directions} directions, {bits} a sample"))
        }));
        rows
    }
}

/// Where a triangle comes from, as JSON has it.
#[derive(Debug, Serialize)]
struct Told {
    format: u32,
    #[serde(flatten)]
    origin: Origin,
}

/// Finds a global triangle id in the manifest's provenance.
fn origin(scene: &SceneFile, id: u32) -> Result<Origin> {
    let manifest = &scene.resident().manifest;
    Origin::of(manifest, id).with_context(|| {
        let file = scene.path().display();
        match manifest.triangle_ids {
            0 => format!("{file}: no triangle has id {id}; the scene is empty"),
            n => format!("{file}: no triangle has id {id}; ids are 0 to {}", n - 1),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn displacement_fields_are_counted() {
        let field = |brick, rings, directions, bits| DisplacementField {
            brick,
            rings,
            directions,
            bits,
            span: bricks::Span { offset: 4096, bytes: 32, checksum: 0 },
            ..bytemuck::Zeroable::zeroed()
        };
        assert_eq!(Displacement::of(&[], &[]), None);
        let fields = [field(3, 16, 4, 8), field(4, 16, 4, 8), field(bricks::NONE, 8, 4, 1)];
        let [even, uneven] = [2.0, 3.0].map(|y| {
            let mut world_from_object = [0.0; 12];
            (world_from_object[0], world_from_object[5], world_from_object[10]) = (2.0, y, 2.0);
            Instance { world_from_object, ..bytemuck::Zeroable::zeroed() }
        });
        let found = Displacement::of(&fields, &[even, uneven, even]).unwrap();
        let sampled = |rings, positions, bits, fields| Sampled { rings, positions, directions: 16, bits, fields };
        assert_eq!(
            found,
            Displacement {
                fields: 3,
                objects: 1,
                bricks: 2,
                bytes: 96,
                loaded_bytes: 2 * 1090 * 16 + 592,
                uneven_instances: 1,
                sampled: vec![sampled(8, 290, 1, 1), sampled(16, 1090, 8, 2)],
            }
        );
        let rows: Vec<String> = found.human().into_iter().map(|(name, value)| format!("{name}: {value}")).collect();
        assert_eq!(
            rows,
            [
                "displacement: 3 fields of 1 object and 2 bricks, 34.6 KiB loaded, 96 B stored",
                ": none for 1 instance, scaled unevenly: rays against them are traced",
                ": 1 field of 290 positions x 16 directions, 1 bit a sample",
                ": 2 fields of 1090 positions x 16 directions, 8 bits a sample",
            ]
        );
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
