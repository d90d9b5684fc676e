//! The rules of a brick's record.

use super::contents;
use super::node::NodeView;
use super::rule::{encoded, length, rule};
use crate::error::{Flaw, Part};
use crate::payload::Payload;
use crate::records::{AttributeLayout, BRICK_DETAIL, BRICK_INDEX32, BRICK_OPACITY, BRICK_WIDE, Brick, GeometryLayout};
use crate::records::{LATTICE_LIMIT, MAX_BRICK_HEIGHT, NEAR_STEPS, ORIGIN_STEPS, WIDE_STEPS};

/// Checks a brick's record, which is `part` or in it, by itself. `index` is what its payloads are named by.
pub(super) fn record(part: Part, index: u32, brick: &Brick) -> Result<(), Flaw> {
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
    let root = NodeView::of(&brick.root);
    root.check(0, brick.node_count, brick.triangle_count, "triangles").map_err(|flaw| flaw.of_node(part, "root"))?;
    contents::grid(&brick.root, part, "root")
}
