//! Instances placed anew in an open scene: their matrices, and the top-level trees fitted to the boxes of their bricks.
//!
//! Boxes are those that a conversion with the same matrices finds, bit for bit; the trees keep their topology, which
//! was chosen for other places and may cost rays time.

use crate::records::{INSTANCE_MIRRORED, Instance, Leaf, NODE_WIDTH, TOP_LEAF, TopNode2, TopNode8};
use crate::resident::Resident;

/// Unit roundoff of f64.
const UNIT: f64 = f64::EPSILON / 2.0;

/// Largest coordinate of a grid.
const GRID_END: i64 = 255;

/// Largest magnitude of a coordinate of the top level, in steps of the world's lattice: offsets of bricks from the
/// reference point of any frame are exact (FORMAT.md, "Lattices").
pub const REACH_STEPS: i64 = 1 << 44;

/// log2 of the largest extent of the top level in device units, for which the range of every intermediate of the
/// triangle test is proved.
pub const EXTENT_UNITS_LOG2: i32 = 30;

/// Least and greatest coordinates, lattice steps.
pub type Bounds = [[i64; 3]; 2];

/// Why an instance cannot be placed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlaceError {
    /// There is no such instance, or it is the world itself.
    #[error("instance {instance} cannot be moved; give one from 1 to {last}")]
    Instance {
        /// What was named.
        instance: u32,
        /// The last instance.
        last: u32,
    },
    /// A matrix that rays cannot be taken through.
    #[error("instance {instance}: its matrix {matrix:?} is not finite or has no inverse")]
    Matrix {
        /// The instance.
        instance: u32,
        /// What was given.
        matrix: [f64; 12],
    },
    /// A place beyond the range of the arithmetic.
    #[error(
        "instance {instance} would be {reach:e} away, from the origin or from other parts; {limit:e} can be held, \
         keep it nearer to the scene"
    )]
    Range {
        /// The instance.
        instance: u32,
        /// Largest coordinate or extent, world units.
        reach: f64,
        /// Largest one that is possible, world units.
        limit: f64,
    },
}

/// 2^e, exactly; |e| is at most 1022.
fn pow2(e: i32) -> f64 {
    f64::from_bits(((e + 1023) as u64) << 52)
}

/// A box that contains the images of all points of a box through a row-major 3x4 matrix, rounding errors included.
pub fn image_bounds(m: &[f64; 12], min: [f64; 3], max: [f64; 3]) -> ([f64; 3], [f64; 3]) {
    let mut out = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        let (mut low, mut high, mut size) = (m[4 * k + 3], m[4 * k + 3], m[4 * k + 3].abs());
        for j in 0..3 {
            let (a, b) = (m[4 * k + j] * min[j], m[4 * k + j] * max[j]);
            low += a.min(b);
            high += a.max(b);
            size += a.abs().max(b.abs());
        }
        // Three products and three sums: at most 4 roundings on any term, and as many in the point itself.
        let margin = 16.0 * UNIT * size;
        out.0[k] = low - margin;
        out.1[k] = high + margin;
    }
    out
}

/// The box of a brick of an instance in steps of the world's lattice, outward: that of the image of the brick's box
/// `own`, in steps of its object's lattice. Steps are given by their log2 in the units of object and world.
pub fn world_box(own: Bounds, object_step_log2: i32, matrix: &[f64; 12], world_step_log2: i32) -> Bounds {
    let [min, max] = own.map(|corner| corner.map(|x| x as f64 * pow2(object_step_log2)));
    let (min, max) = image_bounds(matrix, min, max);
    let steps = |x: f64| x * pow2(-world_step_log2);
    // Scaling by a power of two is exact. Casts saturate.
    [min.map(|x| steps(x).floor() as i64), max.map(|x| steps(x).ceil() as i64)]
}

/// The bounds of two bounds.
fn union(a: Bounds, b: Bounds) -> Bounds {
    [std::array::from_fn(|k| a[0][k].min(b[0][k])), std::array::from_fn(|k| a[1][k].max(b[1][k]))]
}

/// Boxes of children on the grid of a wide node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// log2 of the grid step in lattice steps.
    pub exponent: [u8; 3],
    /// Lower bounds in grid steps.
    pub lo: [[u8; NODE_WIDTH]; 3],
    /// Upper bounds in grid steps.
    pub hi: [[u8; NODE_WIDTH]; 3],
}

impl Grid {
    /// On the finest grids with steps of powers of two from `origin`, which is at most any child's least corner, to
    /// `end`, which is at least any child's greatest one. Outward. Absent children are inverted, so that they are
    /// neutral to unions and entered by no ray.
    pub fn over(children: &[Option<Bounds>; NODE_WIDTH], origin: [i64; 3], end: [i64; 3]) -> Self {
        let mut grid = Self { exponent: [0; 3], lo: [[GRID_END as u8; NODE_WIDTH]; 3], hi: [[0; NODE_WIDTH]; 3] };
        for k in 0..3 {
            let mut exponent = 0;
            while ceil_shift(end[k] - origin[k], exponent) > GRID_END {
                exponent += 1;
            }
            grid.exponent[k] = exponent;
            for (slot, child) in children.iter().enumerate() {
                if let Some([min, max]) = child {
                    grid.lo[k][slot] = ((min[k] - origin[k]) >> exponent) as u8;
                    grid.hi[k][slot] = ceil_shift(max[k] - origin[k], exponent) as u8;
                }
            }
        }
        grid
    }
}

/// ⌈x / 2^exponent⌉ for x ≥ 0.
pub fn ceil_shift(x: i64, exponent: u8) -> i64 {
    (x + ((1 << exponent) - 1)) >> exponent
}

impl Resident {
    /// The bounds of a leaf of the top level, steps of the world's lattice.
    pub fn leaf_box(&self, leaf: &Leaf) -> Bounds {
        let (instance, brick) = (&self.instances[leaf.instance as usize], self.existing_brick(leaf.brick));
        let own = [brick.min, brick.max];
        match leaf.instance {
            0 => own,
            _ => {
                let step_log2 = self.objects[instance.object as usize].step_log2;
                world_box(own, step_log2, &instance.world_from_object, self.objects[0].step_log2)
            }
        }
    }

    /// Places instances by new matrices, world_from_object, row-major 3x4, and fits the top-level trees, those over
    /// levels too, and the scene's bounds to them. All else stays as it is: levels of the world that stand for bricks
    /// of moved instances show them where they were. After an error nothing has changed.
    ///
    /// # Errors
    /// An instance that does not exist or is the world, a matrix without an inverse, a place that is too far out.
    pub fn place(&mut self, places: &[(u32, [f64; 12])]) -> Result<(), PlaceError> {
        let last = self.instances.len().saturating_sub(1) as u32;
        let mut placed: Vec<(u32, Instance)> = Vec::with_capacity(places.len());
        for &(instance, world_from_object) in places {
            if instance == 0 || instance > last {
                return Err(PlaceError::Instance { instance, last });
            }
            let mut record = Instance { world_from_object, ..self.instances[instance as usize] };
            let determinant = record.determinant();
            let is_sound = world_from_object.iter().all(|x| x.is_finite()) && determinant.is_normal();
            if !is_sound {
                return Err(PlaceError::Matrix { instance, matrix: world_from_object });
            }
            record.flags = if determinant < 0.0 { INSTANCE_MIRRORED } else { 0 };
            self.check_range(instance, &record)?;
            placed.push((instance, record));
        }
        let mut has_moved = vec![false; self.instances.len()];
        for (instance, record) in &mut placed {
            std::mem::swap(&mut self.instances[*instance as usize], record);
            has_moved[*instance as usize] |=
                self.instances[*instance as usize].world_from_object != record.world_from_object;
        }
        if !has_moved.contains(&true) {
            return Ok(());
        }
        self.leave_levels_of(&has_moved);
        self.refit(&has_moved);
        let world = &self.objects[0];
        let limit = EXTENT_UNITS_LOG2 - (world.step_log2 - world.unit_log2);
        let extent = |root: &TopNode2| (0..3).map(|k| root.max[k] - root.min[k]).max().unwrap_or(0);
        let extent = self.top2.first().map_or(0, extent);
        if extent as f64 > pow2(limit)
            && let Some(&(instance, _)) = placed.last()
        {
            let step = pow2(world.step_log2);
            let error = PlaceError::Range { instance, reach: extent as f64 * step, limit: pow2(limit) * step };
            for (instance, record) in placed.into_iter().rev() {
                self.instances[instance as usize] = record;
            }
            self.refit(&has_moved);
            return Err(error);
        }
        Ok(())
    }

    /// Refuses an instance whose bricks would lie beyond what the lattice holds.
    fn check_range(&self, instance: u32, record: &Instance) -> Result<(), PlaceError> {
        let (object, world) = (&self.objects[record.object as usize], &self.objects[0]);
        let first = object.first_brick as usize;
        let bricks = &self.bricks[first..first + object.brick_count as usize];
        for brick in bricks {
            let corners =
                world_box([brick.min, brick.max], object.step_log2, &record.world_from_object, world.step_log2);
            let reach = corners.as_flattened().iter().map(|x| x.unsigned_abs()).max().unwrap_or(0);
            if reach > REACH_STEPS as u64 {
                let step = pow2(world.step_log2);
                return Err(PlaceError::Range {
                    instance,
                    reach: reach as f64 * step,
                    limit: REACH_STEPS as f64 * step,
                });
            }
        }
        Ok(())
    }

    /// Fits the trees to the instances, of which those that have moved are marked.
    fn refit(&mut self, has_moved: &[bool]) {
        use std::mem::take;
        let (mut top2, mut top8) = (take(&mut self.top2), take(&mut self.top8));
        self.fit(has_moved, &self.leaves, &mut top2, &mut top8);
        (self.top2, self.top8) = (top2, top8);
        let (mut top2, mut top8) = (take(&mut self.level_top2), take(&mut self.level_top8));
        self.fit(has_moved, &self.level_leaves, &mut top2, &mut top8);
        (self.level_top2, self.level_top8) = (top2, top8);
        if let Some(root) = self.top2.first() {
            let step = pow2(self.objects[0].step_log2);
            let corner = |p: [i64; 3]| p.map(|x| x as f64 * step);
            (self.manifest.min, self.manifest.max) = (corner(root.min), corner(root.max));
        }
    }

    /// Fits two trees over `leaves` to the instances, of which those that have moved are marked.
    fn fit(&self, has_moved: &[bool], leaves: &[Leaf], top2: &mut [TopNode2], top8: &mut [TopNode8]) {
        let mut boxes = vec![[[0; 3]; 2]; leaves.len()];
        // Children follow their parent.
        for index in (0..top2.len()).rev() {
            let node = top2[index];
            let [min, max] = if node.right == TOP_LEAF {
                let leaf = &leaves[node.left as usize];
                let own = if has_moved[leaf.instance as usize] { self.leaf_box(leaf) } else { [node.min, node.max] };
                boxes[node.left as usize] = own;
                own
            } else {
                let [left, right] = [node.left, node.right].map(|child| &top2[child as usize]);
                union([left.min, left.max], [right.min, right.max])
            };
            let node = &mut top2[index];
            (node.min, node.max) = (min, max);
        }
        let mut bounds = vec![[[0; 3]; 2]; top8.len()];
        for index in (0..top8.len()).rev() {
            let children = child_boxes(&top8[index], &bounds, &boxes);
            let mut all = children.iter().flatten().copied();
            // A node has a child.
            let Some(first) = all.next() else { continue };
            let [min, max] = all.fold(first, union);
            bounds[index] = [min, max];
            let Grid { exponent, lo, hi } = Grid::over(&children, min, max);
            let node = &mut top8[index];
            (node.origin, node.exponent, node.lo, node.hi) = (min, exponent, lo, hi);
        }
    }
}

/// The boxes of a wide node's children, by slots, from those of all nodes and leaves.
fn child_boxes(node: &TopNode8, nodes: &[Bounds], leaves: &[Bounds]) -> [Option<Bounds>; NODE_WIDTH] {
    let mut inner = node.child_base as usize;
    std::array::from_fn(|slot| match node.meta[slot] {
        0 => None,
        _ if node.inner_mask & 1 << slot != 0 => {
            inner += 1;
            Some(nodes[inner - 1])
        }
        meta => Some(leaves[(node.leaf_base + u32::from(meta & 31)) as usize]),
    })
}
