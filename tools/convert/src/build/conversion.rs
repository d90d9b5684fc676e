//! The steps of a conversion, in memory and by way of the disk.

use super::assemble::{self, Dropped};
use super::bounded::budget::{self, Budget};
use super::bounded::chunks::WrittenBricks;
use super::bounded::cuts::{Bounded, BoundedCuts};
use super::bounded::distribute::Distribution;
use super::crew::Hands;
use super::cut::cuts::{self, ObjectCut};
use super::disk::journal::{self, Journal, Step, WordReader, Words};
use super::disk::scratch::{self, Scratch};
use super::encode::brick::{self, BrickContext, EncodedBrick};
use super::encode::jobs::{self, BrickWriter, Job};
use super::error::BuildError;
use super::input::objects::{ObjectPlan, Placed, Plan};
use super::input::parts::Reader;
use super::levels::{self, Flattened, LevelWriter, Levels};
use super::settings::{BuildSettings, BuildSummary, TextureEncoding};
use super::texture::mips::{self, Textures};
use super::texture::opacity::Opacities;
use super::tree::top_level::TopLevel;
use super::triangles::lattice::Lattice;
use super::triangles::triangle::{Detailed, Plain, Stored, Triangle};
use crate::progress::Progress;
use crate::source::{Outline, Source};
use bricks::{Brick, Manifest, Material, Occupancy, Partial, Resident, Writer};
use std::fmt::{self, Write};
use std::path::Path;
use std::time::{Duration, Instant};
use xxhash_rust::xxh3::Xxh3;

/// Triangles a thread encodes before what is encoded is written, where everything is in memory.
const BATCH_TRIANGLES: usize = 1 << 18;

/// Stack of a worker: the partition recurses, and a thread that waits takes up other work on the same stack.
const STACK_BYTES: usize = 16 << 20;

/// One conversion.
pub(super) struct Conversion<'a> {
    /// What is converted.
    pub source: &'a dyn Source,
    /// Its outline.
    pub outline: &'a Outline,
    /// What is built.
    pub plan: Plan<'a>,
    /// How.
    pub settings: &'a BuildSettings,
    /// Where to.
    pub output: &'a Path,
    /// By whom.
    pub hands: Hands<'a>,
    /// Who watches.
    pub progress: &'a Progress,
}

/// What is written, but for the resident part.
struct Written {
    textures: Textures,
    opacities: Opacities,
    cuts: Vec<ObjectCut>,
    used_materials: Vec<u64>,
    lattices: Vec<Lattice>,
    bricks: Vec<Brick>,
    occupancy: Vec<Occupancy>,
    /// Triangles that rounding left without area, by object.
    rounded_away: Vec<u32>,
    /// Levels of detail, and the materials that they add.
    levels: Levels,
    added_materials: Vec<Material>,
    warnings: Vec<String>,
}

impl Written {
    fn without_levels(
        (textures, opacities, warnings): (Textures, Opacities, Vec<String>),
        (cuts, used_materials, lattices): (Vec<ObjectCut>, Vec<u64>, Vec<Lattice>),
        (bricks, occupancy, rounded_away): (Vec<Brick>, Vec<Occupancy>, Vec<u32>),
    ) -> Self {
        Self {
            textures,
            opacities,
            cuts,
            used_materials,
            lattices,
            bricks,
            occupancy,
            rounded_away,
            levels: Levels::default(),
            added_materials: Vec::new(),
            warnings,
        }
    }
}

impl Conversion<'_> {
    /// Converts with all geometry in memory.
    pub fn in_memory(&self) -> Result<BuildSummary, BuildError> {
        let mut clock = Clock::new();
        // The name of the temporary file is known, so that the next conversion replaces what a killed one left.
        let partial = Writer::reserve(self.output)?;
        let scratch = scratch::path_for(self.output, self.settings);
        if scratch::earlier(&scratch, self.settings.resume)?.is_some() {
            partial.keep();
            return Err(BuildError::OtherConversion { path: scratch });
        }
        let mut writer = partial.start()?;
        let written = self.write_in_memory(&mut writer, &mut clock)?;
        self.finish(written, writer, clock)
    }

    fn write_in_memory(&self, writer: &mut Writer, clock: &mut Clock) -> Result<Written, BuildError> {
        let Self { outline, plan, settings, progress, .. } = self;
        let textures =
            mips::write(self.source, self.texture_settings(), rayon::current_num_threads(), writer, progress)?;
        let opacities = self.write_opacity(&textures, writer)?;
        let mut warnings = textures.warnings.clone();
        clock.end("textures");
        let reader = Reader::eager(self.source, plan, progress)?;
        clock.end("read");
        warnings.extend(self.source.repairs());
        let (cuts, used_materials) = cuts::in_memory(&reader, plan, settings, progress)?;
        clock.end("partition");
        let lattices = cuts::choose(plan, &outline.meshes, &cuts, settings, &mut warnings)?;
        let means = textures.material_means();
        let opacity = opacities.of_materials(&textures.materials);
        let wants = textures.wants();
        let contexts = jobs::contexts(&lattices, &means, &opacity, &wants, settings);
        let jobs = jobs::jobs(cuts.iter().map(|cut| cut.bricks.as_slice()))?;
        progress.phase("bricks", jobs.iter().map(|job| job.count as u64).sum());
        let mut bricks = BrickWriter::new(writer, cuts.len(), BATCH_TRIANGLES);
        let encode = |job: &Job| encode_loaded(&reader, &plan.objects[job.object as usize], &cuts, &contexts, job);
        bricks.write(&jobs, encode, progress)?;
        let (bricks, occupancy, rounded_away) = (bricks.records, bricks.occupancy, bricks.dropped);
        clock.end("bricks");
        let (images, pieces) = ((textures, opacities, warnings), (cuts, used_materials, lattices));
        let mut written = Written::without_levels(images, pieces, (bricks, occupancy, rounded_away));
        budget::keep();
        self.write_levels(&mut written, (Some(writer), None), BATCH_TRIANGLES)?;
        clock.end("levels");
        Ok(written)
    }

    /// How textures are stored, and whether small copies of them are wanted.
    fn texture_settings(&self) -> (TextureEncoding, bool) {
        (self.settings.textures, self.settings.lod)
    }

    /// Writes levels of detail over the bricks, if they are wanted.
    fn write_levels(
        &self,
        written: &mut Written,
        (writer, on_disk): (Option<&mut Writer>, Option<(&Scratch, &mut Journal)>),
        batch_triangles: usize,
    ) -> Result<(), BuildError> {
        if !self.settings.lod {
            return Ok(());
        }
        let Written { textures, opacities, lattices, bricks, used_materials: used, .. } = &*written;
        let (means, opacity) = (textures.material_means(), opacities.of_materials(&textures.materials));
        let flattened = Flattened::of(textures, (&means, &opacity), used);
        let settings = BuildSettings { proxies: false, ..self.settings.clone() };
        let contexts = jobs::contexts(lattices, &flattened.means, &flattened.opacity, &flattened.wants, &settings);
        let instances = assemble::instance_records(&self.plan);
        let plan = levels::Plan::of(&levels::Scene {
            objects: &assemble::object_records(&self.plan, lattices, bricks),
            lattices,
            bricks,
            placed: self.plan.resting(&settings.movable),
            brick_triangles: settings.brick_triangles,
        });
        let maker = levels::Maker {
            bricks,
            instances: &instances,
            contexts: &contexts,
            flattened: &flattened,
            brick_triangles: settings.brick_triangles,
            progress: self.progress,
        };
        let levels = match (on_disk, writer) {
            (Some((scratch, journal)), writer) if self.hands.are_many() => {
                let partial = self.output;
                levels::LevelTasks { maker, writer, hands: self.hands, scratch, partial }.write(&plan, journal)?
            }
            (on_disk, Some(writer)) => {
                let journal = on_disk.map(|(_, journal)| journal);
                LevelWriter { maker, writer, batch_triangles }.write(&plan, journal)?
            }
            (_, None) => Levels::default(),
        };
        let added = flattened.added;
        (written.levels, written.added_materials) = (levels, added);
        Ok(())
    }

    fn write_opacity(&self, textures: &Textures, writer: &mut Writer) -> Result<Opacities, BuildError> {
        let is_stored = |texture| textures.is_stored(texture);
        Opacities::write(self.source, &self.outline.materials, is_stored, writer, self.progress)
    }

    /// Converts by way of the disk.
    pub fn bounded(&self, budget: Budget) -> Result<BuildSummary, BuildError> {
        let mut clock = Clock::new();
        let (mut scratch, mut journal, mut writer) = self.begin(&budget)?;
        clock.end("begin");
        match self.write_bounded(budget, &scratch, &mut journal, Some(&mut writer), &mut clock) {
            Ok(written) => self.finish(written, writer, clock),
            Err(error @ (BuildError::Interrupted(_) | BuildError::Crew { .. })) => {
                writer.keep();
                scratch.keep(true);
                match error {
                    BuildError::Interrupted(_) => Err(BuildError::Paused { scratch: scratch.path().to_owned() }),
                    other => Err(other),
                }
            }
            Err(error) => Err(error),
        }
    }

    /// Goes through a conversion that another process leads, to the task that this one does there: of the step after
    /// `steps` others.
    pub fn task(&self, steps: u64) -> Result<(), BuildError> {
        let path = scratch::path_for(self.output, self.settings);
        let (mut scratch, mut journal) = Scratch::visit(path, steps)?;
        let words = journal.step(Step::Begin, || Ok(Vec::new()))?;
        let budget = words.get(1..).and_then(|words| Budget::take(&mut WordReader(words)));
        let budget = budget.ok_or_else(|| journal.damaged())?;
        if words != self.identity(&budget) {
            return Err(BuildError::OtherTask { path: scratch.path().to_owned() });
        }
        scratch.name(words[0]);
        let pool = pool(budget.threads)?;
        match pool.install(|| self.write_bounded(budget, &scratch, &mut journal, None, &mut Clock::new())) {
            Err(BuildError::TaskDone) => Ok(()),
            Err(error) => Err(error),
            Ok(_) => Err(BuildError::OtherTask { path: scratch.path().to_owned() }),
        }
    }

    /// Starts anew, or goes on where an earlier run was interrupted.
    fn begin(&self, budget: &Budget) -> Result<(Scratch, Journal, Writer), BuildError> {
        let partial = Writer::reserve(self.output)?;
        let path = scratch::path_for(self.output, self.settings);
        let identity = self.identity(budget);
        if let Some(mut journal) = scratch::earlier(&path, self.settings.resume)? {
            if let Some(writer) = self.go_on(&mut journal, &path, partial, &identity)? {
                return Ok((Scratch::of(path, identity[0], self.hands.are_many()), journal, writer));
            }
            // The file was finished, but the scratch folder was not removed any more.
            drop((journal, Scratch::of(path.clone(), identity[0], false)));
            return self.start(path, Writer::reserve(self.output)?, identity);
        }
        self.start(path, partial, identity)
    }

    fn start(
        &self,
        path: std::path::PathBuf,
        partial: Partial,
        identity: Vec<u64>,
    ) -> Result<(Scratch, Journal, Writer), BuildError> {
        let (scratch, mut journal) = Scratch::create(path, identity[0], self.hands.are_many())?;
        journal.step(Step::Begin, || Ok(identity))?;
        Ok((scratch, journal, partial.start()?))
    }

    /// The writer as the steps of the journal left it; `None` if its file is gone.
    fn go_on(
        &self,
        journal: &mut Journal,
        scratch: &Path,
        partial: Partial,
        identity: &[u64],
    ) -> Result<Option<Writer>, BuildError> {
        if self.hands.are_many() {
            journal.share();
        }
        if journal.step(Step::Begin, || Ok(identity.to_vec()))? != identity {
            partial.keep();
            return Err(BuildError::OtherConversion { path: scratch.to_owned() });
        }
        match journal.written()? {
            Some(_) if partial.is_empty() => Ok(None),
            Some((position, spans)) => {
                self.progress.phase("check", spans.iter().map(|span| span.bytes).sum());
                Ok(Some(partial.resume(position, spans, &mut |bytes| self.progress.advance(bytes))?))
            }
            None => Ok(Some(partial.start()?)),
        }
    }

    /// A number that only the same conversion has, and the budget, which other processes need not come to by
    /// themselves.
    fn identity(&self, budget: &Budget) -> Vec<u64> {
        let settings = BuildSettings { resume: false, scratch: None, ..self.settings.clone() };
        let mut hash = Hash(Xxh3::new());
        // Hashing does not fail.
        let version = (env!("CARGO_PKG_VERSION"), bricks::layout::VERSION, self.hands.are_many());
        let _ = write!(hash, "{version:?} {budget:?} {settings:?} {:?}", self.outline);
        let mut words = Words::default();
        budget.put(words.put(hash.0.digest()));
        words.0
    }

    fn write_bounded(
        &self,
        budget: Budget,
        scratch: &Scratch,
        journal: &mut Journal,
        mut writer: Option<&mut Writer>,
        clock: &mut Clock,
    ) -> Result<Written, BuildError> {
        let Self { outline, plan, settings, hands, progress, .. } = self;
        let hands = *hands;
        // Only the process that leads writes the scene file, and only it comes to steps that do.
        let other = || BuildError::OtherTask { path: scratch.path().to_owned() };
        let words = journal.step(Step::Textures, || {
            let writer = writer.as_deref_mut().ok_or_else(other)?;
            // One at a time, for images may be large.
            let textures = mips::write(self.source, self.texture_settings(), 1, writer, progress)?;
            Ok(textures.to_words(writer.checkpoint()?))
        })?;
        let textures = Textures::from_words(&words, outline).ok_or_else(|| journal.damaged())?;
        let words = journal.step(Step::Opacity, || {
            let writer = writer.as_deref_mut().ok_or_else(other)?;
            let opacities = self.write_opacity(&textures, writer)?;
            Ok(opacities.to_words(writer.checkpoint()?))
        })?;
        let opacities = Opacities::from_words(&words, outline.materials.len()).ok_or_else(|| journal.damaged())?;
        let mut warnings = textures.warnings.clone();
        clock.end("textures");
        let reader = Reader::lazy(self.source);
        let bounded = Bounded { reader: &reader, plan, settings, budget, scratch, hands, progress };
        let cuts = bounded.cut(journal)?;
        let is_continued = journal.is_continued();
        let words = journal.step(Step::Repairs, || {
            // Repairs are known once all parts have been read. Those of steps that an earlier run did, or other
            // processes, have not; but the shards tell whether there are any.
            if cuts.is_repaired && (is_continued || hands.are_many()) {
                bounded.read_all()?;
            }
            Ok(journal::words_of_texts(&self.source.repairs()))
        })?;
        warnings.extend(journal::texts_of_words(&words).ok_or_else(|| journal.damaged())?);
        clock.end("partition");
        let lattices = cuts::choose(plan, &outline.meshes, &cuts.objects, settings, &mut warnings)?;
        let means = textures.material_means();
        let opacity = opacities.of_materials(&textures.materials);
        let wants = textures.wants();
        let contexts = jobs::contexts(&lattices, &means, &opacity, &wants, settings);
        let jobs = jobs::jobs(cuts.objects.iter().map(|cut| cut.bricks.as_slice()))?;
        let distribution = Distribution::new(&bounded, &jobs, &contexts);
        let by_disk = (&distribution, &cuts);
        let (bricks, rounded_away) = if wants.iter().any(|wants| wants.details) {
            write_bricks::<Detailed>(by_disk, writer.as_deref_mut(), journal, clock)?
        } else {
            write_bricks::<Plain>(by_disk, writer.as_deref_mut(), journal, clock)?
        };
        let WrittenBricks { records: bricks, occupancy } = bricks;
        clock.end("bricks");
        let (cuts, used_materials) = (cuts.objects, cuts.materials);
        let (images, pieces) = ((textures, opacities, warnings), (cuts, used_materials, lattices));
        let mut written = Written::without_levels(images, pieces, (bricks, occupancy, rounded_away));
        self.write_levels(&mut written, (writer, Some((scratch, journal))), budget.batch)?;
        clock.end("levels");
        Ok(written)
    }

    /// Builds the resident part and finishes the file.
    fn finish(&self, written: Written, writer: Writer, mut clock: Clock) -> Result<BuildSummary, BuildError> {
        let Written {
            textures,
            opacities,
            cuts,
            used_materials,
            lattices,
            bricks,
            occupancy,
            rounded_away,
            levels,
            added_materials,
            mut warnings,
        } = written;
        let mut materials = textures.materials;
        opacities.name_maps(&mut materials);
        materials.extend(added_materials);
        self.progress.phase("top level", 0);
        let objects = assemble::object_records(&self.plan, &lattices, &bricks);
        let instances = assemble::instance_records(&self.plan);
        let top = assemble::build_top(&objects, &instances, &lattices, &bricks)?;
        let level_top = match levels.records.as_slice() {
            [] => TopLevel::default(),
            levels => assemble::build_level_top(&objects, &instances, &lattices, (&bricks, levels))?,
        };
        let mut resident = Resident {
            manifest: Manifest::default(),
            objects,
            instances,
            leaves: top.leaves,
            top2: top.top2,
            top8: top.top8,
            bricks,
            materials,
            textures: textures.records,
            opacity_maps: opacities.records,
            tiles: textures.tiles,
            lights: self.outline.lights.clone(),
            occupancy,
            displacement: Vec::new(),
            levels: levels.records,
            level_leaves: level_top.leaves,
            level_top2: level_top.top2,
            level_top8: level_top.top8,
        };
        let dropped = Dropped::count(&resident, &cuts, &rounded_away);
        dropped.warn(&mut warnings);
        let made = (self.outline, &self.plan, self.settings);
        resident.manifest = Manifest {
            texture_names: textures.names,
            ..assemble::manifest(&resident, made, &used_materials, &dropped, warnings)
        };
        clock.end("top level");
        writer.finish(&resident)?;
        clock.end("finish");
        let bytes_file = std::fs::metadata(self.output).map_or(0, |file| file.len());
        Ok(assemble::summary(&resident, bytes_file, clock.phases))
    }
}

/// Brings triangles together on the disk as `T` and encodes them. Returns the bricks, and by object how many triangles
/// rounding leaves without area.
fn write_bricks<T: Stored>(
    (distribution, cuts): (&Distribution, &BoundedCuts),
    writer: Option<&mut Writer>,
    journal: &mut Journal,
    clock: &mut Clock,
) -> Result<(WrittenBricks, Vec<u32>), BuildError> {
    let rounded_away = distribution.distribute::<T>(cuts, journal)?;
    clock.end("distribute");
    Ok((distribution.encode::<T>(writer, journal)?, rounded_away))
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
        let wants = context.wants[primitive.material as usize];
        let round = |slot: &u32| Triangle::round(&placed, slot - part.first_slot, &context.lattice, 0, wants);
        triangles.extend(own.iter().filter_map(round));
    }
    let dropped = (slots.len() - triangles.len()) as u32;
    let count = triangles.len();
    ((count > 0).then(|| brick::encode(context, triangles.into_iter(), count)), dropped)
}

/// The threads of a conversion.
pub(super) fn pool(threads: usize) -> Result<rayon::ThreadPool, BuildError> {
    Ok(rayon::ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK_BYTES).build()?)
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

/// Hashes text as it is formatted.
struct Hash(Xxh3);

impl Write for Hash {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}
