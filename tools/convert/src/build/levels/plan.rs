//! Which bricks and levels each level stands for: trees over boxes, which depend on nothing else.

use super::simplify::target;
use crate::build::input::matrix::Affine;
use crate::build::tree::binary::Box3;
use crate::build::tree::top_level::world_box;
use crate::build::triangles::lattice::Lattice;
use bricks::{Brick, LEVEL_CHILDREN, Leaf, NONE, Object};

/// How many times larger than the median a box is that is kept apart from the others.
const HUGE: f64 = 8.0;

/// Triangles at most of what stands for an object that instances place, where that can be.
const COARSEST: usize = 128;

/// Stored triangles for each instance that levels of the world stand for, at least: those levels then take less than
/// the bricks do.
const TRIANGLES_PER_INSTANCE: u64 = 256;

/// A level to be made.
#[derive(Clone, Debug)]
pub(crate) struct Planned {
    /// The object that it belongs to.
    pub object: u32,
    /// What it stands for: one to [`LEVEL_CHILDREN`] bricks, or the number of all bricks and that of a level before it.
    pub children: Vec<Leaf>,
    /// Levels below it, itself counted.
    pub depth: u32,
}

/// All levels, children before those that stand for them, and one depth after the other.
#[derive(Debug, Default)]
pub(crate) struct Plan {
    /// The levels.
    pub levels: Vec<Planned>,
}

/// What can be a child: a brick, or a level that is planned.
#[derive(Clone, Copy, Debug)]
struct Item {
    bounds: Box3,
    child: Leaf,
    depth: u32,
    /// Its triangles, about.
    triangles: usize,
    /// Its place among the items of its tree.
    index: u32,
}

impl Item {
    fn center2(&self, axis: usize) -> i64 {
        self.bounds.min[axis] + self.bounds.max[axis]
    }

    fn diagonal(&self) -> f64 {
        (0..3).map(|k| ((self.bounds.max[k] - self.bounds.min[k]) as f64).powi(2)).sum::<f64>().sqrt()
    }
}

/// A tree that grows.
struct Tree {
    object: u32,
    /// Number of all bricks.
    bricks: u32,
    brick_triangles: u32,
    levels: Vec<Planned>,
}

impl Tree {
    /// The level over up to four items; one item is that itself.
    fn level(&mut self, items: &[Item]) -> Item {
        if let [one] = items { *one } else { self.stand_for(items) }
    }

    /// A level over one to four items.
    fn stand_for(&mut self, items: &[Item]) -> Item {
        let depth = 1 + items.iter().map(|item| item.depth).max().unwrap_or(0);
        let child = Leaf { instance: NONE, brick: self.bricks + self.levels.len() as u32 };
        let children = items.iter().map(|item| item.child).collect();
        self.levels.push(Planned { object: self.object, children, depth });
        let bounds = items[1..].iter().fold(items[0].bounds, |all, item| all.union(&item.bounds));
        let triangles = target(items.iter().map(|item| item.triangles).sum(), self.brick_triangles);
        Item { bounds, child, depth, triangles, index: items[0].index }
    }

    /// A root of few triangles: levels over each other, above `root`.
    fn chain(&mut self, mut root: Item) -> Item {
        while root.triangles > COARSEST {
            root = self.stand_for(&[root]);
        }
        root
    }

    /// The root over items, of which there is at least one.
    fn grow(&mut self, items: &mut [Item]) -> Item {
        if items.len() <= LEVEL_CHILDREN {
            items.sort_unstable_by_key(|item| item.index);
            return self.level(items);
        }
        let (low, high) = halve(items);
        let mut children = Vec::with_capacity(LEVEL_CHILDREN);
        for half in [low, high] {
            let (a, b) = halve(half);
            children.extend([a, b].map(|quarter| self.grow(quarter)));
        }
        self.level(&children)
    }

    /// The same, items that are huge against the others apart from them.
    fn root(&mut self, items: &mut [Item]) -> Item {
        let mut diagonals: Vec<f64> = items.iter().map(Item::diagonal).collect();
        let middle = diagonals.len() / 2;
        let median = *diagonals.select_nth_unstable_by(middle, f64::total_cmp).1;
        items.sort_by_key(|item| (item.diagonal() > HUGE * median, item.index));
        let usual = items.partition_point(|item| item.diagonal() <= HUGE * median);
        let (usual, huge) = items.split_at_mut(usual);
        if usual.is_empty() || huge.is_empty() || usual.len() + huge.len() <= LEVEL_CHILDREN {
            return self.grow(items);
        }
        let children = [self.grow(usual), self.grow(huge)];
        self.level(&children)
    }
}

/// Halves at least two items: those that lie below the others along the longest axis of the bounds of their centres,
/// and the others.
fn halve(items: &mut [Item]) -> (&mut [Item], &mut [Item]) {
    let extent = |axis: usize| {
        let centers = items.iter().map(|item| item.center2(axis));
        let bounds = centers.fold([i64::MAX, i64::MIN], |[low, high], x| [low.min(x), high.max(x)]);
        bounds[1] - bounds[0]
    };
    let extents = [extent(0), extent(1), extent(2)];
    let axis = (0..3).fold(0, |best, k| if extents[k] > extents[best] { k } else { best });
    let middle = items.len().div_ceil(2);
    items.select_nth_unstable_by_key(middle, |item| (item.center2(axis), item.index));
    items.split_at_mut(middle)
}

/// What levels are planned for.
pub(crate) struct Scene<'a> {
    /// The objects.
    pub objects: &'a [Object],
    /// Their lattices.
    pub lattices: &'a [Lattice],
    /// Their bricks.
    pub bricks: &'a [Brick],
    /// Objects that stay where they are, by number of the instance, with the matrix.
    pub placed: Vec<(u32, u32, Affine)>,
    /// Most triangles of a brick.
    pub brick_triangles: u32,
}

impl Scene<'_> {
    /// The bricks of an object as items.
    fn items(&self, object: u32) -> Vec<Item> {
        let record = &self.objects[object as usize];
        let own = record.first_brick..record.first_brick + record.brick_count;
        let item = |(index, brick): (u32, u32)| {
            let Brick { min, max, triangle_count, .. } = self.bricks[brick as usize];
            let child = Leaf { instance: NONE, brick };
            Item { bounds: Box3 { min, max }, child, depth: 0, triangles: triangle_count as usize, index }
        };
        (0..).zip(own).map(item).collect()
    }
}

impl Plan {
    /// The levels of all objects within themselves, and those of the world over the instances too, unless these are too
    /// many for that.
    pub fn of(scene: &Scene) -> Self {
        let (bricks, brick_triangles) = (scene.bricks.len() as u32, scene.brick_triangles);
        let mut tree = Tree { object: 0, bricks, brick_triangles, levels: Vec::new() };
        let mut roots = vec![None; scene.objects.len()];
        for object in 1..scene.objects.len() as u32 {
            tree.object = object;
            let mut items = scene.items(object);
            if !items.is_empty() {
                let root = tree.root(&mut items);
                roots[object as usize] = Some(tree.chain(root));
            }
        }
        tree.object = 0;
        let mut items = scene.items(0);
        let stored: u64 = scene.bricks.iter().map(|brick| u64::from(brick.triangle_count)).sum();
        if scene.placed.len() as u64 <= stored / TRIANGLES_PER_INSTANCE {
            for &(instance, object, matrix) in &scene.placed {
                let Some(root) = roots[object as usize] else { continue };
                let bounds = world_box(root.bounds, &scene.lattices[object as usize], &matrix, &scene.lattices[0]);
                let child = Leaf { instance, ..root.child };
                items.push(Item { bounds, child, index: items.len() as u32, ..root });
            }
        }
        if items.len() > 1 {
            tree.root(&mut items);
        }
        Self::in_order(tree)
    }

    /// One depth after the other, so that levels that follow each other do not stand for each other.
    fn in_order(tree: Tree) -> Self {
        let mut order: Vec<u32> = (0..tree.levels.len() as u32).collect();
        order.sort_by_key(|&level| tree.levels[level as usize].depth);
        let mut new_of_old = vec![0; order.len()];
        for (new, &old) in (0u32..).zip(&order) {
            new_of_old[old as usize] = new;
        }
        let renumber = |old: &u32| {
            let mut planned = tree.levels[*old as usize].clone();
            for child in planned.children.iter_mut().filter(|child| child.brick >= tree.bricks) {
                child.brick = tree.bricks + new_of_old[(child.brick - tree.bricks) as usize];
            }
            planned
        };
        Self { levels: order.iter().map(renumber).collect() }
    }
}
