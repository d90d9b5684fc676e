//! What a field says of a ray through its sphere. Twins of `shaders/displacement/field.wgsl`: f32, rounded operation by
//! operation.

use super::shape::{Shape, on_ring, position_of, ring_place, square_of, square_place};
use crate::kernels::layout::{
    DISPLACEMENT_AIMED, DISPLACEMENT_DIRECTIONS, DISPLACEMENT_MISS, DISPLACEMENT_POSITIONS, DisplacementPosition,
};
use crate::kernels::vector::{Vec3, each};
use crate::math::exact::{divide, square_root};

/// Codes of 8 bits that say where: 0 to 254, of 254 the whole chord.
pub const STEPS: f32 = 254.0;

/// The code of 8 bits of a ray that meets something at a share of its chord, 0 to 1; `None`: it meets nothing.
pub fn code_of(share: Option<f32>) -> u8 {
    share.map_or(DISPLACEMENT_MISS as u8, |share| (share * STEPS + 0.5).clamp(0.0, STEPS) as u8)
}

/// The way of a ray through the unit sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Chord {
    /// Unit vector along the ray.
    pub direction: Vec3,
    /// The point of its line that is nearest to the middle.
    pub middle: Vec3,
    /// From the origin to that point, below 0 behind it.
    pub at: f32,
    /// Half of its length.
    pub half: f32,
}

fn product(a: Vec3, b: Vec3) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl Chord {
    /// Of the line through `origin` along the unit vector `direction`; `None`: it misses the sphere.
    pub fn of(origin: Vec3, direction: Vec3) -> Option<Self> {
        let at = -product(origin, direction);
        let middle = each(|k| origin[k] + at * direction[k]);
        let past = 1.0 - product(middle, middle);
        (past > 0.0).then(|| Self { direction, middle, at, half: square_root(past) })
    }

    /// Distance from the origin at a share of the chord.
    pub fn distance(&self, share: f32) -> f32 {
        self.at + (2.0 * share - 1.0) * self.half
    }

    /// Where it enters the sphere.
    pub fn entry(&self) -> Vec3 {
        each(|k| self.middle[k] - self.half * self.direction[k])
    }
}

/// The samples of a field.
#[derive(Clone, Copy)]
pub struct FieldView<'a> {
    /// How many.
    pub shape: Shape,
    /// Its positions.
    pub table: &'a [DisplacementPosition],
    /// Four codes of 8 bits a word, or 32 of one bit, the first lowest.
    pub codes: &'a [u32],
    /// Bits of a sample, 8 or 1. On the processor also 32, which the kernel does not know: shares as f32, below 0 of a
    /// ray that meets nothing, so that a bench can say what 8 bits lose.
    pub bits: u32,
    /// Of 1 bit: how far along the chord what is met lies.
    pub mean: f32,
}

impl FieldView<'_> {
    /// Share of the chord at which a stored ray meets something; below 0: it meets nothing.
    pub fn stored(&self, position: u32, square: u32) -> f32 {
        let index = position * self.shape.squares() + square;
        if self.bits == 32 {
            return f32::from_bits(self.codes[index as usize]);
        }
        if self.bits == 1 {
            let is_met = self.codes[(index >> 5) as usize] >> (index & 31) & 1 != 0;
            return if is_met { self.mean } else { -1.0 };
        }
        let code = self.codes[(index >> 2) as usize] >> (8 * (index & 3)) & 255;
        if code == DISPLACEMENT_MISS { -1.0 } else { divide(code as f32, STEPS) }
    }

    /// Where in the square of a position's directions a ray from there lies.
    fn square_toward(&self, position: u32, aim: Aim) -> [f32; 2] {
        let row = &self.table[position as usize];
        let [at, x, y] = [row.at, row.x, row.y].map(|v| [v[0], v[1], v[2]]);
        let way = each(|k| aim.to[k] - aim.is_point * at[k]);
        square_place([product(way, x), product(way, y), (-product(way, at)).max(0.0)])
    }

    /// Adds what the stored rays of a position say.
    fn around(&self, position: u32, aim: Aim, look: u32, weight: f32, sum: &mut Sum) {
        let place = self.square_toward(position, aim);
        let n = self.shape.directions;
        if look & DISPLACEMENT_DIRECTIONS == 0 {
            sum.add(self.stored(position, square_of(n, place)), weight);
            return;
        }
        let [x, y] = place.map(|x| (x * n as f32 - 0.5).clamp(0.0, (n - 1) as f32));
        let low = [x, y].map(|x| (x as u32).min(n - 2));
        let [u, v] = [x - low[0] as f32, y - low[1] as f32];
        for corner in 0..4 {
            let (i, j) = (corner & 1, corner >> 1);
            let share = if i == 0 { 1.0 - u } else { u } * if j == 0 { 1.0 - v } else { v };
            sum.add(self.stored(position, low[0] + i + n * (low[1] + j)), weight * share);
        }
    }

    /// The same of the nearest position to `entry`, or of those around it.
    fn toward(&self, entry: Vec3, aim: Aim, look: u32) -> f32 {
        let mut sum = Sum::default();
        let rings = self.shape.rings;
        if look & DISPLACEMENT_POSITIONS == 0 {
            self.around(position_of(rings, entry), aim, look, 1.0, &mut sum);
            return sum.share();
        }
        let [ring, around] = ring_place(rings, entry);
        let low = (ring as u32).min(rings - 1);
        let out = (ring - low as f32).min(1.0);
        for k in 0..2 {
            let (ring, weight) = (low + k, if k == 0 { 1.0 - out } else { out });
            let at = around * ring as f32;
            let whole = (at as u32) as f32;
            let past = at - whole;
            for j in 0..2 {
                let weight = weight * if j == 0 { 1.0 - past } else { past };
                // In the middle between two points rounding takes the one above.
                let near = if ring == 0 { 0.0 } else { divide(whole + j as f32, ring as f32) };
                let position = on_ring(rings, ring, near, entry[2] < 0.0);
                self.around(position, aim, look, weight, &mut sum);
            }
        }
        sum.share()
    }

    /// Share of the chord at which a ray meets something; below 0: it meets nothing. With [`DISPLACEMENT_AIMED`] the
    /// stored ray is the one that meets the asked one in the middle of its chord, else the one in the same direction,
    /// as in the paper.
    pub fn share(&self, chord: &Chord, look: u32) -> f32 {
        let entry = chord.entry();
        if look & DISPLACEMENT_AIMED == 0 {
            return self.toward(entry, Aim { to: chord.direction, is_point: 0.0 }, look);
        }
        self.toward(entry, Aim { to: chord.middle, is_point: 1.0 }, look)
    }
}

/// Where stored rays go.
#[derive(Clone, Copy)]
struct Aim {
    /// A point, or a direction.
    to: Vec3,
    /// 1: it is a point, 0: a direction.
    is_point: f32,
}

/// Weighed samples.
#[derive(Default)]
struct Sum {
    met: f32,
    free: f32,
    shares: f32,
}

impl Sum {
    fn add(&mut self, share: f32, weight: f32) {
        if share < 0.0 {
            self.free += weight;
        } else {
            self.met += weight;
            self.shares += weight * share;
        }
    }

    /// Their mean where most of the weight meets something; below 0 elsewhere.
    fn share(&self) -> f32 {
        if self.met > self.free { divide(self.shares, self.met) } else { -1.0 }
    }
}
