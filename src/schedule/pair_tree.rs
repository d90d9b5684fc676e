//! The query-pair hierarchy of CHC+RT (§4.3): pairs (tile, node), split in screen or in object space, whose leaves are
//! the visible and the invisible front.

use super::PairQuery;
use bricks::{NONE, TopNode2};

/// Fraction t_q of the split rule (CHC+RT §4.4).
const SPLIT_THRESHOLD: f64 = 0.5;

/// A square of tiles, aligned to its own size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Square {
    /// Column of its first tile.
    pub x: u32,
    /// Row of its first tile.
    pub y: u32,
    /// log2 of its edge in tiles.
    pub log2: u32,
}

/// What a pair is at the moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Front {
    /// Split: part of neither front.
    Inner,
    /// A leaf whose rays may hit: one tile and one top-level leaf, to be queried again in frame `requery` or later.
    Visible {
        /// Frame of the next query.
        requery: u32,
    },
    /// No ray of the tile reaches the node before its hit.
    Invisible {
        /// Frame in which it was found so.
        since: u32,
    },
}

/// A pair of the hierarchy.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// Tiles.
    pub square: Square,
    /// Node of the binary top-level tree.
    pub node: u32,
    /// Its part in the fronts.
    pub front: Front,
    /// Children: first index and count; 0 when not split.
    pub children: (u32, u32),
}

/// The hierarchy for one set of rays.
#[derive(Clone, Debug)]
pub struct PairTree {
    pairs: Vec<Pair>,
    /// Blocks of freed children by their count (2 or 4).
    free: [Vec<u32>; 2],
    tiles_x: u32,
    tiles_y: u32,
    tile: u32,
    width: u32,
    height: u32,
}

impl PairTree {
    /// The whole picture of `width` x `height` rays in tiles of `tile` against the root, not visible yet.
    pub fn new(width: u32, height: u32, tile: u32) -> Self {
        let (tiles_x, tiles_y) = (width.div_ceil(tile), height.div_ceil(tile));
        let log2 = tiles_x.max(tiles_y).next_power_of_two().trailing_zeros();
        let root = Pair {
            square: Square { x: 0, y: 0, log2 },
            node: 0,
            front: Front::Invisible { since: 0 },
            children: (0, 0),
        };
        Self { pairs: vec![root], free: [Vec::new(), Vec::new()], tiles_x, tiles_y, tile, width, height }
    }

    /// Bytes it takes.
    pub fn bytes(&self) -> usize {
        self.pairs.capacity() * size_of::<Pair>() + self.free.iter().map(|free| 4 * free.capacity()).sum::<usize>()
    }

    /// A pair.
    pub fn pair(&self, index: u32) -> &Pair {
        &self.pairs[index as usize]
    }

    /// Changes the part of a pair.
    pub fn set_front(&mut self, index: u32, front: Front) {
        self.pairs[index as usize].front = front;
    }

    /// Index of the tile of a pair that has one.
    pub fn tile_index(&self, square: Square) -> usize {
        (square.y * self.tiles_x + square.x) as usize
    }

    /// Number of tiles.
    pub fn tiles(&self) -> usize {
        (self.tiles_x * self.tiles_y) as usize
    }

    /// Leaves of the hierarchy in depth-first order.
    pub fn leaves(&self) -> Vec<u32> {
        let mut out = Vec::new();
        let mut stack = vec![0u32];
        while let Some(index) = stack.pop() {
            let pair = self.pair(index);
            match pair.front {
                Front::Inner => stack.extend((pair.children.0..pair.children.0 + pair.children.1).rev()),
                _ => out.push(index),
            }
        }
        out
    }

    /// The rectangle of rays of a pair; empty where its square lies beyond the picture.
    pub fn query(&self, index: u32) -> PairQuery {
        let Pair { square, .. } = *self.pair(index);
        let edge = self.tile << square.log2;
        let span = |first: u32, most: u32| [(first * self.tile).min(most), (first * self.tile + edge).min(most)];
        PairQuery { x: span(square.x, self.width), y: span(square.y, self.height), nodes: 1 }
    }

    /// Whether a pair is one tile and one leaf, and cannot be split (CHC+RT §4.4; spec: tile and node both terminal).
    pub fn is_terminal(&self, index: u32, top: &[TopNode2]) -> bool {
        let pair = self.pair(index);
        pair.square.log2 == 0 && top[pair.node as usize].right == NONE
    }

    /// Splits a pair that is not terminal: in object space if the node's share of the root's area is larger than t_q
    /// times the tile's share of the screen, else in screen space; where one is terminal, the other. Children start
    /// invisible, since `frame`. Squares beyond the picture are left out.
    pub fn split(&mut self, index: u32, top: &[TopNode2], frame: u32) -> Vec<u32> {
        let Pair { square, node, .. } = *self.pair(index);
        let n = &top[node as usize];
        let share_node = area(n) / area(&top[0]).max(f64::MIN_POSITIVE);
        let q = self.query(index);
        let rays = f64::from(q.x[1] - q.x[0]) * f64::from(q.y[1] - q.y[0]);
        let share_tile = rays / (f64::from(self.width) * f64::from(self.height));
        let object = n.right != NONE && (square.log2 == 0 || share_node > SPLIT_THRESHOLD * share_tile);
        let children: Vec<(Square, u32)> = if object {
            vec![(square, n.left), (square, n.right)]
        } else {
            let log2 = square.log2 - 1;
            let step = 1 << log2;
            [(0, 0), (step, 0), (0, step), (step, step)]
                .into_iter()
                .map(|(dx, dy)| (Square { x: square.x + dx, y: square.y + dy, log2 }, node))
                .filter(|(s, _)| s.x < self.tiles_x && s.y < self.tiles_y)
                .collect()
        };
        let count = children.len() as u32;
        // Blocks hold two or four; a split at the picture's edge leaves part of one unused.
        let class = usize::from(count > 2);
        let first = self.free[class].pop().unwrap_or_else(|| {
            let first = self.pairs.len() as u32;
            let blank = self.pairs[index as usize];
            self.pairs.extend(std::iter::repeat_n(blank, if class == 0 { 2 } else { 4 }));
            first
        });
        for (i, (square, node)) in children.into_iter().enumerate() {
            self.pairs[first as usize + i] =
                Pair { square, node, front: Front::Invisible { since: frame }, children: (0, 0) };
        }
        let pair = &mut self.pairs[index as usize];
        pair.front = Front::Inner;
        pair.children = (first, count);
        (first..first + count).collect()
    }

    /// Collapses pairs whose children are all invisible leaves, one level (CHC+RT §5.1); they have been invisible for
    /// as long as the youngest child. Returns how many.
    pub fn pull_up(&mut self) -> u64 {
        let mut pulled = 0;
        let mut stack = vec![0u32];
        while let Some(index) = stack.pop() {
            let Pair { front, children: (first, count), .. } = *self.pair(index);
            if front != Front::Inner {
                continue;
            }
            let children = first..first + count;
            let since = |c| match self.pair(c).front {
                Front::Invisible { since } => Some(since),
                _ => None,
            };
            let youngest = children.clone().map(since).try_fold(0, |youngest, since| Some(since?.max(youngest)));
            if let Some(since) = youngest {
                self.free[usize::from(count > 2)].push(first);
                let pair = &mut self.pairs[index as usize];
                pair.front = Front::Invisible { since };
                pair.children = (0, 0);
                pulled += 1;
            } else {
                stack.extend(children);
            }
        }
        pulled
    }

    /// A ray (column, row) and a leaf of the top level, of `leaf_count`, that are not together in exactly one leaf
    /// pair; `None` if the leaf pairs partition rays x leaves, as they must (numerical case 31). Takes time and memory
    /// in proportion to both.
    pub fn partition_defect(&self, top: &[TopNode2], leaf_count: usize) -> Option<[u32; 3]> {
        let mut seen = vec![0u8; self.width as usize * self.height as usize * leaf_count];
        for index in self.leaves() {
            let PairQuery { x, y, .. } = self.query(index);
            let mut nodes = vec![self.pair(index).node];
            while let Some(node) = nodes.pop() {
                let node = &top[node as usize];
                if node.right != NONE {
                    nodes.extend([node.left, node.right]);
                    continue;
                }
                for ray in (y[0]..y[1]).flat_map(|y| (x[0]..x[1]).map(move |x| y * self.width + x)) {
                    let times = &mut seen[ray as usize * leaf_count + node.left as usize];
                    *times = times.saturating_add(1);
                }
            }
        }
        let at = seen.iter().position(|&times| times != 1)?;
        let ray = (at / leaf_count) as u32;
        Some([ray % self.width, ray / self.width, (at % leaf_count) as u32])
    }

    /// Whether the picture's size and tiles are these.
    pub fn fits(&self, width: u32, height: u32, tile: u32) -> bool {
        (self.width, self.height, self.tile) == (width, height, tile)
    }
}

/// Surface area of a node's box, in squares of lattice steps.
fn area(node: &TopNode2) -> f64 {
    let e: [f64; 3] = std::array::from_fn(|k| (node.max[k] - node.min[k]) as f64);
    2.0 * (e[0] * e[1] + e[1] * e[2] + e[2] * e[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(min: i64, max: i64, left: u32, right: u32) -> TopNode2 {
        TopNode2 { min: [min; 3], max: [max; 3], left, right }
    }

    /// Four leaves under a balanced tree.
    fn top() -> Vec<TopNode2> {
        vec![
            node(0, 80, 1, 2),
            node(0, 40, 3, 4),
            node(40, 80, 5, 6),
            node(0, 20, 0, NONE),
            node(20, 40, 1, NONE),
            node(40, 60, 2, NONE),
            node(60, 80, 3, NONE),
        ]
    }

    fn assert_partition(tree: &PairTree, top: &[TopNode2]) {
        assert_eq!(tree.partition_defect(top, 4), None, "each (ray, leaf) in exactly one leaf pair");
    }

    #[test]
    fn splits_and_pull_ups_keep_the_partition() {
        let top = top();
        let (width, height) = (37, 21);
        let mut tree = PairTree::new(width, height, 8);
        assert_partition(&tree, &top);
        let mut random = 12345u32;
        let mut next = move || {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            random >> 8
        };
        for _ in 0..300 {
            let leaves = tree.leaves();
            let index = leaves[next() as usize % leaves.len()];
            if tree.is_terminal(index, &top) {
                tree.set_front(
                    index,
                    if next() % 2 == 0 { Front::Visible { requery: 0 } } else { Front::Invisible { since: 0 } },
                );
            } else {
                tree.split(index, &top, 0);
            }
            if next() % 8 == 0 {
                tree.pull_up();
            }
            assert_partition(&tree, &top);
        }
    }

    #[test]
    #[should_panic(expected = "exactly one leaf pair")]
    fn a_lost_child_is_noticed() {
        let top = top();
        let mut tree = PairTree::new(16, 16, 8);
        let children = tree.split(0, &top, 0);
        tree.pairs[children[0] as usize].node = 3;
        assert_partition(&tree, &top);
    }

    #[test]
    fn everything_invisible_collapses_one_level_at_a_time() {
        let top = top();
        let mut tree = PairTree::new(16, 16, 8);
        let children = tree.split(0, &top, 0);
        tree.split(children[0], &top, 0);
        assert_eq!(tree.pull_up(), 1);
        assert_eq!(tree.pull_up(), 1);
        assert_eq!(tree.leaves(), [0]);
        assert_eq!(tree.pull_up(), 0);
    }
}
