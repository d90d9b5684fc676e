//! Checks of displacement fields: the records, and what lies behind the samples.

use super::payload::padding;
use super::rule::{encoded, rule};
use crate::displacement::{
    DISPLACEMENT_BY_CPU, DISPLACEMENT_BY_GPU, DISPLACEMENT_DISTANCES, DISPLACEMENT_HITS, DisplacementField,
    MAX_DISPLACEMENT_DIRECTIONS, MAX_DISPLACEMENT_RINGS, MIN_DISPLACEMENT_DIRECTIONS,
};
use crate::error::{Flaw, Part};
use crate::layout::Section;
use crate::pack::MAX_RATIO;
use crate::payload::Payload;
use crate::resident::Resident;

/// Fields are of objects or bricks that exist, at most one of each, in their order; spheres and samples are sound.
pub(super) fn records(resident: &Resident) -> Result<(), Flaw> {
    let mut before = None;
    for (index, field) in (0u32..).zip(&resident.displacement) {
        let part = Part::Record(Section::Displacement, index);
        let objects = resident.objects.len();
        rule((field.object as usize) < objects, part, || {
            (format!("object {}", field.object), format!("less than {objects}"))
        })?;
        let is_of_it = |brick: u32| {
            let brick = resident.bricks.get(brick as usize);
            brick.is_some_and(|brick| brick.object == field.object)
        };
        rule(field.of_brick().is_none_or(is_of_it), part, || {
            (format!("brick {}", field.brick), format!("none or a brick of object {}", field.object))
        })?;
        let of = (field.object, field.brick);
        rule(before.is_none_or(|before| before < of), part, || {
            (format!("object {}, brick {} after {:?}", of.0, of.1, before.unwrap_or_default()), "ascending order")
        })?;
        before = Some(of);
        samples(part, field)?;
        let payload = Payload::Displacement(index);
        let loaded = field.loaded_bytes();
        encoded(payload, field.span, loaded)?;
        // Then the length as loaded is bounded by that of the file.
        rule(loaded <= field.span.bytes * MAX_RATIO, Part::Payload(payload), || {
            let expected = format!("at least {}, as no block unpacks to more", loaded.div_ceil(MAX_RATIO));
            (format!("{} bytes, {loaded} when loaded", field.span.bytes), expected)
        })?;
    }
    Ok(())
}

/// Checks what a field says of its sphere and samples.
fn samples(part: Part, field: &DisplacementField) -> Result<(), Flaw> {
    rule((1..=MAX_DISPLACEMENT_RINGS).contains(&field.rings), part, || {
        (format!("{} rings", field.rings), format!("1 to {MAX_DISPLACEMENT_RINGS}"))
    })?;
    let directions = MIN_DISPLACEMENT_DIRECTIONS..=MAX_DISPLACEMENT_DIRECTIONS;
    rule(directions.contains(&field.directions), part, || {
        (format!("{} directions a side", field.directions), format!("{} to {}", directions.start(), directions.end()))
    })?;
    rule([DISPLACEMENT_DISTANCES, DISPLACEMENT_HITS].contains(&field.bits), part, || {
        (format!("{} bits a sample", field.bits), format!("{DISPLACEMENT_DISTANCES} or {DISPLACEMENT_HITS}"))
    })?;
    rule([DISPLACEMENT_BY_CPU, DISPLACEMENT_BY_GPU].contains(&field.executor), part, || {
        (format!("executor {}", field.executor), format!("{DISPLACEMENT_BY_CPU} or {DISPLACEMENT_BY_GPU}"))
    })?;
    let finite = field.center.iter().chain([&field.radius]).all(|x| x.is_finite());
    rule(finite && field.radius > 0.0, part, || {
        let found = format!("a sphere of radius {} around {:?}", field.radius, field.center);
        (found, "a finite centre and a finite radius above 0")
    })?;
    rule((0.0..=1.0).contains(&field.mean), part, || (format!("a mean of {}", field.mean), "0 to 1"))
}

/// Checks the samples of field `index`, as they are loaded: the bits and bytes behind them are zero. Any others are
/// samples.
pub(super) fn loaded(resident: &Resident, index: u32, bytes: &[u8]) -> Result<(), Flaw> {
    let field = &resident.displacement[index as usize];
    let part = Part::Payload(Payload::Displacement(index));
    let end = field.sample_bytes();
    if field.bits == DISPLACEMENT_HITS && !field.samples().is_multiple_of(8) {
        let unused = bytes[end as usize - 1] >> (field.samples() % 8);
        rule(unused == 0, part, || (format!("set bits after the last of {} samples", field.samples()), "zeros there"))?;
    }
    padding(part, bytes, end, bytes.len() as u64)
}
