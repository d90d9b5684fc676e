//! How far a picture with levels of detail is from the exact one: where edges are, what is seen through, how bright it
//! is, and what it changes from frame to frame.

use crate::frame::luminance;
use crate::metrics::Image;

/// A depth that jumps by more than so many pixels beyond what the surface's slant explains is an edge.
const JUMP_PIXELS: f64 = 4.0;

/// Least cosine that slant is taken to have.
const LEAST_COSINE: f64 = 0.02;

/// What the rays through the centres of pixels see, row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Seen {
    /// Pixels of a row.
    pub width: usize,
    /// Distances along the rays, world units; infinite on a miss.
    pub depth: Vec<f32>,
    /// Cosines between rays and normals, 0 to 1; any on a miss.
    pub cosine: Vec<f32>,
}

impl Seen {
    /// Whether two neighbours show different things: one a hit and the other a miss, or depths that no surface through
    /// both has. `angle`: of a pixel, radians.
    fn is_edge(&self, a: usize, b: usize, angle: f64) -> bool {
        let [da, db] = [a, b].map(|i| f64::from(self.depth[i]));
        if da.is_finite() != db.is_finite() {
            return true;
        }
        if !da.is_finite() {
            return false;
        }
        // Of a plane at a cosine c a pixel spans a range of depths of its width over c.
        let cosine = f64::from(self.cosine[a].max(self.cosine[b])).max(LEAST_COSINE);
        (da - db).abs() > JUMP_PIXELS * angle * da.min(db) / cosine
    }

    /// The pixels within one pixel of an edge.
    pub fn silhouettes(&self, angle: f64) -> Vec<bool> {
        let (width, count) = (self.width.max(1), self.depth.len());
        let mut is_edge = vec![false; count];
        for i in 0..count {
            let right = (i % width + 1 < width).then_some(i + 1);
            let below = (i + width < count).then_some(i + width);
            for other in [right, below].into_iter().flatten() {
                if self.is_edge(i, other, angle) {
                    (is_edge[i], is_edge[other]) = (true, true);
                }
            }
        }
        // Both pixels of an edge touch it; those beside them are within a pixel of it.
        let near = |i: usize| {
            let (x, y) = (i % width, i / width);
            let rows = y.saturating_sub(1)..(y + 2).min(count.div_ceil(width));
            let columns = x.saturating_sub(1)..(x + 2).min(width);
            rows.flat_map(|row| columns.clone().map(move |column| row * width + column))
                .any(|i| is_edge.get(i).is_some_and(|&is_edge| is_edge))
        };
        (0..count).map(near).collect()
    }

    /// The pixels that are seen through in another picture with depths `other`: what is hit there lies behind the plane
    /// of what is hit here by more than a pixel, of `angle` radians, and what `bound` says of a pixel, world units; or
    /// nothing is hit there.
    pub fn seen_through(&self, other: &[f32], angle: f64, mut bound: impl FnMut(usize) -> f64) -> Vec<bool> {
        let mut is_through = |i: usize| {
            let [own, other] = [self.depth[i], other[i]].map(f64::from);
            if !own.is_finite() || other <= own {
                return false;
            }
            let behind = (other - own) * f64::from(self.cosine[i]).max(LEAST_COSINE);
            !other.is_finite() || behind > angle * own + bound(i)
        };
        (0..self.depth.len().min(other.len())).map(&mut is_through).collect()
    }

    /// The depths of the pixels to the right, those at the right edge their own: what rays of another pixel see.
    pub fn shifted(&self) -> Vec<f32> {
        let width = self.width.max(1);
        let next = |i: usize| if i % width + 1 < width { i + 1 } else { i };
        (0..self.depth.len()).map(|i| self.depth.get(next(i)).copied().unwrap_or(f32::INFINITY)).collect()
    }

    /// The share that `of` has of the pixels that hit something and are `among` those that are asked about.
    pub fn share(&self, of: &[bool], among: impl Fn(usize) -> bool) -> f64 {
        let asked = || (0..self.depth.len()).filter(|&i| self.depth[i].is_finite() && among(i));
        asked().filter(|&i| of.get(i).is_some_and(|&is_of| is_of)).count() as f64 / asked().count().max(1) as f64
    }
}

/// A linear value as sRGB has it, 0 to 1: clamped, then encoded (IEC 61966-2-1).
fn encoded(linear: f32) -> f32 {
    let x = f64::from(linear).clamp(0.0, 1.0);
    (if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }) as f32
}

/// A picture in sRGB, 0 to 1, not rounded.
pub fn srgb(image: &Image) -> Image {
    Image { rgb: image.rgb.iter().map(|pixel| pixel.map(encoded)).collect(), ..*image }
}

/// The root of the mean square of differences over channels of the pixels that `of` has; `None` where it has none.
pub fn rmse_of(a: &Image, b: &Image, of: &[bool]) -> Option<f64> {
    let pixels = a.rgb.iter().zip(&b.rgb).zip(of).filter(|(_, is_of)| **is_of);
    let (mut sum, mut count) = (0.0, 0usize);
    for ((a, b), _) in pixels {
        sum += a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum::<f64>();
        count += 3;
    }
    (count > 0).then(|| (sum / count as f64).sqrt())
}

/// The mean luminance of a picture over that of another; `None` where that is black.
pub fn luminance_ratio(a: &Image, b: &Image) -> Option<f64> {
    let sum = |image: &Image| image.rgb.iter().map(|pixel| luminance(pixel.map(f64::from))).sum::<f64>();
    let (a, b) = (sum(a), sum(b));
    (b > 0.0).then(|| a / b)
}

/// The mean absolute difference of two pictures over pixels and channels.
pub fn change(a: &Image, b: &Image) -> f64 {
    let channels = || a.rgb.as_flattened().iter().zip(b.rgb.as_flattened());
    channels().map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs()).sum::<f64>() / channels().count().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    const ANGLE: f64 = 0.01;
    const MISS: f32 = f32::INFINITY;

    /// Of a picture seen straight on.
    fn seen(width: usize, depth: &[f32]) -> Seen {
        Seen { width, depth: depth.to_vec(), cosine: vec![1.0; depth.len()] }
    }

    #[test]
    fn silhouettes_are_within_a_pixel_of_misses_and_jumps() {
        // A row: a hit beside misses, then far from them a pole in front of a wall.
        let depth = [MISS, MISS, MISS, 10.0, 10.0, 10.0, 10.0, 10.0, 8.0, 10.0, 10.0, 10.0];
        let found = seen(12, &depth).silhouettes(ANGLE);
        let expected = [false, true, true, true, true, false, true, true, true, true, true, false];
        assert_eq!(found, expected);
        // The same as a column, and in the midst of a picture the corners as well.
        assert_eq!(seen(1, &depth).silhouettes(ANGLE), expected);
        let mut middle = [10.0; 49];
        middle[24] = 8.0;
        let found = seen(7, &middle).silhouettes(ANGLE);
        let near = |i: usize| (i % 7).abs_diff(3).max(i / 7_usize) > 0 && found[i];
        assert_eq!(found.iter().filter(|&&is_near| is_near).count(), 21, "a plus and what touches it");
        assert!(near(8 + 3) && !found[0] && !found[6]);
        // Controls: nothing is an edge of a wall, of nothing, and of a plane that is seen at a slant.
        assert!(!seen(4, &[10.0; 16]).silhouettes(ANGLE).contains(&true));
        assert!(!seen(4, &[MISS; 16]).silhouettes(ANGLE).contains(&true));
        let slanted: Vec<f32> = (0..12).map(|i| 10.0 * 1.1f32.powi(i)).collect();
        let plane = Seen { cosine: vec![0.1; 12], ..seen(12, &slanted) };
        assert!(!plane.silhouettes(ANGLE).contains(&true));
        assert!(seen(12, &slanted).silhouettes(ANGLE).contains(&true), "straight on such depths are steps");
    }

    #[test]
    fn what_lies_behind_by_more_than_bound_and_pixel_is_seen_through() {
        let exact = seen(6, &[10.0, 10.0, 10.0, 10.0, 10.0, MISS]);
        let other = [10.0, 9.0, 10.55, 10.65, MISS, 4.0];
        // A pixel is 0.1 wide there.
        let through = exact.seen_through(&other, ANGLE, |_| 0.5);
        assert_eq!(through, [false, false, false, true, true, false]);
        assert_eq!(exact.share(&through, |_| true), 0.4);
        assert_eq!(exact.share(&through, |i| i < 4), 0.25);
        // At a slant the same distance along the ray is less far behind.
        let slanted = Seen { cosine: vec![0.5; 6], ..exact.clone() };
        assert_eq!(slanted.seen_through(&other, ANGLE, |_| 0.5), [false, false, false, false, true, false]);
        // The pixel to the right shows more where there is an edge alone.
        let edge = seen(3, &[10.0, 10.0, 20.0, 20.0, 20.0, 10.0]);
        assert_eq!(edge.shifted(), [10.0, 20.0, 20.0, 20.0, 10.0, 10.0]);
        let through = edge.seen_through(&edge.shifted(), ANGLE, |_| 0.0);
        assert_eq!(through, [false, true, false, false, false, false]);
        // Controls: nothing is seen through itself, and all is seen through nothing.
        assert!(!exact.seen_through(&exact.depth, ANGLE, |_| 0.0).contains(&true));
        let all = exact.seen_through(&[MISS; 6], ANGLE, |_| 1e9);
        assert_eq!(exact.share(&all, |_| true), 1.0);
        assert_eq!(exact.share(&all, |i| i == 5), 0.0, "misses do not count");
    }

    #[test]
    fn errors_luminance_and_changes_are_those_by_hand() {
        let grey = |value: f32| Image::from_fn(2, 2, |_, _| [value; 3]);
        assert_eq!(luminance_ratio(&grey(0.5), &grey(0.25)), Some(2.0));
        assert_eq!(luminance_ratio(&grey(0.5), &grey(0.0)), None);
        let mut other = grey(0.25);
        other.rgb[3] = [1.25, 0.25, 0.25];
        assert_eq!(rmse_of(&grey(0.25), &other, &[true, true, true, false]), Some(0.0));
        assert_eq!(rmse_of(&grey(0.25), &other, &[false, false, false, true]), Some((1.0f64 / 3.0).sqrt()));
        assert_eq!(rmse_of(&grey(0.25), &other, &[false; 4]), None);
        assert_eq!(change(&grey(0.25), &other), 1.0 / 12.0);
        assert_eq!(change(&other, &other), 0.0);
        let shown = srgb(&grey(0.5)).rgb[0][0];
        assert!((shown - 188.0 / 255.0).abs() < 0.5 / 255.0, "{shown}");
        assert_eq!([srgb(&grey(7.0)).rgb[0][0], srgb(&grey(-1.0)).rgb[0][0]], [1.0, 0.0]);
    }
}
