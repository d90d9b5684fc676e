//! Rays as they are given, and as the device gets them.
//!
//! A ray that starts far away is first moved to where it comes near the scene. This is done in f64, of pairs where it
//! matters: origin + s direction loses the digits that the two have in common. Then f32 is as accurate as for a ray
//! that starts there.

use crate::kernels::frame::Frame;
use crate::kernels::layout;
use crate::kernels::layout::T_INFINITE;
use crate::output::npy::Ray;
use anyhow::{Error, Result, anyhow};
use bricks::Resident;
use glam::DVec3;

/// Of the scene's diagonal: how near rays that start far away are brought to its bounds.
const MARGIN: f64 = 1.0 / 64.0;

/// Of the largest coordinate of an origin: what the f64 arithmetic of a slab test cannot tell, with a wide margin.
const SLAB_ERROR: f64 = 1.0 / (1u64 << 44) as f64;

/// Most moves of an origin. The first leaves 2^-44 of its distance, and f64 has 2100 powers of two.
const MOST_MOVES: usize = 50;

/// Refuses a ray that has no direction or that is not all numbers.
///
/// # Errors
/// What is wrong with it.
#[inline]
pub fn check(ray: &Ray) -> Result<()> {
    let (origin, direction) = (DVec3::from_array(ray.origin), DVec3::from_array(ray.direction));
    let is_finite = origin.is_finite() & direction.is_finite();
    let has_interval = !(ray.t_min.is_nan() | ray.t_max.is_nan());
    if is_finite & (direction != DVec3::ZERO) & has_interval { Ok(()) } else { Err(flaw(is_finite, has_interval)) }
}

/// What is wrong with a ray.
#[cold]
fn flaw(is_finite: bool, has_interval: bool) -> Error {
    match (is_finite, has_interval) {
        (false, _) => anyhow!("origin and direction must be finite"),
        (true, false) => anyhow!("t_min and t_max must be numbers"),
        (true, true) => anyhow!("the direction has no length"),
    }
}

/// 2^`log2`, which is a normal number.
fn power(log2: i32) -> f64 {
    f64::from_bits(((log2 + 1023) as u64) << 52)
}

/// 2^`log2` in two factors, either of which f64 holds; `log2` is that of an f64 or its opposite.
fn halves(log2: i32) -> [f64; 2] {
    [power(log2 / 2), power(log2 - log2 / 2)]
}

/// The exponent of a positive number, also of a subnormal one.
fn exponent(x: f64) -> i32 {
    match (x.to_bits() >> 52) as i32 {
        0 => -1011 - x.to_bits().leading_zeros() as i32,
        biased => biased - 1023,
    }
}

/// A direction scaled by a power of two, exactly.
#[derive(Clone, Copy, Debug)]
pub struct Scaled {
    /// The direction, its largest component in 1..2.
    pub direction: DVec3,
    /// The given direction is 2^this times as long.
    log2: i32,
}

impl Scaled {
    /// Of a direction that has a length.
    #[inline]
    pub fn of(direction: [f64; 3]) -> Self {
        let largest = direction.iter().fold(0.0f64, |m, d| m.max(d.abs()));
        let log2 = exponent(largest);
        let [a, b] = halves(-log2);
        Self { direction: DVec3::from_array(direction) * a * b, log2 }
    }

    /// A distance in lengths of the scaled direction, `t` in those of the given one.
    #[inline]
    pub fn scaled(&self, t: f64) -> f64 {
        let [a, b] = self.factors();
        t * a * b
    }

    /// Two factors that do the same one after the other.
    #[inline]
    pub fn factors(&self) -> [f64; 2] {
        halves(self.log2)
    }

    /// A distance in lengths of the given direction, `t` in those of the scaled one.
    #[inline]
    pub fn given(&self, t: f64) -> f64 {
        let [a, b] = halves(-self.log2);
        t * a * b
    }
}

/// A ray from where it comes near the scene.
#[derive(Clone, Copy, Debug)]
pub struct Approach {
    /// The ray, its interval counted from its new origin.
    pub ray: Ray,
    /// The way to the new origin, in lengths of the direction; 0 if the given one is near enough.
    pub start: f64,
}

/// The room about a scene that rays are brought to.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings {
    /// The scene's bounds.
    min: DVec3,
    max: DVec3,
    /// Their diagonal.
    reach: f64,
}

impl Surroundings {
    /// Of a scene; `None` of an empty one.
    pub fn new(resident: &Resident) -> Option<Self> {
        let root = resident.top2.first()?;
        let step = f64::from(resident.objects[0].step_log2).exp2();
        let [min, max] = [root.min, root.max].map(|corner| DVec3::from_array(corner.map(|x| x as f64)) * step);
        // A scene that is one point has room about it, too.
        Some(Self { min, max, reach: (max - min).length().max(step) })
    }

    /// The corners of the room: the scene's bounds, and as much about them as their diagonal.
    #[inline(always)]
    pub fn room(&self) -> [DVec3; 2] {
        [self.min - self.reach, self.max + self.reach]
    }

    /// Whether a point is in the room.
    fn has_near(&self, p: DVec3) -> bool {
        let [min, max] = self.room();
        p.cmpge(min).all() && p.cmple(max).all()
    }

    /// `ray` from where it comes near the scene; `None` if it never does. A ray that starts in the scene's bounds, or
    /// not farther from them than their diagonal, is as it was.
    pub fn approach(&self, ray: &Ray) -> Option<Approach> {
        let &Self { min, max, reach } = self;
        if self.has_near(DVec3::from_array(ray.origin)) {
            return Some(Approach { ray: *ray, start: 0.0 });
        }
        let scaled = Scaled::of(ray.direction);
        let (mut origin, mut way) = (DVec3::from_array(ray.origin), 0.0);
        for _ in 0..MOST_MOVES {
            if self.has_near(origin) {
                break;
            }
            let margin = MARGIN * reach + SLAB_ERROR * origin.abs().max_element();
            let s = entry(origin, scaled.direction, min - margin, max + margin)?;
            if s == 0.0 {
                break;
            }
            origin = along(origin, scaled.direction, s);
            way += s;
        }
        let start = scaled.given(way);
        if !origin.is_finite() || !start.is_finite() {
            return None;
        }
        let ray = Ray {
            origin: origin.to_array(),
            t_min: ray.t_min - start,
            // An end at infinity stays there.
            t_max: ray.t_max - start,
            direction: ray.direction,
        };
        Some(Approach { ray, start })
    }
}

/// Where a ray enters a box, 0 within it; `None` if it does not.
fn entry(origin: DVec3, direction: DVec3, min: DVec3, max: DVec3) -> Option<f64> {
    let (mut near, mut far) = (0.0f64, f64::INFINITY);
    for k in 0..3 {
        if direction[k] == 0.0 {
            if origin[k] < min[k] || origin[k] > max[k] {
                return None;
            }
            continue;
        }
        let [a, b] = [min[k], max[k]].map(|bound| (bound - origin[k]) / direction[k]);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    (near <= far).then_some(near)
}

/// `origin + s direction`, rounded once but for a part in 2^100 of the origin.
fn along(origin: DVec3, direction: DVec3, s: f64) -> DVec3 {
    let one = |o: f64, d: f64| {
        // Dekker's product and Knuth's sum: rounded, and what rounding lost.
        let product = s * d;
        let product_error = s.mul_add(d, -product);
        let sum = o + product;
        let part = sum - o;
        let sum_error = (o - (sum - part)) + (product - part);
        sum + (sum_error + product_error)
    };
    DVec3::new(one(origin.x, direction.x), one(origin.y, direction.y), one(origin.z, direction.z))
}

/// A given ray as the device gets it.
pub struct DeviceRay {
    /// In the frame's device units; the direction's largest component is in 1..2.
    pub ray: layout::Ray,
    /// Length of the device's direction in the given one, both in device units: given t = device t * `t_scale`.
    pub t_scale: f64,
}

/// Rounds a ray to f32 once, in `frame`. Distances are scaled by powers of two alone.
pub fn device_ray(ray: &Ray, frame: &Frame) -> DeviceRay {
    let scaled = Scaled::of(ray.direction);
    let t_scale = scaled.given(frame.unit);
    let bound = |t: f64| {
        let t = t / t_scale;
        if t >= f64::from(T_INFINITE) { T_INFINITE } else { t as f32 }
    };
    let (t_min, t_max) = (bound(ray.t_min.max(0.0)), bound(ray.t_max));
    let origin = frame.point(DVec3::from_array(ray.origin));
    let direction = scaled.direction.as_vec3().to_array();
    // The device's range is closed and starts at 0; an empty one is t_min above t_max.
    let empty = ray.t_min > ray.t_max || t_max < 0.0;
    let (t_min, t_max) = if empty { (1.0, 0.0) } else { (t_min, t_max) };
    DeviceRay { ray: layout::Ray { origin, t_min, direction, t_max }, t_scale }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moved_origins_lie_on_the_ray() {
        // Integers of 128 bits are truth: both origin and direction have few enough digits.
        let mut state = 7u64;
        let mut random = |bits: u32| {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> (64 - bits)) as i64 - (1i64 << (bits - 1))
        };
        let mut naive_differs = 0;
        for _ in 0..10_000 {
            let (o, d, s) = (random(52), random(40), random(30));
            let truth = i128::from(o) + i128::from(s) * i128::from(d);
            let found = along(DVec3::splat(o as f64), DVec3::splat(d as f64), s as f64).x;
            assert_eq!(found, truth as f64, "{o} + {s} * {d}");
            // So that the digits cancel.
            let back = -(i128::from(s) * i128::from(d)) + i128::from(random(8));
            let from = back as f64;
            let truth = from as i128 + i128::from(s) * i128::from(d);
            assert_eq!(along(DVec3::splat(from), DVec3::splat(d as f64), s as f64).x, truth as f64);
            naive_differs += u32::from(from + s as f64 * d as f64 != truth as f64);
        }
        assert!(naive_differs > 1000, "{naive_differs}: plain f64 would do");
    }

    #[test]
    fn exponents_are_those_of_powers_and_what_lies_between() {
        for log2 in (-1074..=1023).step_by(7).chain([-1074, -1023, -1022, 0, 1023]) {
            let least = f64::from(log2).exp2();
            let most = f64::from_bits((2.0 * least).to_bits() - 1);
            assert_eq!([exponent(least), exponent(most)], [log2; 2]);
            let [a, b] = halves(log2);
            assert_eq!(a * b, least);
            let scaled = Scaled::of([0.0, -least, 0.5 * least]);
            assert_eq!(scaled.direction.y, -1.0);
            // Distances lose digits where they are subnormal.
            assert!(log2 < -1070 || scaled.given(scaled.scaled(0.75)) == 0.75);
        }
    }

    #[test]
    fn entries_of_boxes() {
        let (min, max) = (DVec3::splat(-1.0), DVec3::splat(1.0));
        assert_eq!(entry(DVec3::new(-5.0, 0.0, 0.0), DVec3::X, min, max), Some(4.0));
        assert_eq!(entry(DVec3::new(-5.0, 0.0, 0.0), -DVec3::X, min, max), None);
        assert_eq!(entry(DVec3::new(-5.0, 1.5, 0.0), DVec3::X, min, max), None);
        assert_eq!(entry(DVec3::ZERO, DVec3::new(1.0, -1.0, 0.0), min, max), Some(0.0));
        assert_eq!(entry(DVec3::new(-3.0, -3.0, 0.0), DVec3::new(1.0, 1.0, 0.0), min, max), Some(2.0));
    }
}
