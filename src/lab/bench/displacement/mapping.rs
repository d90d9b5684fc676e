//! Ways to take the directions of a position from a square, and back: those that the paper compares (section 3.4,
//! figures 3 and 5).

use crate::secondary::displacement::Shape;
use crate::secondary::displacement::shape::{square_of, square_place};
use crate::settings::names;
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

names! {
    /// A way.
    Mapping {
        /// The concentric map to the disc, lifted: what fields have.
        Concentric = "concentric",
        /// Both angles evenly: dense around the normal.
        Uniform = "uniform",
        /// The square over the disc, lifted; what lies outside of the disc is not used, 21.5 % of it.
        Rejection = "rejection",
    }
}

/// The middle of a square over the disc, -1 to 1 on each axis.
fn over_disc(directions: u32, number: u32) -> DVec2 {
    let middle = |at: u32| (2.0 * f64::from(at) + 1.0) / f64::from(directions) - 1.0;
    DVec2::new(middle(number % directions), middle(number / directions))
}

/// The square that a place lies in, in parts of the edge.
fn square_at(directions: u32, place: [f64; 2]) -> u32 {
    let [x, y] = place.map(|x| ((x * f64::from(directions)) as u32).min(directions - 1));
    x + directions * y
}

impl Mapping {
    /// Whether a number stands for a direction.
    pub fn is_used(self, shape: Shape, number: u32) -> bool {
        self != Self::Rejection || over_disc(shape.directions, number).length_squared() <= 1.0
    }

    /// A direction by its number, a unit vector whose z is along the inward normal; of numbers that are not used any.
    pub fn direction(self, shape: Shape, number: u32) -> DVec3 {
        let n = shape.directions;
        match self {
            Self::Concentric => shape.direction(number),
            Self::Uniform => {
                let part = |at: u32| (f64::from(at) + 0.5) / f64::from(n);
                let [down, around] = [FRAC_PI_2 * part(number % n), TAU * part(number / n)];
                DVec3::new(down.sin() * around.cos(), down.sin() * around.sin(), down.cos())
            }
            Self::Rejection if !self.is_used(shape, number) => DVec3::Z,
            Self::Rejection => {
                let at = over_disc(n, number);
                at.extend((1.0 - at.length_squared()).max(0.0).sqrt())
            }
        }
    }

    /// The number of the direction that is nearest to one of any length whose z is not below 0, as the square has it.
    pub fn number(self, shape: Shape, direction: DVec3) -> u32 {
        let n = shape.directions;
        match self {
            Self::Concentric => square_of(n, square_place(direction.as_vec3().to_array())),
            Self::Uniform => {
                let down = direction.truncate().length().atan2(direction.z) / FRAC_PI_2;
                square_at(n, [down, direction.y.atan2(direction.x).rem_euclid(TAU) / TAU])
            }
            Self::Rejection => {
                let mut at = direction.normalize_or(DVec3::Z).truncate();
                // At the rim the middle of a square may lie outside: the next one inward is taken.
                loop {
                    let number = square_at(n, (0.5 * at + 0.5).to_array());
                    if self.is_used(shape, number) {
                        return number;
                    }
                    at *= 1.0 - 0.5 / f64::from(n);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPES: [Shape; 3] =
        [Shape { rings: 1, directions: 2 }, Shape { rings: 1, directions: 7 }, Shape { rings: 1, directions: 64 }];

    fn used(mapping: Mapping, shape: Shape) -> impl Iterator<Item = u32> {
        (0..shape.squares()).filter(move |&number| mapping.is_used(shape, number))
    }

    #[test]
    fn every_direction_maps_to_itself() {
        for shape in SHAPES {
            for &mapping in Mapping::ALL {
                for number in used(mapping, shape) {
                    let direction = mapping.direction(shape, number);
                    assert!((direction.length() - 1.0).abs() < 1e-12 && direction.z >= 0.0);
                    assert_eq!(mapping.number(shape, direction), number, "{mapping} {}", shape.directions);
                    assert_eq!(mapping.number(shape, 3.0 * direction), number, "of any length");
                }
            }
        }
        // Control: another mapping takes most of them elsewhere.
        let shape = SHAPES[2];
        for (&one, &other) in Mapping::ALL.iter().zip(Mapping::ALL.iter().cycle().skip(1)) {
            let strays = used(one, shape).filter(|&at| other.number(shape, one.direction(shape, at)) != at).count();
            assert!(strays > 2500, "{one} {other} {strays}");
        }
    }

    #[test]
    fn any_direction_gets_one_that_is_used_and_near() {
        let shape = SHAPES[2];
        // Squares of the disc are widest at the rim, where they reach far down; those of angles are 5.6 degrees long.
        for (mapping, most) in [(Mapping::Concentric, 0.3), (Mapping::Uniform, 0.06), (Mapping::Rejection, 0.36)] {
            for number in 0..4 * shape.squares() {
                let fine = Shape { directions: 128, ..shape };
                let direction = Mapping::Concentric.direction(fine, number);
                let own = mapping.number(shape, direction);
                assert!(mapping.is_used(shape, own), "{mapping} {direction}");
                let distance = mapping.direction(shape, own).distance(direction);
                assert!(distance < most, "{mapping} {direction} {distance}");
            }
        }
        let rim = Mapping::Rejection.number(shape, DVec3::new(1.0, 1.0, 0.0));
        assert!(Mapping::Rejection.is_used(shape, rim));
    }

    #[test]
    fn rejection_leaves_a_fifth_unused() {
        let shape = Shape { rings: 1, directions: 256 };
        let unused = 1.0 - used(Mapping::Rejection, shape).count() as f64 / f64::from(shape.squares());
        // The corners of the square beyond the circle: 1 - pi / 4.
        assert!((unused - 0.2146).abs() < 1e-3, "{unused}");
        assert_eq!(used(Mapping::Uniform, shape).count(), 65_536);
    }
}
