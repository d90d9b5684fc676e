//! Where things are: the grid of streets, the order in which blocks are built, what each block is.

use crate::rings::ring;
use crate::rng::{Rng, noise};
use glam::{DVec2, DVec3};

/// Lines of the grid on either side of the origin.
const LINES: i64 = 120;

/// Width of the pavement, metres.
pub const PAVEMENT: f64 = 3.3;
/// Radius of the kerb at corners, metres.
pub const CORNER: f64 = 2.6;
/// Height of the kerb, metres.
pub const KERB: f64 = 0.14;

/// Sides of a rectangle in the order of its walls: +z, +x, −z, −x.
pub const SOUTH: usize = 0;
/// See [`SOUTH`].
pub const EAST: usize = 1;
/// See [`SOUTH`].
pub const NORTH: usize = 2;
/// See [`SOUTH`].
pub const WEST: usize = 3;

/// The point (x, z) on the ground behind the kerb.
pub fn on_ground(p: DVec2) -> DVec3 {
    DVec3::new(p.x, KERB, p.y)
}

/// A rectangle in (x, z).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    /// Least x.
    pub x0: f64,
    /// Greatest x.
    pub x1: f64,
    /// Least z.
    pub z0: f64,
    /// Greatest z.
    pub z1: f64,
}

impl Rect {
    /// Size in x.
    pub fn width(&self) -> f64 {
        self.x1 - self.x0
    }

    /// Size in z.
    pub fn depth(&self) -> f64 {
        self.z1 - self.z0
    }

    /// Centre.
    pub fn center(&self) -> DVec2 {
        DVec2::new(0.5 * (self.x0 + self.x1), 0.5 * (self.z0 + self.z1))
    }

    /// The rectangle with its sides moved inward by `d`, in the order of [`SOUTH`] and the following.
    pub fn shrunk(&self, d: [f64; 4]) -> Self {
        Self { x0: self.x0 + d[WEST], x1: self.x1 - d[EAST], z0: self.z0 + d[NORTH], z1: self.z1 - d[SOUTH] }
    }

    /// The corners such that wall k, from corner k to k + 1, is the side k.
    pub fn polygon(&self) -> [DVec2; 4] {
        [
            DVec2::new(self.x0, self.z1),
            DVec2::new(self.x1, self.z1),
            DVec2::new(self.x1, self.z0),
            DVec2::new(self.x0, self.z0),
        ]
    }

    /// The point at fractions `u` of x and `v` of z.
    pub fn at(&self, u: f64, v: f64) -> DVec2 {
        DVec2::new(self.x0 + u * self.width(), self.z0 + v * self.depth())
    }

    /// A random point.
    pub fn random(&self, rng: &mut Rng) -> DVec2 {
        let u = rng.unit();
        self.at(u, rng.unit())
    }
}

/// What a block is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Zone {
    /// Closed rows of houses around a yard.
    Perimeter,
    /// Towers on a square.
    Towers,
    /// Long buildings on lawns.
    Slabs,
    /// Detached houses with gardens.
    Houses,
    /// Trees, paths, a pond.
    Park,
    /// Paved, with a fountain and one large building.
    Plaza,
}

/// A cell of the grid, from street centre to street centre. Cell (0, 0) has its least corner at the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Column.
    pub i: i64,
    /// Row.
    pub j: i64,
    /// Bounded by the centre lines of four streets.
    pub rect: Rect,
    /// Distance from centre line to kerb, per side.
    pub half: [f64; 4],
    /// What is built.
    pub zone: Zone,
    /// 0 at the outskirts, 1 in the centre.
    pub density: f64,
}

impl Cell {
    /// The block inside its kerbs.
    pub fn block(&self) -> Rect {
        self.rect.shrunk(self.half)
    }

    /// The block inside its pavements.
    pub fn lots(&self) -> Rect {
        self.block().shrunk([PAVEMENT; 4])
    }
}

/// The grid of streets of one seed.
#[derive(Clone, Debug)]
pub struct Layout {
    seed: u64,
    x: Vec<f64>,
    z: Vec<f64>,
}

impl Layout {
    /// The grid of `seed`.
    pub fn new(seed: u64) -> Self {
        let lines = |axis: i64, low: f64, high: f64| {
            let pitch = |k: i64| Rng::new(seed, &[1, axis, k]).range(low, high);
            let mut positive = vec![0.0];
            let mut negative = vec![0.0];
            for k in 0..LINES {
                positive.push(positive[k as usize] + pitch(k));
                negative.push(negative[k as usize] - pitch(-1 - k));
            }
            negative.reverse();
            negative.pop();
            negative.extend(positive);
            negative
        };
        Self { seed, x: lines(0, 62.0, 82.0), z: lines(1, 55.0, 66.0) }
    }

    /// Position of the street along z with number `i`, |i| ≤ 120. Street 0 is at 0.
    pub fn x(&self, i: i64) -> f64 {
        self.x[(i + LINES) as usize]
    }

    /// Position of the street along x with number `j`, |j| ≤ 120. Street 0 is at 0.
    pub fn z(&self, j: i64) -> f64 {
        self.z[(j + LINES) as usize]
    }

    /// Distance from the centre line of the street along z with number `i` to its kerbs.
    pub fn half_x(&self, i: i64) -> f64 {
        if i.rem_euclid(4) == 2 { AVENUE } else { STREET }
    }

    /// Distance from the centre line of the street along x with number `j` to its kerbs.
    pub fn half_z(&self, j: i64) -> f64 {
        if j.rem_euclid(4) == 0 { AVENUE } else { STREET }
    }

    /// The cell (i, j).
    pub fn cell(&self, i: i64, j: i64) -> Cell {
        let rect = Rect { x0: self.x(i), x1: self.x(i + 1), z0: self.z(j), z1: self.z(j + 1) };
        let half = [self.half_z(j + 1), self.half_x(i + 1), self.half_z(j), self.half_x(i)];
        let density = self.density(rect.center());
        Cell { i, j, rect, half, zone: self.zone(i, j, density), density }
    }

    /// A centre of 300 m and lesser ones, from smooth noise.
    fn density(&self, p: DVec2) -> f64 {
        let core = (-p.length_squared() / (2.0 * 150.0f64.powi(2))).exp();
        let noise = noise(self.seed, &[2], p / 330.0);
        (core + 0.85 * noise * noise * (1.0 - core)).clamp(0.0, 1.0)
    }

    fn zone(&self, i: i64, j: i64, density: f64) -> Zone {
        if ring(i, j) == 0 {
            // Around the crossing at the origin: always houses where the walk begins, one square, towers behind.
            let towers_first = Rng::new(self.seed, &[3]).chance(0.5);
            return match (i, j) {
                (0, 0) | (-1, -1) => Zone::Perimeter,
                (0, -1) if towers_first => Zone::Towers,
                (-1, 0) if !towers_first => Zone::Towers,
                _ => Zone::Plaza,
            };
        }
        let mut rng = Rng::new(self.seed, &[4, i, j]);
        let green = rng.unit();
        let kind = rng.unit();
        if green < 0.075 {
            Zone::Park
        } else if green < 0.105 {
            Zone::Plaza
        } else if kind < 0.5 * (density - 0.45) {
            Zone::Towers
        } else if density < 0.22 && kind < 0.75 {
            Zone::Houses
        } else if kind > 0.86 {
            Zone::Slabs
        } else {
            Zone::Perimeter
        }
    }
}

/// Half the width of an avenue, kerb to kerb.
pub const AVENUE: f64 = 7.8;
/// Half the width of a street, kerb to kerb.
pub const STREET: f64 = 5.2;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_ascend_and_leave_room_for_blocks() {
        for seed in 0..20 {
            let layout = Layout::new(seed);
            assert_eq!((layout.x(0), layout.z(0)), (0.0, 0.0));
            for k in -100..100 {
                let cell = layout.cell(k, -k);
                assert!(cell.lots().width() > 36.0 && cell.lots().depth() > 32.0, "{cell:?}");
            }
        }
    }
}
