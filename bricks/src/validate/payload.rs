//! Checks of a payload that has just been copied: every index in it, on the way from the disk to a cache.
//!
//! This lies on the path of every brick that is streamed, so it is one pass of a few instructions per node and a
//! maximum per array of indices or coordinates, which compilers vectorise.

use super::node::NodeView;
use super::rule::rule;
use super::{displacement, occupancy};
use crate::error::{Flaw, Part};
use crate::payload::Payload;
use crate::planted::{self, Defect};
use crate::records::{
    AttributeDetail, AttributeLayout, AttributeVertex, BRICK_INDEX32, BRICK_OPACITY, BRICK_WIDE, Brick, GeometryLayout,
};
use crate::records::{
    NEAR_STEPS, NO_NORMAL, Node, Object, OpacityTriangle, SURFACE_MATERIAL, SURFACE_ROTATION_SHIFT, WIDE_STEPS,
};
use crate::resident::Resident;

/// Bits of an f32 but for its sign.
const MAGNITUDE: u32 = 0x7fff_ffff;

/// Checks the bytes of a payload, as it is loaded, against the resident part, which satisfies [`super::resident`]:
/// every index that traversal or shading follows lies in its array, nodes form a tree no higher than the brick says
/// with children after their parents, node 0 is the brick's root, padding is zero; boxes and vertices are finite, and
/// vertices within reach of the brick's origin; of an occupancy map that all levels agree; of a displacement field that
/// nothing is behind the samples. `bytes` needs no alignment.
pub fn payload(resident: &Resident, payload: Payload, bytes: &[u8]) -> Result<(), Flaw> {
    let part = Part::Payload(payload);
    let length = resident.loaded_bytes(payload);
    rule(length == Some(bytes.len() as u64), part, || {
        (format!("{} bytes", bytes.len()), length.map_or("no such payload".to_owned(), |length| length.to_string()))
    })?;
    match payload {
        Payload::Geometry(index) => {
            let Some(brick) = resident.brick(index) else { return Ok(()) };
            let object = &resident.objects[brick.object as usize];
            geometry(part, brick, (object, triangle_ids(resident, index, brick)), bytes)?;
            opacity(part, brick, resident.materials.len() as u32, bytes)
        }
        Payload::Attributes(index) => {
            let Some(brick) = resident.brick(index) else { return Ok(()) };
            attributes(part, brick, resident.materials.len() as u32, bytes)
        }
        Payload::Proxies(index) => occupancy::map(resident, index, bytes),
        Payload::Displacement(index) => displacement::loaded(resident, index, bytes),
        // Whatever the bytes are, they are texels.
        Payload::Texture(_) | Payload::Tile(_) => Ok(()),
        Payload::Opacity(index) => {
            padding(part, bytes, resident.opacity_maps[index as usize].texel_bytes(), bytes.len() as u64)
        }
    }
}

/// What ids of a brick's triangles are less than. A level of the world may stand for triangles of any instance.
fn triangle_ids(resident: &Resident, index: u32, brick: &Brick) -> u32 {
    if brick.object == 0 && index as usize >= resident.exact_bricks() {
        // A scene has fewer than 2^32, as has been checked.
        return resident.manifest.triangle_ids as u32;
    }
    resident.objects[brick.object as usize].triangle_ids
}

fn geometry(part: Part, brick: &Brick, (object, triangle_ids): (&Object, u32), bytes: &[u8]) -> Result<(), Flaw> {
    let layout = GeometryLayout::of(brick);
    let (vertex_bytes, steps) = if brick.flags & BRICK_WIDE != 0 { (24, WIDE_STEPS) } else { (12, NEAR_STEPS) };
    let vertices_end = layout.vertices + u64::from(brick.vertex_count) * vertex_bytes;
    let ids_end = layout.ids + u64::from(brick.triangle_count) * 4;
    nodes(part, brick, &bytes[..layout.vertices as usize])?;
    // Magnitudes are in the order of their bits, an infinity and what is no number above all. The reach is a power of
    // two in the range of f32, as `validate::resident` has found.
    let most = f32::from_bits(max_u32_by(&bytes[layout.vertices as usize..vertices_end as usize], |x| x & MAGNITUDE));
    let reach = steps as f32 * 2f32.powi(object.step_log2 - object.unit_log2);
    rule(most <= reach, part, || (format!("a vertex at {most}"), format!("at most {reach} units from the origin")))?;
    padding(part, bytes, vertices_end, layout.ids)?;
    let id = max_u32(&bytes[layout.ids as usize..ids_end as usize]);
    rule(id < triangle_ids, part, || {
        (format!("triangle id {id}"), format!("less than {triangle_ids}, as its object says"))
    })?;
    padding(part, bytes, ids_end, layout.indices)?;
    let up_to_indices = &bytes[..layout.opacity_of as usize];
    let vertices = if planted::is(Defect::BrickVertex) { u32::MAX } else { brick.vertex_count };
    indices(part, brick, vertices, up_to_indices, layout.indices)
}

/// Checks what decides which rays pass through triangles.
fn opacity(part: Part, brick: &Brick, materials: u32, bytes: &[u8]) -> Result<(), Flaw> {
    if brick.flags & BRICK_OPACITY == 0 {
        return Ok(());
    }
    let layout = GeometryLayout::of(brick);
    let end = layout.opacity_of + u64::from(brick.triangle_count) * 4;
    // Of numbers one more, so that none is 0.
    let most = max_u32_by(&bytes[layout.opacity_of as usize..end as usize], |number| number.wrapping_add(1));
    rule(most <= brick.opacity_count, part, || {
        (format!("number {} of a triangle with opacity", most - 1), format!("less than {}", brick.opacity_count))
    })?;
    padding(part, bytes, end, layout.opacities)?;
    let (triangles, _) = bytes[layout.opacities as usize..].as_chunks::<{ size_of::<OpacityTriangle>() }>();
    for (index, bytes) in triangles.iter().enumerate() {
        let triangle: OpacityTriangle = bytemuck::pod_read_unaligned(bytes);
        let right = triangle.material < materials
            && triangle.alphas >> 24 == 0
            && triangle.uv.as_flattened().iter().all(|x| x.is_finite());
        rule(right, part, || {
            (format!("{triangle:?} as number {index}"), format!("finite numbers and a material less than {materials}"))
        })?;
    }
    Ok(())
}

fn attributes(part: Part, brick: &Brick, materials: u32, bytes: &[u8]) -> Result<(), Flaw> {
    let layout = AttributeLayout::of(brick);
    let surfaces_end = layout.surfaces + u64::from(brick.triangle_count) * 4;
    let vertices_end = u64::from(brick.attribute_vertex_count) * size_of::<AttributeVertex>() as u64;
    padding(part, bytes, vertices_end, layout.surfaces)?;
    let surfaces = &bytes[layout.surfaces as usize..surfaces_end as usize];
    let material = max_u32_by(surfaces, |surface| surface & SURFACE_MATERIAL);
    rule(material < materials, part, || (format!("material {material}"), format!("less than {materials}")))?;
    let rotation = max_u32(surfaces) >> SURFACE_ROTATION_SHIFT;
    rule(rotation < 3, part, || (format!("rotation {rotation}"), "0, 1 or 2"))?;
    padding(part, bytes, surfaces_end, layout.indices)?;
    let (up_to_indices, details) = bytes.split_at(layout.details as usize);
    indices(part, brick, brick.attribute_vertex_count, up_to_indices, layout.indices)?;
    for (index, bytes) in details.as_chunks::<{ size_of::<AttributeDetail>() }>().0.iter().enumerate() {
        let detail: AttributeDetail = bytemuck::pod_read_unaligned(bytes);
        // A sign with a tangent, nothing without one.
        let handed = match detail.tangent {
            NO_NORMAL => detail.handedness.to_bits() == 0,
            _ => detail.handedness.abs() == 1.0,
        };
        rule(handed && detail.uv.iter().all(|x| x.is_finite()), part, || {
            (
                format!("{detail:?} of vertex {index}"),
                "a handedness of 1 or -1, of 0 without a tangent; finite coordinates",
            )
        })?;
    }
    Ok(())
}

/// Checks that the nodes are a tree: every node but the root is the child of exactly one node before it. Then a
/// traversal ends, and its stack is as deep as the brick's height at most.
fn nodes(part: Part, brick: &Brick, bytes: &[u8]) -> Result<(), Flaw> {
    let (nodes, _) = bytes.as_chunks::<{ size_of::<Node>() }>();
    rule(nodes[0] == bytemuck::bytes_of(&brick.root), part, || ("a node 0", "the brick's root, which it is not"))?;
    // Level of each node, the root's 1; 0 while no parent was met.
    let mut levels = vec![0u8; nodes.len()];
    levels[0] = 1;
    for (index, bytes) in nodes.iter().enumerate() {
        let node = NodeView::of_bytes(bytes);
        node.check(index as u32, brick.node_count, brick.triangle_count, "triangles")
            .map_err(|flaw| flaw.of_node(part, format_args!("node {index}")))?;
        rule(NodeView::has_finite_boxes(bytes), part, || {
            (format!("node {index} with a box that is not finite"), "finite origins and exponents from 1 to 254")
        })?;
        let level = levels[index];
        rule(level != 0, part, || (format!("node {index} without a parent"), "a tree"))?;
        if node.inner_mask == 0 {
            continue;
        }
        rule(u32::from(level) < brick.height, part, || {
            (format!("node {index} with children on level {}", level + 1), format!("at most {} levels", brick.height))
        })?;
        // Inside `levels`: the check above compared them with the number of nodes.
        for child in &mut levels[node.child_base as usize..][..node.inner_count() as usize] {
            rule(*child == 0, part, || (format!("node {index} with another node's child"), "a tree"))?;
            *child = level + 1;
        }
    }
    Ok(())
}

/// Checks that indices of vertices are less than `vertices`, and the padding after them.
fn indices(part: Part, brick: &Brick, vertices: u32, bytes: &[u8], offset: u64) -> Result<(), Flaw> {
    let wide = brick.flags & BRICK_INDEX32 != 0;
    let end = offset + u64::from(brick.triangle_count) * if wide { 12 } else { 6 };
    let indices = &bytes[offset as usize..end as usize];
    let index = if wide { max_u32(indices) } else { u32::from(max_u16(indices)) };
    rule(index < vertices, part, || (format!("index {index} of a vertex"), format!("less than {vertices}")))?;
    padding(part, bytes, end, bytes.len() as u64)
}

/// Checks that `bytes[start..end]` is zero.
pub(super) fn padding(part: Part, bytes: &[u8], start: u64, end: u64) -> Result<(), Flaw> {
    let at = bytes[start as usize..end as usize].iter().position(|&byte| byte != 0);
    rule(at.is_none(), part, || {
        let at = start + at.unwrap_or(0) as u64;
        (format!("{:#04x} at its byte {at}", bytes[at as usize]), "zero padding")
    })
}

fn max_u32(bytes: &[u8]) -> u32 {
    max_u32_by(bytes, |value| value)
}

#[inline]
fn max_u32_by(bytes: &[u8], of: impl Fn(u32) -> u32) -> u32 {
    bytes.as_chunks::<4>().0.iter().fold(0, |max, &value| max.max(of(u32::from_le_bytes(value))))
}

fn max_u16(bytes: &[u8]) -> u16 {
    bytes.as_chunks::<2>().0.iter().fold(0, |max, &value| max.max(u16::from_le_bytes(value)))
}
