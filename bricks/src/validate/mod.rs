//! The rules of the format, checked once at the file's edge so that everything behind it indexes freely.
//!
//! * [`resident`]: the resident part by itself. Every index, range, count and length in it is right, top-level trees
//!   are trees over exactly their leaves, levels of detail stand for what exists, nothing is infinite or not a number.
//! * [`payload`]: the bytes of one payload, as it is loaded, against the resident part: every index in it, and that the
//!   nodes of a brick are a tree no higher than the brick says.
//! * [`spans`]: payloads fill the file up to the directory and do not overlap, displacement fields last.
//! * [`contents`]: what is slower to check and cannot make an index wrong: vertices on the lattice within their bounds
//!   and in occupied cells, every triangle in exactly one leaf. `verify` does it.

mod brick;
mod contents;
mod displacement;
mod levels;
mod node;
mod occupancy;
mod payload;
mod rule;
mod scene;
mod top;

pub use contents::contents;
pub use payload::payload;

use crate::error::{Flaw, Part};
use crate::layout::{PAGE_BYTES, Section};
use crate::payload::Payload;
use crate::planted::{self, Defect};
use crate::records::Span;
use crate::resident::Resident;
use rule::rule;

/// Checks the resident part by itself; see the module's head. Levels of detail are beside the scene, as in a file.
pub fn resident(resident: &Resident) -> Result<(), Flaw> {
    for section in Section::ALL {
        let count = resident.count(section);
        rule(count < u32::MAX as usize, Part::Section(section), || (count, "less than 2^32 - 1 records"))?;
    }
    scene::objects(resident)?;
    scene::instances(resident)?;
    scene::materials(resident)?;
    scene::textures(resident)?;
    scene::opacity_maps(resident)?;
    scene::lights(resident)?;
    for (index, record) in (0u32..).zip(&resident.bricks) {
        brick::record(Part::Record(Section::Bricks, index), index, record)?;
    }
    occupancy::records(resident)?;
    displacement::records(resident)?;
    scene::leaves(resident, Section::Leaves, &resident.leaves, &[])?;
    top::binary(Section::Top2, &resident.top2, resident.leaves.len())?;
    top::wide(Section::Top8, &resident.top8, resident.leaves.len())?;
    levels::levels(resident)?;
    scene::manifest(resident)
}

/// Checks that the payloads fill the file from the header page to `payload_end`, the directory's offset: each starts at
/// the first multiple of [`PAGE_BYTES`] after the one before. So none overlap, and every byte of the file belongs to
/// something that is checked. Displacement fields lie behind all others, which stay where they are when fields change.
pub fn spans(resident: &Resident, payload_end: u64) -> Result<(), Flaw> {
    let mut payloads: Vec<(Payload, Span)> = resident.payloads().collect();
    payloads.sort_unstable_by_key(|(payload, span)| (span.offset, *payload));
    let mut end = Some(PAGE_BYTES);
    let mut last_field = None;
    for &(payload, span) in &payloads {
        if let Payload::Displacement(_) = payload {
            last_field = Some(payload);
        }
        rule(last_field.is_none_or(|field| field == payload), Part::Payload(payload), || {
            (format!("it behind {}", last_field.unwrap_or(payload)), "it before all displacement fields")
        })?;
        let expected = end.and_then(|end| end.checked_next_multiple_of(PAGE_BYTES));
        rule(Some(span.offset) == expected, Part::Payload(payload), || {
            let expected = expected.unwrap_or(u64::MAX);
            (format!("byte {} as its start", span.offset), format!("byte {expected}, next after what is before it"))
        })?;
        let fits = |end: &u64| *end <= payload_end || planted::is(Defect::PayloadEnd);
        end = span.offset.checked_add(span.bytes).filter(fits);
        rule(end.is_some(), Part::Payload(payload), || {
            let found = format!("{} bytes from byte {}", span.bytes, span.offset);
            (found, format!("an end before the directory at byte {payload_end}"))
        })?;
    }
    let end = end.and_then(|end| end.checked_next_multiple_of(PAGE_BYTES));
    let is_last = end == Some(payload_end) || planted::is(Defect::PayloadEnd);
    rule(is_last, Part::Directory, || {
        (
            format!("it starts at byte {payload_end}"),
            format!("byte {}, next after the payloads", end.unwrap_or(u64::MAX)),
        )
    })
}
