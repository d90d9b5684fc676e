//! Fields of visibility, with their checksum made right.

use super::{Files, Format, Verdict};
use crate::kind::Fault;
use crate::mutate::{Harm, bytes};
use crate::random::Random;
use brickwalk::secondary::dvf::file::{decode, encode};
use brickwalk::secondary::dvf::{Areas, DvfField, DvfKept, Shape};
use glam::DVec3;
use std::path::Path;
use xxhash_rust::xxh3::xxh3_64;

/// Most bytes of masks that are read.
const MOST_BYTES: u64 = 8 << 20;
/// What the fields are made of.
const KEY: u64 = 7;

/// Fields.
pub struct Field;

impl Format for Field {
    const NAME: &'static str = "inputs/dvf";
    const ABOUT: &'static str = "Files of fields of visibility, with the checksum made right";
    const NAMES_FILE: bool = false;

    fn make(&self, random: &mut Random, harm: Harm) -> Files {
        let extent = DVec3::new(3.0, random.share() * 3.0, 1.0);
        let shape = Shape::new(DVec3::ZERO, extent, random.within(1, 6) as u32, random.pick([8, 16]));
        let mut field = DvfField::unknown(shape);
        for mask in field.masks.chunks_exact_mut(field.shape.words()).step_by(3) {
            mask.iter_mut().for_each(|word| *word = random.word() as u32);
        }
        field.finish(false);
        let mut file = encode(&DvfKept { field, areas: Areas { scale: 0.5, total: 3.25 } }, KEY);
        if harm.does(random, 60) {
            let mut head = file[..file.len().min(96)].to_vec();
            bytes::change(random, &mut head);
            head.resize(file.len().min(96), 0);
            file.splice(..file.len().min(96), head);
        }
        harm.bytes(random, &mut file, 50);
        if let Some((body, checksum)) = file.split_last_chunk_mut::<8>()
            && !harm.does(random, 10)
        {
            *checksum = xxh3_64(body).to_le_bytes();
        }
        Files::one("a.dvf", file)
    }

    fn read(&self, _: &mut Random, files: &Files, _: &Path) -> Result<Verdict, Fault> {
        let kept = match decode(files.bytes(), KEY, MOST_BYTES) {
            Ok(kept) => kept,
            Err(error) => return Ok(Verdict::Refused(error.to_string())),
        };
        let cells = kept.field.shape.cells() as usize;
        let is_whole = kept.field.labels.len() == cells && kept.field.masks.len() == cells * kept.field.shape.words();
        // What is known is written again as it was, and found so.
        match decode(&encode(&kept, KEY), KEY, MOST_BYTES) {
            Ok(again) if is_whole && again == kept => {}
            _ => return Err(Fault::new("a field is not read as it was written", files.name())),
        }
        kept.finished(true);
        Ok(Verdict::Read)
    }
}
