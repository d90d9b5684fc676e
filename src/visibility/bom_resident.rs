//! Base occupancy maps from what is always resident of bricks: the 16³ level of their occupancy.

use super::bom::{Bom, Cascades, extent};
use bricks::{INSTANCE_IDENTITY, Instance, Occupancy, RESIDENT_LEVEL, Resident};
use glam::{DMat3, DVec3};

/// Cells of the resident level on each axis.
const CELLS: i64 = 16;
/// Most maps.
const MOST_LEVELS: i32 = 6;
/// Maps move with the camera by so many of their cells at a time.
const STRIDE: i64 = 8;
/// By how much of their size and place the boxes of turned cells grow, for roundings.
const MARGIN: f64 = 1e-9;

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
        let (instance, record) =
            (&resident.instances[leaf.instance as usize], &resident.occupancy[leaf.brick as usize]);
        for level in &mut levels {
            enter(level, instance, record);
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

/// Enters what a brick of `instance` occupies.
fn enter(bom: &mut Bom, instance: &Instance, record: &Occupancy) {
    let cells = (0..CELLS).flat_map(|y| (0..CELLS).flat_map(move |x| (0..CELLS).map(move |z| [x, y, z])));
    let is_occupied = |&[x, y, z]: &[i64; 3]| {
        let bit = (z + CELLS * (x + CELLS * y)) as usize;
        record.bits[bit / 8] >> (bit % 8) & 1 != 0
    };
    // In cells of the finest level, from the object's origin.
    let bounds = |cell: [i64; 3], count: i64| -> [[i64; 3]; 2] {
        let first: [i64; 3] = std::array::from_fn(|k| record.origin[k] + (cell[k] << RESIDENT_LEVEL));
        [first, first.map(|x| x + (count << RESIDENT_LEVEL))]
    };
    if instance.flags & INSTANCE_IDENTITY != 0 {
        let shift = bom.cell_log2 - record.cell_log2;
        // A fine cell is cut into several of finer maps, or is a part of one.
        let first = |x: i64| if shift < 0 { x << -shift.max(-30) } else { x >> shift.min(63) };
        let last = |x: i64| if shift < 0 { first(x) - 1 } else { first(x - 1) };
        let placed = |[low, high]: [[i64; 3]; 2]| [low.map(first), high.map(last)];
        if overlaps(bom, placed(bounds([0; 3], CELLS))) {
            cells.filter(is_occupied).for_each(|cell| fill(bom, placed(bounds(cell, 1))));
        }
        return;
    }
    let m = &instance.world_from_object;
    let linear = DMat3::from_cols_array(&[m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]]);
    let translation = DVec3::new(m[3], m[7], m[11]);
    let size = DMat3::from_cols(linear.x_axis.abs(), linear.y_axis.abs(), linear.z_axis.abs());
    let fine = f64::from(record.cell_log2).exp2();
    let side = f64::from(bom.cell_log2).exp2();
    let placed = |[low, high]: [[i64; 3]; 2]| {
        let [low, high] = [low, high].map(|b| DVec3::from_array(b.map(|x| x as f64)) * fine);
        let middle = linear * ((low + high) / 2.0) + translation;
        let half = size * ((high - low) / 2.0);
        let half = half + (half + middle.abs() + translation.abs()) * MARGIN;
        [(middle - half) / side, (middle + half) / side].map(|p| p.floor().to_array().map(|x| x as i64))
    };
    if overlaps(bom, placed(bounds([0; 3], CELLS))) {
        cells.filter(is_occupied).for_each(|cell| fill(bom, placed(bounds(cell, 1))));
    }
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
