//! A plain binary BVH in f64, halved where items lie widest apart.

use super::ray::TruthRay;

/// Most triangles of a leaf.
const LEAF: usize = 4;
/// Relative margin of the slab test: many times the roundings of a subtraction, a product and a division.
const MARGIN: f64 = 64.0 * f64::EPSILON;

/// How far boxes are grown on all sides: by more, the farther they are.
///
/// The pad of a box is `per_reference` times its greatest distance from the ray's reference point, `per_origin` times
/// its greatest distance from the ray's origin, and `constant`, in world units. It never shrinks from a box to one
/// around it, so that what a tree prunes holds nothing within its pad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Padding {
    pub(super) per_reference: f64,
    pub(super) per_origin: f64,
    pub(super) constant: f64,
}

impl Padding {
    /// Boxes as they are.
    pub(super) const NONE: Padding = Padding { per_reference: 0.0, per_origin: 0.0, constant: 0.0 };

    /// The pad of a box for a ray.
    pub(super) fn of(&self, ray: &TruthRay, bounds: &Bounds) -> f64 {
        let (mut reference, mut origin) = (0.0, 0.0);
        for k in 0..3 {
            let (min, max) = (bounds.min[k] - ray.reference[k], bounds.max[k] - ray.reference[k]);
            reference += (min * min).max(max * max);
            let (min, max) = (min - ray.origin[k], max - ray.origin[k]);
            origin += (min * min).max(max * max);
        }
        self.per_reference * reference.sqrt() + self.per_origin * origin.sqrt() + self.constant
    }
}

/// An axis-aligned box, world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    pub(super) min: [f64; 3],
    pub(super) max: [f64; 3],
}

impl Bounds {
    pub(super) const EMPTY: Bounds = Bounds { min: [f64::INFINITY; 3], max: [f64::NEG_INFINITY; 3] };

    pub(super) fn of(points: &[[f64; 3]]) -> Self {
        points.iter().fold(Self::EMPTY, |b, &p| b.join(&Bounds { min: p, max: p }))
    }

    fn join(&self, other: &Self) -> Self {
        Self {
            min: std::array::from_fn(|k| self.min[k].min(other.min[k])),
            max: std::array::from_fn(|k| self.max[k].max(other.max[k])),
        }
    }

    fn center(&self) -> [f64; 3] {
        std::array::from_fn(|k| 0.5 * (self.min[k] + self.max[k]))
    }
}

/// A node: a leaf of `count` items from `first` in the order, or (`count` = 0) the children `first` and `first + 1`.
#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Bounds,
    first: u32,
    count: u32,
}

/// The tree, over items 0..n.
#[derive(Clone, Debug)]
pub(super) struct Bvh {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

impl Bvh {
    /// The tree over boxes; at most 2^31 of them.
    pub(super) fn build(bounds: &[Bounds]) -> Self {
        let mut order: Vec<u32> = (0..bounds.len() as u32).collect();
        let mut nodes = vec![Node { bounds: Bounds::EMPTY, first: 0, count: 0 }];
        let mut pending = vec![(0usize, 0usize, order.len())];
        while let Some((node, start, end)) = pending.pop() {
            let items = &mut order[start..end];
            let all = items.iter().fold(Bounds::EMPTY, |b, &i| b.join(&bounds[i as usize]));
            if items.len() <= LEAF {
                nodes[node] = Node { bounds: all, first: start as u32, count: items.len() as u32 };
                continue;
            }
            let middle = start + split(items, bounds);
            let first = nodes.len();
            nodes[node] = Node { bounds: all, first: first as u32, count: 0 };
            nodes.extend([nodes[node]; 2]);
            pending.extend([(first, start, middle), (first + 1, middle, end)]);
        }
        Self { nodes, order }
    }

    /// Calls `visit` for every item of a leaf whose box, grown by `padding`, the ray meets at some t in t_min..=limit,
    /// nearer nodes first; `visit` returns the limit from then on.
    pub(super) fn visit(&self, ray: &TruthRay, padding: Padding, mut limit: f64, mut visit: impl FnMut(u32) -> f64) {
        if self.order.is_empty() {
            return;
        }
        let slabs = Slabs { ray, padding };
        let mut stack = Vec::from_iter(slabs.entry(&self.nodes[0].bounds, limit).map(|entry| (0u32, entry)));
        while let Some((index, entry)) = stack.pop() {
            if entry > limit {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                for &item in &self.order[node.first as usize..][..node.count as usize] {
                    limit = visit(item);
                }
                continue;
            }
            let children = [node.first, node.first + 1];
            let entries = children.map(|child| slabs.entry(&self.nodes[child as usize].bounds, limit));
            let near = usize::from(entries[1].unwrap_or(f64::INFINITY) < entries[0].unwrap_or(f64::INFINITY));
            // The nearer one last, on top of the stack.
            for child in [1 - near, near] {
                stack.extend(entries[child].map(|entry| (children[child], entry)));
            }
        }
    }
}

/// Orders `items` so that those of the first half lie before the others on the axis where they are widest apart;
/// returns where that half ends.
fn split(items: &mut [u32], bounds: &[Bounds]) -> usize {
    let center = |i: u32| bounds[i as usize].center();
    let all = items.iter().fold(Bounds::EMPTY, |all, &i| all.join(&Bounds::of(&[center(i)])));
    let width = |k: usize| all.max[k] - all.min[k];
    let axis = (0..3).fold(0, |widest, k| if width(k) > width(widest) { k } else { widest });
    let middle = items.len() / 2;
    items.select_nth_unstable_by(middle, |&a, &b| center(a)[axis].total_cmp(&center(b)[axis]));
    middle
}

struct Slabs<'a> {
    ray: &'a TruthRay,
    padding: Padding,
}

impl Slabs<'_> {
    /// A lower bound of the t at which the ray enters the box; `None` if it misses it within t_min..=limit.
    fn entry(&self, bounds: &Bounds, limit: f64) -> Option<f64> {
        let ray = self.ray;
        let (mut near, mut far) = (ray.t_min, limit);
        let grown = self.padding.of(ray, bounds);
        for k in 0..3 {
            let (min, max) = (bounds.min[k] - ray.reference[k], bounds.max[k] - ray.reference[k]);
            let pad = grown + MARGIN * (min.abs().max(max.abs()) + ray.origin[k].abs());
            let (low, high) = (min - ray.origin[k] - pad, max - ray.origin[k] + pad);
            let d = ray.direction[k];
            if d == 0.0 {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            let (t0, t1) = (low / d, high / d);
            near = near.max(t0.min(t1) - MARGIN * t0.min(t1).abs());
            far = far.min(t0.max(t1) + MARGIN * t0.max(t1).abs());
        }
        (near <= far).then_some(near)
    }
}
