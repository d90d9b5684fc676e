//! Fields for a scene: which are made, with how many samples, and what of a stopped run is kept.

use super::bake::{Bench, Job, bake};
use super::field::code_of;
use super::shape::{MOST_RINGS, Shape};
use super::subject::{Subject, is_similarity};
use anyhow::{Context, Result, bail};
use bricks::{Resident, SceneFile, Writer};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use xxhash_rust::xxh3::xxh3_64;

/// Raised when the same settings make other samples.
const MAKING: u64 = 1;
/// A brick's field has at most one over so many of the bytes of its geometry.
pub const BRICK_PART: u64 = 8;
/// Directions on each axis that fields of bricks may have.
const BRICK_DIRECTIONS: [u32; 6] = [4, 6, 8, 12, 16, 24];

/// Which fields are made, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Making {
    /// Of objects that are placed more than once, with so many samples.
    pub objects: Option<Shape>,
    /// Of bricks of objects that are placed once.
    pub bricks: bool,
    /// Bits of a sample, 8 or 1.
    pub bits: u32,
}

/// The samples of a brick's field that fit into `bytes`, with the least error that is to be expected; `None`: too few.
///
/// The nearest position is off by about half of the distance between two, 0.8 / m of the radius, the nearest direction
/// by about 1.2 / n of it where a ray meets something.
pub fn fitting(bytes: u64, bits: u32) -> Option<Shape> {
    let error = |shape: &Shape| (0.8 / f64::from(shape.rings)).powi(2) + (1.2 / f64::from(shape.directions)).powi(2);
    let of = |directions| {
        let shapes = (2..=MOST_RINGS).map(|rings| Shape { rings, directions });
        shapes.take_while(|shape| (shape.samples() * u64::from(bits)).div_ceil(8).next_multiple_of(16) <= bytes).last()
    };
    BRICK_DIRECTIONS.into_iter().filter_map(of).min_by(|a, b| error(a).total_cmp(&error(b)))
}

/// The fields of a scene, in the order of the file: of what, with how many samples.
pub fn plan(resident: &Resident, making: &Making) -> Vec<(Subject, Shape)> {
    let mut placed = vec![[0u32; 2]; resident.objects.len()];
    for instance in &resident.instances {
        let [all, similar] = &mut placed[instance.object as usize];
        *all += 1;
        *similar += u32::from(is_similarity(instance));
    }
    let mut all = Vec::new();
    for (object, (record, [count, similar])) in (0..).zip(resident.objects.iter().zip(placed)) {
        if similar == 0 || record.brick_count == 0 {
            continue;
        }
        if count > 1 {
            all.extend(making.objects.map(|shape| (Subject { object, brick: None }, shape)));
            continue;
        }
        let bricks = record.first_brick..record.first_brick + record.brick_count;
        all.extend(bricks.filter(|_| making.bricks).filter_map(|brick| {
            let bytes = resident.bricks[brick as usize].geometry.bytes / BRICK_PART;
            fitting(bytes, making.bits).map(|shape| (Subject { object, brick: Some(brick) }, shape))
        }));
    }
    all.sort_by_key(|(subject, _)| subject.order());
    all
}

/// The samples of a field as they are traced.
struct Samples {
    bits: u32,
    bytes: Vec<u8>,
    met: u64,
    shares: f64,
}

impl Samples {
    fn new(shape: Shape, bits: u32) -> Self {
        let bytes = (shape.samples() * u64::from(bits)).div_ceil(8).next_multiple_of(16);
        Self { bits, bytes: vec![0; bytes as usize], met: 0, shares: 0.0 }
    }

    fn take(&mut self, first: u64, shares: &[f32]) {
        for (at, &share) in (first as usize..).zip(shares) {
            let met = (share >= 0.0).then_some(share);
            match self.bits {
                1 => self.bytes[at / 8] |= u8::from(met.is_some()) << (at % 8),
                _ => self.bytes[at] = code_of(met),
            }
            self.met += u64::from(met.is_some());
            self.shares += met.map_or(0.0, f64::from);
        }
    }

    fn mean(&self) -> f64 {
        if self.met == 0 { 0.0 } else { self.shares / self.met as f64 }
    }
}

/// A field that is made.
struct Made {
    record: bricks::DisplacementField,
    packed: Vec<u8>,
}

/// Makes the fields of `jobs` and tells `take` each as it is finished, in their order.
fn make(
    bench: &mut Bench,
    jobs: &[Job],
    bits: u32,
    executor: u32,
    watch: &mut dyn FnMut(u64) -> bool,
    take: &mut dyn FnMut(usize, Made) -> Result<()>,
) -> Result<bool> {
    let mut open: BTreeMap<usize, Samples> = BTreeMap::new();
    let mut failed = None;
    let mut goes_on = true;
    bake(bench, jobs, None, &mut |number, first, shares| {
        let job = &jobs[number];
        let samples = open.entry(number).or_insert_with(|| Samples::new(job.shape, bits));
        samples.take(first, shares);
        if first + shares.len() as u64 == job.shape.samples()
            && let Some(samples) = open.remove(&number)
        {
            let record = bricks::DisplacementField {
                object: job.subject.object,
                brick: job.subject.brick.unwrap_or(bricks::NONE),
                rings: job.shape.rings,
                directions: job.shape.directions,
                bits,
                executor,
                center: job.ball.center.to_array(),
                radius: job.ball.radius,
                mean: samples.mean(),
                ..bytemuck::Zeroable::zeroed()
            };
            let packed = bricks::pack::pack(&samples.bytes);
            failed = take(number, Made { record, packed }).err();
        }
        goes_on = watch(shares.len() as u64);
        goes_on && failed.is_none()
    })?;
    failed.map_or(Ok(goes_on), Err)
}

/// What a stopped run has left: fields in the order of their jobs, in a file beside the scene.
struct Kept {
    path: PathBuf,
    file: File,
    /// Records, where their payloads lie, and how long they are.
    fields: Vec<(bricks::DisplacementField, u64, usize)>,
}

/// Bytes of a record in front of its payload: checksum, length, record.
const HEAD: usize = 16 + size_of::<bricks::DisplacementField>();

impl Kept {
    /// Opens the file of a run that `key` stands for; what another has left there is given up.
    fn open(path: PathBuf, key: u64) -> std::io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path)?;
        file.try_lock().map_err(|_| std::io::Error::from(std::io::ErrorKind::ResourceBusy))?;
        let mut kept = Self { path, file, fields: Vec::new() };
        let mut reader = BufReader::new(&kept.file);
        let mut word = [0; 8];
        let mut end = 8;
        if reader.read_exact(&mut word).is_ok() && u64::from_le_bytes(word) == key {
            let mut head = [0; HEAD];
            let mut payload = Vec::new();
            while reader.read_exact(&mut head).is_ok() {
                let number = |at: usize| u64::from_le_bytes(std::array::from_fn(|i| head[at + i]));
                let (checksum, length) = (number(0), number(8));
                payload.clear();
                if (&mut reader).take(length).read_to_end(&mut payload)? as u64 != length
                    || xxh3_64(&[&head[16..], &payload].concat()) != checksum
                {
                    break;
                }
                let at = end + HEAD as u64;
                kept.fields.push((bytemuck::pod_read_unaligned(&head[16..]), at, length as usize));
                end = at + length;
            }
        } else {
            kept.file.set_len(0)?;
            kept.file.seek(SeekFrom::Start(0))?;
            kept.file.write_all(&key.to_le_bytes())?;
        }
        // What was being written when the run was stopped.
        kept.file.set_len(end)?;
        kept.file.seek(SeekFrom::Start(end))?;
        Ok(kept)
    }

    fn push(&mut self, made: &Made) -> std::io::Result<()> {
        let record = bytemuck::bytes_of(&made.record);
        let checksum = xxh3_64(&[record, &made.packed].concat());
        let mut bytes = checksum.to_le_bytes().to_vec();
        bytes.extend((made.packed.len() as u64).to_le_bytes());
        bytes.extend(record);
        bytes.extend(&made.packed);
        let at = self.file.stream_position()? + HEAD as u64;
        self.file.write_all(&bytes)?;
        self.fields.push((made.record, at, made.packed.len()));
        Ok(())
    }

    fn payload(&mut self, number: usize) -> std::io::Result<Vec<u8>> {
        let (_, at, length) = self.fields[number];
        let mut bytes = vec![0; length];
        self.file.seek(SeekFrom::Start(at))?;
        self.file.read_exact(&mut bytes)?;
        Ok(bytes)
    }
}

/// Who watches fields being made.
pub trait Watch {
    /// Work begins of so many units: bytes to be read, rays to be traced, bytes to be written.
    fn phase(&mut self, what: &'static str, units: u64);
    /// So many units are done; whether to go on.
    fn advance(&mut self, units: u64) -> bool;
}

/// Nobody.
impl Watch for () {
    fn phase(&mut self, _: &'static str, _: u64) {}

    fn advance(&mut self, _: u64) -> bool {
        true
    }
}

/// What came of it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Outcome {
    /// Fields of whole objects, and of bricks.
    pub fields: [usize; 2],
    /// Of these, those that an earlier run had left.
    pub kept: usize,
    /// Rays that were traced.
    pub rays: u64,
    /// Bytes of samples, in memory and in the file.
    pub bytes: [u64; 2],
}

/// The name of the file that keeps fields of a scene while they are made.
fn kept_name(scene: &Path) -> PathBuf {
    let name = scene.file_name().unwrap_or_default().to_string_lossy();
    scene.with_file_name(format!(".{name}.fields"))
}

/// The spheres of what fields are of.
///
/// # Errors
/// A brick that cannot be read.
pub fn jobs_of(scene: &SceneFile, plan: &[(Subject, Shape)]) -> Result<Vec<Job>, bricks::Error> {
    let job = |&(subject, shape): &(Subject, Shape)| Ok(Job { subject, ball: subject.ball(scene)?, shape });
    plan.par_iter().map(job).collect()
}

/// Makes fields for the scene in the file `path` and writes it anew with them, to `output`; fields that it had are left
/// out. `executor` says by what rays are traced: 0 the processor, 1 a GPU. Of a run that is stopped a file beside
/// `output` keeps what was finished, and the same call goes on with it.
///
/// # Errors
/// A brick that cannot be read; the device's; a field beyond `memory` bytes; a file that cannot be written; `watch`
/// stopped it.
pub fn add_fields(
    bench: &mut Bench,
    output: &Path,
    making: &Making,
    executor: u32,
    memory: u64,
    watch: &mut dyn Watch,
) -> Result<Outcome> {
    let scene = bench.scene;
    let name = scene.path().display().to_string();
    let plan = plan(scene.resident(), making);
    if let Some(largest) = plan.iter().map(|(_, shape)| shape.samples() * u64::from(making.bits) / 8).max()
        && 3 * largest > memory
    {
        bail!("{name}: making a field of {largest} bytes takes {} bytes; give --memory or fewer samples", 3 * largest);
    }
    let mut numbers = vec![MAKING, scene.checksum(), making.bits.into(), executor.into()];
    numbers.extend(plan.iter().flat_map(|(_, shape)| [shape.rings, shape.directions].map(u64::from)));
    let file = kept_name(output);
    let unkept = || format!("{}: cannot write this file, which keeps what is finished", file.display());
    let mut kept = Kept::open(file.clone(), xxh3_64(bytemuck::cast_slice(&numbers))).with_context(unkept)?;
    let is_kept = |subject: Subject, kept: &Kept| kept.fields.iter().any(|(record, ..)| subject_of(record) == subject);
    let before = kept.fields.len();
    let left: Vec<(Subject, Shape)> = plan.iter().copied().filter(|&(subject, _)| !is_kept(subject, &kept)).collect();
    let jobs = jobs_of(scene, &left).with_context(|| name.clone())?;
    let mut outcome = Outcome { kept: before, ..Outcome::default() };
    watch.phase("rays", jobs.iter().map(|job| job.shape.samples()).sum());
    let goes_on = {
        let rays = &mut outcome.rays;
        let mut advance = |count| {
            *rays += count;
            watch.advance(count)
        };
        make(bench, &jobs, making.bits, executor, &mut advance, &mut |_, made| kept.push(&made).with_context(unkept))
            .with_context(|| name.clone())?
    };
    if !goes_on {
        let (done, all) = (kept.fields.len(), plan.len());
        bail!("{name}: interrupted; {done} of {all} fields are kept, and the same command goes on");
    }
    kept.fields.sort_by_key(|(record, ..)| subject_of(record).order());
    watch.phase("bytes", scene.file_bytes());
    let mut writer = Writer::reserve(output)?.start_from(scene, &mut |bytes| {
        watch.advance(bytes);
    })?;
    let mut resident = scene.resident().clone();
    resident.displacement.clear();
    for number in 0..kept.fields.len() {
        let packed = kept.payload(number).with_context(unkept)?;
        let span = writer.write(&packed)?;
        let record = bricks::DisplacementField { span, ..kept.fields[number].0 };
        outcome.fields[usize::from(record.brick != bricks::NONE)] += 1;
        outcome.bytes[0] += record.loaded_bytes();
        outcome.bytes[1] += span.bytes;
        resident.displacement.push(record);
    }
    writer.finish(&resident)?;
    std::fs::remove_file(&kept.path).with_context(unkept)?;
    Ok(outcome)
}

/// What a record is of.
pub fn subject_of(record: &bricks::DisplacementField) -> Subject {
    Subject { object: record.object, brick: (record.brick != bricks::NONE).then_some(record.brick) }
}

/// Makes a field of the scene file anew: its payload as it is stored.
///
/// # Errors
/// A brick that cannot be read, or the device's.
pub fn make_again(bench: &mut Bench, record: &bricks::DisplacementField) -> Result<Vec<u8>> {
    let shape = Shape { rings: record.rings, directions: record.directions };
    let jobs = jobs_of(bench.scene, &[(subject_of(record), shape)])?;
    let mut packed = Vec::new();
    make(bench, &jobs, record.bits, record.executor, &mut |_| true, &mut |_, made| {
        packed = made.packed;
        Ok(())
    })?;
    Ok(packed)
}
