//! The shape and the colours of the land: a pond in a valley, mountains around it.
//!
//! Sums of smooth noise whose octaves fade where the land is already steep, which leaves valleys smooth and crests
//! rough as erosion does (I. Quilez, "Value noise derivatives", 2008), and ridges for crests (Musgrave, in Ebert et
//! al., "Texturing and Modeling", 3rd ed., ch. 16).

use crate::material::Tint;
use glam::{DVec2, DVec3};

/// Height of the pond's water, metres.
pub const WATER: f64 = -0.35;

/// The land of one seed.
#[derive(Clone, Copy, Debug)]
pub struct Land {
    seed: u64,
}

/// Value noise in [0, 1] and its gradient: a random value at every whole point, quintics between.
fn noise(seed: u64, p: DVec2) -> (f64, DVec2) {
    let (i, f) = (p.floor(), p - p.floor());
    let value = |dx: i64, dz: i64| {
        let (x, z) = ((i.x as i64 + dx) as u64, (i.y as i64 + dz) as u64);
        let mut h = seed ^ x.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ z.wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
        h = (h ^ (h >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h = (h ^ (h >> 32)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (h >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    };
    let ease = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let slope = 30.0 * f * f * (f * (f - 2.0) + 1.0);
    let (a, b, c, d) = (value(0, 0), value(1, 0), value(0, 1), value(1, 1));
    let (x, z, xz) = (b - a, c - a, a - b - c + d);
    let n = a + x * ease.x + z * ease.y + xz * ease.x * ease.y;
    (n, slope * DVec2::new(x + xz * ease.y, z + xz * ease.x))
}

fn smoothstep(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The rotation by the angle whose cosine is 0.8, so that octaves do not line up.
fn turned(p: DVec2) -> DVec2 {
    DVec2::new(0.8 * p.x - 0.6 * p.y, 0.6 * p.x + 0.8 * p.y)
}

impl Land {
    /// The land of `seed`.
    pub fn new(seed: u64) -> Self {
        Self { seed: seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ 0x7465_7272_6169_6e21 }
    }

    /// Smooth noise in [0, 1] whose waves are about `size` metres long; `layer` tells one from another.
    pub fn smooth(&self, layer: u64, p: DVec2, size: f64) -> f64 {
        noise(self.seed ^ layer.wrapping_mul(0x5851_f42d_4c95_7f2d), p / size).0
    }

    /// Height at (x, z).
    pub fn height(&self, p: DVec2) -> f64 {
        // Bent, so that ridges are no grid.
        let bend = DVec2::new(self.smooth(1, p, 190.0), self.smooth(2, p, 190.0)) - 0.5;
        let q = p + 70.0 * bend;
        let r = p.length();
        let far = 105.0 * smoothstep(30.0, 150.0, r) + 330.0 * smoothstep(170.0, 1900.0, r);
        let mut sum = 0.0;
        if far > 0.0 {
            let (mut at, mut weight, mut slope) = (turned(q) / 230.0, 0.55, DVec2::ZERO);
            for octave in 0..9 {
                let (n, d) = noise(self.seed.wrapping_add(octave), at);
                slope += d * if octave == 0 { 0.8 } else { 1.0 };
                sum += weight * n / (1.0 + slope.length_squared());
                weight *= 0.5;
                at = turned(at) * 2.0;
            }
            let (mut at, mut weight, mut crest) = (q / 330.0, 0.42, 1.0);
            for octave in 20..25 {
                let n = 1.0 - (2.0 * noise(self.seed.wrapping_add(octave), at).0 - 1.0).abs();
                crest = (n * n * crest * 1.6).min(1.0);
                sum += weight * crest * n;
                weight *= 0.46;
                at = turned(at) * 2.1;
            }
        }
        // The valley: low waves, and the hollow of the pond.
        let waves = 1.6 * (self.smooth(3, p, 23.0) - 0.5) + 0.5 * (self.smooth(4, p, 7.0) - 0.5);
        let detail = 0.09 * (self.smooth(5, p, 2.3) - 0.5) + 0.05 * (self.smooth(6, p, 1.1) - 0.5);
        let shore = r + 5.0 * (self.smooth(7, p, 11.0) - 0.5);
        let hollow = -2.6 * (1.0 - smoothstep(7.0, 19.0, shore));
        far * sum + waves * smoothstep(9.0, 24.0, r) + detail + hollow + 0.8
    }

    /// Unit normal at (x, z), from heights `step` metres apart.
    pub fn normal(&self, p: DVec2, step: f64) -> DVec3 {
        let h = |x: f64, z: f64| self.height(p + DVec2::new(x, z));
        DVec3::new(h(-step, 0.0) - h(step, 0.0), 2.0 * step, h(0.0, -step) - h(0.0, step)).normalize()
    }

    /// How much snow lies at a point with this height and normal, 0 to 1.
    pub fn snow(&self, p: DVec3, normal: DVec3) -> f64 {
        let line = 74.0 + 26.0 * (self.smooth(8, DVec2::new(p.x, p.z), 60.0) - 0.5);
        smoothstep(line - 9.0, line + 9.0, p.y) * smoothstep(0.55, 0.75, normal.y)
    }

    /// How much of the ground is rock, 0 to 1.
    pub fn rock(&self, p: DVec3, normal: DVec3) -> f64 {
        let rough = 0.1 * (self.smooth(9, DVec2::new(p.x, p.z), 4.0) - 0.5);
        let high = 0.12 * smoothstep(30.0, 75.0, p.y);
        smoothstep(0.84 + high, 0.7 + high, normal.y + rough)
    }

    /// The colour of the ground, linear.
    pub fn color(&self, p: DVec3, normal: DVec3) -> Tint {
        let q = DVec2::new(p.x, p.z);
        let mix = |a: DVec3, b: DVec3, t: f64| a + (b - a) * t.clamp(0.0, 1.0);
        let (patch, fine) = (self.smooth(10, q, 17.0), self.smooth(11, q, 1.7));
        let dry = DVec3::new(0.19, 0.17, 0.065);
        let fresh = DVec3::new(0.075, 0.135, 0.03);
        let mut c = mix(fresh, dry, 0.75 * patch + smoothstep(10.0, 70.0, p.y) * 0.6);
        // Soil shows through in spots, and under the trees.
        let bare = self.smooth(12, q, 4.0) + 0.35 * (fine - 0.5);
        c = mix(c, DVec3::new(0.11, 0.08, 0.05), 0.7 * smoothstep(0.7, 0.85, bare));
        c *= 0.6 + 0.55 * fine + 0.35 * self.smooth(14, q, 0.8);
        let layers = self.smooth(13, DVec2::new(p.y * 0.5 + 0.06 * p.x, 0.1 * p.z), 1.0);
        let stone = mix(DVec3::new(0.16, 0.145, 0.13), DVec3::new(0.36, 0.335, 0.3), layers) * (0.7 + 0.5 * fine);
        c = mix(c, stone, self.rock(p, normal));
        let sand = DVec3::new(0.34, 0.28, 0.18) * (0.8 + 0.3 * fine);
        c = mix(c, sand, smoothstep(WATER + 0.75, WATER + 0.25, p.y + 0.3 * (patch - 0.5)));
        c = mix(c, DVec3::new(0.05, 0.06, 0.045), smoothstep(WATER - 0.1, WATER - 1.2, p.y));
        c = mix(c, DVec3::new(0.86, 0.89, 0.94), self.snow(p, normal));
        [c.x, c.y, c.z].map(|v| v.clamp(0.0, 1.0) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_gradient_of_noise_is_its_slope() {
        // Central differences err by h²/6 of the third derivative (below 200) and by rounding of 1e-16/h.
        let h = 1e-4;
        let mut steepest: f64 = 0.0;
        for k in 0..200 {
            let p = DVec2::new(0.37 * f64::from(k) - 31.0, 17.0 - 0.73 * f64::from(k));
            let (n, slope) = noise(5, p);
            assert!((0.0..=1.0).contains(&n));
            let along = |d: DVec2| (noise(5, p + d * h).0 - noise(5, p - d * h).0) / (2.0 * h);
            let measured = DVec2::new(along(DVec2::X), along(DVec2::Y));
            assert!((measured - slope).length() < 1e-6, "{measured} for {slope} at {p}");
            steepest = steepest.max(slope.length());
        }
        assert!(steepest > 0.5, "flat noise proves nothing");
    }

    #[test]
    fn there_is_a_pond_a_dry_way_around_it_and_mountains() {
        for seed in 0..8 {
            let land = Land::new(seed);
            assert!(land.height(DVec2::ZERO) < WATER - 0.5);
            for k in 0..300 {
                let p = super::super::way::way(f64::from(k) * 0.5);
                assert!(land.height(p) > WATER + 0.1, "seed {seed}: the way at {p} is under water");
            }
            let heights: Vec<f64> =
                (0..64).map(|k| land.height(DVec2::from_angle(f64::from(k) * 0.0982) * 600.0)).collect();
            let (low, high) = heights.iter().fold((f64::MAX, f64::MIN), |(a, b), h| (a.min(*h), b.max(*h)));
            assert!(low > -5.0 && high > 80.0 && high < 500.0, "seed {seed}: {low} to {high}");
        }
    }
}
