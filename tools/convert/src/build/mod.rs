//! Cuts a scene into bricks and writes the scene file.
//!
//! The order of the work is what makes images independent of how a scene is cut (numerics.md, "Positions"): triangles are
//! numbered in the order of the source (`objects`), a partition that ignores all settings gives the sizes from which each
//! object's lattice follows (`partition`, `lattice`), every position is rounded to it once (`triangle`), and only then are
//! bricks encoded (`brick`). Trees take their topology from floating-point builders (`binary`, `wide`), but their boxes are
//! exact integers (`node`). Everything is the same for any number of threads.

mod assemble;
mod attributes;
mod binary;
mod brick;
mod cut;
mod encode;
mod error;
mod gather;
mod intern;
mod lattice;
mod matrix;
mod node;
mod objects;
mod partition;
mod parts;
mod settings;
mod textures;
mod top_level;
mod triangle;
mod wide;

pub use error::BuildError;
pub use settings::{BuildSettings, BuildSummary};

use crate::progress::Progress;
use crate::source::{InMemory, Outline, Source, SourceScene};
use assemble::Dropped;
use attributes::MeanColors;
use brick::{BrickContext, EncodedBrick};
use bricks::{Manifest, Material, Resident, Texture, Writer};
use cut::ObjectCut;
use encode::{BrickWriter, Job};
use objects::{ObjectPlan, Placed};
use parts::Reader;
use rayon::prelude::*;
use std::path::Path;
use std::time::{Duration, Instant};
use triangle::Triangle;

/// Triangles a thread encodes before what is encoded is written, which bounds the memory.
const BATCH_TRIANGLES: usize = 1 << 18;

/// Stack of a worker: the partition recurses, and a thread that waits takes up other work on the same stack.
const STACK_BYTES: usize = 16 << 20;

/// Builds a scene that lies in memory, see [`build_source`].
pub fn build(
    scene: SourceScene,
    settings: &BuildSettings,
    output: &Path,
    progress: &Progress,
) -> Result<BuildSummary, BuildError> {
    build_source(&InMemory::from(scene), settings, output, progress)
}

/// Builds `source` into the scene file `output`, which appears whole or not at all.
///
/// The bytes of the file depend on the source and on the settings but for their `threads`. Ids and positions depend on
/// neither `threads` nor `brick_triangles`.
pub fn build_source(
    source: &dyn Source,
    settings: &BuildSettings,
    output: &Path,
    progress: &Progress,
) -> Result<BuildSummary, BuildError> {
    settings.check()?;
    objects::check(source.outline())?;
    let threads = settings.threads.unwrap_or(0);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK_BYTES).build()?;
    let summary = pool.install(|| run(source, settings, output, progress));
    progress.finish();
    summary
}

fn run(
    source: &dyn Source,
    settings: &BuildSettings,
    output: &Path,
    progress: &Progress,
) -> Result<BuildSummary, BuildError> {
    let mut clock = Clock::new();
    let outline = source.outline();
    let plan = objects::plan(outline, settings)?;
    let mut writer = Writer::create(output)?;
    let mut warnings = outline.warnings.clone();

    let textures = write_textures(source, &mut writer, &mut warnings, progress)?;
    clock.end("textures");
    let reader = Reader::eager(source, &plan, progress)?;
    clock.end("read");
    let (cuts, used_materials) = cut::in_memory(&reader, &plan, settings, progress)?;
    clock.end("partition");
    let lattices = cut::choose(&plan, &outline.meshes, &cuts, settings, &mut warnings)?;

    let contexts = encode::contexts(&lattices, &textures.material_means);
    let jobs = encode::jobs(cuts.iter().map(|cut| cut.bricks.as_slice()))?;
    progress.phase("bricks", jobs.iter().map(|job| job.count as u64).sum());
    let mut bricks = BrickWriter {
        writer: &mut writer,
        records: Vec::with_capacity(jobs.len()),
        dropped: vec![0; cuts.len()],
        batch_triangles: BATCH_TRIANGLES,
    };
    let encode = |job: &Job| encode_loaded(&reader, &plan.objects[job.object as usize], &cuts, &contexts, job);
    bricks.write(&jobs, encode, progress)?;
    let (bricks, rounded_away) = (bricks.records, bricks.dropped);
    clock.end("bricks");

    progress.phase("top level", 0);
    let objects = assemble::object_records(&plan, &lattices, &bricks);
    let instances = assemble::instance_records(&plan);
    let top = assemble::build_top(&objects, &instances, &lattices, &bricks)?;
    let mut resident = Resident {
        manifest: Manifest::default(),
        objects,
        instances,
        leaves: top.leaves,
        top2: top.top2,
        top8: top.top8,
        bricks,
        materials: textures.materials,
        textures: textures.records,
    };
    let dropped = Dropped::count(&resident, &cuts, &rounded_away);
    warnings.extend(source.repairs());
    dropped.warn(&mut warnings);
    resident.manifest = assemble::manifest(&resident, outline, plan, &used_materials, settings, &dropped, warnings);
    clock.end("top level");

    progress.check()?;
    writer.finish(&resident)?;
    clock.end("finish");
    let bytes_file = std::fs::metadata(output).map_or(0, |file| file.len());
    Ok(assemble::summary(&resident, bytes_file, clock.phases))
}

/// Encodes a brick of triangles whose geometry is in memory.
fn encode_loaded(
    reader: &Reader,
    object: &ObjectPlan,
    cuts: &[ObjectCut],
    contexts: &[BrickContext],
    job: &Job,
) -> (Option<EncodedBrick>, u32) {
    let context = &contexts[job.object as usize];
    let slots = &cuts[job.object as usize].order[job.first..job.first + job.count];
    let mut triangles = Vec::with_capacity(slots.len());
    let mut rest = slots;
    while let Some(&slot) = rest.first() {
        let part = &object.parts[object.part_of(slot)];
        let (own, after) = rest.split_at(rest.partition_point(|&slot| slot - part.first_slot < part.triangles));
        rest = after;
        // All parts in use were read.
        let Some(primitive) = reader.loaded(part) else { continue };
        let placed = Placed { part, primitive };
        let round = |slot: &u32| Triangle::round(&placed, slot - part.first_slot, &context.lattice, 0);
        triangles.extend(own.iter().filter_map(round));
    }
    let dropped = (slots.len() - triangles.len()) as u32;
    let count = triangles.len();
    ((count > 0).then(|| brick::encode(context, triangles.into_iter(), count)), dropped)
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

/// Materials and textures as they are stored.
#[derive(Clone, Debug)]
struct Textures {
    materials: Vec<Material>,
    material_means: Vec<MeanColors>,
    records: Vec<Texture>,
}

/// Writes the textures in use. One that cannot be read is left out with a warning.
fn write_textures(
    source: &dyn Source,
    writer: &mut Writer,
    warnings: &mut Vec<String>,
    progress: &Progress,
) -> Result<Textures, BuildError> {
    let Outline { textures: names, materials, .. } = source.outline();
    let used = textures::used(names.len(), materials);
    progress.phase("textures", used.len() as u64);
    let mut stored = textures::Stored::new(names.len());
    for chunk in used.chunks(rayon::current_num_threads()) {
        progress.check()?;
        let read = |&index: &usize| source.texture(index).map(|texture| textures::encode(&texture));
        let encoded: Vec<_> = chunk.par_iter().with_max_len(1).map(read).collect();
        for (&index, texture) in chunk.iter().zip(encoded) {
            match texture {
                Ok(texture) => stored.push(index, texture?, writer)?,
                Err(error) => warnings.push(format!("{error}; it is left out")),
            }
            progress.advance(1);
        }
    }
    let materials = stored.renumber(materials);
    let material_means = materials.iter().map(|material| MeanColors::of(material, &stored.means)).collect();
    Ok(Textures { materials, material_means, records: stored.records })
}
