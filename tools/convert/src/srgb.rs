//! Bytes of sRGB, and the linear values that they stand for.

use std::sync::LazyLock;

static LINEAR_OF_SRGB: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let x = i as f64 / 255.0;
        (if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }) as f32
    })
});

/// The linear value of one of sRGB.
pub(crate) fn linear_of_srgb(value: u8) -> f32 {
    LINEAR_OF_SRGB[value as usize]
}

/// Linear values from which on the sRGB value is at least i + 1.
static SRGB_BORDERS: LazyLock<[f32; 255]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let x = (i as f64 + 0.5) / 255.0;
        (if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }) as f32
    })
});

/// Sections of the linear range, for finding borders fast.
const SECTIONS: usize = 1024;

/// Borders at or below the start of each section.
static FIRST_BORDER: LazyLock<[u8; SECTIONS + 1]> = LazyLock::new(|| {
    std::array::from_fn(|section| {
        let start = section as f32 / SECTIONS as f32;
        SRGB_BORDERS.partition_point(|&border| border <= start) as u8
    })
});

/// The nearest sRGB value of a linear one.
pub(crate) fn srgb(linear: f32) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let mut value = FIRST_BORDER[(linear * SECTIONS as f32) as usize];
    while value < 255 && SRGB_BORDERS[value as usize] <= linear {
        value += 1;
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_is_nearest() {
        for i in 0..=255u8 {
            assert_eq!(srgb(LINEAR_OF_SRGB[i as usize]), i);
        }
        for i in 0..=10_000 {
            let x = i as f32 / 10_000.0;
            let y = f64::from(x);
            let exact = 255.0 * if y <= 0.0031308 { y * 12.92 } else { 1.055 * y.powf(1.0 / 2.4) - 0.055 };
            assert!((f64::from(srgb(x)) - exact).abs() <= 0.501, "{x}");
        }
    }
}
