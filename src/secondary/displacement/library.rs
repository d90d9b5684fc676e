//! The fields of a scene, and which of them are in memory.

use super::ball::Ball;
use super::kernels::{CODES, FAMILY, FIELDS, TABLE};
use super::shape::Shape;
use super::subject::Subject;
use crate::kernels::FrameExecutor;
use crate::kernels::layout::{DisplacementField, DisplacementPosition, NONE};
use crate::schedule::ExecutorError;
use bricks::{Payload, Resident, SceneFile};
use glam::DVec3;
use std::collections::BTreeMap;

/// A field as the scene file has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    /// Of what.
    pub subject: Subject,
    /// Its sphere, object units.
    pub ball: Ball,
    /// How many samples it has.
    pub shape: Shape,
    /// Bits of a sample, 8 or 1.
    pub bits: u32,
    /// Of 1 bit: how far along the chord what is met lies.
    pub mean: f32,
    /// Bytes of its samples in memory.
    pub bytes: u64,
    /// Bytes of the geometry that it stands for.
    pub saved: u64,
}

/// The fields of a scene.
#[derive(Clone, Debug, Default)]
pub struct Library {
    /// In the order of the file.
    pub fields: Vec<Entry>,
    numbers: BTreeMap<Subject, usize>,
    /// Per object, whether it is placed more than once.
    copied: Vec<bool>,
}

impl Library {
    /// Those of a scene file.
    pub fn of(resident: &Resident) -> Self {
        let entry = |record: &bricks::DisplacementField| {
            let subject =
                Subject { object: record.object, brick: (record.brick != bricks::NONE).then_some(record.brick) };
            let saved = subject.bricks(resident).map(|brick| resident.bricks[brick as usize].geometry.bytes).sum();
            Entry {
                subject,
                ball: Ball { center: DVec3::from_array(record.center), radius: record.radius },
                shape: Shape { rings: record.rings, directions: record.directions },
                bits: record.bits,
                mean: record.mean as f32,
                bytes: record.loaded_bytes(),
                saved,
            }
        };
        let fields: Vec<Entry> = resident.displacement.iter().map(entry).collect();
        let numbers = fields.iter().enumerate().map(|(number, entry)| (entry.subject, number)).collect();
        let mut placed = vec![0u32; resident.objects.len()];
        resident.instances.iter().for_each(|instance| placed[instance.object as usize] += 1);
        Self { fields, numbers, copied: placed.into_iter().map(|count| count > 1).collect() }
    }

    /// The number of the field of something.
    pub fn number(&self, subject: Subject) -> Option<usize> {
        self.numbers.get(&subject).copied()
    }

    /// Whether an object is placed more than once.
    pub fn is_copied(&self, object: u32) -> bool {
        self.copied[object as usize]
    }

    /// Which fields are worth `budget` bytes the most, of which so many rays have `asked`: those whose rays times the
    /// bytes of geometry that they stand for are most; ascending.
    pub fn most_useful(&self, asked: &[f64], budget: u64) -> Vec<usize> {
        let worth = |number: usize| (1.0 + asked[number]) * self.fields[number].saved as f64;
        let mut order: Vec<usize> = (0..self.fields.len()).collect();
        order.sort_by(|&a, &b| worth(b).total_cmp(&worth(a)).then(a.cmp(&b)));
        let mut left = budget;
        order.retain(|&number| {
            let fits = self.fields[number].bytes <= left;
            left -= if fits { self.fields[number].bytes } else { 0 };
            fits
        });
        order.sort_unstable();
        order
    }

    /// Gives an executor those fields that are `chosen`.
    ///
    /// # Errors
    /// A field that cannot be read; more than the device holds.
    pub fn give(
        &self,
        scene: &SceneFile,
        chosen: &[usize],
        executor: &mut dyn FrameExecutor,
    ) -> Result<(), ExecutorError> {
        let mut first_of: BTreeMap<u32, u32> = BTreeMap::new();
        let mut table: Vec<DisplacementPosition> = Vec::new();
        for entry in &self.fields {
            first_of.entry(entry.shape.rings).or_insert_with(|| {
                let first = table.len() as u32;
                table.extend(entry.shape.table());
                first
            });
        }
        let mut fields: Vec<DisplacementField> = self
            .fields
            .iter()
            .map(|entry| DisplacementField {
                codes: NONE,
                table: first_of[&entry.shape.rings],
                rings: entry.shape.rings,
                directions: entry.shape.directions,
                bits: entry.bits,
                mean: entry.mean,
                ..Default::default()
            })
            .collect();
        let mut words = 0u64;
        for &number in chosen {
            fields[number].codes = words as u32;
            words += self.fields[number].bytes.div_ceil(4);
        }
        executor.reserve(&FAMILY, &[0, 0, fields.len(), table.len(), words as usize, fields.len()])?;
        executor.write(&FAMILY, FIELDS, 0, bytemuck::cast_slice(&fields));
        executor.write(&FAMILY, TABLE, 0, bytemuck::cast_slice(&table));
        scene.announce(chosen.iter().map(|&number| Payload::Displacement(number as u32)));
        for &number in chosen {
            let bytes = scene.displacement(number as u32).map_err(unread)?;
            executor.write(&FAMILY, CODES, 4 * fields[number].codes as usize, &bytes);
        }
        Ok(())
    }
}

/// What is said of a field that cannot be read.
fn unread(error: bricks::Error) -> ExecutorError {
    ExecutorError::Device(format!("got no displacement field: {error}"))
}
