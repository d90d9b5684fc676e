//! Where the maps of a frame lie.

use super::place::Place;
use super::{Bom, extent};
use bricks::{Resident, TOP_LEAF, TopNode2};

/// Corners of maps are multiples of this many of their cells, so that they seldom move, by whole cells.
const SNAP_CELLS: i64 = 8;

/// Most maps.
const MAX_LEVELS: u32 = 12;

/// log2 of the largest distance from the world's origin, in cells: positions within are exact to a 32nd of a cell in
/// f64.
const REACH_CELLS_LOG2: i32 = 48;

/// What maps are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Cells of each on each axis, a multiple of 32 up to 256; 128 by default.
    pub cells: u32,
    /// log2 of the side of the finest cells, world units. `None`, the default: the finest whose map reaches a brick
    /// with cells no larger. Either is raised where [`Self::levels`] would not hold the scene.
    pub finest_log2: Option<i32>,
    /// Most maps, 1 to 12, the default.
    pub levels: u32,
    /// A 64³ map is wanted where a cell is less than 2^this cells of the brick's 16³ level wide; 1 by default.
    pub detail_log2: i32,
    /// Bytes of 64³ maps held; 64 MiB by default.
    pub budget_bytes: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { cells: 128, finest_log2: None, levels: MAX_LEVELS, detail_log2: 1, budget_bytes: 64 << 20 }
    }
}

/// 2^e.
fn exp2(e: i32) -> f64 {
    f64::from(e).exp2()
}

/// The least e with `x` ≤ 2^e, for a positive x.
fn ceil_log2(x: f64) -> i32 {
    let e = x.log2().round() as i32;
    // The logarithm is off by less than 1/2.
    if x <= exp2(e - 1) {
        e - 1
    } else if x <= exp2(e) {
        e
    } else {
        e + 1
    }
}

/// The empty maps for a camera, world units, the finest first. The middle of all is the point of the scene's bounds
/// nearest to it.
pub(crate) fn maps(resident: &Resident, settings: &Settings, camera: [f64; 3]) -> Vec<Bom> {
    let Some(root) = resident.top2.first() else {
        let cell_log2 = settings.finest_log2.unwrap_or(resident.objects[0].unit_log2);
        return vec![Bom::new(settings.cells, cell_log2, [-i64::from(settings.cells / 2); 3])];
    };
    let step = exp2(resident.objects[0].step_log2);
    let bounds = [root.min, root.max].map(|corner| corner.map(|x| x as f64 * step));
    // Of a NaN the lower bound.
    let middle: [f64; 3] = std::array::from_fn(|k| camera[k].max(bounds[0][k]).min(bounds[1][k]));
    // From the middle, wherever in its grid of corners, a map reaches so far.
    let reached = f64::from(settings.cells / 2) - SNAP_CELLS as f64;
    let extent = extent(resident);
    let coarsest = if extent > 0.0 { ceil_log2(extent / reached) } else { i32::MIN };
    let farthest = bounds.as_flattened().iter().fold(0.0f64, |far, x| far.max(x.abs()));
    let held = coarsest.saturating_sub(settings.levels.clamp(1, MAX_LEVELS) as i32 - 1);
    let exact = if farthest > 0.0 { ceil_log2(farthest) - REACH_CELLS_LOG2 } else { i32::MIN };
    let finest = settings.finest_log2.unwrap_or_else(|| finest_near(resident, &middle, settings.cells));
    let finest = finest.max(held).max(exact);
    let level = |cell_log2: i32| {
        let first = middle.map(|x| {
            let cell = (x / exp2(cell_log2)).floor() as i64;
            (cell + SNAP_CELLS / 2).div_euclid(SNAP_CELLS) * SNAP_CELLS - i64::from(settings.cells / 2)
        });
        Bom::new(settings.cells, cell_log2, first)
    };
    (finest..=finest.max(coarsest)).map(level).collect()
}

/// log2 of the side of the finest cells with a map around `middle` that reaches a brick with cells no larger.
fn finest_near(resident: &Resident, middle: &[f64; 3], cells: u32) -> i32 {
    let step = exp2(resident.objects[0].step_log2);
    let distance = |node: &TopNode2| {
        let apart = |k: usize| (node.min[k] as f64 * step - middle[k]).max(middle[k] - node.max[k] as f64 * step);
        (0..3).map(apart).fold(0.0, f64::max)
    };
    let reaching = |distance: f64| if distance > 0.0 { ceil_log2(distance * 2.0 / f64::from(cells)) } else { i32::MIN };
    let mut finest = i32::MAX;
    let mut stack = vec![0];
    while let Some(index) = stack.pop() {
        let node: &TopNode2 = &resident.top2[index as usize];
        let reaches = reaching(distance(node));
        if reaches >= finest {
            continue;
        }
        if node.right == TOP_LEAF {
            let leaf = &resident.leaves[node.left as usize];
            let instance = &resident.instances[leaf.instance as usize];
            // Levels of detail have no maps; the bricks that they stand for do.
            if let Some(occupancy) = resident.occupancy.get(leaf.brick as usize) {
                finest = finest.min(Place::of(instance, occupancy).cell_log2().max(reaches));
            }
        } else {
            stack.extend([node.left, node.right]);
        }
    }
    finest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithms_are_rounded_up() {
        for e in [-1000, -30, -1, 0, 1, 2, 52, 300] {
            let x = exp2(e);
            assert_eq!([x.next_down(), x, x.next_up()].map(ceil_log2), [e, e, e + 1]);
            assert_eq!(ceil_log2(x * 1.5), e + 1);
        }
    }
}
