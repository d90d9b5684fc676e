//! Measures the rates of a device: what rays of each effect take in a scene, traced and by each method, and how methods
//! err. Ways take turns, so that whatever else the machine does weighs on all of them alike.

use super::candidates::{Candidate, EFFECTS, alone, possible};
use super::error;
use super::rates::{MethodRate, Rates, device_key};
use crate::counters::Record;
use crate::frame::{Captures, FrameOutput, FrameWatch, Methods, RenderError, Renderer};
use crate::math::median::median;
use crate::scene::CameraPath;
use crate::secondary::Method;
use crate::secondary::dvf::Options;
use crate::secondary::dvf::prepare::{Walk, prepare};
use crate::session::renderer::methods_of;
use crate::session::{Session, Settings};
use crate::settings::{CacheSize, ErrorLimit, ImageSize};
use anyhow::{Context, Result};
use bricks::Resident;
use std::collections::BTreeMap;
use std::path::Path;
use std::time::Instant;

/// Views along the path.
const VIEWS: u32 = 3;
/// Turns whose times count, after one that makes everything ready.
const TURNS: usize = 3;
/// What takes so many times as long as exact rays in the turn before is not measured again.
const HOPELESS: f64 = 4.0;

/// Who watches a calibration: what is measured, how much is done of how much; says whether to go on.
pub type Progress<'a> = dyn FnMut(&str, u32, u32) -> bool + 'a;

/// What was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Of which device: [`device_key`].
    pub device: String,
    /// Checksum of the scene.
    pub scene: u64,
    /// The rates.
    pub rates: Rates,
}

/// A way to answer the rays of an effect.
struct Way {
    candidate: Option<&'static Candidate>,
    methods: Methods,
    making: f64,
    /// Seconds by which its very first frame took longer than its first one with kernels that are compiled, and that
    /// one than those after it, which have what it has made.
    starting: Option<[f64; 2]>,
    /// Seconds by size and view.
    seconds: [[Vec<f64>; VIEWS as usize]; 2],
    /// By size and view: nothing more is to be measured.
    is_told: [[bool; VIEWS as usize]; 2],
    /// Rays of exact ways, by size and view.
    rays: [[f64; VIEWS as usize]; 2],
    /// Seconds a pixel that camera rays took.
    primary: Vec<f64>,
    percent: Vec<f64>,
    flip: Vec<f64>,
}

/// Frames go on until somebody wants the calibration to end.
struct Going<'a, 'b>(&'a mut Progress<'b>, &'a str, [u32; 2]);

impl FrameWatch for Going<'_, '_> {
    fn passes(&mut self, _: u32, _: u32) -> bool {
        let [done, all] = self.2;
        (self.0)(self.1, done, all)
    }
}

/// Measures the rates of the device that `settings` name, in the scene `file`, with pictures of their size along their
/// path.
///
/// # Errors
/// The scene's; the device's; `progress` stopped it.
pub fn measure(file: &Path, settings: &Settings, progress: &mut Progress) -> Result<Measured> {
    let of = |effect: &str, size: ImageSize| -> Result<Settings> {
        let own = Settings::from_options(&format!("--quality exact {} --ao-rays 4 --diffuse-rays 2", alone(effect)))?;
        let (path, adapter) = (settings.path.clone(), settings.adapter.clone());
        Ok(Settings { path, adapter, size, cache: CacheSize::Auto, frames: VIEWS, ..own })
    };
    let ImageSize { width, height } = settings.size;
    let sizes = [settings.size, ImageSize { width: (width / 2).max(1), height: (height / 2).max(1) }];
    let mut session = Session::open(file, &of(EFFECTS[0], sizes[0])?)?;
    let (path, name) = (session.path().clone(), file.display().to_string());
    let scene = session.renderer().scene.clone();
    let device = device_key(&session.renderer().executor.device());
    let byte = seconds_a_byte(session.renderer(), &path).with_context(|| name.clone())?;
    let mut rates = Rates { byte, ..Rates::default() };
    let folder = tempfile::tempdir()?;
    let field = folder.path().join("field.dvf");
    let mut primary = Vec::new();
    // Effects share kernels: what compiles them is measured with whatever needs them first.
    let mut compiling = BTreeMap::new();
    for (number, effect) in (0..).zip(EFFECTS) {
        let mut ways = vec![Way::exact()];
        for candidate in possible(effect, scene.resident()) {
            ways.push(Way::of(candidate, &of(effect, sizes[0])?, scene.resident())?);
        }
        let mut going = Going(progress, effect, [number, EFFECTS.len() as u32]);
        for (index, &size) in sizes.iter().enumerate() {
            let settings = of(effect, size)?;
            session.set(&settings)?;
            let place = Place { scene: file, field: &field, path: &path, settings: &settings, effect };
            let renderer = session.renderer();
            place.take_turns(renderer, &mut ways, index, &mut going).with_context(|| name.clone())?;
            if index == 0 {
                let errors = place.note_errors(renderer, &mut ways, &mut going);
                rates.flip = rates.flip.max(errors.with_context(|| name.clone())?);
            }
        }
        primary.append(&mut ways[0].primary);
        for way in &ways {
            if let (Some(candidate), Some([seconds, _])) = (way.candidate, way.starting) {
                let most = compiling.entry(candidate.method).or_insert(0.0f64);
                *most = most.max(seconds);
            }
        }
        note(&mut rates, effect, &ways, &compiling);
    }
    rates.primary = median(primary).unwrap_or(0.0);
    Ok(Measured { device, scene: scene.checksum(), rates })
}

/// What is common to the pictures of an effect at a size.
struct Place<'a> {
    scene: &'a Path,
    /// Where a field of visibility is kept.
    field: &'a Path,
    path: &'a CameraPath,
    settings: &'a Settings,
    effect: &'static str,
}

impl Place<'_> {
    /// Renders all views by all ways, turn by turn; `index`: which of the sizes this is.
    fn take_turns(&self, renderer: &mut Renderer, ways: &mut [Way], index: usize, going: &mut Going) -> Result<()> {
        let pixels = f64::from(renderer.size.0) * f64::from(renderer.size.1);
        for turn in 0..=TURNS {
            for view in 0..VIEWS as usize {
                let mut exact = 0.0;
                for way in &mut *ways {
                    if way.is_told[index][view] {
                        continue;
                    }
                    if way.needs_field() {
                        self.make_field(renderer, way)?;
                    }
                    let mut first = None;
                    if way.starting.is_none() {
                        let very_first = self.seconds(renderer, way, view, going)?.0;
                        let made_anew = match way.candidate {
                            // Of a field it is known what it takes.
                            Some(candidate) if candidate.method != Method::Dvf => {
                                way.methods = Way::of(candidate, self.settings, renderer.scene.resident())?.methods;
                                Some(self.seconds(renderer, way, view, going)?.0)
                            }
                            _ => None,
                        };
                        first = Some((very_first, made_anew));
                    }
                    let (seconds, records) = self.seconds(renderer, way, view, going)?;
                    if let Some((very_first, made_anew)) = first {
                        let made_anew = made_anew.unwrap_or(seconds);
                        way.starting = Some([(very_first - made_anew).max(0.0), (made_anew - seconds).max(0.0)]);
                    }
                    if way.candidate.is_none() {
                        exact = seconds;
                        let own = records.iter().find(|record| record.pass == self.effect);
                        way.rays[index][view] = own.map_or(0, |record| record.rays()) as f64;
                        let own = records.iter().filter(|record| record.pass == "primary" && turn > 0);
                        way.primary.extend(own.map(|record| record.ms * 1e-3 / pixels));
                    }
                    let is_told = turn == 0 && way.candidate.is_some() && seconds > HOPELESS * exact;
                    if turn > 0 || is_told {
                        way.seconds[index][view].push(seconds);
                    }
                    way.is_told[index][view] |= is_told;
                }
            }
        }
        Ok(())
    }

    /// Renders a view by a way: seconds of the effect, and the frame's records.
    fn seconds(
        &self,
        renderer: &mut Renderer,
        way: &mut Way,
        view: usize,
        going: &mut Going,
    ) -> Result<(f64, Vec<Record>)> {
        let records = way.frame(renderer, view as u32, self.path, going)?.records;
        Ok((super::seconds_of(self.effect, &records), records))
    }

    /// Makes the field of visibility of a way.
    fn make_field(&self, renderer: &mut Renderer, way: &mut Way) -> Result<()> {
        let Some(candidate) = way.candidate else { return Ok(()) };
        let options = Options { file: Some(self.field.into()), ..candidate.over(self.settings)?.dvf };
        let walk = Walk { path: self.path, frames: VIEWS, is_moving: false };
        std::mem::swap(&mut renderer.methods, &mut way.methods);
        let start = Instant::now();
        let made = prepare(renderer, self.scene, &options, &walk, &mut Vec::new(), &mut |_, _| true);
        way.making = start.elapsed().as_secs_f64();
        std::mem::swap(&mut renderer.methods, &mut way.methods);
        made.map(drop)
    }

    /// Errors of all ways against the first, view by view; the seconds a pixel that FLIP takes.
    fn note_errors(&self, renderer: &mut Renderer, ways: &mut [Way], going: &mut Going) -> Result<f64, RenderError> {
        let (size, samples) = (renderer.size, renderer.settings.samples);
        let mut a_pixel = 0.0f64;
        for view in 0..VIEWS {
            let mut exact: Option<(Captures, Vec<[f32; 3]>)> = None;
            for way in &mut *ways {
                renderer.captures = Some(Captures::default());
                let output = way.frame(renderer, view, self.path, going);
                let captures = renderer.captures.take().unwrap_or_default();
                let radiance = output?.pixels.radiance;
                let Some((of_exact, picture)) = &exact else {
                    exact = Some((captures, radiance));
                    continue;
                };
                let both = [&captures, of_exact];
                let of = |limit| error(picture, both, self.effect, size, samples, limit);
                way.percent.push(of(ErrorLimit::Percent(1.0)));
                let start = Instant::now();
                way.flip.push(of(ErrorLimit::Flip(1.0)));
                a_pixel = a_pixel.max(start.elapsed().as_secs_f64() / picture.len().max(1) as f64);
            }
        }
        Ok(a_pixel)
    }
}

impl Way {
    fn exact() -> Self {
        Self {
            candidate: None,
            methods: Methods::default(),
            making: 0.0,
            starting: None,
            seconds: Default::default(),
            is_told: Default::default(),
            rays: Default::default(),
            primary: Vec::new(),
            percent: Vec::new(),
            flip: Vec::new(),
        }
    }

    fn of(candidate: &'static Candidate, settings: &Settings, resident: &Resident) -> Result<Self> {
        let methods = methods_of(&[candidate.over(settings)?], resident);
        Ok(Self { candidate: Some(candidate), methods, ..Self::exact() })
    }

    fn needs_field(&self) -> bool {
        self.making == 0.0 && self.candidate.is_some_and(|candidate| candidate.method == Method::Dvf)
    }

    fn frame(
        &mut self,
        renderer: &mut Renderer,
        view: u32,
        path: &CameraPath,
        watch: &mut dyn FrameWatch,
    ) -> Result<FrameOutput, RenderError> {
        std::mem::swap(&mut renderer.methods, &mut self.methods);
        let output = renderer.frame_watched(view, &path.frame(view, VIEWS), &[], watch);
        std::mem::swap(&mut renderer.methods, &mut self.methods);
        output
    }
}

/// Notes the rates of an effect: of views that tell different ones the least of exact rays and the most of methods.
/// `compiling`: seconds that the kernels of methods take before their first frame.
fn note(rates: &mut Rates, effect: &str, ways: &[Way], compiling: &BTreeMap<Method, f64>) {
    let Some(rays) = ways.first().map(|exact| exact.rays) else { return };
    let seen: Vec<usize> =
        (0..VIEWS as usize).filter(|&view| rays[1][view] > 0.0 && rays[0][view] > rays[1][view]).collect();
    let time = |way: &Way, size: usize, view: usize| median(way.seconds[size][view].clone()).unwrap_or(0.0);
    for way in ways {
        let Some(candidate) = way.candidate else {
            let ray = seen.iter().map(|&view| time(way, 0, view) / rays[0][view]);
            if let Some(least) = ray.reduce(f64::min) {
                rates.exact.insert(effect.into(), least);
            }
            continue;
        };
        let (mut ray, mut sample) = (0.0f64, 0.0f64);
        for &view in &seen {
            let (large, small) = (time(way, 0, view), time(way, 1, view));
            let own = ((large - small) / (rays[0][view] - rays[1][view])).max(0.0);
            ray = ray.max(own);
            sample = sample.max(large - own * rays[0][view]);
        }
        let range = |values: &[f64]| {
            let (least, most) = values.iter().fold((f64::INFINITY, 0.0f64), |(a, b), &x| (a.min(x), b.max(x)));
            [least, most]
        };
        let (percent, flip_error) = (range(&way.percent), range(&way.flip));
        if seen.is_empty() || !percent.iter().chain(&flip_error).all(|error| error.is_finite()) {
            continue;
        }
        let own = way.starting.map_or(0.0, |[_, own]| own);
        let making = way.making + own + compiling.get(&candidate.method).copied().unwrap_or(0.0);
        let (effect, name) = (effect.into(), candidate.name.into());
        rates.methods.push(MethodRate { effect, name, making, sample: sample.max(0.0), ray, percent, flip_error });
    }
}

/// What a byte takes that is loaded: of a frame that begins with an empty cache, what it waited for.
fn seconds_a_byte(renderer: &mut Renderer, path: &CameraPath) -> Result<f64, RenderError> {
    let records = renderer.frame(0, &path.frame(0, VIEWS))?.records;
    let bytes: u64 = records.iter().map(Record::loaded_bytes).sum();
    let seconds = records.iter().map(|record| record.ms_stream * 1e-3).sum::<f64>();
    Ok(if bytes == 0 { 0.0 } else { seconds / bytes as f64 })
}
