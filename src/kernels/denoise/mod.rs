//! The denoiser's kernels, their buffers, and the order in which they filter a frame; [`crate::picture::denoise`] says
//! what they are for. The twins need no executor: [`Twins`] runs them where pictures lie on the host.

mod advance;
mod begin;
mod buffers;
mod filter;
mod grid;
mod join;
mod steady;
mod vary;

pub use advance::push;
pub use buffers::{BUFFERS, LAYERS, LEAST_ALBEDO, TALLIES};
pub use grid::{difference, mixed, squared};
pub use vary::variance_of_mean;

use super::bound::Bound;
use super::layout::{DenoiseGiven, DenoiseLit, DenoiseOwn, DenoisePast, DenoiseSecond, DenoiseSeen};
use super::table::{Family, FamilyBuffer, Target, words};
use crate::kernels;
use crate::schedule::{ExecutorError, Over, Own};
use buffers::Buffers;

/// Levels of the filter; the pixels of level k are 2^k apart.
pub const LEVELS: u32 = 5;
/// Columns and rows of a workgroup's pixels.
const GROUP: u32 = 8;

kernels! {
    /// The kernels.
    static KERNELS, names;

    denoise_begin: "denoise/denoise_begin" Own [] |b, t| twin(names::denoise_begin, b, t);
    denoise_advance: "denoise/denoise_advance" Own [] |b, t| twin(names::denoise_advance, b, t);
    denoise_steady: "denoise/denoise_steady" Own [] |b, t| twin(names::denoise_steady, b, t);
    denoise_vary: "denoise/denoise_vary" Own [] |b, t| twin(names::denoise_vary, b, t);
    denoise_filter: "denoise/denoise_filter" Own [] |b, t| twin(names::denoise_filter, b, t);
    denoise_join: "denoise/denoise_join" Own [] |b, t| twin(names::denoise_join, b, t);
}

/// Number of the buffer of what pixels show.
pub const SEEN: usize = 0;
/// Of what they are given beside that.
pub const GIVEN: usize = 1;
/// Of second surfaces.
pub const SECONDS: usize = 2;
/// Of histories.
pub const PAST: usize = 3;
/// Of the picture.
pub const PICTURE: usize = 6;
/// Of what is counted.
pub const TALLY: usize = 7;

/// The kernels and their buffers.
pub static FAMILY: Family = Family {
    name: "denoise",
    what: "what denoising keeps",
    remedy: "give a smaller --size, or leave out --denoise",
    has_lamps: false,
    buffers: &[
        FamilyBuffer { name: "seen", stride: size_of::<DenoiseSeen>(), is_written: false },
        FamilyBuffer { name: "given", stride: size_of::<DenoiseGiven>(), is_written: false },
        FamilyBuffer { name: "seconds", stride: size_of::<DenoiseSecond>(), is_written: false },
        FamilyBuffer { name: "past", stride: size_of::<DenoisePast>(), is_written: true },
        FamilyBuffer { name: "known", stride: size_of::<DenoisePast>(), is_written: true },
        FamilyBuffer { name: "lit", stride: size_of::<DenoiseLit>(), is_written: true },
        FamilyBuffer { name: "picture", stride: 16, is_written: true },
        FamilyBuffer { name: "tally", stride: 4, is_written: true },
    ],
    kernels: KERNELS,
};

/// Elements of each buffer for a picture of so many pixels, of which `seconds` show a second surface.
pub fn elements(pixels: usize, seconds: usize) -> [usize; BUFFERS] {
    [pixels, pixels, seconds, LAYERS * pixels, LAYERS * pixels, 2 * LAYERS * pixels, pixels, TALLIES]
}

/// Bytes that the buffers take for a pixel that shows a second surface.
pub fn bytes_a_pixel() -> u64 {
    let of = |(count, buffer): (usize, &FamilyBuffer)| count as u64 * buffer.stride as u64;
    elements(1, 1).into_iter().zip(FAMILY.buffers).filter(|(_, buffer)| buffer.name != "tally").map(of).sum()
}

/// How a layer is filtered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Kind {
    /// The neighbourhood from which variance is taken where it is not of the pixel alone, pixels to each side.
    radius: i32,
    /// Standard deviations of colour that the filter takes as alike (σ_l of the paper).
    tolerance: f32,
    /// Whether most of a pixel's samples may find nothing and a few much: then single pixels may be far brighter than
    /// what they stand for, and those that are black are not for that certain to be. The neighbourhood's samples tell
    /// the variance of each.
    is_sparse: bool,
}

impl Kind {
    /// The light of lamps: most of its variance in a neighbourhood is that of the edges of shadows, which are to stay,
    /// so that the variance over frames is taken as soon as there is one. Its samples are bounded by what shines: there
    /// are no fireflies.
    pub const LAMPS: Self = Self { radius: 1, tolerance: 1.0, is_sparse: false };
    /// All other light, the environment's among it.
    pub const OTHER: Self = Self { radius: 3, tolerance: 4.0, is_sparse: true };
}

/// The kernels that filter a frame of so many columns and rows, in their order. `remembers`: there is a history.
pub fn steps([width, height]: [u32; 2], remembers: bool) -> Vec<Own> {
    let over = Over::Groups(width.div_ceil(GROUP) * height.div_ceil(GROUP));
    let frame = DenoiseOwn { width, height, remembers: remembers.into(), ..DenoiseOwn::default() };
    let step = |kernel, own: DenoiseOwn| Own::new(kernel, &own).over(over);
    let mut steps = vec![step(names::denoise_begin, frame)];
    for (layer, kind) in (0..).zip([Kind::LAMPS, Kind::OTHER]) {
        let Kind { radius, tolerance, is_sparse } = kind;
        let own = DenoiseOwn { layer, radius, tolerance, sparse: is_sparse.into(), ..frame };
        steps.extend([names::denoise_advance, names::denoise_steady, names::denoise_vary].map(|name| step(name, own)));
        steps.extend((0..LEVELS).map(|level| step(names::denoise_filter, DenoiseOwn { level, ..own })));
    }
    steps.push(step(names::denoise_join, frame));
    steps
}

/// What a row of the table runs.
fn twin(kernel: &str, bound: &Bound, target: &mut Target) -> Result<(), ExecutorError> {
    words(target.buffers).map(|words| run(kernel, bound.own(), words))
}

/// Runs the twin of a kernel.
fn run(kernel: &str, own: &DenoiseOwn, words: [&mut [u32]; BUFFERS]) {
    let mut buffers = Buffers::new(own, words);
    match kernel {
        names::denoise_begin => begin::begin(own, &mut buffers),
        names::denoise_advance => advance::advance(own, &mut buffers),
        names::denoise_steady => steady::steady(own, &mut buffers),
        names::denoise_vary => vary::vary(own, &mut buffers),
        names::denoise_filter => filter::filter(own, &mut buffers),
        _ => join::join(own, &mut buffers),
    }
}

/// The twins with buffers of their own, for pictures that no executor filters.
#[derive(Clone, Debug, Default)]
pub struct Twins {
    buffers: [Vec<u32>; BUFFERS],
}

impl Twins {
    /// Makes room for so many elements in each buffer; one that has room keeps what it holds.
    pub fn reserve(&mut self, elements: &[usize]) {
        for ((buffer, words), &count) in FAMILY.buffers.iter().zip(&mut self.buffers).zip(elements) {
            let needed = (count * buffer.stride).div_ceil(4);
            if words.len() < needed {
                words.clear();
                words.resize(needed, 0);
            }
        }
    }

    /// Writes into a buffer, for which there is room.
    pub fn write(&mut self, buffer: usize, bytes: &[u8]) {
        bytemuck::cast_slice_mut(&mut self.buffers[buffer])[..bytes.len()].copy_from_slice(bytes);
    }

    /// The words of a buffer.
    pub fn words(&mut self, buffer: usize) -> &mut [u32] {
        &mut self.buffers[buffer]
    }

    /// Runs kernels.
    pub fn run(&mut self, steps: &[Own]) {
        for Own { kernel, block, .. } in steps {
            let own = bytemuck::from_bytes(&bytemuck::bytes_of(block)[..size_of::<DenoiseOwn>()]);
            run(kernel, own, self.buffers.each_mut().map(Vec::as_mut_slice));
        }
    }
}
