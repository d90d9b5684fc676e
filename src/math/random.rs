//! Random numbers of fixed cases: of the probe, and of tests.

/// SplitMix64 (Steele, Lea, Flood 2014).
pub struct Rng(pub u64);

impl Rng {
    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number below `n`.
    pub fn below(&mut self, n: u64) -> u64 {
        self.bits() % n
    }

    /// A number in [-1, 1), a multiple of 2^-23.
    pub fn signed(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / 8_388_608.0 - 1.0
    }

    /// A normal number with an unbiased exponent in `low..=high`, its significand random, sparse or dense.
    pub fn float(&mut self, low: i32, high: i32) -> f32 {
        let exponent = (low + 127) as u32 + self.below((high - low + 1) as u64) as u32;
        let r = self.bits() as u32;
        let significand = match r >> 30 {
            0 => 1 << (r % 23),
            1 => 0x7f_ffff ^ (1 << (r % 23)),
            _ => r & 0x7f_ffff,
        };
        f32::from_bits((self.bits() as u32 & 1 << 31) | exponent << 23 | significand)
    }
}
