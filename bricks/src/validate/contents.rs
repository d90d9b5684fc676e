//! Checks that take longer than copying and concern no index: what a converter must have got right.

use super::node::NodeView;
use super::occupancy;
use super::rule::rule;
use crate::error::{Flaw, Part};
use crate::occupancy::OccupancyMap;
use crate::payload::Payload;
use crate::records::{BRICK_INDEX32, BRICK_WIDE, Brick, GeometryLayout, NEAR_STEPS, NODE_WIDTH, Node};
use crate::records::{TEXTURE_BC7, Texture, WIDE_HIGH_STEPS};
use crate::resident::Resident;

/// Checks the contents of a payload, as it is loaded, that [`super::payload`] found right. For geometry: quantisation
/// grids of nodes are finite, every triangle is in exactly one leaf, the brick is as high as it says, vertices lie on
/// the lattice within the brick's bounds and, if `map` is given, in occupied cells, every triangle starts with its
/// smallest vertex. Blocks of textures have a mode.
///
/// # Panics
///
/// May, if [`super::payload`] did not find `bytes` right.
pub fn contents(resident: &Resident, payload: Payload, bytes: &[u8], map: Option<&OccupancyMap>) -> Result<(), Flaw> {
    let index = match payload {
        Payload::Geometry(index) => index,
        Payload::Texture(texture) => return blocks(payload, &resident.textures[texture as usize], bytes),
        Payload::Tile(tile) => {
            let texture = resident.tile_of(tile).map(|(texture, _)| &resident.textures[texture as usize]);
            return texture.map_or(Ok(()), |texture| blocks(payload, texture, bytes));
        }
        Payload::Attributes(_) | Payload::Proxies(_) | Payload::Opacity(_) | Payload::Displacement(_) => return Ok(()),
    };
    let Some(brick) = resident.brick(index) else { return Ok(()) };
    let object = &resident.objects[brick.object as usize];
    let part = Part::Payload(payload);
    let layout = GeometryLayout::of(brick);
    tree(part, brick, &bytes[..layout.vertices as usize])?;
    let vertices = vertices(part, brick, object.step_log2 - object.unit_log2, &bytes[layout.vertices as usize..])?;
    map.map_or(Ok(()), |map| occupancy::vertices(resident, index, &vertices, map))?;
    rotations(part, brick, &vertices, &bytes[layout.indices as usize..])
}

/// Checks that BC7 blocks have a mode; the format reserves a first byte of zero.
fn blocks(payload: Payload, texture: &Texture, bytes: &[u8]) -> Result<(), Flaw> {
    let has_mode = |block: &[u8; 16]| texture.encoding != TEXTURE_BC7 || block[0] != 0;
    let without = bytes.as_chunks::<16>().0.iter().position(|block| !has_mode(block));
    rule(without.is_none(), Part::Payload(payload), || {
        (format!("block {} without a mode", without.unwrap_or(0)), "BC7 blocks of modes 0 to 7")
    })
}

/// Checks the quantisation grid of a node and the order of its children's bounds.
pub(super) fn grid(node: &Node, part: Part, name: impl std::fmt::Display) -> Result<(), Flaw> {
    let finite = node.origin.iter().all(|value| value.is_finite());
    // The biased exponents of normal, finite f32.
    rule(finite && node.exponent.iter().all(|exponent| (1..255).contains(exponent)), part, || {
        let found = format!("{name} with origin {:?} and exponents {:?}", node.origin, node.exponent);
        (found, "finite origins and exponents from 1 to 254")
    })?;
    let view = NodeView::of(node);
    for slot in (0..NODE_WIDTH).filter(|&slot| view.has_child(slot)) {
        let order = (0..3).all(|axis| node.lo[axis][slot] <= node.hi[axis][slot]);
        rule(order, part, || {
            (format!("bounds of child {slot} of {name} that are not in order"), "lower before upper bounds")
        })?;
    }
    Ok(())
}

/// Checks nodes: their grids, their height, and that each triangle is in one leaf.
fn tree(part: Part, brick: &Brick, bytes: &[u8]) -> Result<(), Flaw> {
    let mut levels = vec![1u32; brick.node_count as usize];
    let mut met = vec![false; brick.triangle_count as usize];
    for (index, bytes) in bytes.chunks_exact(size_of::<Node>()).enumerate() {
        let node: Node = bytemuck::pod_read_unaligned(bytes);
        grid(&node, part, format_args!("node {index}"))?;
        let view = NodeView::of(&node);
        for child in 0..view.inner_count() {
            levels[(view.child_base + child) as usize] = levels[index] + 1;
        }
        for (_, first, count) in view.leaves() {
            for triangle in first..first + count {
                let met = &mut met[triangle as usize];
                rule(!*met, part, || (format!("triangle {triangle} in two leaves"), "one"))?;
                *met = true;
            }
        }
    }
    let height = levels.into_iter().max().unwrap_or(0);
    rule(height == brick.height, part, || {
        (format!("{height} levels of nodes"), format!("{}, the brick's height", brick.height))
    })?;
    let missed = met.iter().position(|met| !met);
    rule(missed.is_none(), part, || (format!("triangle {} in no leaf", missed.unwrap_or(0)), "every triangle in one"))
}

/// Checks vertices and returns them in lattice steps from the brick's origin.
fn vertices(part: Part, brick: &Brick, step_unit_log2: i32, bytes: &[u8]) -> Result<Vec<[i64; 3]>, Flaw> {
    let wide = brick.flags & BRICK_WIDE != 0;
    // Exact: a power of two that `validate::resident` bounds.
    let steps_per_unit = 2f64.powi(-step_unit_log2);
    let read = |at: usize| f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
    let mut vertices = Vec::with_capacity(brick.vertex_count as usize);
    for index in 0..brick.vertex_count as usize {
        let mut vertex = [0; 3];
        for (axis, coordinate) in vertex.iter_mut().enumerate() {
            let at = index * if wide { 24 } else { 12 } + axis * 4;
            let value = read(at);
            let steps = f64::from(value) * steps_per_unit;
            let mut whole = steps.fract() == 0.0;
            // A cast saturates and takes NaN to 0, whose `fract` is not 0; bounds are compared below.
            let mut sum = steps as i64;
            if wide {
                let low = f64::from(read(at + 12)) * steps_per_unit;
                whole &= low.fract() == 0.0 && low.abs() <= (WIDE_HIGH_STEPS / 2) as f64 && sum % WIDE_HIGH_STEPS == 0;
                sum = sum.saturating_add(low as i64);
            } else {
                whole &= steps.abs() <= NEAR_STEPS as f64;
            }
            let absolute = sum.saturating_add(brick.origin[axis]);
            rule(whole && (brick.min[axis]..=brick.max[axis]).contains(&absolute), part, || {
                let found = format!("vertex {index} at {steps} steps on axis {axis}");
                (found, "a vertex on the lattice within the brick's bounds")
            })?;
            *coordinate = sum;
        }
        vertices.push(vertex);
    }
    Ok(vertices)
}

/// Checks that every triangle starts with its lexicographically smallest vertex.
fn rotations(part: Part, brick: &Brick, vertices: &[[i64; 3]], bytes: &[u8]) -> Result<(), Flaw> {
    let size = if brick.flags & BRICK_INDEX32 != 0 { 4 } else { 2 };
    let vertex = |at: usize| {
        let bytes = &bytes[at * size..(at + 1) * size];
        let index = bytes.iter().rev().fold(0, |index, &byte| index << 8 | usize::from(byte));
        vertices[index]
    };
    for triangle in 0..brick.triangle_count as usize {
        let [a, b, c] = [vertex(triangle * 3), vertex(triangle * 3 + 1), vertex(triangle * 3 + 2)];
        rule(a <= b && a <= c, part, || {
            (format!("triangle {triangle} with vertices {a:?}, {b:?}, {c:?}"), "its smallest vertex first")
        })?;
    }
    Ok(())
}
