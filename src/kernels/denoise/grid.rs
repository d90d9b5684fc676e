//! Pixels and their neighbours, surfaces, colours: twin of `shaders/denoise/denoise.wgsl`.

use crate::kernels::layout::{DenoiseOwn, DenoiseSecond, DenoiseSeen, NONE};
use crate::math::exact::{divide, square_root};
use rayon::prelude::*;

/// Pixels of a neighbourhood that tell whether light has changed.
pub const FEWEST: u32 = 5;

/// The pixels of a picture, by rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    width: i32,
    height: i32,
}

impl Grid {
    /// Of the picture that a kernel is told.
    pub fn new(own: &DenoiseOwn) -> Self {
        // Pictures have at most 16384 pixels a side.
        Self { width: own.width as i32, height: own.height as i32 }
    }

    /// How many there are.
    pub fn pixels(self) -> usize {
        self.width as usize * self.height as usize
    }

    /// The pixel at a column and a row, if it is in the picture.
    pub fn at(self, x: i32, y: i32) -> Option<usize> {
        let is_inside = (0..self.width).contains(&x) && (0..self.height).contains(&y);
        is_inside.then(|| y as usize * self.width as usize + x as usize)
    }

    /// Column and row of a pixel.
    pub fn position(self, pixel: usize) -> (i32, i32) {
        ((pixel % self.width as usize) as i32, (pixel / self.width as usize) as i32)
    }

    /// The pixels at most `radius` columns and rows from `pixel`, itself among them, row by row.
    pub fn around(self, pixel: usize, radius: i32) -> impl Iterator<Item = usize> {
        let (x, y) = self.position(pixel);
        let rows = (y - radius).max(0)..=(y + radius).min(self.height - 1);
        let columns = (x - radius).max(0)..=(x + radius).min(self.width - 1);
        rows.flat_map(move |y| columns.clone().map(move |x| y as usize * self.width as usize + x as usize))
    }
}

/// Writes what `make` gives for each pixel, which it must do from the pixel alone.
pub fn each<T: Send>(to: &mut [T], make: impl Fn(usize, &mut T) + Sync + Send) {
    to.par_iter_mut().enumerate().with_min_len(256).for_each(|(pixel, to)| make(pixel, to));
}

/// The scalar product.
pub fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Luminance of linear Rec. 709.
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r + 0.7152 * g + 0.0722 * b
}

/// The square of a colour, or of a difference of colours: of greys that of their luminance. Channels count for what
/// they do in that.
pub fn squared([r, g, b]: [f32; 3]) -> f32 {
    0.2126 * r * r + 0.7152 * g * g + 0.0722 * b * b
}

/// The root of [`squared`]. Unlike luminance it tells colours apart, and sees what is bright in one channel alone.
pub fn size(c: [f32; 3]) -> f32 {
    square_root(squared(c))
}

/// a - b.
pub fn difference(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|k| a[k] - b[k])
}

/// a + b.
pub fn sum(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|k| a[k] + b[k])
}

/// `a` on the way to `b` by the share `t`; `b` at 1.
pub fn mixed_number(a: f32, b: f32, t: f32) -> f32 {
    if t >= 1.0 { b } else { a + t * (b - a) }
}

/// The same of colours.
pub fn mixed(a: [f32; 3], b: [f32; 3], t: f32) -> [f32; 3] {
    [0, 1, 2].map(|k| mixed_number(a[k], b[k], t))
}

/// A colour by a number.
pub fn divided(a: [f32; 3], b: f32) -> [f32; 3] {
    a.map(|x| divide(x, b))
}

/// Whether a number is finite, with room for a square of its own.
pub fn is_sound(x: f32) -> bool {
    x.to_bits() & 0x7fff_ffff < 0x7e80_0000
}

/// Distance of `point` from the plane of `a`, world units.
pub fn off_plane(a: &DenoiseSeen, point: [f32; 3]) -> f32 {
    dot(difference(point, a.point), a.plane).abs()
}

fn is_same_surface(a: &DenoiseSeen, id: u32, normal: [f32; 3], point: [f32; 3]) -> bool {
    if a.id == NONE || id == NONE {
        return false;
    }
    let is_near = || off_plane(a, point) <= 2.0 * a.footprint.max(f32::MIN_POSITIVE);
    a.id == id || (dot(a.normal, normal) > 0.9 && is_near())
}

/// Whether two pixels show one surface: the same triangle, or normals within 26 degrees and planes within two pixels.
pub fn is_same(a: &DenoiseSeen, b: &DenoiseSeen) -> bool {
    is_same_surface(a, b.id, b.normal, b.point)
}

/// Whether a pixel shows the second surface of another.
pub fn is_second(a: &DenoiseSeen, b: &DenoiseSecond) -> bool {
    is_same_surface(a, b.id, b.normal, b.point)
}

impl DenoiseSeen {
    /// Whether a surface was seen.
    pub fn is_hit(&self) -> bool {
        self.id != NONE
    }
}
