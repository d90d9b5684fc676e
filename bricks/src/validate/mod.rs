//! The rules of the format, checked once at the file's edge so that everything behind it indexes freely.
//!
//! * [`resident`]: the resident part by itself. Every index, range, count and length in it is right, both top-level
//!   trees are trees over exactly the leaves, nothing is infinite or not a number.
//! * [`payload`]: the bytes of one payload, as it is loaded, against the resident part: every index in it, and that the
//!   nodes of a brick are a tree no higher than the brick says.
//! * [`spans`]: payloads fill the file up to the directory and do not overlap.
//! * [`contents`]: what is slower to check and cannot make an index wrong: vertices on the lattice within their bounds
//!   and in occupied cells,
//!   every triangle in exactly one leaf. `verify` does it.

mod contents;
mod node;
mod occupancy;
mod payload;
mod scene;
mod top;

pub use contents::contents;
pub use payload::payload;

use crate::error::{Flaw, Part};
use crate::layout::{MAX_PAYLOAD_BYTES, PAGE_BYTES, Section};
use crate::payload::Payload;
use crate::records::{AttributeLayout, BRICK_DETAIL, BRICK_INDEX32, BRICK_OPACITY, BRICK_WIDE, Brick, GeometryLayout};
use crate::records::{LATTICE_LIMIT, MAX_BRICK_HEIGHT, NEAR_STEPS, ORIGIN_STEPS, Span, WIDE_STEPS};
use crate::resident::Resident;
use std::fmt::Display;

/// Checks the resident part by itself; see the module's head.
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
        brick(index, record)?;
    }
    occupancy::records(resident)?;
    scene::leaves(resident)?;
    top::binary(&resident.top2, resident.leaves.len())?;
    top::wide(&resident.top8, resident.leaves.len())?;
    scene::manifest(resident)
}

/// Checks that the payloads fill the file from the header page to `payload_end`, the directory's offset: each starts at
/// the first multiple of [`PAGE_BYTES`] after the one before. So none overlap, and every byte of the file belongs to
/// something that is checked.
pub fn spans(resident: &Resident, payload_end: u64) -> Result<(), Flaw> {
    let mut payloads: Vec<(Payload, Span)> = resident.payloads().collect();
    payloads.sort_unstable_by_key(|(payload, span)| (span.offset, *payload));
    let mut end = Some(PAGE_BYTES);
    for &(payload, span) in &payloads {
        let expected = end.and_then(|end| end.checked_next_multiple_of(PAGE_BYTES));
        rule(Some(span.offset) == expected, Part::Payload(payload), || {
            let expected = expected.unwrap_or(u64::MAX);
            (format!("byte {} as its start", span.offset), format!("byte {expected}, next after what is before it"))
        })?;
        end = span.offset.checked_add(span.bytes).filter(|&end| end <= payload_end);
        rule(end.is_some(), Part::Payload(payload), || {
            let found = format!("{} bytes from byte {}", span.bytes, span.offset);
            (found, format!("an end before the directory at byte {payload_end}"))
        })?;
    }
    let end = end.and_then(|end| end.checked_next_multiple_of(PAGE_BYTES));
    rule(end == Some(payload_end), Part::Directory, || {
        (
            format!("it starts at byte {payload_end}"),
            format!("byte {}, next after the payloads", end.unwrap_or(u64::MAX)),
        )
    })
}

/// Checks a brick's record by itself.
fn brick(index: u32, brick: &Brick) -> Result<(), Flaw> {
    let part = Part::Record(Section::Bricks, index);
    let known = BRICK_WIDE | BRICK_INDEX32 | BRICK_OPACITY | BRICK_DETAIL;
    rule(brick.flags & !known == 0, part, || (format!("flags {:#x}", brick.flags), "known flags"))?;
    rule(brick._reserved0 == 0 && brick._reserved1 == [0; 3], part, || ("reserved words", "zero in them"))?;
    rule(
        brick.node_count > 0 && brick.triangle_count > 0 && brick.vertex_count > 0 && brick.attribute_vertex_count > 0,
        part,
        || {
            let counts = [brick.node_count, brick.triangle_count, brick.vertex_count, brick.attribute_vertex_count];
            (format!("{counts:?} nodes, triangles, vertices, attribute vertices"), "at least one of each")
        },
    )?;
    let has_opacity = brick.flags & BRICK_OPACITY != 0;
    rule(has_opacity == (brick.opacity_count > 0) && brick.opacity_count <= brick.triangle_count, part, || {
        let found = format!("{} triangles with opacity, flags {:#x}", brick.opacity_count, brick.flags);
        (found, "at most all, the flag if and only if there are some")
    })?;
    rule((1..=MAX_BRICK_HEIGHT).contains(&brick.height), part, || {
        (format!("height {}", brick.height), format!("1 to {MAX_BRICK_HEIGHT}"))
    })?;
    let vertices = brick.vertex_count.max(brick.attribute_vertex_count);
    rule(brick.flags & BRICK_INDEX32 != 0 || vertices <= 1 << 16, part, || {
        (format!("{vertices} vertices with 16-bit indices"), "at most 65536")
    })?;
    // Then the length of attributes as loaded is bounded by that of geometry, which is in the file.
    let corners = u64::from(brick.triangle_count) * 3;
    rule(u64::from(brick.attribute_vertex_count) <= corners, part, || {
        (format!("{} attribute vertices", brick.attribute_vertex_count), format!("at most {corners}, the corners"))
    })?;
    let reach = if brick.flags & BRICK_WIDE != 0 { WIDE_STEPS } else { NEAR_STEPS };
    for axis in 0..3 {
        let (origin, min, max) = (brick.origin[axis], brick.min[axis], brick.max[axis]);
        rule(origin % ORIGIN_STEPS == 0 && origin.abs_diff(0) <= LATTICE_LIMIT as u64, part, || {
            (format!("origin {:?}", brick.origin), format!("multiples of {ORIGIN_STEPS} within ±{LATTICE_LIMIT}"))
        })?;
        // The origin is at most 2^61 and the reach 2^46, so the sums do not overflow.
        rule(min <= max && min >= origin - reach && max <= origin + reach, part, || {
            let found = format!("bounds {:?} to {:?}", brick.min, brick.max);
            (found, format!("bounds in order within {reach} steps of the origin {:?}", brick.origin))
        })?;
    }
    length(Payload::Geometry(index), brick.geometry, GeometryLayout::of(brick).bytes)?;
    encoded(Payload::Attributes(index), brick.attributes, AttributeLayout::of(brick).bytes)?;
    let means = brick.mean_albedo.iter().chain(&brick.mean_emission);
    rule(means.clone().all(|mean| mean.is_finite() && *mean >= 0.0), part, || {
        (format!("means {:?}", means.collect::<Vec<_>>()), "finite colours, not negative")
    })?;
    let root = node::NodeView::of(&brick.root);
    root.check(0, brick.node_count, brick.triangle_count, "triangles").map_err(|flaw| flaw.of_node(part, "root"))?;
    contents::grid(&brick.root, part, "root")
}

/// Checks the length of a payload that counts imply.
fn length(payload: Payload, span: Span, bytes: u64) -> Result<(), Flaw> {
    rule(span.bytes == bytes && bytes <= MAX_PAYLOAD_BYTES, Part::Payload(payload), || {
        let expected = format!("{bytes} bytes as its counts say, at most {MAX_PAYLOAD_BYTES}");
        (format!("{} bytes", span.bytes), expected)
    })
}

/// Checks the length of a payload that is stored encoded and has `bytes` when loaded.
fn encoded(payload: Payload, span: Span, bytes: u64) -> Result<(), Flaw> {
    let valid = span.bytes > 0 && span.bytes.is_multiple_of(16) && span.bytes.max(bytes) <= MAX_PAYLOAD_BYTES;
    rule(valid, Part::Payload(payload), || {
        let expected = format!("a multiple of 16 from 16 to {MAX_PAYLOAD_BYTES} bytes, stored and loaded");
        (format!("{} bytes, {bytes} when loaded", span.bytes), expected)
    })
}

/// A flaw in `part` unless `ok`. The texts are made only then: (found, expected).
#[inline]
fn rule<F: Display, E: Display>(ok: bool, part: Part, texts: impl FnOnce() -> (F, E)) -> Result<(), Flaw> {
    if ok { Ok(()) } else { Err(broken(part, texts)) }
}

#[cold]
#[inline(never)]
fn broken<F: Display, E: Display>(part: Part, texts: impl FnOnce() -> (F, E)) -> Flaw {
    let (found, expected) = texts();
    Flaw { part, found: found.to_string(), expected: expected.to_string() }
}
