//! Temporal anti-aliasing: frames whose samples lie at different points of their pixels, averaged where the world was
//! seen before.
//!
//! Karis, "High Quality Temporal Supersampling" (SIGGRAPH 2014 courses); the history is clipped to mean ± γσ of the new
//! frame's 3 x 3 pixels in YCoCg (Salvi, GDC 2016) and read with Catmull–Rom weights (Hillaire, SIGGRAPH 2020 courses,
//! has them for the same purpose), not below zero. Motion is that of the nearest surface of the 3 x 3 pixels, so that
//! edges take theirs along.

use super::grid::Grid;
use crate::frame::Guides;
use crate::picture::color::{is_finite, lerp};
use crate::scene::Projection;

/// What a new frame weighs.
const NEW: f32 = 0.1;
/// Standard deviations of the new frame's neighbours that the history may be off.
const DEVIATIONS: f32 = 1.25;

/// Averages frame after frame.
#[derive(Clone, Debug, Default)]
pub struct Taa {
    size: (u32, u32),
    projection: Option<Projection>,
    past: Vec<[f32; 3]>,
}

fn ycocg(c: [f32; 3]) -> [f32; 3] {
    [0.25 * c[0] + 0.5 * c[1] + 0.25 * c[2], 0.5 * c[0] - 0.5 * c[2], -0.25 * c[0] + 0.5 * c[1] - 0.25 * c[2]]
}

fn rgb([y, co, cg]: [f32; 3]) -> [f32; 3] {
    [y + co - cg, y + cg, y - co - cg]
}

/// Catmull–Rom weights of the four pixels around a place `t` of the way from the second to the third.
fn catmull_rom(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [-0.5 * t3 + t2 - 0.5 * t, 1.5 * t3 - 2.5 * t2 + 1.0, -1.5 * t3 + 2.0 * t2 + 0.5 * t, 0.5 * t3 - 0.5 * t2]
}

/// The history at pixel coordinates (x, y), within the picture.
fn sample(grid: &Grid, past: &[[f32; 3]], [x, y]: [f64; 2]) -> [f32; 3] {
    let (x, y) = (x - 0.5, y - 0.5);
    let (left, top) = (x.floor(), y.floor());
    let (across, down) = (catmull_rom((x - left) as f32), catmull_rom((y - top) as f32));
    let mut sum = [0.0f32; 3];
    for (row, weight_y) in (-1..).zip(down) {
        for (column, weight_x) in (-1..).zip(across) {
            let color = past[grid.nearest(left as i32 + column, top as i32 + row)];
            for k in 0..3 {
                sum[k] += weight_x * weight_y * color[k];
            }
        }
    }
    sum.map(|x| x.max(0.0))
}

/// `history` on its way to the mean of the colours around `pixel`, no further off than [`DEVIATIONS`] of theirs in any
/// channel.
fn clipped(grid: &Grid, now: &[[f32; 3]], pixel: usize, history: [f32; 3]) -> [f32; 3] {
    let (mut count, mut mean, mut squares) = (0u32, [0.0f32; 3], [0.0f32; 3]);
    for other in grid.around(pixel, 1) {
        count += 1;
        let color = ycocg(now[other]);
        for k in 0..3 {
            let delta = color[k] - mean[k];
            mean[k] += delta / count as f32;
            squares[k] += delta * (color[k] - mean[k]);
        }
    }
    let old = ycocg(history);
    let mut share = 1.0f32;
    for k in 0..3 {
        let reach = DEVIATIONS * (squares[k].max(0.0) / count as f32).sqrt();
        let off = (old[k] - mean[k]).abs();
        if off > reach {
            share = share.min(reach / off);
        }
    }
    if share >= 1.0 { history } else { rgb(lerp(mean, old, share)).map(|x| x.max(0.0)) }
}

impl Taa {
    /// Averages `radiance` into what was before. Returns the number of pixels of the history that were not finite.
    pub fn frame(&mut self, guides: &Guides, radiance: &mut [[f32; 3]]) -> u64 {
        let grid = Grid::new(guides.size);
        let non_finite = self.past.iter().filter(|c| !is_finite(c)).count() as u64;
        let projection = self.projection.filter(|_| self.size == guides.size);
        let (past, size) = (&self.past, guides.size);
        // What is not finite is black here; the frame has counted it.
        let now: Vec<[f32; 3]> = radiance.iter().map(|&c| if is_finite(&c) { c } else { [0.0; 3] }).collect();
        let next = grid.map(|pixel| {
            let found = projection.and_then(|before| place_before(&grid, guides, &before, pixel));
            let inside = |p: &[f64; 2]| (0.0..size.0.into()).contains(&p[0]) && (0.0..size.1.into()).contains(&p[1]);
            let history = found.filter(inside).map(|place| sample(&grid, past, place)).filter(is_finite);
            history.map_or(now[pixel], |history| lerp(clipped(&grid, &now, pixel, history), now[pixel], NEW))
        });
        radiance.copy_from_slice(&next);
        *self = Self { size, projection: Some(guides.projection), past: next };
        non_finite
    }
}

/// Where the centre of `pixel` was before, by the motion of the nearest surface of the pixels around it.
fn place_before(grid: &Grid, guides: &Guides, before: &Projection, pixel: usize) -> Option<[f64; 2]> {
    let depth = |other: usize| if guides.seen[other].is_hit() { guides.seen[other].footprint } else { f32::INFINITY };
    let mut nearest = pixel;
    for other in grid.around(pixel, 1) {
        if depth(other) < depth(nearest) {
            nearest = other;
        }
    }
    let seen = guides.then(&guides.seen[nearest]);
    let there = if seen.is_hit() { before.pixel_of_point(seen.point) } else { before.pixel_of_direction(seen.point) }?;
    let (column, row) = grid.position(nearest);
    let (x, y) = grid.position(pixel);
    let motion = [there[0] - f64::from(column) - guides.jitter[0], there[1] - f64::from(row) - guides.jitter[1]];
    Some([f64::from(x) + 0.5 + motion[0], f64::from(y) + 0.5 + motion[1]])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_return() {
        for color in [[0.25, 0.5, 1.0], [0.0, 4.0, 0.125]] {
            let back = rgb(ycocg(color));
            assert!((0..3).all(|k| (back[k] - color[k]).abs() < 1e-6), "{back:?}");
        }
    }

    #[test]
    fn weights_sum_to_one_and_keep_pixels() {
        assert_eq!(catmull_rom(0.0), [0.0, 1.0, 0.0, 0.0]);
        for t in [0.125f32, 0.5, 0.875] {
            assert!((catmull_rom(t).iter().sum::<f32>() - 1.0).abs() < 1e-6);
        }
    }
}
