//! Random numbers that depend on nothing but a seed and the name of what draws them, so that every part of a scene can
//! be made, skipped or repeated alone.

/// The finaliser of splitmix64 (Steele, Lea, Flood 2014): a bijection that mixes all bits.
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// A splitmix64 stream.
#[derive(Clone, Debug)]
pub struct Rng(u64);

impl Rng {
    /// The stream of `seed` for the thing named by `key`.
    pub fn new(seed: u64, key: &[i64]) -> Self {
        let mut state = mix(seed ^ 0x9e37_79b9_7f4a_7c15);
        for &part in key {
            state = mix(state.wrapping_add(0x9e37_79b9_7f4a_7c15) ^ mix(part as u64 ^ 0xd1b5_4a32_d192_ed03));
        }
        Self(state)
    }

    /// A stream that is independent of what is drawn from this one afterwards.
    pub fn fork(&mut self) -> Self {
        Self(mix(self.bits()))
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        mix(self.0)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in [low, high).
    pub fn range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in low..=high.
    pub fn int(&mut self, low: i64, high: i64) -> i64 {
        low + (self.unit() * (high - low + 1) as f64) as i64
    }

    /// True with probability `p`.
    pub fn chance(&mut self, p: f64) -> bool {
        self.unit() < p
    }

    /// One of `items`, which must not be empty.
    pub fn pick<T: Copy>(&mut self, items: &[T]) -> T {
        items[self.int(0, items.len() as i64 - 1) as usize]
    }

    /// A direction, uniform on the sphere.
    pub fn direction(&mut self) -> glam::DVec3 {
        let y = self.range(-1.0, 1.0);
        let angle = self.range(0.0, std::f64::consts::TAU);
        let r = (1.0 - y * y).max(0.0).sqrt();
        glam::DVec3::new(r * angle.cos(), y, r * angle.sin())
    }
}

/// Smooth noise in [0, 1] over the plane: random values at whole numbers, of the thing named by `key`, and cubics
/// between.
pub fn noise(seed: u64, key: &[i64], q: glam::DVec2) -> f64 {
    let (fx, fz) = (q.x - q.x.floor(), q.y - q.y.floor());
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let corner = |dx: i64, dz: i64| {
        let mut name = key.to_vec();
        name.extend([q.x.floor() as i64 + dx, q.y.floor() as i64 + dz]);
        Rng::new(seed, &name).unit()
    };
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    mix(mix(corner(0, 0), corner(1, 0), smooth(fx)), mix(corner(0, 1), corner(1, 1), smooth(fx)), smooth(fz))
}
