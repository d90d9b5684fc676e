//! The lattice of an object: which step, which device unit, and rounding to it (docs/methods/exact.md, "Positions").
//!
//! The step follows from sizes alone, so a scene that is moved keeps it. It is coarsened only where it has to be: for
//! the range of the arithmetic ([`REACH_STEPS`], [`DIAGONAL_STEPS_LOG2`]), and then the conversion says so.

use crate::build::error::BuildError;
use crate::build::settings::LatticeStep;
use bricks::{NEAR_STEPS, ORIGIN_STEPS};

/// Largest magnitude of a lattice coordinate of a vertex, in steps. Every vertex is then within `2^45` of every other;
/// with a reference point near the camera the offset of a brick stays within the `2^44` steps in which it is an exact
/// f32.
pub(super) const REACH_STEPS: f64 = (1u64 << 44) as f64;

/// log2 of the largest diagonal in steps: a device unit is `2^-10` of it or more, so a step is at least `2^-30` units.
pub(super) const DIAGONAL_STEPS_LOG2: i32 = 41;

/// log2 of the median extent in steps.
const EXTENT_STEPS_LOG2: i32 = 20;

/// log2 of the diagonal in device units, rounded down.
const DIAGONAL_UNITS_LOG2: i32 = 10;

/// Least step: coordinates below the normal range of f32 are zero.
const LEAST_STEP_LOG2: i32 = -126;

/// Largest magnitude of a source coordinate, in source units.
pub(crate) const COORDINATE_LIMIT: f64 = (1u128 << 96) as f64;

/// 2^`exponent`, exactly; `exponent` within the normal range of f64.
pub(crate) fn pow2(exponent: i32) -> f64 {
    debug_assert!((-1022..=1023).contains(&exponent));
    f64::from_bits(((exponent + 1023) as u64) << 52)
}

/// ⌊log2 x⌋ for a positive, normal x.
fn floor_log2(x: f64) -> i32 {
    ((x.to_bits() >> 52) & 0x7ff) as i32 - 1023
}

/// ⌈log2 x⌉ for a positive, normal x.
fn ceil_log2(x: f64) -> i32 {
    floor_log2(x) + i32::from(x.to_bits() << 12 != 0)
}

/// Step and device unit of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Lattice {
    /// log2 of the step in object units.
    pub step_log2: i32,
    /// log2 of the device unit in object units.
    pub unit_log2: i32,
}

impl Lattice {
    /// The lattice point nearest `p`, ties to even. `p` must be within [`REACH_STEPS`] steps.
    pub fn round(&self, p: [f64; 3]) -> [i64; 3] {
        let scale = pow2(-self.step_log2);
        p.map(|x| (x * scale).round_ties_even() as i64)
    }

    /// Steps of `x` object units, unrounded.
    pub fn steps(&self, x: f64) -> f64 {
        x * pow2(-self.step_log2)
    }

    /// Object units of `steps` steps; exact below 2^53.
    pub fn length(&self, steps: i64) -> f64 {
        steps as f64 * pow2(self.step_log2)
    }

    /// log2 of the step in device units.
    pub fn step_unit_log2(&self) -> i32 {
        self.step_log2 - self.unit_log2
    }
}

/// The extents of an object that its lattice follows from.
#[derive(Clone, Debug)]
pub(crate) struct Extents {
    /// "the scene" or the mesh, for messages.
    pub name: String,
    /// Largest extents of its canonical chunks, any order.
    pub chunks: Vec<f64>,
    /// Bounds, object units; `min > max` if it is empty.
    pub min: [f64; 3],
    /// See [`Self::min`].
    pub max: [f64; 3],
}

impl Extents {
    /// The median of the positive extents, or `None` if there is none.
    pub fn median(&self) -> Option<f64> {
        let mut chunks: Vec<f64> = self.chunks.iter().copied().filter(|extent| *extent > 0.0).collect();
        if chunks.is_empty() {
            return None;
        }
        let middle = (chunks.len() - 1) / 2;
        Some(*chunks.select_nth_unstable_by(middle, f64::total_cmp).1)
    }

    /// log2 of the finest step at which no part is wide.
    fn finest(&self) -> i32 {
        let most = self.chunks.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        // An origin lies up to ORIGIN_STEPS below the least vertex; rounding adds a step.
        ceil_log2(most / (NEAR_STEPS - ORIGIN_STEPS - 1) as f64)
    }

    /// Chooses the lattice. A step that `wanted` names is an error if it is too fine; the step that follows from the
    /// sizes is coarsened where it must be, which is said in `warnings`.
    pub fn lattice(&self, wanted: Option<LatticeStep>, warnings: &mut Vec<String>) -> Result<Lattice, BuildError> {
        let requested = if let Some(LatticeStep::Log2(step)) = wanted { Some(step) } else { None };
        if self.min[0] > self.max[0] {
            return Ok(Lattice { step_log2: requested.unwrap_or(-EXTENT_STEPS_LOG2), unit_log2: 0 });
        }
        let natural = self.median().map_or(-EXTENT_STEPS_LOG2, |median| {
            ceil_log2(median.max(f64::MIN_POSITIVE)).saturating_sub(EXTENT_STEPS_LOG2)
        });
        let natural = match wanted {
            Some(LatticeStep::Finest) => natural.min(self.finest()),
            _ => natural,
        };
        let mut step_log2 = requested.unwrap_or(natural.max(LEAST_STEP_LOG2));
        while !self.fits(step_log2) {
            step_log2 += 1;
        }
        if let Some(found) = requested.filter(|&found| found != step_log2) {
            let least = step_log2;
            return Err(BuildError::LatticeTooFine {
                object: self.name.clone(),
                found,
                reach: self.reach(),
                size: self.diagonal(),
                least,
            });
        }
        if requested.is_none() && step_log2 != natural {
            warnings.push(format!(
                "{}: positions are rounded to multiples of 2^{step_log2}, not of 2^{natural} as the size of its parts \
                 suggests, because it reaches {:e} and is {:e} large",
                self.name,
                self.reach(),
                self.diagonal()
            ));
        }
        let unit_log2 = match self.diagonal_steps(step_log2) {
            steps if steps > 0.0 => step_log2 + floor_log2(steps) - DIAGONAL_UNITS_LOG2,
            _ => 0.clamp(step_log2 - 32, step_log2 + 32),
        };
        Ok(Lattice { step_log2, unit_log2 })
    }

    fn reach(&self) -> f64 {
        self.min.iter().chain(&self.max).fold(0.0, |reach, x| x.abs().max(reach))
    }

    fn diagonal(&self) -> f64 {
        (0..3).map(|k| (self.max[k] - self.min[k]).powi(2)).sum::<f64>().sqrt()
    }

    /// Diagonal of the rounded bounds in steps: differences of integers, so moving by whole steps does not change it.
    fn diagonal_steps(&self, step_log2: i32) -> f64 {
        let lattice = Lattice { step_log2, unit_log2: 0 };
        let round = |x: f64| lattice.steps(x).round_ties_even();
        (0..3).map(|k| round(self.max[k]) - round(self.min[k])).map(|extent| extent * extent).sum::<f64>().sqrt()
    }

    fn fits(&self, step_log2: i32) -> bool {
        let lattice = Lattice { step_log2, unit_log2: 0 };
        lattice.steps(self.reach()) <= REACH_STEPS && self.diagonal_steps(step_log2) < pow2(DIAGONAL_STEPS_LOG2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extents(chunks: &[f64], min: [f64; 3], max: [f64; 3]) -> Extents {
        Extents { name: "the scene".to_owned(), chunks: chunks.to_vec(), min, max }
    }

    #[test]
    fn logarithms_are_exact_at_powers_of_two() {
        for e in -1000..1000 {
            let x = pow2(e);
            assert_eq!((floor_log2(x), ceil_log2(x)), (e, e));
            assert_eq!((floor_log2(x.next_up()), ceil_log2(x.next_up())), (e, e + 1));
            assert_eq!((floor_log2(x.next_down()), ceil_log2(x.next_down())), (e - 1, e));
        }
    }

    #[test]
    fn the_step_follows_the_median_extent() {
        let mut warnings = Vec::new();
        let step = |chunks: &[f64], warnings: &mut Vec<String>| {
            extents(chunks, [0.0; 3], [60.0, 20.0, 30.0]).lattice(None, warnings).unwrap().step_log2
        };
        assert_eq!(step(&[16.0, 1.0, 60.0], &mut warnings), 4 - 20);
        assert_eq!(step(&[16.5, 1.0, 60.0], &mut warnings), 5 - 20);
        assert_eq!(step(&[0.0, 0.0, 0.0, 0.3], &mut warnings), -1 - 20, "extents of nothing do not count");
        assert!(warnings.is_empty());
    }

    #[test]
    fn the_diagonal_lies_between_2_10_and_2_11_units() {
        for scale in -40..40 {
            let size = 1.37 * pow2(scale);
            let moved = 3.0 * pow2(scale + 4);
            let lattice = |shift: f64| {
                let object = extents(&[size], [shift; 3], [shift + size, shift + size, shift + 0.5 * size]);
                let lattice = object.lattice(None, &mut Vec::new()).unwrap();
                let units = object.diagonal() / pow2(lattice.unit_log2);
                assert!((1023.9..2048.1).contains(&units), "{units}");
                lattice
            };
            assert_eq!(lattice(0.0), lattice(moved));
            assert_eq!(lattice(0.0).step_log2, scale + 1 - 20);
        }
    }

    #[test]
    fn steps_too_fine_for_the_range_are_coarsened_or_refused() {
        let mut warnings = Vec::new();
        let large = extents(&[0.001], [0.0; 3], [1e6, 1.0, 1.0]);
        let lattice = large.lattice(None, &mut warnings).unwrap();
        assert_eq!(warnings.len(), 1);
        assert!(large.fits(lattice.step_log2) && !large.fits(lattice.step_log2 - 1));
        assert!(lattice.step_unit_log2() >= -30);

        let far = extents(&[1.0], [1e9; 3], [1e9 + 1.0; 3]);
        let lattice = far.lattice(None, &mut warnings).unwrap();
        assert_eq!(warnings.len(), 2);
        assert!(lattice.steps(1e9) <= REACH_STEPS);
        assert!(matches!(
            far.lattice(Some(LatticeStep::Log2(-20)), &mut warnings),
            Err(BuildError::LatticeTooFine { least, .. }) if least == lattice.step_log2
        ));
        assert_eq!(far.lattice(Some(LatticeStep::Log2(lattice.step_log2)), &mut warnings).unwrap(), lattice);

        let unit = extents(&[1.0], [1e7; 3], [1e7 + 1.0; 3]);
        assert_eq!(unit.lattice(None, &mut warnings).unwrap().step_log2, -20, "ten thousand kilometres are in range");
        assert_eq!(warnings.len(), 2);
    }

    #[test]
    fn rounds_half_to_even() {
        let lattice = Lattice { step_log2: -1, unit_log2: 0 };
        assert_eq!(lattice.round([0.25, 0.75, -0.25]), [0, 2, 0]);
        assert_eq!(lattice.round([0.26, 0.7, -0.3]), [1, 1, -1]);
    }
}
