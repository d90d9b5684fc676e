//! Cuts a scene into bricks and writes the scene file.
//!
//! The order of the work is what makes images independent of how a scene is cut (numerics.md, "Positions"): triangles are
//! numbered in the order of the source (`objects`), a partition that ignores all settings gives the sizes from which each
//! object's lattice follows (`partition`, `lattice`), every position is rounded to it once, and only then are bricks
//! encoded (`brick`). Trees take their topology from floating-point builders (`binary`, `wide`), but their boxes are
//! exact integers (`node`). Everything is the same for any number of threads.

mod attributes;
mod binary;
mod brick;
mod error;
mod gather;
mod intern;
mod lattice;
mod matrix;
mod node;
mod objects;
mod partition;
mod settings;
mod textures;
mod top_level;
mod wide;

pub use error::BuildError;
pub use settings::{BuildSettings, BuildSummary};

use crate::progress::Progress;
use crate::source::{SourceScene, SourceTexture};
use attributes::MeanColors;
use binary::Box3;
use brick::{BrickContext, EncodedBrick};
use bricks::{
    BRICK_WIDE, Brick, INSTANCE_IDENTITY, INSTANCE_MIRRORED, Instance, Leaf, MATERIAL_BLEND, MATERIAL_MASK, Manifest,
    Material, Node, Object, Resident, Texture, Writer,
};
use lattice::{COORDINATE_LIMIT, Extents, Lattice};
use matrix::Affine;
use objects::{ObjectPlan, Plan};
use partition::{Bounds, bounds};
use rayon::prelude::*;
use std::ops::Range;
use std::path::Path;
use std::time::{Duration, Instant};
use top_level::{TopLevel, world_box};

/// Triangles a thread encodes before what is encoded is written, which bounds the memory.
const CHUNK_TRIANGLES: usize = 1 << 18;

/// Stack of a worker: the partition recurses, and a thread that waits takes up other work on the same stack.
const STACK_BYTES: usize = 16 << 20;

/// Builds `scene` into the scene file `output`, which appears whole or not at all.
///
/// The bytes of the file depend on `scene` and on the settings but for their `threads`. Ids and positions depend on neither
/// `threads` nor `brick_triangles`.
pub fn build(
    scene: SourceScene,
    settings: &BuildSettings,
    output: &Path,
    progress: &Progress,
) -> Result<BuildSummary, BuildError> {
    settings.check()?;
    objects::check(&scene)?;
    let threads = settings.threads.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK_BYTES).build()?;
    let summary = pool.install(|| run(scene, settings, output, progress));
    progress.finish();
    summary
}

fn run(
    mut scene: SourceScene,
    settings: &BuildSettings,
    output: &Path,
    progress: &Progress,
) -> Result<BuildSummary, BuildError> {
    let mut clock = Clock::new();
    let mut writer = Writer::create(output)?;
    let mut warnings = std::mem::take(&mut scene.warnings);

    let source_textures = std::mem::take(&mut scene.textures);
    let (used, materials) = textures::used(source_textures.len(), &scene.materials);
    let (textures, texture_means) = write_textures(&source_textures, &used, &mut writer, progress)?;
    drop(source_textures);
    let means: Vec<MeanColors> = materials.iter().map(|material| MeanColors::of(material, &texture_means)).collect();
    clock.end("textures");

    let plan = objects::plan(&scene, settings)?;
    progress.phase("partition", plan.objects.iter().map(|object| u64::from(object.slots)).sum());
    let cuts = cut_objects(&plan, settings, progress)?;
    clock.end("partition");
    let lattices = choose_lattices(&plan, &cuts, settings, &mut warnings)?;

    let contexts: Vec<BrickContext> = (0u32..)
        .zip(plan.objects.iter().zip(&lattices))
        .map(|(index, (object, &lattice))| BrickContext { index, object, lattice, materials: &means })
        .collect();
    let (bricks, zero_area) = write_bricks(&contexts, &cuts, &mut writer, progress)?;
    clock.end("bricks");

    progress.phase("top level", 0);
    let objects = object_records(&plan, &lattices, &bricks);
    let instances = instance_records(&plan);
    let top = build_top(&objects, &instances, &lattices, &bricks)?;
    let mut resident = Resident {
        manifest: Manifest::default(),
        objects,
        instances,
        leaves: top.leaves,
        top2: top.top2,
        top8: top.top8,
        bricks,
        materials,
        textures,
    };
    let dropped = Dropped::count(&resident, &cuts, &zero_area);
    dropped.warn(&mut warnings);
    resident.manifest = manifest(&resident, &scene, plan, settings, &dropped, warnings);
    clock.end("top level");

    writer.finish(&resident)?;
    clock.end("finish");
    let bytes_file = std::fs::metadata(output).map_or(0, |file| file.len());
    Ok(summary(&resident, bytes_file, clock.phases))
}

/// Measures phases that follow each other.
struct Clock {
    start: Instant,
    phases: Vec<(&'static str, Duration)>,
}

impl Clock {
    fn new() -> Self {
        Self { start: Instant::now(), phases: Vec::new() }
    }

    fn end(&mut self, phase: &'static str) {
        self.phases.push((phase, self.start.elapsed()));
        self.start = Instant::now();
    }
}

/// Writes the textures in use; returns their records and mean colours.
fn write_textures(
    sources: &[SourceTexture],
    used: &[u32],
    writer: &mut Writer,
    progress: &Progress,
) -> Result<(Vec<Texture>, Vec<[f32; 3]>), BuildError> {
    progress.phase("textures", used.len() as u64);
    let (mut records, mut means) = (Vec::with_capacity(used.len()), Vec::with_capacity(used.len()));
    for chunk in used.chunks(rayon::current_num_threads()) {
        let encoded: Vec<_> = chunk.par_iter().map(|&index| textures::encode(&sources[index as usize])).collect();
        for texture in encoded {
            let texture = texture?;
            records.push(Texture { texels: writer.write(&texture.texels)?, ..texture.record });
            means.push(texture.mean);
            progress.advance(1);
        }
    }
    Ok((records, means))
}

/// An object cut into the triangles of its bricks.
struct CutObject {
    /// Slots in the order of the bricks.
    slots: Vec<u32>,
    /// Ranges of `slots`.
    bricks: Vec<Range<u32>>,
    extents: Extents,
    zero_area: u32,
    non_finite: u32,
}

fn cut_objects(plan: &Plan, settings: &BuildSettings, progress: &Progress) -> Result<Vec<CutObject>, BuildError> {
    let cut = |object: &ObjectPlan| {
        let mut gathered = gather::gather(object, settings.drop_non_finite)?;
        let all = if gathered.items.is_empty() {
            Bounds { min: [1.0; 3], max: [-1.0; 3] }
        } else {
            bounds(&gathered.items).0
        };
        let parts = partition::partition(&mut gathered.items, settings.brick_triangles as usize);
        progress.advance(u64::from(object.slots));
        Ok(CutObject {
            slots: gathered.items.iter().map(|item| item.index).collect(),
            bricks: parts.bricks,
            extents: Extents { name: object.name.clone(), chunks: parts.extents, min: all.min, max: all.max },
            zero_area: gathered.zero_area,
            non_finite: gathered.non_finite,
        })
    };
    let cuts: Vec<Result<CutObject, BuildError>> = plan.objects.par_iter().map(cut).collect();
    // The first error in order, whichever thread met one first.
    cuts.into_iter().collect()
}

/// Chooses the lattice of each object. The world's must also hold every instance, and follows from the instances' sizes
/// where nothing is baked.
fn choose_lattices(
    plan: &Plan,
    cuts: &[CutObject],
    settings: &BuildSettings,
    warnings: &mut Vec<String>,
) -> Result<Vec<Lattice>, BuildError> {
    let requested = settings.lattice_log2;
    let mut lattices = Vec::with_capacity(cuts.len());
    for cut in &cuts[1..] {
        lattices.push(cut.extents.lattice(requested, warnings)?);
    }
    let mut world = cuts[0].extents.clone();
    let mut all = match world.min[0] > world.max[0] {
        true => Bounds::EMPTY,
        false => Bounds { min: world.min, max: world.max },
    };
    let is_baked = world.median().is_some();
    for instance in &plan.instances {
        let extents = &cuts[instance.object as usize].extents;
        if extents.min[0] > extents.max[0] {
            continue;
        }
        let lattice = &lattices[instance.object as usize - 1];
        let rounded = |corner: [f64; 3]| lattice.round(corner).map(|x| lattice.length(x));
        let (min, max) = instance.matrix.bounds(rounded(extents.min), rounded(extents.max));
        if !min.iter().chain(&max).all(|x| x.abs() <= COORDINATE_LIMIT) {
            let (node, limit) = (instance.placement.name.clone(), COORDINATE_LIMIT);
            let mesh = plan.objects[instance.object as usize].parts[0].mesh.name.clone();
            return Err(BuildError::InstanceOutOfRange { node, mesh, limit });
        }
        all.extend(min, max);
        if let Some(median) = extents.median().filter(|_| !is_baked) {
            world.chunks.push(median * instance.matrix.determinant().abs().cbrt());
        }
    }
    if all.min[0] <= all.max[0] {
        (world.min, world.max) = (all.min, all.max);
    }
    lattices.insert(0, world.lattice(requested, warnings)?);
    Ok(lattices)
}

/// Encodes and writes all bricks in order. Returns their records, and by object the triangles dropped after rounding.
fn write_bricks(
    contexts: &[BrickContext],
    cuts: &[CutObject],
    writer: &mut Writer,
    progress: &Progress,
) -> Result<(Vec<Brick>, Vec<u32>), BuildError> {
    let jobs: Vec<(&BrickContext, &[u32])> = contexts
        .iter()
        .zip(cuts)
        .flat_map(|(context, cut)| {
            cut.bricks.iter().map(move |range| (context, &cut.slots[range.start as usize..range.end as usize]))
        })
        .collect();
    progress.phase("bricks", jobs.len() as u64);
    let limit = u64::from(u32::MAX / 2);
    if jobs.len() as u64 > limit {
        return Err(BuildError::TooMany { what: "bricks", found: jobs.len() as u64, limit });
    }
    let mut records = Vec::with_capacity(jobs.len());
    let mut zero_area = vec![0u32; contexts.len()];
    let mut ready: Vec<EncodedBrick> = Vec::new();
    let mut rest = jobs.as_slice();
    while !rest.is_empty() || !ready.is_empty() {
        let (chunk, after) = rest.split_at(chunk_length(rest));
        rest = after;
        // One chunk is written while the next is encoded.
        let (written, encoded) = rayon::join(
            || write_chunk(std::mem::take(&mut ready), writer, &mut records),
            || {
                let encode = |&(context, slots): &(&BrickContext, &[u32])| {
                    let (brick, dropped) = brick::encode(context, slots);
                    progress.advance(1);
                    (brick, context.index, dropped)
                };
                chunk.par_iter().map(encode).collect::<Vec<_>>()
            },
        );
        written?;
        for (brick, object, dropped) in encoded {
            ready.extend(brick);
            zero_area[object as usize] += dropped;
        }
    }
    Ok((records, zero_area))
}

/// How many of the next bricks are encoded before they are written.
fn chunk_length(jobs: &[(&BrickContext, &[u32])]) -> usize {
    let budget = CHUNK_TRIANGLES * rayon::current_num_threads();
    let mut triangles = 0;
    jobs.iter()
        .take_while(|(_, slots)| {
            let before = triangles;
            triangles += slots.len();
            before < budget
        })
        .count()
}

fn write_chunk(bricks: Vec<EncodedBrick>, writer: &mut Writer, records: &mut Vec<Brick>) -> Result<(), BuildError> {
    for brick in bricks {
        let geometry = writer.write(&brick.geometry)?;
        let attributes = writer.write(&brick.attributes)?;
        records.push(Brick { geometry, attributes, ..brick.record });
    }
    Ok(())
}

fn object_records(plan: &Plan, lattices: &[Lattice], bricks: &[Brick]) -> Vec<Object> {
    let mut first_brick = 0;
    (0u32..)
        .zip(plan.objects.iter().zip(lattices))
        .map(|(index, (object, lattice))| {
            let own = bricks[first_brick as usize..].iter().take_while(|brick| brick.object == index);
            let (brick_count, triangle_count) =
                own.fold((0, 0), |(bricks, triangles), brick| (bricks + 1, triangles + brick.triangle_count));
            let record = Object {
                step_log2: lattice.step_log2,
                unit_log2: lattice.unit_log2,
                first_brick,
                brick_count,
                triangle_ids: object.triangle_ids,
                triangle_count,
                _reserved: [0; 2],
            };
            first_brick += brick_count;
            record
        })
        .collect()
}

fn instance_records(plan: &Plan) -> Vec<Instance> {
    let world =
        Instance { object: 0, base: 0, flags: INSTANCE_IDENTITY, _reserved: 0, world_from_object: Instance::IDENTITY };
    let placed = plan.instances.iter().map(|instance| Instance {
        object: instance.object,
        base: instance.base,
        flags: if instance.matrix.determinant() < 0.0 { INSTANCE_MIRRORED } else { 0 },
        _reserved: 0,
        world_from_object: instance.matrix.0,
    });
    std::iter::once(world).chain(placed).collect()
}

fn build_top(
    objects: &[Object],
    instances: &[Instance],
    lattices: &[Lattice],
    bricks: &[Brick],
) -> Result<TopLevel, BuildError> {
    let leaves: Vec<Leaf> = (0u32..)
        .zip(instances)
        .flat_map(|(index, instance)| {
            let object = &objects[instance.object as usize];
            (object.first_brick..object.first_brick + object.brick_count)
                .map(move |brick| Leaf { instance: index, brick })
        })
        .collect();
    let boxes: Vec<Box3> = leaves
        .par_iter()
        .map(|leaf| {
            let (instance, brick) = (&instances[leaf.instance as usize], &bricks[leaf.brick as usize]);
            let own = Box3 { min: brick.min, max: brick.max };
            match leaf.instance {
                0 => own,
                _ => {
                    let matrix = Affine(instance.world_from_object);
                    world_box(own, &lattices[instance.object as usize], &matrix, &lattices[0])
                }
            }
        })
        .collect();
    top_level::build(&leaves, &boxes)
}

/// Triangles left out, instances multiplied out.
struct Dropped {
    zero_area: u64,
    non_finite: u64,
}

impl Dropped {
    fn count(resident: &Resident, cuts: &[CutObject], zero_area: &[u32]) -> Self {
        let mut dropped = Self { zero_area: 0, non_finite: 0 };
        for instance in &resident.instances {
            let object = instance.object as usize;
            dropped.zero_area += u64::from(zero_area[object]) + u64::from(cuts[object].zero_area);
            dropped.non_finite += u64::from(cuts[object].non_finite);
        }
        dropped
    }

    fn warn(&self, warnings: &mut Vec<String>) {
        if self.zero_area > 0 {
            warnings.push(format!("{} triangles without area were left out", self.zero_area));
        }
        if self.non_finite > 0 {
            warnings.push(format!("{} triangles with vertices that are not finite were left out", self.non_finite));
        }
    }
}

fn manifest(
    resident: &Resident,
    scene: &SourceScene,
    plan: Plan,
    settings: &BuildSettings,
    dropped: &Dropped,
    warnings: Vec<String>,
) -> Manifest {
    let step = lattice::pow2(resident.objects[0].step_log2);
    let (min, max) = resident
        .top2
        .first()
        .map_or(([1.0; 3], [-1.0; 3]), |root| (root.min.map(|x| x as f64 * step), root.max.map(|x| x as f64 * step)));
    let mut is_used = vec![false; resident.materials.len()];
    for part in plan.objects.iter().flat_map(|object| &object.parts) {
        is_used[part.primitive.material as usize] = true;
    }
    let any = |test: &dyn Fn(&Material) -> bool| {
        resident.materials.iter().zip(&is_used).any(|(material, is_used)| *is_used && test(material))
    };
    let instanced = resident.instances.iter().map(|instance| &resident.objects[instance.object as usize]);
    Manifest {
        generator: concat!("brickwalk ", env!("CARGO_PKG_VERSION")).to_owned(),
        sources: scene.sources.clone(),
        brick_triangles: settings.brick_triangles,
        triangle_ids: plan.triangle_ids,
        triangles_stored: resident.objects.iter().map(|object| u64::from(object.triangle_count)).sum(),
        triangles_instanced: instanced.map(|object| u64::from(object.triangle_count)).sum(),
        dropped_zero_area: dropped.zero_area,
        dropped_non_finite: dropped.non_finite,
        min,
        max,
        has_textures: any(&|material| material.base_color_texture != bricks::NONE),
        has_alpha_mask: any(&|material| material.flags & MATERIAL_MASK != 0),
        has_alpha_blend: any(&|material| material.flags & MATERIAL_BLEND != 0),
        has_emission: any(&|material| material.emission.iter().any(|x| *x > 0.0)),
        has_instances: resident.instances.len() > 1,
        has_animation: scene.has_animation,
        has_wide_bricks: resident.bricks.iter().any(|brick| brick.flags & BRICK_WIDE != 0),
        instance_scale_ratio: plan.instances.iter().fold(1.0, |most, instance| instance.matrix.scale_ratio().max(most)),
        warnings,
        provenance: plan.provenance,
    }
}

fn summary(resident: &Resident, bytes_file: u64, phases: Vec<(&'static str, Duration)>) -> BuildSummary {
    let manifest = &resident.manifest;
    let nodes = resident.bricks.iter().map(|brick| u64::from(brick.node_count)).sum();
    BuildSummary {
        objects: resident.objects.len() as u64,
        instances: resident.instances.len() as u64 - 1,
        bricks: resident.bricks.len() as u64,
        wide_bricks: resident.bricks.iter().filter(|brick| brick.flags & BRICK_WIDE != 0).count() as u64,
        leaves: resident.leaves.len() as u64,
        triangle_ids: manifest.triangle_ids,
        triangles_stored: manifest.triangles_stored,
        triangles_instanced: manifest.triangles_instanced,
        dropped_zero_area: manifest.dropped_zero_area,
        dropped_non_finite: manifest.dropped_non_finite,
        world_step_log2: resident.objects[0].step_log2,
        nodes,
        bytes_nodes: nodes * size_of::<Node>() as u64,
        bytes_geometry: resident.bricks.iter().map(|brick| brick.geometry.bytes).sum(),
        bytes_attributes: resident.bricks.iter().map(|brick| brick.attributes.bytes).sum(),
        bytes_textures: resident.textures.iter().map(|texture| texture.texels.bytes).sum(),
        bytes_file,
        warnings: manifest.warnings.clone(),
        phases,
    }
}
