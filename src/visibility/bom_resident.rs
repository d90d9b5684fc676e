//! Base occupancy maps from what is always resident of bricks: the 16³ level of their occupancy, and the boxes of their roots' children.

use super::bom::{Bom, Cascades, extent};
use bricks::{Brick, INSTANCE_IDENTITY, Instance, Object, Occupancy, RESIDENT_LEVEL, Resident};
use glam::{DMat3, DVec3};

/// Cells of the resident level on each axis.
const CELLS: i64 = 16;
/// Most maps.
const MOST_LEVELS: i32 = 6;
/// Maps move with the camera by so many of their cells at a time.
const STRIDE: i64 = 8;
/// By how much of their size and place the boxes of turned cells grow, for roundings.
const MARGIN: f64 = 1e-9;
/// By how much of their place the boxes of children grow, for the rounding of a sum.
const SUM_ULPS: f64 = 2.0 * f64::EPSILON;

/// Maps of `cells` on each axis (a multiple of 32 from 32 to 256) around `camera`, a point of the world. The coarsest holds the scene. The
/// finest has cells as large as those of half of the bricks; finer ones would repeat cells. No maps of a scene without proxies or triangles.
pub fn assemble(resident: &Resident, camera: DVec3, cells: u32) -> Cascades {
    let mut sizes: Vec<i32> = resident
        .leaves
        .iter()
        .filter_map(|leaf| {
            let instance = &resident.instances[leaf.instance as usize];
            let scale = instance.determinant().abs().cbrt().log2().ceil();
            Some(resident.occupancy.get(leaf.brick as usize)?.cell_log2 + RESIDENT_LEVEL as i32 + scale as i32)
        })
        .collect();
    if sizes.is_empty() {
        return Cascades::default();
    }
    let half = sizes.len() / 2;
    let finest = *sizes.select_nth_unstable(half).1;
    // From the middle of a map to its nearest side, when the camera is at the end of a stride.
    let least_reach = i64::from(cells / 2) - STRIDE;
    let coarsest = (reach(resident, camera) / least_reach as f64).log2().ceil().max(f64::from(finest)) as i32;
    let finest = finest.max(coarsest + 1 - MOST_LEVELS);
    let mut levels: Vec<Bom> = (finest..=coarsest).map(|log2| empty(camera, cells, log2)).collect();
    for leaf in &resident.leaves {
        let instance = &resident.instances[leaf.instance as usize];
        let (object, brick) = (&resident.objects[instance.object as usize], &resident.bricks[leaf.brick as usize]);
        for level in &mut levels {
            enter(level, object, brick, instance, &resident.occupancy[leaf.brick as usize]);
        }
    }
    Cascades { levels }
}

/// From the camera to the furthest side of the scene's bounds.
fn reach(resident: &Resident, camera: DVec3) -> f64 {
    let step = f64::from(resident.objects[0].step_log2).exp2();
    let Some(root) = resident.top2.first() else { return 0.0 };
    let far = |k: usize| [root.min[k], root.max[k]].map(|x| (x as f64 * step - camera[k]).abs());
    // Flat scenes have an extent, too.
    (0..3).flat_map(far).fold(extent(resident).max(step), f64::max)
}

fn empty(camera: DVec3, cells: u32, cell_log2: i32) -> Bom {
    let stride = f64::from(cell_log2).exp2() * STRIDE as f64;
    let first = |x: f64| (x / stride).round() as i64 * STRIDE - i64::from(cells / 2);
    Bom::new(cells, cell_log2, camera.to_array().map(first))
}

/// Boxes that hold the triangles of a brick, in units of its object: those of its root's children.
fn boxes(object: &Object, brick: &Brick) -> impl Iterator<Item = [DVec3; 2]> {
    let (unit, step) = (f64::from(object.unit_log2).exp2(), f64::from(object.step_log2).exp2());
    let root = brick.root;
    let origin = DVec3::from_array(brick.origin.map(|x| x as f64)) * step;
    (0..8).filter(move |&child| root.meta[child] != 0).map(move |child| {
        // Exact but for the sum, of numbers of unlike sizes.
        let side = |steps: &[[u8; 8]; 3], outward: f64| {
            let along = |k: usize| {
                let grid = f64::from(i32::from(root.exponent[k]) - 127).exp2();
                let x = origin[k] + (f64::from(root.origin[k]) + f64::from(steps[k][child]) * grid) * unit;
                x + outward * SUM_ULPS * x.abs()
            };
            DVec3::new(along(0), along(1), along(2))
        };
        [side(&root.lo, -1.0), side(&root.hi, 1.0)]
    })
}

/// Enters what a brick of `instance` occupies: its cells, as far as they lie in the boxes of its root's children, which are thin where it is
/// flat and its cells are not.
fn enter(bom: &mut Bom, object: &Object, brick: &Brick, instance: &Instance, record: &Occupancy) {
    let own = f64::from(record.cell_log2 + RESIDENT_LEVEL as i32).exp2();
    let first = DVec3::from_array(record.origin.map(|x| x as f64)) * f64::from(record.cell_log2).exp2();
    for of_child in boxes(object, brick) {
        if !overlaps(bom, placed(bom, instance, of_child, [false; 3])) {
            continue;
        }
        let [low, high] =
            of_child.map(|p| ((p - first) / own).floor().to_array().map(|x| (x as i64).clamp(0, CELLS - 1)));
        for (x, y, z) in (low[0]..=high[0])
            .flat_map(|x| (low[1]..=high[1]).flat_map(move |y| (low[2]..=high[2]).map(move |z| (x, y, z))))
        {
            let bit = (z + CELLS * (x + CELLS * y)) as usize;
            if record.bits[bit / 8] >> (bit % 8) & 1 == 0 {
                continue;
            }
            let low = first + own * DVec3::new(x as f64, y as f64, z as f64);
            let high = low + DVec3::splat(own);
            // Where the cell ends and not the box, what begins there belongs to the next cell.
            let is_open = [0, 1, 2].map(|k| high[k] <= of_child[1][k]);
            fill(bom, placed(bom, instance, [low.max(of_child[0]), high.min(of_child[1])], is_open));
        }
    }
}

/// First and last cell, from the world's origin, of those that a box of an object meets; where it is open it does not meet what begins at its
/// upper side.
fn placed(bom: &Bom, instance: &Instance, [low, high]: [DVec3; 2], is_open: [bool; 3]) -> [[i64; 3]; 2] {
    let side = f64::from(bom.cell_log2).exp2();
    if instance.flags & INSTANCE_IDENTITY != 0 {
        let first = low.to_array().map(|x| (x / side).floor() as i64);
        let last = |k: usize| {
            let x = high[k] / side;
            let last = if is_open[k] { x.ceil() as i64 - 1 } else { x.floor() as i64 };
            last.max(first[k])
        };
        return [first, [last(0), last(1), last(2)]];
    }
    let m = &instance.world_from_object;
    let linear = DMat3::from_cols_array(&[m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]]);
    let translation = DVec3::new(m[3], m[7], m[11]);
    let size = DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
    let middle = linear * ((low + high) / 2.0) + translation;
    let half = size * ((high - low) / 2.0);
    let half = half + (half + middle.abs() + translation.abs()) * MARGIN;
    [(middle - half) / side, (middle + half) / side].map(|p| p.floor().to_array().map(|x| x as i64))
}

/// The part of cells `low` to `high`, of the world's origin, that lies in the map, in its own cells.
fn clipped(bom: &Bom, [low, high]: [[i64; 3]; 2]) -> [[i64; 3]; 2] {
    let last = i64::from(bom.cells()) - 1;
    [
        std::array::from_fn(|k| (low[k] - bom.first[k]).max(0)),
        std::array::from_fn(|k| (high[k] - bom.first[k]).min(last)),
    ]
}

fn overlaps(bom: &Bom, bounds: [[i64; 3]; 2]) -> bool {
    let [low, high] = clipped(bom, bounds);
    (0..3).all(|k| low[k] <= high[k])
}

fn fill(bom: &mut Bom, bounds: [[i64; 3]; 2]) {
    let [low, high] = clipped(bom, bounds);
    for y in low[1]..=high[1] {
        for x in low[0]..=high[0] {
            for z in low[2]..=high[2] {
                bom.occupy([x, y, z].map(|x| x as u32));
            }
        }
    }
}
