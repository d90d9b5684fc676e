//! Linear values as sRGB bytes (IEC 61966-2-1).

use rayon::prelude::*;
use std::sync::LazyLock;

/// The sRGB value, 0 to 255, of a linear value, by the standard's formula: clamped to 0..=1, rounded to nearest; NaN is
/// black.
fn by_formula(linear: f32) -> u8 {
    let x = f64::from(linear).clamp(0.0, 1.0);
    let encoded = if x <= 0.0031308 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
    // A NaN survives the clamp and becomes 0 in the cast.
    (encoded * 255.0 + 0.5) as u8
}

/// At `k` the least linear value that becomes `k`, 1 to 255; at 0 what no value is below.
static THRESHOLDS: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|k| {
        if k == 0 {
            return f32::NEG_INFINITY;
        }
        // Positive floats are ordered as their bits, and the formula is monotonic: 0 is too little, 1 is enough.
        let (mut too_little, mut enough) = (0, 1f32.to_bits());
        while too_little + 1 < enough {
            let middle = too_little + (enough - too_little) / 2;
            if usize::from(by_formula(f32::from_bits(middle))) >= k {
                enough = middle;
            } else {
                too_little = middle;
            }
        }
        f32::from_bits(enough)
    })
});

/// Cells of an octave of linear values: no two thresholds lie in one.
const CELLS: u32 = 256;
/// Bits of a value below its cell.
const BELOW: u32 = 23 - CELLS.ilog2();
/// The least value of the first cell, before the first threshold: 2^-13.
const FIRST: u32 = (127 - 13) << 23;

/// Of each cell up to 1 how many thresholds a value passes before it.
static PASSED: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let thresholds = &*THRESHOLDS;
    let cells = (FIRST >> BELOW..1f32.to_bits() >> BELOW).map(|cell| f32::from_bits(cell << BELOW));
    cells.map(|least| (1..256).filter(|&k| least >= thresholds[k]).count() as u8).collect()
});

fn by_table(thresholds: &[f32; 256], passed: &[u8], linear: f32) -> u8 {
    if linear >= 1.0 {
        return 255;
    }
    // Negative values and what is no number lie before the first cell, too.
    let within = if linear > 0.0 { linear.to_bits().saturating_sub(FIRST) } else { 0 };
    let before = passed[(within >> BELOW) as usize];
    let passes_next = thresholds.get(usize::from(before) + 1).is_some_and(|&next| linear >= next);
    before + u8::from(passes_next)
}

/// The sRGB value, 0 to 255, of a linear value: clamped to 0..=1, rounded to nearest; NaN is black.
pub fn srgb8(linear: f32) -> u8 {
    by_table(&THRESHOLDS, &PASSED, linear)
}

/// [`srgb8`] of whole pixels.
pub fn pixels(linear: &[[f32; 3]]) -> Vec<[u8; 3]> {
    let (thresholds, passed) = (&*THRESHOLDS, &PASSED[..]);
    let byte = |x: f32| by_table(thresholds, passed, x);
    let bytes = |&[r, g, b]: &[f32; 3]| [byte(r), byte(g), byte(b)];
    linear.par_iter().with_min_len(4096).map(bytes).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_matches_the_standard() {
        for (linear, srgb) in [
            (0.0, 0),
            (1.0, 255),
            (0.5, 188),
            (0.18, 118),
            (0.0031308, 10),
            (-1.0, 0),
            (7.0, 255),
            (f32::NAN, 0),
            (f32::INFINITY, 255),
            (f32::NEG_INFINITY, 0),
        ] {
            assert_eq!(srgb8(linear), srgb, "{linear}");
        }
        // Decoding each byte and encoding it again is the identity.
        for byte in 0..=255u8 {
            let e = f64::from(byte) / 255.0;
            let linear = if e <= 0.04045 { e / 12.92 } else { ((e + 0.055) / 1.055).powf(2.4) };
            assert_eq!(srgb8(linear as f32), byte);
        }
    }

    #[test]
    fn the_table_gives_the_formulas_bytes() {
        // Between two thresholds a monotonic formula gives one byte, so that their neighbours decide.
        for k in 1..256 {
            let least = THRESHOLDS[k].to_bits();
            for bits in least - 100..=least + 100 {
                let x = f32::from_bits(bits);
                assert_eq!(srgb8(x), by_formula(x), "{x:e} at {k}");
            }
            assert_eq!((usize::from(srgb8(THRESHOLDS[k])), usize::from(srgb8(THRESHOLDS[k].next_down()))), (k, k - 1));
        }
        // That it is monotonic: every 1009th float up to 1, and denormals.
        for bits in (0..=1f32.to_bits()).step_by(1009) {
            let x = f32::from_bits(bits);
            assert_eq!(srgb8(x), by_formula(x), "{x:e}");
        }
        assert_eq!((srgb8(f32::from_bits(1)), srgb8(-0.0), srgb8(f32::MAX)), (0, 0, 255));
        assert_eq!(pixels(&[[0.0, 0.5, 1.0], [f32::NAN, 0.18, 2.0]]), [[0, 188, 255], [0, 118, 255]]);
    }
}
