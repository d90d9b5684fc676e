//! What an executor is set up for, and what it is told of every frame.

use super::frame::Frame;
use super::layout::Params;
use crate::schedule::{Lamp, Pass};

/// Size of the picture, or of the block of rays, in rays, and the tiles over it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// Rays per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Edge of a tile in rays.
    pub tile: u32,
}

impl Extent {
    /// Number of rays.
    pub fn rays(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Tiles per row.
    pub fn tiles_x(&self) -> u32 {
        self.width.div_ceil(self.tile)
    }

    /// Number of tiles.
    pub fn tiles(&self) -> u32 {
        self.tiles_x() * self.height.div_ceil(self.tile)
    }

    /// Its first rows, as many as hold so many rays; all of it for `None`.
    pub fn first(&self, rays: Option<usize>) -> Self {
        let rows = rays.map_or(self.height, |rays| rays.div_ceil(self.width as usize).try_into().unwrap_or(u32::MAX));
        Self { height: rows.clamp(1, self.height), ..*self }
    }
}

/// How an executor is set up.
#[derive(Clone, Copy, Debug)]
pub struct Setup {
    /// Picture and tiles.
    pub extent: Extent,
    /// A (tile, leaf) query with at most so many rays is not visible; 0 is exact.
    pub threshold: u32,
    /// Count nodes and triangles visited (slower).
    pub count: bool,
    /// Every triangle stops every ray, whatever its alpha.
    pub opaque: bool,
    /// Triangles are hidden from the start, or soon ([`super::FrameExecutor::set_hidden`]).
    pub hides: bool,
    /// Bytes that may be taken beside the cache for resident bricks in a form that takes less time
    /// ([`super::flat`]); of the processor alone.
    pub flat_bytes: u64,
    /// What is kept though the scene does not need it.
    pub keep: Keep,
}

/// What is kept though a scene does not need it, to measure what leaving it out saves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Keep {
    /// Queries for missing bricks where the cache holds all.
    pub queries: bool,
    /// The kernel that looks textures up.
    pub textures: bool,
    /// Alpha tests in traversal.
    pub opacity: bool,
    /// Reflections other than diffuse ones.
    pub gloss: bool,
}

impl Keep {
    /// Whether `other` has all that is kept.
    pub fn is_part_of(self, other: Self) -> bool {
        let fields = |keep: Self| [keep.queries, keep.textures, keep.opacity, keep.gloss];
        fields(self).into_iter().zip(fields(other)).all(|(own, other)| other || !own)
    }
}

/// What of an executor may change between submissions.
#[derive(Clone, Copy, Debug)]
pub struct Tuning {
    /// [`Setup::threshold`].
    pub threshold: u32,
    /// The most leaves of a list of [`crate::schedule::Step::ShortLists`], for every pass; with 0 all rays walk from
    /// the root.
    pub list_most: u32,
}

impl Tuning {
    /// As an executor is set up: lists bounded by their passes alone.
    pub fn new(setup: &Setup) -> Self {
        Self { threshold: setup.threshold, list_most: u32::MAX }
    }
}

/// The directions of the passes that start at hits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Directions {
    /// Occlusion rays a pixel and sample.
    pub occlusion: u32,
    /// Their length, device units.
    pub occlusion_length: f32,
    /// Diffuse rays a pixel and sample.
    pub diffuse: u32,
    /// Greatest random turn about the normal, radians.
    pub turn: f32,
    /// Every pixel has directions of its own, all over the hemisphere: what filters over pixels and frames needs, and
    /// means over few directions that are to be right.
    pub scatter: bool,
    /// What surfaces reflect otherwise than diffusely comes by rays of its own, too.
    pub glossy: bool,
    /// Bodies that refract bend light.
    pub refracts: bool,
    /// Diffuse rays bring the environment's light as well as rays to it; of an even one, they alone.
    pub shares: bool,
    /// Directions to the environment are drawn by the cosine alone.
    pub even: bool,
    /// What levels of detail are selected by.
    pub lod: Lod,
}

/// What levels of detail are selected by: a ray takes those whose error is no more than `pixels` times the width of its
/// cone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lod {
    /// Tolerance in widths of a ray's cone; 0: none, rays take bricks alone.
    pub pixels: f32,
    /// Rays choose at random between two levels, instead of all changing at one distance.
    pub blend: bool,
    /// Angle of a pixel, radians.
    pub angle: f32,
    /// Rays are given: each starts without width, wherever that is.
    pub given: bool,
}

/// Share of a squared width that blending takes off at most: levels blend over a factor of 2 in distance.
const BLEND: f32 = 0.75;

/// Angle that rays around a hit stand for, radians: what a cosine-weighted ray of a hundred does.
const AROUND: f32 = 0.18;

impl Lod {
    /// [`Params::levels`] of the rays of a pass, under a sun with such a tangent of its angular radius.
    pub fn params(&self, pass: Pass, sun_radius: f32) -> [f32; 4] {
        let Self { pixels, blend, angle, given } = *self;
        if pixels == 0.0 {
            return [0.0; 4];
        }
        let spread = match pass {
            // Rays of gloss, and those of paths, each spread by what they were drawn by.
            Pass::Primary | Pass::Glossy | Pass::Path(_) => angle,
            Pass::Shadow(lamp) | Pass::BounceShadow(lamp) | Pass::PathShadow(lamp) => match lamp {
                Lamp::Emitter => angle,
                Lamp::Sun => angle.max(2.0 * sun_radius),
                Lamp::Environment => AROUND,
            },
            Pass::Occlusion(_) | Pass::Diffuse(_) => AROUND,
        };
        let square = |angle: f32| (pixels * angle) * (pixels * angle);
        [
            if given { 0.0 } else { square(angle) },
            square(angle.max(spread)),
            pixels * pixels,
            if blend { BLEND } else { 0.0 },
        ]
    }
}

/// What a frame needs to know besides the scene.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Reference point.
    pub frame: Frame,
    /// Fields of [`Params`] that the view sets: camera, lights, sample, seed, jitter.
    pub params: Params,
    /// Directions of the passes that start at hits.
    pub directions: Directions,
    /// Rays of its passes, from outside, where they are fewer than the extent holds: kernels then run over the rows
    /// that hold them, and nothing of others can be read.
    pub rays: Option<usize>,
}
