//! What is measured: every way to answer the rays of an effect, over sizes of the cache.

use super::args::{Effect, Scale};
use crate::session::auto::candidates::alone;

/// What a scene has that some ways need.
#[derive(Clone, Copy, Debug, Default)]
pub struct Has {
    /// The occupancy of its bricks.
    pub occupancy: bool,
    /// Displacement fields.
    pub displacement: bool,
    /// Levels of detail.
    pub levels: bool,
}

/// Settings under which rays of an effect are answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Way {
    /// What answers: a method, or what is done beside exact rays.
    pub method: &'static str,
    /// Rays of the effect a pixel.
    pub rays: u32,
    /// Options of `walk`, beside those of the effect.
    pub options: String,
    /// The source of error that is less than in the way before without one, where that is studied.
    pub source: &'static str,
}

impl Way {
    /// Without a source.
    pub fn new(method: &'static str, rays: u32, options: impl Into<String>) -> Self {
        Self { method, rays, options: options.into(), source: "" }
    }
}

/// Rays a pixel of exact ways.
pub const RAYS: [u32; 5] = [1, 2, 4, 8, 16];
/// Rays a pixel of all others.
pub const USUAL: u32 = 4;

/// Options of `walk` for an effect by itself, without rays.
pub fn base(effect: Effect) -> &'static str {
    alone(effect.name())
}

/// Options of `walk` for so many rays of an effect a pixel.
pub fn rays(effect: Effect, count: u32) -> String {
    match effect {
        Effect::Ao => format!("--ao-rays {count}"),
        Effect::Diffuse => format!("--diffuse-rays {count}"),
        Effect::Shadow | Effect::Environment => format!("--spp {count}"),
    }
}

/// All ways of an effect, exact ones first.
pub fn ways(effect: Effect, has: Has, is_quick: bool) -> Vec<Way> {
    let usual = |method, options: String| Way::new(method, USUAL, options);
    let thinned = |all: &[u32]| all.iter().copied().step_by(if is_quick { 2 } else { 1 }).collect::<Vec<u32>>();
    let mut ways: Vec<Way> = thinned(&RAYS).into_iter().map(|rays| Way::new("exact", rays, "")).collect();
    let name = effect.name();
    ways.extend([20, 200].map(|pixels| usual("threshold", format!("--schedule chc --query-threshold {pixels}"))));
    if has.occupancy && effect != Effect::Environment {
        let option = match effect {
            Effect::Ao => "--roma-k",
            Effect::Shadow => "--roma-shadow-k",
            _ => "--roma-diffuse-k",
        };
        for size in thinned(&[32, 64, 128]) {
            ways.extend(
                thinned(&[4, 8])
                    .into_iter()
                    .map(|k| usual("roma", format!("--secondary {name}=roma --roma-size {size} {option} {k}"))),
            );
        }
        ways.push(usual("roma", format!("--secondary {name}=roma --roma-unsnapped all")));
        // Zeng et al.'s: one ray, a denoiser, and frames put together.
        ways.push(Way::new("roma", 1, format!("--secondary {name}=roma --denoise --taa")));
    }
    if has.occupancy && matches!(effect, Effect::Ao | Effect::Shadow) {
        ways.extend([2, 5, 10].map(|percent| usual("sift", format!("--secondary {name}=sift --auto-error {percent}"))));
        ways.push(usual("sift", format!("--secondary {name}=sift --auto-one-in 4")));
        ways.extend(
            thinned(&[32, 64, 128])
                .into_iter()
                .map(|size| usual("df", format!("--secondary {name}=df --df-size {size}"))),
        );
    }
    if effect == Effect::Environment {
        let counts: &[u32] = if is_quick { &[1_000, 5_000] } else { &[20_000, 100_000, 400_000] };
        let dvf = |points: u32, rest: &str| {
            usual("dvf", format!("--secondary {name}=dvf --dvf-points {points} --dvf-count rounding{rest}"))
        };
        ways.extend(counts.iter().map(|&points| dvf(points, "")));
        ways.push(dvf(counts[1], " --dvf-rays 32"));
        ways.push(dvf(counts[1], " --dvf-region view"));
    }
    if has.displacement {
        ways.extend(["absent", "all"].map(|against| {
            usual("displacement", format!("--secondary {name}=displacement --displacement-against {against}"))
        }));
    }
    if has.levels {
        ways.extend(["0.5", "1", "2", "4"].map(|pixels| usual("levels", format!("--lod {pixels}"))));
    }
    ways.extend([1, USUAL].map(|rays| Way::new("denoised", rays, "--denoise")));
    ways.push(Way::new("denoised", 1, "--denoise --taa"));
    ways.push(Way::new("taa", 1, "--taa"));
    ways
}

/// A method's own options for an effect, and by which of them each source of its error becomes less.
type Attributed = (&'static str, String, Vec<(&'static str, String)>);

/// Ways by which sources of error are told apart: of each method one as it is, then others of which one source each is
/// less; exact rays first. Sources that no option switches are not among them: the rounding of f32, and the seams
/// between levels of maps.
pub fn attributed(effect: Effect, has: Has) -> Vec<Way> {
    let name = effect.name();
    let some = |all: &[(&'static str, &str)]| all.iter().map(|&(source, options)| (source, options.into())).collect();
    let mut methods: Vec<Attributed> = vec![(
        "threshold",
        "--schedule chc --query-threshold 20".into(),
        some(&[("threshold", "--query-threshold 5")]),
    )];
    if has.occupancy && effect != Effect::Environment {
        let directions = match effect {
            Effect::Ao => "--roma-k 8",
            Effect::Shadow => "--roma-shadow-k 8",
            _ => "--roma-diffuse-k 8",
        };
        let base = match effect {
            Effect::Shadow => "--roma-size 64 --roma-unsnapped none --roma-shadow-k 4",
            _ => "--roma-size 64 --roma-unsnapped none",
        };
        methods.push((
            "roma",
            format!("--secondary {name}=roma {base}"),
            some(&[
                ("cells", "--roma-size 128"),
                ("directions", directions),
                ("snapping", "--roma-unsnapped all --roma-steps 64"),
                ("look-ups", "--roma-samples 4"),
            ]),
        ));
    }
    if has.occupancy && matches!(effect, Effect::Ao | Effect::Shadow) {
        methods.push((
            "df",
            format!("--secondary {name}=df --df-size 64"),
            some(&[("cells", "--df-size 128"), ("steps", "--df-steps 256"), ("offset", "--df-lift 1")]),
        ));
    }
    if effect == Effect::Environment {
        methods.push((
            "dvf",
            "--secondary environment=dvf --dvf-points 20000 --dvf-count rounding --dvf-octahedral 16".into(),
            some(&[
                ("points", "--dvf-points 100000"),
                ("rays", "--dvf-rays 512"),
                ("masks", "--dvf-octahedral 32"),
                ("cells", "--dvf-cells 128"),
            ]),
        ));
    }
    if has.displacement {
        methods.push((
            "displacement",
            format!("--secondary {name}=displacement --displacement-against all"),
            some(&[
                ("stand-ins", "--displacement-against absent"),
                ("offset", "--displacement-near 8"),
                ("samples", "--displacement-interpolate both"),
            ]),
        ));
    }
    if has.levels {
        methods.push(("levels", "--lod 2".into(), some(&[("levels", "--lod 0.5"), ("edges", "--lod-blend")])));
    }
    let of = |(method, base, sources): Attributed| {
        let own = Way::new(method, USUAL, base.clone());
        let less = move |(source, options): (&'static str, String)| Way {
            source,
            ..Way::new(method, USUAL, merged(&base, &options))
        };
        std::iter::once(own).chain(sources.into_iter().map(less))
    };
    std::iter::once(Way::new("exact", USUAL, "")).chain(methods.into_iter().flat_map(of)).collect()
}

/// Options with those of `other` in the place of the same ones.
fn merged(base: &str, other: &str) -> String {
    let split = |text: &str| {
        let mut found: Vec<String> = Vec::new();
        for word in text.split_whitespace() {
            match found.last_mut().filter(|_| !word.starts_with("--")) {
                Some(last) => *last += &format!(" {word}"),
                None => found.push(word.to_owned()),
            }
        }
        found
    };
    let flag = |option: &str| option.split(' ').next().map(str::to_owned);
    let (mut all, others) = (split(base), split(other));
    all.retain(|own| !others.iter().any(|other| flag(own) == flag(other)));
    all.extend(others);
    all.join(" ")
}

/// Ways of an effect in one view that take turns, with one cache.
#[derive(Clone, Debug)]
pub struct Job {
    /// The effect.
    pub effect: Effect,
    /// Number of the view.
    pub view: u32,
    /// Percent of all bricks that the cache holds.
    pub cache: u32,
    /// Whether every picture begins with an empty cache.
    pub is_cold: bool,
    /// The ways.
    pub ways: Vec<Way>,
}

impl Job {
    /// The name of a measurement.
    pub fn key(&self, way: &Way) -> String {
        let state = if self.is_cold { "cold" } else { "warm" };
        let Self { effect, view, cache, .. } = self;
        let Way { method, rays, options, .. } = way;
        format!("{effect}/view {view}/{cache}%/{state}/{method}/{rays} rays/{options}").trim_end_matches('/').into()
    }
}

/// All jobs, those that say most first: of the first view all effects with everything resident, then with the smallest
/// cache, empty; then the rest.
pub fn jobs(scale: &Scale, ways: impl Fn(Effect) -> Vec<Way>) -> Vec<Job> {
    let mut caches = scale.caches.clone();
    caches.sort_unstable_by(|a, b| b.cmp(a));
    caches.dedup();
    let smallest = caches.last().copied().unwrap_or(100);
    let mut all = Vec::new();
    for &cache in &caches {
        for is_cold in [false, true] {
            for view in 0..scale.views {
                all.extend(scale.effects.iter().map(|&effect| Job {
                    effect,
                    view,
                    cache,
                    is_cold,
                    ways: ways(effect),
                }));
            }
        }
    }
    all.sort_by_key(|job| match (job.view, job.cache, job.is_cold) {
        (0, 100, false) => 0,
        (0, cache, true) if cache == smallest => 1,
        _ => 2,
    });
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::study::args::StudyArgs;
    use crate::session::Settings;
    use crate::settings::Group as _;
    use std::collections::BTreeSet;

    const ALL: Has = Has { occupancy: true, displacement: true, levels: true };

    #[test]
    fn all_ways_are_settings_and_have_an_exact_one_of_as_many_rays() {
        for &effect in Effect::ALL {
            for is_quick in [false, true] {
                let ways = ways(effect, ALL, is_quick);
                for way in &ways {
                    let text = format!("--quality exact {} {} {}", base(effect), rays(effect, way.rays), way.options);
                    Settings::from_options(&text).unwrap_or_else(|error| panic!("{text}: {error}")).check().unwrap();
                    let is_same = |other: &Way| other.method == "exact" && other.rays == way.rays;
                    assert!(ways.iter().any(is_same), "{effect}: no exact rays beside {way:?}");
                }
                assert!(
                    ways.iter().any(|way| !["exact", "denoised", "taa", "levels", "threshold"].contains(&way.method))
                );
            }
        }
    }

    #[test]
    fn sources_of_error_are_switched_one_at_a_time() {
        for &effect in Effect::ALL {
            let ways = attributed(effect, ALL);
            let parsed = |way: &Way| {
                let text = format!("--quality exact {} {} {}", base(effect), rays(effect, way.rays), way.options);
                Settings::from_options(&text).unwrap_or_else(|error| panic!("{text}: {error}"))
            };
            let mut own = &ways[0];
            for way in &ways {
                if way.source.is_empty() {
                    own = way;
                    continue;
                }
                assert_eq!(own.method, way.method);
                let [before, after] = [own, way].map(parsed);
                let differ = Settings::entries().into_iter().filter(|entry| {
                    let key = entry.key();
                    before.get(&key) != after.get(&key)
                });
                let count = differ.count();
                assert!((1..=2).contains(&count), "{effect}: {way:?} switches {count} settings");
            }
            assert!(ways.iter().filter(|way| !way.source.is_empty()).count() >= 6, "{effect}");
        }
        assert_eq!(merged("--a 1 --b --c 2 3", "--b 4 --d"), "--a 1 --c 2 3 --b 4 --d");
    }

    #[test]
    fn a_scene_without_data_is_measured_without_what_needs_it() {
        for &effect in Effect::ALL {
            let found: BTreeSet<&str> = ways(effect, Has::default(), false).iter().map(|way| way.method).collect();
            assert!(!found.iter().any(|method| ["roma", "sift", "df", "displacement", "levels"].contains(method)));
        }
    }

    #[test]
    fn measurements_have_names_of_their_own_and_the_most_telling_come_first() {
        let scale = StudyArgs::default().scale();
        let jobs = jobs(&scale, |effect| ways(effect, ALL, false));
        let mut keys: Vec<String> = jobs.iter().flat_map(|job| job.ways.iter().map(|way| job.key(way))).collect();
        let count = keys.len();
        keys.sort();
        keys.dedup();
        assert_eq!(keys.len(), count);
        let effects = scale.effects.len();
        assert!(jobs[..effects].iter().all(|job| job.cache == 100 && !job.is_cold));
        assert!(jobs[effects..2 * effects].iter().all(|job| job.cache == 5 && job.is_cold));
        assert_eq!(jobs.len(), effects * scale.views as usize * 10);
    }
}
