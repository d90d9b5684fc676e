//! What stands in the scene with a field, or without, in a tree of boxes.

use super::library::Library;
use super::subject::{Subject, is_similarity};
use super::twin::STACK;
use crate::kernels::frame::Frame;
use crate::kernels::layout::{DisplacementCarrier, DisplacementNode, NONE};
use crate::scene::placement::affine;
use bricks::Resident;
use glam::DVec3;
use std::collections::BTreeMap;

/// Of all that rays can meet what answers for it, placed in a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Carriers {
    /// Boxes: of all, then the two children of each one by one.
    pub nodes: Vec<DisplacementNode>,
    /// What they hold.
    pub carriers: Vec<DisplacementCarrier>,
}

/// A box of the world's lattice.
#[derive(Clone, Copy)]
struct Bounds {
    min: [i64; 3],
    max: [i64; 3],
}

impl Bounds {
    fn and(self, other: Self) -> Self {
        Self {
            min: std::array::from_fn(|k| self.min[k].min(other.min[k])),
            max: std::array::from_fn(|k| self.max[k].max(other.max[k])),
        }
    }

    /// Twice its middle.
    fn middle(&self, k: usize) -> i128 {
        i128::from(self.min[k]) + i128::from(self.max[k])
    }
}

/// Something with a box.
struct Boxed {
    bounds: Bounds,
    carrier: DisplacementCarrier,
}

impl Carriers {
    /// Those of a scene with the fields of `library`: an instance of an object that has a field, or a brick of an
    /// instance. Fields answer for instances that are turned, moved and scaled alike on all axes.
    pub fn new(resident: &Resident, library: &Library, frame: &Frame) -> Self {
        let mut whole: BTreeMap<u32, Bounds> = BTreeMap::new();
        let mut all = Vec::new();
        for node in resident.top2.iter().filter(|node| node.right == bricks::NONE) {
            let leaf = resident.leaves[node.left as usize];
            let bounds = Bounds { min: node.min, max: node.max };
            let object = resident.bricks[leaf.brick as usize].object;
            let instance = &resident.instances[leaf.instance as usize];
            if !is_similarity(instance) {
                all.push(Boxed {
                    bounds,
                    carrier: DisplacementCarrier { field: NONE, brick: NONE, ..Default::default() },
                });
            } else if library.number(Subject { object, brick: None }).is_some() {
                whole.entry(leaf.instance).and_modify(|own| *own = own.and(bounds)).or_insert(bounds);
            } else {
                let subject = Subject { object, brick: Some(leaf.brick) };
                let brick = if library.is_copied(object) { NONE } else { leaf.brick };
                all.push(Boxed { bounds, carrier: placed(resident, library, subject, leaf.instance, brick, frame) });
            }
        }
        for (instance, bounds) in whole {
            let object = resident.instances[instance as usize].object;
            let brick = if library.is_copied(object) { NONE } else { resident.objects[object as usize].first_brick };
            let subject = Subject { object, brick: None };
            all.push(Boxed { bounds, carrier: placed(resident, library, subject, instance, brick, frame) });
        }
        let mut tree = Self::default();
        if !all.is_empty() {
            let world = &resident.objects[0];
            let scale = f64::from(world.step_log2 - world.unit_log2).exp2();
            tree.nodes.push(DisplacementNode::default());
            tree.split(0, &mut all, frame, scale, 0);
        }
        tree
    }

    /// Makes node `number` of `all`.
    fn split(&mut self, number: usize, all: &mut [Boxed], frame: &Frame, scale: f64, height: usize) {
        assert!(height + 2 < STACK, "a tree of halves over fewer than 2^32 leaves is no higher than 32");
        let bounds = all.iter().skip(1).fold(all[0].bounds, |bounds, one| bounds.and(one.bounds));
        let at = |x: i64, k: usize| ((x - frame.reference[k]) as f64 * scale) as f32;
        // Beyond what rounding moves a face by, or a ray's place on it.
        let room = |x: f32| x.abs() * (8.0 * f32::EPSILON) + f32::MIN_POSITIVE;
        let size = (0..3).map(|k| at(bounds.max[k], k).abs().max(at(bounds.min[k], k).abs())).fold(0.0, f32::max);
        let mut node = DisplacementNode {
            min: std::array::from_fn(|k| at(bounds.min[k], k) - room(size)),
            max: std::array::from_fn(|k| at(bounds.max[k], k) + room(size)),
            ..Default::default()
        };
        if let [one] = all {
            (node.first, node.is_leaf) = (self.carriers.len() as u32, 1);
            self.carriers.push(one.carrier);
            self.nodes[number] = node;
            return;
        }
        let extent = |k: usize| {
            let all = || all.iter().map(|one| one.bounds.middle(k));
            all().max().unwrap_or(0) - all().min().unwrap_or(0)
        };
        let axis = (0..3).max_by_key(|&k| extent(k)).unwrap_or(0);
        let half = all.len() / 2;
        all.select_nth_unstable_by_key(half, |one| one.bounds.middle(axis));
        let first = self.nodes.len();
        node.first = first as u32;
        self.nodes[number] = node;
        self.nodes.extend([DisplacementNode::default(); 2]);
        let (low, high) = all.split_at_mut(half);
        self.split(first, low, frame, scale, height + 1);
        self.split(first + 1, high, frame, scale, height + 1);
    }
}

/// A subject as an instance places it; without a field if it has none.
fn placed(
    resident: &Resident,
    library: &Library,
    subject: Subject,
    instance: u32,
    brick: u32,
    frame: &Frame,
) -> DisplacementCarrier {
    let Some(number) = library.number(subject) else {
        return DisplacementCarrier { field: NONE, brick, ..Default::default() };
    };
    let ball = library.fields[number].ball;
    let object_from_world = affine(&resident.instances[instance as usize].world_from_object).inverse();
    let linear = object_from_world.matrix3 * (frame.unit / ball.radius);
    let offset: DVec3 = (object_from_world.transform_point3(frame.origin) - ball.center) / ball.radius;
    let row = |k: usize| linear.row(k).as_vec3().extend(offset[k] as f32).to_array();
    DisplacementCarrier { unit_from_point: std::array::from_fn(row), field: number as u32, brick, ..Default::default() }
}
