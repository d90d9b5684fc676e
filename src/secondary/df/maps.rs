//! Distance fields as kernels see them: placed in a frame.

use super::kernels::{BOMS, FAMILY, MAPS};
use super::{LEVELS, Options};
use crate::kernels::FrameExecutor;
use crate::kernels::frame::Frame;
use crate::kernels::layout::Level;
use crate::schedule::ExecutorError;
use crate::secondary::occupancy::{Bom, Cascades};
use glam::DVec3;
use std::sync::Arc;

/// Fields of all base maps, placed in a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DfMaps {
    /// The base maps, of which the fields are made.
    pub cascades: Arc<Cascades>,
    /// Where they lie, the finest first.
    pub levels: Vec<Level>,
    /// How near something is met, cells.
    pub hit: f32,
}

impl DfMaps {
    /// Those of `cascades`.
    pub fn new(cascades: &Arc<Cascades>, frame: &Frame, settings: &Options) -> Self {
        let level = |bom: &Bom| {
            let first = frame.origin / bom.side() - DVec3::from_array(bom.first.map(|x| x as f64));
            let per_unit = frame.unit / bom.side();
            Level {
                first: first.as_vec3().to_array(),
                scale: per_unit as f32,
                lift: (settings.lift / per_unit) as f32,
                ..Level::default()
            }
        };
        let levels = cascades.levels.iter().map(level).collect();
        Self { cascades: cascades.clone(), levels, hit: settings.hit as f32 }
    }

    /// Cells of each on each axis.
    pub fn cells(&self) -> u32 {
        self.cascades.levels.first().map_or(0, Bom::cells)
    }

    /// Gives an executor the base maps, unless it has them, and places the fields. Those that were made last stay as
    /// long as their maps do: returns whether they are to be made.
    ///
    /// # Errors
    /// More than the device holds in one buffer, with how much it does.
    pub fn give(&self, executor: &mut dyn FrameExecutor) -> Result<bool, ExecutorError> {
        let held = executor.held(&FAMILY).as_ref().and_then(|held| held.downcast_ref::<Arc<Cascades>>());
        let is_held = held.is_some_and(|held| Arc::ptr_eq(held, &self.cascades));
        let boms = self.cascades.levels.iter().map(|bom| bom.words().len()).sum();
        let lengths = [self.levels.len(), boms, self.nearest_words() as usize, self.distance_words() as usize];
        executor.reserve(&FAMILY, &lengths)?;
        executor.write(&FAMILY, MAPS, 0, bytemuck::cast_slice(&self.levels));
        if !is_held {
            let mut at = 0;
            for words in self.cascades.levels.iter().map(Bom::words) {
                executor.write(&FAMILY, BOMS, at, bytemuck::cast_slice(words));
                at += size_of_val(words);
            }
            *executor.held(&FAMILY) = Some(Box::new(self.cascades.clone()));
        }
        Ok(!is_held)
    }

    /// Words of the nearest cells that flooding keeps: those of one field, twice.
    pub fn nearest_words(&self) -> u64 {
        2 * u64::from(self.cells()).pow(3)
    }

    /// Words of the distances of all fields.
    pub fn distance_words(&self) -> u64 {
        let of_field: u64 = (0..LEVELS).map(|level| u64::from(self.cells() >> level).pow(3) / 2).sum();
        self.levels.len() as u64 * of_field
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_lie_where_their_maps_do() {
        let frame = Frame { reference: [0; 3], unit: 0.25, origin: DVec3::new(5.0, -3.0, 2.0) };
        let boms = vec![Bom::new(64, -2, [-4, -20, 1]), Bom::new(64, -1, [-10, -18, -7])];
        let cascades = Arc::new(Cascades { levels: boms });
        let settings = Options { size: 64, lift: 2.0, hit: 0.75, ..Options::default() };
        let maps = DfMaps::new(&cascades, &frame, &settings);
        for (bom, level) in cascades.levels.iter().zip(&maps.levels) {
            // A point of the world and how far along it lies in the frame.
            let world = DVec3::new(1.0, 2.0, -3.0);
            let point = (world - frame.origin) / frame.unit;
            let found = point * f64::from(level.scale) + DVec3::from(level.first.map(f64::from));
            let expected = world / bom.side() - DVec3::from(bom.first.map(|x| x as f64));
            assert!(found.distance(expected) < 1e-4, "{found} instead of {expected}");
            assert!((f64::from(level.lift) * frame.unit - 2.0 * bom.side()).abs() < 1e-6);
        }
        assert_eq!(maps.nearest_words(), 2 * 64 * 64 * 64);
        assert_eq!(2 * maps.distance_words(), 2 * (64 * 64 * 64 + 32 * 32 * 32 + 16 * 16 * 16));
        assert_eq!(DfMaps::default().distance_words(), 0);
    }
}
