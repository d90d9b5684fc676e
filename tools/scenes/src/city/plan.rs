//! Footprints of buildings.

use super::facade::Side;
use super::layout::Rect;
use crate::mesh::{Frame, inset};
use glam::DVec2;

/// A footprint: a convex polygon whose wall k runs from corner k to k + 1.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Corners.
    pub corners: Vec<DVec2>,
    /// What the walls look at.
    pub sides: Vec<Side>,
}

impl Plan {
    /// A rectangle.
    pub fn rect(rect: Rect, sides: [Side; 4]) -> Self {
        Self { corners: rect.polygon().to_vec(), sides: sides.to_vec() }
    }

    /// Cuts corner `k` off, `c` metres from it; the new wall looks at the street.
    pub fn chamfer(&mut self, k: usize, c: f64) {
        let count = self.corners.len();
        let corner = self.corners[k];
        let toward = |to: DVec2| corner + (to - corner).normalize() * c;
        let (before, after) = (toward(self.corners[(k + count - 1) % count]), toward(self.corners[(k + 1) % count]));
        self.corners[k] = before;
        self.corners.insert(k + 1, after);
        self.sides.insert(k, Side::Street);
        // Wall k is now the cut itself; the wall that started at the corner follows it.
    }

    /// The plan with its street walls moved in by `street` and its rear walls by `rear`.
    pub fn set_back(&self, street: f64, rear: f64) -> Self {
        let distance = |s: &Side| match s {
            Side::Street => street,
            Side::Rear => rear,
            Side::Party => 0.0,
        };
        let distances: Vec<f64> = self.sides.iter().map(distance).collect();
        Self { corners: inset(&self.corners, &distances), sides: self.sides.clone() }
    }

    /// Frame and length of wall `k` with its foot at `y`.
    pub fn wall(&self, k: usize, y: f64) -> (Frame, f64) {
        Frame::wall(self.corners[k], self.corners[(k + 1) % self.corners.len()], y)
    }

    /// Whether ledges run around the left and right ends of wall `k`.
    pub fn joins(&self, k: usize) -> [bool; 2] {
        let count = self.sides.len();
        [(k + count - 1) % count, (k + 1) % count].map(|n| self.sides[n] != Side::Party)
    }

    /// A rectangle well inside.
    pub fn core(&self) -> Rect {
        let fold =
            |f: fn(f64, f64) -> f64, start: f64, axis: fn(&DVec2) -> f64| self.corners.iter().map(axis).fold(start, f);
        let bounds = Rect {
            x0: fold(f64::min, f64::INFINITY, |p| p.x),
            x1: fold(f64::max, f64::NEG_INFINITY, |p| p.x),
            z0: fold(f64::min, f64::INFINITY, |p| p.y),
            z1: fold(f64::max, f64::NEG_INFINITY, |p| p.y),
        };
        let margin = if self.corners.len() > 4 { 2.6 } else { 1.0 };
        bounds.shrunk([margin; 4])
    }
}
