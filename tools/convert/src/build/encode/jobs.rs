//! Encodes bricks in parallel and writes them in order.

use super::brick::{BrickContext, EncodedBrick};
use crate::build::disk::shard::{ShardReader, ShardWriter};
use crate::build::error::BuildError;
use crate::build::settings::BuildSettings;
use crate::build::texture::opacity::MaterialOpacity;
use crate::build::triangles::attributes::{MeanColors, Wants};
use crate::build::triangles::lattice::Lattice;
use crate::progress::Progress;
use bricks::{Brick, Occupancy, Span, Writer};
use rayon::prelude::*;

/// A brick to be encoded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Job {
    /// Its number among the bricks of all objects.
    pub index: u32,
    /// Its object.
    pub object: u32,
    /// Where its triangles begin.
    pub first: usize,
    /// Number of its triangles, dropped ones counted.
    pub count: usize,
}

/// Where payloads go.
pub(crate) trait Payloads: Send {
    /// Writes a payload; where it lies there.
    fn put(&mut self, payload: &[u8]) -> Result<Span, BuildError>;
}

impl Payloads for Writer {
    fn put(&mut self, payload: &[u8]) -> Result<Span, BuildError> {
        Ok(self.write(payload)?)
    }
}

impl Payloads for ShardWriter {
    fn put(&mut self, payload: &[u8]) -> Result<Span, BuildError> {
        self.append(0, payload)
    }
}

/// Copies a payload of a shard, if there is one, and says where it lies now.
pub(crate) fn copy(shard: &ShardReader, span: &mut Span, writer: &mut Writer) -> Result<(), BuildError> {
    if *span != Span::default() {
        let mut payload = Vec::new();
        shard.read::<u8>(*span, &mut payload)?;
        *span = writer.write(&payload)?;
    }
    Ok(())
}

/// Bricks as they are written.
pub(crate) struct BrickWriter<'a> {
    /// The scene file, or a shard.
    writer: &'a mut dyn Payloads,
    /// Records of what is written.
    pub records: Vec<Brick>,
    /// Occupancy of what is written, if bricks have proxies.
    pub occupancy: Vec<Occupancy>,
    /// Triangles dropped after rounding, by object.
    pub dropped: Vec<u32>,
    /// Triangles a thread encodes before what is encoded is written, which bounds the memory.
    pub batch_triangles: usize,
}

impl<'a> BrickWriter<'a> {
    /// Writes bricks of `objects` objects.
    pub fn new(writer: &'a mut dyn Payloads, objects: usize, batch_triangles: usize) -> Self {
        Self { writer, records: Vec::new(), occupancy: Vec::new(), dropped: vec![0; objects], batch_triangles }
    }

    /// Encodes and writes bricks. `encode` makes one, or none if no triangle of it has an area; it also returns how
    /// many have none.
    pub fn write(
        &mut self,
        jobs: &[Job],
        encode: impl Fn(&Job) -> (Option<EncodedBrick>, u32) + Sync,
        progress: &Progress,
    ) -> Result<(), BuildError> {
        let mut ready: Vec<EncodedBrick> = Vec::new();
        let mut rest = jobs;
        while !rest.is_empty() || !ready.is_empty() {
            progress.check()?;
            let (batch, after) = rest.split_at(self.batch_length(rest));
            rest = after;
            // One batch is written while the next is encoded.
            let (written, encoded) = rayon::join(
                || self.write_batch(std::mem::take(&mut ready)),
                || {
                    let encode = |job: &Job| {
                        let (brick, dropped) = encode(job);
                        progress.advance(job.count as u64);
                        (brick, job.object, dropped)
                    };
                    batch.par_iter().with_max_len(1).map(encode).collect::<Vec<_>>()
                },
            );
            written?;
            for (brick, object, dropped) in encoded {
                ready.extend(brick);
                self.dropped[object as usize] += dropped;
            }
        }
        Ok(())
    }

    /// How many of the next bricks are encoded before they are written.
    fn batch_length(&self, jobs: &[Job]) -> usize {
        let budget = self.batch_triangles * rayon::current_num_threads();
        let mut triangles = 0;
        jobs.iter()
            .take_while(|job| {
                let before = triangles;
                triangles += job.count;
                before < budget
            })
            .count()
    }

    fn write_batch(&mut self, bricks: Vec<EncodedBrick>) -> Result<(), BuildError> {
        for brick in bricks {
            let geometry = self.writer.put(&brick.geometry)?;
            let attributes = self.writer.put(&brick.attributes)?;
            let mut proxies = Span::default();
            if let Some((occupancy, payload)) = &brick.proxies {
                proxies = self.writer.put(payload)?;
                self.occupancy.push(*occupancy);
            }
            self.records.push(Brick { geometry, attributes, proxies, ..brick.record });
        }
        Ok(())
    }
}

/// The bricks of all objects, in order; `bricks` are the numbers of triangles of each by object.
pub(crate) fn jobs<'a>(bricks: impl Iterator<Item = &'a [u32]>) -> Result<Vec<Job>, BuildError> {
    let mut jobs = Vec::new();
    for (object, bricks) in (0u32..).zip(bricks) {
        let mut first = 0;
        for &count in bricks {
            jobs.push(Job { index: jobs.len() as u32, object, first, count: count as usize });
            first += count as usize;
        }
    }
    let (found, limit) = (jobs.len() as u64, u64::from(u32::MAX / 2));
    if found > limit { Err(BuildError::TooMany { what: "bricks", found, limit }) } else { Ok(jobs) }
}

/// The contexts of the objects' bricks.
pub(crate) fn contexts<'a>(
    lattices: &[Lattice],
    materials: &'a [MeanColors],
    opacity: &'a [MaterialOpacity],
    wants: &'a [Wants],
    settings: &BuildSettings,
) -> Vec<BrickContext<'a>> {
    let (is_fast, has_proxies) = (settings.fast, settings.proxies);
    let context = |(index, &lattice)| BrickContext { index, lattice, materials, opacity, wants, is_fast, has_proxies };
    (0u32..).zip(lattices).map(context).collect()
}
