//! Encodes a brick: its triangles rounded to the lattice, its tree, its payloads.

use super::voxelise::voxelise;
use crate::build::texture::opacity::MaterialOpacity;
use crate::build::tree::binary::{BinaryTree, Box3};
use crate::build::tree::node;
use crate::build::tree::wide::{WideTree, collapse, collapse_levels};
use crate::build::triangles::attributes::{self, MeanColors, VertexBits, Wants};
use crate::build::triangles::intern::Interner;
use crate::build::triangles::lattice::{Lattice, pow2};
use crate::build::triangles::triangle::Triangle as Rounded;
use bricks::{
    AttributeLayout, BRICK_DETAIL, BRICK_INDEX32, BRICK_OPACITY, BRICK_WIDE, Brick, GeometryLayout, LEAF_TRIANGLES,
    MAX_BRICK_HEIGHT, NEAR_STEPS, NONE, ORIGIN_STEPS, Occupancy, OccupancyGrid, OpacityTriangle, SURFACE_MATERIAL,
    SURFACE_ROTATION_SHIFT, Span, WIDE_HIGH_STEPS,
};
use bytemuck::Zeroable;

/// Levels of a binary tree whose wide tree is seldom too high.
const SPLIT_LEVELS: u32 = 48;

/// What bricks of one object have in common.
#[derive(Clone, Copy)]
pub(crate) struct BrickContext<'a> {
    /// Index of the object.
    pub index: u32,
    /// Its lattice.
    pub lattice: Lattice,
    /// Mean colours by material.
    pub materials: &'a [MeanColors],
    /// Opacity by material.
    pub opacity: &'a [MaterialOpacity],
    /// What triangles want, by material.
    pub wants: &'a [Wants],
    /// Whether trees are built fast rather than well.
    pub is_fast: bool,
    /// Whether bricks have proxies.
    pub has_proxies: bool,
}

/// A brick ready to be written.
#[derive(Debug)]
pub(crate) struct EncodedBrick {
    /// The record, without the places of its payloads.
    pub record: Brick,
    /// The geometry payload.
    pub geometry: Vec<u8>,
    /// The attribute payload, encoded.
    pub attributes: Vec<u8>,
    /// The occupancy and the proxies payload, if wanted.
    pub proxies: Option<(Occupancy, Vec<u8>)>,
}

/// A triangle while its brick is made. Corners are in stored order.
#[derive(Clone, Copy)]
struct Triangle {
    id: u32,
    surface: u32,
    /// Numbers of interned positions.
    positions: [u32; 3],
    /// Numbers of interned attribute vertices.
    attributes: [u32; 3],
}

/// The triangles of a brick with their distinct vertices.
struct Contents {
    triangles: Vec<Triangle>,
    positions: Interner<[i64; 3]>,
    attributes: Interner<VertexBits>,
    mean_albedo: [f32; 3],
    mean_emission: [f32; 3],
}

/// Encodes triangles, about `count` of them and at least one, in order of their ids.
pub(crate) fn encode(context: &BrickContext, triangles: impl Iterator<Item = Rounded>, count: usize) -> EncodedBrick {
    lay_out(context, &collect(context, triangles, count))
}

/// Rotates triangles and numbers their distinct vertices.
fn collect(context: &BrickContext, rounded: impl Iterator<Item = Rounded>, count: usize) -> Contents {
    let mut positions: Interner<[i64; 3]> = Interner::with_capacity(count);
    let mut attributes: Interner<VertexBits> = Interner::with_capacity(count);
    let mut triangles = Vec::with_capacity(count);
    let (mut albedo, mut emission, mut area_sum) = ([0.0f64; 3], [0.0f64; 3], 0.0f64);
    for triangle in rounded {
        let (points, vertices) = (triangle.corners, triangle.attributes);
        let [x, y, z] = attributes::cross(&points);
        let area = (x * x + y * y + z * z).sqrt();
        area_sum += area;
        let mean = &context.materials[triangle.material as usize];
        for k in 0..3 {
            let color: f32 = vertices.iter().map(|vertex| vertex.rgb()[k]).sum();
            albedo[k] += area * f64::from(mean.albedo[k] * color / 3.0);
            emission[k] += area * f64::from(mean.emission[k]);
        }

        let rotation = (0..3).fold(0, |least, k| if points[k] < points[least] { k } else { least });
        let turned = |k: usize| (k + rotation) % 3;
        triangles.push(Triangle {
            id: triangle.id,
            surface: triangle.material | (rotation as u32) << SURFACE_ROTATION_SHIFT,
            positions: std::array::from_fn(|k| positions.intern(points[turned(k)]).0),
            attributes: std::array::from_fn(|k| attributes.intern(vertices[turned(k)]).0),
        });
    }
    let mean = |sum: [f64; 3]| sum.map(|x| if area_sum > 0.0 { (x / area_sum) as f32 } else { 0.0 });
    Contents { triangles, positions, attributes, mean_albedo: mean(albedo), mean_emission: mean(emission) }
}

/// The wide tree over the boxes of the triangles, of at most `levels` levels; 8 always suffice.
fn build_tree(boxes: &[Box3], is_fast: bool, levels: u32) -> WideTree {
    let tree = collapse(&BinaryTree::by_obvhs(boxes, is_fast), LEAF_TRIANGLES);
    if tree.height <= levels {
        return tree;
    }
    let tree = collapse(&BinaryTree::by_splits(boxes, SPLIT_LEVELS), LEAF_TRIANGLES);
    if tree.height <= levels {
        return tree;
    }
    // Halving 2^20 triangles takes 21 levels, of which each wide node spans three.
    collapse_levels(&BinaryTree::by_splits(boxes, 0), LEAF_TRIANGLES)
}

/// Renumbers values in the order of their first use.
struct Renumbering {
    new_of_old: Vec<u32>,
    old_of_new: Vec<u32>,
}

impl Renumbering {
    fn new(count: usize) -> Self {
        Self { new_of_old: vec![u32::MAX; count], old_of_new: Vec::with_capacity(count) }
    }

    fn of(&mut self, old: u32) -> u32 {
        let new = &mut self.new_of_old[old as usize];
        if *new == u32::MAX {
            *new = self.old_of_new.len() as u32;
            self.old_of_new.push(old);
        }
        *new
    }
}

fn lay_out(context: &BrickContext, contents: &Contents) -> EncodedBrick {
    let points = contents.positions.values();
    let corners = |triangle: &Triangle| triangle.positions.map(|position| points[position as usize]);
    let boxes: Vec<Box3> = contents.triangles.iter().map(|triangle| Box3::of(&corners(triangle))).collect();
    let bounds = boxes[1..].iter().fold(boxes[0], |all, b| all.union(b));
    let origin: [i64; 3] = std::array::from_fn(|k| nearest_origin(bounds.min[k] + (bounds.max[k] - bounds.min[k]) / 2));
    let relative = |p: [i64; 3]| -> [i64; 3] { std::array::from_fn(|k| p[k] - origin[k]) };
    let relative_boxes: Vec<Box3> = boxes.iter().map(|b| Box3 { min: relative(b.min), max: relative(b.max) }).collect();
    let tree = build_tree(&relative_boxes, context.is_fast, MAX_BRICK_HEIGHT);

    let mut vertices = Renumbering::new(points.len());
    let mut attribute_vertices = Renumbering::new(contents.attributes.values().len());
    let triangles: Vec<Triangle> = tree
        .items
        .iter()
        .map(|&item| {
            let mut triangle = contents.triangles[item as usize];
            triangle.positions = triangle.positions.map(|old| vertices.of(old));
            triangle.attributes = triangle.attributes.map(|old| attribute_vertices.of(old));
            triangle
        })
        .collect();

    let reach = (0..3).flat_map(|k| [origin[k] - bounds.min[k], bounds.max[k] - origin[k]]).max().unwrap_or(0);
    let wide = reach > NEAR_STEPS;
    let index32 = vertices.old_of_new.len().max(attribute_vertices.old_of_new.len()) > 1 << 16;
    let step_unit_log2 = context.lattice.step_unit_log2();
    let nodes: Vec<bricks::Node> = tree.nodes.iter().map(|node| node::encode(node, step_unit_log2)).collect();
    // By the triangles' places in the tree's order, as they were interned: `triangles` are numbered anew.
    let opacity = |&item: &u32| {
        let triangle = &contents.triangles[item as usize];
        let material = triangle.surface & SURFACE_MATERIAL;
        let vertices = triangle.attributes.map(|vertex| &contents.attributes.values()[vertex as usize]);
        context.opacity[material as usize].triangle(material, vertices)
    };
    let mut opacities: Vec<OpacityTriangle> = Vec::new();
    let number = |opacity: Option<OpacityTriangle>| {
        opacity.map_or(NONE, |opacity| {
            opacities.push(opacity);
            opacities.len() as u32 - 1
        })
    };
    let opacity_of: Vec<u32> = tree.items.iter().map(opacity).map(number).collect();
    let flag = |set: bool, flag: u32| if set { flag } else { 0 };
    let wants = |surface: u32| context.wants[(surface & SURFACE_MATERIAL) as usize];
    let details = triangles.iter().any(|triangle| wants(triangle.surface).details);
    let kind = flag(wide, BRICK_WIDE) | flag(index32, BRICK_INDEX32) | flag(details, BRICK_DETAIL);
    let record = Brick {
        object: context.index,
        flags: kind | flag(!opacities.is_empty(), BRICK_OPACITY),
        opacity_count: opacities.len() as u32,
        node_count: nodes.len() as u32,
        triangle_count: triangles.len() as u32,
        vertex_count: vertices.old_of_new.len() as u32,
        attribute_vertex_count: attribute_vertices.old_of_new.len() as u32,
        height: tree.height,
        origin,
        min: bounds.min,
        max: bounds.max,
        mean_albedo: contents.mean_albedo,
        mean_emission: contents.mean_emission,
        root: nodes[0],
        geometry: Span::default(),
        attributes: Span::default(),
        proxies: Span::default(),
        ..Brick::zeroed()
    };

    let layout = GeometryLayout::of(&record);
    let mut geometry = Vec::with_capacity(layout.bytes as usize);
    geometry.extend_from_slice(bytemuck::cast_slice(&nodes));
    for &old in &vertices.old_of_new {
        push_vertex(&mut geometry, relative(points[old as usize]), wide, step_unit_log2);
    }
    geometry.resize(layout.ids as usize, 0);
    geometry.extend(triangles.iter().flat_map(|triangle| triangle.id.to_le_bytes()));
    geometry.resize(layout.indices as usize, 0);
    push_indices(&mut geometry, triangles.iter().map(|triangle| triangle.positions), index32);
    geometry.resize(layout.opacity_of as usize, 0);
    if !opacities.is_empty() {
        geometry.extend_from_slice(bytemuck::cast_slice(&opacity_of));
        geometry.resize(layout.opacities as usize, 0);
        geometry.extend_from_slice(bytemuck::cast_slice(&opacities));
    }

    let layout = AttributeLayout::of(&record);
    let mut attributes = Vec::with_capacity(layout.bytes as usize);
    for &old in &attribute_vertices.old_of_new {
        let vertex = contents.attributes.values()[old as usize].vertex();
        attributes.extend_from_slice(bytemuck::bytes_of(&vertex));
    }
    attributes.resize(layout.surfaces as usize, 0);
    attributes.extend(triangles.iter().flat_map(|triangle| triangle.surface.to_le_bytes()));
    attributes.resize(layout.indices as usize, 0);
    push_indices(&mut attributes, triangles.iter().map(|triangle| triangle.attributes), index32);
    attributes.resize(layout.details as usize, 0);
    if details {
        for &old in &attribute_vertices.old_of_new {
            let detail = contents.attributes.values()[old as usize].detail();
            attributes.extend_from_slice(bytemuck::bytes_of(&detail));
        }
    }
    let proxies = context.has_proxies.then(|| {
        let step_log2 = context.lattice.step_log2;
        let grid = OccupancyGrid::of(step_log2, bounds.min, bounds.max);
        let map = voxelise(step_log2, &grid, contents.triangles.iter().map(corners));
        (map.record(&grid), map.pack())
    });
    let attributes = bricks::attributes::encode(&record, &attributes);
    EncodedBrick { record, geometry, attributes, proxies }
}

/// The multiple of [`ORIGIN_STEPS`] nearest `x`, ties upward.
fn nearest_origin(x: i64) -> i64 {
    (x + ORIGIN_STEPS / 2).div_euclid(ORIGIN_STEPS) * ORIGIN_STEPS
}

/// Appends a vertex: three f32, or for a wide brick three high and three low parts. All are exact: 24 bits of steps
/// times a power of two in the normal range.
fn push_vertex(bytes: &mut Vec<u8>, steps: [i64; 3], wide: bool, step_unit_log2: i32) {
    let scale = pow2(step_unit_log2);
    let mut push = |steps: i64| bytes.extend(((steps as f64 * scale) as f32).to_le_bytes());
    if wide {
        let high = steps.map(|x| (x + WIDE_HIGH_STEPS / 2).div_euclid(WIDE_HIGH_STEPS) * WIDE_HIGH_STEPS);
        high.into_iter().for_each(&mut push);
        (0..3).for_each(|k| push(steps[k] - high[k]));
    } else {
        steps.into_iter().for_each(push);
    }
}

fn push_indices(bytes: &mut Vec<u8>, triangles: impl Iterator<Item = [u32; 3]>, index32: bool) {
    if index32 {
        bytes.extend(triangles.flatten().flat_map(u32::to_le_bytes));
    } else {
        // Fewer than 2^16 vertices, as the flag says.
        bytes.extend(triangles.flatten().flat_map(|index| (index as u16).to_le_bytes()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn origins_are_nearest() {
        let half = ORIGIN_STEPS / 2;
        for x in [0, 1, -1, half - 1, half, -half, -half - 1, 5 * ORIGIN_STEPS + 3, -(1 << 44) + 7] {
            let origin = nearest_origin(x);
            assert!(origin % ORIGIN_STEPS == 0 && (x - origin).abs() <= half);
        }
    }

    #[test]
    fn vertices_are_exact() {
        let values = [0, 1, -1, NEAR_STEPS, -NEAR_STEPS, 12_345_677];
        for step_unit_log2 in [-30, 0, 10] {
            for &x in &values {
                let mut bytes = Vec::new();
                push_vertex(&mut bytes, [x; 3], false, step_unit_log2);
                let stored = f32::from_le_bytes(bytes[4..8].try_into().unwrap());
                assert_eq!(f64::from(stored), x as f64 * pow2(step_unit_log2));
            }
            for &x in values.iter().chain(&[(1 << 44) + 1, -(1 << 45) + 4_194_305, (1 << 22) + 1, 1 << 22, -(1 << 22)])
            {
                let mut bytes = Vec::new();
                push_vertex(&mut bytes, [x; 3], true, step_unit_log2);
                let part = |at: usize| {
                    let stored = f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
                    f64::from(stored) / pow2(step_unit_log2)
                };
                assert_eq!((part(0) + part(12)) as i64, x);
                assert!(part(0) % WIDE_HIGH_STEPS as f64 == 0.0 && part(12).abs() <= (1 << 22) as f64);
            }
        }
        // One step more than a near brick may hold is no f32.
        assert_ne!((NEAR_STEPS + 1) as f32 as i64, NEAR_STEPS + 1);
    }

    #[test]
    fn trees_are_not_too_high() {
        let boxes: Vec<Box3> = (0..3000)
            .map(|i| {
                let x = (1e9 * 0.99f64.powi(i)) as i64;
                Box3 { min: [0; 3], max: [x + 1, x + i64::from(i % 7), x] }
            })
            .collect();
        let heights = [MAX_BRICK_HEIGHT, 14].map(|levels| {
            let tree = build_tree(&boxes, false, levels);
            assert!(tree.height <= levels, "{} levels", tree.height);
            let mut items = tree.items.clone();
            items.sort_unstable();
            assert!(items.len() == boxes.len() && items.iter().zip(0..).all(|(&item, index)| item == index));
            tree.height
        });
        assert!(heights[0] > 14, "the bound takes effect: {heights:?}");
    }
}
