//! `--secondary auto`: of each effect the rays are answered by the method that is expected to take least, if it pays
//! and errs by no more than `--error`.
//!
//! Frames go in blocks of [`BLOCK`]. The first of a block is exact. Its counts and the rates of the device say which
//! methods pay. The frame is rendered by these as well, and what errs little enough answers the rest of the block. All
//! of it follows from settings, scene, camera path, size of the cache and rates: no clock decides, and a block depends
//! on no other, so that parts of a walk show what the whole walk does.

pub mod calibrate;
pub mod candidates;
pub mod model;
pub mod rates;

use super::renderer::methods_of;
use super::settings::Settings;
use crate::counters::Record;
use crate::frame::{Captures, Effects, FrameOutput, FrameWatch, Methods, RenderError, RenderSettings, Renderer};
use crate::metrics::{Image, PIXELS_PER_DEGREE, flip_ldr, pixel_errors};
use crate::scene::{Camera, CameraPath};
use crate::secondary::Method;
use crate::secondary::dvf::Dvf;
use crate::secondary::dvf::prepare::{Walk, prepare};
use crate::settings::ErrorLimit;
use bricks::Resident;
use candidates::{Candidate, possible};
use model::{Counts, MARGIN, Means, Offer, Offers, exact_seconds, offers};
use rates::{Found, RateFile, default_file};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Frames for which methods are chosen together.
pub const BLOCK: u32 = 32;

/// A frame of a walk.
pub struct Wanted<'a> {
    /// Its number.
    pub number: u32,
    /// What sees it.
    pub camera: &'a Camera,
    /// The whole walk, and its frames.
    pub path: &'a CameraPath,
    /// How many frames.
    pub frames: u32,
    /// Samples after which the sum is told, too.
    pub checkpoints: &'a [u32],
}

/// An effect whose rays are answered by whatever pays.
struct Own {
    effect: &'static str,
    candidates: Vec<&'static Candidate>,
    takes: Option<&'static Candidate>,
    why: String,
    /// Frames by the name of what answered.
    frames: BTreeMap<&'static str, u32>,
    /// Errors that were measured: frame, method, error, whether it was taken.
    trials: Vec<(u32, &'static str, f64, bool)>,
}

/// Chooses methods for frames.
pub struct Auto {
    /// With `exact` in the place of `auto`.
    settings: Settings,
    file: PathBuf,
    limit: ErrorLimit,
    rates: Option<Found>,
    rate_file: Option<PathBuf>,
    effects: Vec<Own>,
    block: Option<u32>,
    /// Methods of the block before: what they have made is of use where the same are taken again.
    kept: Option<(Vec<Option<&'static Candidate>>, Methods)>,
}

impl Auto {
    /// For a walk with `settings` of the scene in `file`, which `renderer` renders; `None`: no effect that is on has
    /// `auto`.
    ///
    /// # Errors
    /// A file of rates that is none, or was named and is missing.
    pub fn new(settings: &Settings, file: &Path, renderer: &Renderer) -> anyhow::Result<Option<Self>> {
        let is_on = |effect: &str| is_on(effect, &renderer.settings.effects, renderer.draws_environment());
        let of_auto = settings.secondary.list().into_iter().filter(|(_, method)| *method == Method::Auto);
        let effects: Vec<Own> = of_auto
            .filter(|(effect, _)| is_on(effect))
            .map(|(effect, _)| Own::new(effect, renderer.scene.resident()))
            .collect();
        if effects.is_empty() {
            return Ok(None);
        }
        let rate_file = settings.rates.clone().or_else(default_file);
        let read = rate_file.as_deref().map(RateFile::read).transpose()?.flatten();
        if let (Some(named), None) = (&settings.rates, &read) {
            anyhow::bail!("{}: there is no such file; `brickwalk calibrate --rates` writes it", named.display());
        }
        let rates = read.and_then(|read| read.find(&renderer.executor.device(), renderer.scene.checksum()));
        let secondary = settings.secondary.with(Method::Auto, Method::Exact);
        Ok(Some(Self {
            settings: Settings { secondary, ..settings.clone() },
            file: file.into(),
            limit: settings.error,
            rates,
            rate_file,
            effects,
            block: None,
            kept: None,
        }))
    }

    /// What a person should know, if no rates are known.
    pub fn warning(&self) -> Option<String> {
        let name = self.file.display();
        self.rates.is_none().then(|| {
            format!(
                "--secondary auto traces all rays, as no rates of this device are known; `brickwalk calibrate {name}` \
                     measures them"
            )
        })
    }

    /// Renders a frame.
    ///
    /// # Errors
    /// As those of [`Renderer::frame_watched`].
    pub fn frame(
        &mut self,
        renderer: &mut Renderer,
        wanted: &Wanted,
        watch: &mut dyn FrameWatch,
    ) -> Result<FrameOutput, RenderError> {
        let &Wanted { number, camera, path, frames, checkpoints } = wanted;
        let first = number - number % BLOCK;
        if self.block != Some(first) {
            self.block = Some(first);
            self.take_nothing(renderer);
            let length = frames.saturating_sub(first).clamp(1, BLOCK);
            if self.may_pay(renderer, length, frames) {
                let captures = renderer.captures.replace(Captures::default());
                let exact = match number == first {
                    true => renderer.frame_watched(first, camera, checkpoints, watch)?,
                    false => renderer.frame_watched(first, &path.frame(first, frames), &[], &mut Stops(watch))?,
                };
                let camera = if number == first { *camera } else { path.frame(first, frames) };
                let pilot = Pilot { number: first, camera: &camera, exact: &exact, length, path, frames };
                let own = renderer.captures.take();
                let decided = own.as_ref().map_or(Ok(()), |own| self.decide(renderer, &pilot, own, watch));
                renderer.captures = captures.and(own);
                decided?;
                if number == first {
                    self.note_frame(true);
                    return Ok(exact);
                }
            }
        }
        // The first of a block is exact, whenever it is asked for.
        let is_exact = number == first && self.effects.iter().any(|own| own.takes.is_some());
        self.note_frame(is_exact);
        if !is_exact {
            return renderer.frame_watched(number, camera, checkpoints, watch);
        }
        let without = self.methods(renderer, &[]);
        let taken = self.exchange(renderer, without);
        let output = renderer.frame_watched(number, camera, checkpoints, watch);
        self.exchange(renderer, taken);
        output
    }

    fn note_frame(&mut self, is_exact: bool) {
        for own in &mut self.effects {
            let by = own.takes.filter(|_| !is_exact).map_or("exact", |candidate| candidate.name);
            *own.frames.entry(by).or_default() += 1;
        }
    }

    /// Traces all rays of its effects.
    fn take_nothing(&mut self, renderer: &mut Renderer) {
        if self.effects.iter().all(|own| own.takes.is_none()) {
            return;
        }
        let takes = self.effects.iter().map(|own| own.takes).collect();
        self.effects.iter_mut().for_each(|own| own.takes = None);
        let methods = self.methods(renderer, &[]);
        self.kept = Some((takes, self.exchange(renderer, methods)));
    }

    /// The methods of settings, and these.
    fn methods(&self, renderer: &Renderer, chosen: &[Option<&'static Candidate>]) -> Methods {
        // What candidates set are settings: a test says so of all of them.
        let parts = chosen.iter().flatten().filter_map(|candidate| candidate.over(&self.settings).ok());
        let parts: Vec<Settings> = std::iter::once(self.settings.clone()).chain(parts).collect();
        methods_of(&parts, renderer.scene.resident())
    }

    /// Whether any method may pay and be tried, however many rays hit and whatever the cache holds; says why where none
    /// does.
    fn may_pay(&mut self, renderer: &Renderer, length: u32, frames: u32) -> bool {
        let Self { settings, limit, rates, effects, .. } = self;
        let mut may = false;
        let pixels = f64::from(renderer.size.0) * f64::from(renderer.size.1);
        let samples = renderer.settings.samples;
        let missing = (renderer.cache.sizes.sum() as f64 - renderer.cache.residency.budget_bytes() as f64).max(0.0);
        let most =
            |effect: &str| Counts::most(pixels, rays_per_sample(effect, &renderer.settings.effects), samples, missing);
        let means = rates.as_ref().map(|Found { rates, .. }| {
            let exact = effects.iter().filter_map(|own| exact_seconds(rates, own.effect, &most(own.effect)));
            Means::of(rates, *limit, pixels, samples)(exact.sum(), length, frames)
        });
        for own in effects {
            let found = match &*rates {
                _ if settings.motion.is_some() => Offers::none("instances move"),
                _ if settings.lod > 0.0 => Offers::none("rates of levels of detail are not known"),
                None => Offers::none("there are no rates of this device"),
                Some(Found { rates, .. }) => {
                    let loaded = most(own.effect);
                    let [held, mut loaded] = [Counts { missing: 0.0, ..loaded }, loaded]
                        .map(|counts| offers(rates, own.effect, &counts, &own.candidates, *limit, length));
                    loaded.paying.extend(&held.paying);
                    let forbid = |offer: &Offer| means.as_ref().and_then(|means| means.forbid(offer));
                    match loaded.paying.iter().map(forbid).collect::<Option<Vec<String>>>() {
                        None => Offers::default(),
                        Some(why) => why.into_iter().next().map_or(held, |why| Offers::none(&why)),
                    }
                }
            };
            may |= found.why.is_empty();
            own.why = found.why;
        }
        may
    }

    /// Chooses methods for a block by its first frame, of which `own` has what each effect added.
    fn decide(
        &mut self,
        renderer: &mut Renderer,
        pilot: &Pilot,
        own: &Captures,
        watch: &mut dyn FrameWatch,
    ) -> Result<(), RenderError> {
        let Some(Found { rates, .. }) = self.rates.clone() else { return Ok(()) };
        let samples = renderer.settings.samples;
        let pixels = f64::from(renderer.size.0) * f64::from(renderer.size.1);
        let bricks = renderer.scene.resident().bricks.len().max(1) as f64;
        let brick_bytes = renderer.cache.sizes.sum() as f64 / bricks;
        let mut exact = 0.0;
        let mut left: Vec<Vec<Offer>> = Vec::new();
        for own in &mut self.effects {
            let counts = Counts::of(own.effect, &pilot.exact.records, samples, brick_bytes);
            let found = offers(&rates, own.effect, &counts, &own.candidates, self.limit, pilot.length);
            exact += exact_seconds(&rates, own.effect, &counts).unwrap_or(0.0);
            own.why = found.why;
            left.push(found.paying.into_iter().rev().collect());
        }
        let means = Means::of(&rates, self.limit, pixels, samples)(exact, pilot.length, pilot.frames);
        let mut budget = means.errors;
        loop {
            let open = |(own, left): (&Own, &Vec<Offer>)| left.last().copied().filter(|_| own.takes.is_none());
            let mut round: Vec<Option<Offer>> = self.effects.iter().zip(&left).map(open).collect();
            let cost = |round: &[Option<Offer>]| means.measuring(round.iter().flatten());
            while round.iter().any(Option::is_some) && cost(&round) > budget {
                // The dearest of them is not measured.
                let seconds = |i: &usize| round[*i].map_or(-1.0, |offer| offer.seconds);
                let Some(dearest) = (0..round.len()).max_by(|a, b| seconds(a).total_cmp(&seconds(b))) else { break };
                let name = round[dearest].map_or("", |offer| offer.candidate.name);
                self.effects[dearest].why = format!("there are too few frames to measure the error of {name}");
                left[dearest].clear();
                round[dearest] = None;
            }
            for (i, offer) in round.iter_mut().enumerate() {
                if let Some(one) = offer.filter(|one| one.making > means.making) {
                    self.effects[i].why = format!("there are too few frames to make {}", one.candidate.name);
                    left[i].pop();
                    *offer = None;
                }
            }
            let chosen: Vec<Option<&'static Candidate>> =
                round.iter().map(|offer| offer.map(|offer| offer.candidate)).collect();
            if chosen.iter().all(Option::is_none) {
                if left.iter().zip(&self.effects).all(|(left, own)| left.is_empty() || own.takes.is_some()) {
                    break;
                }
                continue;
            }
            budget -= cost(&round);
            let errors = self.errors(renderer, pilot, own, &chosen, watch)?;
            for (i, error) in errors.into_iter().enumerate() {
                let (Some(offer), Some(error)) = (round[i], error) else { continue };
                let (is_taken, name) = (error <= MARGIN * self.limit.value(), offer.candidate.name);
                let effect = &mut self.effects[i];
                effect.trials.push((pilot.number, name, error, is_taken));
                effect.why = match is_taken {
                    true => format!("it is expected to take {:.2} times as long as exact rays", offer.share),
                    false => format!("{name} errs by {}", shown(error, self.limit)),
                };
                effect.takes = is_taken.then_some(offer.candidate);
                left[i].pop();
            }
        }
        let chosen: Vec<Option<&'static Candidate>> = self.effects.iter().map(|own| own.takes).collect();
        if chosen.iter().any(Option::is_some) {
            let methods = self.take(renderer, &chosen);
            self.exchange(renderer, methods);
            self.give_field(renderer, pilot, &chosen, watch)?;
        }
        Ok(())
    }

    /// The methods of a choice: those kept, where it is the same.
    fn take(&mut self, renderer: &Renderer, chosen: &[Option<&'static Candidate>]) -> Methods {
        match self.kept.take() {
            Some((before, methods)) if before == chosen => methods,
            _ => self.methods(renderer, chosen),
        }
    }

    /// Gives a renderer other methods, and back those it had. A field of visibility that settings ask for stays.
    fn exchange(&self, renderer: &mut Renderer, mut methods: Methods) -> Methods {
        if self.settings.secondary.has(Method::Dvf)
            && let Some(field) = renderer.methods.remove::<Dvf>()
        {
            methods.set(field);
        }
        std::mem::replace(&mut renderer.methods, methods)
    }

    /// Renders the effects of `chosen` by these; their errors in the measure of the limit.
    fn errors(
        &mut self,
        renderer: &mut Renderer,
        pilot: &Pilot,
        exact: &Captures,
        chosen: &[Option<&'static Candidate>],
        watch: &mut dyn FrameWatch,
    ) -> Result<Vec<Option<f64>>, RenderError> {
        let methods = self.take(renderer, chosen);
        let before = self.exchange(renderer, methods);
        let settings = renderer.engine.settings;
        let names: Vec<&str> =
            self.effects.iter().zip(chosen).filter(|(_, c)| c.is_some()).map(|(o, _)| o.effect).collect();
        let effects = only(&settings.effects, &names);
        renderer.engine.settings = RenderSettings { effects, aov: false, guides: settings.guides, ..settings };
        renderer.captures = Some(Captures::default());
        let field = self.give_field(renderer, pilot, chosen, watch);
        let output = field.and_then(|()| renderer.frame_watched(pilot.number, pilot.camera, &[], &mut Stops(watch)));
        renderer.engine.settings = settings;
        let captures = renderer.captures.take().unwrap_or_default();
        let methods = self.exchange(renderer, before);
        self.kept = Some((chosen.to_vec(), methods));
        output?;
        let (size, samples) = (renderer.size, settings.samples);
        let of =
            |own: &Own| error(&pilot.exact.pixels.radiance, [&captures, exact], own.effect, size, samples, self.limit);
        Ok(self.effects.iter().zip(chosen).map(|(own, candidate)| candidate.map(|_| of(own))).collect())
    }

    /// Makes or reads the field of visibility that a choice needs.
    fn give_field(
        &self,
        renderer: &mut Renderer,
        pilot: &Pilot,
        chosen: &[Option<&'static Candidate>],
        watch: &mut dyn FrameWatch,
    ) -> Result<(), RenderError> {
        let Some(candidate) = chosen.iter().flatten().find(|candidate| candidate.method == Method::Dvf) else {
            return Ok(());
        };
        if renderer.methods.get::<Dvf>().is_some() {
            return Ok(());
        }
        let Ok(own) = candidate.over(&self.settings) else { return Ok(()) };
        let walk = Walk { path: pilot.path, frames: pilot.frames, is_moving: false };
        let mut goes_on = true;
        let mut stops = |_, _| {
            goes_on = watch.passes(0, 1);
            goes_on
        };
        // Without it the rays are traced.
        let made = prepare(renderer, &self.file, &own.dvf, &walk, &mut Vec::new(), &mut stops);
        if made.is_err() && !goes_on { Err(RenderError::Interrupted) } else { Ok(()) }
    }

    /// What summaries say.
    pub fn report(&self) -> Value {
        let effect = |own: &Own| {
            let trial = |one: &(u32, &str, f64, bool)| {
                let (frame, method, error, is_taken) = *one;
                json!({ "frame": frame, "method": method, "error": error, "taken": is_taken })
            };
            let report = json!({
                "takes": own.takes.map_or("exact", |candidate| candidate.name),
                "why": own.why,
                "frames": own.frames,
                "trials": own.trials.iter().map(trial).collect::<Vec<_>>(),
            });
            (own.effect.to_owned(), report)
        };
        json!({
            "error": self.limit.to_string(),
            "rates": self.rates.as_ref().map(|found| json!({
                "file": self.rate_file.as_deref().and_then(Path::file_name).map(|name| name.to_string_lossy()),
                "hash": format!("{:016x}", found.hash),
                "of_this_scene": found.is_own,
            })),
            "effects": self.effects.iter().map(effect).collect::<Map<String, Value>>(),
        })
    }
}

impl Own {
    fn new(effect: &'static str, resident: &Resident) -> Self {
        let candidates = possible(effect, resident).collect();
        Self { effect, candidates, takes: None, why: String::new(), frames: BTreeMap::new(), trials: Vec::new() }
    }
}

impl Offers {
    fn none(why: &str) -> Self {
        Self { paying: Vec::new(), why: why.into() }
    }
}

/// The frame that a block's methods are chosen by.
struct Pilot<'a> {
    number: u32,
    camera: &'a Camera,
    exact: &'a FrameOutput,
    /// Frames of the block.
    length: u32,
    path: &'a CameraPath,
    /// Of the walk.
    frames: u32,
}

/// Watches a frame that nobody sees: it may be stopped, and tells of no samples.
struct Stops<'a>(&'a mut dyn FrameWatch);

impl FrameWatch for Stops<'_> {
    fn passes(&mut self, done: u32, about: u32) -> bool {
        self.0.passes(done, about)
    }
}

/// Whether an effect is on.
fn is_on(effect: &str, effects: &Effects, draws_environment: bool) -> bool {
    match effect {
        "ao" => effects.occlusion.is_some(),
        "shadow" => effects.shadow,
        "diffuse" => effects.diffuse.is_some(),
        _ => draws_environment,
    }
}

/// Rays of an effect a pixel and sample.
fn rays_per_sample(effect: &str, effects: &Effects) -> u32 {
    match effect {
        "ao" => effects.occlusion.map_or(0, |occlusion| occlusion.rays),
        "diffuse" => effects.diffuse.unwrap_or(0),
        _ => 1,
    }
}

/// Effects without those that the pictures of `names` do not need. Hits of diffuse rays are lit by lamps.
fn only(effects: &Effects, names: &[&str]) -> Effects {
    let has = |name| names.contains(&name);
    Effects {
        shadow: effects.shadow && (has("shadow") || has("diffuse")),
        environment: effects.environment && (has("environment") || has("diffuse")),
        occlusion: effects.occlusion.filter(|_| has("ao")),
        diffuse: effects.diffuse.filter(|_| has("diffuse")),
        glossy: false,
        ..*effects
    }
}

fn shown(error: f64, limit: ErrorLimit) -> String {
    match limit {
        ErrorLimit::Flip(most) => format!("{error:.4}, of {most}"),
        ErrorLimit::Percent(most) => format!("{error:.2} %, of {most} %"),
    }
}

/// The error of an effect in the measure of `limit`: of what it added by itself, or of the picture where that stands in
/// the place of what exact rays added.
fn error(
    exact: &[[f32; 3]],
    [own, of_exact]: [&Captures; 2],
    effect: &str,
    (width, height): (u32, u32),
    samples: u32,
    limit: ErrorLimit,
) -> f64 {
    let (width, height) = (width as usize, height as usize);
    let added = |captures: &Captures| captures.added(|pass| model::is_of(pass, effect), samples);
    let (own, of_exact) = (added(own), added(of_exact));
    if own.len() != exact.len() || of_exact.len() != exact.len() {
        return f64::INFINITY;
    }
    let image = |rgb: Vec<[f32; 3]>| Image { width, height, rgb };
    let measured = match limit {
        ErrorLimit::Percent(_) => {
            pixel_errors(&image(own), &image(of_exact)).map(|errors| 100.0 * errors.rel_mse.sqrt())
        }
        ErrorLimit::Flip(_) => {
            let mixed = exact.iter().zip(own.iter().zip(&of_exact));
            let mixed = mixed.map(|(all, (own, of_exact))| std::array::from_fn(|k| all[k] + (own[k] - of_exact[k])));
            flip_ldr(&image(mixed.collect()), &image(exact.to_vec()), PIXELS_PER_DEGREE).map(|map| map.mean())
        }
    };
    measured.unwrap_or(f64::INFINITY)
}

/// The passes of a frame that an effect by itself has, and how long they took, seconds.
pub(super) fn seconds_of(effect: &str, records: &[Record]) -> f64 {
    let others = |pass: &str| pass == "primary" || (effect == "diffuse" && pass == "shadow");
    records.iter().filter(|record| !others(record.pass)).map(|record| record.ms * 1e-3).sum()
}
