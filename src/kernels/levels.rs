//! Levels of detail in a frame: what selection goes by, for each leaf of the top level, and which levels stand for all
//! that is below its nodes.
//!
//! Boxes and errors are made to nest here, from the bricks to the roots, whatever rounding does: then a ray takes exactly
//! one leaf on each way from a root to a brick (`shaders/trace/levels.wgsl`).

use super::frame::Frame;
use super::layout::LevelLeaf;
use crate::scene::placement::affine;
use bricks::{Bounds, Instance, NONE, Resident, TOP_LEAF};
use glam::DMat3;

/// What kernels read of levels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelTable {
    /// For each leaf of the top level.
    pub leaves: Vec<LevelLeaf>,
    /// For each node of the binary and then of the wide top level the leaf of the level that stands for all below it,
    /// or [`NONE`].
    pub nodes: Vec<u32>,
}

impl LevelTable {
    /// Of the scene in the frame. Where levels are not in use every leaf is one that all rays take.
    pub fn new(resident: &Resident, frame: &Frame) -> Self {
        let parents = resident.level_parents();
        let (boxes, errors) = nested(resident, &parents);
        let world = &resident.objects[0];
        let scale = f64::from(world.step_log2 - world.unit_log2).exp2();
        let point = |p: &[i64; 3]| std::array::from_fn(|k| ((p[k] - frame.reference[k]) as f64 * scale) as f32);
        let exact = resident.exact_bricks();
        let leaf = |index: usize| {
            let [min, max] = &boxes[index];
            // Of a level above 0, so that rays without tolerance take none.
            let square = ((errors[index] / frame.unit).powi(2) as f32).next_up().max(f32::MIN_POSITIVE);
            let is_level = resident.leaves[index].brick as usize >= exact;
            let error_square = if is_level { square } else { 0.0 };
            LevelLeaf { min: point(min), error_square, max: point(max), parent: parents[index] }
        };
        let leaves = (0..boxes.len()).map(leaf).collect();
        Self { leaves, nodes: stand_ins(resident, &parents) }
    }
}

/// The largest factor by which an instance lengthens anything, rounding included: the root of the largest eigenvalue
/// of the product of its matrix with its transpose.
fn stretch(instance: &Instance) -> f64 {
    let linear = affine(&instance.world_from_object).matrix3;
    let mut squares: DMat3 = linear.transpose() * linear;
    let size = squares.to_cols_array().iter().fold(0.0f64, |most, x| most.max(x.abs()));
    if !(size.is_finite() && size > 0.0) {
        return f64::INFINITY;
    }
    // Squaring a matrix again and again leaves its largest eigenvalue: that of the 2^20th power is known to a factor 3.
    let mut log2 = 0.0;
    let steps = 20;
    for step in 0..=steps {
        let size = squares.to_cols_array().iter().fold(0.0f64, |most, x| most.max(x.abs()));
        log2 += size.log2() / f64::from(1 << step);
        squares *= 1.0 / size;
        squares = squares * squares;
    }
    (log2 / 2.0).exp2() * (1.0 + 4e-6)
}

/// Boxes, world lattice steps, and errors, world units, of the leaves: of a level no less than of anything below it.
fn nested(resident: &Resident, parents: &[u32]) -> (Vec<Bounds>, Vec<f64>) {
    let stretches: Vec<f64> = resident.instances.iter().map(stretch).collect();
    let first = resident.exact_bricks();
    let mut boxes: Vec<Bounds> = resident.leaves.iter().map(|leaf| resident.leaf_box(leaf)).collect();
    let own = |leaf: &bricks::Leaf| match (leaf.brick as usize).checked_sub(first) {
        Some(level) if parents.len() == resident.leaves.len() => {
            resident.levels.get(level).map_or(0.0, |level| level.error * stretches[leaf.instance as usize])
        }
        _ => 0.0,
    };
    let mut errors: Vec<f64> = resident.leaves.iter().map(own).collect();
    // Children are bricks or levels before their parent.
    let mut order: Vec<u32> = (0..resident.leaves.len() as u32).collect();
    order.sort_unstable_by_key(|&leaf| resident.leaves[leaf as usize].brick);
    for leaf in order {
        let (leaf, parent) = (leaf as usize, parents[leaf as usize]);
        if parent != NONE {
            let ([min, max], error) = (boxes[leaf], errors[leaf]);
            let [low, high] = &mut boxes[parent as usize];
            for k in 0..3 {
                low[k] = low[k].min(min[k]);
                high[k] = high[k].max(max[k]);
            }
            errors[parent as usize] = errors[parent as usize].max(error);
        }
    }
    (boxes, errors)
}

/// For each node of both trees the level that everything below it belongs to, if there is one: the last that the ways
/// from the leaves to the roots have in common.
fn stand_ins(resident: &Resident, parents: &[u32]) -> Vec<u32> {
    let mut depths = vec![0u32; parents.len()];
    let mut order: Vec<u32> = (0..parents.len() as u32).collect();
    order.sort_unstable_by_key(|&leaf| std::cmp::Reverse(resident.leaves[leaf as usize].brick));
    for leaf in order {
        let parent = parents[leaf as usize];
        if parent != NONE {
            depths[leaf as usize] = depths[parent as usize] + 1;
        }
    }
    let common = |mut a: u32, mut b: u32| {
        while a != b {
            if a == NONE || b == NONE {
                return NONE;
            }
            if depths[a as usize] >= depths[b as usize] {
                a = parents[a as usize];
            } else {
                b = parents[b as usize];
            }
        }
        a
    };
    let mut of2 = vec![NONE; resident.top2.len()];
    // Children follow their parents.
    for (index, node) in resident.top2.iter().enumerate().rev() {
        of2[index] = match node.right {
            TOP_LEAF => parents[node.left as usize],
            right => common(of2[node.left as usize], of2[right as usize]),
        };
    }
    let mut of8 = vec![NONE; resident.top8.len()];
    for (index, node) in resident.top8.iter().enumerate().rev() {
        let mut inner = node.child_base as usize;
        let mut all = None;
        for (slot, &meta) in node.meta.iter().enumerate().filter(|(_, meta)| **meta != 0) {
            let of_child = if node.inner_mask & 1 << slot != 0 {
                inner += 1;
                of8[inner - 1]
            } else {
                parents[(node.leaf_base + u32::from(meta & 31)) as usize]
            };
            all = Some(all.map_or(of_child, |before| common(before, of_child)));
        }
        of8[index] = all.unwrap_or(NONE);
    }
    of2.extend(of8);
    of2
}
