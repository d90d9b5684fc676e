//! Base and ray-aligned occupancy maps as kernels see them: placed in a frame.

use super::directions::{Drawn, draw};
use super::kernels::{BOMS, FAMILY, LEVELS, MAPS};
use super::{LIFT, RomaPass};
use crate::kernels::FrameExecutor;
use crate::kernels::frame::Frame;
use crate::kernels::layout::{Level, RomaMap};
use crate::schedule::ExecutorError;
use crate::secondary::occupancy::{Bom, Cascades, clearance, clearance_bytes};
use glam::{DMat3, DVec3};
use rayon::prelude::*;
use std::f64::consts::TAU;
use std::sync::Arc;

/// What is drawn for ROMA takes random numbers of its own.
const STREAM: u32 = 9 << 24;

/// The maps of an array, placed in a frame, and not filled yet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RomaMaps {
    /// Square root of the number of maps of a level.
    pub k: u32,
    /// Texels of a map on both axes, and cells of a column.
    pub size: u32,
    /// Cells of a base map on each axis.
    pub cells: u32,
    /// Look-ups of the base map a cell.
    pub samples: u32,
    /// Whether coarser base maps were left out, so that these do not hold the scene.
    pub is_part: bool,
    /// Base maps, the finest first.
    pub levels: Vec<Level>,
    /// Maps of the finest level, by their strata, then those of the next.
    pub maps: Vec<RomaMap>,
}

impl RomaMaps {
    /// Those of the finest `count` levels of `cascades` for `pass`, in directions drawn for sample `sample`.
    pub fn new(cascades: &Cascades, count: usize, frame: &Frame, pass: RomaPass, (sample, seed): (u32, u32)) -> Self {
        let grid = pass.grid;
        let cells = cascades.levels.first().map_or(0, Bom::cells);
        let drawn = draw(grid.k, sample.wrapping_add(STREAM), seed);
        let level = |bom: &Bom| {
            let side = f64::from(bom.cell_log2).exp2();
            let first = frame.origin / side - DVec3::from_array(bom.first.map(|x| x as f64));
            (first, frame.unit / side)
        };
        let scale = if cells == 0 { 0.0 } else { grid.scale(cells) };
        let levels: Vec<(DVec3, f64)> = cascades.levels.iter().take(count).map(level).collect();
        let record = |&(first, per_unit): &(DVec3, f64)| Level {
            first: first.as_vec3().to_array(),
            scale: per_unit as f32,
            lift: (LIFT / (scale * per_unit)) as f32,
            ..Level::default()
        };
        let middle = DVec3::splat(f64::from(cells) / 2.0);
        let map = |&(first, per_unit): &(DVec3, f64), drawn: &Drawn| {
            let axes = axes(drawn);
            let origin = DVec3::splat(f64::from(grid.size) / 2.0) + DVec3::from(drawn.shift.map(f64::from));
            // Rows of the turn; base = first + per_unit p, cell = scale axes (base - middle) + origin.
            let there = axes.transpose() * scale;
            let back = axes * (1.0 / scale);
            let (offset, back_offset) = (there * (first - middle) + origin, middle - back * origin);
            let rows = |m: DMat3, w: DVec3| std::array::from_fn(|k| m.row(k).extend(w[k]).as_vec4().to_array());
            RomaMap {
                cell_from_point: rows(there * per_unit, offset),
                base_from_cell: rows(back, back_offset),
                direction: axes.z_axis.extend(0.0).as_vec4().to_array(),
            }
        };
        let maps = levels.iter().flat_map(|level| drawn.iter().map(move |drawn| map(level, drawn))).collect();
        Self {
            k: grid.k,
            size: grid.size,
            cells,
            samples: grid.samples,
            is_part: levels.len() < cascades.levels.len(),
            levels: levels.iter().map(record).collect(),
            maps,
        }
    }

    /// Words of all columns.
    pub fn words(&self) -> u64 {
        self.maps.len() as u64 * u64::from(self.size * self.size) * u64::from(self.size / 32)
    }

    /// Gives an executor the base maps, unless it has them, and places these maps, which are made next.
    ///
    /// # Errors
    /// More than the device holds in one buffer, with how much it does.
    pub fn give(&self, executor: &mut dyn FrameExecutor, cascades: &Arc<Cascades>) -> Result<(), ExecutorError> {
        let clearances: Vec<Vec<u8>>;
        let held = executor.held(&FAMILY).as_ref().and_then(|held| held.downcast_ref::<Arc<Cascades>>());
        let is_held = held.is_some_and(|held| Arc::ptr_eq(held, cascades));
        let boms =
            cascades.levels.iter().map(|bom| bom.words().len() + clearance_bytes(bom.cells()) / 4).sum::<usize>();
        executor.reserve(&FAMILY, &[self.levels.len(), self.maps.len(), boms, self.words() as usize])?;
        if !is_held {
            clearances = cascades.levels.par_iter().map(clearance).collect();
            let mut at = 0;
            for (bom, clearance) in cascades.levels.iter().zip(&clearances) {
                for bytes in [bytemuck::cast_slice(bom.words()), clearance] {
                    executor.write(&FAMILY, BOMS, at, bytes);
                    at += bytes.len();
                }
            }
            *executor.held(&FAMILY) = Some(Box::new(cascades.clone()));
        }
        executor.write(&FAMILY, LEVELS, 0, bytemuck::cast_slice(&self.levels));
        executor.write(&FAMILY, MAPS, 0, bytemuck::cast_slice(&self.maps));
        Ok(())
    }
}

/// The axes of a map, z its direction, turned about it.
fn axes(drawn: &Drawn) -> DMat3 {
    let z = DVec3::from(drawn.direction.map(f64::from)).normalize();
    let (x, y) = z.any_orthonormal_pair();
    let (sin, cos) = (TAU * f64::from(drawn.turn)).sin_cos();
    DMat3::from_cols(cos * x + sin * y, cos * y - sin * x, z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::secondary::roma::{Grid, Role};

    fn pass(size: u32) -> RomaPass {
        RomaPass { grid: Grid { k: 4, size, samples: 2 }, steps: 0, role: Role::Answer }
    }

    fn apply(rows: &[[f32; 4]; 3], p: DVec3) -> DVec3 {
        let row = |r: &[f32; 4]| DVec3::new(r[0].into(), r[1].into(), r[2].into()).dot(p) + f64::from(r[3]);
        DVec3::new(row(&rows[0]), row(&rows[1]), row(&rows[2]))
    }

    #[test]
    fn maps_hold_their_base_map_and_lead_back_to_it() {
        let frame = Frame { reference: [0; 3], unit: 0.25, origin: DVec3::new(5.0, -3.0, 2.0) };
        for cells in [32u32, 64] {
            let cascades =
                Cascades { levels: vec![Bom::new(cells, -2, [-4, -20, 1]), Bom::new(cells, -1, [-10, -18, -7])] };
            for sample in 0..4 {
                let maps = RomaMaps::new(&cascades, 2, &frame, pass(64), (sample, 3));
                assert_eq!((maps.levels.len(), maps.maps.len()), (2, 32));
                for (i, map) in maps.maps.iter().enumerate() {
                    let level = &cascades.levels[i / 16];
                    let side = f64::from(level.cell_log2).exp2();
                    for corner in 0..8 {
                        let base = DVec3::from([0, 1, 2].map(|k| f64::from(corner >> k & 1) * f64::from(cells)));
                        let world = (base + DVec3::from(level.first.map(|x| x as f64))) * side;
                        let point = (world - frame.origin) / frame.unit;
                        let record = &maps.levels[i / 16];
                        let in_base = point * f64::from(record.scale) + DVec3::from(record.first.map(f64::from));
                        assert!(in_base.distance(base) < 1e-3);
                        let cell = apply(&map.cell_from_point, point);
                        assert!(cell.min_element() > -1e-3 && cell.max_element() < 64.001, "{cell}");
                        assert!(apply(&map.base_from_cell, cell).distance(base) < 1e-3);
                    }
                    // A cell further along a column is further in the map's direction.
                    let [at, further] = [0.0, 1.0].map(|z| apply(&map.base_from_cell, DVec3::new(3.0, 5.0, z)));
                    let direction =
                        DVec3::new(map.direction[0].into(), map.direction[1].into(), map.direction[2].into());
                    assert!((further - at).normalize().distance(direction) < 1e-5 && direction.z >= 0.0);
                }
            }
        }
        assert_eq!(RomaMaps::new(&Cascades::default(), 1, &frame, pass(32), (0, 0)).words(), 0);
    }
}
