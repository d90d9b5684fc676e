//! Exposure: what radiance is multiplied by before the tone map.

use super::color::luminance;
use crate::settings::{Plain, Rule, Value};

/// Middle grey, beside which an automatic exposure brings the log-average luminance of a frame (Reinhard et al. 2002,
/// equation 2).
const MIDDLE_GREY: f64 = 0.18;

/// By how many stops it is brighter: what a picture is of is brighter than all that there is.
const LIFT: f64 = 0.5;

/// The share of pixels at each end of the range that does not count: lamps, mirrored suns, cracks.
const TRIMMED: f64 = 0.05;

/// The share of pixels that may become white.
const WHITE_SHARE: f64 = 0.02;

/// Luminance counts as at least this share of the mean, so that black parts do not make everything else white: 8 stops
/// below the mean.
const FLOOR: f64 = 1.0 / 256.0;

/// Seconds of the camera path in which an automatic exposure goes all but 1/e of the way to what a frame asks for.
const ADAPTATION_S: f64 = 0.5;

/// Stops that any exposure keeps within.
pub const MOST_STOPS: f64 = 32.0;

/// Stops that an automatic exposure keeps within unless other bounds are given.
const USUAL_STOPS: f64 = 8.0;

/// How exposure is chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// So many stops (EV): radiance is multiplied by 2 to the power of it.
    Fixed(f64),
    /// What brings the log-average luminance of what a frame hits half a stop above middle grey and keeps most of it
    /// from white; from frame to frame it adapts, by the times of the path, so that it depends on the frames alone.
    Auto {
        /// Stops that it does not go below.
        least: f64,
        /// Stops that it does not go above.
        most: f64,
    },
}

impl Exposure {
    /// Automatic, within 8 stops of 0.
    pub const AUTO: Self = Self::Auto { least: -USUAL_STOPS, most: USUAL_STOPS };
}

impl Value for Exposure {
    const IS_SIGNED: bool = true;

    fn read(text: &str, _: Rule, _: &str) -> Result<Self, String> {
        let stops = |text: &str, unit: &str| f64::read(text.trim(), Rule::Real(-MOST_STOPS, MOST_STOPS), unit);
        let Some(range) = text.strip_prefix("auto") else {
            return stops(text, "stops, or auto, or auto:MIN,MAX").map(Self::Fixed);
        };
        if range.is_empty() {
            return Ok(Self::AUTO);
        }
        let ends = range.strip_prefix(':').and_then(|range| range.split_once(','));
        let (least, most) = ends.ok_or("it must be auto:MIN,MAX, as in auto:-12,12")?;
        let (least, most) = (stops(least, "stops")?, stops(most, "stops")?);
        if least <= most { Ok(Self::Auto { least, most }) } else { Err("MIN must not be above MAX".into()) }
    }

    fn plain(&self) -> Plain {
        match self {
            Self::Fixed(stops) => stops.plain(),
            Self::Auto { least, most } => Plain::Text(match *self == Self::AUTO {
                true => "auto".into(),
                false => format!("auto:{least},{most}"),
            }),
        }
    }
}

/// The stops that bring the log-average luminance of the pixels of `radiance` that count above middle grey, or less
/// where these would show more of them brighter than `white` than may be; `None` if they are all black. Where none
/// counts, all do. Pixels that are not finite do not count.
fn metered(radiance: &[[f32; 3]], counts: &[bool], white: f64) -> Option<f64> {
    let is_finite = |color: &[f32; 3]| color.iter().all(|c| c.is_finite());
    let counted: Vec<[f32; 3]> = radiance
        .iter()
        .zip(counts)
        .filter(|(color, counts)| **counts && is_finite(color))
        .map(|(color, _)| *color)
        .collect();
    let counted = match counted.is_empty() {
        true => radiance.iter().copied().filter(is_finite).collect(),
        false => counted,
    };
    let sorted = |value: fn([f32; 3]) -> f32| {
        let mut values: Vec<f32> = counted.iter().map(|&color| value(color).max(0.0)).collect();
        values.sort_unstable_by(f32::total_cmp);
        values
    };
    let luminances = sorted(luminance);
    let trimmed = (luminances.len() as f64 * TRIMMED) as usize;
    let middle = &luminances[trimmed..luminances.len() - trimmed];
    let count = middle.len() as f64;
    let mean = middle.iter().map(|&y| f64::from(y)).sum::<f64>() / count;
    // Of no pixels at all the mean is no number.
    if mean.is_nan() || mean <= 0.0 {
        return None;
    }
    let average = middle.iter().map(|&y| f64::from(y).max(mean * FLOOR).log2()).sum::<f64>() / count;
    let brightest = sorted(|color| color.into_iter().fold(0.0, f32::max));
    let bright = brightest[((brightest.len() - 1) as f64 * (1.0 - WHITE_SHARE)) as usize];
    Some((MIDDLE_GREY.log2() + LIFT - average).min((white / f64::from(bright)).log2()))
}

/// Gives every frame of a walk its exposure.
#[derive(Clone, Copy, Debug)]
pub struct Meter {
    exposure: Exposure,
    /// What pictures show as white, or just before it.
    white: f64,
    /// The stops of the frame before, if it was not the first and not all black.
    adapted: Option<f64>,
}

impl Meter {
    /// Before the first frame; pictures show `white` as white, or just before it.
    pub fn new(exposure: Exposure, white: f32) -> Self {
        Self { exposure, white: white.into(), adapted: None }
    }

    /// The stops of the next frame, `seconds` of the path after the last one; `counts` says which pixels count, all if
    /// it says nothing. The first frame has what it asks for; a frame that is all black keeps what there was, or 0.
    pub fn stops(&mut self, radiance: &[[f32; 3]], counts: &[bool], seconds: f64) -> f64 {
        let asked = match self.exposure {
            Exposure::Fixed(stops) => return stops,
            Exposure::Auto { least, most } => {
                metered(radiance, counts, self.white).map(|stops| stops.clamp(least, most))
            }
        };
        let share = 1.0 - (-seconds.max(0.0) / ADAPTATION_S).exp();
        self.adapted = match (self.adapted, asked) {
            (Some(before), Some(asked)) => Some(before + (asked - before) * share),
            (before, asked) => asked.or(before),
        };
        self.adapted.unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stops_are_read_within_their_range() {
        let read = |text: &str| Exposure::read(text, Rule::Any, "");
        assert_eq!(read("auto"), Ok(Exposure::AUTO));
        assert_eq!(read("auto:-12, 3.5"), Ok(Exposure::Auto { least: -12.0, most: 3.5 }));
        assert_eq!(read("-2.5"), Ok(Exposure::Fixed(-2.5)));
        for bad in ["", "bright", "nan", "33", "-33", "inf", "auto:", "auto:3", "auto:3,2", "auto:-33,0", "automatic"] {
            assert!(read(bad).is_err(), "{bad}");
        }
        for exposure in [Exposure::AUTO, Exposure::Auto { least: -1.0, most: 0.5 }, Exposure::Fixed(2.0)] {
            assert_eq!(read(&exposure.plain().to_string()), Ok(exposure));
        }
    }

    /// What a picture asks for where nothing becomes white, beyond the lift.
    fn of(radiance: &[[f32; 3]], counts: &[bool]) -> Option<f64> {
        metered(radiance, counts, f64::INFINITY).map(|stops| stops - LIFT)
    }

    /// The same of all of it.
    fn asked(radiance: &[[f32; 3]]) -> Option<f64> {
        of(radiance, &[])
    }

    #[test]
    fn log_average_becomes_middle_grey() {
        // Half of it at 0.09, half at 0.36: the geometric mean is 0.18.
        let even: Vec<[f32; 3]> = (0..100).map(|i| [[0.09; 3], [0.36; 3]][i % 2]).collect();
        assert!(asked(&even).unwrap().abs() < 1e-6);
        let brighter: Vec<[f32; 3]> = even.iter().map(|c| c.map(|x| 8.0 * x)).collect();
        assert!((asked(&brighter).unwrap() + 3.0).abs() < 1e-6);
        // A colour counts by its luminance.
        assert!((asked(&[[0.0, 0.18 / 0.7152, 0.0]]).unwrap()).abs() < 1e-6);
    }

    #[test]
    fn background_and_extremes_do_not_count() {
        // A tenth of a picture shows a surface, the rest a sky 6 stops brighter.
        let seen = |i: usize| i.is_multiple_of(10);
        let picture: Vec<[f32; 3]> = (0..1000).map(|i| if seen(i) { [0.18; 3] } else { [11.52; 3] }).collect();
        let counts: Vec<bool> = (0..1000).map(seen).collect();
        assert!(of(&picture, &counts).unwrap().abs() < 1e-6);
        assert!(asked(&picture).unwrap() < -5.0, "the control: all of it");
        // A picture of the sky alone is exposed for it.
        assert!((of(&[[11.52; 3]; 4], &[false; 4]).unwrap() + 6.0).abs() < 1e-6);
        // Lamps of a million in a twentieth of it.
        let lamps: Vec<[f32; 3]> = (0..100).map(|i| if i % 20 == 0 { [1e6; 3] } else { [0.18; 3] }).collect();
        assert!(asked(&lamps).unwrap().abs() < 1e-6);
    }

    #[test]
    fn most_of_what_counts_is_kept_from_white() {
        // Three in a hundred are 5 stops above middle grey, which the average hardly knows of.
        let picture: Vec<[f32; 3]> = (0..1000).map(|i| [[0.18f32; 3], [5.76, 0.0, 0.0]][usize::from(i < 30)]).collect();
        let stops = metered(&picture, &[], 1.0).unwrap();
        assert!((stops + 5.76f64.log2()).abs() < 1e-6, "{stops}");
        // One in a hundred may become white.
        let picture: Vec<[f32; 3]> = (0..1000).map(|i| [[0.18; 3], [5.76; 3]][usize::from(i < 10)]).collect();
        assert!((metered(&picture, &[], 1.0).unwrap() - LIFT).abs() < 1e-6);
    }

    #[test]
    fn black_parts_do_not_blow_it_up() {
        // Half black: mean 0.09, floor 0.09 / 256; the average of the logarithms of 0.18 and of that.
        let half: Vec<[f32; 3]> = (0..100).map(|i| [[0.0; 3], [0.18; 3]][i % 2]).collect();
        let truth = -0.5 * ((0.09f64 / 256.0).log2() - 0.18f64.log2());
        assert!((asked(&half).unwrap() - truth).abs() < 1e-6);
        assert_eq!(asked(&[[0.0; 3]; 4]), None);
        assert_eq!(asked(&[]), None);
        assert!(asked(&[[f32::NAN; 3], [f32::INFINITY; 3], [0.18; 3]]).unwrap().abs() < 1e-6);
        // Within 8 stops, unless asked for more.
        let dim = [[1e-6f32; 3]; 4];
        assert_eq!(Meter::new(Exposure::AUTO, 1.0).stops(&dim, &[], 0.0), USUAL_STOPS);
        let wide = Exposure::Auto { least: -MOST_STOPS, most: MOST_STOPS };
        assert!((Meter::new(wide, 1.0).stops(&dim, &[], 0.0) - (0.18f64 / 1e-6).log2() - LIFT).abs() < 1e-4);
    }

    #[test]
    fn adaptation_follows_the_path() {
        let (dark, light) = (vec![[0.045f32; 3]], vec![[0.72f32; 3]]);
        let auto = || Meter::new(Exposure::AUTO, 1.0);
        let mut meter = auto();
        assert!((meter.stops(&dark, &[], 0.1) - 2.0 - LIFT).abs() < 1e-6, "the first frame has what it asks for");
        assert!((meter.stops(&light, &[], ADAPTATION_S) - (-2.0 + 4.0 / 1f64.exp()) - LIFT).abs() < 1e-6);
        // Twice half a step is a step.
        let mut halves = auto();
        for (picture, seconds) in [(&dark, 0.0), (&light, 0.5 * ADAPTATION_S), (&light, 0.5 * ADAPTATION_S)] {
            halves.stops(picture, &[], seconds);
        }
        assert!((halves.adapted.unwrap() - meter.adapted.unwrap()).abs() < 1e-12);
        assert!((meter.stops(&light, &[], 1e3) + 2.0 - LIFT).abs() < 1e-6);
        assert_eq!(meter.stops(&[[0.0; 3]], &[], 1.0), meter.stops(&[[0.0; 3]], &[], 1.0));
        assert_eq!(auto().stops(&[[0.0; 3]], &[], 1.0), 0.0);
        assert_eq!(Meter::new(Exposure::Fixed(-1.5), 1.0).stops(&light, &[], 1.0), -1.5);
    }
}
