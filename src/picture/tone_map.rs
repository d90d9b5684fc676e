//! Tone maps: from scene radiance, after exposure, to what a display shows.
//!
//! All are functions of one pixel, from linear Rec. 709 to linear Rec. 709 of which a display shows 0 to 1; the sRGB
//! encoding comes after them. Components below 0 and those that are no number count as 0.

use super::color::luminance;
use crate::settings::names;

names! {
    /// A tone map.
    ToneMap {
        /// The value itself; what is above 1 is cut off where it is encoded.
        None = "none",
        /// AgX, the base look: Sobotka, github.com/sobotka/AgX; matrices and the polynomial of its curve by Wrensch,
        /// "Minimal AgX Implementation", 2023.
        AgX = "agx",
        /// Hill's fit of the ACES reference rendering and sRGB output transforms: Pettineo,
        /// github.com/TheRealMJP/BakingLab, `ACES.hlsl`.
        Aces = "aces",
        /// Reinhard, Stark, Shirley and Ferwerda, "Photographic Tone Reproduction for Digital Images", SIGGRAPH 2002,
        /// equation 4, on luminance.
        Reinhard = "reinhard",
    }
}

/// Luminance that `Reinhard` shows as white: two stops above 1.
const REINHARD_WHITE: f32 = 4.0;

/// Where components are cut off before a curve; all have saturated long before, and squares of it are finite.
const MOST: f32 = 1e12;

/// The range of AgX's curve in stops, from 10 stops below middle grey to 6.5 above it.
const AGX_STOPS: [f32; 2] = [-12.473_93, 4.026_069];

/// Rec. 709 to AgX's working primaries, in rows: each component takes a share of the others, so that bright colours go
/// to white.
const AGX_INSET: [[f32; 3]; 3] = [
    [0.842_479_06, 0.078_433_6, 0.079_223_745],
    [0.042_328_242, 0.878_468_64, 0.079_166_13],
    [0.042_375_654, 0.078_433_6, 0.879_143],
];

/// The inverse of [`AGX_INSET`].
const AGX_OUTSET: [[f32; 3]; 3] = [
    [1.196_879, -0.098_020_88, -0.099_029_74],
    [-0.052_896_85, 1.151_903_1, -0.098_961_18],
    [-0.052_971_635, -0.098_043_45, 1.151_073_7],
];

/// The polynomial of AgX's curve, the constant first; maps 0..=1 to 0..=1 of a display of exponent 2.2, to within
/// 0.006.
const AGX_CURVE: [f32; 7] = [-0.002_32, 0.119_1, 0.429_8, -6.868, 31.96, -40.14, 15.5];

/// Rec. 709 to the primaries AP1, with the desaturation of the reference rendering transform, in rows.
const ACES_INPUT: [[f32; 3]; 3] =
    [[0.597_19, 0.354_58, 0.048_23], [0.076, 0.908_34, 0.015_66], [0.028_4, 0.133_83, 0.837_77]];

/// The output transform's desaturation, and back to Rec. 709, in rows.
const ACES_OUTPUT: [[f32; 3]; 3] =
    [[1.604_75, -0.531_08, -0.073_67], [-0.102_08, 1.108_13, -0.006_05], [-0.003_27, -0.072_76, 1.076_02]];

impl ToneMap {
    /// What components may be before a picture of them is white, or one of its channels is full.
    pub fn white(self) -> f32 {
        match self {
            Self::None => 0.95,
            Self::AgX => 3.0,
            Self::Aces => 1.5,
            Self::Reinhard => 1.0,
        }
    }

    /// What a display shows of `color`; but for [`Self::None`], which leaves everything as it is, at least 0 and
    /// finite.
    pub fn apply(self, color: [f32; 3]) -> [f32; 3] {
        // A NaN is not above 0.
        let held = color.map(|x| if x > 0.0 { x.min(MOST) } else { 0.0 });
        match self {
            Self::None => color,
            Self::AgX => agx(held),
            Self::Aces => aces(held),
            Self::Reinhard => {
                let y = luminance(held);
                let scale = (1.0 + y / (REINHARD_WHITE * REINHARD_WHITE)) / (1.0 + y);
                held.map(|x| x * scale)
            }
        }
    }
}

fn multiply(rows: &[[f32; 3]; 3], v: [f32; 3]) -> [f32; 3] {
    rows.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn agx(color: [f32; 3]) -> [f32; 3] {
    let [least, most] = AGX_STOPS;
    let curve = |x: f32| {
        let at = (x.max(1e-10).log2().clamp(least, most) - least) / (most - least);
        AGX_CURVE.iter().rev().fold(0.0, |sum, coefficient| sum * at + coefficient)
    };
    multiply(&AGX_OUTSET, multiply(&AGX_INSET, color).map(curve)).map(|x| x.max(0.0).powf(2.2))
}

fn aces(color: [f32; 3]) -> [f32; 3] {
    let curve = |x: f32| (x * (x + 0.024_578_6) - 0.000_090_537) / (x * (0.983_729 * x + 0.432_951) + 0.238_081);
    multiply(&ACES_OUTPUT, multiply(&ACES_INPUT, color).map(curve)).map(|x| x.max(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Greys from the least denormal to 10^6, ascending.
    fn greys() -> Vec<f32> {
        let denormals = [1, 2, 1000, 0x007f_ffff].map(f32::from_bits);
        denormals.into_iter().chain((-1260..200).map(|i| (0.1 * i as f32).exp2())).chain([1e6]).collect()
    }

    #[test]
    fn greys_stay_grey_and_in_order() {
        for &map in ToneMap::ALL {
            let mut before = 0.0f32;
            for x in greys() {
                let [r, g, b] = map.apply([x; 3]);
                assert!(r.is_finite() && g.is_finite() && b.is_finite(), "{}: {x:e}", map.name());
                // As a display of exponent 2.2 has them. The sums of the rows differ by 1.9e-4 before AgX's curve,
                // which are
                // 2.7e-4 / 16.5 of its range at a slope of 2.5, and by 2.3e-4 after it: 0.07 steps of 1/255 together.
                let [r, g, b] = [r, g, b].map(|x| x.powf(1.0 / 2.2));
                let spread = r.max(g).max(b) - r.min(g).min(b);
                assert!(spread <= 2.8e-4, "{}: {x:e} becomes {r}, {g}, {b}", map.name());
                // A rounding of the last bits is no step back.
                assert!(g >= before * (1.0 - 1e-6) - 1e-9, "{}: {x:e} becomes {g} after {before}", map.name());
                before = before.max(g);
            }
            assert!(before >= 0.99, "{}: white is {before}", map.name());
        }
    }

    #[test]
    fn black_stays_black() {
        for &map in ToneMap::ALL {
            assert_eq!(map.apply([0.0; 3]), [0.0; 3], "{}", map.name());
            // The least of light is no step up.
            assert!(map.apply([f32::from_bits(1); 3])[1] < 1e-6, "{}", map.name());
        }
    }

    #[test]
    fn nothing_is_out_of_range() {
        let hard = [0.0, f32::from_bits(1), 1e-30, 0.18, 1.0, 1e6, 1e30, f32::MAX, f32::INFINITY, f32::NAN, -1.0];
        for map in [ToneMap::AgX, ToneMap::Aces, ToneMap::Reinhard] {
            for (r, g, b) in hard
                .iter()
                .flat_map(|&r| hard.iter().map(move |&g| (r, g)))
                .zip(hard.iter().cycle())
                .map(|((r, g), &b)| (r, g, b))
            {
                let mapped = map.apply([r, g, b]);
                assert!(mapped.iter().all(|x| x.is_finite() && *x >= 0.0), "{}: {r} {g} {b}: {mapped:?}", map.name());
            }
        }
    }

    #[test]
    fn white_is_not_yet_full() {
        let colors =
            [[1.0, 1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.9, 0.6], [0.4, 0.6, 1.0]];
        for &map in ToneMap::ALL {
            let white = map.white();
            for color in colors {
                let shown = map.apply(color.map(|c| c * white));
                // Full is 254 of 255 in sRGB.
                assert!(shown.iter().all(|c| *c < 0.99), "{}: {color:?} becomes {shown:?}", map.name());
            }
            assert!(map.apply([white; 3])[1] > 0.45, "{}: it could be brighter", map.name());
        }
    }

    #[test]
    fn known_values() {
        // AgX brings middle grey to half of a display of exponent 2.2 (its pivot), to within the polynomial's error.
        let grey = ToneMap::AgX.apply([0.18; 3])[1].powf(1.0 / 2.2);
        assert!((grey - 0.5).abs() < 0.006, "{grey}");
        // Hill's curve on 1 by hand: (1.0245786 - 0.000090537) / (0.983729 + 0.432951 + 0.238081).
        let white = ToneMap::Aces.apply([1.0; 3])[1];
        assert!((white - 0.619_11).abs() < 1e-4, "{white}");
        // Equation 4: the white point becomes 1, 1 becomes (1 + 1/16) / 2.
        assert!((ToneMap::Reinhard.apply([REINHARD_WHITE; 3])[0] - 1.0).abs() < 1e-6);
        assert!((ToneMap::Reinhard.apply([1.0; 3])[2] - 0.531_25).abs() < 1e-6);
        assert_eq!(ToneMap::None.apply([-1.0, 7.0, 0.25]), [-1.0, 7.0, 0.25]);
        // The control: without its inverse matrix AgX would show red as something less.
        let red = ToneMap::AgX.apply([0.5, 0.0, 0.0]);
        assert!(red[0] > 10.0 * red[1], "{red:?}");
    }
}
