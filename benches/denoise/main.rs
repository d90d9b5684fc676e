//! What denoising is worth: frames of one sample a pixel along a camera path, against pictures of many samples. Prints
//! tables and, with `--record FILE`, writes them there. `--help` lists the options.
//!
//! Everything is measured on what a display shows: radiance times 2^EV, the EV that brings the first reference to
//! middle grey, through the tone map, cut off at 0 and 1, linear. *RMSE* is over pixels and channels, *FLIP* the mean,
//! *temporal error* the root of the mean squared error over all frames of the steady state, *flicker* the mean over
//! pixels, channels and these frames of |(A[k] - A[k-1]) - (R[k] - R[k-1])|: how far the change of the picture A is
//! from the change of the reference R. The steady state is the last frames of the walk.

mod measures;
mod references;
mod report;

use brickwalk::frame::{Guides, Renderer};
use brickwalk::picture::denoise::{Denoiser, Taa};
use brickwalk::picture::exposure::{Exposure, Meter};
use brickwalk::picture::tone_map::ToneMap;
use brickwalk::scene::Camera;
use brickwalk::scene::path::CameraPath;
use clap::Parser;
use measures::{Display, Shown};
use references::{Picture, References, mean, renderer};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Frames of which the tables have rows, from 1.
const ROWS: [usize; 5] = [1, 2, 4, 8, 16];

/// Measures the denoiser along a camera path against pictures of many samples, on the processor
#[derive(Parser)]
pub struct Options {
    /// The scene
    #[arg(long, value_name = "S.bricks")]
    scene: PathBuf,
    /// The camera path
    #[arg(long, value_name = "P.json")]
    path: PathBuf,
    /// Time of the path at the first frame, seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0)]
    start: f64,
    /// Frames a second of the path's time
    #[arg(long, value_name = "N", default_value_t = 30.0)]
    fps: f64,
    /// Frames, 2 to 1000, more than those of the steady state
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(2..=1000))]
    frames: u32,
    /// Frames of the steady state, the last ones
    #[arg(long, value_name = "N", default_value_t = 4)]
    steady: usize,
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", default_value = "160x90")]
    size: String,
    /// Effects and light: options of walk in one argument
    #[arg(long, value_name = "OPTIONS", default_value = "--effects shadow,diffuse", allow_hyphen_values = true)]
    light: String,
    /// Diffuse rays a pixel of the noisy frames, 1 to 1024
    #[arg(long, value_name = "N", default_value_t = 1)]
    rays: u32,
    /// Samples a pixel of references, an even number from 2
    #[arg(long, value_name = "N", default_value_t = 1024)]
    spp: u32,
    /// Diffuse rays a sample of references, 1 to 1024
    #[arg(long, value_name = "N", default_value_t = 1)]
    reference_rays: u32,
    /// Folder of references, which are kept there and not made twice
    #[arg(long, value_name = "DIR")]
    references: PathBuf,
    /// Effects and light after a jump of the light: options of walk in one argument [default: no jump]
    #[arg(long, value_name = "OPTIONS", allow_hyphen_values = true)]
    moved_light: Option<String>,
    /// Only make references
    #[arg(long)]
    only_references: bool,
    /// Tone map: none, agx, aces, reinhard
    #[arg(long, value_name = "NAME", default_value = "agx")]
    tone_map: String,
    /// Seed of the noisy frames
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u32,
    /// Write the last frame's pictures there
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// Write the tables there
    #[arg(long, value_name = "FILE.md")]
    record: Option<PathBuf>,
    #[arg(long, hide = true)]
    bench: bool,
}

impl Options {
    /// Width and height, pixels.
    fn size(&self) -> (u32, u32) {
        let (width, height) = self.size.split_once('x').expect("--size is WxH");
        (width.parse().expect("a width"), height.parse().expect("a height"))
    }
}

/// What is done to frames of one sample.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Way {
    Noisy,
    Taa,
    /// The control: the filter without a history.
    Alone,
    Denoised,
    Both,
}

impl Way {
    const ALL: [Self; 5] = [Self::Noisy, Self::Taa, Self::Alone, Self::Denoised, Self::Both];

    fn name(self) -> &'static str {
        match self {
            Self::Noisy => "noisy",
            Self::Taa => "--taa",
            Self::Alone => "no history",
            Self::Denoised => "--denoise",
            Self::Both => "--denoise --taa",
        }
    }
}

/// What goes on from frame to frame.
#[derive(Default)]
struct Going {
    denoiser: Denoiser,
    both: Denoiser,
    after: Taa,
    taa: Taa,
}

/// A frame at a camera, in every way; pixels that the denoiser had no history of.
struct Frame {
    pictures: [Picture; 5],
    new: Vec<bool>,
}

fn frame(renderer: &mut Renderer, jittered: &mut Renderer, going: &mut Going, k: u32, camera: &Camera) -> Frame {
    let rendered = |renderer: &mut Renderer| -> (Guides, Picture) {
        let output = renderer.frame(k, camera).expect("a frame");
        (output.guides.expect("guides were asked for"), output.pixels.radiance)
    };
    let (guides, noisy) = rendered(renderer);
    let (moved_guides, moved) = rendered(jittered);
    let mut alone = noisy.clone();
    Denoiser::default().frame(guides.clone(), &mut alone);
    let mut denoised = noisy.clone();
    let is_hit: Vec<bool> = guides.seen.iter().map(|seen| seen.is_hit()).collect();
    going.denoiser.frame(guides, &mut denoised);
    let past = &going.denoiser.past(1);
    let new = past.iter().zip(&is_hit).map(|(past, hit)| *hit && past.length <= 1.0).collect();
    let mut taa = moved.clone();
    going.taa.frame(&moved_guides, &mut taa);
    let mut both = moved;
    going.both.frame(moved_guides.clone(), &mut both);
    going.after.frame(&moved_guides, &mut both);
    Frame { pictures: [noisy, taa, alone, denoised, both], new }
}

/// A walk, shown: of every frame the pictures in every way, of those that are measured the reference and the halves of
/// its samples.
pub struct Walk {
    pictures: Vec<[Shown; 5]>,
    truth: BTreeMap<usize, Shown>,
    halves: BTreeMap<usize, [Shown; 2]>,
}

/// What is left of a change after some frames: errors of `--denoise` and `--denoise --taa` over what changed.
pub struct Change {
    name: String,
    pixels: usize,
    /// At once, after four frames, after ten, and what the same pixels have without the change.
    errors: [[f64; 4]; 2],
}

fn main() {
    let options = Options::parse();
    let path = CameraPath::read(&options.path).expect("the path");
    let camera = |k: u32| path.at(options.start + f64::from(k) / options.fps);
    let mut references = References::new(&options, &options.light);
    let mut moved_references = options.moved_light.as_ref().map(|light| References::new(&options, light));
    let last = options.frames - 1;
    let frames = options.frames as usize;
    let measured = |k: &usize| ROWS.contains(&(k + 1)) || *k + 1 + options.steady >= frames;
    let halves: BTreeMap<usize, [Picture; 2]> =
        (0..frames).filter(measured).map(|k| (k, references.halves(k as u32, &camera(k as u32)))).collect();
    let moved_truth = moved_references.as_mut().map(|references| references.picture(last, &camera(last)));
    if options.only_references {
        return;
    }
    let tone_map: ToneMap = options.tone_map.parse().expect("a tone map");
    let stops = Meter::new(Exposure::AUTO, tone_map.white()).stops(&mean(&halves[&0][0], &halves[&0][1]), &[], 0.0);
    let display = Display { stops, tone_map, size: options.size() };

    let words = |light: &str| format!("{light} --diffuse-rays {} --seed {} --denoise", options.rays, options.seed);
    let make =
        |light: &str| [renderer(&options, &words(light)), renderer(&options, &format!("{} --taa", words(light)))];
    let [mut noisy, mut jittered] = make(&options.light);
    let mut going = Going::default();
    let mut walk = Walk {
        pictures: Vec::new(),
        truth: halves.iter().map(|(k, [a, b])| (*k, display.show(&mean(a, b)))).collect(),
        halves: halves.iter().map(|(k, halves)| (*k, halves.each_ref().map(|half| display.show(half)))).collect(),
    };
    for k in 0..options.frames {
        let frame = frame(&mut noisy, &mut jittered, &mut going, k, &camera(k));
        walk.pictures.push(frame.pictures.map(|picture| display.show(&picture)));
    }

    let mut changes = Vec::new();
    let shown = |frame: &Frame| [Way::Denoised, Way::Both].map(|way| display.show(&frame.pictures[way as usize]));
    // Still, until histories are long, at either end of the walk; then at its last frame. What either lacks is new
    // there.
    let (mut still, mut jump) = (Going::default(), Going::default());
    let (mut steady, mut after, mut new) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..24 + 10 {
        let whence = if k < 24 { 0 } else { last };
        let of_jump = frame(&mut noisy, &mut jittered, &mut jump, k, &camera(whence));
        steady = shown(&frame(&mut noisy, &mut jittered, &mut still, k, &camera(last))).to_vec();
        if k == 24 {
            new = of_jump.new.clone();
        }
        if k >= 24 {
            after.push(shown(&of_jump));
        }
    }
    changes.push(change("a step".into(), &after, &steady, &walk.truth[&(last as usize)], &new));
    if let (Some(light), Some(truth)) = (&options.moved_light, &moved_truth) {
        let [mut noisy_after, mut jittered_after] = make(light);
        let (mut still, mut jump) = (Going::default(), Going::default());
        after.clear();
        for k in 0..24 + 10 {
            let here = camera(last);
            let settled = frame(&mut noisy_after, &mut jittered_after, &mut still, k, &here);
            let moved = if k < 24 {
                frame(&mut noisy, &mut jittered, &mut jump, k, &here)
            } else {
                frame(&mut noisy_after, &mut jittered_after, &mut jump, k, &here)
            };
            steady = shown(&settled).to_vec();
            if k >= 24 {
                after.push(shown(&moved));
            }
        }
        let truth = display.show(truth);
        let which: Vec<bool> =
            measures::errors(&walk.truth[&(last as usize)], &truth).iter().map(|error| *error > 0.05).collect();
        changes.push(change("the sun's jump".into(), &after, &steady, &truth, &which));
    }
    let text = report::text(&options, &display, &walk, &changes);
    print!("{text}");
    if let Some(file) = &options.record {
        brickwalk::output::atomic::write(file, text.as_bytes()).expect("the results");
    }
    if let Some(folder) = &options.pictures {
        report::pictures(folder, &display, &walk);
    }
}

fn change(name: String, after: &[[Shown; 2]], steady: &[Shown], truth: &Shown, which: &[bool]) -> Change {
    let over = |picture: &Shown| {
        let errors = measures::errors(picture, truth);
        measures::average(errors.into_iter().zip(which).filter(|(_, which)| **which).map(|(error, _)| error))
    };
    let errors =
        [0, 1].map(|way| [over(&after[0][way]), over(&after[3][way]), over(&after[9][way]), over(&steady[way])]);
    Change { name, pixels: which.iter().filter(|which| **which).count(), errors }
}
