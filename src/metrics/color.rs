//! The colour spaces of FLIP, for the illuminant D65 (Andersson et al. 2020, section 4 and their appendix).

/// Row-major 3x3 matrix.
type Matrix = [[f32; 3]; 3];

/// XYZ of linear sRGB primaries as exact fractions of the primaries' chromaticities.
const XYZ_FROM_RGB: Matrix = [
    [10135552.0 / 24577794.0, 8788810.0 / 24577794.0, 4435075.0 / 24577794.0],
    [2613072.0 / 12288897.0, 8788810.0 / 12288897.0, 887015.0 / 12288897.0],
    [1425312.0 / 73733382.0, 8788810.0 / 73733382.0, 70074185.0 / 73733382.0],
];
const RGB_FROM_XYZ: Matrix = [
    [3.241_003_3, -1.537_399, -0.498_615_86],
    [-0.969_224_3, 1.875_93, 0.041_554_224],
    [0.055_639_423, -0.204_011_2, 1.057_149],
];
/// XYZ of white.
const WHITE: [f32; 3] = [0.950_428_55, 1.0, 1.088_900_4];
const WHITE_RECIPROCAL: [f32; 3] = [1.052_156_9, 1.0, 0.918_357_7];

fn multiply(m: &Matrix, v: [f32; 3]) -> [f32; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Linear light of an sRGB code value in 0..=1 (IEC 61966-2-1).
pub(crate) fn linear_from_srgb(value: f64) -> f64 {
    if value <= 0.04045 { value / 12.92 } else { ((value + 0.055) / 1.055).powf(2.4) }
}

/// YCxCz of linear RGB: the linearised Lab in which FLIP filters.
pub(crate) fn ycxcz_from_rgb(rgb: [f32; 3]) -> [f32; 3] {
    let [x, y, z] = multiply(&XYZ_FROM_RGB, rgb);
    let (x, y, z) = (x * WHITE_RECIPROCAL[0], y * WHITE_RECIPROCAL[1], z * WHITE_RECIPROCAL[2]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Linear RGB of YCxCz, not clamped.
pub(crate) fn rgb_from_ycxcz([luma, cx, cz]: [f32; 3]) -> [f32; 3] {
    let y = (luma + 16.0) / 116.0;
    multiply(&RGB_FROM_XYZ, [(y + cx / 500.0) * WHITE[0], y * WHITE[1], (y - cz / 200.0) * WHITE[2]])
}

/// CIELab of linear RGB, its chroma scaled by lightness after Hunt.
pub(crate) fn hunt_lab_from_rgb(rgb: [f32; 3]) -> [f32; 3] {
    const DELTA: f32 = 6.0 / 29.0;
    let f = |t: f32| if t > DELTA * DELTA * DELTA { t.cbrt() } else { t / (3.0 * DELTA * DELTA) + 4.0 / 29.0 };
    let [x, y, z] = multiply(&XYZ_FROM_RGB, rgb);
    let (x, y, z) = (f(x * WHITE_RECIPROCAL[0]), f(y * WHITE_RECIPROCAL[1]), f(z * WHITE_RECIPROCAL[2]));
    let lightness = 116.0 * y - 16.0;
    let hunt = 0.01 * lightness;
    [lightness, hunt * (500.0 * (x - y)), hunt * (200.0 * (y - z))]
}

/// HyAB: city-block distance in lightness plus Euclidean distance in chroma.
pub(crate) fn hyab(a: [f32; 3], b: [f32; 3]) -> f32 {
    let (da, db) = (a[1] - b[1], a[2] - b[2]);
    (a[0] - b[0]).abs() + (da * da + db * db).sqrt()
}

/// Luminance of linear Rec. 709 RGB.
pub(crate) fn luminance(rgb: [f32; 3]) -> f32 {
    0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ycxcz_round_trip() {
        for rgb in [[0.0; 3], [1.0; 3], [1.0, 0.0, 0.0], [0.2, 0.7, 0.1], [0.0, 0.0, 1.0]] {
            let back = rgb_from_ycxcz(ycxcz_from_rgb(rgb));
            for c in 0..3 {
                assert!((back[c] - rgb[c]).abs() < 2e-5, "{rgb:?} {back:?}");
            }
        }
        let [y, cx, cz] = ycxcz_from_rgb([1.0; 3]);
        assert!((y - 100.0).abs() < 1e-3 && cx.abs() < 1e-3 && cz.abs() < 1e-3, "white is neutral");
        assert!(ycxcz_from_rgb([1.0, 0.0, 0.0])[1].abs() > 10.0, "red is not");
    }

    #[test]
    fn srgb_ends_and_middle() {
        assert_eq!(linear_from_srgb(0.0), 0.0);
        assert!((linear_from_srgb(1.0) - 1.0).abs() < 1e-15);
        assert!((linear_from_srgb(188.0 / 255.0) - 0.5029).abs() < 1e-4);
    }
}
