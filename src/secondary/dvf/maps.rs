//! Discrete visibility fields as kernels see them: placed in a frame.

use super::{Areas, DvfField, DvfSettings, DvfUse, Fresh, Shape};
use crate::kernels::frame::Frame;
use crate::kernels::layout::{DVF_BOTH, DVF_DOUBT, DVF_HAMMERSLEY, DVF_PAPER, DVF_RENEW, DVF_ROUND, DVF_WALK, DvfGrid};
use crate::math::blue_noise;
use std::f64::consts::TAU;
use std::sync::{Arc, OnceLock};

/// Points of the unit circle by which the directions of a point are turned.
pub const CIRCLE: u32 = 1024;

/// Pixels of the tile of turns on both axes.
pub const TILE: u32 = blue_noise::SIDE as u32;

/// A field in a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DvfMaps {
    /// How it lies, and what is being made.
    pub grid: DvfGrid,
    /// What its masks and labels are; `None`: those that the executor has.
    pub field: Option<Arc<DvfField>>,
    /// Without `field`: masks and labels are emptied; so they are, too, where there are not as many.
    pub is_new: bool,
    /// Directions of rays about z, then [`CIRCLE`] points of the unit circle, then, to answer as in the paper, numbers
    /// of these for a tile of [`TILE`]² pixels, row by row, four to an element.
    pub directions: Arc<Vec<[f32; 4]>>,
    /// Cells that are made anew while others are not: masks are those of their entries.
    pub fresh: Option<Arc<Fresh>>,
    /// Words in which rays that wait for bricks are noted; where there are as many or more already, these keep what was
    /// noted.
    pub waiting_words: usize,
}

/// The cosine-weighted directions of `rays` rays about z (Hammersley; Malley), then the circle.
pub fn directions(rays: u32) -> Vec<[f32; 4]> {
    let around = |i: u32| {
        let share = (f64::from(i) + 0.5) / f64::from(rays);
        let (radius, angle) = (share.sqrt(), TAU * f64::from(i.reverse_bits()) / 4_294_967_296.0);
        [radius * angle.cos(), radius * angle.sin(), (1.0 - share).max(0.0).sqrt(), 0.0].map(|x| x as f32)
    };
    let turn = |i: u32| {
        let angle = TAU * f64::from(i) / f64::from(CIRCLE);
        [angle.cos() as f32, angle.sin() as f32, 0.0, 0.0]
    };
    (0..rays).map(around).chain((0..CIRCLE).map(turn)).collect()
}

/// Pixels of the tile for each point of the circle.
const RANKS_A_POINT: u16 = (TILE * TILE / CIRCLE) as u16;

/// The circle, then the tile of turns: each point as often, and by blue noise.
fn turns() -> Arc<Vec<[f32; 4]>> {
    static TURNS: OnceLock<Arc<Vec<[f32; 4]>>> = OnceLock::new();
    let made = TURNS.get_or_init(|| {
        let number = |rank: u16| f32::from(rank / RANKS_A_POINT);
        let tile = blue_noise::ranks().as_chunks::<4>().0.iter().map(|ranks| ranks.map(number));
        Arc::new(directions(0).into_iter().chain(tile).collect())
    });
    made.clone()
}

/// The grid of `shape` in `frame`.
fn placed(shape: &Shape, frame: &Frame) -> DvfGrid {
    DvfGrid {
        first: ((frame.origin - shape.corner) / shape.side).as_vec3().to_array(),
        scale: (frame.unit / shape.side) as f32,
        size: shape.size,
        octahedral: shape.octahedral,
        ..DvfGrid::default()
    }
}

impl DvfMaps {
    /// A field by which rays are answered.
    pub fn to_answer(field: &Arc<DvfField>, frame: &Frame, how: DvfUse) -> Self {
        let flags = if how.doubt { DVF_DOUBT } else { 0 } | if how.paper { DVF_PAPER } else { 0 };
        let directions = if how.paper { turns() } else { Arc::default() };
        let grid = DvfGrid { flags, ..placed(&field.shape, frame) };
        Self { grid, field: Some(field.clone()), directions, ..Self::default() }
    }

    /// A field that is being made, of `lanes` to a point. Masks are those that the executor has.
    pub fn to_make(
        shape: &Shape,
        frame: &Frame,
        settings: &DvfSettings,
        lanes: u32,
        areas: &Areas,
        directions: &Arc<Vec<[f32; 4]>>,
    ) -> Self {
        let flag = |set: bool, flag: u32| if set { flag } else { 0 };
        let grid = DvfGrid {
            flags: flag(settings.hammersley, DVF_HAMMERSLEY)
                | flag(settings.round, DVF_ROUND)
                | flag(settings.both, DVF_BOTH),
            points: settings.points as f32,
            total: areas.total,
            area_scale: areas.scale,
            rays: settings.rays,
            lanes,
            seed: settings.seed,
            ..placed(shape, frame)
        };
        Self { grid, directions: directions.clone(), ..Self::default() }
    }

    /// The same, of some cells.
    pub fn of_cells(self, fresh: &Arc<Fresh>) -> Self {
        let flags = self.grid.flags | DVF_RENEW;
        Self { grid: DvfGrid { flags, ..self.grid }, fresh: Some(fresh.clone()), ..self }
    }

    /// Cells.
    pub fn cells(&self) -> usize {
        self.grid.size.iter().map(|&n| n as usize).product()
    }

    /// Words of all masks.
    pub fn mask_words(&self) -> usize {
        let cells = self.fresh.as_ref().map_or(self.cells(), |fresh| fresh.entries());
        cells * 2 * (self.grid.octahedral * self.grid.octahedral / 32) as usize
    }
}

/// Where the levels of a sweep over `count` elements lie: first element and number, from the elements themselves to
/// their sum.
pub fn sweep_levels(count: u32) -> Vec<(u32, u32)> {
    let mut levels = vec![(0, count.max(1))];
    loop {
        let (first, count) = levels[levels.len() - 1];
        levels.push((first + count, count.div_ceil(DVF_WALK)));
        if count <= DVF_WALK {
            return levels;
        }
    }
}

/// Elements of all levels.
pub fn sweep_elements(count: u32) -> u32 {
    sweep_levels(count).last().map_or(0, |(first, count)| first + count)
}

/// A sum of 64 bits.
pub fn sum(words: [u32; 2]) -> u64 {
    u64::from(words[0]) | u64::from(words[1]) << 32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_end_in_one_sum() {
        assert_eq!(sweep_levels(1), [(0, 1), (1, 1)]);
        assert_eq!(sweep_levels(512), [(0, 512), (512, 1)]);
        assert_eq!(sweep_levels(513), [(0, 513), (513, 2), (515, 1)]);
        assert_eq!(sweep_levels(3_000_000), [(0, 3_000_000), (3_000_000, 5860), (3_005_860, 12), (3_005_872, 1)]);
        assert_eq!(sweep_elements(513), 516);
    }

    #[test]
    fn directions_lie_by_the_cosine() {
        for rays in [1, 7, 128] {
            let all = directions(rays);
            let around = &all[..rays as usize];
            assert!(around.iter().all(|d| d[2] > 0.0 && (d[0] * d[0] + d[1] * d[1] + d[2] * d[2] - 1.0).abs() < 1e-6));
            // The mean of the height is that of a cosine-weighted hemisphere.
            let mean = around.iter().map(|d| f64::from(d[2])).sum::<f64>() / f64::from(rays);
            assert!((mean - 2.0 / 3.0).abs() < 0.1 / f64::from(rays), "{mean}");
            assert_eq!(all.len(), (rays + CIRCLE) as usize);
        }
    }
}
