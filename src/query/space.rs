//! The scene in f64, where it lies: boxes of nodes, and triangles.
//!
//! Vertices are those of the file, on their lattice, placed by the f64 matrix of their instance and rounded once.
//! Boxes are grown by more than any rounding here, so that what misses a box meets nothing in it.

use super::near::{MARGIN, Near};
use super::room::{Child, Inner};
use super::walk::{extent, walk};
use crate::kernels::payloads::BrickView;
use crate::kernels::simd::isa::Isa;
use crate::kernels::trace::node::inner_before;
use crate::session::trace::Scaled;
use bricks::{Brick, INSTANCE_IDENTITY, INSTANCE_MIRRORED, Instance, Node, Resident};
use glam::DVec3;

/// Greatest inverse of a direction's component: times any coordinate it is finite.
const MOST_INVERSE: f64 = f64::from_bits((900 + 1023) << 52);

/// Axis-aligned boxes side by side, by axes, world units. What slots without a child have is nothing's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Boxes<const N: usize> {
    min: [[f64; N]; 3],
    max: [[f64; N]; 3],
    /// By how much all are grown: more than the roundings of what is computed from them, and of where they lie.
    pad: f64,
}

/// What asks whether it may meet what is in boxes.
pub(super) trait Meets {
    /// Which boxes it may meet, a bit each.
    fn meets<const N: usize>(&self, boxes: &Boxes<N>) -> u32;
}

impl<const N: usize> Boxes<N> {
    /// Boxes where their bounds say, but for roundings of those.
    pub(super) fn new(min: [[f64; N]; 3], max: [[f64; N]; 3]) -> Self {
        let reach = |axes: &[[f64; N]; 3]| axes.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
        let pad = MARGIN * reach(&min).max(reach(&max));
        Self { min, max, pad }
    }

    /// Their lower and upper bounds, grown.
    pub(super) fn grown(&self) -> [[[f64; N]; 3]; 2] {
        let axes = |of: &[[f64; N]; 3], pad: f64| of.map(|axis| axis.map(|x| x + pad));
        [axes(&self.min, -self.pad), axes(&self.max, self.pad)]
    }

    /// No more than the squared distance of `point` from anything in each box.
    #[inline(always)]
    pub(super) fn distances_squared(&self, point: DVec3) -> [f64; N] {
        let pad = self.pad.max(MARGIN * point.abs().max_element());
        let mut sums = [0.0; N];
        for k in 0..3 {
            for (sum, (min, max)) in sums.iter_mut().zip(self.min[k].iter().zip(&self.max[k])) {
                let gap = (min - pad - point[k]).max(point[k] - max - pad).max(0.0);
                *sum += gap * gap;
            }
        }
        sums.map(|sum| sum * (1.0 - MARGIN))
    }
}

/// A half-line from a point along x.
#[derive(Clone, Copy, Debug)]
pub(super) struct AlongX(pub(super) DVec3);

impl Meets for AlongX {
    #[inline(always)]
    fn meets<const N: usize>(&self, boxes: &Boxes<N>) -> u32 {
        let p = self.0;
        let pad = boxes.pad.max(MARGIN * p.abs().max_element());
        (0..N).fold(0, |mask, i| {
            let is_within = |k: usize| p[k] >= boxes.min[k][i] - pad && p[k] <= boxes.max[k][i] + pad;
            mask | u32::from(p.x <= boxes.max[0][i] + pad && is_within(1) && is_within(2)) << i
        })
    }
}

/// A ray, as box tests take it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slabs {
    origin: DVec3,
    /// Of the direction, times a power of two that makes its greatest component 1 to 2.
    inverse: DVec3,
    /// In lengths of that.
    t_min: f64,
    t_max: f64,
    pad: f64,
}

impl Slabs {
    pub(super) fn new(origin: [f64; 3], direction: [f64; 3], t_min: f64, t_max: f64) -> Self {
        let scaled = Scaled::of(direction);
        let inverse = (1.0 / scaled.direction).clamp(DVec3::splat(-MOST_INVERSE), DVec3::splat(MOST_INVERSE));
        let [t_min, t_max] = [t_min, t_max].map(|t| scaled.scaled(t));
        let origin = DVec3::from_array(origin);
        Self { origin, inverse, t_min, t_max, pad: MARGIN * origin.abs().max_element() }
    }
}

impl Meets for Slabs {
    #[inline(always)]
    fn meets<const N: usize>(&self, boxes: &Boxes<N>) -> u32 {
        let pad = boxes.pad.max(self.pad);
        let (mut near, mut far) = ([self.t_min; N], [self.t_max; N]);
        for k in 0..3 {
            let (o, inverse) = (self.origin[k], self.inverse[k]);
            let (first, last) =
                if inverse < 0.0 { (&boxes.max[k], &boxes.min[k]) } else { (&boxes.min[k], &boxes.max[k]) };
            let pad = if inverse < 0.0 { -pad } else { pad };
            for i in 0..N {
                near[i] = near[i].max((first[i] - pad - o) * inverse);
                far[i] = far[i].min((last[i] + pad - o) * inverse);
            }
        }
        (0..N).fold(0, |mask, i| mask | u32::from(near[i] <= far[i]) << i)
    }
}

/// The geometry of a brick.
pub(super) struct Geometry<'a> {
    pub(super) view: BrickView<'a>,
    /// In its object's units.
    pub(super) origin: DVec3,
    /// Object units of a device unit.
    pub(super) unit: f64,
    /// Device units of an object unit.
    pub(super) per_unit: f64,
    /// Object units of a step of the lattice.
    pub(super) step: f64,
    /// Greatest magnitude of a component of its origin.
    pub(super) reach: f64,
    /// Its greatest coordinates, in its object's units.
    far: DVec3,
    /// The greatest of its boxes, in device units.
    pub(super) extent: f32,
}

impl<'a> Geometry<'a> {
    /// Of a brick whose geometry is `bytes`; `opacity` as of [`BrickView::new`].
    pub(super) fn new(resident: &Resident, brick: u32, bytes: &'a [u8], opacity: &'a [[u32; 4]]) -> Self {
        let brick: &Brick = &resident.bricks[brick as usize];
        let object = &resident.objects[brick.object as usize];
        let [step, unit] = [object.step_log2, object.unit_log2].map(|log2| f64::from(log2).exp2());
        let far = |k: usize| (brick.min[k].unsigned_abs().max(brick.max[k].unsigned_abs())) as f64 * step;
        let origin = DVec3::from_array(brick.origin.map(|x| x as f64)) * step;
        let view = BrickView::new(brick, bytes, opacity);
        Self {
            extent: extent(view.nodes),
            view,
            origin,
            unit,
            per_unit: 1.0 / unit,
            step,
            reach: origin.abs().max_element(),
            far: DVec3::new(far(0), far(1), far(2)),
        }
    }
}

/// A point of an object in the world: where a matrix, if there is one, has it.
#[inline(always)]
pub(super) fn world(matrix: Option<&[f64; 12]>, p: DVec3) -> DVec3 {
    let Some(m) = matrix else { return p };
    DVec3::new(
        m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3],
        m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
        m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11],
    )
}

/// A brick where an instance has it.
pub(super) struct Placed<'a> {
    pub(super) geometry: &'a Geometry<'a>,
    /// Global id of the instance's triangle 0.
    base: u32,
    /// `None`: the world's own.
    pub(super) matrix: Option<&'a [f64; 12]>,
    /// -1 where the instance is a mirror image, else 1.
    pub(super) handedness: i32,
}

impl<'a> Placed<'a> {
    /// A leaf of the top level, of whose brick `geometry` is.
    #[inline(always)]
    pub(super) fn new(resident: &'a Resident, leaf: u32, geometry: &'a Geometry<'a>) -> Self {
        let instance: &Instance = &resident.instances[resident.leaves[leaf as usize].instance as usize];
        let matrix = (instance.flags & INSTANCE_IDENTITY == 0).then_some(&instance.world_from_object);
        let handedness = if instance.flags & INSTANCE_MIRRORED != 0 { -1 } else { 1 };
        Self { geometry, base: instance.base, matrix, handedness }
    }

    /// By how much its boxes are grown.
    #[inline(always)]
    pub(super) fn pad(&self) -> f64 {
        let far = self.geometry.far;
        let Some(m) = self.matrix else { return MARGIN * far.max_element() };
        // What the rows of a matrix add up is rounded by its terms, not by their sum.
        let terms = |k: usize| {
            (m[4 * k] * far.x).abs() + (m[4 * k + 1] * far.y).abs() + (m[4 * k + 2] * far.z).abs() + m[4 * k + 3].abs()
        };
        MARGIN * terms(0).max(terms(1)).max(terms(2))
    }

    /// The global id of a triangle.
    #[inline(always)]
    pub(super) fn id(&self, triangle: u32) -> u32 {
        self.base.wrapping_add(self.geometry.view.ids[triangle as usize])
    }

    /// The vertices of a triangle as they are stored, world units. Triangles of an instance that share a vertex have
    /// the same numbers for it, whatever brick they lie in.
    #[inline(always)]
    pub(super) fn vertices(&self, triangle: u32) -> [DVec3; 3] {
        let &Geometry { origin, unit, ref view, .. } = self.geometry;
        let [a, b, c] = view.corners(triangle);
        let [a, b, c] = [DVec3::from_array(a), DVec3::from_array(b), DVec3::from_array(c)];
        let world = |p: DVec3| world(self.matrix, origin + p * unit);
        [world(a), world(b), world(c)]
    }

    /// The world's boxes of what the children of a node hold.
    #[inline(always)]
    pub(super) fn boxes(&self, node: &Node, pad: f64) -> Boxes<8> {
        let &Geometry { origin: from, unit, .. } = self.geometry;
        let scale = |k: usize| f64::from_bits((u64::from(node.exponent[k]) + 1023 - 127) << 52) * unit;
        let grid = |bounds: &[[u8; 8]; 3]| -> [[f64; 8]; 3] {
            std::array::from_fn(|k| {
                let (origin, scale) = (from[k] + f64::from(node.origin[k]) * unit, scale(k));
                bounds[k].map(|q| origin + f64::from(q) * scale)
            })
        };
        let (min, max) = (grid(&node.lo), grid(&node.hi));
        let Some(m) = self.matrix else { return Boxes { min, max, pad } };
        let mut own = Boxes { min, max, pad };
        for k in 0..3 {
            let row = [m[4 * k], m[4 * k + 1], m[4 * k + 2]];
            for i in 0..8 {
                let (mut low, mut high) = (m[4 * k + 3], m[4 * k + 3]);
                for (j, r) in row.into_iter().enumerate() {
                    let (a, b) = (r * min[j][i], r * max[j][i]);
                    (low, high) = (low + a.min(b), high + a.max(b));
                }
                (own.min[k][i], own.max[k][i]) = (low, high);
            }
        }
        own
    }

    /// Calls `visit` for every triangle of leaves whose boxes, and those above them, `what` may meet; false ends it.
    /// `open` is room to work in.
    #[inline(always)]
    pub(super) fn walk(&self, what: &impl Meets, open: &mut Vec<u32>, mut visit: impl FnMut(u32) -> bool) {
        let pad = self.pad();
        open.clear();
        open.push(0);
        while let Some(index) = open.pop() {
            let node = &self.geometry.view.nodes[index as usize];
            let mut met = what.meets(&self.boxes(node, pad)) & children(node);
            while met != 0 {
                let slot = met.trailing_zeros() as usize;
                met &= met - 1;
                match child(node, slot) {
                    Child::Node(index) => open.push(index),
                    Child::Triangles(first, count) => {
                        if !(first..first + count).all(&mut visit) {
                            return;
                        }
                    }
                }
            }
        }
    }

    /// Calls `visit` for the triangles of leaves no farther from `point` than `within`, and than `visit` last said,
    /// squared, about the nearest first.
    #[inline(always)]
    pub(super) fn walk_near<I: Isa>(
        &self,
        isa: I,
        point: DVec3,
        mut within: f64,
        room: &mut Inner,
        mut visit: impl FnMut(u32) -> f64,
    ) {
        let far = self.geometry.far.max_element();
        let near = self
            .matrix
            .is_none()
            .then(|| Near::new(point, self.geometry.origin, self.geometry.per_unit, (self.geometry.extent, far)));
        let Some(near) = near.flatten() else { return self.walk_near_wide(point, within, &mut room.near, visit) };
        let mut limit = near.limit(within);
        walk(
            isa,
            self.geometry.view.nodes,
            &near,
            limit,
            &mut room.open,
            #[inline(always)]
            |triangles, _| {
                for triangle in triangles {
                    let now = visit(triangle);
                    if now < within {
                        (within, limit) = (now, near.limit(now));
                    }
                }
                Some(limit)
            },
        );
    }

    /// [`Self::walk_near`] where boxes are asked in f64: those of instances, and from afar. `open` is room to work in.
    #[cold]
    fn walk_near_wide(
        &self,
        point: DVec3,
        mut within: f64,
        open: &mut Vec<(f64, Child)>,
        mut visit: impl FnMut(u32) -> f64,
    ) {
        let pad = self.pad();
        open.clear();
        open.push((0.0, Child::Node(0)));
        while let Some((distance, next)) = open.pop() {
            if distance > within {
                continue;
            }
            let index = match next {
                Child::Node(index) => index,
                Child::Triangles(first, count) => {
                    for triangle in first..first + count {
                        within = visit(triangle).min(within);
                    }
                    continue;
                }
            };
            let node = &self.geometry.view.nodes[index as usize];
            let before = open.len();
            let distances = self.boxes(node, pad).distances_squared(point);
            let mut left = children(node);
            while left != 0 {
                let slot = left.trailing_zeros() as usize;
                left &= left - 1;
                if distances[slot] <= within {
                    open.push((distances[slot], child(node, slot)));
                }
            }
            // The nearest on top.
            open[before..].sort_unstable_by(|a, b| b.0.total_cmp(&a.0));
        }
    }
}

/// The slots of a node that have a child, a bit each.
#[inline(always)]
pub(super) fn children(node: &Node) -> u32 {
    (0..8).fold(0, |mask, slot| mask | u32::from(node.meta[slot] != 0) << slot)
}

#[inline(always)]
fn child(node: &Node, slot: usize) -> Child {
    if node.inner_mask & 1 << slot != 0 {
        return Child::Node(node.child_base + inner_before(u32::from(node.inner_mask), slot as u32));
    }
    let what = u32::from(node.meta[slot]);
    Child::Triangles(node.triangle_base + (what & 31), (what >> 5).count_ones())
}
