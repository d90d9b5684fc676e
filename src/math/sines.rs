//! Sines and cosines of several angles at once.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2};

/// Adding it rounds a number of less than 2⁵⁰ to an integer, which the low bits then hold.
const ROUNDING: f64 = 6_755_399_441_055_744.0;

/// Of x³, x⁵ and x⁷: the sine of at most π / 4 within 2⁻²⁸ (Arm, optimized routines, `sincosf`).
const SINE: [f64; 3] = [-0.166_666_549_437_010_84, 0.008_332_178_146_138_854, -0.000_195_172_989_813_857_25];

/// Of 1, x², x⁴, x⁶ and x⁸: the cosine, as well.
const COSINE: [f64; 5] =
    [1.0, -0.499_999_997_251_082_24, 0.041_666_623_324_344_516, -0.001_388_676_379_437_604, 2.439_045_070_356_454_2e-5];

/// The sines and the cosines of angles of up to some thousand turns, in radians, within 0.56 of the last bit.
#[inline(always)]
pub fn sin_cos<const N: usize>(angles: [f32; N]) -> [[f32; N]; 2] {
    let mut both = [[0.0; N]; 2];
    for k in 0..N {
        let angle = f64::from(angles[k]);
        let rounded = angle * FRAC_2_PI + ROUNDING;
        let x = angle - (rounded - ROUNDING) * FRAC_PI_2;
        let quarter = rounded.to_bits();
        let y = x * x;
        let odd = x + x * y * (SINE[0] + y * (SINE[1] + y * SINE[2]));
        let even = COSINE[0] + y * (COSINE[1] + y * (COSINE[2] + y * (COSINE[3] + y * COSINE[4])));
        let (sine, cosine) = if quarter & 1 == 0 { (odd, even) } else { (even, odd) };
        let signed = |value: f64, quarter: u64| f64::from_bits(value.to_bits() ^ (quarter & 2) << 62) as f32;
        both[0][k] = signed(sine, quarter);
        both[1][k] = signed(cosine, quarter.wrapping_add(1));
    }
    both
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_are_within_three_fifths_of_the_last_bit() {
        let mut worst = 0.0f64;
        for i in 0..2_000_000u32 {
            // Every exponent up to some turns, and evenly over two turns.
            let of_bits = f32::from_bits(((i % 2) << 31) + i / 2 * 1097);
            let angle = if of_bits.abs() < 7.0 && i % 3 == 0 { of_bits } else { i as f32 * 6.3e-6 - 6.3 };
            let [[sine], [cosine]] = sin_cos([angle]);
            for (found, exact) in [(sine, f64::from(angle).sin()), (cosine, f64::from(angle).cos())] {
                let bit = f64::from((exact as f32).next_up()) - f64::from(exact as f32);
                worst = worst.max((f64::from(found) - exact).abs() / bit.abs());
            }
        }
        assert!(worst < 0.6, "{worst}");
        assert_eq!(sin_cos([0.0]), [[0.0], [1.0]]);
        assert!(sin_cos([f32::NAN])[0][0].is_nan());
    }

    #[test]
    fn many_are_as_one() {
        let angles: [f32; 8] = std::array::from_fn(|k| k as f32 - 3.7);
        let [sines, cosines] = sin_cos(angles);
        for (k, angle) in angles.into_iter().enumerate() {
            assert_eq!(sin_cos([angle]), [[sines[k]], [cosines[k]]]);
        }
    }
}
