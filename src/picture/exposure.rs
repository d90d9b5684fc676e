//! Exposure: what radiance is multiplied by before the tone map.

use super::color::luminance;
use crate::settings::{Plain, Rule, Value};

/// Middle grey, which an automatic exposure brings the log-average luminance of a frame to (Reinhard et al. 2002,
/// equation 2).
const MIDDLE_GREY: f64 = 0.18;

/// Luminance counts as at least this share of the frame's mean, so that black parts do not make everything else white:
/// 8 stops below the mean.
const FLOOR: f64 = 1.0 / 256.0;

/// Seconds of the camera path in which an automatic exposure goes all but 1/e of the way to what a frame asks for.
const ADAPTATION_S: f64 = 0.5;

/// Stops that any exposure keeps within.
pub const MOST_STOPS: f64 = 32.0;

/// How exposure is chosen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Exposure {
    /// So many stops (EV): radiance is multiplied by 2 to the power of it.
    Fixed(f64),
    /// What brings the log-average luminance of the frame to middle grey; from frame to frame it adapts, by the times
    /// of the path, so that it depends on the frames alone.
    Auto,
}

impl Value for Exposure {
    const IS_SIGNED: bool = true;

    fn read(text: &str, _: Rule, _: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        f64::read(text, Rule::Real(-MOST_STOPS, MOST_STOPS), "stops, or auto").map(Self::Fixed)
    }

    fn plain(&self) -> Plain {
        match self {
            Self::Fixed(stops) => stops.plain(),
            Self::Auto => Plain::Text("auto".into()),
        }
    }
}

/// The stops that bring the log-average luminance of `radiance` to middle grey, within [`MOST_STOPS`]; `None` of a
/// picture that is all black. Pixels that are not finite do not count.
fn metered(radiance: &[[f32; 3]]) -> Option<f64> {
    let luminances = || radiance.iter().map(|&c| f64::from(luminance(c))).filter(|y| y.is_finite()).map(|y| y.max(0.0));
    let count = luminances().count() as f64;
    let mean = luminances().sum::<f64>() / count;
    // Of no pixels at all the mean is no number.
    if mean.is_nan() || mean <= 0.0 {
        return None;
    }
    let floor = mean * FLOOR;
    let average = luminances().map(|y| y.max(floor).log2()).sum::<f64>() / count;
    Some((MIDDLE_GREY.log2() - average).clamp(-MOST_STOPS, MOST_STOPS))
}

/// Gives every frame of a walk its exposure.
#[derive(Clone, Copy, Debug)]
pub struct Meter {
    exposure: Exposure,
    /// The stops of the frame before, if it was not the first and not all black.
    adapted: Option<f64>,
}

impl Meter {
    /// Before the first frame.
    pub fn new(exposure: Exposure) -> Self {
        Self { exposure, adapted: None }
    }

    /// The stops of the next frame, `seconds` of the path after the last one. The first frame has what it asks for; a
    /// frame that is all black keeps what there was, or 0.
    pub fn stops(&mut self, radiance: &[[f32; 3]], seconds: f64) -> f64 {
        let asked = match self.exposure {
            Exposure::Fixed(stops) => return stops,
            Exposure::Auto => metered(radiance),
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
        assert_eq!(read("auto"), Ok(Exposure::Auto));
        assert_eq!(read("-2.5"), Ok(Exposure::Fixed(-2.5)));
        for bad in ["", "bright", "nan", "33", "-33", "inf"] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn log_average_becomes_middle_grey() {
        // Half of it at 0.09, half at 0.36: the geometric mean is 0.18.
        let even: Vec<[f32; 3]> = (0..100).map(|i| [[0.09; 3], [0.36; 3]][i % 2]).collect();
        assert!(metered(&even).unwrap().abs() < 1e-6);
        let brighter: Vec<[f32; 3]> = even.iter().map(|c| c.map(|x| 8.0 * x)).collect();
        assert!((metered(&brighter).unwrap() + 3.0).abs() < 1e-6);
        // A colour counts by its luminance.
        assert!((metered(&[[0.0, 0.18 / 0.7152, 0.0]]).unwrap()).abs() < 1e-6);
    }

    #[test]
    fn black_parts_do_not_blow_it_up() {
        // Half black: mean 0.09, floor 0.09 / 256; the average of the logarithms of 0.18 and of that.
        let half: Vec<[f32; 3]> = (0..100).map(|i| [[0.0; 3], [0.18; 3]][i % 2]).collect();
        let truth = -0.5 * ((0.09f64 / 256.0).log2() - 0.18f64.log2());
        assert!((metered(&half).unwrap() - truth).abs() < 1e-6);
        assert_eq!(metered(&[[0.0; 3]; 4]), None);
        assert_eq!(metered(&[]), None);
        assert_eq!(metered(&[[f32::from_bits(1); 3]; 4]), Some(MOST_STOPS));
        assert!(metered(&[[f32::NAN; 3], [f32::INFINITY; 3], [0.18; 3]]).unwrap().abs() < 1e-6);
    }

    #[test]
    fn adaptation_follows_the_path() {
        let (dark, light) = (vec![[0.045f32; 3]], vec![[0.72f32; 3]]);
        let mut meter = Meter::new(Exposure::Auto);
        assert!((meter.stops(&dark, 0.1) - 2.0).abs() < 1e-6, "the first frame has what it asks for");
        assert!((meter.stops(&light, ADAPTATION_S) - (-2.0 + 4.0 / 1f64.exp())).abs() < 1e-6);
        // Twice half a step is a step.
        let mut halves = Meter::new(Exposure::Auto);
        for (picture, seconds) in [(&dark, 0.0), (&light, 0.5 * ADAPTATION_S), (&light, 0.5 * ADAPTATION_S)] {
            halves.stops(picture, seconds);
        }
        assert!((halves.adapted.unwrap() - meter.adapted.unwrap()).abs() < 1e-12);
        assert!((meter.stops(&light, 1e3) + 2.0).abs() < 1e-6);
        assert_eq!(meter.stops(&[[0.0; 3]], 1.0), meter.stops(&[[0.0; 3]], 1.0));
        assert_eq!(Meter::new(Exposure::Auto).stops(&[[0.0; 3]], 1.0), 0.0);
        assert_eq!(Meter::new(Exposure::Fixed(-1.5)).stops(&light, 1.0), -1.5);
    }
}
