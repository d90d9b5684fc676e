//! A model over a corner: three walls of 33 x 33 vertices, 256 rays each (figures 4 to 8 of the paper).
//!
//! The paper does not say how large the corner is, nor how far from the model. Walls of [`SIDE`] radii, [`AWAY`] from
//! the middle, with light that falls off over twice the radius ([`REACH`]) give its errors for its model.

use crate::math::sampling::{cosine_hemisphere, hammersley, random2};
use crate::secondary::displacement::{Ball, Chord};
use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

/// Vertices of a wall on each axis.
pub const VERTICES: u32 = 33;
/// Edge of a wall, in radii of the model's sphere.
pub const SIDE: f64 = 3.0;
/// From the middle of the model's sphere to each wall, in radii.
pub const AWAY: f64 = 1.0;
/// Distance beyond which nothing is occluded, in radii.
pub const REACH: f32 = 2.0;

/// A ray of a vertex.
#[derive(Clone, Copy, Debug)]
pub struct CornerRay {
    /// Where it starts.
    pub origin: DVec3,
    /// A unit vector.
    pub direction: DVec3,
    /// Where it starts, from the middle of the model's sphere in radii.
    pub start: Vec3,
    /// `direction` in f32.
    pub way: Vec3,
}

/// The rays of all vertices of a corner, `rays` each: those of a vertex one after another, distributed by the cosine.
pub fn rays(ball: &Ball, rays: u32) -> Vec<CornerRay> {
    let vertices = 3 * VERTICES * VERTICES;
    let of_vertex = |vertex: u32| {
        let (wall, at) = (vertex / (VERTICES * VERTICES), vertex % (VERTICES * VERTICES));
        let along = |x: u32| SIDE * f64::from(x) / f64::from(VERTICES - 1);
        let place = [0.0, along(at % VERTICES), along(at / VERTICES)];
        let turned = |v: [f64; 3]| DVec3::from_array(std::array::from_fn(|k| v[(k + wall as usize) % 3]));
        let frame = DMat3::from_cols(turned([0.0, 1.0, 0.0]), turned([0.0, 0.0, 1.0]), turned([1.0, 0.0, 0.0]));
        let start = turned(place) - AWAY;
        let origin = ball.center + ball.radius * start;
        let moved = random2(vertex, 0, 7);
        (0..rays).map(move |ray| {
            let point = hammersley(ray, rays);
            let square = std::array::from_fn(|k| (point[k] + moved[k]).fract());
            let local = cosine_hemisphere(square).map(f64::from);
            let direction = (frame * DVec3::from_array(local)).normalize();
            CornerRay { origin, direction, start: start.as_vec3(), way: direction.as_vec3() }
        })
    };
    (0..vertices).flat_map(of_vertex).collect()
}

/// Distances at which rays meet something by a field, in radii of its sphere, infinite where they meet nothing: `share`
/// says where along the chord, below 0 where it is free. `exact` are the distances of rays that a field does not know.
pub fn by_field(share: impl Fn(&Chord) -> f32 + Sync, rays: &[CornerRay], exact: &[f32]) -> Vec<f32> {
    let one = |(ray, &exact): (&CornerRay, &f32)| {
        let chord = Chord::of(ray.start.to_array(), ray.way.to_array());
        let Some(chord) = chord.filter(|chord| chord.at + chord.half > 0.0) else { return f32::INFINITY };
        let share = share(&chord);
        if share < 0.0 {
            return f32::INFINITY;
        }
        // From inside of the sphere what is met behind says nothing.
        let distance = chord.distance(share);
        if distance <= 0.0 { exact } else { distance }
    };
    rays.par_iter().zip(exact).map(one).collect()
}

/// The share of rays that go through the sphere.
pub fn inside(rays: &[CornerRay]) -> f64 {
    let chord = |ray: &&CornerRay| Chord::of(ray.start.to_array(), ray.way.to_array());
    let is_in = |ray: &&CornerRay| chord(ray).is_some_and(|chord| chord.at + chord.half > 0.0);
    rays.iter().filter(is_in).count() as f64 / rays.len().max(1) as f64
}

/// Grey levels of vertices, 0 to 255, each of so many rays: the mean of the distances at which they meet something, of
/// [`REACH`] at most, as a share of that.
pub fn levels(distances: &[f32], rays: u32) -> Vec<f64> {
    let light = |&distance: &f32| f64::from((distance / REACH).min(1.0));
    let mean = |own: &[f32]| own.iter().map(light).sum::<f64>() / own.len() as f64;
    distances.chunks(rays as usize).map(|own| 255.0 * mean(own)).collect()
}

/// The root of the mean square of differences, and their mean.
pub fn rms(one: &[f64], other: &[f64]) -> (f64, f64) {
    let count = one.len().max(1) as f64;
    let all = || one.iter().zip(other).map(|(a, b)| a - b);
    (f64::sqrt(all().map(|d| d * d).sum::<f64>() / count), all().sum::<f64>() / count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_and_their_errors_are_those_by_hand() {
        // Half way, beyond reach, free, at once: 0.5, 1, 1 and 0 of 255.
        let own = levels(&[1.0, 7.0, f32::INFINITY, 0.0], 2);
        assert_eq!(own, [255.0 * 0.75, 255.0 * 0.5]);
        assert_eq!(levels(&[2.0; 6], 3), [255.0; 2]);
        assert_eq!(rms(&[3.0, 1.0], &[0.0, 5.0]), (f64::sqrt(12.5), -0.5));
        assert_eq!(rms(&own, &own), (0.0, 0.0));
        assert_eq!(rms(&[], &[]), (0.0, 0.0));
    }

    #[test]
    fn rays_leave_walls_into_the_corner() {
        let ball = Ball { center: DVec3::new(5.0, -2.0, 1.0), radius: 2.0 };
        let all = rays(&ball, 4);
        assert_eq!(all.len(), 3 * 33 * 33 * 4);
        for (number, ray) in all.iter().enumerate() {
            let wall = number / (33 * 33 * 4);
            // Wall number k has one of the axes as its normal, of which it is a radius away.
            let along = ray.origin - (ball.center - ball.radius);
            let on = (0..3).filter(|&k| along[k].abs() < 1e-12).count();
            assert!(on >= 1 && along.min_element() > -1e-12 && along.max_element() < 6.0 + 1e-12, "{along}");
            let normal = (3 - wall) % 3;
            assert!(along[normal].abs() < 1e-12 && ray.direction[normal] >= 0.0, "{wall} {along} {}", ray.direction);
            assert!((ray.direction.length() - 1.0).abs() < 1e-12);
        }
        let inside = inside(&all);
        assert!(inside > 0.2 && inside < 0.9, "{inside}");
    }

    #[test]
    fn distances_are_those_along_the_ray() {
        let ball = Ball { center: DVec3::ZERO, radius: 1.0 };
        let mut ray = rays(&ball, 1)[0];
        (ray.start, ray.way) = (Vec3::new(-3.0, 0.0, 0.0), Vec3::X);
        let asked = |share: f32, exact: f32| by_field(|_| share, &[ray], &[exact])[0];
        // The chord is from 2 to 4.
        assert_eq!([asked(0.0, 9.0), asked(0.25, 9.0), asked(1.0, 9.0)], [2.0, 2.5, 4.0]);
        assert_eq!(asked(-1.0, 9.0), f32::INFINITY);
        // Inside, half of the chord is behind.
        ray.start = Vec3::ZERO;
        let asked = |share: f32| by_field(|_| share, &[ray], &[9.0])[0];
        assert_eq!([asked(0.25), asked(0.75), asked(-1.0)], [9.0, 0.5, f32::INFINITY]);
        // Past the sphere, and away from it.
        ray.start = Vec3::new(-3.0, 1.5, 0.0);
        assert_eq!(by_field(|_| 0.5, &[ray], &[9.0]), [f32::INFINITY]);
        ray.start = Vec3::new(3.0, 0.0, 0.0);
        assert_eq!(by_field(|_| 0.5, &[ray], &[9.0]), [f32::INFINITY]);
    }
}
