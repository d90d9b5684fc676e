//! The scene as one tree of boxes in f32, with the vertices of triangles side by side: what rays walk faster than
//! bricks, where there is room for all of it.
//!
//! A ray is brought into one frame, not into that of each brick; nothing is decoded and no index is looked up. The tree
//! is that of the bricks, and its triangles are decided in f64 by the same numbers, so hits are the same. It takes two
//! to three times the bytes of bricks.

use super::aims::{Aims, Locals};
use super::space::{Boxes, Geometry, Placed, world};
use super::top::{self, Top};
use super::walk::{Branch, moved};
use super::{Queries, Watch};
use crate::kernels::opacity;
use crate::kernels::payloads::AttributeView;
use crate::kernels::simd::isa::Isa;
use crate::kernels::trace::node::UNIT;
use crate::stream::Item;
use anyhow::Result;
use bricks::{BRICK_WIDE, Leaf, Node, Resident, SURFACE_ROTATION_SHIFT};
use glam::DVec3;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

/// Units of distances by which boxes are grown. What is rounded of a ray and of distances to planes is 6 of them
/// together: two of the inverse, one each of the origin, of moving it, of products and of their sum. Bricks need more,
/// for rays are moved to where they enter one.
const GROWN: f32 = 16.0 * UNIT;

/// Scenes that lie farther from the world's origin, in their own extents, have no tree: f64 moves rays there from afar
/// by less than a unit of these.
const FARTHEST: f64 = (1u64 << 25) as f64;

/// By how much the boxes of a brick's triangles may grow in area, all together, for what f32 does not know.
const MOST_GROWN: f64 = 1.25;

/// As many triangles and nodes have numbers in trees ([`super::walk`]).
const MOST_TRIANGLES: u64 = 1 << 29;

/// As many rays for each triangle are to have come before the tree is made: about so many gain what making it takes.
const RAYS_PER_TRIANGLE: f64 = 0.5;

/// A node: the boxes of its children and what they are, side by side. It fills four lines of a processor's cache.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct FlatNode {
    /// Lower bounds by axes, and upper ones.
    bounds: [[[f32; 8]; 3]; 2],
    /// The numbers of the children.
    children: [u32; 8],
}

impl FlatNode {
    /// One without children: boxes that nothing meets.
    const EMPTY: Self = Self { bounds: [[[f32::INFINITY; 8]; 3], [[f32::NEG_INFINITY; 8]; 3]], children: [0; 8] };

    /// A node like `of`, whose children have these boxes: in the frame of the top level, rounded outward. What its
    /// children are is left open.
    fn new(of: &Node, top: &Top, boxes: &Boxes<8>) -> Self {
        let (mut node, [low, high]) = (Self::EMPTY, boxes.grown());
        for k in 0..3 {
            let in_frame = |x: f64| ((x - top.frame.origin[k]) * top.per_unit) as f32;
            for slot in (0..8).filter(|&slot| of.meta[slot] != 0) {
                node.bounds[0][k][slot] = in_frame(low[k][slot]).next_down();
                node.bounds[1][k][slot] = in_frame(high[k][slot]).next_up();
            }
        }
        node
    }
}

impl Branch for FlatNode {
    #[inline(always)]
    fn child(&self, slot: u32) -> Option<u32> {
        Some(self.children[slot as usize])
    }

    #[inline(always)]
    fn grid(&self, _: usize) -> (f32, f32) {
        (1.0, 0.0)
    }

    #[inline(always)]
    fn bounds<I: Isa>(&self, isa: I, axis: usize, is_upper: bool) -> I::Eight {
        isa.load_eight(&self.bounds[usize::from(is_upper)][axis])
    }
}

/// A triangle.
#[derive(Clone, Copy, Default)]
#[repr(C, align(16))]
pub(super) struct FlatTriangle {
    /// Its vertices in device units of the object, relative to the brick's origin.
    corners: [[f32; 3]; 3],
    /// The leaf of the top level in which it lies.
    leaf: u32,
    /// Global id.
    pub(super) id: u32,
    /// Stored vertex i is the source's (i + rotation) mod 3.
    pub(super) rotation: u32,
}

/// Where the triangles of a leaf lie.
#[derive(Clone, Copy)]
struct Place {
    origin: DVec3,
    unit: f64,
    /// As of [`Placed`].
    matrix: Option<[f64; 12]>,
}

/// The scene as one tree.
pub(super) struct Flat {
    /// Nodes, the root first.
    pub(super) nodes: Vec<FlatNode>,
    pub(super) triangles: Vec<FlatTriangle>,
    /// By leaves.
    places: Vec<Place>,
    /// No less than the magnitude of any coordinate of boxes.
    extent: f32,
}

/// A leaf that is filled in: where its nodes and triangles begin, and they.
struct Part<'a> {
    leaf: u32,
    first: [u32; 2],
    nodes: &'a mut [FlatNode],
    triangles: &'a mut [FlatTriangle],
}

/// Leaves brick by brick.
fn by_bricks(resident: &Resident) -> Vec<u32> {
    let mut leaves: Vec<u32> = (0..resident.leaves.len() as u32).collect();
    leaves.sort_by_key(|&leaf| resident.leaves[leaf as usize].brick);
    leaves
}

/// Nodes and triangles of a leaf.
fn counts(resident: &Resident, leaf: u32) -> [u64; 2] {
    let Leaf { brick, .. } = resident.leaves[leaf as usize];
    let brick = &resident.bricks[brick as usize];
    [brick.node_count, brick.triangle_count].map(u64::from)
}

/// Nodes and triangles of all leaves.
fn totals(resident: &Resident) -> [u64; 2] {
    let leaves = (0..resident.leaves.len() as u32).map(|leaf| counts(resident, leaf));
    leaves.fold([resident.top8.len() as u64, 0], |sum, own| [sum[0] + own[0], sum[1] + own[1]])
}

/// Bytes that the tree of a scene takes. `None`: it has none, for rays pass through some of its triangles, vertices
/// have too many bits, or there are too many.
pub(super) fn bytes(resident: &Resident) -> Option<u64> {
    let [nodes, triangles] = totals(resident);
    let is_wide = resident.bricks[..resident.exact_bricks()].iter().any(|brick| brick.flags & BRICK_WIDE != 0);
    let has_one = !is_wide && !opacity::is_needed(resident) && nodes.max(triangles) < MOST_TRIANGLES && triangles > 0;
    has_one.then_some(nodes * size_of::<FlatNode>() as u64 + triangles * size_of::<FlatTriangle>() as u64)
}

impl Flat {
    /// The tree of a scene for which [`bytes`] says how many it takes. `None`: bricks are much smaller than the scene,
    /// so that f32 does not tell their boxes apart in one frame.
    ///
    /// # Errors
    /// A damaged brick; what `watch` says.
    fn new(queries: &Queries, watch: &mut Watch) -> Result<Option<Self>> {
        let (resident, top) = (queries.scene.resident(), queries.top());
        let extent = top.reach();
        if top.far > FARTHEST * extent {
            return Ok(None);
        }
        let grown = 4.0 * f64::from(GROWN) * extent * top.per_unit;
        let [nodes, triangles] = totals(resident);
        let mut nodes = vec![FlatNode::EMPTY; nodes as usize];
        let mut triangles = vec![FlatTriangle::default(); triangles as usize];
        let leaves = by_bricks(resident);
        let mut roots = vec![0; leaves.len()];
        let mut places = vec![Place { origin: DVec3::ZERO, unit: 1.0, matrix: None }; leaves.len()];
        let (above, below) = nodes.split_at_mut(top.nodes.len());

        // Leaves come as bricks do, so that those of bricks that are at hand together lie together.
        let first = [above.len() as u32, 0];
        let mut left = Left { leaves: &leaves, nodes: &mut *below, triangles: &mut triangles, first };
        let all: Vec<Item> = (0..resident.exact_bricks() as u32).map(Item::geometry).collect();
        let is_told_apart = AtomicBool::new(true);
        queries.store.for_each(&all, |place, payloads| {
            let brick = |leaf: u32| resident.leaves[leaf as usize].brick as usize;
            let parts = left.take(resident, |leaf| brick(leaf) < place + payloads.len());
            for part in &parts {
                roots[part.leaf as usize] = part.first[0];
            }
            let fill = |mut part: Part| {
                let bytes = &payloads[brick(part.leaf) - place];
                let geometry = Geometry::new(resident, brick(part.leaf) as u32, bytes, &[]);
                let placed = Placed::new(resident, part.leaf, &geometry);
                is_told_apart.fetch_and(part.fill((top, grown), &placed), Ordering::Relaxed);
                let place = Place { origin: geometry.origin, unit: geometry.unit, matrix: placed.matrix.copied() };
                (part.leaf, place)
            };
            let placed: Vec<_> = queries.threads.install(|| parts.into_par_iter().map(fill).collect());
            for (leaf, place) in placed {
                places[leaf as usize] = place;
            }
            watch(0)
        })?;
        if !is_told_apart.into_inner() {
            return Ok(None);
        }
        for ((node, of), boxes) in above.iter_mut().zip(&top.nodes).zip(&top.boxes) {
            *node = FlatNode::new(of, top, boxes);
            for slot in 0..8 {
                if let Some(number) = of.child(slot) {
                    node.children[slot as usize] = match top::child(of, slot as usize) {
                        top::Child::Node(_) => number,
                        top::Child::Leaf(leaf) => roots[leaf as usize],
                    };
                }
            }
        }
        turn(queries, Left { leaves: &leaves, nodes: below, triangles: &mut triangles, first }, watch)?;
        let of_node = |node: &FlatNode| {
            let bounds = node.bounds.iter().flatten().flatten().filter(|x| x.is_finite());
            bounds.fold(0.0, |most: f32, x| most.max(x.abs()))
        };
        let extent = queries.threads.install(|| nodes.par_iter().map(of_node).reduce(|| 0.0, f32::max));
        Ok(Some(Self { nodes, triangles, places, extent }))
    }

    /// Rays in its frame.
    #[inline(always)]
    pub(super) fn locals<const N: usize>(&self, top: &Top, aims: &Aims<N>) -> Locals<N> {
        aims.locals_grown((top.frame.origin, self.extent), top.per_unit, (0.0, top.step), GROWN)
    }

    /// The vertices of a triangle as they are stored, world units: those of [`Placed::vertices`].
    #[inline(always)]
    pub(super) fn vertices(&self, triangle: u32) -> [DVec3; 3] {
        let FlatTriangle { corners: [a, b, c], leaf, .. } = self.triangles[triangle as usize];
        let Place { origin, unit, matrix } = &self.places[leaf as usize];
        let world =
            |[x, y, z]: [f32; 3]| world(matrix.as_ref(), *origin + DVec3::new(x.into(), y.into(), z.into()) * *unit);
        [world(a), world(b), world(c)]
    }

    /// Asks for the memory of what a number names.
    #[inline(always)]
    pub(super) fn fetch<I: Isa>(&self, isa: I, node: u32, triangles: Option<Range<u32>>) {
        match triangles {
            None => isa.prefetch(&self.nodes[node as usize]),
            Some(of) => {
                isa.prefetch(&self.triangles[of.start as usize]);
                isa.prefetch(&self.triangles[of.end as usize - 1]);
            }
        }
    }
}

/// What is not filled in yet.
struct Left<'a> {
    leaves: &'a [u32],
    nodes: &'a mut [FlatNode],
    triangles: &'a mut [FlatTriangle],
    /// The numbers of the first of them.
    first: [u32; 2],
}

impl<'a> Left<'a> {
    /// The parts of the next leaves, as long as `is_next` holds for them.
    fn take(&mut self, resident: &Resident, is_next: impl Fn(u32) -> bool) -> Vec<Part<'a>> {
        let mut parts = Vec::new();
        while let Some((&leaf, leaves)) = self.leaves.split_first()
            && is_next(leaf)
        {
            let [nodes, triangles] = counts(resident, leaf).map(|count| count as usize);
            let (own_nodes, next_nodes) = std::mem::take(&mut self.nodes).split_at_mut(nodes);
            let (own_triangles, next_triangles) = std::mem::take(&mut self.triangles).split_at_mut(triangles);
            parts.push(Part { leaf, first: self.first, nodes: own_nodes, triangles: own_triangles });
            *self = Left {
                leaves,
                nodes: next_nodes,
                triangles: next_triangles,
                first: [self.first[0] + nodes as u32, self.first[1] + triangles as u32],
            };
        }
        parts
    }
}

impl Part<'_> {
    /// Fills it in from a brick. Returns whether f32 tells its boxes apart, which are grown by so much.
    fn fill(&mut self, (top, grown): (&Top, f64), placed: &Placed) -> bool {
        let (view, pad) = (&placed.geometry.view, placed.pad());
        for (number, triangle) in self.triangles.iter_mut().enumerate() {
            *triangle = FlatTriangle {
                corners: view.corners(number as u32).map(|corner| corner.map(|x| x as f32)),
                leaf: self.leaf,
                id: placed.id(number as u32),
                rotation: 0,
            };
        }
        let (mut area, mut grown_area) = (0.0, 0.0);
        for (node, of) in self.nodes.iter_mut().zip(view.nodes) {
            *node = FlatNode::new(of, top, &placed.boxes(of, pad));
            for slot in 0..8 {
                let Some(number) = of.child(slot) else { continue };
                node.children[slot as usize] = moved(number, self.first[0], self.first[1]);
                let [low, high] = &node.bounds;
                let [x, y, z] = [0, 1, 2].map(|k| f64::from(high[k][slot as usize] - low[k][slot as usize]));
                area += x * y + y * z + z * x;
                let [x, y, z] = [x + grown, y + grown, z + grown];
                grown_area += x * y + y * z + z * x;
            }
        }
        grown_area <= MOST_GROWN * area
    }
}

/// Notes how the stored vertices of triangles are turned.
fn turn(queries: &Queries, mut left: Left, watch: &mut Watch) -> Result<()> {
    let resident = queries.scene.resident();
    let all: Vec<Item> = (0..resident.exact_bricks() as u32).map(Item::attributes).collect();
    queries.store.for_each(&all, |place, payloads| {
        let brick = |leaf: u32| resident.leaves[leaf as usize].brick as usize;
        let parts = left.take(resident, |leaf| brick(leaf) < place + payloads.len());
        queries.threads.install(|| {
            parts.into_par_iter().for_each(|part| {
                let brick = brick(part.leaf);
                let view = AttributeView::new(&resident.bricks[brick], &payloads[brick - place]);
                for (triangle, word) in part.triangles.iter_mut().zip(view.surfaces) {
                    triangle.rotation = word >> SURFACE_ROTATION_SHIFT;
                }
            });
        });
        watch(0)
    })
}

impl Queries {
    /// The scene as one tree, where there is one, and room for it, and rays enough have come; `rays` more come now.
    ///
    /// # Errors
    /// A damaged brick; what `watch` says.
    pub(super) fn flat(&self, rays: usize, watch: &mut Watch) -> Result<Option<&Flat>> {
        let Some(room) = self.flat_bytes else { return Ok(None) };
        let before = self.rays.fetch_add(rays as u64, Ordering::Relaxed);
        if let Some(made) = self.flat.get() {
            return Ok(made.as_ref());
        }
        let [_, triangles] = totals(self.scene.resident());
        if ((before + rays as u64) as f64) < RAYS_PER_TRIANGLE * triangles as f64 {
            return Ok(None);
        }
        let _one = self.making.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if self.flat.get().is_none() {
            let made = Flat::new(self, watch)?;
            self.store.note_beside(made.as_ref().map_or(0, |_| room));
            let _ = self.flat.set(made);
        }
        Ok(self.flat.get().and_then(Option::as_ref))
    }
}
