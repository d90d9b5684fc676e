//! Where a pixel's surface was in the frame before.

use super::grid::Grid;
use crate::frame::{Guides, Seen};

/// Pixels of the frame before that show a pixel's surface, with weights that sum to 1; of weight 0 are those that do
/// not count.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Taps(pub [(usize, f32); 4]);

/// Least sum of bilinear weights of usable pixels.
const LEAST_WEIGHT: f32 = 0.01;

/// Bilinear weights of the four pixels around pixel coordinates (x, y), of which (i, j) has its sample at (i, j) +
/// `jitter`.
fn around(grid: &Grid, [x, y]: [f64; 2], jitter: [f64; 2]) -> [(Option<usize>, f32); 4] {
    let (x, y) = (x - jitter[0], y - jitter[1]);
    let (left, top) = (x.floor(), y.floor());
    let (right_share, low_share) = ((x - left) as f32, (y - top) as f32);
    // A cast saturates; pixels outside of the picture are told by `at`.
    [0, 1, 2, 3].map(|k| {
        let (right, low) = (k & 1, k >> 1);
        let weight_x = if right == 1 { right_share } else { 1.0 - right_share };
        let weight_y = if low == 1 { low_share } else { 1.0 - low_share };
        (grid.at((left as i32).saturating_add(right), (top as i32).saturating_add(low)), weight_x * weight_y)
    })
}

fn taps(grid: &Grid, seen: &Seen, before: &Guides) -> Option<Taps> {
    if !seen.is_hit() {
        return None;
    }
    let position = before.projection.pixel_of_point(seen.point)?;
    let mut taps = around(grid, position, before.jitter).map(|(pixel, weight)| {
        pixel.filter(|&p| seen.is_same_surface(&before.seen[p])).map_or((0, 0.0), |p| (p, weight))
    });
    let sum: f32 = taps.iter().map(|(_, weight)| weight).sum();
    if sum < LEAST_WEIGHT {
        return None;
    }
    taps.iter_mut().for_each(|(_, weight)| *weight /= sum);
    Some(Taps(taps))
}

/// For every pixel where its surface was before; `None` where it is new.
pub fn reproject(grid: &Grid, now: &Guides, before: Option<&Guides>) -> Vec<Option<Taps>> {
    grid.map(|pixel| before.and_then(|before| taps(grid, &now.then(&now.seen[pixel]), before)))
}
