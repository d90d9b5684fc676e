//! Which directions the maps of a frame have, and which of them stands for a ray's.
//!
//! The hemisphere about z is cut into K x K strata of equal solid angle: squares, mapped to the disc by the concentric
//! map (Shirley, Chiu 1997) and from there to the hemisphere, z = 1 - r². Each has one direction, drawn evenly. The
//! stratum of a direction follows from the inverse of the map; that part is the twin of `shaders/roma/roma.wgsl`,
//! rounded operation by operation.

use crate::math::angles::square_of_disc;
use crate::math::exact::{divide, square_root};
use crate::math::sampling::{random4, uniform_hemisphere};

/// Where in the unit square a direction of the upper hemisphere lies, |z| its height: the inverse of the concentric map
/// and of z = 1 - r². It needs no unit length.
pub fn square_of([x, y, z]: [f32; 3]) -> [f32; 2] {
    let across = x * x + y * y;
    let length = square_root(across + z * z);
    square_of_disc([x, y], square_root(divide(across, length * (length + z.abs()))))
}

/// Number of the stratum, of `k` x `k`, that a direction lies in, and whether it is in the upper hemisphere: else its
/// opposite lies in the stratum.
pub fn stratum_of(direction: [f32; 3], k: u32) -> (u32, bool) {
    let is_upper = direction[2] >= 0.0;
    let d = if is_upper { direction } else { direction.map(|x| -x) };
    let [x, y] = square_of(d).map(|s| ((s * k as f32) as u32).min(k - 1));
    (x + k * y, is_upper)
}

/// What is drawn for a map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drawn {
    /// Its direction, of about unit length, in the upper hemisphere.
    pub direction: [f32; 3],
    /// Its turn about that, a share of a full one from 0 to 1.
    pub turn: f32,
    /// By how many of its cells it is moved, each from -1/2 to 1/2.
    pub shift: [f32; 3],
}

/// What is drawn for the maps of `k` x `k` strata in sample `sample`, in the order of [`stratum_of`].
pub fn draw(k: u32, sample: u32, seed: u32) -> Vec<Drawn> {
    let unit = |word: u32| (word >> 8) as f32 / 16_777_216.0;
    let of = |map: u32| {
        let [a, b, c, _] = random4(2 * map, sample, seed).map(unit);
        let [d, e, f, _] = random4(2 * map + 1, sample, seed).map(unit);
        let square = [(map % k) as f32 + a, (map / k) as f32 + b].map(|x| x / k as f32);
        Drawn { direction: uniform_hemisphere(square), turn: c, shift: [d, e, f].map(|x| x - 0.5) }
    };
    (0..k * k).map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::sampling::hammersley;

    #[test]
    fn the_square_comes_back() {
        let mut worst = 0.0f32;
        let mut take = |square: [f32; 2]| {
            let direction = uniform_hemisphere(square);
            let scaled = direction.map(|x| 3.0 * x);
            for d in [direction, scaled, [direction[0], direction[1], -direction[2]]] {
                let back = square_of(d);
                worst = worst.max((back[0] - square[0]).abs()).max((back[1] - square[1]).abs());
            }
        };
        (0..50_000).map(|i| hammersley(i, 50_000)).for_each(&mut take);
        // Centre, diagonals, equator.
        for i in 0..=1000 {
            let x = i as f32 / 1000.0;
            [[0.5, 0.5], [x, x], [x, 1.0 - x], [x, 0.5], [0.5, x], [0.0, x], [1.0, x], [x, 0.0], [x, 1.0]]
                .into_iter()
                .for_each(&mut take);
        }
        assert!(worst <= 1e-5, "{worst}");
        assert_eq!(square_of([0.0, 0.0, 1.0]), [0.5, 0.5]);
        assert_eq!(square_of([0.0, 0.0, 1e-20]), [0.5, 0.5]);
        // Control: without the inverse of the angle's stretch it does not.
        let [x, y, _] = uniform_hemisphere([0.9, 0.7]);
        assert!((0.5 + 0.5 * x - 0.9).abs().max((0.5 + 0.5 * y - 0.7).abs()) > 0.01);
    }

    #[test]
    fn every_stratum_has_its_direction_and_equal_solid_angle() {
        for k in [4, 8] {
            for sample in 0..200 {
                for (map, drawn) in draw(k, sample, 7).iter().enumerate() {
                    let d = drawn.direction;
                    assert!((d.iter().map(|x| x * x).sum::<f32>() - 1.0).abs() < 1e-5 && d[2] >= 0.0);
                    assert!(drawn.shift.iter().all(|x| (-0.5..0.5).contains(x)) && (0.0..1.0).contains(&drawn.turn));
                    // At a border rounding may decide otherwise.
                    let inside = square_of(d).iter().all(|s| (0.001..0.999).contains(&(s * k as f32).fract()));
                    if inside {
                        assert_eq!(stratum_of(d, k), (map as u32, true));
                        assert_eq!(stratum_of(d.map(|x| -2.0 * x), k), (map as u32, false));
                    }
                }
            }
            let n = 100_000;
            let mut counts = vec![0u32; (k * k) as usize];
            for i in 0..n {
                // Evenly over the sphere.
                let [a, b] = hammersley(i, n);
                let (z, angle) = (2.0 * a - 1.0, std::f32::consts::TAU * b);
                let r = (1.0 - z * z).sqrt();
                counts[stratum_of([r * angle.cos(), r * angle.sin(), z], k).0 as usize] += 1;
            }
            let even = n as f32 / (k * k) as f32;
            assert!(counts.iter().all(|&c| (c as f32 / even - 1.0).abs() < 0.03), "{counts:?}");
        }
        assert_ne!(draw(4, 0, 0), draw(4, 1, 0));
        assert_ne!(draw(4, 0, 0), draw(4, 0, 1));
    }

    #[test]
    fn any_direction_has_a_stratum() {
        for x in [0.0, -0.0, 1.0, -1.0, 1e-30, 1e15] {
            for y in [0.0, -0.0, 1.0, -1.0, 1e-30, -1e15] {
                for z in [0.0, -0.0, 1.0, -1.0, 1e-30, -1e-30] {
                    assert!(stratum_of([x, y, z], 4).0 < 16);
                }
            }
        }
    }
}
