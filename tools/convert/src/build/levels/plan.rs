//! Which bricks and levels each level stands for: trees over boxes, which depend on nothing else.

use crate::build::tree::binary::Box3;
use bricks::{Brick, LEVEL_CHILDREN, Leaf, NONE, Object};

/// How many times larger than the median a box is that is kept apart from the others.
const HUGE: f64 = 8.0;

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
    levels: Vec<Planned>,
}

impl Tree {
    /// The level over up to four items; one item is that itself.
    fn level(&mut self, items: &[Item]) -> Item {
        let [first, others @ ..] = items else { unreachable!("a set of items is not empty") };
        if others.is_empty() {
            return *first;
        }
        let depth = 1 + items.iter().map(|item| item.depth).max().unwrap_or(0);
        let child = Leaf { instance: NONE, brick: self.bricks + self.levels.len() as u32 };
        let children = items.iter().map(|item| item.child).collect();
        self.levels.push(Planned { object: self.object, children, depth });
        let bounds = others.iter().fold(first.bounds, |all, item| all.union(&item.bounds));
        Item { bounds, child, depth, index: first.index }
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

/// Halves at least two items: those that lie below the others along the longest axis of the bounds of their centres, and
/// the others.
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

impl Plan {
    /// The levels of all objects within themselves.
    pub fn of(objects: &[Object], bricks: &[Brick]) -> Self {
        let mut tree = Tree { object: 0, bricks: bricks.len() as u32, levels: Vec::new() };
        for (object, record) in (0u32..).zip(objects) {
            tree.object = object;
            let own = record.first_brick..record.first_brick + record.brick_count;
            let item = |(index, brick): (u32, u32)| {
                let Brick { min, max, .. } = bricks[brick as usize];
                Item { bounds: Box3 { min, max }, child: Leaf { instance: NONE, brick }, depth: 0, index }
            };
            let mut items: Vec<Item> = (0..).zip(own).map(item).collect();
            if items.len() > 1 {
                tree.root(&mut items);
            }
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
