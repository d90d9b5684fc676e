//! Levels of detail in a frame: what selection goes by, for each leaf of the top level, and which levels stand for all
//! that is below its nodes.
//!
//! Boxes and errors are made to nest here, from the bricks to the roots, whatever rounding does: then a ray takes
//! exactly one leaf on each way from a root to a brick (`shaders/trace/levels.wgsl`).

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

    /// Marks leaves by the signs of their errors; leaves without a mark, or all where there are none, have none.
    pub fn mark(&mut self, marks: &[bool]) {
        for (index, leaf) in self.leaves.iter_mut().enumerate() {
            let is_marked = marks.get(index).is_some_and(|&mark| mark);
            leaf.error_square = leaf.error_square.copysign(if is_marked { -1.0 } else { 1.0 });
        }
    }
}

/// The largest factor by which an instance lengthens anything, rounding included: the root of the largest eigenvalue
/// of the product of its matrix with its transpose.
pub fn stretch(instance: &Instance) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::SceneFile;
    use brickwalk_convert::build::{BuildSettings, build};
    use brickwalk_convert::progress::Progress;
    use brickwalk_scenes::rotated_instances;

    fn scene() -> SceneFile {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bricks");
        let settings =
            BuildSettings { brick_triangles: 32, instance_min_triangles: 1, lod: true, ..BuildSettings::default() };
        build(rotated_instances(7), &settings, &path, &Progress::hidden()).unwrap();
        let mut scene = SceneFile::open(&path).unwrap();
        scene.use_levels();
        scene
    }

    /// The levels above a leaf, the nearest first.
    fn above(parents: &[u32], mut leaf: u32) -> Vec<u32> {
        let mut levels = Vec::new();
        while parents[leaf as usize] != NONE {
            leaf = parents[leaf as usize];
            levels.push(leaf);
        }
        levels
    }

    #[test]
    fn errors_grow_and_boxes_nest_toward_the_roots() {
        let scene = scene();
        let resident = scene.resident();
        let frame = Frame::near(resident, glam::DVec3::new(3.0, 1.0, -2.0));
        let table = LevelTable::new(resident, &frame);
        let mut levels = 0;
        for (leaf, own) in resident.leaves.iter().zip(&table.leaves) {
            assert_eq!(own.error_square == 0.0, (leaf.brick as usize) < resident.exact_bricks());
            if own.parent == NONE {
                continue;
            }
            levels += 1;
            let parent = &table.leaves[own.parent as usize];
            assert!(own.error_square <= parent.error_square);
            assert!((0..3).all(|k| own.min[k] >= parent.min[k] && own.max[k] <= parent.max[k]));
        }
        assert!(levels > 100, "{levels}");
    }

    #[test]
    fn nodes_know_the_last_level_above_all_that_is_below_them() {
        let scene = scene();
        let resident = scene.resident();
        let parents = resident.level_parents();
        let found = stand_ins(resident, &parents);
        let last_common = |leaves: &[u32]| {
            let first = above(&parents, leaves[0]);
            let is_common = |level: &&u32| leaves.iter().all(|&leaf| above(&parents, leaf).contains(level));
            first.iter().find(is_common).copied().unwrap_or(NONE)
        };
        let mut below: Vec<Vec<u32>> = vec![Vec::new(); resident.top2.len()];
        for (index, node) in resident.top2.iter().enumerate().rev() {
            below[index] = match node.right {
                TOP_LEAF => vec![node.left],
                right => [below[node.left as usize].clone(), below[right as usize].clone()].concat(),
            };
            assert_eq!(found[index], last_common(&below[index]), "node {index}");
        }
        assert!(found.iter().filter(|level| **level != NONE).count() > resident.top2.len() / 2);
    }

    #[test]
    fn instances_lengthen_by_their_largest_factor() {
        let of = |matrix: [f64; 9]| {
            let [a, b, c, d, e, f, g, h, i] = matrix;
            stretch(&Instance { world_from_object: [a, b, c, 0.0, d, e, f, 0.0, g, h, i, 0.0], ..resident_instance() })
        };
        let (sin, cos) = 0.3f64.sin_cos();
        for (matrix, factor) in [
            ([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], 1.0),
            ([0.0, -2.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 2.0], 2.0),
            ([3.0 * cos, -sin, 0.0, 3.0 * sin, cos, 0.0, 0.0, 0.0, 0.5], 3.0),
            ([1e-9, 0.0, 0.0, 0.0, 1e9, 0.0, 0.0, 0.0, 1.0], 1e9),
        ] {
            let found = of(matrix);
            assert!(found >= factor && found < factor * 1.00001, "{found} for {factor}");
        }
    }

    fn resident_instance() -> Instance {
        Instance { object: 0, base: 0, flags: 0, _reserved: 0, world_from_object: Instance::IDENTITY }
    }
}
