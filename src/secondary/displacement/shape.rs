//! At which positions and in which directions a field has samples, and which of them stands for a ray's.
//!
//! Positions are Slater's (2002, "Constant-time queries on uniformly distributed points on a hemisphere"): a pole, then
//! ring k of m with 4k points at the height 1 - (k / m)²; each hemisphere has its own equator. Directions are the
//! middles of n x n squares, mapped to the disc by the concentric map (Shirley, Chiu 1997) and lifted to the hemisphere
//! about the inward normal (Malley): dense where a ray passes near the middle. Both have inverses of constant time,
//! which are twins of `shaders/displacement/field.wgsl`, rounded operation by operation.

use crate::kernels::layout::DisplacementPosition;
use crate::math::angles::{eighths_around, square_of_disc};
use crate::math::exact::{divide, square_root};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

/// Most rings of a hemisphere, and most directions on each axis.
pub const MOST_RINGS: u32 = 64;
/// Most directions on each axis of their square.
pub const MOST_DIRECTIONS: u32 = 256;

/// How many samples a field has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Shape {
    /// Rings of positions of a hemisphere around its pole, 1 to 64: Slater's m.
    pub rings: u32,
    /// Directions of a position on each axis of their square, 2 to 256.
    pub directions: u32,
}

impl Shape {
    /// Positions on the whole sphere: 290, 1090, 4226 of 8, 16, 32 rings.
    pub fn positions(self) -> u32 {
        2 * of_hemisphere(self.rings)
    }

    /// Directions of a position.
    pub fn squares(self) -> u32 {
        self.directions * self.directions
    }

    /// Samples in all.
    pub fn samples(self) -> u64 {
        u64::from(self.positions()) * u64::from(self.squares())
    }

    /// A position by its number, a unit vector.
    pub fn position(self, number: u32) -> DVec3 {
        let half = of_hemisphere(self.rings);
        let (number, is_lower) = if number < half { (number, false) } else { (number - half, true) };
        let sign = if is_lower { -1.0 } else { 1.0 };
        if number == 0 {
            return DVec3::new(0.0, 0.0, sign);
        }
        // Ring k begins with point 1 + 2k (k - 1).
        let mut ring = ((f64::from(2 * number - 1).sqrt() + 1.0) / 2.0) as u32;
        while first_of(ring) > number {
            ring -= 1;
        }
        while first_of(ring + 1) <= number {
            ring += 1;
        }
        let down = (f64::from(ring) / f64::from(self.rings)).powi(2);
        let around = FRAC_PI_2 * f64::from(number - first_of(ring)) / f64::from(ring);
        let across = (down * (2.0 - down)).sqrt();
        DVec3::new(across * around.cos(), across * around.sin(), sign * (1.0 - down))
    }

    /// A direction by its number, a unit vector whose z is along the inward normal.
    pub fn direction(self, number: u32) -> DVec3 {
        let middle = |at: u32| (2.0 * f64::from(at) + 1.0) / f64::from(self.directions) - 1.0;
        lifted(disc([middle(number % self.directions), middle(number / self.directions)]))
    }

    /// All positions, each with the frame of its directions.
    pub fn table(self) -> Vec<DisplacementPosition> {
        let row = |number| {
            let at = self.position(number);
            let [x, y, _] = frame(at);
            let row = |v: DVec3| v.as_vec3().extend(0.0).to_array();
            DisplacementPosition { at: row(at), x: row(x), y: row(y) }
        };
        (0..self.positions()).map(row).collect()
    }
}

/// Positions of a hemisphere.
pub fn of_hemisphere(rings: u32) -> u32 {
    2 * rings * rings + 2 * rings + 1
}

/// The first position of a ring, from 1.
fn first_of(ring: u32) -> u32 {
    1 + 2 * ring * (ring - 1)
}

/// The square -1 to 1 to the unit disc (Shirley, Chiu 1997).
fn disc([x, y]: [f64; 2]) -> [f64; 2] {
    if x == 0.0 && y == 0.0 {
        return [0.0; 2];
    }
    let (r, angle) = if x.abs() > y.abs() { (x, FRAC_PI_4 * (y / x)) } else { (y, FRAC_PI_2 - FRAC_PI_4 * (x / y)) };
    [r * angle.cos(), r * angle.sin()]
}

/// The unit disc to the hemisphere above it (Malley).
fn lifted([x, y]: [f64; 2]) -> DVec3 {
    DVec3::new(x, y, (1.0 - x * x - y * y).max(0.0).sqrt())
}

/// The frame of the directions from a position: two tangents and the inward normal (Duff et al. 2017, "Building an
/// orthonormal basis, revisited").
pub fn frame(position: DVec3) -> [DVec3; 3] {
    let n = -position;
    let sign = 1f64.copysign(n.z);
    let a = -1.0 / (sign + n.z);
    let b = n.x * n.y * a;
    [DVec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), DVec3::new(b, sign + n.y * n.y * a, -n.y), n]
}

/// How far from the pole a point of the unit sphere lies, in rings, and how far around, in points of a ring of one.
pub fn ring_place(rings: u32, [x, y, z]: [f32; 3]) -> [f32; 2] {
    let across = x * x + y * y;
    let ring = rings as f32 * square_root(divide(across, 1.0 + z.abs()));
    // 1 - |z| = across / (1 + |z|), which keeps its digits near the pole. An eighth of a turn is half a point.
    [ring, 0.5 * eighths_around(x, y)]
}

/// The position of a ring that is nearest around; `is_lower`: of the lower hemisphere.
pub fn on_ring(rings: u32, ring: u32, around: f32, is_lower: bool) -> u32 {
    let first = if is_lower { of_hemisphere(rings) } else { 0 };
    if ring == 0 {
        return first;
    }
    first + first_of(ring) + (around * ring as f32 + 0.5) as u32 % (4 * ring)
}

/// The position that is nearest to a point of the unit sphere, along its ring and across.
pub fn position_of(rings: u32, at: [f32; 3]) -> u32 {
    let [ring, around] = ring_place(rings, at);
    on_ring(rings, ((ring + 0.5) as u32).min(rings), around, at[2] < 0.0)
}

/// Where in the unit square a direction of any length lies whose z, along the inward normal, is not below 0.
pub fn square_place([x, y, z]: [f32; 3]) -> [f32; 2] {
    let across = x * x + y * y;
    square_of_disc([x, y], square_root(divide(across, across + z * z)))
}

/// The number of the direction of a place in the unit square.
pub fn square_of(directions: u32, place: [f32; 2]) -> u32 {
    let [x, y] = place.map(|x| ((x * directions as f32) as u32).min(directions - 1));
    x + directions * y
}
