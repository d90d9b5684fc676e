//! Distance fields as kernels see them: placed in a frame.

use super::{FieldSettings, LEVELS};
use crate::kernels::frame::Frame;
use crate::kernels::layout::{Params, RomaLevel};
use crate::secondary::occupancy::{Bom, Cascades};
use glam::DVec3;
use std::sync::Arc;

/// Fields of all base maps, placed in a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FieldMaps {
    /// The base maps, of which the fields are made.
    pub cascades: Arc<Cascades>,
    /// Where they lie, the finest first.
    pub levels: Vec<RomaLevel>,
    /// How near something is met, cells.
    pub hit: f32,
}

impl FieldMaps {
    /// Those of `cascades`.
    pub fn new(cascades: &Arc<Cascades>, frame: &Frame, settings: &FieldSettings) -> Self {
        let level = |bom: &Bom| {
            let first = frame.origin / bom.side() - DVec3::from_array(bom.first.map(|x| x as f64));
            let per_unit = frame.unit / bom.side();
            RomaLevel {
                first: first.as_vec3().to_array(),
                scale: per_unit as f32,
                lift: (settings.lift / per_unit) as f32,
                ..RomaLevel::default()
            }
        };
        let levels = cascades.levels.iter().map(level).collect();
        Self { cascades: cascades.clone(), levels, hit: settings.hit }
    }

    /// Cells of each on each axis.
    pub fn cells(&self) -> u32 {
        self.cascades.levels.first().map_or(0, Bom::cells)
    }

    /// `params` with what kernels need to know of them.
    pub fn params(&self, params: Params) -> Params {
        Params { field_cells: self.cells(), field_levels: self.levels.len() as u32, field_hit: self.hit, ..params }
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
        let settings = FieldSettings { size: 64, occlusion_steps: 64, shadow_steps: 16, lift: 2.0, hit: 0.75 };
        let maps = FieldMaps::new(&cascades, &frame, &settings);
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
        assert_eq!(FieldMaps::default().distance_words(), 0);
    }
}
