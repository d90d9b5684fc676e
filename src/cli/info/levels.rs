//! Levels of detail for `info`: how many, what they take, how far they are from what they stand for.

use super::quality::bytes_of;
use crate::settings::sizes::{counted, human_bytes, human_count};
use bricks::{Instance, Level, Resident};
use serde::Serialize;
use std::collections::BTreeSet;

/// The levels of detail of a scene. Lengths are in scene units, by the largest scale of an object's instances.
#[derive(Debug, PartialEq, Serialize)]
pub struct Levels {
    /// Levels.
    levels: u64,
    /// Objects that have some.
    objects: u64,
    /// Triangles of all of them.
    triangles: u64,
    /// Of geometry and attributes, as they lie in the file.
    bytes: u64,
    /// Of the bytes of geometry and attributes of bricks.
    share_of_bricks: f64,
    /// The middle one of what selection goes by.
    median_error: f64,
    largest_error: f64,
    /// The largest distance of any level to what it stands for.
    largest_bound: f64,
    /// By depth, 1 being directly over bricks.
    depths: Vec<Depth>,
}

/// The levels of a depth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Depth {
    /// One more than the largest of the children, of which bricks have 0.
    depth: u32,
    levels: u64,
    median_error: f64,
    largest_bound: f64,
}

/// The largest scale along an axis of the instance's object.
fn scale(instance: &Instance) -> f64 {
    let m = &instance.world_from_object;
    (0..3).map(|axis| (0..3).map(|row| m[4 * row + axis].powi(2)).sum::<f64>().sqrt()).fold(0.0, f64::max)
}

/// The middle of some numbers, the upper one of two; 0 of none.
fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_unstable_by(f64::total_cmp);
    numbers.get(numbers.len() / 2).copied().unwrap_or(0.0)
}

/// The depth of every level.
fn depths(levels: &[Level], bricks: usize) -> Vec<u32> {
    let mut depths: Vec<u32> = Vec::with_capacity(levels.len());
    for level in levels {
        let below = level.children().map(|child| (child.brick as usize).checked_sub(bricks).map_or(0, |at| depths[at]));
        let depth = 1 + below.max().unwrap_or(0);
        depths.push(depth);
    }
    depths
}

impl Levels {
    /// Nothing of a scene without levels.
    pub fn of(resident: &Resident) -> Option<Self> {
        let levels = &resident.levels;
        let mut scales = vec![0.0f64; resident.objects.len()];
        for instance in &resident.instances {
            let largest = &mut scales[instance.object as usize];
            *largest = largest.max(scale(instance));
        }
        let scaled = |level: &Level, length: f64| length * scales[level.brick.object as usize];
        let depths = depths(levels, resident.exact_bricks());
        let errors_at = |depth: u32| {
            let all = levels.iter().zip(&depths).filter(move |(_, own)| depth == 0 || **own == depth);
            let (errors, bounds): (Vec<f64>, Vec<f64>) =
                all.map(|(level, _)| (scaled(level, level.error), scaled(level, level.bound))).unzip();
            let largest = |of: &[f64]| of.iter().copied().fold(0.0, f64::max);
            (errors.len() as u64, largest(&errors), largest(&bounds), median(errors))
        };
        let row = |depth| {
            let (levels, _, largest_bound, median_error) = errors_at(depth);
            Depth { depth, levels, median_error, largest_bound }
        };
        let (_, largest_error, largest_bound, median_error) = errors_at(0);
        let bytes = levels.iter().map(|level| bytes_of(&level.brick)).sum();
        let of_bricks: u64 = resident.bricks[..resident.exact_bricks()].iter().map(bytes_of).sum();
        (!levels.is_empty()).then(|| Self {
            levels: levels.len() as u64,
            objects: levels.iter().map(|level| level.brick.object).collect::<BTreeSet<_>>().len() as u64,
            triangles: levels.iter().map(|level| u64::from(level.brick.triangle_count)).sum(),
            bytes,
            share_of_bricks: bytes as f64 / of_bricks.max(1) as f64,
            median_error,
            largest_error,
            largest_bound,
            depths: (1..=depths.iter().copied().max().unwrap_or(0)).map(row).collect(),
        })
    }

    /// Rows for people.
    pub fn human(&self) -> Vec<(&'static str, String)> {
        let (levels, objects) = (counted(self.levels, "level"), counted(self.objects, "object"));
        let (triangles, bytes) = (human_count(self.triangles), human_bytes(self.bytes));
        let Self { share_of_bricks, median_error, largest_error, largest_bound, .. } = self;
        let share = 100.0 * share_of_bricks;
        let mut rows = vec![
            ("levels", format!("{levels} of {objects}, {triangles} triangles, {bytes} ({share:.1} % of bricks)")),
            ("", format!("error {median_error:.3e} median, {largest_error:.3e} largest; bound {largest_bound:.3e}")),
        ];
        rows.extend(self.depths.iter().map(|row| {
            let Depth { depth, levels, median_error, largest_bound } = row;
            let levels = counted(*levels, "level");
            ("", format!("depth {depth}: {levels}, error {median_error:.3e} median, bound {largest_bound:.3e}"))
        }));
        rows
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::{Brick, Leaf, NONE, Object, Span};
    use bytemuck::Zeroable;

    fn brick(object: u32, triangle_count: u32, bytes: u64) -> Brick {
        let span = |bytes| Span { offset: 4096, bytes, checksum: 0 };
        Brick { object, triangle_count, geometry: span(bytes), attributes: span(bytes / 2), ..Brick::zeroed() }
    }

    fn level(brick: Brick, children: [u32; 2], error: f64, bound: f64) -> Level {
        let child = |brick| Leaf { instance: NONE, brick };
        let children = [child(children[0]), child(children[1]), child(NONE), child(NONE)];
        Level { brick, children, error, bound, color: 0.0, _reserved: 0 }
    }

    #[test]
    fn levels_are_counted_by_depth() {
        let object = |first_brick, brick_count| Object { first_brick, brick_count, ..Object::zeroed() };
        let placed = |object, scale| Instance {
            object,
            world_from_object: Instance::IDENTITY.map(|x| x * scale),
            ..Instance::zeroed()
        };
        let mut resident = Resident {
            objects: vec![object(0, 3), object(3, 1)],
            instances: vec![placed(0, 1.0), placed(1, 2.0), placed(1, 4.0)],
            bricks: vec![brick(0, 9, 1600), brick(0, 9, 1600), brick(0, 9, 1600), brick(1, 9, 1600)],
            ..Resident::default()
        };
        assert_eq!(Levels::of(&resident), None);
        resident.levels = vec![
            level(brick(0, 5, 320), [0, 1], 0.5, 1.5),
            level(brick(1, 6, 320), [3, NONE], 0.25, 0.75),
            level(brick(0, 7, 320), [4, 2], 2.0, 2.5),
        ];
        resident.level_leaves = vec![Leaf::zeroed()];
        let found = Levels::of(&resident);
        let depth = |depth, levels, median_error, largest_bound| Depth { depth, levels, median_error, largest_bound };
        let expected = Levels {
            levels: 3,
            objects: 2,
            triangles: 18,
            bytes: 3 * 480,
            share_of_bricks: 0.15,
            median_error: 1.0,
            largest_error: 2.0,
            largest_bound: 3.0,
            depths: vec![depth(1, 2, 1.0, 3.0), depth(2, 1, 2.0, 2.5)],
        };
        let rows: Vec<String> = expected.human().into_iter().map(|(name, value)| format!("{name}: {value}")).collect();
        assert_eq!(
            rows,
            [
                "levels: 3 levels of 2 objects, 18 triangles, 1440 B (15.0 % of bricks)",
                ": error 1.000e0 median, 2.000e0 largest; bound 3.000e0",
                ": depth 1: 2 levels, error 1.000e0 median, bound 3.000e0",
                ": depth 2: 1 level, error 2.000e0 median, bound 2.500e0",
            ]
        );
        assert_eq!(found, Some(expected));
    }
}
