//! What frames are expected to take: rates times counts. No clock is asked, so that pictures depend on counts alone.

use super::candidates::Candidate;
use super::rates::{MethodRate, Rates};
use crate::counters::Record;
use crate::settings::ErrorLimit;

/// A method is taken where it is expected to take less than this share of what exact rays do.
const PAYS: f64 = 0.9;
/// Share of what the frames of a block take exactly that measuring errors may take, and of what all frames of a walk
/// take that making what turns out to err may take.
const SHARE: f64 = 0.04;
/// Errors of a frame must be below this share of what is allowed, as those of the frames after it may be larger.
pub const MARGIN: f64 = 0.75;

/// What a frame has of the rays of an effect.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Counts {
    /// Rays of it.
    pub rays: f64,
    /// Samples a pixel.
    pub samples: f64,
    /// Bytes that they need beyond what the cache holds.
    pub missing: f64,
}

/// What passes of a frame count for an effect: its own, and those of the hits of its rays.
pub fn is_of(pass: &str, effect: &str) -> bool {
    pass.strip_prefix(effect).is_some_and(|rest| rest.is_empty() || rest.starts_with('-'))
}

impl Counts {
    /// Those of an effect in a frame's `records`; a brick is as large as they are on the mean.
    pub fn of(effect: &str, records: &[Record], samples: u32, brick_bytes: f64) -> Self {
        let own: Vec<&Record> = records.iter().filter(|record| is_of(record.pass, effect)).collect();
        let rays = own.iter().filter(|record| record.pass == effect).map(|record| record.rays()).sum::<u64>();
        let needed = own.iter().map(|record| record.bricks_needed.count()).max().unwrap_or(0) as f64 * brick_bytes;
        let cache = own.first().map_or(0, |record| record.cache_bytes) as f64;
        Self { rays: rays as f64, samples: samples.into(), missing: (needed - cache).max(0.0) }
    }

    /// The most that a picture can have: every camera ray hits, and all bytes that the cache cannot hold are `missing`.
    pub fn most(pixels: f64, rays: u32, samples: u32, missing: f64) -> Self {
        Self { rays: pixels * f64::from(rays) * f64::from(samples), samples: samples.into(), missing }
    }
}

/// Seconds that the exact rays of an effect take, where that is known.
pub fn exact_seconds(rates: &Rates, effect: &str, counts: &Counts) -> Option<f64> {
    let loads = if counts.missing > 0.0 { counts.missing * rates.byte } else { 0.0 };
    rates.exact.get(effect).map(|seconds| seconds * counts.rays + loads)
}

/// Seconds a frame that a method takes in place of them, without what comes before the first.
pub fn method_seconds(rates: &Rates, rate: &MethodRate, candidate: &Candidate, counts: &Counts) -> f64 {
    let loads = if candidate.traces && counts.missing > 0.0 { counts.missing * rates.byte } else { 0.0 };
    rate.sample * counts.samples + rate.ray * counts.rays + loads
}

/// A method that is expected to pay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offer {
    /// It.
    pub candidate: &'static Candidate,
    /// Seconds a frame.
    pub seconds: f64,
    /// Seconds before the first.
    pub making: f64,
    /// All of it, over what exact rays take.
    pub share: f64,
}

/// The methods that pay for an effect, the fastest first; where there are none, why.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Offers {
    /// Those that pay.
    pub paying: Vec<Offer>,
    /// Why there are none.
    pub why: String,
}

/// What frames take exactly, and how much of that may be spent on what comes to nothing, should a method err too much.
#[derive(Clone, Copy, Debug)]
pub struct Means {
    /// Seconds of the camera rays of a frame, with which errors are measured.
    pub primary: f64,
    /// Seconds that FLIP of a frame takes, where that is the measure.
    pub flip: f64,
    /// Seconds that may go to errors.
    pub errors: f64,
    /// Seconds that may go to what comes before the first frame of a method.
    pub making: f64,
}

impl Means {
    /// Of a block of `length` frames in a walk of `frames`, of which one takes `exact` seconds.
    pub fn of(rates: &Rates, limit: ErrorLimit, pixels: f64, samples: u32) -> impl Fn(f64, u32, u32) -> Self {
        let primary = rates.primary * pixels * f64::from(samples);
        let flip = if matches!(limit, ErrorLimit::Flip(_)) { rates.flip * pixels } else { 0.0 };
        move |exact, length, frames| {
            let share = SHARE * (primary + exact);
            Self { primary, flip, errors: share * f64::from(length), making: share * f64::from(frames) }
        }
    }

    /// Seconds in which the errors of methods are measured together.
    pub fn measuring<'a>(&self, offers: impl IntoIterator<Item = &'a Offer>) -> f64 {
        self.primary + offers.into_iter().map(|offer| offer.seconds + self.flip).sum::<f64>()
    }

    /// Why a method cannot be tried; nothing where it can.
    pub fn forbid(&self, offer: &Offer) -> Option<String> {
        let (name, few) = (offer.candidate.name, "there are too few frames to");
        if self.measuring([offer]) > self.errors {
            return Some(format!("{few} measure the error of {name}"));
        }
        (offer.making > self.making).then(|| format!("{few} make {name}"))
    }
}

/// What pays for the rays of an effect over `frames` frames.
pub fn offers(
    rates: &Rates,
    effect: &str,
    counts: &Counts,
    candidates: &[&'static Candidate],
    limit: ErrorLimit,
    frames: u32,
) -> Offers {
    let none = |why: &str| Offers { paying: Vec::new(), why: why.into() };
    let exact = match exact_seconds(rates, effect, counts) {
        Some(seconds) if counts.rays > 0.0 => seconds,
        Some(_) => return none("there are no such rays"),
        None => return none("there are no rates of its rays"),
    };
    let rated = |&candidate: &&'static Candidate| Some((candidate, rates.method(effect, candidate.name)?));
    let known = candidates.iter().filter_map(rated);
    let known: Vec<(&'static Candidate, &MethodRate)> = known.collect();
    if known.is_empty() {
        return none("there are no rates of a method");
    }
    // What errs by more wherever it was measured is not tried.
    let allowed = known.into_iter().filter(|(_, rate)| limit.of(rate.percent[0], rate.flip_error[0]) <= limit.value());
    let offer = |(candidate, rate): (&'static Candidate, &MethodRate)| {
        let seconds = method_seconds(rates, rate, candidate, counts);
        let share = match (seconds.is_infinite(), exact.is_infinite()) {
            (true, _) => 1.0,
            (false, true) => 0.0,
            (false, false) => (seconds + rate.making / f64::from(frames.max(1))) / exact,
        };
        Offer { candidate, seconds, making: rate.making, share }
    };
    let mut all: Vec<Offer> = allowed.map(offer).collect();
    all.sort_by(|a, b| a.share.total_cmp(&b.share).then(a.candidate.name.cmp(b.candidate.name)));
    let why = match all.first() {
        None => format!("every method errs by more than {limit} here"),
        Some(best) if best.share < PAYS => String::new(),
        Some(best) => format!("{} would take {:.2} times as long", best.candidate.name, best.share),
    };
    all.retain(|offer| offer.share < PAYS);
    Offers { paying: all, why }
}

#[cfg(test)]
mod tests {
    use super::super::candidates::CANDIDATES;
    use super::*;

    fn rates(sample: f64, ray: f64) -> Rates {
        let method = |name: &str, ray| MethodRate {
            effect: "ao".into(),
            name: name.into(),
            making: 0.0,
            sample,
            ray,
            percent: [4.0, 9.0],
            flip_error: [0.02, 0.06],
        };
        let methods = vec![method("roma, 32 cells", ray), method("roma, 64 cells", 0.5 * ray)];
        Rates { byte: 1e-9, exact: [("ao".to_owned(), 1e-6)].into(), methods, ..Rates::default() }
    }

    fn of_ao() -> Vec<&'static Candidate> {
        CANDIDATES.iter().filter(|candidate| candidate.effect == "ao").collect()
    }

    fn of(rates: &Rates, rays: f64, limit: ErrorLimit) -> Offers {
        let counts = Counts { rays, samples: 1.0, missing: 0.0 };
        offers(rates, "ao", &counts, &of_ao(), limit, 32)
    }

    #[test]
    fn what_pays_depends_on_how_many_rays_there_are() {
        let rates = rates(0.1, 0.4e-6);
        let many = of(&rates, 1e6, ErrorLimit::Percent(5.0));
        // 0.1 s of maps and 0.2 s or 0.4 s of rays, where exact rays take 1 s.
        assert_eq!(many.paying[0].candidate.name, "roma, 64 cells");
        assert!((many.paying[0].share - 0.3).abs() < 1e-9 && (many.paying[1].share - 0.5).abs() < 1e-9);
        let few = of(&rates, 1e5, ErrorLimit::Percent(5.0));
        assert!(few.paying.is_empty() && few.why.contains("roma, 64 cells would take 1.20"), "{few:?}");
    }

    #[test]
    fn what_errs_by_more_is_not_tried() {
        let rates = rates(0.0, 0.1e-6);
        assert_eq!(of(&rates, 1e6, ErrorLimit::Percent(4.5)).paying.len(), 2);
        let strict = of(&rates, 1e6, ErrorLimit::Percent(2.0));
        assert!(strict.paying.is_empty() && strict.why.contains("more than 2%"), "{strict:?}");
        assert_eq!(of(&rates, 1e6, ErrorLimit::Flip(0.05)).paying.len(), 2);
        assert!(of(&rates, 1e6, ErrorLimit::Flip(0.01)).paying.is_empty());
    }

    #[test]
    fn loads_count_for_what_traces() {
        let rates = rates(0.5, 0.4e-6);
        let counts = Counts { rays: 1e6, samples: 1.0, missing: 2e9 };
        let all = offers(&rates, "ao", &counts, &of_ao(), ErrorLimit::Percent(5.0), 32);
        // 1 s of rays and 2 s of loads; maps load nothing.
        assert!((all.paying[0].share - 0.7 / 3.0).abs() < 1e-9, "{all:?}");
        let most =
            offers(&rates, "ao", &Counts::most(1.0, 1, 1, f64::INFINITY), &of_ao(), ErrorLimit::Percent(5.0), 32);
        assert_eq!(most.paying.len(), 2);
    }

    #[test]
    fn what_takes_more_than_its_share_is_not_tried() {
        let rates = rates(0.1, 0.4e-6);
        let best = of(&rates, 1e6, ErrorLimit::Percent(5.0)).paying[0];
        // A frame takes 1 s exactly, of which no camera rays; to measure the error takes 0.3 s.
        let means = Means::of(&rates, ErrorLimit::Percent(5.0), 1e6, 1);
        let why = |making, length, frames| means(1.0, length, frames).forbid(&Offer { making, ..best });
        assert_eq!(why(0.0, 8, 8), None);
        assert!(why(0.0, 7, 7).is_some_and(|why| why.contains("measure the error of roma, 64 cells")));
        assert_eq!(why(1.2, 32, 32), None);
        assert!(why(1.3, 32, 32).is_some_and(|why| why.contains("make roma, 64 cells")));
        assert_eq!(why(1.3, 32, 64), None);
    }

    #[test]
    fn passes_of_hits_count_for_their_effect() {
        assert!(is_of("diffuse", "diffuse") && is_of("diffuse-shadow", "diffuse"));
        assert!(!is_of("diffuse-shadow", "shadow") && !is_of("aorta", "ao"));
    }
}
