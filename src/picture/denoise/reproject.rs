//! Where a pixel's surface was in the frame before.

use super::grid::Grid;
use crate::frame::{Guides, Seen};
use crate::kernels::layout::NONE;
use crate::scene::Projection;
use glam::DVec3;

/// What is kept of what a frame saw.
#[derive(Clone, Debug)]
pub struct Before {
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// The camera's picture.
    pub projection: Projection,
    /// Where in its pixel the first sample lies.
    pub jitter: [f64; 2],
    /// Pixel by pixel.
    pub seen: Vec<Seen>,
}

/// Pixels of the frame before that show a pixel's surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taps {
    /// The one to the upper left: its column and, from bit 16 on, its row, both plus 1; [`NONE`]: the surface is new.
    pub before: u32,
    /// What that one, the next, and the two below weigh: the sum is 1, and those that do not count have 0.
    pub shares: [f32; 4],
}

impl Default for Taps {
    fn default() -> Self {
        Self { before: NONE, shares: [0.0; 4] }
    }
}

/// Least sum of bilinear weights of usable pixels.
const LEAST_WEIGHT: f32 = 0.01;
/// By so many times the angle within which it is alike may what a surface mirrors have turned.
const MOST_TURNED: f32 = 1.0;

/// How far what a surface mirrors has turned since the frame before, as the camera moved: 1 is the angle within which
/// it is alike.
fn turned(seen: &Seen, now: DVec3, before: DVec3) -> f32 {
    let normal = seen.normal.as_dvec3();
    let mirrored = |from: DVec3| (seen.point - from).normalize_or_zero().reflect(normal);
    (mirrored(now) - mirrored(before)).length() as f32 * seen.polish
}

/// Where the surface of a pixel was before; `None` where it is new.
pub fn reproject(now: &Guides, pixel: usize, before: &Before) -> Option<Taps> {
    let seen = now.then(&now.seen[pixel]);
    if !seen.is_hit() {
        return None;
    }
    if seen.polish > 0.0 && turned(&seen, now.projection.position(), before.projection.position()) > MOST_TURNED {
        return None;
    }
    let grid = Grid::new(now.size);
    let position = before.projection.pixel_of_point(seen.point)?;
    // Pixel (i, j) has its sample at (i, j) + jitter.
    let [x, y] = [0, 1].map(|k| position[k] - before.jitter[k]);
    let (left, top) = (x.floor(), y.floor());
    let (right_share, low_share) = ((x - left) as f32, (y - top) as f32);
    // A cast saturates; pixels outside of the picture are told by `at`.
    let (left, top) = (left as i32, top as i32);
    let mut shares = [0, 1, 2, 3].map(|k| {
        let (right, low) = (k & 1, k >> 1);
        let weight_x = if right == 1 { right_share } else { 1.0 - right_share };
        let weight_y = if low == 1 { low_share } else { 1.0 - low_share };
        let there = grid.at(left.saturating_add(right), top.saturating_add(low));
        there.filter(|&p| seen.is_same_surface(&before.seen[p])).map_or(0.0, |_| weight_x * weight_y)
    });
    let sum: f32 = shares.iter().sum();
    if sum < LEAST_WEIGHT {
        return None;
    }
    shares.iter_mut().for_each(|share| *share /= sum);
    // One of the four is in the picture: columns and rows are -1 and more.
    Some(Taps { before: (left + 1) as u32 | ((top + 1) as u32) << 16, shares })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// What a flat mirror shows at a point turns by the angle that the camera goes around it; what is matt does not.
    #[test]
    fn mirrored_things_turn_as_the_camera_does() {
        let around = |angle: f64| 5.0 * DVec3::new(angle.sin(), 0.0, angle.cos());
        let seen = |polish: f32| Seen {
            point: DVec3::ZERO,
            plane: Vec3::Z,
            normal: Vec3::Z,
            id: 1,
            footprint: 0.01,
            albedo: [0.5; 3],
            polish,
        };
        for angle in [0.005, 0.02] {
            let found = f64::from(turned(&seen(100.0), around(0.3 + angle), around(0.3)));
            let expected = 100.0 * 2.0 * (angle / 2.0).sin();
            assert!((found - expected).abs() < 1e-5, "{angle}: {found} instead of {expected}");
            assert_eq!(found > f64::from(MOST_TURNED), angle > 0.01);
            assert_eq!(turned(&seen(0.0), around(0.3 + angle), around(0.3)), 0.0);
        }
        // Nearer along the same line nothing turns.
        assert!(turned(&seen(100.0), 0.5 * around(0.3), around(0.3)) < 1e-5);
    }
}
